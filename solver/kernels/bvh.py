"""Bounding volume hierarchy over patches, and the rays that go through it.

Leaves hold pieces of patches: a curved patch enters as several parameter boxes, whose control nets
lie closer to the surface. The tree is split by the surface area heuristic over binned centroids
[1]. Slab tests are widened by their own rounding [2], so that no hit the patch test would find is
lost in the tree.

A tree is four arrays: ``bounds (n, 6)`` lower and upper corner of every node; ``links (n, 2)`` the
two children of a node, or (−1 − first, count) of a leaf's pieces; ``piece_patch (m,)`` and
``piece_box (m, 4)`` the patch and (u0, u1, v0, v1) of every piece.

.. [1] I. Wald, "On fast construction of SAH-based bounding volume hierarchies", IEEE Symposium on
   Interactive Ray Tracing, 2007, pp. 33-40.
.. [2] T. Ize, "Robust BVH ray traversal", Journal of Computer Graphics Techniques 2(2), 2013.
"""

import math

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .ray_patch import FLAT_QUAD, MISS, WORK, hit_general, hit_quad, quad_parameters, setup_ray

_BINS = 16
_LEAF = 2
#: Below this depth ranges are halved by count, which bounds the stack.
_SAH_DEPTH = 40
STACK = 128
#: Rays a thread takes at a time; each group shares scratch arrays.
_GROUP = 64


@kernel
def build_tree(boxes):
    """Tree over boxes (m, 6): (bounds, links, order), ``order`` being the pieces leaf by leaf."""
    m = boxes.shape[0]
    order = np.arange(m)
    bounds = np.empty((max(2 * m, 1), 6))
    links = np.zeros((max(2 * m, 1), 2), dtype=np.int64)
    todo = np.empty((STACK, 4), dtype=np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, 0, m, 0
    top, nodes = 1, 1
    while top > 0:
        top -= 1
        node, first, last, depth = todo[top, 0], todo[top, 1], todo[top, 2], todo[top, 3]
        _union(boxes, order, first, last, bounds[node])
        if last - first <= _LEAF:
            links[node, 0], links[node, 1] = -1 - first, last - first
            continue
        middle = _partition(boxes, order, first, last, depth)
        links[node, 0], links[node, 1] = nodes, nodes + 1
        for side in range(2):
            todo[top, 0] = nodes + side
            todo[top, 1] = first if side == 0 else middle
            todo[top, 2] = middle if side == 0 else last
            todo[top, 3] = depth + 1
            top += 1
        nodes += 2
    return bounds[:nodes].copy(), links[:nodes].copy(), order


@lean
def _union(boxes, order, first, last, out):
    for k in range(3):
        out[k], out[k + 3] = math.inf, -math.inf
    for i in range(first, last):
        for k in range(3):
            out[k] = min(out[k], boxes[order[i], k])
            out[k + 3] = max(out[k + 3], boxes[order[i], k + 3])


@lean
def _half_area(box):
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x


@kernel
def _partition(boxes, order, first, last, depth):
    """Reorder ``order[first:last]`` into two groups; returns where the second begins."""
    best_cost, best_axis, best_bin = math.inf, -1, 0
    low, high = np.empty(3), np.empty(3)
    for k in range(3):
        low[k], high[k] = math.inf, -math.inf
        for i in range(first, last):
            c = boxes[order[i], k] + boxes[order[i], k + 3]
            low[k], high[k] = min(low[k], c), max(high[k], c)
    bin_box = np.empty((_BINS, 6))
    bin_count = np.empty(_BINS, dtype=np.int64)
    right_area = np.empty(_BINS)
    run = np.empty(6)
    for axis in range(3):
        if depth >= _SAH_DEPTH or not high[axis] > low[axis]:
            continue
        for b in range(_BINS):
            bin_count[b] = 0
            for k in range(3):
                bin_box[b, k], bin_box[b, k + 3] = math.inf, -math.inf
        factor = _BINS / (high[axis] - low[axis])
        for i in range(first, last):
            box = boxes[order[i]]
            b = min(int((box[axis] + box[axis + 3] - low[axis]) * factor), _BINS - 1)
            bin_count[b] += 1
            for k in range(3):
                bin_box[b, k] = min(bin_box[b, k], box[k])
                bin_box[b, k + 3] = max(bin_box[b, k + 3], box[k + 3])
        for k in range(3):
            run[k], run[k + 3] = math.inf, -math.inf
        for b in range(_BINS - 1, 0, -1):
            for k in range(3):
                run[k] = min(run[k], bin_box[b, k])
                run[k + 3] = max(run[k + 3], bin_box[b, k + 3])
            right_area[b] = _half_area(run)
        for k in range(3):
            run[k], run[k + 3] = math.inf, -math.inf
        left = 0
        for b in range(_BINS - 1):
            left += bin_count[b]
            for k in range(3):
                run[k] = min(run[k], bin_box[b, k])
                run[k + 3] = max(run[k + 3], bin_box[b, k + 3])
            right = last - first - left
            if left == 0 or right == 0:
                continue
            cost = left * _half_area(run) + right * right_area[b + 1]
            if cost < best_cost:
                best_cost, best_axis, best_bin = cost, axis, b
    if best_axis < 0:
        return _halve(boxes, order, first, last, low, high)
    factor = _BINS / (high[best_axis] - low[best_axis])
    i, j = first, last - 1
    while i <= j:
        box = boxes[order[i]]
        b = min(int((box[best_axis] + box[best_axis + 3] - low[best_axis]) * factor), _BINS - 1)
        if b <= best_bin:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i


@kernel
def _halve(boxes, order, first, last, low, high):
    """Median split along the axis of the widest centroids."""
    axis = 0
    for k in range(1, 3):
        if high[k] - low[k] > high[axis] - low[axis]:
            axis = k
    keys = np.empty(last - first)
    for i in range(first, last):
        keys[i - first] = boxes[order[i], axis] + boxes[order[i], axis + 3]
    ranked = order[first:last][np.argsort(keys, kind="mergesort")]
    order[first:last] = ranked
    return (first + last) // 2


@lean
def enters(box, ox, oy, oz, ix, iy, iz, t_min, t_max):
    """Distance at which a ray with inverse direction (ix, iy, iz) enters the box, or inf."""
    a, b = (box[0] - ox) * ix, (box[3] - ox) * ix
    near, far = min(a, b), max(a, b)
    a, b = (box[1] - oy) * iy, (box[4] - oy) * iy
    near, far = max(near, min(a, b)), min(far, max(a, b))
    a, b = (box[2] - oz) * iz, (box[5] - oz) * iz
    near, far = max(near, min(a, b)), min(far, max(a, b))
    # Three roundings each in two distances [2]; a point box at the origin keeps near = far = 0.
    far += 1.4e-15 * (abs(near) + abs(far))
    if far < near or far < t_min or near > t_max:
        return math.inf
    return near


@lean
def inverse(d):
    # A finite stand-in for 1/0, so that 0 · (1/0) is 0 and not NaN.
    if abs(d) < 1e-290:
        return -1e290 if d < 0.0 else 1e290
    return 1.0 / d


@lean
def trace_ray(
    bounds, links, piece_patch, piece_box, nets, kinds,
    ox, oy, oz, dx, dy, dz, t_min, t_max, facing_filter, find_any, stack, work,
):  # fmt: skip
    """Nearest (or any) hit of one ray: (status, patch, t, u, v, facing), patch −1 for a miss.

    ``facing_filter`` and ``facing`` as in `ray_patch`; an undecided test counts as a hit.
    ``stack (STACK,) int64`` and ``work (WORK,)`` are scratch.
    """
    status, patch, t_hit, u_hit, v_hit, facing_hit = MISS, -1, t_max, 0.0, 0.0, 0
    squared = dx * dx + dy * dy + dz * dz
    if not (squared > 0.0 and squared < math.inf) or links.shape[0] == 0:
        return status, patch, t_hit, u_hit, v_hit, facing_hit
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    if enters(bounds[0], ox, oy, oz, ix, iy, iz, t_min, t_hit) == math.inf:
        return status, patch, t_hit, u_hit, v_hit, facing_hit
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        first = links[node, 0]
        if first < 0:
            for i in range(-1 - first, -1 - first + links[node, 1]):
                p = piece_patch[i]
                if kinds[p] == FLAT_QUAD:
                    hit, t, facing = hit_quad(nets[p], t_min, t_hit, work)
                    if hit and facing * facing_filter >= 0:
                        status, patch, t_hit, facing_hit = 1, p, t, facing
                else:
                    box = piece_box[i]
                    found, t, u, v, facing = hit_general(
                        nets[p], box[0], box[1], box[2], box[3],
                        t_min, t_hit, facing_filter, find_any, work,
                    )  # fmt: skip
                    if found != MISS:
                        status, patch, t_hit, facing_hit = found, p, t, facing
                        u_hit, v_hit = u, v
            if find_any and status != MISS:
                break
            continue
        second = links[node, 1]
        near_1 = enters(bounds[first], ox, oy, oz, ix, iy, iz, t_min, t_hit)
        near_2 = enters(bounds[second], ox, oy, oz, ix, iy, iz, t_min, t_hit)
        if near_1 > near_2:
            first, second = second, first
            near_1, near_2 = near_2, near_1
        if near_2 < math.inf:
            stack[top] = second
            top += 1
        if near_1 < math.inf:
            stack[top] = first
            top += 1
    if patch >= 0 and not find_any and kinds[patch] == FLAT_QUAD:
        u_hit, v_hit = quad_parameters(nets[patch], work)
    return status, patch, t_hit, u_hit, v_hit, facing_hit


@parallel
def first_hit(
    bounds, links, piece_patch, piece_box, nets, kinds, origins, directions, t_min, t_max,
    facing_filter,
):  # fmt: skip
    """Nearest hits of rays (m, 3): arrays patch, t, u, v, facing, status; patch −1 for a miss.

    Rays with a NaN or zero direction miss. Distances are in units of |direction|.
    """
    m = origins.shape[0]
    patch = np.full(m, -1, dtype=np.int64)
    t, u, v = np.full(m, math.inf), np.full(m, math.nan), np.full(m, math.nan)
    facing, status = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    find_any = m < 0  # never; not a literal: it would compile the callees once more
    for group in nb.prange((m + _GROUP - 1) // _GROUP):
        stack = np.empty(STACK, dtype=np.int64)
        work = np.empty(WORK)
        for r in range(group * _GROUP, min((group + 1) * _GROUP, m)):
            found, p, distance, a, b, side = trace_ray(
                bounds, links, piece_patch, piece_box, nets, kinds,
                origins[r, 0], origins[r, 1], origins[r, 2],
                directions[r, 0], directions[r, 1], directions[r, 2],
                t_min, t_max, facing_filter, find_any, stack, work,
            )  # fmt: skip
            if found != MISS:
                status[r], patch[r], t[r], u[r], v[r], facing[r] = found, p, distance, a, b, side
    return patch, t, u, v, facing, status


@parallel
def any_hit(
    bounds, links, piece_patch, piece_box, nets, kinds, origins, directions, t_min, t_max,
    facing_filter,
):  # fmt: skip
    """Whether rays (m, 3) hit anything with t_min < t < t_max[ray]: (m,) bool."""
    m = origins.shape[0]
    hit = np.zeros(m, dtype=np.bool_)
    find_any = m >= 0  # always, as above
    for group in nb.prange((m + _GROUP - 1) // _GROUP):
        stack = np.empty(STACK, dtype=np.int64)
        work = np.empty(WORK)
        for r in range(group * _GROUP, min((group + 1) * _GROUP, m)):
            found, _, _, _, _, _ = trace_ray(
                bounds, links, piece_patch, piece_box, nets, kinds,
                origins[r, 0], origins[r, 1], origins[r, 2],
                directions[r, 0], directions[r, 1], directions[r, 2],
                t_min, t_max[r], facing_filter, find_any, stack, work,
            )  # fmt: skip
            hit[r] = found != MISS
    return hit
