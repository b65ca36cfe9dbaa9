"""Area of a trimmed face from its boundary alone, independent of the patches.

Green's theorem: with F(u, v) = ∫ |S_u × S_v| du from a fixed u, the area is the contour integral
of F dv. On planes, surfaces of revolution and extrusions the inner integral is a product. Every
interval is halved until the area stays the same.
"""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import gauss_rule

from .arcs import Arc, Chord, EdgeArc
from .compare import cross, length
from .curves import Conic, Curve
from .domain import Domain
from .extract import RawFace
from .surfaces import Plane, Surface, knot_lines

KnotLines = tuple[FloatArray | None, FloatArray | None]
_X, _W = gauss_rule(8)
#: Relative change at which the integral has converged, a tenth of what exact faces must keep.
CONVERGED = 1e-7
#: Larger changes leave a face unchecked. Halving takes at least half off the error, so that what is
#: left is no more than the last change: a tenth of what approximated faces must keep.
USABLE = 1e-5
FINENESS = (1, 2, 4, 8)
MOST_EVALUATIONS = 1_500_000
#: Points evaluated at a time: each one of a spline takes a copy of its control points.
BLOCK = 20_000


def face_area(face: RawFace, domain: Domain) -> float:
    """Area of a face from its surface and boundary; NaN when it takes too long. [file units²]"""
    surface = face.surface
    assert surface is not None
    area, change = math.nan, math.inf
    for fineness in FINENESS:
        before = area
        if isinstance(surface, Plane):
            area = _planar_area(face, surface, fineness)
        else:
            area = _curved_area(surface, domain, fineness)
        if math.isnan(area):
            area = before
            break
        if not math.isnan(before):
            change = abs(area - before)
            if change <= CONVERGED * area:
                return area
    return area if change <= USABLE * area else math.nan


def _nodes(cuts: FloatArray, fineness: int) -> tuple[FloatArray, FloatArray]:
    """Parameters and weights of the Gauss rule on each of the intervals, cut ``fineness`` times."""
    f = np.arange(fineness) / fineness
    fine = np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * f).ravel(), cuts[-1])
    step = np.diff(fine)
    return (fine[:-1, None] + step[:, None] * _X).ravel(), (step[:, None] * _W).ravel()


def _intervals(curve: Curve, a: float, b: float) -> FloatArray:
    """Smooth intervals of a curve from ``a`` to ``b``, which may be the smaller one."""
    cuts = curve.breaks(min(a, b), max(a, b))
    # Full ellipses and hyperbolas need a cut for the rule to converge at once.
    pieces = 4 if isinstance(curve, Conic) else 1
    f = np.arange(pieces) / pieces
    cuts = np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * f).ravel(), cuts[-1])
    return cuts if b >= a else cuts[::-1]


def _planar_area(face: RawFace, surface: Plane, fineness: int) -> float:
    """Area of a planar face from its edges in space: ½ ∮ (x dy − y dx). [file units²]"""
    o, x, y, _ = surface.frame
    total = 0.0
    for uses in face.loops:
        for use in uses:
            curve = use.edge.curve
            if curve is None:
                continue
            a, b = (use.end, use.start) if use.reversed else (use.start, use.end)
            if curve.straight:
                p = curve.evaluate(np.array([a, b])) - o
                px, py = p @ x, p @ y
                total += 0.5 * float(px[0] * py[1] - px[1] * py[0])
                continue
            t, w = _nodes(_intervals(curve, a, b), fineness)
            p, d = curve.both(t)
            p = p - o
            total += 0.5 * float(w @ ((p @ x) * (d @ y) - (p @ y) * (d @ x)))
    return abs(total)


def _straight_cuts(p: FloatArray, q: FloatArray, knots: KnotLines) -> FloatArray:
    """Shares of the way from ``p`` to ``q`` at which it crosses knot lines, ends included."""
    cuts = [0.0, 1.0]
    for k, lines in enumerate(knots):
        step = float(q[k] - p[k])
        if lines is not None and step != 0.0:
            at = (lines - p[k]) / step
            cuts.extend(at[(at > 1e-9) & (at < 1.0 - 1e-9)].tolist())
    return np.unique(np.array(cuts))


def _arc_nodes(arc: Arc, knots: KnotLines, fineness: int) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) of an arc and its steps (n, 2), derivatives times weights."""
    if isinstance(arc, EdgeArc) and not arc.straight:
        curve = arc.side.curve
        a, b = arc.parameter(np.array([0.0, 1.0])).tolist()
        t, w = _nodes(_intervals(curve, a, b), fineness)
        p, d = curve.both(t)
        return p + arc.side.shift, d * w[:, None]
    if isinstance(arc, EdgeArc):
        p, q = arc.at(np.array([0.0, 1.0]))
    else:
        assert isinstance(arc, Chord)
        p, q = arc.p, arc.q
    t, w = _nodes(_straight_cuts(p, q, knots), fineness)
    return p + t[:, None] * (q - p), w[:, None] * (q - p)


def _jacobian(surface: Surface, u: FloatArray, v: FloatArray) -> FloatArray:
    out = np.empty(len(u))
    for start in range(0, len(u), BLOCK):
        some = slice(start, start + BLOCK)
        _, a, b = surface.evaluate(u[some], v[some])
        out[some] = length(cross(a, b))
    return out


def _curved_area(surface: Surface, domain: Domain, fineness: int) -> float:
    """Area of a face on a curved surface; NaN when it would take too long. [file units²]"""
    knots = knot_lines(surface, *domain.box)
    points, steps = [], []
    for region in domain.regions:
        for loop in region:
            for arc in loop:
                p, d = _arc_nodes(arc, knots, fineness)
                points.append(p)
                steps.append(d)
    uv, d = np.concatenate(points), np.concatenate(steps)
    low, high = uv.min(axis=0), uv.max(axis=0)
    middle = 0.5 * (low + high)
    variable = surface.jacobian_variable()
    if variable in ("", "v"):
        j = _jacobian(surface, np.full(len(uv), middle[0]), uv[:, 1])
        return abs(float((j * (uv[:, 0] - middle[0])) @ d[:, 1]))
    if variable == "u":
        j = _jacobian(surface, uv[:, 0], np.full(len(uv), middle[1]))
        return abs(float((j * (uv[:, 1] - middle[1])) @ d[:, 0]))
    return abs(_double(surface, uv, d, low, high, knots[0], fineness))


def _double(
    surface: Surface,
    uv: FloatArray,
    d: FloatArray,
    low: FloatArray,
    high: FloatArray,
    knots: FloatArray | None,
    fineness: int,
) -> float:
    """The contour integral where the Jacobian depends on both parameters."""
    extent = high - low
    keep = (np.abs(d[:, 1]) > 1e-15 * np.abs(d).max()) & (uv[:, 0] > low[0] + 1e-14 * extent[0])
    uv, d = uv[keep], d[keep]
    cuts = np.array([low[0], high[0]]) if knots is None else knots
    least = 2 if len(cuts) < 5 else 1
    f = np.arange(fineness * least) / (fineness * least)
    cuts = np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * f).ravel(), cuts[-1])
    if len(uv) * (len(cuts) - 1) * len(_X) > MOST_EVALUATIONS:
        return math.nan
    # Each interval clipped at the boundary point: full, partial or empty.
    a = cuts[None, :-1]
    b = np.clip(cuts[None, 1:], a, np.maximum(a, uv[:, :1]))
    u = a[..., None] + (b - a)[..., None] * _X
    v = np.broadcast_to(uv[:, 1, None, None], u.shape)
    some = np.broadcast_to((b > a)[..., None], u.shape)
    j = np.zeros(u.shape)
    j[some] = _jacobian(surface, u[some], v[some])
    inner = np.einsum("nkq,q,nk->n", j, _W, b - a)
    return float(inner @ d[:, 1])
