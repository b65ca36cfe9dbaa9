"""B-rep edges in space as chains of rational cubic pieces, shared by both faces of the edge.

Lines, conics and splines of degree <= 3 are exact; everything else is interpolated at the
Chebyshev–Lobatto nodes (0, 1/4, 3/4, 1) and halved until it is within the tolerance.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 12 and 13.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein

from . import nurbs
from .curves import SMOOTH, BSpline, Conic, Curve
from .extract import Edge
from .together import rows_of

LOBATTO = np.array([0.0, 0.25, 0.75, 1.0])
#: Control points of a cubic from its values at the Lobatto nodes.
TO_CONTROL = np.linalg.inv(bernstein(LOBATTO))
QUARTER = 0.5 * math.pi
#: Share of the limit by which all parts of a curve together may turn more than so many times that:
#: where two cylinders meet, the curve turns a little more than once around.
SLACK = 0.2
#: Relative distance below which two curves are the same to rounding.
SAME_CURVE = 1e-10
#: Largest distance between an edge and its chain as a share of the edge's extent. The chain swings
#: from one side of the edge to the other, so that the areas of faces keep 1e-4 of their size: over
#: real files none is off at 2e-4, and 8 of 1500 are at 5e-4.
SHARE = 2e-4
#: More exact pieces than this on one edge are replaced by fewer approximate ones if possible.
MANY_PIECES = 24


#: Start, end (shares of a piece) and rational cubic (4, 4) of a part of it.
Part = tuple[float, float, FloatArray]


@dataclass(slots=True)
class Piece:
    """An edge between two stations, over its parameters [start, end], as a rational cubic (4, 4).

    ``kind`` says how the cubic's own parameter s in [0, 1] runs along the edge's: "linear",
    "ellipse" and "hyperbola" (half angles), "rational" (a linear fraction of ``ratio``). Where one
    cubic is not near enough, ``parts`` are the cubics of halves, quarters … of it. All end weights
    are 1.
    """

    start: float
    end: float
    net: FloatArray
    exact: bool
    kind: str = "linear"
    ratio: float = 1.0
    parts: list[Part] = field(default_factory=list)

    @property
    def cubics(self) -> list[FloatArray]:
        """The cubics that the piece consists of."""
        return [net for _, _, net in self.parts] or [self.net]

    def parameter(self, s: FloatArray) -> FloatArray:
        """Parameter of the edge at ``s``."""
        middle, half = 0.5 * (self.start + self.end), 0.5 * (self.end - self.start)
        if self.kind == "ellipse":
            return np.asarray(middle + 2.0 * np.arctan((2.0 * s - 1.0) * math.tan(0.5 * half)))
        if self.kind == "hyperbola":
            return np.asarray(middle + 2.0 * np.arctanh((2.0 * s - 1.0) * math.tanh(0.5 * half)))
        if self.kind == "rational":
            s = self.ratio * s / (1.0 - s + self.ratio * s)
        return np.asarray(self.start + (self.end - self.start) * s)

    def local(self, t: float) -> float:
        """The cubic's own parameter at the edge's parameter ``t``."""
        middle, half = 0.5 * (self.start + self.end), 0.5 * (self.end - self.start)
        if self.kind == "ellipse":
            return 0.5 + 0.5 * math.tan(0.5 * (t - middle)) / math.tan(0.5 * half)
        if self.kind == "hyperbola":
            return 0.5 + 0.5 * math.tanh(0.5 * (t - middle)) / math.tanh(0.5 * half)
        s = (t - self.start) / (self.end - self.start)
        return s / (self.ratio * (1.0 - s) + s)


def normalised(net: FloatArray) -> FloatArray:
    """The same curve with end weights 1: coefficients scaled by c λ^i. [1, sec. 13.7]"""
    first, last = net[0, -1], net[-1, -1]
    ratio = (first / last) ** (1.0 / (len(net) - 1))
    out = np.asarray(net / first * (ratio ** np.arange(len(net)))[:, None])
    out[-1] /= out[-1, -1]
    return out


def turning(curve: Curve, a: float, b: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Parameters, accumulated turning angle [rad] at them, and the kinks inside [a, b]."""
    breaks = curve.breaks(a, b)
    per_span = 16 if len(breaks) < 8 else 6
    inner = np.linspace(0.0, 1.0, per_span + 1)
    inner[0], inner[-1] = 1e-6, 1.0 - 1e-6
    t = (breaks[:-1, None] + np.diff(breaks)[:, None] * inner).ravel()
    d = curve.slope(t)
    length = np.linalg.norm(d, axis=1)
    ok = length > 1e-12 * max(float(length.max()), 1e-300)
    t, d = t[ok], d[ok] / length[ok, None]
    if len(t) < 2:
        return np.array([a, b]), np.zeros(2), np.empty(0)
    chord = np.linalg.norm(np.diff(d, axis=0), axis=1)
    angle = 2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
    close = np.diff(t) < 1e-4 * (b - a) / len(breaks)
    kink = close & (angle > SMOOTH)
    angle[kink] = 0.0
    return t, np.concatenate([[0.0], np.cumsum(angle)]), 0.5 * (t[:-1] + t[1:])[kink]


def split_by_turning(curve: Curve, a: float, b: float, limit: float = QUARTER) -> FloatArray:
    """Parameters from a to b, cut at kinks and so that each part turns about ``limit`` at most."""
    if curve.straight:
        return np.array([a, b])
    if isinstance(curve, Conic) and curve.kind == "ellipse":
        n = max(1, math.ceil((b - a) / limit - 1e-9))
        return np.linspace(a, b, n + 1)
    if isinstance(curve, BSpline) and curve.turn <= (1.0 + SLACK) * limit:
        return np.array([a, b])
    t, total, kinks = turning(curve, a, b)
    stations = [a]
    for low, high in zip([a, *kinks], [*kinks, b], strict=True):
        at = np.interp([low, high], t, total)
        n = max(1, math.ceil((at[1] - at[0]) / limit - SLACK))
        targets = at[0] + (at[1] - at[0]) * np.arange(1, n) / n
        inside = (t > low) & (t < high)
        if n > 1 and inside.sum() > 1:
            # Strictly rising abscissae, for the inverse of a monotone function.
            rising = total[inside] + 1e-12 * np.arange(inside.sum())
            stations.extend(np.interp(targets, rising, t[inside]).tolist())
        stations.append(float(high))
    return np.array(stations)


def stations(edge: Edge) -> FloatArray:
    """Parameters at which both faces of an edge may have patch corners; made once an edge."""
    if edge.stations is None:
        if edge.curve is None:
            edge.stations = np.array([edge.start, edge.end])
        else:
            edge.stations = split_by_turning(edge.curve, edge.start, edge.end)
    return edge.stations


def interpolated(curve: Curve, a: float, b: float) -> FloatArray:
    """Homogeneous cubic (4, d + 1) through the curve at the Lobatto nodes of [a, b]."""
    points = TO_CONTROL @ curve.evaluate(a + (b - a) * LOBATTO)
    return np.concatenate([points, np.ones((4, 1))], axis=1)


_CHECK = np.array([0.06, 0.12, 0.37, 0.5, 0.63, 0.88, 0.94])
_AT = np.unique(np.concatenate([LOBATTO, _CHECK]))
_AT_NODES, _AT_CHECK = np.searchsorted(_AT, LOBATTO), np.searchsorted(_AT, _CHECK)
DEEPEST = 12


def _approximate(curve: Curve, cuts: FloatArray, tolerance: float) -> list[Piece]:
    """Pieces between ``cuts``, halved until they are within ``tolerance`` of the curve.

    Along the curve points may be four times as far from those of the same parameter.
    """
    ends = curve.evaluate(np.linspace(cuts[0], cuts[-1], 9))
    tolerance = min(tolerance, SHARE * float(np.ptp(ends, axis=0).max()))
    basis = bernstein(_CHECK)
    low, extent = cuts[:-1, None], np.diff(cuts)[:, None]
    knots = [(curve.breaks(a, b)[1:-1] - a) / (b - a) for a, b in itertools.pairwise(cuts.tolist())]
    pieces: list[Piece] = []
    # Parts [s0, s1] of the pieces k, those of all pieces at once.
    k, s0, s1 = np.arange(len(low)), np.zeros(len(low)), np.ones(len(low))
    for depth in range(DEEPEST + 1):
        t = low[k] + extent[k] * (s0[:, None] + (s1 - s0)[:, None] * _AT)
        points, slopes = (x.reshape(*t.shape, -1) for x in curve.both(t.ravel()))
        net = np.ones((len(k), 4, points.shape[2] + 1))
        net[..., :-1] = TO_CONTROL @ points[:, _AT_NODES]
        offset = basis @ net[..., :-1] - points[:, _AT_CHECK]
        d = slopes[:, _AT_CHECK]
        d = d / np.maximum(np.linalg.norm(d, axis=2, keepdims=True), 1e-300)
        along = np.einsum("nij,nij->ni", offset, d)
        across = np.linalg.norm(offset - along[..., None] * d, axis=2)
        worst = np.maximum(across, 0.25 * np.abs(along)).max(axis=1)
        good = (worst <= tolerance) | (depth == DEEPEST)
        if depth == 0:
            whole = zip(cuts[:-1].tolist(), cuts[1:].tolist(), net, strict=True)
            pieces = [Piece(a, b, cubic, False) for a, b, cubic in whole]
        else:
            columns = (x[good].tolist() for x in (k, s0, s1))
            for i, a, b, part in zip(*columns, net[good], strict=True):
                pieces[i].parts.append((a, b, part))
        k, s0, s1 = k[~good], s0[~good], s1[~good]
        if not len(k):
            break
        middle = np.empty(len(k))
        for i, rows in rows_of(k, np.arange(len(low))):
            middle[rows] = nurbs.middles(s0[rows], s1[rows], knots[i])
        k, s0, s1 = np.tile(k, 2), np.append(s0, middle), np.append(middle, s1)
    for piece in pieces:
        piece.parts.sort(key=lambda part: part[0])
    return pieces


def _exact(edge: Edge) -> list[Piece] | None:
    curve = edge.curve
    if curve is None:
        return None
    cuts = stations(edge)
    if curve.straight:
        ends = curve.evaluate(np.array([edge.start, edge.end]))
        h = np.concatenate([ends, np.ones((2, 1))], axis=1)
        return [Piece(edge.start, edge.end, nurbs.elevation(1) @ h, True)]
    pairs = zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)
    if isinstance(curve, Conic):
        up = nurbs.elevation(2)
        kind = {"parabola": "linear"}.get(curve.kind, curve.kind)
        nets = up @ curve.quadratics(cuts)
        return [Piece(a, b, net, True, kind) for (a, b), net in zip(pairs, nets, strict=True)]
    if isinstance(curve, BSpline) and curve.degree <= 3:
        out: list[Piece] = []
        for a, b in pairs:
            # Knots that only cut one and the same polynomial are left out.
            whole = _one_cubic(curve, a, b)
            if whole is not None:
                out.append(whole)
                continue
            found = [
                _cubic_of(curve, c, d, 0.5 * (c + d))
                for c, d in itertools.pairwise(curve.breaks(a, b))
            ]
            # Rational cubics run at different speeds, so that they are no parts of one piece.
            parts: list[Part] = []
            for part in found:
                if part is None or np.abs(part.net[:, -1] - 1.0).max() > SAME_CURVE:
                    return None
                parts.append(((part.start - a) / (b - a), (part.end - a) / (b - a), part.net))
            out.append(Piece(a, b, interpolated(curve, a, b), True, parts=parts))
        return out
    return None


def _cubic_of(curve: BSpline, a: float, b: float, at: float) -> Piece | None:
    """The polynomial of the span at ``at`` over [a, b]; None where a weight is not positive."""
    inside = float(nurbs.wrap(at, float(curve.knots[0]), curve.period))
    k, _, length = nurbs.locate(curve.knots, np.array([inside]))
    start = float(curve.knots[k[0]]) + at - inside
    low, high = (a - start) / float(length[0]), (b - start) / float(length[0])
    net = nurbs.elevation(curve.degree) @ nurbs.restricted(curve.pieces[k[0]], low, high)
    if not (net[:, -1] > 0.0).all():
        return None
    ratio = float(net[0, -1] / net[-1, -1]) ** (1.0 / 3.0)
    return Piece(a, b, normalised(net), True, "rational", ratio)


def _one_cubic(curve: BSpline, a: float, b: float) -> Piece | None:
    """The curve over [a, b] when it is one rational cubic to rounding, across its knots."""
    knots = curve.breaks(a, b)
    if len(knots) == 2:
        return _cubic_of(curve, a, b, 0.5 * (a + b))
    longest = int(np.argmax(np.diff(knots)))
    piece = _cubic_of(curve, a, b, 0.5 * float(knots[longest] + knots[longest + 1]))
    if piece is None:
        return None
    h = bernstein(_CHECK) @ piece.net
    x = curve.evaluate(piece.parameter(_CHECK))
    off = np.abs(h[:, :-1] / h[:, -1:] - x).max()
    return piece if off <= SAME_CURVE * float(np.ptp(x, axis=0).max()) else None


def chain(edge: Edge) -> list[Piece]:
    """Pieces of an edge from start to end; made once and kept on the edge.

    Consecutive cubics share the bits of their joint, and the first and the last one those of the
    vertices, as long as these are within the tolerance of the edge.
    """
    if edge.chain is None:
        pieces = _exact(edge)
        if edge.curve is None:
            pieces = []
        elif pieces is None or _count(pieces) > (MANY_PIECES if edge.exact else len(pieces)):
            fewer = _approximate(edge.curve, stations(edge), edge.tolerance)
            if pieces is None or _count(fewer) < (0.5 if edge.exact else 1.0) * _count(pieces):
                pieces = fewer
        _join(edge, pieces)
        edge.chain = pieces
    return edge.chain


def _count(pieces: list[Piece]) -> int:
    return sum(max(1, len(p.parts)) for p in pieces)


def _join(edge: Edge, pieces: list[Piece]) -> None:
    cubics = [net for piece in pieces for net in piece.cubics]
    for before, after in zip(cubics[:-1], cubics[1:], strict=True):
        after[0] = before[3]
    if not cubics:
        return
    for net, k, vertex in ((cubics[0], 0, edge.vertices[0]), (cubics[-1], 3, edge.vertices[1])):
        if vertex is None:
            continue
        shift = float(np.abs(vertex - net[k, :3]).max())
        if shift > edge.tolerance:
            edge.gap = max(edge.gap, shift)
            continue
        net[k, :3] = vertex
    if edge.curve is not None and edge.curve.straight:
        pieces[0].net[:] = nurbs.elevation(1) @ pieces[0].net[[0, 3]]
