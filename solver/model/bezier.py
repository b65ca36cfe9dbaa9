"""Bernstein algebra on rational bicubic control nets (NumPy; kernels have their own copy).

Nets are homogeneous: ``[..., i, j, :] = (w x, w y, w z, w)`` with i along u and j along v.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 5, 12 and 14.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, frozen

#: Nets done at a time: the temporary arrays stay in the processor's cache.
_CACHED_NETS = 64


def bernstein(t: ArrayLike) -> FloatArray:
    """Cubic Bernstein polynomials at ``t`` (...,), shape (..., 4). [1, eq. 5.2]"""
    t = np.asarray(t, dtype=np.float64)
    s = 1.0 - t
    return np.stack([s * s * s, 3 * t * s * s, 3 * t * t * s, t * t * t], axis=-1)


def bernstein_derivative(t: ArrayLike) -> FloatArray:
    """Derivatives of the cubic Bernstein polynomials at ``t`` (...,), shape (..., 4)."""
    t = np.asarray(t, dtype=np.float64)
    s = 1.0 - t
    return np.stack([-3 * s * s, 3 * s * (s - 2 * t), 3 * t * (2 * s - t), 3 * t * t], axis=-1)


def split_matrix(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Matrices (..., 4, 4) that take cubic coefficients on [0, 1] to those on [a, b], each (...,).

    Row k is the blossom at (a, .., b, ..) with k arguments equal to b [1, sec. 5.3]; always from
    the original interval, so that repeated halving does not drift.
    """
    low, high = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    # The blossom at t1, t2, t3 has the coefficients of ∏ ((1 − ti) + ti z).
    p, q = 1.0 - low, 1.0 - high
    pp, pq, qq = p * p, p * q, q * q
    ll, lh, hh = low * low, low * high, high * high
    out = np.empty((*low.shape, 4, 4))
    for k, row in enumerate(
        (
            (pp * p, 3.0 * pp * low, 3.0 * p * ll, ll * low),
            (pp * q, pp * high + 2.0 * pq * low, 2.0 * p * lh + ll * q, ll * high),
            (p * qq, 2.0 * pq * high + qq * low, p * hh + 2.0 * q * lh, low * hh),
            (qq * q, 3.0 * qq * high, 3.0 * q * hh, hh * high),
        )
    ):
        for j, value in enumerate(row):
            out[..., k, j] = value
    return out


def sub_net(net: FloatArray, u0: float, u1: float, v0: float, v1: float) -> FloatArray:
    """Control net (..., 4, 4, 4) of the parameter box [u0, u1] x [v0, v1] of ``net``."""
    mu, mv = split_matrix(u0, u1), split_matrix(v0, v1)
    return np.einsum("ai,bj,...ijk->...abk", mu, mv, net, optimize=True)


def sub_nets(nets: FloatArray, boxes: FloatArray) -> FloatArray:
    """Control nets (n, 4, 4, 4) of a parameter box u0, u1, v0, v1 (n, 4) of each net."""
    u0, u1, v0, v1 = np.asarray(boxes, dtype=np.float64).T
    mu, mv = split_matrix(u0, u1), split_matrix(v0, v1)
    along_u = np.einsum("nai,nijk->najk", mu, nets)
    return np.asarray(np.einsum("nbj,najk->nabk", mv, along_u))


def evaluate(net: FloatArray, u: ArrayLike, v: ArrayLike) -> FloatArray:
    """Points (..., 3) of one net (4, 4, 4) at parameters u, v (...,). [m]"""
    h = np.einsum("...i,...j,ijk->...k", bernstein(u), bernstein(v), net, optimize=True)
    return np.asarray(h[..., :3] / h[..., 3:])


def _euclidean(
    h: FloatArray, hu: FloatArray, hv: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points and derivatives (..., 3) from homogeneous ones (..., 4)."""
    w = h[..., 3:]
    point = h[..., :3] / w
    # Quotient rule: (A/w)' = (A' − w' A/w) / w.
    return (
        point,
        (hu[..., :3] - hu[..., 3:] * point) / w,
        (hv[..., :3] - hv[..., 3:] * point) / w,
    )


def tangents(
    net: FloatArray, u: ArrayLike, v: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points and first derivatives (∂u, ∂v) of one net (4, 4, 4), each (..., 3). [m]"""
    bu, bv = bernstein(u), bernstein(v)
    du, dv = bernstein_derivative(u), bernstein_derivative(v)
    h = np.einsum("...i,...j,ijk->...k", bu, bv, net, optimize=True)
    hu = np.einsum("...i,...j,ijk->...k", du, bv, net, optimize=True)
    hv = np.einsum("...i,...j,ijk->...k", bu, dv, net, optimize=True)
    return _euclidean(h, hu, hv)


def curve_points(curves: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points and first derivatives (n, k, 3) of rational cubics (n, 4, 4) at ``t`` (n, k)."""
    h, along = bernstein(t) @ curves, bernstein_derivative(t) @ curves
    point = h[..., :3] / h[..., 3:]
    return point, (along[..., :3] - along[..., 3:] * point) / h[..., 3:]


def surface_points(
    nets: FloatArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points and first derivatives (n, k, 3) of nets (n, 4, 4, 4).

    At parameters u, v (n, k) of their own, or (k,) for all.
    """
    k = np.shape(u)[-1]
    if np.ndim(u) > 1:
        h = _bases(u, v) @ nets.reshape(len(nets), 16, 4)
        return _euclidean(h[:, :k], h[:, k : 2 * k], h[:, 2 * k :])
    basis = _fixed_basis(*(np.ascontiguousarray(x, dtype=np.float64).tobytes() for x in (u, v)))
    if 0 < len(nets) <= _CACHED_NETS:
        return next(_in_blocks(nets, basis))[1]
    out = np.empty((3, len(nets), k, 3))
    for some, found in _in_blocks(nets, basis):
        out[:, some] = found
    return out[0], out[1], out[2]


def _bases(u: FloatArray, v: FloatArray) -> FloatArray:
    """What takes nets to points and both derivatives, one behind the other: (..., 3 k, 16)."""
    bu, bv = bernstein(u), bernstein(v)
    du, dv = bernstein_derivative(u), bernstein_derivative(v)
    *more, k, _ = bu.shape
    out = np.empty((*more, 3, k, 4, 4))
    for row, (a, b) in enumerate(((bu, bv), (du, bv), (bu, dv))):
        np.multiply(a[..., :, None], b[..., None, :], out=out[..., row, :, :, :])
    return out.reshape(*more, 3 * k, 16)


@lru_cache(maxsize=32)
def _fixed_basis(u: bytes, v: bytes) -> FloatArray:
    """The same (3 k, 16) at parameters (k,) given by their bytes.

    The rules that elements are looked at by are few, and come again and again.
    """
    return frozen(_bases(np.frombuffer(u), np.frombuffer(v)))


def _in_blocks(
    nets: FloatArray, basis: FloatArray
) -> Iterator[tuple[slice, tuple[FloatArray, FloatArray, FloatArray]]]:
    """Points and derivatives of some nets after the others, all by the same ``basis``."""
    k = len(basis) // 3
    for start in range(0, len(nets), _CACHED_NETS):
        some = slice(start, start + _CACHED_NETS)
        h = basis @ nets[some].reshape(-1, 16, 4)
        yield some, _euclidean(h[:, :k], h[:, k : 2 * k], h[:, 2 * k :])


@cache
def gauss_rule(order: int) -> tuple[FloatArray, FloatArray]:
    """Gauss–Legendre nodes and weights on [0, 1], read-only."""
    x, w = np.polynomial.legendre.leggauss(order)
    return frozen(0.5 * (x + 1.0)), frozen(0.5 * w)


def area_points(nets: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points (n, k, 3) of nets (n, 4, 4, 4) and the area vectors they stand for. [m], [m²]

    ``order`` points a direction, k of them in all; the vectors lie along the +normal.
    """
    t, w = gauss_rule(order)
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    points, su, sv = surface_points(nets, u, v)
    return points, np.cross(su, sv) * np.outer(w, w).ravel()[:, None]


def areas(nets: FloatArray, *, order: int = 6, pieces: int = 2) -> FloatArray:
    """Areas (n,) of nets (n, 4, 4, 4) by composite Gauss quadrature of |∂u × ∂v|. [m²]

    ``order`` points on each of ``pieces`` intervals a direction: 1e-9 relative on 90-degree arcs.
    """
    nets = np.asarray(nets, dtype=np.float64)
    x, w = gauss_rule(order)
    t = np.concatenate([(x + k) / pieces for k in range(pieces)])
    weight = np.tile(w / pieces, pieces)
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    weights = np.outer(weight, weight).ravel()
    total = np.empty(len(nets))
    for some, (_, su, sv) in _in_blocks(nets, _fixed_basis(u.tobytes(), v.tobytes())):
        (ax, ay, az), (bx, by, bz) = np.moveaxis(su, -1, 0), np.moveaxis(sv, -1, 0)
        # Components one by one: several times faster than NumPy's product of many small vectors.
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        total[some] = np.sqrt(x * x + y * y + z * z) @ weights
    return total
