"""What the solver knows of a patch set: flatness, convexity, neighbours, closed solids."""

from __future__ import annotations

import numpy as np

from .kernels.nets import CONCAVE, CONVEX, PLANAR, normal_cone
from .kernels.pyramid import Blockers
from .kernels.ray_patch import classify_patches
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.patches import PatchSet

#: Edges closer than this share of a patch's width may be one.
NARROW = 0.01
#: Nets at a time whose points are compared with each other.
_NETS = 512
#: Patches at a time of which it is asked what lies before them: most solids show it at the first.
_PATCHES = 16
#: A unit vector along which edges are sorted.
_ASKEW = np.array([0.5773, 0.6081, 0.5450])


def writable(array: np.ndarray, dtype: type = np.float64) -> np.ndarray:
    """A C-contiguous writable copy for kernels.

    Parallel kernels see all their arrays as writable: given read-only ones, Numba would compile
    every function they call a second time.
    """
    return np.array(array, dtype=dtype, order="C")


def bounding_spheres(nets: FloatArray) -> FloatArray:
    """Centre and radius (n, 4) of spheres about the control points of nets (n, 4, 4, 4). [m]"""
    points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
    center = 0.5 * (points.min(axis=1) + points.max(axis=1))
    radius = np.linalg.norm(points - center[:, None], axis=2).max(axis=1)
    return np.concatenate([center, radius[:, None] * (1.0 + 1e-12)], axis=1)


def normal_cones(nets: FloatArray) -> FloatArray:
    """Axis and sine of the half-angle (n, 4) of the normals of nets (n, 4, 4, 4)."""
    cones = np.empty((len(nets), 4))
    for net, cone in zip(writable(nets), cones, strict=True):
        normal_cone(net, cone)
    return cones


def _points_and_normals(
    nets: FloatArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points and ∂u × ∂v (n, k, 3) of all nets at the same parameters (k,)."""
    points, su, sv = surface_points(nets, u, v)
    return points, np.cross(su, sv)


def shape_flags(nets: FloatArray) -> IntArray:
    """Bits of `patch_factor` (n,): `PLANAR`, and `CONVEX` or `CONCAVE` seen from the + side.

    Judged on 5 x 5 points of the surface: every point below (above) the tangent planes of all
    others. A plane is planar only.
    """
    t = (np.arange(5) + 0.5) / 5.0
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    flags = np.zeros(len(nets), dtype=np.int64)
    for start in range(0, len(nets), _NETS):
        some = nets[start : start + _NETS]
        control = (some[..., :3] / some[..., 3:]).reshape(-1, 16, 3)
        points, normals = _points_and_normals(some, u, v)
        points = points - control[:, :1]  # near 0, where differences keep their digits
        size = np.ptp(control, axis=1).max(axis=1)
        rounding = 1e-11 * size + 4e-15 * np.abs(control).max(axis=(1, 2))
        length = np.linalg.norm(normals, axis=2)
        longest = length.max(axis=1, keepdims=True)
        good = length > 1e-9 * longest
        # Where there is no normal, nothing is above or below.
        normals = np.where(good[..., None], normals / np.where(good, length, 1.0)[..., None], 0.0)
        first = normals[np.arange(len(some)), good.argmax(axis=1)]
        across = np.einsum("nki,ni->nk", control - control[:, :1], first)
        flat = np.abs(across).max(axis=1) <= rounding
        foot = np.einsum("nai,nai->na", normals, points)
        above = normals @ points.swapaxes(1, 2) - foot[..., None]
        convex = above.max(axis=(1, 2)) <= rounding
        concave = above.min(axis=(1, 2)) >= -rounding
        kind = np.where(flat, PLANAR, np.where(convex, CONVEX, np.where(concave, CONCAVE, 0)))
        flags[start : start + _NETS] = np.where(longest[:, 0] > 0.0, kind, 0)
    return flags


def edge_points(nets: FloatArray) -> FloatArray:
    """End and two inner points (n, 4, 4, 3) of the four boundary edges of each net."""
    t = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
    s = 1.0 - t
    basis = np.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], axis=1)
    edges = np.stack([nets[:, :, 0], nets[:, 3, :], nets[:, :, 3], nets[:, 0, :]], axis=1)
    h = np.einsum("ti,neik->netk", basis, edges, optimize=True)
    return np.asarray(h[..., :3] / h[..., 3:])


def size_of(points: FloatArray) -> float:
    """Largest extent of points (..., 3) along an axis. [m]"""
    return float(np.ptp(points.reshape(-1, 3), axis=0).max())


def adjacency(
    nets: FloatArray, solid: IntArray, *, relative: float = 1e-7, extent: float | None = None
) -> IntArray:
    """Neighbour (n, 4) over each boundary edge within the same solid, −1 where there is none.

    Two edges are one when their ends and two inner points agree, in either direction, within
    ``relative`` of the size of the set, or of ``extent`` [m], but not when the patch is no wider
    than that. An edge met by more than two patches has no neighbour.
    """
    n = len(nets)
    out = np.full((n, 4), -1, dtype=np.int64)
    if n == 0:
        return out
    points = edge_points(nets).reshape(4 * n, 4, 3)
    extent = size_of(points) if extent is None else extent
    tolerance = relative * max(extent, 1e-300)
    length = np.linalg.norm(points[:, 3] - points[:, 0], axis=1) + np.linalg.norm(
        points[:, 1] - points[:, 2], axis=1
    )
    middle = points.mean(axis=1)
    across = middle.reshape(n, 4, 3)
    width = np.linalg.norm(across - across[:, [2, 3, 0, 1]], axis=2).ravel()
    within = np.minimum(tolerance, np.where(width > 0.0, NARROW * width, tolerance))
    long = np.flatnonzero(length > 4.0 * tolerance)
    # Along a direction that no model is aligned with, few places agree by chance.
    place = middle @ _ASKEW
    order = np.argsort(place, kind="stable")
    reach = 2.0 * tolerance
    low = np.searchsorted(place[order], place[long] - reach)
    count = np.searchsorted(place[order], place[long] + reach, side="right") - low
    a = np.repeat(long, count)
    b = order[np.arange(len(a)) + np.repeat(low - (np.cumsum(count) - count), count)]
    near = (a != b) & (solid[a // 4] == solid[b // 4])
    near &= np.abs(middle[a] - middle[b]).max(axis=1) <= tolerance
    a, b = a[near], b[near]
    close = np.minimum(within[a], within[b])
    same = np.abs(points[a] - points[b]).max(axis=(1, 2)) <= close
    turned = np.abs(points[a] - points[b][:, ::-1]).max(axis=(1, 2)) <= close
    a, b = a[same | turned], b[same | turned]
    partners = np.bincount(a, minlength=4 * n)
    single = (partners[a] == 1) & (partners[b] == 1)
    out[a[single] // 4, a[single] % 4] = b[single] // 4
    return out


def watertight(nets: FloatArray, adjacent: IntArray) -> IntArray:
    """Whether each patch (n,) has a neighbour over every side that is not one point."""
    edges = edge_points(nets)
    collapsed = np.ptp(edges, axis=2).max(axis=2) <= 1e-12 * np.ptp(edges, axis=(1, 2)).max(
        axis=1, keepdims=True
    )
    return np.asarray(((adjacent >= 0) | collapsed).all(axis=1))


def convexity(
    nets: FloatArray,
    flags: IntArray,
    solid: IntArray,
    closed: IntArray,
    count: int,
    one_sided: IntArray | None = None,
) -> tuple[IntArray, IntArray]:
    """Which solids (count,) are convex bodies, and which are convex cavities.

    Every corner of the solid must lie on one side of the tangent planes at 9 points of each patch.

    Surfaces that are open are bodies, too, where they bend and nothing but their + side gives or
    gets light (``one_sided`` (n,)): what is seen of that side is seen from before its tangent
    plane, and all of the surface lies behind it.
    """
    one_sided = np.zeros(len(nets), dtype=bool) if one_sided is None else one_sided
    bulging, hollow = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    t = np.array([0.1, 0.5, 0.9])
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    for index in np.unique(solid):
        rows = np.flatnonzero(solid == index)
        whole, shapes = closed[rows].all(), flags[rows]
        bent = one_sided[rows].all() and bool((shapes & CONVEX).any())
        if not (whole or bent) or len(rows) > 200:
            continue
        own = nets[rows]
        points = (own[..., :3] / own[..., 3:]).reshape(-1, 3)
        size = float(np.ptp(points, axis=0).max())
        highest, lowest = -np.inf, np.inf
        corners = (own[:, ::3, ::3, :3] / own[:, ::3, ::3, 3:]).reshape(-1, 3)
        at, normals = _points_and_normals(own, u, v)
        length = np.linalg.norm(normals, axis=2)
        good = length > 1e-9 * np.maximum(length.max(axis=1, keepdims=True), 1e-300)
        for first in range(0, len(rows), _PATCHES):
            some = slice(first, first + _PATCHES)
            away = normals[some][good[some]] / length[some][good[some], None]
            foot = (away * at[some][good[some]]).sum(axis=1)
            height = away @ corners.T - foot[:, None]
            if height.size:
                highest, lowest = max(highest, height.max()), min(lowest, height.min())
            if highest > 1e-9 * size and lowest < -1e-9 * size:
                break
        bulging[index] = highest <= 1e-9 * size and bool((shapes & (PLANAR | CONVEX)).all())
        inward = lowest >= -1e-9 * size and bool((shapes & (PLANAR | CONCAVE)).all())
        hollow[index] = whole and inward
    return bulging, hollow


def make_blockers(
    patches: PatchSet,
    closed: IntArray,
    solid: IntArray,
    adjacent: IntArray | None = None,
    *,
    one_sided: IntArray | None = None,
) -> Blockers:
    """Everything the kernels need to know of the patches that hide light.

    Parameters
    ----------
    patches : PatchSet
        All patches of the scene.
    closed : (p,) bool array
        Patches of closed solids, +normal outward: they block with their front only.
    solid : (p,) int array
        Solid or part of each patch.
    adjacent : (p, 4) int array, optional
        From `adjacency`, where it is known already.
    one_sided : (p,) bool array, optional
        Patches whose − side neither gives nor gets light; none when not given.
    """
    nets = writable(patches.control_points)
    flags = shape_flags(nets)
    solid = np.asarray(solid, dtype=np.int64)
    count = int(solid.max()) + 1 if len(solid) else 0
    bulging, hollow = convexity(nets, flags, solid, np.asarray(closed, bool), count, one_sided)
    return Blockers(
        nets=nets,
        kinds=classify_patches(nets),
        closed=writable(closed, np.bool_),
        adjacent=adjacency(nets, solid) if adjacent is None else writable(adjacent, np.int64),
        cones=normal_cones(nets),
        flags=flags,
        solid=writable(solid, np.int64),
        bulging=bulging,
        hollow=hollow,
        spheres=bounding_spheres(nets),
    )


def is_single(blockers: Blockers, shape: IntArray) -> bool:
    """Whether all there is is one solid of a ``shape``: ``.bulging`` or ``.hollow``."""
    return bool(len(np.unique(blockers.solid)) == 1 and shape[blockers.solid[0]])
