"""Sides of the cells of a face as arrays, evaluated for many boxes at once.

A box is a part (s0, s1, t0, t1) of a cell's unit square. Sides count 0 … 3 as v=0, u=1, v=1, u=0;
here each is run in the direction of +s or +t.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, sec. 22.1.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein

from .arcs import Arc, EdgeArc
from .boxes import Boxes
from .cells import Cell
from .compare import TINY, BoolArray
from .cuts import Cuts, Way
from .joined_arcs import BentArc
from .side_curves import NOWHERE, Curves, Parted, shares
from .surfaces import knot_lines
from .together import SurfaceBatch

#: Where the distance between a side and its edge in space is measured.
GAP_AT = np.linspace(0.0, 1.0, 9)
#: Corners of a face are one within this share of its extent in u and v.
SAME_CORNER = 1e-8
THIRDS = np.arange(4) / 3.0
ONCE = np.array([1])


class Sides:
    """The sides of the cells of some faces.

    Attributes
    ----------
    face : (n,) array
        Number of the face of each cell.
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

    def __init__(self, cells: list[Cell], face: IntArray, surfaces: SurfaceBatch) -> None:
        n = len(cells)
        self.face, self.surfaces = face, surfaces
        self.arcs: list[list[Arc | None]] = []
        self.nets = np.zeros((n, 4, 4, 4))
        self.on_edge = np.zeros((n, 4), dtype=bool)
        self.collapsed = np.zeros((n, 4), dtype=bool)
        self._names = np.array([c.edges for c in cells])
        #: Those of the second pieces of sides of two, and where these begin.
        self._later, self._share = self._names.copy(), np.full((n, 4), 0.5)
        self.parts: dict[tuple[int, int], tuple[FloatArray, FloatArray, FloatArray]] = {}
        straight: list[tuple[float, ...]] = []
        curved: list[Arc] = []
        #: Number of the curve of each side that is not straight, else -1.
        self._curve = np.full((n, 4), -1, dtype=np.int64)
        #: Shifts of the corners, from `measure_gaps`.
        self.corners = np.zeros((n, 4, 3))
        #: How far normals of cells lean over because they move [rad], from `measure_gaps`; 0 where
        #: nobody would notice.
        self.leans = np.zeros(n)
        side_weights = np.ones((n, 4, 4))
        for c, cell in enumerate(cells):
            # +s or +t: sides 2 and 3 of a cell run the other way.
            row = [a if a is None or k < 2 else a.reversed() for k, a in enumerate(cell.sides)]
            self.arcs.append(row)
            for k, arc in enumerate(row):
                if arc is None:
                    self.collapsed[c, k] = True
                    other = row[(k + 2) % 4]
                    # A collapsed side blends with the weights of the side opposite to it.
                    if other is not None:
                        side_weights[c, k] = other.weights
                    straight.append((*_corner(row, k).tolist(), *NOWHERE))
                    continue
                side_weights[c, k] = arc.weights
                if isinstance(arc, BentArc):
                    self._names[c, k], self._later[c, k] = arc.edge, arc.second.edge
                    self._share[c, k] = arc.share
                if arc.net is not None:
                    self.nets[c, k], self.on_edge[c, k] = arc.net, True
                elif isinstance(arc, EdgeArc):
                    a, b, nets = zip(*arc.parts, strict=True)
                    self.parts[c, k] = np.array(a), np.array(b), np.array(nets)
                    self.on_edge[c, k] = True
                line = arc.line()
                if line is None:
                    self._curve[c, k] = len(curved)
                    curved.append(arc)
                    line = (0.0, 0.0, *NOWHERE)
                straight.append(line)
        #: Start, step, half angle and linear fraction of straight sides.
        self._straight = np.array(straight).reshape(n, 4, 9)
        self._curves = Curves(curved)
        self._parted = [
            Parted({c: parts for (c, side), parts in self.parts.items() if side == k})
            for k in range(4)
        ]
        self.weights = _blended(side_weights)
        self.cuts = Cuts(self._own_cuts(), face, self.arcs)

    def edges(self, boxes: Boxes) -> IntArray:
        """B-rep edge (n, 4) of each side of boxes, −1 for none."""
        late = boxes.box[:, [0, 2, 0, 2]] >= self._share[boxes.cell]
        names = np.where(late, self._later[boxes.cell], self._names[boxes.cell])
        return np.where(boxes.on_border(), names, -1)

    def _own_cuts(self) -> dict[Way, list[FloatArray]]:
        """Joints of the cubics along the sides of each cell, and knots inside those cells that
        parameter lines bound."""
        out: dict[Way, list[FloatArray]] = defaultdict(list)
        for (c, k), (starts, _, _) in self.parts.items():
            out[c, k % 2].append(starts[1:])
        p, step, half, m = np.split(self._straight, (2, 4, 5), axis=2)
        a = p + m[..., 1:2] * step
        b = a + m[..., :1] * step
        linear = ((half == 0.0) & (m[..., 2:3] == 0.0) & (m[..., 3:] == 1.0)).all(axis=(1, 2))
        linear &= (self._curve < 0).all(axis=1)
        for c in np.flatnonzero(linear & ~self.collapsed.any(axis=1)).tolist():
            low, high = a[c, 0], b[c, 2]
            corners = np.array([a[c, 1], b[c, 3]])
            if (
                np.abs(corners - [[high[0], low[1]], [low[0], high[1]]]).max()
                > 1e-9 * np.abs(high - low).max()
            ):
                continue
            knots = knot_lines(self.surfaces.surfaces[self.face[c]], low, high)
            for k, line in enumerate(knots):
                if line is not None and len(line) > 2:
                    out[c, k].append((line[1:-1] - low[k]) / (high[k] - low[k]))
        return out

    def at(self, cell: IntArray, k: int, s: FloatArray) -> FloatArray:
        """(u, v) (m, a, 2) of side ``k`` of each ``cell`` (m,) at ``s`` (m, a)."""
        p, step, half, m = np.split(self._straight[cell, k, :, None], (2, 4, 5), axis=1)
        f = shares(half[:, 0], m[:, :, 0], s)
        out = np.asarray((p + f[:, None] * step).swapaxes(1, 2))
        curve = self._curve[cell, k]
        some = np.flatnonzero(curve >= 0)
        if len(some):
            out[some] = self._curves.at(curve[some], s[some])
        return out

    def coons(self, cell: IntArray, s: FloatArray, t: FloatArray) -> FloatArray:
        """(u, v) (m, a, b, 2) of boxes with parameters ``s`` (m, a) and ``t`` (m, b). [1]"""
        ends = np.broadcast_to(np.array([0.0, 1.0]), (len(cell), 2))
        c = self.at(cell, 0, np.concatenate([s, ends], axis=1))
        d = self.at(cell, 2, np.concatenate([s, ends], axis=1))
        return boolean_sum(c, self.at(cell, 1, t), d, self.at(cell, 3, t), s, t)

    def on_surface(self, k: int, cell: IntArray, s: FloatArray) -> FloatArray:
        """Points (m, a, 3) of the surface along side ``k`` of cells (m,) at ``s`` (m, a)."""
        uv = self.at(cell, k, s)
        return self.surfaces.points(self.face[cell], uv[..., 0], uv[..., 1])

    def space(self, k: int, cell: IntArray, s: FloatArray) -> FloatArray:
        """Points (m, a, 3) of side ``k`` of cells (m,) on edges at ``s`` (m, a)."""
        h = bernstein(s) @ self.nets[cell, k]
        out = h[..., :3] / np.where(h[..., 3:] > 0.0, h[..., 3:], 1.0)
        own, rows = self._parted[k].rows(cell)
        if len(rows):
            out[rows] = self._parted[k].points(own, s[rows])
        return np.asarray(out)

    def measure_gaps(self, limit: FloatArray, lean: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gaps (n, 4) between the sides and their edges, and how far (n,) cells move for them.

        Sides further than the ``limit`` (n,) from their edge are left where they are. ``lean`` (n,)
        is the angle [rad] that normals may lean over where a cell moves.
        """
        every = np.arange(len(self._names))
        at = np.broadcast_to(GAP_AT, (len(every), len(GAP_AT)))
        shift = np.zeros((len(every), 4, len(GAP_AT), 3))
        for k in range(4):
            some = np.flatnonzero(self.on_edge[:, k])
            there = at[: len(some)]
            shift[some, k] = self.space(k, some, there) - self.on_surface(k, some, there)
        gap = np.linalg.norm(shift, axis=-1).max(axis=-1)
        self.on_edge &= gap <= limit[:, None]
        shift[~self.on_edge] = 0.0
        # Corners (s, t) = (0, 0), (1, 0), (1, 1), (0, 1) follow an edge that ends there.
        ends = (((0, 0), (3, 0)), ((0, -1), (1, 0)), ((1, -1), (2, -1)), ((2, 0), (3, -1)))
        known = np.zeros((len(every), 4), dtype=bool)
        for corner, ((k, i), (m, j)) in enumerate(ends):
            first = self.on_edge[:, k, None]
            self.corners[:, corner] = np.where(first, shift[:, k, i], shift[:, m, j])
            known[:, corner] = self.on_edge[:, k] | self.on_edge[:, m]
        self._share_corners(known)
        moves = np.where(self.on_edge, gap, 0.0).max(axis=1)
        middle = np.full((len(every), 1), 0.5)
        a, b, c, d = (self.on_surface(k, every, middle)[:, 0] for k in range(4))
        width = np.minimum(np.linalg.norm(a - c, axis=1), np.linalg.norm(b - d, axis=1))
        # The slope of (1 − s)³ is 3 at the border.
        leans = 3.0 * moves / np.maximum(width, 1e-300)
        self._powers = np.where(leans > 0.5 * lean, 1, 3)
        leans = leans * self._powers / 3.0
        self.leans = np.where(leans > 0.1 * lean, leans, 0.0)
        return gap, moves

    def _share_corners(self, known: BoolArray) -> None:
        """Give the shifts of corners on an edge to cells that touch the edge there alone."""
        if known.all() or not self.corners.any():
            return
        every, ends = np.arange(len(known)), np.broadcast_to([0.0, 1.0], (len(known), 2))
        below, above = self.at(every, 0, ends), self.at(every, 2, ends)
        uv = np.concatenate([below, above[:, ::-1]], axis=1).reshape(-1, 2)
        face = np.repeat(self.face, 4)
        low, high = np.full((face.max() + 1, 2), np.inf), np.full((face.max() + 1, 2), -np.inf)
        np.minimum.at(low, face, uv)
        np.maximum.at(high, face, uv)
        place = np.round((uv - low[face]) / (SAME_CORNER * np.maximum(high - low, TINY)[face]))
        _, group = np.unique(np.column_stack([face, place]), axis=0, return_inverse=True)
        group, flat = group.ravel(), known.ravel()
        source = np.full(group.max() + 1, -1)
        source[group[flat]] = np.flatnonzero(flat)
        shifts = self.corners.reshape(-1, 3)
        rows = np.flatnonzero(~flat & (source[group] >= 0))
        shifts[rows] = shifts[source[group[rows]]]

    def shifts(self, cell: IntArray, s: FloatArray, t: FloatArray) -> FloatArray:
        """How far (m, a, b, 3) points of boxes move so that the border meets the edges.

        The cubic blend moves next to nothing but the border; the linear one of narrow cells bends
        least.
        """
        ends = np.broadcast_to(np.array([0.0, 1.0]), (len(cell), 2))
        sides = []
        for k, x in enumerate((np.append(s, ends, axis=1), t, np.append(s, ends, axis=1), t)):
            first, last = ((0, 1), (1, 2), (3, 2), (0, 3))[k]
            p, q = self.corners[cell, first, None], self.corners[cell, last, None]
            line = p + x[..., None] * (q - p)
            some = np.flatnonzero(self.on_edge[cell, k])
            own, at = cell[some], x[some]
            line[some] = self.space(k, own, at) - self.on_surface(k, own, at)
            sides.append(line)
        power = self._powers[cell]
        return boolean_sum(sides[0], sides[1], sides[2], sides[3], s, t, power)

    def rows(
        self, cell: IntArray, k: int, a: FloatArray, b: FloatArray, matrices: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Cubics (m, 4, 4) over [a, b] (m,) of side ``k`` on an edge.

        ``matrices`` (m, 4, 4) restrict a cubic to [a, b]. The mask (m,) tells where more than one
        of the edge's cubics lies there, which no cubic is.
        """
        out = matrices @ self.nets[cell, k]
        several = np.zeros(len(cell), dtype=bool)
        own, rows = self._parted[k].rows(cell)
        if len(rows):
            out[rows], several[rows] = self._parted[k].restricted(own, a[rows], b[rows])
        return out, several


def boolean_sum(
    c: FloatArray,
    right: FloatArray,
    d: FloatArray,
    left: FloatArray,
    s: FloatArray,
    t: FloatArray,
    power: IntArray = ONCE,
) -> FloatArray:
    """Coons' blend (m, a, b, x) of four sides; ``c`` and ``d`` (m, a + 2, x) end with corners.

    Blending functions are (1 − s)^power and s^power with a ``power`` (m,) or (1,).
    """
    n = power[:, None]
    s0, s1 = ((1 - s) ** n)[:, :, None, None], (s**n)[:, :, None, None]
    t0, t1 = ((1 - t) ** n)[:, None, :, None], (t**n)[:, None, :, None]
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
