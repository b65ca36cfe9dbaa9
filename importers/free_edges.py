"""Edges of a part at which nothing goes on: one face ends there and no other begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import gauss_rule

from .compare import BoolArray
from .extract import Edge
from .together import points_of
from .triangulate import overlapping

#: Where edges are sampled to find those that lie on each other.
INNER = np.linspace(0.0, 1.0, 33)
#: Places within a stretch of an edge at which it must lie on another one.
WITHIN = np.array([0.25, 0.5, 0.75])
#: Share of an edge that is no stretch of its own, however small the tolerance.
CLOSE = 1e-6
#: Points that are compared with edges at a time: the temporary arrays stay small.
BLOCK = 2000
#: Share of the way along an edge that the nearest points of one on which it lies go with it: edges
#: shorter than the tolerance are near all others at their ends, but those do not run along them.
ALONG = 0.5
#: Share of the tolerance by which a chord may leave its curve: the curve need not be asked.
STRAIGHT = 1e-3
#: Steps of Newton's method from the nearest chord to the nearest point of a curve.
STEPS = 3


@dataclass(slots=True)
class Lone:
    """Edges (n,) that one face alone uses, and where they lie on each other and on shared ones.

    ``free`` (n,) is the length of each one on which no other lies [file units], ``others`` (n,) the
    largest number of others that lie on a stretch of it, shared ones counted twice. A stretch of
    ``edge`` (m,) lies on ``other`` (m,), at the shares ``at`` (m, 3) of the one and ``on`` (m, 3)
    of the other. Rows of ``other`` from n on are shared edges.
    """

    free: FloatArray
    others: IntArray
    edge: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    other: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    at: FloatArray = field(default_factory=lambda: np.zeros((0, len(WITHIN))))
    on: FloatArray = field(default_factory=lambda: np.zeros((0, len(WITHIN))))


def lone_edges(edges: Sequence[Edge], shared: Sequence[Edge], tolerance: float) -> Lone:
    """Which stretches of some edges lie on others of them, or on edges that two faces share.

    Faces that were never sewn together close up all the same, also where one edge meets several
    shorter ones: each is divided where others end on it. Edges lie on each other within
    ``tolerance`` [file units].
    """
    n = len(edges)
    found = Lone(np.zeros(n), np.zeros(n, dtype=np.int64))
    if not n:
        return found
    lines = _Lines([*edges, *shared], tolerance)
    first, second = lines.near()
    first, second = first[first < n], second[first < n]
    cuts = _ends_on(lines, first, second)[:n]
    # Ends of edges that meet to the tolerance alone divide nothing, and neither do those of several
    # edges that end in one place.
    least = np.maximum(CLOSE, tolerance / np.maximum(lines.length, 1e-300))
    inner = [_cuts(c, s) for c, s in zip(cuts, least[:n].tolist(), strict=True)]
    edge = np.repeat(np.arange(n), [len(c) - 1 for c in inner])
    start, end = np.concatenate([c[:-1] for c in inner]), np.concatenate([c[1:] for c in inner])
    at = start[:, None] + (end - start)[:, None] * WITHIN
    # Each stretch with each edge that is near its own one.
    order = np.argsort(first, kind="stable")
    base = np.searchsorted(first[order], edge)
    count = np.searchsorted(first[order], edge, side="right") - base
    stretch = np.repeat(np.arange(len(edge)), count)
    step = np.arange(len(stretch)) - np.repeat(np.cumsum(count) - count, count)
    other = second[order][np.repeat(base, count) + step]
    points = lines.points_at(edge, at)
    on, off = lines.nearest(points[stretch], other)
    met = np.flatnonzero((off <= tolerance).all(axis=1))
    met = met[lines.advance(points[stretch[met]], other[met], on[met])]
    stretch, found.other, found.on = stretch[met], other[met], on[met]
    found.edge, found.at = edge[stretch], at[stretch]
    times = np.bincount(np.append(stretch, stretch[found.other >= n]), minlength=len(edge))
    np.maximum.at(found.others, edge, times)
    for k in np.flatnonzero(times == 0).tolist():
        found.free[edge[k]] += length(edges[edge[k]], float(start[k]), float(end[k]))
    return found


def length(edge: Edge, a: float, b: float) -> float:
    """Length of an edge between the shares ``a`` and ``b`` of its parameters. [file units]"""
    assert edge.curve is not None
    x, w = gauss_rule(8)
    extent = edge.end - edge.start
    breaks = edge.curve.breaks(edge.start + a * extent, edge.start + b * extent)
    # Ellipses turn the whole way round within one span.
    cuts = np.append(np.linspace(breaks[:-1], breaks[1:], 4, endpoint=False).T, breaks[-1])
    steps = np.diff(cuts)
    t = cuts[:-1, None] + steps[:, None] * x
    speed = np.linalg.norm(edge.curve.slope(t.ravel()), axis=-1).reshape(t.shape)
    return float(steps @ speed @ w)


def _cuts(shares: list[float], least: float) -> FloatArray:
    """0, the shares in order, and 1, those left out that are as good as one: ``least`` apart."""
    out = [0.0]
    for share in sorted(shares):
        if share - out[-1] > least and 1.0 - share > least:
            out.append(share)
    return np.array([*out, 1.0])


class _Lines:
    """Edges as polygons (n, 33, 3), which lie on each other within ``tolerance``."""

    def __init__(self, edges: Sequence[Edge], tolerance: float) -> None:
        self.edges = edges
        self.tolerance = tolerance
        every = np.broadcast_to(INNER, (len(edges), len(INNER)))
        self.points = self.points_at(np.arange(len(edges)), every)
        self.chords = np.diff(self.points, axis=1)
        # A chord leaves its curve by an eighth of its length times the angle that turns.
        bend = np.linalg.norm(np.diff(self.chords, axis=1), axis=2)
        bend = np.maximum(np.pad(bend, ((0, 0), (1, 0))), np.pad(bend, ((0, 0), (0, 1))))
        self.sagitta = bend / 8.0
        self.length = np.linalg.norm(self.chords, axis=2).sum(axis=1)

    def points_at(self, which: IntArray, shares: FloatArray) -> FloatArray:
        """Points (m, k, 3) of the edges ``which`` (m,) at ``shares`` (m, k)."""
        edges = [self.edges[i] for i in which.tolist()]
        ends = np.array([(e.start, e.end) for e in edges]).reshape(-1, 2)
        curves = [e.curve for e in edges if e.curve is not None]
        return points_of(curves, ends[:, :1] + np.diff(ends) * shares, 3)

    def near(self) -> tuple[IntArray, IntArray]:
        """Pairs of different edges whose boxes are nearer than the tolerance, both ways round."""
        margin = self.tolerance + self.sagitta.max(axis=1)[:, None]
        low, high = self.points.min(axis=1) - margin, self.points.max(axis=1) + margin
        i, j = overlapping(low[:, :2], high[:, :2], low[:, :2], high[:, :2])
        keep = (i != j) & (low[i, 2] <= high[j, 2]) & (low[j, 2] <= high[i, 2])
        return i[keep], j[keep]

    def advance(self, points: FloatArray, which: IntArray, shares: FloatArray) -> BoolArray:
        """Whether places (m, k) on the edges ``which`` (m,) go along with points (m, k, 3)."""
        step = np.diff(points, axis=1)
        beside = np.diff(self.points_at(which, shares), axis=1)
        return np.asarray(
            ((step * beside).sum(axis=2) > ALONG * (step * step).sum(axis=2)).all(axis=1)
        )

    def nearest(self, points: FloatArray, which: IntArray) -> tuple[FloatArray, FloatArray]:
        """Shares (m, k) of the edges ``which`` (m,) nearest to ``points`` (m, k, 3), distances.

        Where an edge is farther away than the tolerance, both are those of its polygon.
        """
        share, off = np.empty(points.shape[:2]), np.empty(points.shape[:2])
        for a in range(0, len(which), BLOCK):
            some = slice(a, a + BLOCK)
            share[some], off[some] = self._nearest(points[some], which[some])
        return share, off

    def _nearest(self, points: FloatArray, which: IntArray) -> tuple[FloatArray, FloatArray]:
        d = self.chords[which][:, None]
        away = points[:, :, None] - self.points[which][:, None, :-1]
        square = np.maximum((d * d).sum(axis=3), 1e-300)
        along = np.clip((away * d).sum(axis=3) / square, 0.0, 1.0)
        off = np.linalg.norm(away - along[..., None] * d, axis=3)
        best = off.argmin(axis=2)[..., None]
        share = (best + np.take_along_axis(along, best, axis=2))[..., 0] / (len(INNER) - 1)
        found = np.take_along_axis(off, best, axis=2)[..., 0]
        # Chords leave the curve: there the curve itself is asked.
        bent = np.take_along_axis(self.sagitta[which][:, None], best, axis=2)[..., 0]
        ask = (bent > STRAIGHT * self.tolerance) & (found <= self.tolerance + bent)
        for row in np.flatnonzero(ask.any(axis=1)).tolist():
            share[row], found[row] = self._on_curve(int(which[row]), points[row], share[row])
        return share, found

    def _on_curve(
        self, i: int, points: FloatArray, share: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Shares (k,) and distances from points (k, 3) to a curve, from shares close to them.

        Of all steps the nearest ones: they need not come nearer where the curve turns sharply.
        """
        edge = self.edges[i]
        assert edge.curve is not None
        extent = edge.end - edge.start
        best, nearest = share, np.full(len(points), np.inf)
        for step in range(STEPS + 1):
            t = edge.start + share * extent
            away = points - edge.curve.evaluate(t)
            off = np.linalg.norm(away, axis=1)
            best, nearest = np.where(off < nearest, share, best), np.minimum(off, nearest)
            if step < STEPS:
                d = edge.curve.slope(t) * extent
                along = (away * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300)
                share = np.clip(share + along, 0.0, 1.0)
        return best, nearest


def _ends_on(lines: _Lines, first: IntArray, second: IntArray) -> list[list[float]]:
    """Shares of each edge at which another one ends on it."""
    ends = lines.points[:, [0, -1]]
    share, off = lines.nearest(ends[second], first)
    cuts: list[list[float]] = [[] for _ in lines.edges]
    rows, k = np.nonzero(off <= lines.tolerance)
    for i, s in zip(first[rows].tolist(), share[rows, k].tolist(), strict=True):
        cuts[i].append(s)
    return cuts
