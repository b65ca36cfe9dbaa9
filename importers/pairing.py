"""Triangles of a region paired to four-sided cells, fewest partners first.

A triangle left over is a cell with one collapsed side.
"""

from __future__ import annotations

import heapq

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from .arcs import Arc, EdgeArc, NetArc
from .cells import THIN, Cell, quality, samples_of
from .compare import BoolArray
from .mesh import Loop, Mesh
from .together import rows_of
from .triangulate import inner_edges, overlapping

#: By identity of an arc: the shares of its length where it should be cut, none for its middle.
Wanted = dict[int, list[float]]

#: Quality of a pair that is preferred to its triangles.
PAIRED = 0.1
#: Feet of corners nearer to the end of a side than this share of it are no place to cut it.
NEAR_END = 0.02
#: The direction in which triangles are matched.
SWEEP = np.array([1.0, 0.01])


def best_triangle(arcs: list[Arc]) -> tuple[Cell, float]:
    """The best of the three ways to collapse a side, and its quality."""
    options = []
    for k in range(3):
        a, b, c = arcs[k], arcs[(k + 1) % 3], arcs[(k + 2) % 3]
        options.append(Cell((a, b, None, c)))
    q = quality(samples_of(options))
    best = int(np.argmax(q))
    return options[best], float(q[best])


def paired(mesh: Mesh, loops: list[Loop], limit: float) -> tuple[list[Cell] | None, Wanted, str]:
    """Cells of a triangulation, by identity of an arc where to cut it, and why it failed."""
    if not mesh.update(loops):
        return None, {}, "the boundary touches or crosses itself"
    triangles, alone, collapsed = _reshaped(mesh)
    a, b, c, d, i, j = inner_edges(triangles)
    quads = np.stack([a, d, b, c], axis=1)
    q = mesh.quads(quads)
    chosen = _match(i, j, q, alone)
    corners = quads[chosen].tolist()
    cells = [mesh.cell(four) for four in corners]
    bad = [
        tuple(mesh.side(four[k - 1], four[k]) for k in (1, 2, 3, 0))
        for four, value in zip(corners, q[chosen].tolist(), strict=True)
        if value < limit
    ]
    left = np.ones(len(triangles), dtype=bool)
    left[i[chosen]] = left[j[chosen]] = False
    for k in np.flatnonzero(left).tolist():
        three = triangles[k].tolist()
        cells.append(mesh.cell(three, int(collapsed[k])))
        if alone[k] < limit:
            bad.append(tuple(mesh.side(three[m - 1], three[m]) for m in (1, 2, 0)))
    return cells, _wanted(bad, loops), ""


def _wanted(bad: list[tuple[Arc, ...]], loops: list[Loop]) -> Wanted:
    """Where to cut arcs for the sake of bad cells, given by their sides.

    A row of holes beside a long straight side has nothing but the ends of that to be joined to,
    which gives thin cells across the holes: the side gets corners next to those of the holes.
    Curves that are sides of other bad cells are halved.
    """
    wanted: Wanted = {}
    if not bad:
        return wanted
    every = (a for loop in loops for a in loop)
    lines = [a for a in every if isinstance(a, NetArc | EdgeArc) and a.straight]
    p = np.array([a.start for a in lines]).reshape(-1, 2)
    end = np.array([a.end for a in lines]).reshape(-1, 2)
    corners = [np.array([a.start for a in cell]) for cell in bad]
    size = np.array([max(float(np.linalg.norm(a.end - a.start)) for a in cell) for cell in bad])
    reach = 0.5 * size[:, None]
    low = np.array([c.min(axis=0) for c in corners]) - reach
    high = np.array([c.max(axis=0) for c in corners]) + reach
    cell, line = overlapping(low, high, np.minimum(p, end), np.maximum(p, end))
    near = dict(rows_of(cell, np.arange(len(bad))))
    for n, arcs in enumerate(bad):
        some = np.sort(line[near[n]]) if n in near else np.zeros(0, dtype=np.int64)
        d = end[some] - p[some]
        away = corners[n][:, None] - p[some]
        foot = (away * d).sum(axis=2) / (d * d).sum(axis=1)
        off = np.linalg.norm(away - foot[..., None] * d, axis=2)
        beside = (foot > NEAR_END) & (foot < 1.0 - NEAR_END) & (off > NEAR_END * size[n])
        off = np.where(beside & (off < 0.5 * size[n]), off, np.inf)
        nearest = off.argmin(axis=1) if len(some) else np.empty(0, dtype=np.int64)
        found = [(m, k) for m, k in enumerate(nearest.tolist()) if off[m, k] < np.inf]
        for m, k in found:
            wanted.setdefault(id(lines[some[k]]), []).append(float(foot[m, k]))
        if not found:
            for arc in arcs:
                if not arc.straight:
                    wanted.setdefault(id(arc), [])
    return wanted


def _reshaped(mesh: Mesh) -> tuple[IntArray, FloatArray, IntArray]:
    """Diagonals swapped while that improves a bad triangle: Delaunay's rule sees chords only.

    The triangles (n, 3), their quality as cells and the sides collapsed in these.
    """
    # Matching goes on where it has begun, from one side of the region to the other.
    tri = np.array(mesh.triangles)
    tri = tri[np.argsort(mesh.points[tri].sum(axis=1) @ SWEEP, kind="stable")]
    q, side = mesh.alone(tri)
    for _ in range(6):
        if q.min() >= PAIRED:
            break
        a, b, c, d, i, j = inner_edges(tri)
        some = np.minimum(q[i], q[j]) < PAIRED
        a, b, c, d, i, j = (x[some] for x in (a, b, c, d, i, j))
        some = _left(mesh.points, a, d, c) & _left(mesh.points, d, b, c)
        if not some.any():
            break
        a, b, c, d, i, j = (x[some] for x in (a, b, c, d, i, j))
        first, second = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
        (q1, side1), (q2, side2) = mesh.alone(first), mesh.alone(second)
        gain = np.minimum(q1, q2) - np.minimum(q[i], q[j])
        touched = np.zeros(len(tri), dtype=bool)
        for k in np.argsort(-gain, kind="stable")[: int((gain > 0.01).sum())].tolist():
            m, n = i[k], j[k]
            if touched[m] or touched[n]:
                continue
            touched[m] = touched[n] = True
            tri[m], q[m], side[m] = first[k], q1[k], side1[k]
            tri[n], q[n], side[n] = second[k], q2[k], side2[k]
        if not touched.any():
            break
    return tri, q, side


def _left(points: FloatArray, a: IntArray, b: IntArray, c: IntArray) -> BoolArray:
    """Whether triangles (m,) are counter-clockwise and not flat."""
    e, f = points[b] - points[a], points[c] - points[a]
    cross = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    return np.asarray(cross > 1e-9 * np.abs(e).sum(axis=1) * np.abs(f).sum(axis=1))


def _match(first: IntArray, second: IntArray, q: FloatArray, alone: FloatArray) -> list[int]:
    """Greedy matching of triangles, those with the fewest partners first, best shape first.

    Pair k of quality ``q`` (k,) joins the triangles ``first`` and ``second`` (k,). Triangles that
    make bad cells ``alone`` (n,) choose before all others.
    """
    count = len(alone)
    options: list[list[int]] = [[] for _ in range(count)]
    least = np.where(np.minimum(alone[first], alone[second]) > THIN, PAIRED, THIN)
    pairs = list(zip(first.tolist(), second.tolist(), strict=True))
    for k in np.flatnonzero(q > least).tolist():
        i, j = pairs[k]
        options[i].append(k)
        options[j].append(k)
    thick = (alone > THIN).tolist()
    free = [True] * count
    degree = [len(o) for o in options]
    chosen = []
    heap = [(thick[i], d, i) for i, d in enumerate(degree) if d]
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
                        heapq.heappush(heap, (thick[other], degree[other], other))
    return chosen
