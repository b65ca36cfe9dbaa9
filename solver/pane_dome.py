"""Light of sky, ground and sun on receivers of a scene with panes.

What comes through panes is integrated over them (`kernels.glazed_dome`); what passes none of them
is that of the dome with the panes taken for walls (`clear_dome`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .budget import Budget
from .clear_dome import ClearDome
from .dome import LEVELS, ROWS_PER_BLOCK, sun_cells
from .kernels.glazed_dome import (
    COLUMNS,
    GROUND,
    GROUND_FACTOR,
    GROUND_VARIANCE,
    SKY,
    SKY_FACTOR,
    SKY_VARIANCE,
    glazed_rows,
)
from .kernels.panes import Panes
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .model.bezier import bernstein
from .model.scene import SceneData
from .model.sky import CIESky, Sun
from .panes import shares_through
from .skies import ground_luminance, sky_tone
from .sun_disc import DiscLight
from .surfaces import Receivers
from .topology import PLANAR, writable

#: Change of what panes let through that does not matter, as a form factor, against that below which
#: partly hidden cells of the sky are sampled.
TOLERANCE = 0.25
#: How often a pane is quartered at most.
QUARTERINGS = 7
#: Points of the sun's disc, a direction of each quarter, at which the share let through is taken.
DISC_POINTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Daylight:
    """Light from outside on m receivers, with no colour.

    Attributes
    ----------
    illuminance : dict of (m,) arrays
        By ``"sky"``, ``"sun"``, ``"ground"``. [lx]
    variance : (m,) array
        Of what was sampled. [lx²]
    outside, outside_variance : (m,) array
        Form factor of sky and ground with nothing in place of the panes, and its variance.
    """

    illuminance: dict[str, FloatArray]
    variance: FloatArray
    outside: FloatArray
    outside_variance: FloatArray


class PaneDome:
    """Light from outside in one scene with panes.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    panes : Panes
        These.
    blockers, walls : Blockers
        What hides light, without and with the panes.
    trace : bool
        Whether the blockers hide anything.
    """

    def __init__(
        self, scene: SceneData, panes: Panes, blockers: Blockers, walls: Blockers, *, trace: bool
    ) -> None:
        self.scene, self.panes, self.trace = scene, panes, trace
        self.blockers, self.walls = blockers, walls
        self.clear = ClearDome(scene, walls)
        self.disc, self.beside = DiscLight(blockers, trace=trace), DiscLight(walls, trace=True)
        low, high = scene.patches.bounds()
        self.lift = 1e-9 * float(np.linalg.norm(high - low))
        first = scene.opaque_count
        self._flat = writable(walls.flags[first:] & PLANAR != 0, np.bool_)
        nets = walls.nets[first:]
        points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
        over = np.einsum(
            "pk,pqik->pqi", walls.cones[first:, :3], points[None] - points[:, None, :1]
        )
        self._ranges = np.stack([over.min(axis=2), over.max(axis=2)], axis=2)

    def light(
        self,
        receivers: Receivers,
        budget: Budget,
        tell: Callable[[int, int], None],
        *,
        on_elements: bool,
    ) -> Daylight:
        """Light of all there is outside.

        Parameters
        ----------
        receivers : Receivers
            m receivers.
        on_elements : bool
            Whether they are many, whose errors average: what passes no pane is then seen by
            meridians, and else by pyramids, where curved surfaces are in its way.
        """
        scene, m = self.scene, len(receivers.nodes)
        found: dict[str, FloatArray] = {}
        variance, outside, spread = np.zeros((3, m))
        cell_eps = budget.cell_eps if on_elements else budget.sensor_dome_cell_eps
        level = ground_luminance(scene.ground, scene.sky, scene.sun)
        if scene.sky is not None or level > 0.0:
            through = self._through(receivers, budget.eps, cell_eps, tell)
            clear = self.clear.light(receivers, budget, on_elements=on_elements)
            for name, own, luminance in (
                ("sky", clear.sky, 1.0 if scene.sky is not None else 0.0),
                ("ground", clear.ground.times(level), level),
            ):
                if luminance == 0.0:
                    continue
                sky = name == "sky"
                scale = np.pi * luminance
                found[name] = own.illuminance + scale * through[:, SKY if sky else GROUND]
                variance += own.deviation**2
                variance += scale**2 * through[:, SKY_VARIANCE if sky else GROUND_VARIANCE]
                outside += own.factor + through[:, SKY_FACTOR if sky else GROUND_FACTOR]
                spread += own.factor_variance
        if scene.sun is not None:
            sun, own_variance = self._sun(receivers, budget, scene.sun)
            found["sun"] = sun
            variance += own_variance
        order = [name for name in ("sky", "sun", "ground") if name in found]
        return Daylight({name: found[name] for name in order}, variance, outside, spread)

    def _through(
        self, receivers: Receivers, eps: float, cell_eps: float, tell: Callable[[int, int], None]
    ) -> FloatArray:
        """What comes through panes (m, COLUMNS); see `kernels.glazed_dome`."""
        sky = self.scene.sky
        tone = sky_tone(CIESky(5, zenith_luminance_cd_m2=1.0) if sky is None else sky)
        out = np.zeros((len(receivers.nodes), COLUMNS))
        for start in range(0, len(out), ROWS_PER_BLOCK):
            rows = slice(start, min(start + ROWS_PER_BLOCK, len(out)))
            glazed_rows(
                writable(receivers.nodes[rows]),
                writable(receivers.normals[rows]),
                writable(receivers.weights[rows]),
                self.panes,
                self.scene.opaque_count,
                self._ranges,
                self._flat,
                tone,
                self.walls,
                eps,
                cell_eps,
                TOLERANCE * cell_eps,
                LEVELS,
                QUARTERINGS,
                self.lift,
                out[rows],
            )
            tell(rows.stop, len(out))
        return out

    def _sun(self, receivers: Receivers, budget: Budget, sun: Sun) -> tuple[FloatArray, FloatArray]:
        """Illuminance (m,) of the sun [lx], and the variance of what was sampled.

        The share of the disc that panes cover is that which walls in their place would hide.
        """
        m, q = receivers.weights.shape
        # Each node by itself: what it gets through panes depends on where it is.
        used = np.flatnonzero(receivers.weights.ravel() > 0.0)
        nodes, normals = (a.reshape(-1, 3)[used] for a in (receivers.nodes, receivers.normals))
        plain, clear = (
            disc.at(nodes, normals, sun, budget.sun_cell_eps) for disc in (self.disc, self.beside)
        )
        behind = np.maximum(plain.illuminance - clear.illuminance, 0.0)
        rows = np.flatnonzero(behind > 0.0)
        share = np.zeros(len(used))
        share[rows] = self._disc_share(nodes[rows], sun_cells(sun))
        light, variance = np.zeros((2, m * q))
        light[used] = np.minimum(clear.illuminance, plain.illuminance) + share * behind
        variance[used] = np.maximum(plain.deviation, clear.deviation) ** 2
        weights = receivers.weights
        return (
            np.asarray((weights * light.reshape(m, q)).sum(axis=1)),
            np.asarray((weights**2 * variance.reshape(m, q)).sum(axis=1)),
        )

    def _disc_share(self, points: FloatArray, cells: FloatArray) -> FloatArray:
        """Mean share (m,) that panes leave of the sun's disc where they cover it."""
        t = (np.arange(DISC_POINTS) + 0.5) / DISC_POINTS
        # u runs from the rim to the centre: parts of equal area.
        u, v = (g.ravel() for g in np.meshgrid(1.0 - np.sqrt(t), t, indexing="ij"))
        d = np.einsum("si,sj,cijk->csk", bernstein(u), bernstein(v), cells[..., :3]).reshape(-1, 3)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        total, met = np.zeros((2, len(points)))
        for direction in d:
            share, first = shares_through(
                self.panes, points, np.broadcast_to(direction, points.shape), t_min=self.lift
            )
            total += np.where(first >= 0, share, 0.0)
            met += first >= 0
        # A sliver that no point lies in: as if there were no pane.
        return np.asarray(np.where(met > 0.0, total / np.maximum(met, 1.0), 1.0))
