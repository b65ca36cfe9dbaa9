"""Which solid a point lies in, by the side on which rays first meet each solid."""

import math

import numba as nb
import numpy as np

from .bvh import STACK, enters, inverse
from .ray_patch import FLAT_QUAD, MISS, WORK, hit_general, hit_quad, setup_ray

_GROUP = 16


@nb.njit(cache=True, error_model="numpy")
def _containing_part(
    bounds, links, piece_patch, piece_box, nets, kinds,
    part_of, ox, oy, oz, dx, dy, dz, nearest, facings, touched, stack, work,
):  # fmt: skip
    """Lowest part that the ray leaves at its first hit of that part, −1 if there is none.

    ``nearest``, ``facings`` and ``touched`` (parts,) are scratch; ``nearest`` must be inf
    everywhere and is so again afterwards.
    """
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    count = 0
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
            limit = min(nearest[part], 1e300)
            if kinds[p] == FLAT_QUAD:
                hit, t, facing = hit_quad(nets[p], 0.0, limit, work)
            else:
                box = piece_box[i]
                status, t, _, _, facing = hit_general(
                    nets[p], box[0], box[1], box[2], box[3], 0.0, limit, 0, False, work
                )
                hit = status != MISS
            if hit:
                if nearest[part] == math.inf:
                    touched[count] = part
                    count += 1
                nearest[part], facings[part] = t, facing
    found = -1
    for i in range(count):
        part = touched[i]
        if facings[part] < 0 and (found < 0 or part < found):
            found = part
        nearest[part] = math.inf
    return found


@nb.njit(cache=True, parallel=True, error_model="numpy")
def containing_parts(
    bounds, links, piece_patch, piece_box, nets, kinds, part_of, parts, points, directions
):
    """Part (m,) each point lies in, −1 for none, by a vote of rays along ``directions (k, 3)``.

    Three rays decide when they agree, otherwise all k do.
    """
    m = points.shape[0]
    k = directions.shape[0]
    out = np.full(m, -1, dtype=np.int64)
    if links.shape[0] == 0:
        return out
    for group in nb.prange((m + _GROUP - 1) // _GROUP):
        stack, work = np.empty(STACK, dtype=np.int64), np.empty(WORK)
        nearest, facings = np.full(parts, math.inf), np.zeros(parts, dtype=np.int64)
        touched = np.empty(parts, dtype=np.int64)
        for r in range(group * _GROUP, min((group + 1) * _GROUP, m)):
            votes, asked, last = 0, 0, -1
            for j in range(k):
                if asked == 3 and (votes == 0 or votes == 3):
                    break
                part = _containing_part(
                    bounds, links, piece_patch, piece_box, nets, kinds,
                    part_of, points[r, 0], points[r, 1], points[r, 2],
                    directions[j, 0], directions[j, 1], directions[j, 2],
                    nearest, facings, touched, stack, work,
                )  # fmt: skip
                asked += 1
                if part >= 0:
                    votes += 1
                    last = part
            if 2 * votes > asked:
                out[r] = last
    return out
