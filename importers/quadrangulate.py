"""Regions of the (u, v) domain cut into few well-shaped four-sided cells.

A region with three or four corners is one cell, some with five are two, and a smooth disc five;
anything else goes through a constrained Delaunay triangulation whose triangles are paired, fewest
partners first. A triangle left over is a cell with one collapsed side.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray, IntArray

from .arcs import Arc, EdgeArc, NetArc, corner_turns
from .cells import Cell, quality, samples_of
from .mesh import ChordMaker, Loop, Mesh
from .pairing import PAIRED, THIN, Wanted, best_triangle, paired
from .strips import joints, pieces
from .together import rows_of
from .triangulate import crossings, inside, overlapping

GOOD = 0.2
#: Quality below which halving of sides goes on where cells of less have failed.
STRICT = 0.25
FOLDED = 1e-3
#: Halving ends with more arcs than `FEW_ARCS` and than `GROWTH` times those of the boundary: that
#: is near a place where it touches itself, at which no halving ever ends.
FEW_ARCS = 1000
GROWTH = 4
#: Arcs that all rounds together may pair, against most of one: each takes seconds then.
ROUNDS = 2
#: What a round costs in which little is new, against one from the start.
KEPT_COST = 0.4
#: Rounds without any triangles after which halving is given up where there were some before: the
#: boundary crosses itself by now, and each round has twice as many arcs.
IN_VAIN = 2
#: Halvings of a boundary where it comes near to itself: a 4000th of an arc.
MOST_ROUNDS = 12


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
        cell, best = best_triangle(loop)
        if best > max(PAIRED, thin):
            return [cell]
    if len(loop) == 4 and (turns > math.radians(25.0)).all():
        cell = Cell((loop[0], loop[1], loop[2], loop[3]))
        # Between straight sides the angles are between those of the corners.
        if all(a.straight for a in loop) and np.sin(turns).min() > GOOD:
            return [cell]
        if quality(samples_of([cell]))[0] > GOOD:
            return [cell]
    if len(loop) == 5 and (turns > math.radians(25.0)).all():
        two = _halved(loop, chord)
        if two is not None:
            return two
    if 4 <= len(loop) <= 8 and (np.abs(turns) < math.radians(30.0)).all():
        return _disc(loop, chord)
    return None


def _halved(loop: Loop, chord: ChordMaker) -> list[Cell] | None:
    """Five sides as two cells, cut from a corner to a joint of the side opposite to it.

    Patches end at joints anyhow; None where there is none, or the cells are of bad shape.
    """
    options = []
    for k in range(5):
        a, b, opposite, c, d = (loop[(k + m) % 5] for m in range(5))
        for s in joints(opposite):
            assert isinstance(opposite, EdgeArc)
            first, second = pieces(opposite, [s])
            line = chord(first.end / first.scale, a.start / a.scale)
            options.append((Cell((a, b, first, line)), Cell((line.reversed(), second, c, d))))
    if not options:
        return None
    q = quality(samples_of([cell for two in options for cell in two])).reshape(-1, 2).min(axis=1)
    best = int(q.argmax())
    return list(options[best]) if q[best] > GOOD else None


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


def _cut(loops: list[Loop], wanted: Wanted) -> list[Loop]:
    """Loops with the arcs of the given identities cut where it is wanted, or in two."""
    out = []
    for loop in loops:
        new: Loop = []
        for arc in loop:
            at = wanted.get(id(arc))
            if at and isinstance(arc, NetArc | EdgeArc):
                cuts = _apart(at)
                new.extend(arc.cut(cuts) if cuts else arc.halves())
            else:
                new.extend([arc] if at is None else arc.halves())
        out.append(new)
    return out


def _apart(shares: list[float]) -> list[float]:
    """Shares of a length in order, those left out that are much nearer to the one before than
    they are on average."""
    ordered = sorted(shares)
    least = 0.1 / (len(ordered) + 1)
    out: list[float] = []
    for x in ordered:
        if x - (out[-1] if out else 0.0) > least and 1.0 - x > least:
            out.append(x)
    return out


def _offenders(loops: list[Loop]) -> Wanted:
    """Curved arcs whose chord crosses another chord or has a foreign vertex between."""
    arcs = [a for loop in loops for a in loop]
    p, after = _vertices(loops)
    hit = crossings(p, p[after])
    bad: Wanted = {id(a): [] for a, h in zip(arcs, hit, strict=True) if h and not a.straight}
    curved = np.array([k for k, a in enumerate(arcs) if not a.straight], dtype=np.int64)
    if not len(curved):
        return bad
    samples = np.array([arcs[k].samples for k in curved.tolist()])
    low, high = samples.min(axis=1), samples.max(axis=1)
    # Only arcs with a foreign vertex in their box are looked at one by one.
    margin = 1e-7 * (high - low).max(axis=1)
    k, v = overlapping(low, high, p, p)
    # Arcs may end a little beside the start of the next one, however short they are.
    foreign = (v != curved[k]) & (v != after[curved[k]])
    for end in (samples[:, 0], samples[:, -1]):
        foreign &= np.abs(p[v] - end[k]).max(axis=1) > margin[k]
    k, v = k[foreign], v[foreign]
    for i, rows in rows_of(k, np.arange(len(curved))):
        if inside(samples[i], p[v[rows]]).any():
            bad[id(arcs[curved[i]])] = []
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
    most = max(FEW_ARCS, GROWTH * sum(len(loop) for loop in loops))
    tries = (True, False) if planar else (False,)
    spent = 0.0
    for sectors in tries:
        current: list[Loop] = loops
        mesh = Mesh(chord)
        vain = 0
        folds: dict[int, bool] = {}
        for round_ in range(MOST_ROUNDS):
            for _ in range(6):
                bad = _offenders(current)
                if not bad:
                    break
                current = _cut(current, bad)
                if sum(len(loop) for loop in current) > most:
                    raise GeometryError("the boundary touches or crosses itself")
            cut, extra = _with_sectors(current, chord) if sectors else (current, [])
            if sectors and not extra:
                break
            cut = [loop for loop in cut if len(loop) > 2]
            if not cut:
                return extra
            if sectors and not _clean(cut):
                break
            if spent > ROUNDS * most:
                reason = reason or "the boundary touches or crosses itself"
                break
            # Thin cells are worth three rounds of halving, folded ones more.
            limit = thin if round_ < 3 else FOLDED
            spent += sum(len(loop) for loop in cut) * (KEPT_COST if mesh.triangles else 1.0)
            cells, worst, reason = paired(mesh, cut, limit)
            if cells is not None and folded is not None and (not worst or round_ > 1):
                # The mesh keeps cells that stay the same.
                new = [c for c in cells if id(c) not in folds]
                folds |= dict.fromkeys(map(id, new), False)
                folds |= dict.fromkeys(map(id, folded(new)), True)
                for cell in cells:
                    if folds[id(cell)]:
                        worst |= {id(a): [] for a in cell.sides if a is not None and not a.straight}
            if cells is not None and not worst:
                return extra + cells
            if cells is not None and (fallback is None or len(worst) < fewest):
                fallback, fewest = extra + cells, len(worst)
            vain = vain + 1 if cells is None else 0
            if vain == IN_VAIN and fallback is not None:
                break
            if cells is None:
                every = [a for loop in current for a in loop]
                worst = {id(a): [] for a in [a for a in every if not a.straight] or every}
            known = {id(a) for loop in current for a in loop}
            if not (worst.keys() & known):
                if cells is not None and not sectors:
                    return extra + cells
                break
            if sum(len(loop) for loop in current) > most:
                break
            current = _cut(current, worst)
    if fallback is not None:
        return fallback  # thin cells; the area of the patches decides whether they may stay
    raise GeometryError(reason or "no valid decomposition into four-sided cells")


def _split_up(loop: Loop) -> Loop:
    """A loop of one or two arcs as four."""
    while len(loop) < 4:
        loop = [half for arc in loop for half in arc.halves()]
    return loop


def _vertices(loops: list[Loop]) -> tuple[FloatArray, IntArray]:
    """Starts (n, 2) of all arcs, and the number (n,) of the arc that follows each one."""
    points = np.array([a.start for loop in loops for a in loop])
    after, base = [], 0
    for loop in loops:
        after += [*range(base + 1, base + len(loop)), base]
        base += len(loop)
    return points, np.array(after)


def _clean(loops: list[Loop]) -> bool:
    p, after = _vertices(loops)
    return not crossings(p, p[after]).any()
