"""Curves in (u, v) of edges whose own ones do not follow them: feet of the points of the edge.

References
----------
.. [1] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., Springer, 1997, sec. 6.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from . import nurbs
from .compare import length
from .curves import BSpline
from .extract import EdgeUse
from .together import SurfaceBatch, points_of

DEGREE = 5
#: Where the curve is interpolated (Chebyshev–Lobatto) and where it is compared.
_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
_CHECK = np.array([0.05, 0.5, 0.95])
_TO_CONTROL = np.linalg.inv(nurbs.bernstein_basis(DEGREE, _NODES))
_AT = np.concatenate([_NODES, _CHECK])
DEEPEST = 8
STEPS = 5


def _feet(batch: SurfaceBatch, which: IntArray, uv: FloatArray, target: FloatArray) -> FloatArray:
    """(u, v) (n, k, 2) of the feet of points ``target`` (n, k, 3), from a start near them.

    Gauss–Newton's iteration on |S(u, v) − X|². [1, without the second derivatives]
    """
    start = uv
    for _ in range(STEPS):
        p, a, b = batch.evaluate(which, uv[..., 0], uv[..., 1])
        r = target - p
        aa, bb, ab = (a * a).sum(axis=2), (b * b).sum(axis=2), (a * b).sum(axis=2)
        ra, rb = (a * r).sum(axis=2), (b * r).sum(axis=2)
        det = aa * bb - ab * ab
        least = 1e-10 * (aa.max(axis=1) * bb.max(axis=1))[:, None]
        ok = (det > least) & (det > 1e-8 * aa * bb)
        det = np.where(ok, det, 1.0)
        step = np.stack([(bb * ra - ab * rb) / det, (aa * rb - ab * ra) / det], axis=2)
        uv = uv + np.where(ok[..., None], step, 0.0)  # at a pole the start is as good as any
    return np.where(np.isfinite(uv).all(axis=2, keepdims=True), uv, start)


def projected(
    uses: Sequence[EdgeUse], batch: SurfaceBatch, which: IntArray, tolerance: FloatArray
) -> list[BSpline]:
    """The edges of uses (m,) in (u, v) over the parameters of the curves that they have there now.

    Polynomials of degree 5 between the knots of the edge, halved until their points on the surface
    ``which`` (m,) are within ``tolerance`` (m,) [file units] of the feet.
    """
    firsts = [use.curve for use in uses if use.curve is not None]
    spaces = [use.edge.curve for use in uses if use.edge.curve is not None]
    starts = np.array([(use.start, use.edge.start) for use in uses])
    rates = np.array([(u.end - u.start) / (u.edge.end - u.edge.start) for u in uses])
    cuts = [
        use.start + (curve.breaks(use.edge.start, use.edge.end) - use.edge.start) * rate
        for use, curve, rate in zip(uses, spaces, rates.tolist(), strict=True)
    ]
    use = np.repeat(np.arange(len(uses)), [len(c) - 1 for c in cuts])
    a, b = np.concatenate([c[:-1] for c in cuts]), np.concatenate([c[1:] for c in cuts])
    done: list[tuple[IntArray, FloatArray, FloatArray]] = []
    for depth in range(DEEPEST + 1):
        t = a[:, None] + (b - a)[:, None] * _AT
        on_edge = starts[use, 1:] + (t - starts[use, :1]) / rates[use, None]
        x = points_of([spaces[k] for k in use.tolist()], on_edge, 3)
        first = points_of([firsts[k] for k in use.tolist()], t, 2)
        uv = _feet(batch, which[use], first, x)
        net = _TO_CONTROL @ uv[:, : DEGREE + 1]
        now = nurbs.bernstein_basis(DEGREE, _CHECK) @ net
        _, su, sv = batch.evaluate(which[use], now[..., 0], now[..., 1])
        off = now - uv[:, DEGREE + 1 :]
        away = length(off[..., :1] * su + off[..., 1:] * sv).max(axis=1)
        good = (away <= tolerance[use]) | (depth == DEEPEST)
        done.append((use[good], a[good], net[good]))
        if good.all():
            break
        use, low, high = use[~good], a[~good], b[~good]
        middle = 0.5 * (low + high)
        use, a, b = np.tile(use, 2), np.append(low, middle), np.append(middle, high)
    number, start, points = (np.concatenate(x) for x in zip(*done, strict=True))
    pieces = np.ones((len(start), DEGREE + 1, 3))
    pieces[..., :2] = points
    out = []
    for k, use_ in enumerate(uses):
        rows = np.flatnonzero(number == k)
        rows = rows[np.argsort(start[rows])]
        out.append(BSpline(np.append(start[rows], use_.end), pieces[rows], DEGREE))
    return out
