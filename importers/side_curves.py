"""Curves of the sides of cells in (u, v) and in space, for many sides at once."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, split_matrix

from .arcs import Arc, EdgeArc
from .compare import BoolArray
from .curves import BSpline
from .joined_arcs import BentArc
from .together import LAST, CurveBatch, rows_of

#: Share of a box that is not worth a patch of its own.
SLIVER = 1e-4
#: What follows the start of a line of no length: step, half angle and the fraction s / 1.
NOWHERE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0)


def shares(half: FloatArray, m: FloatArray, s: FloatArray) -> FloatArray:
    """`arcs.fraction` of half angles (n, 1) at the linear fractions ``m`` (n, 4) of s (n, a)."""
    if (m != NOWHERE[3:]).any():
        s = (m[:, :1] * s + m[:, 1:2]) / (m[:, 2:3] * s + m[:, 3:])
    if half.any():
        round_ = half > 1e-9
        h = np.where(round_, half, 1.0)
        s = np.where(round_, 0.5 + np.arctan((2.0 * s - 1.0) * np.tan(0.5 * h)) / h, s)
    return s


class Parted:
    """Sides that are several cubics, by their cell: starts, ends and nets of these."""

    def __init__(self, parts: dict[int, tuple[FloatArray, FloatArray, FloatArray]]) -> None:
        self._cells = np.array(sorted(parts), dtype=np.int64)
        if not parts:
            return
        ordered = [parts[c] for c in self._cells.tolist()]
        self._start, self._end, self._nets = (
            np.concatenate([p[k] for p in ordered]) for k in range(3)
        )
        self._count = np.array([len(p[0]) for p in ordered])
        self._first = np.cumsum(self._count) - self._count
        # The sides one after the other, so that all are searched at once.
        self._keys = np.repeat(np.arange(len(ordered)), self._count) + self._start

    def rows(self, cell: IntArray) -> tuple[IntArray, IntArray]:
        """Numbers of those of cells (m,) that are here, and their rows."""
        if not len(self._cells):
            return self._cells, self._cells
        own = np.minimum(np.searchsorted(self._cells, cell), len(self._cells) - 1)
        rows = np.flatnonzero(self._cells[own] == cell)
        return own[rows], rows

    def _at(self, own: IntArray, s: FloatArray) -> IntArray:
        """The cubic of side ``own`` (m,) that holds ``s`` (m,)."""
        found = np.searchsorted(self._keys, own + np.minimum(s, LAST), side="right") - 1
        return np.asarray(np.maximum(found, self._first[own]))

    def points(self, own: IntArray, s: FloatArray) -> FloatArray:
        """Points (m, a, 3) of sides ``own`` (m,) at ``s`` (m, a)."""
        flat = s.ravel()
        part = self._at(np.repeat(own, s.shape[1]), flat)
        local = (flat - self._start[part]) / (self._end - self._start)[part]
        h = (bernstein(local)[:, None] @ self._nets[part])[:, 0]
        return np.asarray((h[:, :3] / h[:, 3:]).reshape(*s.shape, 3))

    def restricted(
        self, own: IntArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Cubics (m, 4, 4) over [low, high], and where another one begins in between."""
        part = self._at(own, low)
        # A joint of parts very near to the end of a box would cut off a sliver.
        near = SLIVER * (high - low)
        last = (self._first + self._count)[own] - 1
        part = np.where((self._end[part] - low <= near) & (part < last), part + 1, part)
        start, length = self._start[part], (self._end - self._start)[part]
        inner = split_matrix((low - start) / length, (high - start) / length)
        return inner @ self._nets[part], np.asarray(high - self._end[part] > near)


class Curves:
    """Curved arcs numbered as given; splines of one degree are evaluated in one go."""

    def __init__(self, given: list[Arc]) -> None:
        bent = [i for i, arc in enumerate(given) if isinstance(arc, BentArc)]
        #: Number of the second piece of arcs of two, else -1; the first has the arc's own.
        self._second = np.full(len(given), -1, dtype=np.int64)
        self._second[bent] = len(given) + np.arange(len(bent))
        self._share = np.array([arc.share if isinstance(arc, BentArc) else 0.5 for arc in given])
        arcs = [arc.first if isinstance(arc, BentArc) else arc for arc in given]
        arcs += [arc.second for arc in given if isinstance(arc, BentArc)]
        self._arcs = arcs
        n = len(arcs)
        self._course, self._shift = np.zeros((n, 7)), np.zeros((n, 2))
        #: Degree of splines, else 0, and the place among those.
        self._degree, self._place = np.zeros((2, n), dtype=np.int64)
        splines: dict[int, list[BSpline]] = {}
        for i, arc in enumerate(arcs):
            course = arc.course() if isinstance(arc, EdgeArc) else None
            if course is None or not isinstance(arc.side.curve, BSpline):  # type: ignore[attr-defined]
                continue
            curve = arc.side.curve  # type: ignore[attr-defined]
            own = splines.setdefault(curve.degree, [])
            self._degree[i], self._place[i] = curve.degree, len(own)
            self._course[i], self._shift[i] = course, arc.side.shift  # type: ignore[attr-defined]
            own.append(curve)
        self._splines = {degree: CurveBatch(own) for degree, own in splines.items()}

    def at(self, which: IntArray, s: FloatArray) -> FloatArray:
        """(u, v) (m, a, 2) of the arcs ``which`` (m,) at ``s`` (m, a)."""
        second = self._second[which]
        bent = np.flatnonzero(second >= 0)
        if not len(bent):
            return self._pieces_at(which, s)
        out = np.empty((*s.shape, 2))
        whole = np.flatnonzero(second < 0)
        out[whole] = self._pieces_at(which[whole], s[whole])
        share, x = self._share[which[bent], None], s[bent]
        late = x >= share
        piece = np.where(late, second[bent, None], which[bent, None])
        local = np.where(late, (x - share) / (1.0 - share), x / share)
        found = self._pieces_at(piece.ravel(), local.reshape(-1, 1))
        out[bent] = found.reshape(*late.shape, 2)
        return out

    def _pieces_at(self, which: IntArray, s: FloatArray) -> FloatArray:
        out = np.empty((*s.shape, 2))
        degree = self._degree[which]
        for d in np.unique(degree).tolist():
            rows = np.flatnonzero(degree == d)
            own = which[rows]
            if d == 0:
                for k, some in rows_of(own, np.unique(own)):
                    arc = self._arcs[int(np.unique(own)[k])]
                    there = rows[some]
                    out[there] = arc.at(s[there].ravel()).reshape(len(there), -1, 2)
                continue
            c = self._course[own]
            t = c[:, :1] + c[:, 1:2] * shares(c[:, 2:3], c[:, 3:], s[rows])
            out[rows] = self._splines[d].evaluate(self._place[own], t) + self._shift[own][:, None]
        return out
