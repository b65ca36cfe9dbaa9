"""B-rep edges in space as chains of rational cubic pieces, shared by both faces of the edge.

Lines, conics and splines of degree <= 3 are exact; everything else is interpolated at the
Chebyshev–Lobatto nodes (0, 1/4, 3/4, 1) and halved until it is within the tolerance.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 12 and 13.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein

from . import nurbs
from .curves import BSpline, Conic, Curve
from .extract import Edge

LOBATTO = np.array([0.0, 0.25, 0.75, 1.0])
#: Control points of a cubic from its values at the Lobatto nodes.
TO_CONTROL = np.linalg.inv(bernstein(LOBATTO))
QUARTER = 0.5 * math.pi
#: More exact pieces than this on one edge are replaced by fewer approximate ones if possible.
MANY_PIECES = 24


@dataclass(slots=True)
class Piece:
    """One rational cubic (4, 4) of an edge over its parameters [start, end]; end weights 1."""

    start: float
    end: float
    net: FloatArray
    exact: bool


def normalised(net: FloatArray) -> FloatArray:
    """The same curve with end weights 1: coefficients scaled by c λ^i. [1, sec. 13.7]"""
    first, last = net[0, -1], net[-1, -1]
    ratio = (first / last) ** (1.0 / (len(net) - 1))
    return np.asarray(net / first * (ratio ** np.arange(len(net)))[:, None])


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
    kink = close & (angle > math.radians(3.0))
    angle[kink] = 0.0
    return t, np.concatenate([[0.0], np.cumsum(angle)]), 0.5 * (t[:-1] + t[1:])[kink]


def split_by_turning(curve: Curve, a: float, b: float, limit: float = QUARTER) -> FloatArray:
    """Parameters from a to b, cut at kinks and so that each part turns at most ``limit``."""
    if curve.straight:
        return np.array([a, b])
    if isinstance(curve, Conic) and curve.kind == "ellipse":
        n = max(1, math.ceil((b - a) / limit - 1e-9))
        return np.linspace(a, b, n + 1)
    t, total, kinks = turning(curve, a, b)
    stations = [a]
    for low, high in zip([a, *kinks], [*kinks, b], strict=True):
        at = np.interp([low, high], t, total)
        n = max(1, math.ceil((at[1] - at[0]) / limit - 1e-3))
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


def _approximate(curve: Curve, cuts: FloatArray, tolerance: float) -> list[Piece]:
    out: list[Piece] = []
    basis = bernstein(_CHECK)
    stack = [(float(a), float(b), 0) for a, b in zip(cuts[:-1], cuts[1:], strict=True)][::-1]
    while stack:
        a, b, depth = stack.pop()
        net = interpolated(curve, a, b)
        t = a + (b - a) * _CHECK
        offset = basis @ net[:, :-1] - curve.evaluate(t)
        d = curve.slope(t)
        d = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
        offset -= np.einsum("ij,ij->i", offset, d)[:, None] * d
        if depth < 12 and np.linalg.norm(offset, axis=1).max() > tolerance:
            m = 0.5 * (a + b)
            stack += [(m, b, depth + 1), (a, m, depth + 1)]
        else:
            out.append(Piece(a, b, net, False))
    return out


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
        return [Piece(a, b, up @ curve.quadratic(a, b), True) for a, b in pairs]
    if isinstance(curve, BSpline) and curve.degree <= 3:
        out = []
        knots = curve.breaks(edge.start, edge.end)
        knots = merged(knots, cuts)
        for a, b in zip(knots[:-1].tolist(), knots[1:].tolist(), strict=True):
            middle = float(nurbs.wrap(0.5 * (a + b), float(curve.knots[0]), curve.period))
            k, _, length = nurbs.locate(curve.knots, np.array([middle]))
            local = 0.5 + (np.array([a, b]) - 0.5 * (a + b)) / length
            shift = (middle - curve.knots[k][0]) / length[0] - 0.5
            part = nurbs.restricted(
                curve.pieces[k[0]], float(local[0] + shift), float(local[1] + shift)
            )
            net = nurbs.elevation(curve.degree) @ part
            if not (net[:, -1] > 0.0).all():
                return None
            out.append(Piece(a, b, normalised(net), True))
        return out
    return None


def merged(a: FloatArray, b: FloatArray) -> FloatArray:
    """Sorted union of two parameter lists, values closer than 1e-6 of the range taken once."""
    both = np.sort(np.concatenate([a, b]))
    keep = np.concatenate([[True], np.diff(both) > 1e-6 * (both[-1] - both[0])])
    out = both[keep]
    out[-1] = both[-1]
    return out


def chain(edge: Edge, tolerance: float) -> list[Piece]:
    """Pieces of an edge from start to end; made once and kept on the edge."""
    if edge.chain is None:
        pieces = _exact(edge)
        if edge.curve is None:
            pieces = []
        elif pieces is None or len(pieces) > MANY_PIECES:
            fewer = _approximate(edge.curve, stations(edge), tolerance)
            if pieces is None or len(fewer) < 0.5 * len(pieces):
                pieces = fewer
        edge.chain = pieces
    return edge.chain
