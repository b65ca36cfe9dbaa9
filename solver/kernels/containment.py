"""Which solid a point lies in, by the side on which rays first meet each solid."""

import math

import numba as nb
import numpy as np

from .bvh import STACK, enters, inverse
from .compiled import lean, parallel
from .ray_patch import FLAT_QUAD, MISS, WORK, hit_general, hit_quad, setup_ray

_GROUP = 16


@lean
def _containing_part(
    bounds, links, piece_patch, piece_box, nets, kinds,
    part_of, candidates, count, ox, oy, oz, dx, dy, dz, nearest, facings, stack, work,
):  # fmt: skip
    """Lowest candidate part that the ray leaves at its first hit of it, −1 if there is none.

    ``candidates[:count]`` are the parts to look at, the only ones with ``nearest`` >= 0.
    """
    for k in range(count):
        nearest[candidates[k]], facings[candidates[k]] = 1e300, 0
    # Not literals: those would compile the callee once more.
    facing_filter, find_any = count * 0, count < 0
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        if enters(bounds[node], ox, oy, oz, ix, iy, iz, 0.0, 1e300) == math.inf:
            continue
        first = links[node, 0]
        if first >= 0:
            stack[top], stack[top + 1] = first, links[node, 1]
            top += 2
            continue
        for i in range(-1 - first, -1 - first + links[node, 1]):
            p = piece_patch[i]
            part = part_of[p]
            if nearest[part] < 0.0:
                continue
            if kinds[p] == FLAT_QUAD:
                hit, t, facing = hit_quad(nets[p], 0.0, nearest[part], work)
            else:
                box = piece_box[i]
                status, t, _, _, facing = hit_general(
                    nets[p], box[0], box[1], box[2], box[3], 0.0, nearest[part], facing_filter,
                    find_any, work,
                )  # fmt: skip
                hit = status != MISS
            if hit:
                nearest[part], facings[part] = t, facing
    for k in range(count):
        if facings[candidates[k]] < 0:
            return candidates[k]
    return -1


@parallel
def containing_parts(
    bounds, links, piece_patch, piece_box, nets, kinds, part_of, part_boxes, points, directions
):
    """Part (m,) each point lies in, −1 for none, by a vote of rays along ``directions (rays, 3)``.

    Three rays decide when they agree, otherwise all do. Only parts whose box in ``part_boxes``
    (parts, 6) holds the point are looked at.
    """
    m = points.shape[0]
    parts = part_boxes.shape[0]
    rays = directions.shape[0]
    out = np.full(m, -1, dtype=np.int64)
    if links.shape[0] == 0:
        return out
    for group in nb.prange((m + _GROUP - 1) // _GROUP):
        stack, work = np.empty(STACK, dtype=np.int64), np.empty(WORK)
        nearest, facings = np.full(parts, -1.0), np.zeros(parts, dtype=np.int64)
        candidates = np.empty(parts, dtype=np.int64)
        for r in range(group * _GROUP, min((group + 1) * _GROUP, m)):
            x, y, z = points[r, 0], points[r, 1], points[r, 2]
            count = 0
            for part in range(parts):
                box = part_boxes[part]
                inside = x >= box[0] and y >= box[1] and z >= box[2]
                if inside and x <= box[3] and y <= box[4] and z <= box[5]:
                    candidates[count] = part
                    count += 1
            if count == 0:
                continue
            votes, asked, last = 0, 0, -1
            for j in range(rays):
                if asked == 3 and (votes == 0 or votes == 3):
                    break
                part = _containing_part(
                    bounds, links, piece_patch, piece_box, nets, kinds,
                    part_of, candidates, count, x, y, z,
                    directions[j, 0], directions[j, 1], directions[j, 2],
                    nearest, facings, stack, work,
                )  # fmt: skip
                asked += 1
                if part >= 0:
                    votes += 1
                    last = part
            if 2 * votes > asked:
                out[r] = last
            for k in range(count):
                nearest[candidates[k]] = -1.0
    return out
