"""Points inside the material of solids, and faces that lie against other faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .model.arrays import FloatArray, IntArray, check_finite, check_shape, frozen
from .model.patches import PatchSet
from .model.scene import SceneData
from .raycast import RayCaster

#: Directions of the votes: no axis, diagonal or plane of symmetry comes near them.
_DIRECTIONS = frozen(
    [
        (0.2672612419124244, 0.5345224838248488, 0.8017837257372732),
        (-0.6813851438692469, 0.2725540575476987, -0.6793056434513147),
        (0.4312455362167191, -0.8624910724334382, 0.2649079722474132),
        (-0.1432098765432099, -0.5510204081632653, 0.8221344537815126),
        (0.9012345679012346, 0.3312101910828025, -0.2797202797202797),
        (-0.5194805194805194, 0.7906976744186046, 0.3240223463687151),
        (0.1698113207547170, -0.2727272727272727, -0.9469696969696970),
    ]
)
#: Distance of test points from surfaces, relative to the size of the scene.
_RELATIVE_DISTANCE = 1e-6


class Containment:
    """Point-in-solid queries on one scene; build once, ask often.

    A point lies in a solid when a ray from it first meets that solid from behind. Each solid is
    judged by itself, so that bodies may touch and overlap. Air solids are no material.

    Parameters
    ----------
    scene : SceneData
        Only patches of closed solids take part.
    """

    def __init__(self, scene: SceneData) -> None:
        patches = scene.patches
        air = np.array([part.kind == "air" for part in scene.parts], dtype=bool)
        closed = np.asarray(scene.closed, dtype=bool)
        in_air = air[patches.part_index] if air.size else np.zeros(len(patches), dtype=bool)
        rows = np.flatnonzero(closed & ~in_air)
        self._part_of = frozen(patches.part_index[rows], np.int64)
        self._solids = RayCaster(patches.take(rows))
        self._closed = RayCaster(patches.take(np.flatnonzero(closed)))
        self._part_boxes = _part_boxes(patches.take(rows), len(scene.parts))

    def parts_at(self, points: ArrayLike) -> IntArray:
        """Row of a part whose material each point (m, 3) lies in, −1 for none: (m,) int. [m]"""
        from .kernels.containment import containing_parts

        p = frozen(points)
        check_shape("points", p, (None, 3))
        check_finite("points", p)
        arrays = (*self._solids.arrays, self._part_of, self._part_boxes)
        return np.asarray(containing_parts(*arrays, p, _DIRECTIONS))

    def buried(self, nodes: ArrayLike, normals: ArrayLike, distance: float) -> IntArray:
        """Whether surface nodes (m, 3) with unit normals are covered: (m,) bool.

        A node is covered when the point ``distance`` [m] above it lies in a solid, or when a face
        of a solid (or of an air volume) that looks the other way lies within ``distance``.
        """
        if not (np.isfinite(distance) and distance > 0.0):
            raise InputError(f"distance = {distance}: must be positive")
        x, n = frozen(nodes), frozen(normals)
        check_shape("nodes", x, (None, 3))
        check_shape("normals", n, x.shape)
        # From below the node upwards: its own face is met from behind, a face lying on it from
        # the front, also when it bounds a plate thinner than the distance.
        against = self._closed.any_hit(
            x - distance * n, n, t_min=0.5 * distance, t_max=2.0 * distance, facing=1
        )
        out = np.array(against)
        rest = np.flatnonzero(~out)
        out[rest] = self.parts_at(x[rest] + distance * n[rest]) >= 0
        return out


def _part_boxes(patches: PatchSet, parts: int) -> FloatArray:
    """Boxes (parts, 6) around the control points of each part; inverted for parts without any."""
    boxes = np.tile([np.inf] * 3 + [-np.inf] * 3, (parts, 1))
    points = patches.control_points[..., :3] / patches.control_points[..., 3:]
    np.minimum.at(boxes[:, :3], patches.part_index, points.min(axis=(1, 2)))
    np.maximum.at(boxes[:, 3:], patches.part_index, points.max(axis=(1, 2)))
    return frozen(boxes)


def inside_solids(scene: SceneData, points: ArrayLike) -> IntArray:
    """Whether points (m, 3) lie inside the material of a closed solid: (m,) bool. [m]"""
    return np.asarray(Containment(scene).parts_at(points) >= 0)


def buried(scene: SceneData, nodes: ArrayLike, normals: ArrayLike, distance: float) -> IntArray:
    """Whether surface nodes are covered by solids; see `Containment.buried`."""
    return Containment(scene).buried(nodes, normals, distance)


def check_placement(scene: SceneData) -> tuple[str, ...]:
    """One line for each lamp, camera and sensor grid that lies inside a solid."""
    if not len(scene.patches):
        return ()
    tester = Containment(scene)
    low, high = scene.patches.bounds()
    distance = _RELATIVE_DISTANCE * float(np.linalg.norm(high - low))
    lines = _dark_lamps(scene, tester, distance)
    for camera in scene.cameras:
        part = int(tester.parts_at([camera.eye])[0])
        if part >= 0:
            lines.append(
                f"camera {camera.name!r}: the eye {_place(camera.eye)} lies inside the solid "
                f"{scene.parts[part].path!r}; the image will be dark"
            )
    for grid in scene.sensors:
        parts = tester.parts_at(grid.points)
        inside = np.flatnonzero(parts >= 0)
        if inside.size:
            first = int(inside[0])
            lines.append(
                f"sensors {grid.name!r}: {inside.size} of {len(grid)} points lie inside solids, "
                f"the first {_place(grid.points[first])} in {scene.parts[parts[first]].path!r}"
            )
    return tuple(lines)


def _dark_lamps(scene: SceneData, tester: Containment, distance: float) -> list[str]:
    """Lamps of whose emitting sides no patch centre is free."""
    lines = []
    patches = scene.patches
    centers, normals = patches.evaluate(0.5, 0.5), patches.normals(0.5, 0.5)
    for lamp, luminaire in enumerate(scene.luminaires):
        rows, sides = np.nonzero(scene.luminaire_index == lamp)
        if not rows.size:
            continue
        n = normals[rows] * np.where(sides == 0, 1.0, -1.0)[:, None]
        usable = np.isfinite(n).all(axis=1)
        x, n = centers[rows[usable]], n[usable]
        if len(x) and tester.buried(x, n, distance).all():
            parts = tester.parts_at(x + distance * n)
            inside = parts[parts >= 0]
            where = f" the solid {scene.parts[inside[0]].path!r}" if inside.size else " other faces"
            lines.append(
                f"lamp {luminaire.part!r}: all of its emitting faces lie inside or against{where};"
                f" its {luminaire.flux_lm:g} lm stay dark"
            )
    return lines


def _place(point: ArrayLike) -> str:
    x, y, z = (float(c) for c in np.asarray(point))
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"
