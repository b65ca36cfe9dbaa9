"""Direct light of lamps and sun at many points, as well as it takes to decide where to cut."""

from __future__ import annotations

import numpy as np

from .emission import Emission
from .exchange import form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .model.shapes import frames, places_on_disk
from .model.sky import direction
from .profile_boxes import cut_evenly
from .raycast import RayCaster
from .topology import is_single

#: Relative accuracy of unoccluded form factors: a hundredth of the light decides no cut.
EPS = 1e-2
#: Pairs of point and lamp at a time: some 60 MB.
PAIRS = 2_000_000
#: Share of a point's light below which it is not asked whether a lamp is in sight.
FAINT = 0.02
#: Rays that tell how much of what a surface reflects meets anything.
REFLECTED = 24
#: Distance above a surface from which rays start, relative to the scene's size, and the share of
#: their way after which they have reached the lamp.
LIFT, REACHED = 1e-5, 0.999


def lamp_boxes(scene: SceneData) -> Boxes:
    """Emitting patch sides; those of uneven lamps in some pieces."""
    patch, side = np.nonzero(scene.luminaire_index >= 0)
    whole = np.tile((0.0, 1.0, 0.0, 1.0), (len(patch), 1))
    return cut_evenly(scene, Boxes(patch, side, whole))


def lamp_exitances(scene: SceneData, boxes: Boxes) -> FloatArray:
    """Mean exitance (k,) of pieces of lamps. [lm/m²]"""
    lamp = scene.luminaire_index[boxes.patch, boxes.side]
    out = np.array([one.exitance_lm_m2 for one in scene.luminaires])[lamp]
    if any(one.profile is not None for one in scene.luminaires):
        emission = Emission.of(scene, elements_on(scene.patches, boxes), lamp, 1)
        if emission is not None:
            out[emission.element] = emission.mean
    return out


def sun_numbers(scene: SceneData, blockers: Blockers) -> FloatArray:
    """Direction and illuminance (4,) of the sun of a scene; none (0,) where there is none.

    None comes into a convex cavity that is all there is, which no rays are traced in.
    """
    sun = scene.sun
    closed = is_single(blockers, blockers.hollow) and scene.opaque_count == len(scene.patches)
    if sun is None or closed or sun.altitude_deg <= 0.0 or sun.normal_illuminance_lx == 0.0:
        return np.empty(0)
    return np.array([*direction(sun.altitude_deg, sun.azimuth_deg), sun.normal_illuminance_lx])


class DirectLight:
    """Light of all lamps: exact unoccluded form factors, and one ray to the middle of each patch.

    That of the sun is told by a ray to the middle of its disc, as if panes kept nothing back.

    A convex body's own horizon is in the form factors: what its middle lies behind is not hidden
    by the body itself.

    Patches of uneven lamps are cut into some pieces first.

    Lamps with photometric webs are taken to shine alike in all directions.

    Parameters
    ----------
    scene : SceneData
        Geometry and lamps.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    more : (k,) array, optional
        By how much each piece shines more, or less, than before: the light is the change then.
        Pieces that do as before are left out. [lm/m²]
    """

    def __init__(
        self, scene: SceneData, blockers: Blockers, *, trace: bool, more: FloatArray | None = None
    ) -> None:
        self.blockers = blockers
        boxes = lamp_boxes(scene)
        self._exitance = lamp_exitances(scene, boxes) if more is None else more[more != 0.0]
        boxes = boxes if more is None else boxes.take(np.flatnonzero(more))
        self._sun = sun_numbers(scene, blockers) if more is None else np.empty(0)
        self._caster = RayCaster(scene.without_panes.patches) if trace else None
        low, high = scene.patches.bounds()
        self._lift = LIFT * float(np.linalg.norm(high - low))
        self._areas = np.empty(0)
        if not len(boxes):
            return
        lamps = elements_on(scene.patches, boxes)
        self._areas, self._middles = lamps.areas, lamps.nodes.mean(axis=1)
        nets = scene.patches.control_points
        self._sources = make_sources(lamps, nets, np.full(len(lamps), EPS))
        self._solid = blockers.solid[np.minimum(boxes.patch, scene.opaque_count - 1)]
        self._convex = blockers.bulging[self._solid] & (boxes.patch < scene.opaque_count)
        self._opaque = scene.opaque_count

    def at(
        self, points: FloatArray, normals: FloatArray, patches: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Illuminance [lx], and nearness [1/m] of lamps, at points (m, 3) on ``patches`` (m,).

        Nearness is the sum of form factor over distance of the lamps in sight, each taken for a
        disc F = R² / (R² + d²) of its area.
        """
        light, nearness = np.zeros((2, len(points)))
        step = max(1, PAIRS // max(len(self._areas), 1))
        for start in range(0, len(points), step):
            some = slice(start, start + step)
            if len(self._areas):
                light[some], nearness[some] = self._at(points[some], normals[some], patches[some])
            light[some] += self._of_sun(points[some], normals[some])
        return light, nearness

    def stays(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Share (m,) of what surfaces reflect at points (m, 3) that meets anything.

        Told by some rays where there is a sun, which shines mostly outdoors; else 1.
        """
        if self._caster is None or not len(self._sun):
            return np.ones(len(points))
        (out, turn), (e1, e2) = places_on_disk(REFLECTED), frames(normals)
        up = np.sqrt(1.0 - out**2)
        start, met = points + self._lift * normals, np.zeros(len(points))
        for x, y, z in zip(out * np.cos(turn), out * np.sin(turn), up, strict=True):
            met += self._caster.any_hit(start, x * e1 + y * e2 + z * normals)
        return met / REFLECTED

    def _of_sun(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Illuminance (m,) of the sun's middle."""
        if not len(self._sun):
            return np.zeros(len(points))
        toward = self._sun[:3]
        light = self._sun[3] * np.maximum(normals @ toward, 0.0)
        rows = np.flatnonzero(light > 0.0)
        if self._caster is not None and len(rows):
            start = points[rows] + self._lift * normals[rows]
            hidden = self._caster.any_hit(start, np.broadcast_to(toward, start.shape))
            light[rows[hidden]] = 0.0
        return np.asarray(light)

    def _at(
        self, points: FloatArray, normals: FloatArray, patches: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        factors = form_factor_matrix(
            points[:, None],
            normals[:, None],
            np.ones((len(points), 1)),
            np.where(patches < self._opaque, patches, -1),
            self._sources,
            self.blockers,
            eps=EPS,
            trace=False,
        ).factors
        if self._caster is not None:
            light = factors * np.abs(self._exitance)
            row, lamp = np.nonzero(light > FAINT * light.sum(axis=1, keepdims=True))
            start = points[row] + self._lift * normals[row]
            way = self._middles[lamp] - start
            hidden = self._caster.any_hit(start, way, t_max=REACHED)
            doubted = np.flatnonzero(hidden & self._convex[lamp])
            if len(doubted):
                hits = self._caster.first_hit(start[doubted], way[doubted], t_max=REACHED)
                own = self.blockers.solid[hits.patch] == self._solid[lamp[doubted]]
                own &= hits.patch >= 0  # undecided: it stays hidden
                hidden[doubted[own]] = False
            factors[row[hidden], lamp[hidden]] = 0.0
        share = np.clip(factors, 1e-12, 1.0 - 1e-6)
        distance = np.sqrt(self._areas / np.pi * (1.0 / share - 1.0))
        return factors @ self._exitance, (factors / distance).sum(axis=1)
