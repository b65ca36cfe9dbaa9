"""Sides of the cells of a face as arrays, evaluated for many boxes at once.

A box is a part (s0, s1, t0, t1) of a cell's unit square. Sides count 0 … 3 as v=0, u=1, v=1, u=0;
here each is run in the direction of +s or +t.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, sec. 22.1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, split_matrix

from .arcs import Arc, Chord, EdgeArc
from .cells import Cell
from .surfaces import Surface

BoolArray = NDArray[np.bool_]
#: Where the distance between a side and its edge in space is measured.
GAP_AT = np.linspace(0.0, 1.0, 9)
#: Share of a box that is not worth a patch of its own.
SLIVER = 1e-4
THIRDS = np.arange(4) / 3.0


class Sides:
    """The sides of some cells.

    Attributes
    ----------
    nets : (n, 4, 4, 4) array
        Rational cubics of the sides that lie on an edge in space; zeros elsewhere.
    on_edge : (n, 4) bool array
        Sides that lie on an edge in space.
    parts : dict
        By (cell, side): starts, ends and nets of sides that are several cubics; the others have one
        in ``nets``.
    collapsed : (n, 4) bool array
        Sides that are one point in (u, v).
    weights : (n, 4, 4) array
        Weights of the patch of each whole cell.
    """

    def __init__(self, cells: list[Cell]) -> None:
        n = len(cells)
        self.arcs: list[list[Arc | None]] = []
        self.nets = np.zeros((n, 4, 4, 4))
        self.on_edge = np.zeros((n, 4), dtype=bool)
        self.collapsed = np.zeros((n, 4), dtype=bool)
        self.names = np.array([c.edges for c in cells])
        self.parts: dict[tuple[int, int], tuple[FloatArray, FloatArray, FloatArray]] = {}
        self._straight = np.zeros((n, 4, 5))  # p, q − p and half angle of chords
        self._curved: list[tuple[int, int, Arc]] = []
        #: Shifts of the corners, from `measure_gaps`.
        self.corners = np.zeros((n, 4, 3))
        side_weights = np.ones((n, 4, 4))
        for c, cell in enumerate(cells):
            # +s or +t: sides 2 and 3 of a cell run the other way.
            row = [a if a is None or k < 2 else a.reversed() for k, a in enumerate(cell.sides)]
            self.arcs.append(row)
            for k, arc in enumerate(row):
                if arc is None:
                    self.collapsed[c, k] = True
                    continue
                side_weights[c, k] = arc.weights
                if arc.net is not None:
                    self.nets[c, k], self.on_edge[c, k] = arc.net, True
                elif isinstance(arc, EdgeArc):
                    a, b, nets = zip(*arc.parts, strict=True)
                    self.parts[c, k] = np.array(a), np.array(b), np.array(nets)
                    self.on_edge[c, k] = True
                if isinstance(arc, Chord):
                    self._straight[c, k] = (*arc.p, *(arc.q - arc.p), arc.half)
                else:
                    self._curved.append((c, k, arc))
            for k, arc in enumerate(row):
                if arc is None:
                    point = _corner(row, k)
                    self._straight[c, k, :2] = point
                    other = row[(k + 2) % 4]
                    # A collapsed side blends with the weights of the side opposite to it.
                    if other is not None:
                        side_weights[c, k] = other.weights
        self.weights = _blended(side_weights)

    def at(self, cell: IntArray, k: int, s: FloatArray) -> FloatArray:
        """(u, v) (m, a, 2) of side ``k`` of each ``cell`` (m,) at ``s`` (m, a)."""
        data = self._straight[cell, k]
        half = data[:, 4:]
        f = s
        if half.any():
            round_ = half > 1e-9
            h = np.where(round_, half, 1.0)
            f = np.where(round_, 0.5 + np.arctan((2.0 * s - 1.0) * np.tan(0.5 * h)) / h, s)
        out = data[:, None, :2] + f[..., None] * data[:, None, 2:4]
        for c, side, arc in self._curved:
            if side == k:
                rows = np.flatnonzero(cell == c)
                if len(rows):
                    out[rows] = arc.at(s[rows].ravel()).reshape(len(rows), -1, 2)
        return out

    def coons(self, cell: IntArray, s: FloatArray, t: FloatArray) -> FloatArray:
        """(u, v) (m, a, b, 2) of boxes with parameters ``s`` (m, a) and ``t`` (m, b). [1]"""
        ends = np.broadcast_to(np.array([0.0, 1.0]), (len(cell), 2))
        c = self.at(cell, 0, np.concatenate([s, ends], axis=1))
        d = self.at(cell, 2, np.concatenate([s, ends], axis=1))
        return boolean_sum(c, self.at(cell, 1, t), d, self.at(cell, 3, t), s, t)

    def space(self, k: int, cell: IntArray, s: FloatArray) -> FloatArray:
        """Points (m, a, 3) of side ``k`` of cells (m,) on edges at ``s`` (m, a)."""
        h = bernstein(s) @ self.nets[cell, k]
        out = h[..., :3] / np.where(h[..., 3:] > 0.0, h[..., 3:], 1.0)
        for c, side in self.parts:
            rows = np.flatnonzero(cell == c) if side == k else ()
            if len(rows):
                arc = self.arcs[c][k]
                assert isinstance(arc, EdgeArc)
                out[rows] = arc.space(s[rows].ravel()).reshape(len(rows), -1, 3)
        return np.asarray(out)

    def measure_gaps(self, surface: Surface, limit: float) -> tuple[FloatArray, bool]:
        """Gaps (n, 4) between the sides and their edges, and whether the surface must move.

        Sides further than ``limit`` from their edge are left where they are.
        """
        every = np.arange(len(self.names))
        at = np.broadcast_to(GAP_AT, (len(every), len(GAP_AT)))
        shift = np.zeros((len(every), 4, len(GAP_AT), 3))
        for k in range(4):
            uv = self.at(every, k, at)
            shift[:, k] = self.space(k, every, at) - surface.points(uv[..., 0], uv[..., 1])
        gap = np.where(self.on_edge, np.linalg.norm(shift, axis=-1).max(axis=-1), 0.0)
        self.on_edge &= gap <= limit
        shift[~self.on_edge] = 0.0
        # Corners (s, t) = (0, 0), (1, 0), (1, 1), (0, 1) follow an edge that ends there.
        ends = (((0, 0), (3, 0)), ((0, -1), (1, 0)), ((1, -1), (2, -1)), ((2, 0), (3, -1)))
        for corner, ((k, i), (m, j)) in enumerate(ends):
            first = self.on_edge[:, k, None]
            self.corners[:, corner] = np.where(first, shift[:, k, i], shift[:, m, j])
        return gap, bool(np.abs(shift).max() > 0.0)

    def shifts(self, surface: Surface, cell: IntArray, s: FloatArray, t: FloatArray) -> FloatArray:
        """How far (m, a, b, 3) points of boxes move so that the border meets the edges.

        The cubic blend moves next to nothing but the border.
        """
        ends = np.broadcast_to(np.array([0.0, 1.0]), (len(cell), 2))
        sides = []
        for k, x in enumerate((np.append(s, ends, axis=1), t, np.append(s, ends, axis=1), t)):
            uv = self.at(cell, k, x)
            edge = self.space(k, cell, x) - surface.points(uv[..., 0], uv[..., 1])
            first, last = ((0, 1), (1, 2), (3, 2), (0, 3))[k]
            p, q = self.corners[cell, first, None], self.corners[cell, last, None]
            line = p + x[..., None] * (q - p)
            sides.append(np.where(self.on_edge[cell, k, None, None], edge, line))
        return boolean_sum(sides[0], sides[1], sides[2], sides[3], s, t, power=3)

    def rows(
        self, cell: IntArray, k: int, a: FloatArray, b: FloatArray, matrices: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Cubics (m, 4, 4) over [a, b] (m,) of side ``k`` on an edge, and where to cut (m,).

        ``matrices`` (m, 4, 4) restrict a cubic to [a, b]; the cut is NaN where one part holds it.
        """
        out = matrices @ self.nets[cell, k]
        cut = np.full(len(cell), np.nan)
        for (c, side), (starts, ends, nets) in self.parts.items():
            if side != k:
                continue
            some = np.flatnonzero(cell == c)
            low, high = a[some], b[some]
            part = np.clip(np.searchsorted(starts, low, side="right") - 1, 0, len(starts) - 1)
            # A joint of parts very near to the end of a box would cut off a sliver.
            near = SLIVER * (high - low)
            part = np.where((ends[part] - low <= near) & (part < len(starts) - 1), part + 1, part)
            length = ends[part] - starts[part]
            inner = split_matrix((low - starts[part]) / length, (high - starts[part]) / length)
            out[some] = inner @ nets[part]
            middle = 0.5 * (low + high)
            joint = starts[np.argmin(np.abs(starts[None] - middle[:, None]), axis=1)]
            several = high - ends[part] > near
            cut[some] = np.where(several, joint, np.nan)
        return out, cut


def boolean_sum(
    c: FloatArray,
    right: FloatArray,
    d: FloatArray,
    left: FloatArray,
    s: FloatArray,
    t: FloatArray,
    power: int = 1,
) -> FloatArray:
    """Coons' blend (m, a, b, x) of four sides; ``c`` and ``d`` (m, a + 2, x) end with corners.

    Blending functions are (1 − s)^power and s^power.
    """
    s0, s1 = ((1 - s) ** power)[:, :, None, None], (s**power)[:, :, None, None]
    t0, t1 = ((1 - t) ** power)[:, None, :, None], (t**power)[:, None, :, None]
    cc, dd = c[:, None, None, -2:], d[:, None, None, -2:]
    out = t0 * c[:, :-2, None] + t1 * d[:, :-2, None]
    out = out + s0 * left[:, None] + s1 * right[:, None]
    out = out - s0 * (t0 * cc[..., 0, :] + t1 * dd[..., 0, :])
    return np.asarray(out - s1 * (t0 * cc[..., 1, :] + t1 * dd[..., 1, :]))


def _corner(row: list[Arc | None], k: int) -> FloatArray:
    """(u, v) of a collapsed side: the end of a neighbour, all run in +s and +t."""
    for other, at_end in (
        ((3, 0.0), (1, 0.0)), ((0, 1.0), (2, 1.0)), ((3, 1.0), (1, 1.0)), ((0, 0.0), (2, 0.0)),
    )[k]:  # fmt: skip
        arc = row[other]
        if arc is not None:
            return np.asarray(arc.at(np.array([at_end]))[0])
    raise ValueError("three sides of a cell are collapsed")


def _blended(w: FloatArray) -> FloatArray:
    """Weights (n, 4, 4) of patches from those of their sides (n, 4, 4)."""
    f = THIRDS
    along = (1 - f)[None, None, :] * w[:, 0, :, None] + f[None, None, :] * w[:, 2, :, None]
    across = (1 - f)[None, :, None] * w[:, 3, None, :] + f[None, :, None] * w[:, 1, None, :]
    ends = w[:, :, [0, 3]]
    corner = (1 - f)[:, None] * ((1 - f) * ends[:, 0, :1, None] + f * ends[:, 2, :1, None])
    corner = corner + f[:, None] * ((1 - f) * ends[:, 0, 1:, None] + f * ends[:, 2, 1:, None])
    # Opposite sides that agree give the product of both, whatever the weights of their ends.
    out = along * across / corner
    out[:, :, 0], out[:, :, 3], out[:, 0], out[:, 3] = w[:, 0], w[:, 2], w[:, 3], w[:, 1]
    return out
