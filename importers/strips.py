"""Cells between two edges of several cubics each, cut from joint to joint of these.

No patch has a joint inside a side. Joints of opposite sides are rarely at the same place, and
straight cuts at both leave two strips where one does that leans a little.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from .arcs import Arc, EdgeArc
from .cells import Cell, quality, samples_of
from .joined_arcs import BentArc
from .together import rows_of

#: Joints are of a pair within this share of the way to the next one on either side.
NEXT_TO = 0.5
#: Joints nearer than this need no line of their own.
SAME = 1e-9
#: Share of the quality of a cell that its strips must keep.
KEPT = 0.8


def joints(arc: Arc | None) -> list[float]:
    """Places inside (0, 1) at which one cubic of a side ends and another begins."""
    if isinstance(arc, BentArc):
        first, second = joints(arc.first), joints(arc.second)
        late = [arc.share + (1.0 - arc.share) * s for s in second]
        return [*(arc.share * s for s in first), arc.share, *late]
    return [part[0] for part in arc.parts[1:]] if isinstance(arc, EdgeArc) else []


def pieces(arc: EdgeArc, at: list[float]) -> list[EdgeArc]:
    """The arc cut at some of its joints."""
    if not at:
        return [arc]
    if not isinstance(arc, BentArc):
        return [arc.part(a, b) for a, b in itertools.pairwise([0.0, *at, 1.0])]
    share = arc.share
    first = pieces(arc.first, [s / share for s in at if s < share])
    second = pieces(arc.second, [(s - share) / (1.0 - share) for s in at if s > share])
    if share not in at:
        low = max((s for s in at if s < share), default=0.0)
        high = min((s for s in at if s > share), default=1.0)
        first[-1:] = [BentArc(first[-1], second.pop(0), (share - low) / (high - low))]
    return [*first, *second]


def _pairs(a: list[float], b: list[float]) -> list[tuple[float, float]]:
    """Joints of two sides that are each other's nearest, in order, and near."""
    x, y = np.array(a), np.array(b)
    off = np.abs(x[:, None] - y)
    out = []
    for i, j in enumerate(off.argmin(axis=1).tolist()):
        if off[:, j].argmin() != i:
            continue
        room = min(_room(a, i), _room(b, j))
        if off[i, j] <= NEXT_TO * room:
            out.append((a[i], b[j]))
    return out


def _room(places: list[float], i: int) -> float:
    """The way from a place to the next one or the end of the side."""
    ends = [0.0, *places, 1.0]
    return min(ends[i + 1] - ends[i], ends[i + 2] - ends[i + 1])


def strips(cells: list[Cell], chord: Callable[[FloatArray, FloatArray], Arc]) -> list[Cell]:
    """The cells, those between two edges cut where joints of both lie next to each other."""
    parts: list[list[Cell]] = [_cut(cell, chord) for cell in cells]
    cut = [i for i, some in enumerate(parts) if len(some) > 1]
    if cut:
        owner = np.repeat(np.arange(len(cut)), [len(parts[i]) for i in cut])
        now = quality(samples_of([c for i in cut for c in parts[i]]))
        before = quality(samples_of([cells[i] for i in cut]))
        for k, rows in rows_of(owner, np.arange(len(cut))):
            if now[rows].min() < KEPT * before[k]:
                parts[cut[k]] = [cells[cut[k]]]
    return [c for some in parts for c in some]


def _cut(cell: Cell, chord: Callable[[FloatArray, FloatArray], Arc]) -> list[Cell]:
    """The cell as strips across its sides 0 and 2, or 1 and 3; itself where there are none."""
    for k in (0, 1):
        below, above = cell.sides[k], cell.sides[k + 2]
        if not (isinstance(below, EdgeArc) and isinstance(above, EdgeArc)):
            continue
        above = above.reversed()
        first, second = joints(below), joints(above)
        pairs = _pairs(first, second) if first and second else []
        if not pairs or all(abs(a - b) <= SAME for a, b in pairs):
            continue
        low = pieces(below, [a for a, _ in pairs])
        high = pieces(above, [b for _, b in pairs])
        lines = [chord(p.end / p.scale, q.end / q.scale) for p, q in zip(low, high, strict=True)]
        out = []
        for i, (p, q) in enumerate(zip(low, high, strict=True)):
            right = cell.sides[(k + 1) % 4] if i == len(low) - 1 else lines[i]
            left = cell.sides[(k + 3) % 4] if i == 0 else lines[i - 1].reversed()
            four = (p, right, q.reversed(), left)
            out.append(Cell(four if k == 0 else (left, p, right, q.reversed())))  # type: ignore[arg-type]
        return out
    return [cell]
