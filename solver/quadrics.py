"""Which patches lie on a quadric, and on which."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray
from .model.bezier import surface_points

#: Points along u and v that a quadric is fitted to.
_POINTS = 7
#: How far the points may lie off it, in coordinates of size 1; a displacement of the silhouette
#: by this much changes a form factor by its square.
_OFF = 1e-11
#: Points closer than this to a quadric, against the patch, may be on it.
_ON = 1e-8
#: Thinnest patch, against its length.
_FLAT = 1e-7
#: Least singular value of another fit: else there are several, as through a plane.
_ALONE = 1e-5


def fit_quadrics(nets: FloatArray) -> FloatArray:
    """Quadric (n, 5, 4) of each net (n, 4, 4, 4), as in `kernels.quadric.polar_plane`.

    Rows 0 to 3 are the symmetric matrix Q of Pᵀ Q P = 0, with P = ((p − centre) · scale, 1) and the
    sign that makes its gradient the +normal; row 4 holds centre [m] and scale [1/m]. All zeros
    where there is none, or more than one, as for planes: there nothing is gained.

    The coefficients are the null vector of the monomials at points of the surface. Values of
    Pᵀ Q P are scaled to be heights over the surface, in units of 1/scale, close to it.
    """
    n = len(nets)
    out = np.zeros((n, 5, 4))
    if n == 0:
        return out
    # Chebyshev–Lobatto points, the ends included: all of a patch is to lie on it.
    t = 0.5 - 0.5 * np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1))
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    points, su, sv = surface_points(nets, u, v)
    normals = np.cross(su, sv)
    low, high = points.min(axis=1), points.max(axis=1)
    center = 0.5 * (low + high)
    scale = 2.0 / np.maximum((high - low).max(axis=1), 1e-300)
    local = (points - center[:, None]) * scale[:, None, None]
    # Along its own axes, each of length 1, or a long thin patch would fit to several.
    axes = np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))[1]
    extent = np.abs(np.einsum("nki,nij->nkj", local, axes)).max(axis=1)
    turn = np.zeros((n, 4, 4))
    turn[:, :3, :3] = axes.swapaxes(1, 2) / np.maximum(extent, _FLAT)[:, :, None]
    turn[:, 3, 3] = 1.0
    places = np.concatenate([local, np.ones((*local.shape[:2], 1))], axis=2)
    x, y, z, one = np.einsum("nij,nkj->ink", turn, places)
    terms = np.stack([x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, one], axis=2)
    _, singular, vectors = np.linalg.svd(terms, full_matrices=False)
    good = (singular[:, 9] <= _OFF * singular[:, 0]) & (singular[:, 8] > _ALONE * singular[:, 0])
    good &= (extent > _FLAT).all(axis=1)
    a = vectors[:, 9]
    q = np.empty((n, 4, 4))
    for k, (i, j) in enumerate(
        [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3), (3, 3)]
    ):
        q[:, i, j] = q[:, j, i] = a[:, k] * (1.0 if i == j else 0.5)
    q = turn.swapaxes(1, 2) @ q @ turn
    gradient = np.einsum("nij,nkj->nki", q, places)[..., :3]
    steep = np.linalg.norm(gradient, axis=2)
    length = np.linalg.norm(normals, axis=2)
    # At poles and apexes there is no normal.
    known = length > 1e-6 * length.max(axis=1, keepdims=True)
    along = np.einsum("nki,nki->nk", gradient, normals)
    cosine = along / np.maximum(length * steep, 1e-300)
    sign = np.sign(np.where(known, cosine, 0.0).sum(axis=1))
    good &= ((sign[:, None] * cosine > 0.99) | ~known).all(axis=1)
    # So that values of Pᵀ Q P are heights over the surface, about.
    unit = sign / np.maximum(2.0 * steep.mean(axis=1), 1e-300)
    out[:, :4] = q * unit[:, None, None]
    out[:, 4, :3], out[:, 4, 3] = center, scale
    return np.where(good[:, None, None], out, 0.0)


def turned(quadrics: FloatArray, back: np.ndarray) -> FloatArray:
    """The same for the other side where ``back`` (n,)."""
    out = quadrics.copy()
    out[back, :4] *= -1.0
    return out


def may_lie_on(points: FloatArray, sphere: FloatArray, quadric: FloatArray) -> NDArray[np.bool_]:
    """Which points (m, 3) are in a patch's sphere (4,), and on its quadric if it has one."""
    near = np.asarray(np.linalg.norm(points - sphere[:3], axis=1) <= sphere[3])
    if quadric.any():
        near[near] = np.abs(heights_over(quadric, points[near])) <= _ON * sphere[3]
    return near


def heights_over(quadric: FloatArray, points: FloatArray) -> FloatArray:
    """Height (m,) of points over a quadric, to first order; 0 on it alone. [m]"""
    scale = quadric[4, 3]
    p = np.concatenate([(points - quadric[4, :3]) * scale, np.ones((len(points), 1))], axis=1)
    gradient = p @ quadric[:4]
    value = np.einsum("mk,mk->m", gradient, p)
    # Where the gradient vanishes, as in the middle of a sphere, the value itself is a length.
    slope = np.maximum(2.0 * np.linalg.norm(gradient[:, :3], axis=1), 1e-3)
    return np.asarray(value / slope / scale)
