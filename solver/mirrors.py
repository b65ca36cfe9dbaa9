"""Light that mirrors send on to surfaces and sensors.

Of what a mirror element sends to a receiver, the part it scatters is in its exitance like that of
any other element. What it mirrors is added to the receiver's row: the form factor of the mirror,
spread over what is seen in it. Lamps, the sun and, at sensors, sky and ground that are seen in one
flat mirror come by images (`images.py`), all else by rays over any number of mirrors of any shape
(`kernels/mirrors.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .dome import gather
from .elements_by_side import elements_by_side
from .exchange import Rows, form_factor_matrix, make_sources, products
from .images import TOUCH, Pieces, Plane, Window, pieces_before, windows
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, IntArray, frozen
from .model.elements import Elements
from .model.patches import PatchSet
from .model.scene import SceneData
from .model.sky import Sky, Sun, direction
from .outside_light import Horizon
from .panes import make_panes
from .raycast import RayCaster
from .row_finder import Ask
from .stages import Stages
from .surfaces import Receivers, Surfaces

if TYPE_CHECKING:
    from .pane_images import PaneImages

#: Rays over mirrors for a form factor of 1, for each unit of accuracy: on elements, at sensors.
RAYS, SENSOR_RAYS = 20.0, 200.0
#: Most of them.
MOST_RAYS = 200_000.0
#: How often places on curved mirrors that may show a lamp are quartered: on elements, at sensors.
LAMP_LEVELS = 1, 4
#: Outlines that are looked through at most; lamps in others are found by rays.
MOST_WINDOWS = 64
#: Distance in which rays do not hit what they start on, against the size of the scene.
NEAR = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Reflections:
    """What m receivers see in mirrors.

    Attributes
    ----------
    rows, variances : (m, n) float32 array
        Form factors of the elements by way of mirrors, and variances of what they reflect.
    emits : (l,) int array
        Elements that are lamps.
    lamps, lamp_variances : (m, l) array
        Their form factors times what is mirrored of them, and the variances of that.
    away : dict of pairs of (m,) arrays
        ``"sky"``: luminance x form factor [cd/m²], ``"ground"``: form factor, of what rays found of
        them; and their variances.
    """

    rows: NDArray[np.float32]
    variances: NDArray[np.float32]
    emits: IntArray
    lamps: FloatArray
    lamp_variances: FloatArray
    away: dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, slots=True, eq=False)
class Through:
    """Lamps as k receivers see them through a window.

    Attributes
    ----------
    looking : (k,) int array
        Rows of the receivers.
    owner : (l,) int array
        An element of each part.
    images : Receivers
        Images of the receivers.
    parts : Elements
        Parts of lamps, of even light each.
    factors, variances : (k, l) array
        Form factors, before the mirror takes its share, and their variances.
    """

    looking: IntArray
    owner: IntArray
    images: Receivers
    parts: Elements
    factors: FloatArray
    variances: FloatArray


def mirror_shares(scene: SceneData) -> FloatArray:
    """Luminous share (p, 2) that both sides of every patch mirror."""
    out = np.zeros(scene.material_index.shape)
    for row, material in enumerate(scene.materials):
        out[scene.material_index == row] = material.luminous_mirror
    out[~np.asarray(scene.two_sided), 1] = 0.0
    return out


class Mirrors:
    """The mirrors of one scene.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives counters and warnings.
    """

    def __init__(
        self, scene: SceneData, blockers: Blockers, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self.shares = mirror_shares(scene)
        self.any = bool(self.shares.any())
        self._caster: RayCaster | None = None
        self.windows: list[Window] = []
        self.imaged = np.zeros(self.shares.shape, dtype=bool)
        #: Whether light may pass panes on its way.
        self.panes = bool(scene.see_through.any())
        self._pane_images: dict[int, PaneImages] = {}
        if self.any:
            low, high = scene.patches.bounds()
            self.size = float(np.linalg.norm(high - low))
            self._find_windows()
        else:
            stages.skipped["mirrors"] = "no mirrors"

    def share_of(self, surfaces: Surfaces) -> FloatArray:
        """Share (n,) of the light that each element mirrors."""
        elements = surfaces.elements
        return np.asarray(self.shares[elements.patch_index, elements.side])

    def kept(self, rows: Rows, mirrored: Reflections | None, surfaces: Surfaces) -> FloatArray:
        """Share (m,) of what the receivers send that stays in the scene, wherever it comes to."""
        if mirrored is None:
            return np.asarray(rows.sums[:, 0])
        stays = 1.0 - self.share_of(surfaces)
        return products(rows.factors, stays) + products(mirrored.rows, stays)

    def _find_windows(self) -> None:
        """Outlines of flat mirrors, the largest first, as many as are looked through."""
        from .topology import PLANAR

        # Panes hide nothing, before mirrors or in them.
        scene, nets = self.scene, self.scene.without_panes.patches.control_points
        flat = self.blockers.flags & PLANAR != 0
        areas = scene.patches.areas()
        found: dict[tuple[float, ...], tuple[Plane, Pieces]] = {}
        curved = []
        for patch, side in sorted(
            np.argwhere(self.shares > 0.0).tolist(), key=lambda k: -areas[k[0]]
        ):
            if not flat[patch]:
                curved.append(patch)
                continue
            axis = -self.blockers.cones[patch, :3] if side else self.blockers.cones[patch, :3]
            axis = axis / np.linalg.norm(axis)
            offset = float(np.mean(nets[patch][..., :3] / nets[patch][..., 3:] @ axis))
            key = (*np.round(axis, 9), round(offset / self.size, 9), side)
            if key not in found:
                plane = Plane(axis, offset)
                found[key] = (plane, pieces_before(nets, plane, TOUCH * self.size))
            plane, pieces = found[key]
            parts = windows(nets[patch], plane)
            if parts is None or len(self.windows) + len(parts) > MOST_WINDOWS:
                continue
            self.imaged[patch, side] = True
            self.windows += [
                Window(
                    plane, part, float(self.shares[patch, side]), patch, side,
                    nets, self.blockers.closed, self.blockers.solid, pieces, self.trace,
                )
                for part in parts
            ]  # fmt: skip
        if curved:
            self._warn_curved(sorted(set(curved)))

    def _warn_curved(self, patches: list[int]) -> None:
        parts = sorted({self.scene.parts[self.scene.patches.part_index[p]].path for p in patches})
        names = ", ".join(repr(name) for name in parts[:3]) + (", …" if len(parts) > 3 else "")
        lost = ", and the sun's not at all" if self.scene.sun is not None else ""
        self.stages.warnings.append(
            f"curved mirrors ({names}): the light that they send to surfaces and sensors is found "
            f"by rays, that of small lamps less exactly{lost}"
        )

    def reflect(
        self,
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        *,
        fine: bool = False,
        lamps: bool = True,
    ) -> Reflections:
        """What is seen in mirrors.

        Parameters
        ----------
        rows : Rows
            From m receivers to the n elements.
        surfaces : Surfaces
            These.
        asked : Ask
            What the rows were asked for.
        fine : bool
            Whether the receivers are sensors, which nothing averages.
        lamps : bool
            Whether lamps are looked for.
        """
        # Webs and uneven lamps are followed by rays only here, at their mean: their images are
        # `MirrorLight`'s.
        emits = np.flatnonzero(surfaces.emitted.any(axis=1) & lamps)
        found = np.zeros((2, len(rows.factors), len(emits)))
        for window in self.windows:
            self._add_image(window, rows, surfaces, asked, emits, fine, found)
        return self._add_rays(rows, surfaces, asked, emits, fine, found)

    def looking(self, window: Window, rows: Rows, surfaces: Surfaces) -> IntArray:
        """Receivers that see anything of a window's patch side."""
        own = np.flatnonzero(
            (surfaces.elements.patch_index == window.patch)
            & (surfaces.elements.side == window.side)
        )
        return np.asarray(np.flatnonzero(rows.factors[:, own].sum(axis=1) > 0.0))

    def _add_image(
        self,
        window: Window,
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        emits: IntArray,
        fine: bool,
        lamps: FloatArray,
    ) -> None:
        """Add to ``lamps`` (2, m, l) those that are seen through one window."""
        own = emits[~(surfaces.web | surfaces.uneven)[emits]]
        seen = self.through(window, rows, surfaces, asked, own, fine)
        if seen is None:
            return
        for k, column in enumerate(np.searchsorted(emits, seen.owner)):
            lamps[0, seen.looking, column] += window.share * seen.factors[:, k]
            lamps[1, seen.looking, column] += window.share**2 * seen.variances[:, k]

    def through(
        self,
        window: Window,
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        lamps: IntArray,
        fine: bool,
    ) -> Through | None:
        """What of some elements that are lamps is seen through a window; None for nothing."""
        looking = self.looking(window, rows, surfaces)
        if not len(looking) or not len(lamps):
            return None
        apart = np.where(surfaces.uneven, np.arange(1, len(surfaces.areas) + 1), 0)
        light = np.column_stack([surfaces.emitted, surfaces.lamp, apart])[lamps]
        kind = np.unique(light, axis=0, return_inverse=True)[1].reshape(-1)
        parts, owner = window.lamps(surfaces.elements, lamps, kind)
        if not len(owner):
            return None
        images = window.image_of(asked.receivers.take(looking))
        factors, variances = self.factors(window, images, parts, asked, fine)
        self.stages.count({"mirror_pairs": factors.size})
        return Through(looking, owner, images, parts, factors, variances)

    def factors(
        self,
        window: Window,
        images: Receivers,
        parts: Elements,
        asked: Ask,
        fine: bool,
        *,
        hiding: bool = True,
    ) -> tuple[FloatArray, FloatArray]:
        """Form factors of lamps through a window, and their variances; or with nothing hiding."""
        found, variances = self._factors(window, images, parts, asked, fine, hiding)
        if not self.panes:
            return found, variances
        return self.panes_in(window).left_of(found, variances, images, parts, asked)

    def panes_in(self, window: Window) -> PaneImages:
        """Panes that light through a window passes."""
        from .pane_images import PaneImages

        if id(window) not in self._pane_images:
            self._pane_images[id(window)] = PaneImages(self.scene, window, self.size)
        return self._pane_images[id(window)]

    def _factors(
        self,
        window: Window,
        images: Receivers,
        parts: Elements,
        asked: Ask,
        fine: bool,
        hiding: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """The same without panes."""
        eps, blockers = asked.budget.fine_eps, window.near
        if fine and self.trace:
            # Sensors before the plane have one node: the contour of what is seen is exact.
            from .factors import point_form_factors

            before = images.weights[:, 0]
            seen = point_form_factors(
                images.nodes[:, 0],
                images.normals[:, 0],
                PatchSet(parts.nets),
                PatchSet(blockers.nets),
                accuracy=eps,
                visibility="auto" if hiding else "none",
            )
            return before[:, None] * seen.value, (0.25 * (seen.high - seen.low)) ** 2
        cells = np.full(len(parts), asked.budget.lamp_cell_eps)
        found = form_factor_matrix(
            images.nodes,
            images.normals,
            images.weights,
            images.patches,
            make_sources(parts, blockers.nets, cells),
            blockers,
            eps=eps,
            trace=hiding,
            own=images.own,
        )
        return np.asarray(found.factors), np.asarray(found.variances)

    def dome(
        self,
        rows: Rows,
        receivers: Receivers,
        surfaces: Surfaces,
        cells: FloatArray,
        luminance: Sky | float,
        *,
        sun: Sun | None = None,
        **how: Any,
    ) -> tuple[FloatArray, FloatArray]:
        """Illuminance (m,) by cells at infinity seen in single flat mirrors, and its variance.

        Only receivers to which a mirror may show the ``sun`` are asked, if it is that.
        """
        light, variance = np.zeros((2, len(rows.factors)))
        for window in self.windows:
            looking = self.looking(window, rows, surfaces)
            if not len(looking):
                continue
            images = window.image_of(receivers.take(looking))
            if sun is not None:
                toward = np.asarray(direction(sun.altitude_deg, sun.azimuth_deg))
                angle = float(np.radians(sun.angular_radius_arcmin / 60.0))
                may = window.shows(images.nodes, toward, angle).any(axis=1)
                looking, images = looking[may], images.take(np.flatnonzero(may))
            left = np.ones(len(looking))
            if sun is not None and self.panes:
                left = self.panes_in(window).left_of_beam(images, toward)
            places = (images.nodes, images.normals, images.weights)
            # What the outline would hide of all behind it is what comes through.
            for sign, blockers in ((1.0, window.open), (-1.0, window.shut)):
                there = self.blockers if blockers is None else blockers
                trace = blockers is not None
                if sun is None:
                    # As they are seen straight: of cells sampled in both, errors would add up.
                    sky = luminance if isinstance(luminance, Sky) else None
                    outside = Horizon(there, trace=trace).light(
                        images, sky, ground=sky is None, **how
                    )
                    found = outside.ground if sky is None else outside.sky
                    if not isinstance(luminance, Sky):
                        found = found.times(luminance)
                else:
                    found = gather(*places, cells, luminance, there, trace=trace, **how)
                self.stages.count(found.counters)
                light[looking] += sign * window.share * left * found.illuminance
                variance[looking] += (window.share * left * found.deviation) ** 2
        return light, variance

    def _add_rays(
        self,
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        emits: IntArray,
        fine: bool,
        lamps: FloatArray,
    ) -> Reflections:
        """What rays find; lamps that no window shows are added to ``lamps`` (2, m, l)."""
        from .kernels.mirrors import GROUND, GROUND_IMAGED, SKY, SKY_IMAGED, Seen, mirror_rows
        from .kernels.paths import Sides, Tree
        from .skies import sky_tone
        from .topology import bounding_spheres, writable

        elements, scene, receivers = surfaces.elements, self.scene, asked.receivers
        m, n = rows.factors.shape
        own = np.flatnonzero(self.share_of(surfaces) > 0.0)
        row = 2 * elements.patch_index + elements.side
        column = np.full(n, -1)
        column[emits] = np.arange(len(emits))
        if self._caster is None:
            self._caster = RayCaster(scene.without_panes.patches)
        start, order = elements_by_side(elements, len(scene.patches))
        others, away, lost = np.zeros((m, 2, len(emits))), np.zeros((m, 2, 4)), np.zeros((m, 2))
        added = np.zeros((m, n), np.float32), np.zeros((m, n), np.float32)
        mirror_rows(
            writable(receivers.nodes),
            writable(receivers.normals),
            writable(receivers.weights),
            writable(rows.factors[:, own]),
            Seen(
                frozen(own, np.int64),
                frozen(row[own], np.int64),
                frozen(self.imaged.ravel(), np.bool_),
                frozen(column, np.int64),
                bounding_spheres(elements.nets[emits]) if len(emits) else np.zeros((0, 4)),
                frozen(np.empty(0) if scene.sky is None else sky_tone(scene.sky)),
            ),
            Tree(*self._caster.arrays),
            make_panes(scene),
            Sides(start, order, elements.boxes, frozen(self.shares.ravel())),
            min((SENSOR_RAYS if fine else RAYS) / asked.budget.accuracy, MOST_RAYS),
            LAMP_LEVELS[1 if fine else 0],
            NEAR * self.size,
            self.trace,
            *added,
            others,
            away,
            lost,
        )
        # Rows are asked for the deviation of all that elements send: what lamps emit is not here.
        added[1][:, emits] = 0.0
        self.stages.count({"mirror_rays": int(lost[:, 1].sum())})
        lamps += others.transpose(1, 0, 2)
        # Sensors see sky and ground in flat mirrors by images, if no panes are in the way.
        sky, ground = [SKY, SKY_IMAGED], [GROUND, GROUND_IMAGED]
        if fine and not self.panes:
            sky, ground = [SKY], [GROUND]
        seen = {
            name: (away[:, 0, columns].sum(axis=1), away[:, 1, columns].sum(axis=1))
            for name, columns in (("sky", sky), ("ground", ground))
        }
        return Reflections(added[0], added[1], emits, lamps[0], lamps[1], seen)
