"""Area of a trimmed face from its boundary alone, independent of the patches.

Green's theorem: with F(u, v) = ∫ |S_u × S_v| du from a fixed u, the area is the contour integral
of F dv. On planes, surfaces of revolution and extrusions the inner integral is a product.
"""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import gauss_rule

from .arcs import Arc, Chord, EdgeArc
from .curves import Conic, Curve
from .domain import Domain
from .extract import RawFace
from .surfaces import Offset, Plane, SplineSurface, Surface

_X, _W = gauss_rule(10)
_XI, _WI = gauss_rule(10)
MOST_EVALUATIONS = 400_000


def _parts(curve: Curve, a: float, b: float, least: int) -> FloatArray:
    """Integration intervals (n + 1,) of a curve from a to b."""
    low, high = min(a, b), max(a, b)
    cuts = curve.breaks(low, high)
    pieces = 1
    if not curve.straight:
        pieces = 4 if isinstance(curve, Conic) or len(cuts) < 6 else 2
    pieces = max(pieces, -(-least // (len(cuts) - 1)))
    fine = np.concatenate(
        [np.linspace(p, q, pieces + 1)[:-1] for p, q in zip(cuts[:-1], cuts[1:], strict=True)]
        + [[high]]
    )
    return fine if b >= a else fine[::-1]


def _nodes(curve: Curve, a: float, b: float, least: int = 1) -> tuple[FloatArray, FloatArray]:
    """Points and derivatives times weights at the Gauss nodes of a curve."""
    cuts = _parts(curve, a, b, least)
    step = np.diff(cuts)
    t = (cuts[:-1, None] + step[:, None] * _X).ravel()
    w = (step[:, None] * _W).ravel()
    return curve.evaluate(t), curve.slope(t) * w[:, None]


def planar_area(face: RawFace, surface: Plane) -> float:
    """Area of a planar face from its edges in space: ½ ∮ (x dy − y dx). [file units²]"""
    _, x, y, _ = surface.frame
    total = 0.0
    for uses in face.loops:
        for use in uses:
            curve = use.edge.curve
            if curve is None:
                continue
            a, b = (use.end, use.start) if use.reversed else (use.start, use.end)
            p, d = _nodes(curve, a, b)
            p = p - surface.frame[0]
            total += 0.5 * float((p @ x) @ (d @ y) - (p @ y) @ (d @ x))
    return abs(total)


def _arc_nodes(arc: Arc, least: int) -> tuple[FloatArray, FloatArray]:
    if isinstance(arc, EdgeArc):
        p, d = _nodes(arc.curve, arc.a, arc.b, least)
        return p + arc.shift, d
    assert isinstance(arc, Chord)
    n = max(4, least)
    t = ((np.arange(n)[:, None] + _X) / n).ravel()
    w = np.tile(_W / n, n)
    return arc.p + t[:, None] * (arc.q - arc.p), w[:, None] * (arc.q - arc.p)


def _jacobian(surface: Surface, u: FloatArray, v: FloatArray) -> FloatArray:
    _, a, b = surface.evaluate(u, v)
    return np.asarray(np.linalg.norm(np.cross(a, b), axis=-1))


def curved_area(surface: Surface, domain: Domain) -> float:
    """Area of a face on a curved surface; NaN when it would take too long. [file units²]"""
    points, steps = [], []
    variable = surface.jacobian_variable()
    least = 8 if variable == "uv" else 1  # knots of the surface cut the boundary too
    for region in domain.regions:
        for loop in region:
            for arc in loop:
                p, d = _arc_nodes(arc, least)
                points.append(p)
                steps.append(d)
    uv, d = np.concatenate(points), np.concatenate(steps)
    low, high = uv.min(axis=0), uv.max(axis=0)
    middle = 0.5 * (low + high)
    if variable in ("", "v"):
        j = _jacobian(surface, np.full(len(uv), middle[0]), uv[:, 1])
        return abs(float((j * (uv[:, 0] - middle[0])) @ d[:, 1]))
    if variable == "u":
        j = _jacobian(surface, uv[:, 0], np.full(len(uv), middle[1]))
        return abs(float((j * (uv[:, 1] - middle[1])) @ d[:, 0]))
    return abs(_general(surface, uv, d, low, high))


def _general(
    surface: Surface, uv: FloatArray, d: FloatArray, low: FloatArray, high: FloatArray
) -> float:
    keep = np.abs(d[:, 1]) > 1e-15 * np.abs(d).max()
    uv, d = uv[keep], d[keep]
    base = surface.base if isinstance(surface, Offset) else surface
    knots = np.array([low[0], high[0]])
    if isinstance(base, SplineSurface):
        from .rectangle import _cuts

        knots = _cuts(base.u_knots, base.periods[0], float(low[0]), float(high[0]))
    if len(knots) < 5:
        knots = np.unique(
            np.concatenate([np.linspace(a, b, 5) for a, b in zip(knots, knots[1:], strict=False)])
        )
    if len(uv) * (len(knots) - 1) * len(_XI) > MOST_EVALUATIONS:
        return float("nan")
    # Each knot interval clipped at the boundary point: full, partial or empty.
    a = knots[None, :-1]
    b = np.clip(knots[None, 1:], a, np.maximum(a, uv[:, :1]))
    u = a[..., None] + (b - a)[..., None] * _XI
    v = np.broadcast_to(uv[:, 1, None, None], u.shape)
    some = (b > a)[..., None] & np.ones(len(_XI), dtype=bool)
    j = np.zeros(u.shape)
    j[some] = _jacobian(surface, u[some], v[some])
    inner = np.einsum("nkq,q,nk->n", j, _WI, b - a)
    return float(inner @ d[:, 1])
