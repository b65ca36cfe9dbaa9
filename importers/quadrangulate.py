"""Regions of the (u, v) domain cut into few well-shaped four-sided cells.

A region with three or four corners is one cell and a smooth disc five; anything else goes through
a constrained Delaunay triangulation whose triangles are paired, fewest partners first. A triangle
left over is a cell with one collapsed side.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray, IntArray

from .arcs import Arc
from .cells import Cell, corner_sines, quality, samples_of, side_samples, straight_quality
from .together import rows_of
from .triangulate import crossings, inside, overlapping, triangulate

ChordMaker = Callable[[FloatArray, FloatArray], Arc]
Loop = list[Arc]
Triangle = tuple[int, int, int]

GOOD = 0.2
PAIRED = 0.1
THIN = 0.02
#: Quality below which halving of sides goes on where cells of less have failed.
STRICT = 0.25
FOLDED = 1e-3
SMOOTH = math.cos(math.radians(20.0))
MOST_ARCS = 3000


def corner_turns(loop: Loop) -> FloatArray:
    """Exterior angle at the start of each arc [rad], positive at convex corners."""
    d = [a.directions for a in loop]
    out = []
    for k in range(len(loop)):
        e, s = d[k - 1][1], d[k][0]
        out.append(math.atan2(e[0] * s[1] - e[1] * s[0], float(e @ s)))
    return np.array(out)


def cells_of(
    loops: list[Loop],
    chord: ChordMaker,
    *,
    planar: bool,
    folded: Callable[[list[Cell]], list[Cell]] | None = None,
    thin: float = THIN,
) -> list[Cell]:
    """Cells of one region (outer loop counter-clockwise, then holes).

    ``folded`` picks the cells whose patches would overlap themselves, which samples may miss. Cells
    of a quality below ``thin`` are worth a few more.

    Raises
    ------
    GeometryError
        If no valid decomposition is found; the message is the reason for the certificate.
    """
    if len(loops) == 1:
        simple = _simple(loops[0], chord, thin)
        if simple is not None:
            curved = any(a is not None and not a.straight for c in simple for a in c.sides)
            if not (folded and curved and folded(simple)):
                return simple
    return _general(loops, chord, planar, folded, thin)


def _simple(loop: Loop, chord: ChordMaker, thin: float) -> list[Cell] | None:
    if len(loop) == 1:
        a, b = loop[0].halves()
        loop = [*a.halves(), *b.halves()]
    elif len(loop) == 2:
        turns = corner_turns(loop)
        if turns.min() > math.radians(30.0):
            cell = Cell((loop[0], None, loop[1], None))
            if quality(samples_of([cell]))[0] > thin:
                return [cell]
        loop = [*loop[0].halves(), *loop[1].halves()]
    turns = corner_turns(loop)
    if len(loop) == 3 and (turns > math.radians(15.0)).all():
        cell, best = _triangle(loop)
        if best > max(PAIRED, thin):
            return [cell]
    if len(loop) == 4 and (turns > math.radians(25.0)).all():
        cell = Cell((loop[0], loop[1], loop[2], loop[3]))
        # Between straight sides the angles are between those of the corners.
        if all(a.straight for a in loop) and np.sin(turns).min() > GOOD:
            return [cell]
        if quality(samples_of([cell]))[0] > GOOD:
            return [cell]
    if 4 <= len(loop) <= 8 and (np.abs(turns) < math.radians(30.0)).all():
        return _disc(loop, chord)
    return None


def _triangle(arcs: list[Arc]) -> tuple[Cell, float]:
    """The best of the three ways to collapse a side, and its quality."""
    options = []
    for k in range(3):
        a, b, c = arcs[k], arcs[(k + 1) % 3], arcs[(k + 2) % 3]
        options.append(Cell((a, b, None, c)))
    q = quality(samples_of(options))
    best = int(np.argmax(q))
    return options[best], float(q[best])


def _disc(loop: Loop, chord: ChordMaker) -> list[Cell] | None:
    """A core and a ring of cells around it."""
    if len(loop) % 2:
        longest = max(range(len(loop)), key=lambda k: np.linalg.norm(loop[k].end - loop[k].start))
        loop = [*loop[:longest], *loop[longest].halves(), *loop[longest + 1 :]]
    outline = np.concatenate([a.samples[:-1] for a in loop])
    center = outline.mean(axis=0)
    scale = loop[0].scale
    inner = [(center + 0.5 * (a.start - center)) / scale for a in loop]
    n = len(loop)
    spokes = [chord(loop[k].start / scale, inner[k]) for k in range(n)]
    rim = [chord(inner[k], inner[(k + 1) % n]) for k in range(n)]
    cells = [
        Cell((loop[k], spokes[(k + 1) % n], rim[k].reversed(), spokes[k].reversed()))
        for k in range(n)
    ]
    previous = rim[0]
    for k in range(1, n - 2, 2):
        closing = rim[n - 1] if k == n - 3 else chord(inner[k + 2], inner[0])
        cells.append(Cell((previous, rim[k], rim[k + 1], closing)))
        previous = closing.reversed()
    if quality(samples_of(cells)).min() < PAIRED:
        return None
    return cells


def _halve(loops: list[Loop], bad: set[int]) -> list[Loop]:
    """Loops with the arcs of the given identities cut in two."""
    out = []
    for loop in loops:
        new: Loop = []
        for arc in loop:
            new.extend(arc.halves() if id(arc) in bad else [arc])
        out.append(new)
    return out


def _offenders(loops: list[Loop]) -> set[int]:
    """Curved arcs whose chord crosses another chord or has a foreign vertex between."""
    arcs = [a for loop in loops for a in loop]
    p, q = np.array([a.start for a in arcs]), np.array([a.end for a in arcs])
    hit = crossings(p, q)
    bad = {id(a) for a, h in zip(arcs, hit, strict=True) if h and not a.straight}
    curved = np.array([k for k, a in enumerate(arcs) if not a.straight], dtype=np.int64)
    if not len(curved):
        return bad
    samples = np.array([arcs[k].samples for k in curved.tolist()])
    low, high = samples.min(axis=1), samples.max(axis=1)
    # Only arcs with a foreign vertex in their box are looked at one by one.
    margin = 1e-7 * (high - low).max(axis=1)
    k, v = overlapping(low, high, p, p)
    foreign = np.ones(len(k), dtype=bool)
    for end in (samples[:, 0], samples[:, -1]):
        foreign &= np.abs(p[v] - end[k]).max(axis=1) > margin[k]
    k, v = k[foreign], v[foreign]
    for i, rows in rows_of(k, np.arange(len(curved))):
        if inside(samples[i], p[v[rows]]).any():
            bad.add(id(arcs[curved[i]]))
    return bad


def _with_sectors(loops: list[Loop], chord: ChordMaker) -> tuple[list[Loop], list[Cell]]:
    """Cut circular sectors off round corners: a smooth joint must not be a cell's corner."""
    cells: list[Cell] = []
    out: list[Loop] = []
    for loop in loops:
        turns = corner_turns(loop)
        new: Loop = []
        n = len(loop)
        for k, arc in enumerate(loop):
            joints = (abs(turns[k]), abs(turns[(k + 1) % n]))
            center = None if arc.straight or min(joints) > 0.35 else _center(arc)
            if center is None:
                new.append(arc)
                continue
            a, b = arc.start / arc.scale, arc.end / arc.scale
            c = center / arc.scale
            to, back = chord(a, c), chord(c, b)
            cells.append(Cell((arc, back.reversed(), None, to.reversed())))
            # Two sectors about one centre share a radius, which is then no boundary any more.
            if new and _same(new[-1].start, center, arc) and _same(new[-1].end, arc.start, arc):
                new[-1] = back
            else:
                new += [to, back]
        if len(new) > 2 and _same(new[0].end, new[-1].start, new[0]):
            same_way = _same(new[0].start, new[-1].end, new[0])
            if same_way and new[0].edge < 0 and new[-1].edge < 0:
                new = new[1:-1]
        out.append(new)
    return out, cells


def _same(p: FloatArray, q: FloatArray, arc: Arc) -> bool:
    size = float(np.abs(arc.end - arc.start).max())
    return bool(np.abs(p - q).max() < 1e-6 * max(size, 1e-12))


def _center(arc: Arc) -> FloatArray | None:
    """Centre of a convex arc that turns 40 to 100 degrees and is nearly circular, else None."""
    d0, d1 = arc.directions
    turn = math.atan2(d0[0] * d1[1] - d0[1] * d1[0], float(d0 @ d1))
    if not 0.7 < turn < 1.75:
        return None
    radius = 0.5 * float(np.linalg.norm(arc.end - arc.start)) / math.sin(0.5 * turn)
    center = arc.start + radius * np.array([-d0[1], d0[0]])
    distance = np.linalg.norm(arc.samples - center, axis=1)
    return center if np.abs(distance - radius).max() < 0.02 * radius else None


def _general(
    loops: list[Loop],
    chord: ChordMaker,
    planar: bool,
    folded: Callable[[list[Cell]], list[Cell]] | None,
    thin: float,
) -> list[Cell]:
    reason = ""
    fallback: list[Cell] | None = None
    fewest = 0
    loops = [loop if len(loop) > 2 else _split_up(loop) for loop in loops]
    tries = (True, False) if planar else (False,)
    for sectors in tries:
        current: list[Loop] = loops
        for round_ in range(7):
            for _ in range(6):
                bad = _offenders(current)
                if not bad:
                    break
                current = _halve(current, bad)
                if sum(len(loop) for loop in current) > MOST_ARCS:
                    raise GeometryError("the boundary touches or crosses itself")
            cut, extra = _with_sectors(current, chord) if sectors else (current, [])
            if sectors and not extra:
                break
            cut = [loop for loop in cut if len(loop) > 2]
            if not cut:
                return extra
            if sectors and not _clean(cut):
                break
            # Thin cells are worth three rounds of halving, folded ones more.
            limit = thin if round_ < 3 else FOLDED
            cells, worst, reason = _paired(cut, chord, limit)
            if cells is not None and not worst and folded is not None:
                for cell in folded(cells):
                    worst |= {id(a) for a in cell.sides if a is not None and not a.straight}
            if cells is not None and not worst:
                return extra + cells
            if cells is not None and (fallback is None or len(worst) < fewest):
                fallback, fewest = extra + cells, len(worst)
            if cells is None:
                curved = {id(a) for loop in current for a in loop if not a.straight}
                worst = curved or {id(a) for loop in current for a in loop}
            known = {id(a) for loop in current for a in loop}
            if not (worst & known):
                if cells is not None and not sectors:
                    return extra + cells
                break
            if sum(len(loop) for loop in current) > MOST_ARCS:
                break
            current = _halve(current, worst & known)
    if fallback is not None:
        return fallback  # thin cells; the area of the patches decides whether they may stay
    raise GeometryError(reason or "no valid decomposition into four-sided cells")


def _split_up(loop: Loop) -> Loop:
    """A loop of one or two arcs as four."""
    while len(loop) < 4:
        loop = [half for arc in loop for half in arc.halves()]
    return loop


def _clean(loops: list[Loop]) -> bool:
    arcs = [a for loop in loops for a in loop]
    p, q = np.array([a.start for a in arcs]), np.array([a.end for a in arcs])
    return not crossings(p, q).any()


def _paired(
    loops: list[Loop], chord: ChordMaker, limit: float
) -> tuple[list[Cell] | None, set[int], str]:
    """Cells of a triangulation, identities of the arcs to halve, and why it failed."""
    vertices = [np.array([a.start for a in loop]) for loop in loops]
    triangles = triangulate(vertices)
    if triangles is None:
        return None, set(), "the boundary touches or crosses itself"
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
    worst: set[int] = set()
    chosen_bad = [k for k in chosen if q[k] < limit]
    for k in chosen_bad:
        worst.update(id(a) for a in sides[k] if not a.straight)
    for i, t in enumerate(triangles):
        if i in used:
            continue
        three = [side(t[k], t[(k + 1) % 3]) for k in range(3)]
        cell, best = _triangle(three)
        if best < limit:
            worst.update(id(a) for a in three if not a.straight)
        cells.append(cell)
    return cells, worst, ""


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
