"""Rays against a set of patches; the façade of `kernels.bvh`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .model.arrays import FloatArray, IntArray, check_shape, frozen
from .model.bezier import split_matrix
from .model.patches import PatchSet

#: Curved patches are cut in 2 x 2 pieces, and in 4 x 4 when that shrinks the boxes to this share.
_WORTHWHILE = 0.75
#: More pieces than this cost more memory than they save time.
_MAX_PIECES = 400_000
_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Nearest hits; row i of every array belongs to ray i.

    Attributes
    ----------
    patch : (m,) int array
        Row of the patch, −1 where nothing is hit.
    t : (m,) array
        Distance in units of the direction's length; inf where nothing is hit.
    u, v : (m,) array
        Parameters of the hit; NaN where nothing is hit.
    facing : (m,) int array
        +1 where the ray meets the + side, −1 the − side, 0 where it is tangent or misses.
    undecided : int
        Hits taken without proof because a patch test reached the bound on its work.
    """

    patch: IntArray
    t: FloatArray
    u: FloatArray
    v: FloatArray
    facing: IntArray
    undecided: int


class RayCaster:
    """Exact ray casting on curved patches.

    Parameters
    ----------
    patches : PatchSet
        The surfaces; hits are reported as rows of it.

    Attributes
    ----------
    arrays : tuple
        ``bounds, links, piece_patch, piece_box, nets, kinds``: the leading arguments of
        `kernels.bvh.first_hit`, `any_hit` and `trace_ray`.
    """

    def __init__(self, patches: PatchSet) -> None:
        from .kernels.bvh import build_tree
        from .kernels.ray_patch import classify_patches
        from .topology import writable

        nets = writable(patches.control_points)
        kinds = frozen(classify_patches(nets), np.int64)
        piece_patch, piece_box, boxes = _pieces(nets, kinds)
        if len(boxes):
            bounds, links, order = build_tree(boxes)
        else:
            bounds, links, order = np.zeros((0, 6)), np.zeros((0, 2), np.int64), np.zeros(0, int)
        self.patches = patches
        self.arrays = (
            frozen(bounds),
            frozen(links, np.int64),
            frozen(piece_patch[order], np.int64),
            frozen(piece_box[order]),
            nets,
            kinds,
        )

    def first_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: float = np.inf,
        facing: int = 0,
    ) -> Hits:
        """Nearest hits with t_min < t < t_max of rays (m, 3), (m, 3) [m].

        ``facing`` = +1 looks for hits of + sides only, −1 for − sides only, 0 for both. Rays with
        a NaN direction hit nothing.
        """
        from .kernels.bvh import first_hit
        from .kernels.ray_patch import UNDECIDED

        o, d = _rays(origins, directions)
        # Distances must stay finite inside the kernel: 1e300 is beyond every scene.
        limit = min(float(t_max), 1e300)
        patch, t, u, v, side, status = first_hit(*self.arrays, o, d, float(t_min), limit, facing)
        return Hits(patch, t, u, v, side, int(np.count_nonzero(status == UNDECIDED)))

    def any_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: ArrayLike = np.inf,
        facing: int = 0,
    ) -> IntArray:
        """Whether rays (m, 3) hit anything with t_min < t < t_max (scalar or (m,)): (m,) bool."""
        from .kernels.bvh import any_hit

        o, d = _rays(origins, directions)
        limit = frozen(np.broadcast_to(np.minimum(t_max, 1e300), (len(o),)))
        return np.asarray(any_hit(*self.arrays, o, d, float(t_min), limit, facing))


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    d = frozen(directions)
    check_shape("directions", d, (None, 3))
    try:
        o = frozen(np.broadcast_to(np.asarray(origins, dtype=np.float64), d.shape))
    except ValueError:
        raise InputError(f"origins: shape {np.shape(origins)} does not fit {d.shape}") from None
    return o, d


def _pieces(nets: FloatArray, kinds: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Pieces of all patches: patch (m,), parameter box (m, 4) and space box (m, 6)."""
    n = len(nets)
    levels = np.zeros(n, dtype=np.int64)
    cut = np.flatnonzero((kinds == 0) & ~flat(nets))
    levels[cut] = 1
    coarse = _half_areas(_cut_boxes(nets[cut], 2)).sum(axis=1)
    fine = _half_areas(_cut_boxes(nets[cut], 4)).sum(axis=1)
    levels[cut[fine < _WORTHWHILE * coarse]] = 2
    while levels.any() and int((4**levels).sum()) > _MAX_PIECES:
        levels = np.maximum(levels - 1, 0)
    patch, box, space = [], [], []
    for level in range(3):
        rows = np.flatnonzero(levels == level)
        k = 2**level
        grid = np.arange(k) / k
        u, v = (a.ravel() for a in np.meshgrid(grid, grid, indexing="ij"))
        patch.append(np.repeat(rows, k * k))
        box.append(np.tile(np.stack([u, u + 1 / k, v, v + 1 / k], axis=-1), (len(rows), 1)))
        space.append(_cut_boxes(nets[rows], k).reshape(-1, 6))
    return np.concatenate(patch), np.concatenate(box), np.concatenate(space)


def _cut_boxes(nets: FloatArray, k: int) -> FloatArray:
    """Boxes (n, k², 6) around the control points of k x k pieces, u-major. [m]"""
    cut = _cuts(k)
    along_v = cut @ nets.reshape(-1, 4, 4)
    pieces = cut @ along_v.reshape(len(nets), 4, 16 * k)
    points = pieces.reshape(len(nets), k, 4, k, 4, 4)
    points = points[..., :3] / points[..., 3:]
    # Along the first axis, as whole arrays: short axes in the middle take twice as long in all.
    points = np.ascontiguousarray(points.transpose(2, 4, 0, 1, 3, 5)).reshape(16, -1)
    low, high = (f(axis=0).reshape(len(nets), k * k, 3) for f in (points.min, points.max))
    # The patch test accepts hits within rounding outside the surface.
    slack = 64 * _EPS * np.maximum(np.abs(low), np.abs(high)).max(axis=2, keepdims=True)
    return np.concatenate([low - slack, high + slack], axis=2)


@cache
def _cuts(k: int) -> FloatArray:
    """What takes the coefficients of a cubic to those of its k equal parts: (4 k, 4)."""
    ends = np.arange(k + 1) / k
    return split_matrix(ends[:-1], ends[1:]).reshape(4 * k, 4)


def _half_areas(boxes: FloatArray) -> FloatArray:
    x, y, z = np.moveaxis(boxes[..., 3:] - boxes[..., :3], -1, 0)
    return np.asarray(x * y + y * z + z * x)


def flat(nets: FloatArray) -> IntArray:
    """Whether all control points lie in a plane to 1e-3 of the patch's size."""
    points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
    points = points - points.mean(axis=1, keepdims=True)
    if len(nets) == 0:
        return np.zeros(0, dtype=bool)
    values = np.linalg.svd(points, compute_uv=False)
    return np.asarray(values[:, 2] <= 1e-3 * values[:, 0])
