"""Cuts of the scene with a plane: the walls, columns and furniture drawn in plans."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import PatchSet, bezier

#: Chord error of the display triangles relative to the scene, and the finest grid on a patch.
_CHORD_ERROR, _MAX_STEPS = 2e-4, 32


def patch_triangles(patches: PatchSet) -> NDArray[np.float64]:
    """Triangles (t, 3, 3) of a display grid on every patch, as fine as its curvature asks. [m]

    With second differences of the control points of at most D, the chords of k steps stay within
    6 D / (8 k²) of a cubic [Farin, "Curves and Surfaces for CAGD", 5th ed., sec. 5.4 and 7.6].
    """
    if len(patches) == 0:
        return np.zeros((0, 3, 3))
    nets = patches.control_points
    points = nets[..., :3] / nets[..., 3:]
    low, high = patches.bounds()
    tolerance = _CHORD_ERROR * max(float((high - low).max()), 1e-9)
    bend = np.maximum(
        np.linalg.norm(np.diff(points, 2, axis=1), axis=-1).max(axis=(1, 2)),
        np.linalg.norm(np.diff(points, 2, axis=2), axis=-1).max(axis=(1, 2)),
    )
    steps = np.clip(np.ceil(np.sqrt(0.75 * bend / tolerance)), 1, _MAX_STEPS).astype(np.int64)
    return np.concatenate([_triangles(nets[steps == k], int(k)) for k in np.unique(steps)])


def _triangles(nets: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    """Two triangles for each of k x k cells of the nets (n, 4, 4, 4)."""
    b = bezier.bernstein(np.linspace(0.0, 1.0, k + 1))
    h = np.einsum("ai,bj,nijk->nabk", b, b, nets, optimize=True)
    p = h[..., :3] / h[..., 3:]
    c0, c1, c2, c3 = p[:, :-1, :-1], p[:, 1:, :-1], p[:, 1:, 1:], p[:, :-1, 1:]
    both = [np.stack([c0, c1, c2], axis=-2), np.stack([c0, c2, c3], axis=-2)]
    return np.asarray(np.concatenate(both).reshape(-1, 3, 3))


def cut(
    triangles: NDArray[np.float64], origin: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Segments (s, 2, 3) in which the triangles (t, 3, 3) meet the plane. [m]"""
    height = (triangles - origin) @ normal
    # A corner exactly on the plane counts as above: each crossing is found once.
    above = height >= 0.0
    crossing = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    tri, h, up = triangles[crossing], height[crossing], above[crossing]
    ends = np.empty((len(crossing), 2, 3))
    filled = np.zeros(len(crossing), dtype=np.int64)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        rows = np.flatnonzero(up[:, i] != up[:, j])
        t = h[rows, i] / (h[rows, i] - h[rows, j])
        ends[rows, filled[rows]] = tri[rows, i] + t[:, None] * (tri[rows, j] - tri[rows, i])
        filled[rows] += 1
    return ends


def joined(segments: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Polylines (m, d) of segments (s, 2, d) that share end points, without points on straights."""
    if len(segments) == 0:
        return []
    size = float(np.ptp(segments.reshape(-1, segments.shape[2]), axis=0).max()) or 1.0
    keys = np.round(segments / (1e-6 * size)).astype(np.int64)
    ends: dict[tuple[int, ...], list[int]] = defaultdict(list)
    names = [tuple(tuple(int(x) for x in end) for end in pair) for pair in keys]
    for row, pair in enumerate(names):
        if pair[0] != pair[1]:
            for end in pair:
                ends[end].append(row)
    used: set[int] = {row for row, pair in enumerate(names) if pair[0] == pair[1]}
    # Open lines are walked from their loose ends first, closed ones from anywhere.
    starts = sorted(ends, key=lambda end: len(ends[end]) == 2)
    lines = []
    for start in starts:
        for first in ends[start]:
            if first in used:
                continue
            here, row, line = start, first, []
            while True:
                used.add(row)
                side = names[row].index(here)
                line.append(segments[row, side])
                here = names[row][1 - side]
                following = [r for r in ends[here] if r not in used]
                if len(ends[here]) != 2 or not following:
                    line.append(segments[row, 1 - side])
                    break
                row = following[0]
            lines.append(_without_straights(np.array(line), 1e-4 * size))
    return lines


def _without_straights(line: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """The polyline without points that lie within ``tolerance`` of their neighbours' chord."""
    kept = [line[0]]
    for k in range(1, len(line) - 1):
        chord = line[k + 1] - kept[-1]
        length = float(np.linalg.norm(chord))
        offset = line[k] - kept[-1]
        if length <= tolerance:
            kept.append(line[k])
            continue
        along = float(offset @ chord) / length
        away = float(np.sqrt(max(float(offset @ offset) - along * along, 0.0)))
        # A tenth of the tolerance each time: dropped points must not add up to a bent line.
        if away > 0.1 * tolerance or not 0.0 <= along <= length:
            kept.append(line[k])
    return np.array([*kept, line[-1]])
