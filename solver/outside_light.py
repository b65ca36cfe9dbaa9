"""Light of sky and ground at receivers: exact past flat surfaces, traced past curved ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .dome import DomeLight, dome_cells, gather, patch_cells
from .errors import NumericsError
from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .kernels.sky_sweep import sweep_rows
from .model.arrays import FloatArray, IntArray
from .model.patch_sky import PatchSky
from .model.sky import Sky
from .skies import sky_tone
from .surfaces import Receivers
from .topology import writable

#: Sectors of azimuth, those of the cells of the dome, and receivers per kernel call.
SECTORS, ROWS_PER_BLOCK = 8, 64
#: Patches in a scene up to which the light of sky and ground is told exactly on elements too.
PLAIN = 100
#: Sine of the angle by which a side is off a straight line, up to rounding.
_STRAIGHT = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class OutsideLight:
    """What receivers get of sky and ground.

    Attributes
    ----------
    sky, ground : DomeLight
        The ground's illuminance is that of luminance 1 cd/m².

    left : (m,) bool array
        Receivers of which some directions were left out.
    """

    sky: DomeLight
    ground: DomeLight
    left: NDArray[np.bool_]


class Horizon:
    """What may hide sky and ground.

    Parameters
    ----------
    blockers : Blockers
        The patches of the scene as obstacles.
    trace : bool
        Whether anything can hide anything.
    """

    def __init__(self, blockers: Blockers, *, trace: bool) -> None:
        self.blockers, self.trace = blockers, trace
        #: Whether little enough hides them to look for the nodes of all elements.
        self.is_plain = len(blockers.nets) <= PLAIN
        self._planar = np.ascontiguousarray(blockers.flags & PLANAR != 0)
        self._curvy = curved_sides(blockers.nets)

    def light(
        self,
        receivers: Receivers,
        sky: Sky | None,
        *,
        ground: bool = True,
        eps: float,
        cell_eps: float | None,
        progress: Callable[[int, int], None] | None = None,
    ) -> OutsideLight:
        """Light of ``sky``, and of a ground of luminance 1, on receivers.

        Parameters
        ----------
        receivers : Receivers
            Their nodes and normals.
        sky : Sky or None
            The sky; with None its luminance is 1. [cd/m²]
        ground : bool
            Whether the ground is asked for, too.
        eps : float
            Relative accuracy.
        cell_eps : float or None
            Where curved surfaces may hide something: form factor below which a partly hidden cell
            is sampled; with None such receivers are left, see `OutsideLight`.

        Raises
        ------
        NumericsError
            If a value is not finite.
        """
        m = len(receivers.nodes)
        tone = np.empty(0) if sky is None else sky_tone(sky)
        out, lines = np.zeros((m, SECTORS, 6)), np.zeros(m, dtype=np.int64)
        for start in range(0, m, ROWS_PER_BLOCK):
            rows = slice(start, min(start + ROWS_PER_BLOCK, m))
            sweep_rows(
                writable(receivers.nodes[rows]),
                writable(receivers.normals[rows]),
                writable(receivers.weights[rows]),
                tone,
                self.blockers,
                self._planar,
                self._curvy,
                self.trace,
                eps,
                out[rows],
                lines[rows],
            )
            if progress is not None:
                progress(rows.stop, m)
        left = out[..., 5] < 0.0
        out[left] = 0.0
        if not np.isfinite(out).all():
            bad = int(np.argwhere(~np.isfinite(out))[0][0])
            raise NumericsError(f"light from outside at receiver {bad}: not finite")
        # Half of the bound, which counts as two standard deviations.
        values, spread = out[..., :3].sum(axis=1), (0.5 * out[..., 3:].sum(axis=1)) ** 2
        counters = {"sky_lines": int(lines.sum()), "sky_sectors_traced": int(left.sum())}
        sky_light, ground_light = (
            DomeLight(
                illuminance=np.pi * values[:, k],
                deviation=np.pi * np.sqrt(spread[:, k]),
                factor=values[:, max(k, 1)],
                factor_variance=spread[:, max(k, 1)],
                counters=counters if k == 0 else {},
            )
            for k in (0, 2)
        )
        if cell_eps is None:
            counters["sky_sectors_traced"] = 0
            return OutsideLight(sky_light, ground_light, np.asarray(left.any(axis=1)))
        how = (receivers, left, eps, cell_eps)
        if left.any():
            self._trace(sky_light, _sky_sectors(sky), *how)
        if left.any() and ground:
            self._trace(ground_light, _sectors(dome_cells(-90.0, 0.0, azimuths=SECTORS), 1.0), *how)
        return OutsideLight(sky_light, ground_light, np.zeros(m, dtype=bool))

    def _trace(
        self,
        light: DomeLight,
        sectors: list[tuple[FloatArray, Sky | FloatArray | float]],
        receivers: Receivers,
        left: NDArray[np.bool_],
        eps: float,
        cell_eps: float,
    ) -> None:
        """Add the light of the cells of sectors ``left`` (m, sectors) by pyramids."""
        for k, (cells, luminance) in enumerate(sectors):
            rows = np.flatnonzero(left[:, k])
            if not len(rows):
                continue
            some = receivers.take(rows)
            more = gather(
                some.nodes,
                some.normals,
                some.weights,
                cells,
                luminance,
                self.blockers,
                eps=eps,
                cell_eps=cell_eps,
                trace=self.trace,
            )
            _add(light, rows, more)


def _sky_sectors(sky: Sky | None) -> list[tuple[FloatArray, Sky | FloatArray | float]]:
    """Cells of each sector and their luminance; of 1 where there is no sky. [cd/m²]"""
    if isinstance(sky, PatchSky):
        turns = 2.0 * np.pi * np.arange(SECTORS + 1) / SECTORS
        return [patch_cells(sky, start, end) for start, end in pairwise(turns.tolist())]
    return _sectors(dome_cells(0.0, 90.0, azimuths=SECTORS), 1.0 if sky is None else sky)


def _sectors(
    cells: FloatArray, luminance: Sky | float
) -> list[tuple[FloatArray, Sky | FloatArray | float]]:
    """``cells`` by sector, each with ``luminance``."""
    return [(np.ascontiguousarray(some), luminance) for some in np.split(cells, SECTORS)]


def _add(light: DomeLight, rows: IntArray, more: DomeLight) -> None:
    light.illuminance[rows] += more.illuminance
    light.deviation[rows] = np.hypot(light.deviation[rows], more.deviation)
    light.factor[rows] += more.factor
    light.factor_variance[rows] += more.factor_variance
    for name, count in more.counters.items():
        light.counters[name] = light.counters.get(name, 0) + count


def curved_sides(nets: FloatArray) -> NDArray[np.bool_]:
    """Whether each of the four sides (p, 4) of nets (p, 4, 4, 4) is more than a straight line."""
    sides = np.stack([nets[:, :, 0], nets[:, 3, :], nets[:, :, 3], nets[:, 0, :]], axis=1)
    points = sides[..., :3] / sides[..., 3:]
    chord = points[:, :, 3] - points[:, :, 0]
    away = np.linalg.norm(np.cross(points - points[:, :, :1], chord[:, :, None]), axis=-1)
    size = np.abs(points).max(axis=(2, 3)) * np.linalg.norm(chord, axis=-1)
    return np.ascontiguousarray(away.max(axis=-1) > _STRAIGHT * np.maximum(size, 1e-300))
