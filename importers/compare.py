"""How far patches are from the surface they stand for: position, normal and area.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 13.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative

BoolArray = NDArray[np.bool_]
#: Parameters at which a patch is compared with the surface; every other one is a node.
CHECK = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
NODE = np.array([0, 2, 4, 6])
_BETWEEN = np.array([1, 3, 5])
_BASIS, _SLOPE = bernstein(CHECK), bernstein_derivative(CHECK)
#: What takes the 16 control points to points and both derivatives at the 7 x 7 check points.
_ALL = np.concatenate([np.kron(_BASIS, _BASIS), np.kron(_SLOPE, _BASIS), np.kron(_BASIS, _SLOPE)])
#: Derivatives and integral over [0, 1] of the polynomials of degree 6 through values at `CHECK`.
_POWERS = CHECK[:, None] ** np.arange(7)
_DERIVATIVE = (
    np.concatenate([np.zeros((7, 1)), _POWERS[:, :6] * np.arange(1, 7)], axis=1)
) @ np.linalg.inv(_POWERS)
_INTEGRAL = (1.0 / np.arange(1, 8)) @ np.linalg.inv(_POWERS)
#: The four sides of an array (..., 7, 7): the first two along s, the others along t.
_BORDER: tuple[Any, ...] = (np.s_[..., 0], np.s_[..., 6], np.s_[..., 0, :], np.s_[..., 6, :])
TINY = 1e-300
#: Turn of a surface within the tolerance above which it has no normal there [rad]: that of a radius
#: of twice the tolerance.
CREASE = 0.5
#: Sine of the angle between the sides of a patch up to which they leave a corner in one direction:
#: what is left of its Jacobian may be small elsewhere because parameters run slowly.
CUSP = 0.1
_AREA = np.outer(_INTEGRAL, _INTEGRAL).ravel()


@dataclass(slots=True)
class Asked:
    """What is asked of each of some patches: arrays (n,).

    ``tolerance`` [file units] and ``angle_deg`` of the normal, ``area_limit`` relative, ``scale``
    the size of |S_u| |S_v|, ``leans_deg`` by which normals lean over where the surface moves to its
    edges, and ``least`` the Jacobian of a patch up to which it has no normal at a cusp.
    """

    tolerance: FloatArray
    angle_deg: FloatArray
    area_limit: FloatArray
    scale: FloatArray
    leans_deg: FloatArray
    least: FloatArray

    def take(self, rows: IntArray) -> Asked:
        """Of some of the patches, or of faces for each patch of theirs."""
        return Asked(
            self.tolerance[rows], self.angle_deg[rows], self.area_limit[rows], self.scale[rows],
            self.leans_deg[rows], self.least[rows],
        )  # fmt: skip


@dataclass(slots=True)
class Found:
    """What is found of some patches; which of them are good enough.

    ``errors`` (n, 5): distance, angle [deg], area and its error, and at how many points normals
    that are off by more than the angle asked for do not count. ``jacobian`` (n,) is the largest of
    each patch. ``split`` (n,) says how to halve those that are not good enough: in s (1), t (2) or
    both (3); ``over`` in which directions the tolerance is missed.
    """

    errors: FloatArray
    split: IntArray
    over: IntArray
    kept: BoolArray
    jacobian: FloatArray


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (..., 3); faster than NumPy's for many small arrays."""
    out = np.empty(a.shape)
    for k, i, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return out


def length(a: FloatArray) -> FloatArray:
    """Euclidean norms (...) of vectors (..., 3)."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products (...) of vectors (3, ...)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _size(a: FloatArray) -> FloatArray:
    """Euclidean norms (...) of vectors (3, ...)."""
    return np.asarray(np.sqrt(dot(a, a)))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (3, ...) of vectors (3, ...)."""
    return np.stack([a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))])


def _first(a: FloatArray) -> FloatArray:
    """Vectors (n, 7, 7, 3) as (3, n, 7, 7): what is done to one coordinate lies in a row."""
    return np.ascontiguousarray(np.moveaxis(a, 3, 0))


def _unit(a: FloatArray, size: FloatArray) -> FloatArray:
    """Vectors (3, ...) by their ``size`` (...); those of none as they are."""
    return np.asarray(a / np.where(size > 0.0, size, 1.0))


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angles (...) between unit vectors (3, ...). [deg]"""
    return np.asarray(2.0 * np.degrees(np.arcsin(np.minimum(0.5 * _size(a - b), 1.0))))


def _worst(a: FloatArray) -> FloatArray:
    """Largest value (n,) of each of (n, i, j)."""
    return np.asarray(a.max(axis=(1, 2)))


def _creased(
    p: FloatArray, q: FloatArray, m: FloatArray, n: FloatArray, tolerance: FloatArray
) -> BoolArray:
    """Points p (3, k) of surfaces, with unit normals ``m``, at which these are too sharp for one.

    There the surface has a normal ``n`` (3, k, 7, 7) that is another by more than `CREASE` at a
    point ``q`` (3, k, 7, 7) within the ``tolerance`` (k,): a fold or cusp, or a radius under twice
    the tolerance. No patch that may be off by that much has a normal to be compared.
    """
    near = _size(q - p[..., None, None]) <= tolerance[:, None, None]
    turned = dot(n, m[..., None, None]) < math.cos(CREASE)
    return np.asarray((near & turned).any(axis=(1, 2)))


def compared(nets: FloatArray, points: FloatArray, normals: FloatArray, asked: Asked) -> Found:
    """Patches (n, 4, 4, 4) against points and normals (n, 7, 7, 3) of the surface at `CHECK`."""
    n = len(nets)
    # Many small products: a large one would be shared between threads, which wait for each other.
    h = (nets.reshape(n, 16, 4).swapaxes(1, 2) @ _ALL.T).swapaxes(0, 1).reshape(4, n, 3, 7, 7)
    w = h[3, :, 0]
    x = h[:3, :, 0] / w
    xs, xt = ((h[:3, :, k] - h[3, :, k] * x) / w for k in (1, 2))
    n_patch = _cross(xs, xt)
    p, n_face = _first(points), _first(normals)
    a, b = _size(n_patch), _size(n_face)
    ok = (a > 1e-3 * a.max(axis=(1, 2), keepdims=True)) & (b > 1e-6 * asked.scale[:, None, None])
    n_face, n_patch = _unit(n_face, b), _unit(n_patch, a)
    off = x - p
    distance = np.where(ok, np.abs(dot(off, n_face)), _size(off))
    # On the border and where no normal is reliable the distance itself counts; along the border
    # sliding on the curve is harmless.
    for row, tangent in zip(_BORDER, (xs, xs, xt, xt), strict=True):
        d, o = tangent[row], off[row]
        d = _unit(d, _size(d))
        distance[row] = _size(o - dot(o, d) * d)
    angle = np.where(ok, _angles(n_patch, n_face), 0.0)
    ps = _first((_DERIVATIVE @ points.reshape(n, 7, 21)).reshape(n, 7, 7, 3))
    normal = _cross(ps, p @ _DERIVATIVE.T)
    wanted = _size(normal)
    tolerance, limit = asked.tolerance[:, None, None], asked.angle_deg[:, None, None]
    left_out = np.zeros(n)
    at = i, _, _ = np.nonzero(angle > limit)
    if len(i):
        here: tuple[Any, ...] = (slice(None), *at)
        sine = a[at] / np.maximum(_size(xs[here]) * _size(xt[here]), TINY)
        none = (a[at] <= asked.least[i]) & (sine <= CUSP)
        none |= _creased(p[here], p[:, i], n_face[here], n_face[:, i], asked.tolerance[i])
        ok[at], angle[at] = ~none, np.where(none, 0.0, angle[at])
        left_out = np.bincount(i[none], minlength=n).astype(np.float64)
    # Where the surface was moved to its edges no halving brings its own normal back.
    bent = angle
    leans = asked.leans_deg[:, None, None]
    if leans.any():
        other = np.where(ok & (wanted > 0.0), _angles(n_patch, _unit(normal, wanted)), 0.0)
        nearer = (other < angle) & (leans > 0.0) & (angle <= limit + leans)
        bent = np.where(nearer, other, angle)
        n_face = np.where(nearer, _unit(normal, wanted), n_face)
    measure = np.maximum(distance / tolerance, bent / limit)
    # On lines through nodes of t the interpolation in t is exact, normals along s included: what
    # is left there is the error of halving in s too little.
    long_s, long_t = _size(xs), _size(xt)
    lean_s, lean_t = (
        np.where(ok, np.degrees(np.abs(dot(d, n_face)) / np.maximum(long, TINY)), 0.0)
        for d, long in ((xs, long_s), (xt, long_t))
    )
    in_s = np.maximum(
        _worst(distance[:, _BETWEEN][:, :, NODE] / tolerance), _worst(lean_s[:, :, NODE] / limit)
    )
    in_t = np.maximum(
        _worst(distance[:, NODE][:, :, _BETWEEN] / tolerance), _worst(lean_t[:, NODE] / limit)
    )
    area = wanted.reshape(n, 49) @ _AREA
    excess = (a - wanted).reshape(n, 49) @ _AREA
    over = (in_s > 1.0).astype(np.int64) + 2 * (in_t > 1.0)
    split = np.where(
        over > 0, over, np.where(in_s > 4.0 * in_t, 1, np.where(in_t > 4.0 * in_s, 2, 3))
    )
    # Halves of what is narrower than the tolerance say nothing new.
    thin_s, thin_t = (_worst(long) < asked.tolerance for long in (long_s, long_t))
    split = np.where(thin_s & ~thin_t, 2, np.where(thin_t & ~thin_s, 1, split))
    errors = np.stack([_worst(distance), _worst(angle), area, excess, left_out], axis=1)
    extent = np.ptp(x.reshape(3, n, 49), axis=2).max(axis=0)
    kept = _worst(measure) <= 1.0
    limited = np.isfinite(asked.area_limit)
    kept &= ~limited | (np.abs(excess) <= asked.area_limit * np.abs(area))
    kept |= (errors[:, 0] <= asked.tolerance) & (extent < 10.0 * asked.tolerance)
    return Found(errors, split, over, kept, a.max(axis=(1, 2)))
