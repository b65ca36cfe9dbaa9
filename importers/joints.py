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
from .cuts import Key, line_of

#: Side k of many nets.
_ROWS: tuple[Any, ...] = (np.s_[:, :, 0], np.s_[:, 3], np.s_[:, :, 3], np.s_[:, 0])
#: The inner control points next to each side, and the ones behind these.
_INNER: tuple[tuple[Any, Any], ...] = (
    (np.s_[:, 1:3, 1], np.s_[:, 1:3, 2]),
    (np.s_[:, 2, 1:3], np.s_[:, 1, 1:3]),
    (np.s_[:, 1:3, 2], np.s_[:, 1:3, 1]),
    (np.s_[:, 1, 1:3], np.s_[:, 2, 1:3]),
)
#: Rounds of moving sides, and the relative change that is rounding.
PASSES = 12
ROUNDING = 1e-14
#: Start and end along a line, patch and side.
Use = tuple[float, float, int, int]
#: A short side: its patch and side, start and end on the long one, whose patch and side follow,
#: and whether that one runs backwards along the line.
Short = tuple[int, int, float, float, int, int, bool]


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
                line, backwards = line_of(f, arc)
                lines[line].append((1.0 - a, 1.0 - b, i, k) if backwards else (a, b, i, k))
    short = [
        found
        for uses in lines.values()
        if len({(min(u[:2]), max(u[:2])) for u in uses}) * 2 != len(uses)
        for found in _short(uses)
    ]
    changed: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for i, _, _, _, owner, side, _ in short:
        changed[i].append((owner, side))
    if short:
        _follow(nets, short)
    return changed


def _short(uses: list[Use]) -> list[Short]:
    """Uses of a line that are parts of longer ones."""
    long: list[tuple[float, float, int, int, bool]] = []
    out: list[Short] = []
    for a, b, i, k in sorted(uses, key=lambda u: -abs(u[1] - u[0])):
        low, high = min(a, b), max(a, b)
        found = next((x for x in long if x[0] <= low and high <= x[1]), None)
        if found is None:
            long.append((low, high, i, k, a > b))
            continue
        start, end, owner, side, backwards = found
        length = end - start
        if length != high - low:
            out.append((i, k, (a - start) / length, (b - start) / length, owner, side, backwards))
    return out


def _follow(nets: FloatArray, short: list[Short]) -> None:
    """Short sides become parts of the long ones.

    Where a long side ends on a longer one it moves itself, and its short ones once more.
    """
    patch, side, owner, long = np.array([(s[0], s[1], s[4], s[5]) for s in short]).T
    ends = np.array([(s[2], s[3]) for s in short])
    backwards = np.array([s[6] for s in short])
    # From the lower to the higher end, so that both sides of a line have the same bits.
    turned = ends[:, 0] > ends[:, 1]
    ends.sort(axis=1)
    matrices = split_matrix(ends[:, 0], ends[:, 1])
    by_side = [(k, np.flatnonzero(side == k), np.flatnonzero(long == k)) for k in range(4)]
    whole = np.empty((len(short), 4, 4))
    for _ in range(PASSES):
        for k, _, some in by_side:
            whole[some] = nets[owner[some]][_ROWS[k]]
        whole[backwards] = whole[backwards, ::-1]
        rows = matrices @ whole
        rows[turned] = rows[turned, ::-1]
        change = 0.0
        for k, some, _ in by_side:
            if len(some):
                before = nets[patch[some]]
                change = max(change, float(np.abs(rows[some] - before[_ROWS[k]]).max()))
                nets[patch[some]] = _moved(before, k, rows[some])
        if change <= ROUNDING * float(np.abs(rows).max()):
            break


def _moved(nets: FloatArray, k: int, rows: FloatArray) -> FloatArray:
    """Nets (n, 4, 4, 4) with ``rows`` (n, 4, 4) as side ``k``.

    Inner control points follow with 2/3 and 1/3 of the shift; the other sides, which neighbours
    share, keep theirs.
    """
    before = nets[_ROWS[k]]
    shift = (rows / rows[..., 3:] - before / before[..., 3:])[:, 1:3]
    nets[_ROWS[k]] = rows
    for share, inner in zip((2.0 / 3.0, 1.0 / 3.0), _INNER[k], strict=True):
        nets[inner] += share * shift * nets[inner][..., 3:]
    return nets
