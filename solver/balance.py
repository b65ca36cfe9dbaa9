"""Boxes cut so that no edge of an element has more than two neighbours.

Cuts where light changes leave small elements beside large ones. Here every box that has more than
one corner of others on one of its edges is cut at such a corner, until none is left: along each
border neighbours then differ by one cut at most. Borders are those within patches, and edges of
patches over which the surface goes on smoothly.

Unknowns are not shared between elements, so nothing needs this: measured, it betters no error and
adds up to an eighth to the elements. It is there for those who look at meshes, or use them on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .kernels.pyramid import Blockers
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .topology import edge_points

#: Turn of the normal over an edge up to which a surface is smooth there. [cos]
SMOOTH = math.cos(math.radians(2.0))
#: Parameters that differ by less are the same.
SAME = 1e-9
#: Sides of a patch, as `topology` numbers them: the parameter that is constant, and its value.
_ACROSS, _END = (1, 0, 1, 0), (0.0, 1.0, 1.0, 0.0)
#: Passes at most: each cuts at a place where a corner was before, so they come to an end.
_PASSES = 64


Look = Callable[[IntArray, int, FloatArray], None]


@dataclass(frozen=True, slots=True)
class Seam:
    """Side ``first`` of ``patch`` is side ``second`` of ``other``, run along or ``turned``."""

    patch: int
    first: int
    other: int
    second: int
    turned: bool


def smooth_seams(blockers: Blockers) -> list[Seam]:
    """Edges over which the surface of a solid goes on smoothly, each once."""
    nets, adjacent = blockers.nets, blockers.adjacent
    if not len(nets):
        return []
    points = edge_points(nets)
    half = np.array([0.5, 1.0, 0.5, 0.0]), np.array([0.0, 0.5, 1.0, 0.5])
    # A little inside, where sides collapsed to a point have normals, too.
    u, v = (t + 1e-6 * (0.5 - t) for t in half)
    _, su, sv = surface_points(nets, u, v)
    normals = np.cross(su, sv)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    seams = []
    for p, e in zip(*np.nonzero(adjacent >= 0), strict=True):
        q = int(adjacent[p, e])
        if q <= p:
            continue
        there = np.flatnonzero(adjacent[q] == p)
        if not len(there):
            continue
        ways = np.stack([points[q, there], points[q, there][:, ::-1]])
        off = np.abs(ways - points[p, e]).max(axis=(2, 3))
        way, k = np.unravel_index(int(np.argmin(off)), off.shape)
        f = int(there[k])
        if normals[p, e] @ normals[q, f] >= SMOOTH:
            seams.append(Seam(int(p), int(e), q, f, bool(way)))
    return seams


def balanced(boxes: Boxes, seams: list[Seam], most: int) -> Boxes:
    """``boxes`` and further cuts, with no more than one corner of others inside any edge.

    No pass is begun that would lead to more than ``most`` boxes.
    """
    for _ in range(_PASSES):
        rows, axis, place = _overfull(boxes, seams)
        if not len(rows) or len(boxes) + len(rows) > most:
            break
        low, high = boxes.ends[rows, 2 * axis], boxes.ends[rows, 2 * axis + 1]
        parts = boxes.take(rows).cut(axis, (place - low) / (high - low))
        # Ends as the neighbours have them, to the bit.
        parts.ends[::2][np.arange(len(rows)), 2 * axis + 1] = place
        parts.ends[1::2][np.arange(len(rows)), 2 * axis] = place
        kept = np.setdiff1d(np.arange(len(boxes)), rows)
        boxes = boxes.take(kept).joined(parts)[0]
    return boxes


def is_balanced(boxes: Boxes, seams: list[Seam]) -> bool:
    """Whether no edge has more than two neighbours."""
    return not len(_overfull(boxes, seams)[0])


def _overfull(boxes: Boxes, seams: list[Seam]) -> tuple[IntArray, IntArray, FloatArray]:
    """Boxes to cut, across which axis and at which parameter, each box once."""
    found: dict[int, tuple[int, float]] = {}

    def look(rows: IntArray, axis: int, corners: FloatArray) -> None:
        """Cut ``rows`` with more than one of ``corners``, in order, inside their edge."""
        low, high = boxes.ends[rows, 2 * axis], boxes.ends[rows, 2 * axis + 1]
        first = np.searchsorted(corners, low + SAME)
        count = np.searchsorted(corners, high - SAME) - first
        for k in np.flatnonzero(count > 1):
            inside = corners[first[k] : first[k] + count[k]]
            middle = 0.5 * (low[k] + high[k])
            place = float(inside[np.argmin(np.abs(inside - middle))])
            found.setdefault(int(rows[k]), (axis, place))

    face = 2 * boxes.patch + boxes.side
    start = np.searchsorted(face, np.arange(2 * int(boxes.patch.max(initial=0)) + 4))
    for begin, end in zip(start[:-1], start[1:], strict=True):
        if end - begin > 2:
            _within(boxes.ends[begin:end], int(begin), look)
    for seam in seams:
        for side in (0, 1):
            one = _on_edge(boxes, start, seam.patch, side, seam.first)
            two = _on_edge(boxes, start, seam.other, side, seam.second)
            if not (len(one) and len(two)):
                continue
            along = 1 - _ACROSS[seam.first], 1 - _ACROSS[seam.second]
            for rows, axis, others, across in (
                (one, along[0], two, along[1]),
                (two, along[1], one, along[0]),
            ):
                corners = np.unique(boxes.ends[others, 2 * across])
                look(rows, axis, np.sort(1.0 - corners) if seam.turned else corners)
    chosen = sorted(found)
    axes = np.array([found[k][0] for k in chosen], dtype=np.int64)
    return np.array(chosen, dtype=np.int64), axes, np.array([found[k][1] for k in chosen])


def _within(ends: FloatArray, begin: int, look: Look) -> None:
    """Look at all borders inside one side of one patch."""
    for across in (0, 1):
        axis = 1 - across
        low, high = ends[:, 2 * across], ends[:, 2 * across + 1]
        lines = np.unique(high)
        for line in lines[:-1]:
            below, above = np.flatnonzero(high == line), np.flatnonzero(low == line)
            look(begin + below, axis, np.unique(ends[above, 2 * axis]))
            look(begin + above, axis, np.unique(ends[below, 2 * axis]))


def _on_edge(boxes: Boxes, start: IntArray, patch: int, side: int, edge: int) -> IntArray:
    """Boxes that lie along one side of a patch."""
    rows = np.arange(start[2 * patch + side], start[2 * patch + side + 1])
    column = 2 * _ACROSS[edge] + int(_END[edge])
    return rows[boxes.ends[rows, column] == _END[edge]]
