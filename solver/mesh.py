"""Elements: patches cut into curved sub-patches by parameter box."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .errors import GeometryError
from .model.arrays import FloatArray, IntArray
from .model.bezier import areas, gauss_rule, sub_nets, surface_points
from .model.elements import Elements
from .model.patches import PatchSet

#: Largest turn of the normal inside an element: beyond it a constant exitance and a single
#: horizon make no sense. [rad]
MAX_TURN = math.radians(46.0)
#: Places along u and v at which patches are measured, and how far inside the outermost normals are
#: taken: collapsed edges have none.
_PLACES, _INSIDE = 7, 1e-3


def patch_extent(patches: PatchSet) -> tuple[FloatArray, FloatArray]:
    """Mean lengths (p, 2) [m] along u and v, and turns of the normal (p, 2) [rad]."""
    n, k = len(patches), _PLACES
    ends = np.linspace(0.0, 1.0, k), np.linspace(_INSIDE, 1.0 - _INSIDE, k)
    u, v = (
        np.concatenate([g.ravel() for g in both])
        for both in zip(*(np.meshgrid(t, t, indexing="ij") for t in ends), strict=True)
    )
    found = surface_points(patches.control_points, u, v)
    points = found[0][:, : k * k].reshape(n, k, k, 3)
    su, sv = (a[:, k * k :].reshape(n, k, k, 3) for a in found[1:])
    normals = np.cross(su, sv)
    size = np.linalg.norm(normals, axis=3, keepdims=True)
    normals = np.where(size > 0.0, normals / np.maximum(size, 1e-300), 0.0)
    lengths, turns = np.empty((n, 2)), np.empty((n, 2))
    for axis in (0, 1):
        run = np.linalg.norm(np.diff(points, axis=1 + axis), axis=3)
        lengths[:, axis] = run.sum(axis=1 + axis).max(axis=1)
        chord = (np.diff(normals, axis=1 + axis) ** 2).sum(axis=3)
        step = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * np.sqrt(chord)))
        turns[:, axis] = step.sum(axis=1 + axis).max(axis=1)
    return lengths, turns


def divisions(patches: PatchSet, size: float) -> IntArray:
    """How many elements (p, 2) of about ``size`` [m] each patch gets along u and v."""
    lengths, turns = patch_extent(patches)
    by_size = np.ceil(lengths / size - 1e-9)
    by_turn = np.ceil(turns / MAX_TURN - 1e-2)
    # Thin round legs need no more than one element a quarter turn: their light is small.
    thin = lengths < 0.5 * size
    by_turn = np.where(thin, np.minimum(by_turn, 1), by_turn)
    return np.maximum(1, np.maximum(by_size, by_turn)).astype(np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Parameter boxes that the lit sides of all patches are cut into, sorted by patch and side.

    Attributes
    ----------
    patch, side : (n,) int array
        Row of the patch, and 0 on its + side, 1 on its − side.
    ends : (n, 4) array
        u0, u1, v0, v1 in the patch's parameters; those of one side fill it without overlap.
    """

    patch: IntArray
    side: IntArray
    ends: FloatArray

    def __len__(self) -> int:
        return len(self.patch)

    def take(self, rows: IntArray) -> Boxes:
        """Some of them."""
        return Boxes(self.patch[rows], self.side[rows], self.ends[rows])

    def halved(self, axis: IntArray) -> Boxes:
        """Both halves of every box, cut across u where ``axis`` (n,) is 0, across v where 1."""
        return self.cut(axis, np.full(len(self), 0.5))

    def cut(self, axis: IntArray, place: FloatArray) -> Boxes:
        """Both parts of every box, cut across ``axis`` at ``place`` (n,), 0 … 1 of its length."""
        rows, ends = np.arange(len(self)), np.repeat(self.ends[:, None], 2, axis=1)
        low, high = self.ends[rows, 2 * axis], self.ends[rows, 2 * axis + 1]
        middle = low + (high - low) * place
        ends[rows, 0, 2 * axis + 1] = ends[rows, 1, 2 * axis] = middle
        return Boxes(np.repeat(self.patch, 2), np.repeat(self.side, 2), ends.reshape(-1, 4))

    def joined(self, others: Boxes) -> tuple[Boxes, IntArray]:
        """These and ``others``, sorted, and the row of each when one follows the other."""
        both = Boxes(
            np.append(self.patch, others.patch),
            np.append(self.side, others.side),
            np.concatenate([self.ends, others.ends]),
        )
        order = np.lexsort((both.ends[:, 2], both.ends[:, 0], both.side, both.patch))
        return both.take(order), order

    @classmethod
    def regular(cls, counts: IntArray, two_sided: IntArray) -> Boxes:
        """``counts`` (p, 2) equal boxes along u and v on every side that light can reach."""
        counts, sides = (
            np.asarray(counts, dtype=np.int64),
            1 + np.asarray(two_sided, dtype=np.int64),
        )
        total = counts.prod(axis=1)
        patch = np.repeat(np.arange(len(counts)), total * sides)
        place = np.arange(len(patch)) - np.repeat(
            np.cumsum(total * sides) - total * sides, total * sides
        )
        side, place = np.divmod(place, total[patch])
        i, j = np.divmod(place, counts[patch, 1])
        # Ends as neighbours have them, to the bit.
        ends = [(k + s) / counts[patch, axis] for axis, k in ((0, i), (1, j)) for s in (0, 1)]
        return cls(patch, side, np.stack(ends, axis=1))


def make_elements(
    patches: PatchSet,
    two_sided: IntArray,
    counts: IntArray,
    *,
    nodes: int = 2,
    small: float = 0.0,
) -> Elements:
    """Cut every patch into ``counts[p]`` equal elements; see `elements_on`."""
    return elements_on(patches, Boxes.regular(counts, two_sided), nodes=nodes, small=small)


def elements_on(patches: PatchSet, boxes: Boxes, *, nodes: int = 2, small: float = 0.0) -> Elements:
    """Elements over ``boxes`` with ``nodes`` x ``nodes`` inset Gauss nodes.

    Elements of an area below ``small`` [m²] have one node in their middle; the weights of their
    other nodes are 0.

    Raises
    ------
    GeometryError
        If there is no patch, or a patch has no area.
    """
    if len(patches) == 0:
        raise GeometryError("the scene has no surfaces")
    rule, weight = gauss_rule(nodes)
    patch, turned = boxes.patch, boxes.side == 1
    all_nets = patches.control_points[patch]
    # A patch that is one element keeps its net to the bit.
    cut = np.flatnonzero((boxes.ends != (0.0, 1.0, 0.0, 1.0)).any(axis=1))
    all_nets[cut] = sub_nets(all_nets[cut], boxes.ends[cut])
    all_nets[turned] = all_nets[turned][:, ::-1]
    u, v = (g.ravel() for g in np.meshgrid(rule, rule, indexing="ij"))
    rule_weight = np.outer(weight, weight).ravel()
    points, su, sv = surface_points(all_nets, u, v)
    normals = np.cross(su, sv)
    length = np.linalg.norm(normals, axis=2)
    bad = np.flatnonzero(~(length > 0.0).all(axis=1))
    if bad.size:
        raise GeometryError(f"patch {patch[bad[0]]}: it has no area near an edge")
    normals, weights = normals / length[:, :, None], length * rule_weight
    area = areas(all_nets)
    if not (area > 0.0).all():
        raise GeometryError(f"patch {patch[int(np.argmin(area))]}: its area is zero")
    weights *= (area / weights.sum(axis=1))[:, None]
    one = np.flatnonzero(area < small) if nodes > 1 else np.empty(0, dtype=np.int64)
    if len(one):
        at, su, sv = surface_points(all_nets[one], np.array([0.5]), np.array([0.5]))
        n = np.cross(su, sv)
        points[one], normals[one] = at, n / np.linalg.norm(n, axis=2, keepdims=True)
        weights[one], weights[one, 0] = 0.0, area[one]
    return Elements(
        nets=all_nets,
        patch_index=patch,
        side=boxes.side,
        boxes=boxes.ends,
        nodes=points,
        normals=normals,
        weights=weights,
        areas=area,
        buried=np.zeros(weights.shape, dtype=bool),
    )
