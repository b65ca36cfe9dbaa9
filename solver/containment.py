"""Points inside solids and air volumes, and faces that lie against other faces."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError
from .model.arrays import FloatArray, IntArray, check_finite, check_shape, frozen
from .model.patches import PatchSet
from .model.scene import SceneData
from .raycast import RayCaster

if TYPE_CHECKING:
    from .kernels.pyramid import Blockers

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


class Volumes:
    """Which closed part points lie in.

    Parameters
    ----------
    patches : PatchSet
        Closed parts with +normals outwards.
    parts : int
        Number of parts of the scene.

    Attributes
    ----------
    caster : RayCaster
        Of the patches.
    """

    def __init__(self, patches: PatchSet, parts: int) -> None:
        self._part_of = frozen(patches.part_index, np.int64)
        self.caster = RayCaster(patches)
        self._boxes = _part_boxes(patches, parts)

    @classmethod
    def of_air(cls, scene: SceneData) -> Volumes | None:
        """The air volumes of a scene; None when it has none."""
        air = np.array([part.kind == "air" for part in scene.parts], dtype=bool)
        if not air.any():
            return None
        rows = np.flatnonzero(air[scene.patches.part_index])
        # The active side of air looks inwards.
        return cls(scene.patches.take(rows).flipped(), len(scene.parts))

    def parts_at(self, points: ArrayLike) -> IntArray:
        """Row of a part that each point (m, 3) lies in, −1 for none: (m,) int. [m]"""
        from .kernels.containment import containing_parts
        from .kernels.threads import threads_for

        p = frozen(points)
        check_shape("points", p, (None, 3))
        check_finite("points", p)
        if not len(self._part_of):
            return np.full(len(p), -1)
        arrays = (*self.caster.arrays, self._part_of, self._boxes)
        with threads_for(5 * len(p)):  # a point of a few surfaces takes as long as five pairs
            return np.asarray(containing_parts(*arrays, p, _DIRECTIONS))


class Containment:
    """Point-in-solid queries on one scene; build once, ask often.

    A point lies in a solid when a ray from it first meets that solid from behind. Each solid is
    judged by itself, so that bodies may touch and overlap. Air solids are no material.

    Parameters
    ----------
    scene : SceneData
        Only patches of closed solids take part.
    blockers : Blockers, optional
        Its patches without panes: they tell scenes in which nothing is asked, see `Attributes`.

    Attributes
    ----------
    is_cavity : bool
        Whether one convex cavity is known to be all there is: nothing covers its walls.
    """

    def __init__(self, scene: SceneData, blockers: Blockers | None = None) -> None:
        from .topology import is_single

        self._scene = scene
        self._no_pane = scene.opaque_count == len(scene.patches)
        alone = blockers is not None and is_single(blockers, blockers.hollow)
        self.is_cavity = alone and self._no_pane

    @cached_property
    def _material(self) -> NDArray[np.bool_]:
        """Patches (p,) of closed solids other than air."""
        scene = self._scene
        air = np.array([part.kind == "air" for part in scene.parts], dtype=bool)
        closed = np.asarray(scene.closed, dtype=bool)
        return closed & ~air[scene.patches.part_index] if air.size else closed

    @cached_property
    def _solids(self) -> Volumes:
        rows = np.flatnonzero(self._material)
        return Volumes(self._scene.patches.take(rows), len(self._scene.parts))

    @cached_property
    def _closed(self) -> RayCaster:
        every = np.flatnonzero(self._scene.closed)
        same = len(every) == int(self._material.sum())
        return self._solids.caster if same else RayCaster(self._scene.patches.take(every))

    @property
    def caster_of_all(self) -> RayCaster | None:
        """Of all patches, where all are of solids or air volumes and none is a pane; else None."""
        every = bool(np.asarray(self._scene.closed).all()) and self._no_pane
        return self._closed if every else None

    def parts_at(self, points: ArrayLike) -> IntArray:
        """Row of a part whose material each point (m, 3) lies in, −1 for none: (m,) int. [m]"""
        return self._solids.parts_at(points)

    def any_in(self, points: ArrayLike, patches: NDArray[np.bool_]) -> bool:
        """Whether any point (m, 3) [m] lies in a solid that ``patches`` (p,) are all of."""
        rows = np.flatnonzero(self._material & patches)
        if not len(rows):
            return False
        solids = Volumes(self._scene.patches.take(rows), len(self._scene.parts))
        return bool((solids.parts_at(points) >= 0).any())

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
        if self.is_cavity or not self._scene.closed.any():
            return np.zeros(len(x), dtype=bool)
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
