"""Triangles of a region whose boundary is cut finer from round to round.

What a cut leaves as it is, is kept: triangles, lines between vertices, the quality of cells. A
region with a thousand holes is so worked on where it has to be, not all over again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from .arcs import Arc, EdgeArc
from .cells import (
    THIN,
    Cell,
    corner_sines,
    quality,
    samples_of,
    side_samples,
    straight_quality,
)
from .joined_arcs import bends, bent
from .triangulate import Pair, Triangle, border_of, clipped, flipped, nudged, settled

ChordMaker = Callable[[FloatArray, FloatArray], Arc]
Loop = list[Arc]
#: Corners of a cell, or of a triangle and the side that is collapsed, and which sides are curved.
Name = tuple[int, ...]

_NINTHS = np.linspace(0.0, 1.0, 9)[:, None]
#: Cells measured at a time: the temporary arrays stay in the processor's cache.
BLOCK = 256


class Mesh:
    """Triangles between the vertices of a region; `update` follows its boundary.

    Attributes
    ----------
    points : (n, 2) array
        All vertices so far, in scaled coordinates.
    triangles : list of (int, int, int)
        Delaunay's, counter-clockwise.
    """

    def __init__(self, chord: ChordMaker) -> None:
        self._chord = chord
        self._scale = np.ones(2)
        self._numbers: dict[tuple[float, ...], int] = {}
        self.points = np.zeros((0, 2))
        self.triangles: list[Triangle] = []
        self._moved: list[Triangle] = []
        self._border: dict[Pair, Arc] = {}
        self._curved = np.zeros(0, dtype=np.int64)
        self._lines: dict[Pair, Arc] = {}
        self._known: dict[Name, tuple[float, int]] = {}
        self._cells: dict[Name, Cell] = {}

    def update(self, loops: list[Loop]) -> bool:
        """Follow the boundary; False where there are no triangles of it."""
        before = len(self.points)
        numbers = self._named(loops)
        border = {
            pair: arc
            for loop, row in zip(loops, numbers, strict=True)
            for arc, pair in zip(loop, zip(row, [*row[1:], row[0]], strict=True), strict=True)
        }
        found = self._flipped(numbers, before)
        if found is None:
            self._moved = []
            return False
        self.triangles, self._border, self._scale = found, border, loops[0][0].scale
        keys = [a * len(self.points) + b for (a, b), arc in border.items() if not arc.straight]
        self._curved = np.sort(np.array(keys, dtype=np.int64))
        return True

    def _flipped(self, numbers: list[list[int]], before: int) -> list[Triangle] | None:
        """Delaunay's triangles within loops, of which ``before`` vertices were there already."""
        # They are kept as they are between displaced points: flat ones would hold up later flips.
        moved = nudged(self.points, len(numbers))
        border = border_of(numbers)
        found = None
        if self._moved and (refined := self._refined(numbers, before, moved)):
            self._moved = flipped(moved, refined[0], border, refined[1])
            found = settled(self.points, self._moved, numbers)
        if found is None and (anew := clipped(moved, numbers)):
            self._moved = flipped(moved, anew, border)
            found = settled(self.points, self._moved, numbers)
        return found

    def _named(self, loops: list[Loop]) -> list[list[int]]:
        """Numbers of the vertices of loops; those of earlier rounds keep theirs."""
        out, new = [], []
        times: dict[tuple[float, ...], int] = {}
        for loop in loops:
            row = []
            for place in np.array([a.start for a in loop]).tolist():
                # Loops may touch: vertices in one place are several all the same.
                again = times.get((place[0], place[1]), 0)
                times[place[0], place[1]] = again + 1
                name = (*place, again)
                number = self._numbers.get(name)
                if number is None:
                    number = self._numbers[name] = len(self._numbers)
                    new.append(place)
                row.append(number)
            out.append(row)
        if new:
            self.points = np.concatenate([self.points, np.array(new)])
        return out

    def _refined(
        self, numbers: list[list[int]], before: int, moved: FloatArray
    ) -> tuple[list[Triangle], list[Pair]] | None:
        """Triangles with the vertices that sides have been cut at, and their edges.

        None where some would be turned over.
        """
        after = {a: b for row in numbers for a, b in zip(row, [*row[1:], row[0]], strict=True)}
        gone = [(a, b) for a, b in self._border if after.get(a) != b]
        if 2 * len(gone) > len(self._border):
            return None  # nearly all is new
        tri = list(self._moved)
        owner = {(t[k - 1], t[k]): i for i, t in enumerate(tri) for k in range(3)}
        start: list[Pair] = []
        for a, b in gone:
            chain = [a]
            while chain[-1] != b:
                then = after.get(chain[-1])
                if then is None or (then < before and then != b):
                    return None
                chain.append(then)
            i = owner.pop((a, b), -1)
            if i < 0:
                return None  # loops that touch may have changed places: no triangle has that side
            c = sum(tri[i]) - a - b
            for k, (p, q) in enumerate(zip(chain[:-1], chain[1:], strict=True)):
                e, f = moved[q] - moved[p], moved[c] - moved[p]
                if e[0] * f[1] - e[1] * f[0] <= 0.0:
                    return None
                if k:
                    i = len(tri)
                    tri.append((p, q, c))
                else:
                    tri[i] = (p, q, c)
                owner[p, q] = owner[q, c] = owner[c, p] = i
                start += [(c, p), (q, c)]
        return tri, start

    def side(self, a: int, b: int) -> Arc:
        """The arc of the boundary from one vertex to another, or the line between them."""
        found = self._border.get((a, b)) or self._lines.get((a, b))
        if found is None:
            p, q = self.points[a] / self._scale, self.points[b] / self._scale
            found = self._lines[a, b] = self._chord(p, q)
            self._lines[b, a] = found.reversed()
        return found

    def quads(self, corners: IntArray) -> FloatArray:
        """Quality (m,) of quadrilaterals (m, 4) as cells."""
        if not len(corners):
            return np.empty(0)
        q = straight_quality(self.points[corners])
        bent = self._bent(corners)
        some = np.flatnonzero(bent.any(axis=1))
        q[some] = [x for x, _ in self._measured(corners[some], bent[some])]
        return q

    def alone(self, corners: IntArray) -> tuple[FloatArray, IntArray]:
        """Quality (m,) of triangles (m, 3) as cells with the side collapsed that suits them best.

        That is at the third corner from the side (m,) which is returned.
        """
        if not len(corners):
            return np.empty(0), np.empty(0, dtype=np.int64)
        # A collapsed corner does not count: the best is the one of the smallest angle.
        sines = corner_sines(self.points[corners])
        q, side = np.sort(sines, axis=1)[:, 1], (sines.argmin(axis=1) + 1) % 3
        bent = self._bent(corners)
        some = np.flatnonzero(bent.any(axis=1))
        found = self._measured(corners[some], bent[some])
        q[some], side[some] = [x for x, _ in found], [k for _, k in found]
        return q, side

    def _bent(self, corners: IntArray) -> FloatArray:
        """Which sides (m, k) of polygons are curved."""
        if not len(self._curved):
            return np.zeros(corners.shape, dtype=bool)
        key = corners * len(self.points) + np.roll(corners, -1, axis=1)
        at = np.minimum(np.searchsorted(self._curved, key), len(self._curved) - 1)
        return np.asarray(self._curved[at] == key)

    def _measured(self, corners: IntArray, bent: FloatArray) -> list[tuple[float, int]]:
        """Quality of polygons with curved sides and, of triangles, which side is collapsed."""
        names = [
            (*polygon, -1, *flags)
            for polygon, flags in zip(corners.tolist(), bent.tolist(), strict=True)
        ]
        first = {name: i for i, name in enumerate(names) if name not in self._known}
        rows = np.array(list(first.values()), dtype=np.int64)
        for k in range(0, len(rows), BLOCK):
            some = rows[k : k + BLOCK]
            for i, value in zip(
                some.tolist(), self._quality(corners[some], bent[some]), strict=True
            ):
                self._known[names[i]] = value
        return [self._known[name] for name in names]

    def _quality(self, corners: IntArray, bent: FloatArray) -> list[tuple[float, int]]:
        p = self.points[corners]
        samples = p[:, :, None] + _NINTHS * (np.roll(p, -1, axis=1) - p)[:, :, None]
        after = np.roll(corners, -1, axis=1)
        for i, k in zip(*(x.tolist() for x in np.nonzero(bent)), strict=True):
            samples[i, k] = side_samples(self._border[int(corners[i, k]), int(after[i, k])])
        if corners.shape[1] == 4:
            return [(x, 0) for x in quality(samples).tolist()]
        four = np.empty((len(p), 3, 4, 9, 2))
        for k in range(3):
            a, b, c = samples[:, k], samples[:, (k + 1) % 3], samples[:, (k + 2) % 3]
            four[:, k, 0], four[:, k, 1], four[:, k, 3] = a, b, c
            four[:, k, 2] = b[:, -1:]
        q = quality(four.reshape(-1, 4, 9, 2)).reshape(-1, 3)
        best = q.argmax(axis=1)
        return list(zip(q.max(axis=1).tolist(), best.tolist(), strict=True))

    def cell(self, corners: Sequence[int], collapsed: int = -1) -> Cell:
        """The cell of four corners, or of three with the side that a triangle is collapsed at."""
        n = len(corners)
        sides = [self.side(corners[k], corners[(k + 1) % n]) for k in range(n)]
        name = (*corners, collapsed, *(not a.straight for a in sides))
        found = self._cells.get(name)
        if found is None:
            if n == 4:
                found = Cell((sides[0], sides[1], sides[2], sides[3]))
            else:
                a, b, c = (sides[(collapsed + k) % 3] for k in range(3))
                found = _segment(sides) or Cell((a, b, None, c))
            self._cells[name] = found
        return found


def _segment(sides: list[Arc]) -> Cell | None:
    """The cell between a smooth curve of two arcs and its chord, where three sides are that.

    The vertex in the middle of the curve is neither a corner, at which parameter lines would run
    along each other, nor an end at which the cell could be collapsed.
    """
    for k in range(3):
        a, b, c = sides[k], sides[(k + 1) % 3], sides[(k + 2) % 3]
        if not isinstance(c, EdgeArc) and bends(a, b):
            cell = Cell((bent(a, b), None, c, None))
            return cell if quality(samples_of([cell]))[0] > THIN else None
    return None
