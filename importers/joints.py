"""Sides of patches inside a face made equal where a long one meets several short ones.

Neighbours of different depth approximate the same line on their own, each within the tolerance.
The short sides become parts of the long one, so that nothing shows between them.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import split_matrix

from .arcs import Arc, Chord

_ROWS = (np.s_[:, 0], np.s_[3, :], np.s_[:, 3], np.s_[0, :])
#: The inner control points next to each side, and the ones behind these.
_INNER: tuple[tuple[Any, Any], ...] = (
    (np.s_[1:3, 1], np.s_[1:3, 2]),
    (np.s_[2, 1:3], np.s_[1, 1:3]),
    (np.s_[1:3, 2], np.s_[1:3, 1]),
    (np.s_[1, 1:3], np.s_[2, 1:3]),
)
Key = tuple[float, ...]
#: Start and end along a line, patch and side.
Use = tuple[float, float, int, int]


def mended(
    nets: FloatArray,
    some: IntArray,
    face: IntArray,
    cell: IntArray,
    box: FloatArray,
    arcs: list[list[Arc | None]],
) -> dict[int, list[tuple[int, int]]]:
    """Replace the shorter sides in ``nets`` (n, 4, 4, 4) of ``some`` of the patches.

    ``face``, ``cell`` (n,) and ``box`` (n, 4) say where each patch lies; ``arcs`` are the sides of
    each cell, run in the direction of +s or +t.

    Returns
    -------
    dict
        By patch that changed: the patches and their sides that it now follows.
    """
    lines: dict[Key, list[Use]] = defaultdict(list)
    columns = (some.tolist(), face[some].tolist(), cell[some].tolist(), box[some].tolist())
    for i, f, c, (s0, s1, t0, t1) in zip(*columns, strict=True):
        for k, (at, a, b) in enumerate(((t0, s0, s1), (s1, t0, t1), (t1, s0, s1), (s0, t0, t1))):
            if 0.0 < at < 1.0:
                lines[c, k % 2, at].append((a, b, i, k))
                continue
            arc = arcs[c][k]
            if isinstance(arc, Chord) and arc.net is None:
                # The other cell may run along it backwards.
                p, q = tuple(arc.p.tolist()), tuple(arc.q.tolist())
                if p <= q:
                    lines[f, *p, *q].append((a, b, i, k))
                else:
                    lines[f, *q, *p].append((1.0 - a, 1.0 - b, i, k))
    changed: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for uses in lines.values():
        if len({(min(u[:2]), max(u[:2])) for u in uses}) * 2 != len(uses):
            _one_line(nets, uses, changed)
    return changed


def _one_line(nets: FloatArray, uses: list[Use], changed: dict[int, list[tuple[int, int]]]) -> None:
    uses = sorted(uses, key=lambda u: -abs(u[1] - u[0]))
    long: list[tuple[float, float, FloatArray, int, int]] = []
    for a, b, i, k in uses:
        low, high = min(a, b), max(a, b)
        found = next((x for x in long if x[0] <= low and high <= x[1]), None)
        if found is None:
            row = nets[i][_ROWS[k]].copy()
            long.append((low, high, row if a <= b else row[::-1], i, k))
            continue
        start, end, long_row, owner, side = found
        length = end - start
        if length == high - low:
            continue
        row = split_matrix((low - start) / length, (high - start) / length) @ long_row
        _move(nets[i], k, row if a <= b else row[::-1])
        changed[i].append((owner, side))


def _move(net: FloatArray, k: int, row: FloatArray) -> None:
    """Replace side ``k``; inner control points follow with 2/3 and 1/3 of the shift.

    The other sides, which neighbours share, keep their inner control points.
    """
    shift = (row / row[:, 3:] - net[_ROWS[k]] / net[_ROWS[k]][:, 3:])[1:3]
    net[_ROWS[k]] = row
    for share, inner in zip((2.0 / 3.0, 1.0 / 3.0), _INNER[k], strict=True):
        net[inner] += share * shift * net[inner][:, 3:]
