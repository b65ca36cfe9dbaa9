"""Regions of a patch set: patches joined smoothly on one quadric."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from .kernels.pyramid import Blockers
    from .kernels.regions import Regions

#: Coefficients of one quadric fitted to two of its patches, of size 1, differ by this at most.
_ALIKE = 1e-10
#: Least singular value of a cone or cylinder, and its homogeneous coordinate that means infinity;
#: both against the largest.
_SINGULAR, _INFINITE = 1e-9, 1e-9
#: Shortest axis of an ellipsoid, squared, against the longest, and thinnest cone.
_SLENDER = 1e-6


def make_regions(quadrics: FloatArray, beyond: IntArray, blockers: Blockers) -> Regions:
    """Regions of the surfaces ``blockers``, of which ``quadrics`` (p, 5, 4) are fits.

    ``beyond`` (p, 4, 4) is `kernels.pieces.Surfaces.neighbors`: sides over which the surface goes
    on smoothly are marked in it, in place.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    from .kernels.outlines import SMOOTH
    from .kernels.pieces import COLLAPSED, FREE
    from .kernels.regions import PATCHES, ROUND, RULED, Regions
    from .topology import writable

    count, sheet, spheres = len(quadrics), blockers.solid, blockers.spheres
    smooth = _goes_on(quadrics, beyond)
    a, side = np.nonzero(smooth & (beyond[..., 3] > 0))
    links = coo_array((np.ones(len(a)), (a, beyond[a, side, 0])), shape=(count, count))
    _, label = connected_components(links, directed=False)
    # Where the + side changes over to the other side, patches are taken one by one.
    turned = np.isin(label, label[(smooth & (beyond[..., 3] < 0)).any(axis=1)])
    label = np.where(turned, count + np.arange(count), label)
    beyond[..., 2] = np.where(smooth, SMOOTH, beyond[..., 2])
    _, first, of = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(sheet[first], kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    of, first = rank[of], first[order]
    patch = np.argsort(of, kind="stable")
    ends = (beyond[..., 0] != COLLAPSED) & ~smooth
    bounded = np.zeros(len(first), dtype=bool)
    np.logical_or.at(bounded, of, ends.any(axis=1))
    kind = np.full(len(first), PATCHES, dtype=np.int64)
    center = np.zeros((len(first), 4))
    for r in np.flatnonzero((quadrics[first, 4, 3] > 0.0) & ~turned[first]):
        q = quadrics[first[r], :4]
        _, singular, vectors = np.linalg.svd(q)
        if singular[3] <= _SINGULAR * singular[0] and singular[2] > _SLENDER * singular[0]:
            vertex = vectors[3]
            kind[r] = RULED
            center[r] = vertex
            center[r, 3] = 0.0
            if abs(vertex[3]) > _INFINITE:
                center[r] = vertex / vertex[3]
            continue
        axes = np.linalg.eigvalsh(q[:3, :3])
        axes = axes if axes[0] > 0.0 else -axes[::-1]
        if axes[0] > _SLENDER * axes[2]:
            kind[r] = ROUND
            center[r, :3] = -np.linalg.solve(q[:3, :3], q[:3, 3])
            center[r, 3] = 1.0
    bounded |= kind != ROUND
    sheets = int(sheet.max()) + 1 if count else 0
    convex = blockers.bulging[:sheets].copy()
    np.logical_and.at(convex, sheet, (beyond[..., 0] != FREE).all(axis=1))
    around = _spheres_about(spheres, sheet, sheets)
    for r in np.flatnonzero(~bounded):
        if (sheet == sheet[first[r]]).sum() == (of == r).sum():
            around[sheet[first[r]]] = _sphere_about_ellipsoid(quadrics[first[r]])
    return Regions(
        of=writable(of, np.int64),
        start=np.searchsorted(sheet[first], np.arange(sheets + 1)).astype(np.int64),
        first=np.searchsorted(of[patch], np.arange(len(first) + 1)).astype(np.int64),
        patch=writable(patch, np.int64),
        kind=kind,
        bounded=bounded,
        spheres=around,
        convex=convex,
        quadric=writable(quadrics[first]),
        center=center,
    )


def _spheres_about(spheres: FloatArray, label: IntArray, count: int) -> FloatArray:
    """Spheres (count, 4) about all ``spheres`` of each ``label``."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, label, spheres[:, :3] - spheres[:, 3:])
    np.maximum.at(high, label, spheres[:, :3] + spheres[:, 3:])
    out = np.zeros((count, 4))
    used = np.isfinite(low[:, 0])
    out[used, :3] = 0.5 * (low + high)[used]
    reach = np.linalg.norm(spheres[:, :3] - out[label, :3], axis=1) + spheres[:, 3]
    np.maximum.at(out[:, 3], label, reach * (1.0 + 1e-12))
    return out


def _sphere_about_ellipsoid(quadric: FloatArray) -> FloatArray:
    """The same (4,) about a whole ellipsoid, whose control points reach far beyond it."""
    a, b, scale = quadric[:3, :3], quadric[:3, 3], quadric[4, 3]
    center = -np.linalg.solve(a, b)
    # yᵀ A y = k with y from the centre.
    k = -(quadric[3, 3] + b @ center)
    radius = np.sqrt((k / np.linalg.eigvalsh(a)).max())
    return np.append(quadric[4, :3] + center / scale, radius / scale * (1.0 + 1e-9))


def _goes_on(quadrics: FloatArray, beyond: IntArray) -> NDArray[np.bool_]:
    """Whether the patch over each side (p, 4) goes on on the same quadric, facing either way."""
    other = np.maximum(beyond[..., 0], 0)
    mine, theirs = quadrics[:, None], quadrics[other]
    # Both in the coordinates of the first.
    move = np.zeros((*other.shape, 4, 4))
    ratio = theirs[..., 4, 3] / np.where(mine[..., 4, 3] > 0.0, mine[..., 4, 3], 1.0)
    move[..., [0, 1, 2], [0, 1, 2]] = ratio[..., None]
    move[..., :3, 3] = (mine[..., 4, :3] - theirs[..., 4, :3]) * theirs[..., 4, 3:]
    move[..., 3, 3] = 1.0
    same = move.swapaxes(-1, -2) @ theirs[..., :4, :] @ move
    a, b = (
        q / np.maximum(np.abs(q).max(axis=(-1, -2), keepdims=True), 1e-300)
        for q in (np.broadcast_to(mine[..., :4, :], same.shape), same)
    )
    alike = np.abs(a - beyond[..., 3, None, None] * b).max(axis=(-1, -2)) <= _ALIKE
    known = (mine[..., 4, 3] > 0.0) & (theirs[..., 4, 3] > 0.0)
    return np.asarray((beyond[..., 0] >= 0) & known & alike)
