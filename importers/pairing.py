"""Triangles of a region paired to four-sided cells, fewest partners first.

A triangle left over is a cell with one collapsed side.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from .arcs import Arc, NetArc
from .cells import Cell, corner_sines, quality, samples_of, side_samples, straight_quality
from .triangulate import triangulate

ChordMaker = Callable[[FloatArray, FloatArray], Arc]
Loop = list[Arc]
Triangle = tuple[int, int, int]
#: By identity of an arc: the shares of its length where it should be cut, none for its middle.
Wanted = dict[int, list[float]]

#: Qualities: of a pair that is preferred to its triangles, and of a cell that is thin.
PAIRED = 0.1
THIN = 0.02
#: Feet of corners nearer to the end of a side than this share of it are no place to cut it.
NEAR_END = 0.02


def best_triangle(arcs: list[Arc]) -> tuple[Cell, float]:
    """The best of the three ways to collapse a side, and its quality."""
    options = []
    for k in range(3):
        a, b, c = arcs[k], arcs[(k + 1) % 3], arcs[(k + 2) % 3]
        options.append(Cell((a, b, None, c)))
    q = quality(samples_of(options))
    best = int(np.argmax(q))
    return options[best], float(q[best])


def paired(
    loops: list[Loop], chord: ChordMaker, limit: float
) -> tuple[list[Cell] | None, Wanted, str]:
    """Cells of a triangulation, by identity of an arc where to cut it, and why it failed."""
    vertices = [np.array([a.start for a in loop]) for loop in loops]
    triangles = triangulate(vertices)
    if triangles is None:
        return None, {}, "the boundary touches or crosses itself"
    arcs: dict[tuple[int, int], Arc] = {}
    base = 0
    for loop in loops:
        n = len(loop)
        for k, arc in enumerate(loop):
            arcs[base + k, base + (k + 1) % n] = arc
        base += n
    points = np.concatenate(vertices)
    scale = loops[0][0].scale

    def side(a: int, b: int) -> Arc:
        found = arcs.get((a, b))
        if found is None:
            found = chord(points[a] / scale, points[b] / scale)
            arcs[a, b] = found
            arcs[b, a] = found.reversed()
        return found

    curved = {key for key, arc in arcs.items() if not arc.straight}
    outline = _Outline(points, curved, side)
    triangles, alone = _reshaped(triangles, outline)
    owner = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(triangles) for k in range(3)}
    pairs: list[tuple[int, int]] = []
    quads: list[tuple[int, ...]] = []
    for (a, b), i in owner.items():
        j = owner.get((b, a))
        if j is None or i > j:
            continue
        c = next(x for x in triangles[i] if x not in (a, b))
        d = next(x for x in triangles[j] if x not in (a, b))
        pairs.append((i, j))
        quads.append((a, d, b, c))
    q = outline.quads(quads)
    chosen = _match(pairs, q, alone)
    sides = {k: tuple(side(a, b) for a, b in _around(quads[k])) for k in chosen}
    cells = [Cell(four) for four in sides.values()]  # type: ignore[arg-type]
    used = {t for k in chosen for t in pairs[k]}
    bad = [sides[k] for k in chosen if q[k] < limit]
    for i, t in enumerate(triangles):
        if i in used:
            continue
        three = [side(t[k], t[(k + 1) % 3]) for k in range(3)]
        cell, best = best_triangle(three)
        if best < limit:
            bad.append(tuple(three))
        cells.append(cell)
    return cells, _wanted(bad, loops), ""


def _wanted(bad: list[tuple[Arc, ...]], loops: list[Loop]) -> Wanted:
    """Where to cut arcs for the sake of bad cells, given by their sides.

    A row of holes beside a long straight side has nothing but the ends of that to be joined to,
    which gives thin cells across the holes: the side gets corners next to those of the holes.
    Curves that are sides of other bad cells are halved.
    """
    wanted: Wanted = {}
    lines = [a for loop in loops for a in loop if isinstance(a, NetArc) and a.straight]
    p = np.array([a.start for a in lines]).reshape(-1, 2)
    d = np.array([a.end for a in lines]).reshape(-1, 2) - p
    square = (d * d).sum(axis=1)
    for cell in bad:
        corners = np.array([a.start for a in cell])
        size = max(float(np.linalg.norm(a.end - a.start)) for a in cell)
        away = corners[:, None] - p
        foot = (away * d).sum(axis=2) / square
        off = np.linalg.norm(away - foot[..., None] * d, axis=2)
        beside = (foot > NEAR_END) & (foot < 1.0 - NEAR_END) & (off > NEAR_END * size)
        off = np.where(beside & (off < 0.5 * size), off, np.inf)
        nearest = off.argmin(axis=1) if len(lines) else np.empty(0, dtype=np.int64)
        found = [(m, k) for m, k in enumerate(nearest.tolist()) if off[m, k] < np.inf]
        for m, k in found:
            wanted.setdefault(id(lines[k]), []).append(float(foot[m, k]))
        if not found:
            for arc in cell:
                if not arc.straight:
                    wanted.setdefault(id(arc), [])
    return wanted


_NINTHS = np.linspace(0.0, 1.0, 9)[:, None]


def _around(corners: tuple[int, ...]) -> list[tuple[int, int]]:
    return [(corners[k - 1], corners[k]) for k in (*range(1, len(corners)), 0)]


@dataclass(slots=True)
class _Outline:
    """Vertices (n, 2), the pairs of them that a curved arc joins, and the arc of any pair."""

    points: FloatArray
    curved: set[tuple[int, int]]
    side: Callable[[int, int], Arc]

    def _bent(self, corners: Sequence[tuple[int, ...]]) -> tuple[IntArray, FloatArray]:
        """Which of some polygons have a curved side, and samples (m, k, 9, 2) of their sides."""
        found = [
            (i, k, key)
            for i, polygon in enumerate(corners)
            for k, key in enumerate(_around(polygon))
            if key in self.curved
        ]
        bent, row = np.unique([i for i, _, _ in found], return_inverse=True)
        bent = bent.astype(np.int64)
        p = self.points[np.array(corners)[bent]]
        samples = p[:, :, None] + _NINTHS * (np.roll(p, -1, axis=1) - p)[:, :, None]
        for m, (_, k, (a, b)) in zip(row.ravel().tolist(), found, strict=True):
            samples[m, k] = side_samples(self.side(a, b))
        return bent, samples

    def quads(self, quads: Sequence[tuple[int, ...]]) -> FloatArray:
        """Quality (n,) of quadrilaterals as cells."""
        if not quads:
            return np.empty(0)
        q = straight_quality(self.points[np.array(quads)])
        bent, samples = self._bent(quads)
        q[bent] = quality(samples)
        return q

    def triangles(self, triangles: Sequence[Triangle]) -> FloatArray:
        """Quality (n,) of triangles as cells with the side collapsed that suits them best."""
        p = self.points[np.array(triangles)]
        # A collapsed corner does not count: the best is the one of the smallest angle.
        q = np.sort(corner_sines(p), axis=1)[:, 1]
        bent, three = self._bent(triangles)
        if len(bent):
            four = np.empty((len(three), 3, 4, 9, 2))
            for k in range(3):
                a, b, c = three[:, k], three[:, (k + 1) % 3], three[:, (k + 2) % 3]
                four[:, k, 0], four[:, k, 1], four[:, k, 3] = a, b, c
                four[:, k, 2] = b[:, -1:]
            q[bent] = quality(four.reshape(-1, 4, 9, 2)).reshape(-1, 3).max(axis=1)
        return q


def _reshaped(triangles: list[Triangle], outline: _Outline) -> tuple[list[Triangle], FloatArray]:
    """Diagonals swapped while that improves a bad triangle: Delaunay's rule sees chords only.

    The triangles and their quality as cells.
    """
    tri = list(triangles)
    q, points = outline.triangles(tri), outline.points
    for _ in range(6):
        bad = [i for i in np.argsort(q).tolist() if q[i] < PAIRED]
        if not bad:
            break
        owner = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(tri) for k in range(3)}
        options: list[tuple[int, int, Triangle, Triangle]] = []
        for i in bad:
            for k in range(3):
                a, b, c = tri[i][k], tri[i][(k + 1) % 3], tri[i][(k + 2) % 3]
                j = owner.get((b, a))
                if j is None:
                    continue
                d = next(x for x in tri[j] if x not in (a, b))
                if _left(points, a, d, c) and _left(points, d, b, c):
                    options.append((i, j, (a, d, c), (d, b, c)))
        if not options:
            break
        new = outline.triangles([t for o in options for t in o[2:]]).reshape(-1, 2)
        gain = new.min(axis=1) - np.array([min(q[i], q[j]) for i, j, *_ in options])
        touched: set[int] = set()
        for k in np.argsort(-gain).tolist():
            i, j, s, t = options[k]
            if gain[k] <= 0.01 or i in touched or j in touched:
                continue
            touched |= {i, j}
            tri[i], tri[j] = s, t
            q[i], q[j] = new[k]
        if not touched:
            break
    return tri, q


def _left(points: FloatArray, a: int, b: int, c: int) -> bool:
    p, q, r = points[a], points[b], points[c]
    cross = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return bool(cross > 1e-9 * (np.abs(q - p).sum() * np.abs(r - p).sum()))


def _match(pairs: list[tuple[int, int]], q: FloatArray, alone: FloatArray) -> list[int]:
    """Greedy matching of triangles, those with the fewest partners first, best shape first.

    Triangles that make bad cells ``alone`` choose before all others.
    """
    count = len(alone)
    options: list[list[int]] = [[] for _ in range(count)]
    for k, (i, j) in enumerate(pairs):
        if q[k] > (PAIRED if min(alone[i], alone[j]) > THIN else THIN):
            options[i].append(k)
            options[j].append(k)
    free = [True] * count
    degree = [len(o) for o in options]
    chosen = []
    heap = [(alone[i] > THIN, d, i) for i, d in enumerate(degree) if d]
    heapq.heapify(heap)
    while heap:
        first, d, i = heapq.heappop(heap)
        if not free[i] or d != degree[i]:
            continue
        live = [k for k in options[i] if free[pairs[k][0]] and free[pairs[k][1]]]
        if not live:
            continue
        partner = {k: pairs[k][1] if pairs[k][0] == i else pairs[k][0] for k in live}
        best = min(live, key=lambda k: (degree[partner[k]] > 1, -q[k]))
        chosen.append(best)
        for t in pairs[best]:
            free[t] = False
            for k in options[t]:
                for other in pairs[k]:
                    if free[other]:
                        degree[other] -= 1
                        heapq.heappush(heap, (alone[other] > THIN, degree[other], other))
    return chosen
