"""Curves in (u, v) of edges whose own ones do not follow them: feet of the points of the edge.

References
----------
.. [1] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., Springer, 1997, sec. 6.1.
"""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from . import nurbs
from .curves import BSpline
from .extract import EdgeUse
from .surfaces import Surface

DEGREE = 5
#: Where the curve is interpolated (Chebyshev–Lobatto) and where it is compared.
_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
_CHECK = np.array([0.05, 0.5, 0.95])
_TO_CONTROL = np.linalg.inv(nurbs.bernstein_basis(DEGREE, _NODES))
_AT = np.concatenate([_NODES, _CHECK])
DEEPEST = 8
STEPS = 5


def _feet(surface: Surface, uv: FloatArray, target: FloatArray) -> FloatArray:
    """(u, v) (n, 2) of the feet of points ``target`` (n, 3), from a start near them.

    Gauss–Newton's iteration on |S(u, v) − X|². [1, without the second derivatives]
    """
    start = uv
    for _ in range(STEPS):
        p, a, b = surface.evaluate(uv[:, 0], uv[:, 1])
        r = target - p
        aa, bb, ab = (a * a).sum(axis=1), (b * b).sum(axis=1), (a * b).sum(axis=1)
        ra, rb = (a * r).sum(axis=1), (b * r).sum(axis=1)
        det = aa * bb - ab * ab
        ok = (det > 1e-10 * aa.max() * bb.max()) & (det > 1e-8 * aa * bb)
        det = np.where(ok, det, 1.0)
        step = np.stack([(bb * ra - ab * rb) / det, (aa * rb - ab * ra) / det], axis=1)
        uv = uv + np.where(ok[:, None], step, 0.0)  # at a pole the start is as good as any
    return np.where(np.isfinite(uv).all(axis=1, keepdims=True), uv, start)


def projected(use: EdgeUse, surface: Surface, tolerance: float) -> BSpline:
    """The edge of ``use`` in (u, v) over the parameters of the curve that it has there now.

    Polynomials of degree 5 between the knots of the edge, halved until their points on the surface
    are within ``tolerance`` [file units] of the feet.
    """
    edge, first = use.edge, use.curve
    assert edge.curve is not None and first is not None
    rate = (use.end - use.start) / (edge.end - edge.start)
    cuts = use.start + (edge.curve.breaks(edge.start, edge.end) - edge.start) * rate
    a, b = cuts[:-1], cuts[1:]
    starts, nets = [], []
    for depth in range(DEEPEST + 1):
        t = a[:, None] + (b - a)[:, None] * _AT
        x = edge.curve.evaluate((edge.start + (t - use.start) / rate).ravel())
        uv = _feet(surface, first.evaluate(t.ravel()), x).reshape(*t.shape, 2)
        net = _TO_CONTROL @ uv[:, : DEGREE + 1]
        now = nurbs.bernstein_basis(DEGREE, _CHECK) @ net
        _, su, sv = surface.evaluate(now[..., 0], now[..., 1])
        off = now - uv[:, DEGREE + 1 :]
        away = np.linalg.norm(off[..., :1] * su + off[..., 1:] * sv, axis=-1).max(axis=1)
        good = (away <= tolerance) | (depth == DEEPEST)
        starts.append(a[good])
        nets.append(net[good])
        if good.all():
            break
        middle = 0.5 * (a + b)[~good]
        a, b = np.append(a[~good], middle), np.append(middle, b[~good])
    start, points = np.concatenate(starts), np.concatenate(nets)
    order = np.argsort(start)
    pieces = np.ones((len(start), DEGREE + 1, 3))
    pieces[..., :2] = points[order]
    return BSpline(np.append(start[order], use.end), pieces, DEGREE)
