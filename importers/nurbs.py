"""B-splines as arrays of Bézier pieces: extraction by blossoming and vectorised evaluation.

Coefficients are homogeneous (w x, …, w). A parameter outside the knots is evaluated with the
first or last piece: curves on a surface often overshoot its domain a little, and the polynomial
continuation is what the CAD kernel does as well.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 5, 8 and 13.
.. [2] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., Springer, 1997, sec. 4.5.
"""

from __future__ import annotations

from functools import cache
from math import ceil, comb, floor

import numpy as np
from numpy.typing import ArrayLike
from patchlight.solver.model.arrays import FloatArray, IntArray

#: Orders of derivatives in u and v: each after those that it needs.
Orders = tuple[tuple[int, int], ...]
POINT: Orders = ((0, 0),)
FIRST: Orders = ((0, 0), (1, 0), (0, 1))
SECOND: Orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
#: Share of an interval that is no interval of its own.
CLOSE = 1e-4


def bezier_pieces(
    knots: FloatArray, degree: int, poles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Bézier pieces of a B-spline in the first axis of ``poles``.

    Parameters
    ----------
    knots : (n + degree + 1,) array
        Flat knot vector.
    poles : (n, ...) array
        Homogeneous poles.

    Returns
    -------
    breaks : (m + 1,) array
        Distinct knots of the domain.
    pieces : (m, degree + 1, ...) array
        Coefficients of each piece; coefficient k is the blossom at k times the end and
        degree − k times the start of the span [1, sec. 8.3].
    """
    n = len(poles)
    if n == degree + 1 and knots[0] == knots[degree] and knots[n] == knots[-1]:
        return knots[[degree, n]], poles[None]
    index = degree + np.flatnonzero(np.diff(knots[degree : n + 1]) > 0.0)
    a, b = knots[index], knots[index + 1]
    k = np.arange(degree + 1)
    # What the blossoms make of the poles of a span, from those of unit vectors.
    level = np.broadcast_to(np.eye(degree + 1), (len(index), degree + 1, degree + 1, degree + 1))
    for r in range(1, degree + 1):
        j = index[:, None] + np.arange(-degree + r, 1)
        low, high = knots[j][:, None], knots[j + degree - r + 1][:, None]
        x = np.where(r <= k, b[:, None], a[:, None])[..., None]
        alpha = ((x - low) / (high - low))[..., None]
        level = (1.0 - alpha) * level[:, :, :-1] + alpha * level[:, :, 1:]
    own = poles[index[:, None] + np.arange(-degree, 1)].reshape(len(index), degree + 1, -1)
    pieces = (level[:, :, 0] @ own).reshape(len(index), degree + 1, *poles.shape[1:])
    return np.append(a, b[-1]), pieces


@cache
def elevation(degree: int) -> FloatArray:
    """(4, degree + 1) matrix that raises Bézier coefficients of ``degree`` <= 3 to degree 3."""
    m = np.eye(degree + 1)
    for p in range(degree, 3):
        up = np.zeros((p + 2, p + 1))
        for i in range(p + 2):
            if i > 0:
                up[i, i - 1] = i / (p + 1)
            if i <= p:
                up[i, i] = 1.0 - i / (p + 1)
        m = up @ m
    return m


@cache
def _binomials(degree: int) -> FloatArray:
    return np.array([comb(degree, i) for i in range(degree + 1)], dtype=np.float64)


def bernstein_basis(degree: int, t: FloatArray) -> FloatArray:
    """Bernstein polynomials (..., degree + 1) at ``t`` (...,). [1, eq. 5.1]"""
    # Each polynomial lies in a row until all are done.
    rows = np.empty((degree + 1, *t.shape))
    rows[...] = _binomials(degree).reshape(-1, *(1,) * t.ndim)
    s = 1.0 - t
    rising, falling = t, s
    for i in range(1, degree + 1):
        rows[i] *= rising
        rows[degree - i] *= falling
        if i < degree:
            rising, falling = rising * t, falling * s
    return np.ascontiguousarray(np.moveaxis(rows, 0, -1))


def bernstein_slope(degree: int, t: FloatArray) -> FloatArray:
    """Derivatives (..., degree + 1) of the Bernstein polynomials at ``t`` (...,)."""
    out = np.zeros((*t.shape, degree + 1))
    if degree > 0:
        lower = bernstein_basis(degree - 1, t)
        out[..., 1:] = degree * lower
        out[..., :-1] -= degree * lower
    return out


def bernstein_derivatives(degree: int, t: FloatArray, most: int) -> FloatArray:
    """Derivatives (n, most + 1, degree + 1) of orders 0 to ``most`` <= 2 of the Bernstein
    polynomials at ``t`` (n,)."""
    out = np.zeros((most + 1, degree + 1, len(t)))
    s = 1.0 - t
    for order in range(min(most, degree) + 1):
        # Rows are contiguous: polynomials of the lower degree first, then their differences.
        lower = degree - order
        rows = out[order]
        rows[order:] = _binomials(lower)[:, None]
        rising, falling = t, s
        for i in range(1, lower + 1):
            rows[order + i] *= rising
            rows[order + lower - i] *= falling
            if i < lower:
                rising, falling = rising * t, falling * s
        for k in range(order):
            rows[order - k - 1 : -1] -= rows[order - k :]
            rows *= degree - order + k + 1
    return np.ascontiguousarray(out.transpose(2, 0, 1))


def patch_derivatives(
    nets: FloatArray, s: FloatArray, ds: FloatArray, t: FloatArray, dt: FloatArray, orders: Orders
) -> tuple[FloatArray, ...]:
    """Points and derivatives (n, 3) of rational patches (n, pu + 1, pv + 1, 4) at s, t (n,).

    Derivatives are with respect to parameters that run ``ds`` and ``dt`` (n,) over a patch; those
    of w P follow from the net, those of P from Leibniz' rule [2].
    """
    n, pu, pv = len(nets), nets.shape[1] - 1, nets.shape[2] - 1
    mu, mv = (max(order[k] for order in orders) for k in (0, 1))
    along_u, along_v = bernstein_derivatives(pu, s, mu), bernstein_derivatives(pv, t, mv)
    # First over u, with all coefficients in v as columns: the nets stay as they lie in memory.
    rows = (along_u @ nets.reshape(n, pu + 1, -1)).reshape(n, mu + 1, pv + 1, 4)
    every = along_v[:, None] @ rows
    found: dict[tuple[int, int], FloatArray] = {}
    weights: dict[tuple[int, int], FloatArray] = {}
    for k, m in orders:
        h = every[:, k, m]
        if k or m:
            h = h / (ds**k * dt**m)[:, None]
        a, weights[k, m] = h[:, :3], h[:, 3:]
        for i, j in found:
            if i <= k and j <= m:
                a = a - comb(k, i) * comb(m, j) * weights[k - i, m - j] * found[i, j]
        found[k, m] = a / weights[0, 0]
    return tuple(found[order] for order in orders)


def locate(breaks: FloatArray, t: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Piece, local parameter and length of the piece for each ``t`` (...,)."""
    piece = np.searchsorted(breaks[1:-1], t, side="right")
    length = breaks[piece + 1] - breaks[piece]
    return piece, (t - breaks[piece]) / length, length


def wrap(t: ArrayLike, start: float, period: float | None) -> FloatArray:
    """``t`` moved by whole periods to [start, start + period]; unchanged without a period."""
    t = np.asarray(t, dtype=np.float64)
    if period is None:
        return t
    turns = np.floor((t - start) / period)
    moved = t - turns * period
    # A value just below the start must not jump to the far end, nor an end back to the start.
    near_end = np.abs(t - (start + period)) <= 1e-9 * period
    near_start = np.abs(t - start) <= 1e-9 * period
    return np.where(near_end | near_start, t, moved)


def restriction(degree: int, a: float, b: float) -> FloatArray:
    """(degree + 1, degree + 1) matrix that takes Bézier coefficients to those on [a, b].

    Row k is the blossom with k arguments ``b`` and the others ``a`` [1, sec. 5.3].
    """
    level = np.broadcast_to(np.eye(degree + 1), (degree + 1, degree + 1, degree + 1))
    k = np.arange(degree + 1)
    for r in range(1, degree + 1):
        t = np.where(r <= k, b, a)[:, None, None]
        level = (1.0 - t) * level[:, :-1] + t * level[:, 1:]
    return np.asarray(level[:, 0])


def restricted(pieces: FloatArray, a: float, b: float) -> FloatArray:
    """Bézier coefficients (degree + 1, d) of one piece on its local interval [a, b]."""
    return pieces if a == 0.0 and b == 1.0 else restriction(len(pieces) - 1, a, b) @ pieces


def knots_between(knots: FloatArray, period: float | None, a: float, b: float) -> FloatArray:
    """``a``, the knots strictly between ``a`` and ``b`` in every period, and ``b``."""
    if period is not None:
        low, high = floor((a - knots[0]) / period), ceil((b - knots[0]) / period)
        knots = np.unique(np.concatenate([knots + k * period for k in range(low, high + 1)]))
    margin = 1e-9 * (b - a)
    inside = knots[(knots > a + margin) & (knots < b - margin)]
    return np.concatenate([[a], inside, [b]])


def middles(low: FloatArray, high: FloatArray, knots: FloatArray) -> FloatArray:
    """Where to halve the intervals [low, high] (n,): at the knot next to the middle, if any."""
    middle = 0.5 * (low + high)
    if not len(knots):
        return middle
    near = knots[np.argmin(np.abs(knots[None] - middle[:, None]), axis=1)]
    margin = CLOSE * (high - low)
    return np.where((near > low + margin) & (near < high - margin), near, middle)
