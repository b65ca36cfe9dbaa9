"""Sky and ground through panes.

Seen from a receiver, a pane is a cell of directions: its control points relative to the receiver,
with weight 0. The pyramids see the sky in it past everything that hides, before the pane and
beyond it. A cell is cut exactly along the world's horizon where the pane is a flat quadrangle, and
quartered until the share that panes let through changes little over it; the light of a cell is
then that of the unhidden sky times the mean of that share, weighted with luminance and cosine.
Each direction belongs to the pane that it meets first: panes that are wholly before another one
hide it like walls, of others that is told by sampling.
"""

import math

import numba as nb
import numpy as np

from .bvh import STACK
from .compiled import lean, parallel
from .contour import horizon_tolerance, shift_net
from .nets import ALWAYS_FRONT, copy_net, halve_u, halve_v, heights, surface
from .panes import through
from .pyramid import NO_BLOCKER, make_scratch, see_blockers, visible_factor
from .ray_nets import WORK
from .ray_quad import FLAT_QUAD
from .sky_luminance import sky_luminance

#: What is found: luminance times form factor of the sky, let through and with nothing in place of
#: the panes, its form factor, form factors of the ground in the same way, and the variances of the
#: second and the last.
SKY, SKY_PLAIN, SKY_FACTOR, GROUND, GROUND_FACTOR, SKY_VARIANCE, GROUND_VARIANCE = range(7)
COLUMNS = 7
#: Regions of a cell: not known yet, above and below the horizon.
_ANY, _ABOVE, _BELOW = 0, 1, 2
_CELLS = 96
_GAUSS = 0.5 - 0.5 / math.sqrt(3.0)
_FAR = 1e300


@lean
def _clip(corners, count, sign, out):
    """Part of a polygon of directions (count, 3) with ``sign`` z >= 0; returns its corners."""
    kept = 0
    for k in range(count):
        a, b = corners[k], corners[(k + 1) % count]
        za, zb = sign * a[2], sign * b[2]
        if za >= 0.0:
            for c in range(3):
                out[kept, c] = a[c]
            kept += 1
        if (za > 0.0 and zb < 0.0) or (za < 0.0 and zb > 0.0):
            t = za / (za - zb)
            out[kept, 0] = a[0] + t * (b[0] - a[0])
            out[kept, 1] = a[1] + t * (b[1] - a[1])
            out[kept, 2] = 0.0
            kept += 1
    return kept


@lean
def _bilinear(corners, a, b, c, d, turned, net):
    """Net of the flat quadrangle of directions with the corners of those numbers, in order."""
    for i in range(4):
        u = 1.0 - i / 3.0 if turned else i / 3.0
        for j in range(4):
            v = j / 3.0
            for k in range(3):
                net[i, j, k] = (
                    (1.0 - u) * ((1.0 - v) * corners[a, k] + v * corners[d, k])
                    + u * ((1.0 - v) * corners[b, k] + v * corners[c, k])
                )  # fmt: skip
            net[i, j, 3] = 0.0


@lean
def _push_clipped(cell, turned, polygon, clipped, stack, level, region, top, deep):
    """Put the parts of a flat cell above and below the horizon on the stack; returns its top."""
    for k in range(3):
        polygon[0, k], polygon[1, k] = cell[0, 0, k], cell[3, 0, k]
        polygon[2, k], polygon[3, k] = cell[3, 3, k], cell[0, 3, k]
    for side in range(2):
        count = _clip(polygon, 4, 1.0 - 2.0 * side, clipped)
        for first in range(1, count - 1, 2):
            last = min(first + 2, count - 1)
            _bilinear(clipped, 0, first, first + 1, last, turned, stack[top])
            level[top], region[top] = deep, _ABOVE if side == 0 else _BELOW
            top += 1
    return top


@lean
def _seen_sign(cell, u, v, h, hu, hv):
    """Positive where the cell runs counter-clockwise as the receiver sees it."""
    surface(cell, u, v, h, hu, hv)
    return -(
        h[0] * (hu[1] * hv[2] - hu[2] * hv[1])
        + h[1] * (hu[2] * hv[0] - hu[0] * hv[2])
        + h[2] * (hu[0] * hv[1] - hu[1] * hv[0])
    )


@lean
def _size(cell, h, hu, hv):
    """Solid angle of a small cell over π, the most that its form factor can be."""
    sign = _seen_sign(cell, 0.5, 0.5, h, hu, hv)
    return abs(sign) / (math.pi * (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]) ** 1.5)


@lean
def _turn(cell):
    """Let u run backwards."""
    for j in range(4):
        for k in range(4):
            for i in range(2):
                a = cell[i, j, k]
                cell[i, j, k] = cell[3 - i, j, k]
                cell[3 - i, j, k] = a


@lean
def _mean(
    panes,
    own,
    before,
    cell,
    x,
    n,
    tone,
    region,
    lift,
    h,
    hu,
    hv,
    walk,
    work,
    scratch,
    point,
    area,
    found,
):
    """Means over a cell by 2 x 2 Gauss points.

    Of the share let through, and of whether pane ``own`` comes first, weighted with light; the
    change of the first from the cell's middle; its form factor. Points that a pane ``before`` it
    hides do not count, unless that is all.
    """
    light = weight = mine = factor = any_light = any_weight = 0.0
    for i in range(2):
        for j in range(2):
            u = _GAUSS if i == 0 else 1.0 - _GAUSS
            v = _GAUSS if j == 0 else 1.0 - _GAUSS
            det = abs(_seen_sign(cell, u, v, h, hu, hv))
            square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
            size = math.sqrt(square)
            up = max(n[0] * h[0] + n[1] * h[1] + n[2] * h[2], 1e-6 * size)
            w = det * up / (square * square)
            factor += 0.25 * w / math.pi
            if region == _ABOVE:
                w *= sky_luminance(
                    tone, tone[7], tone[8], tone[9], h[0] / size, h[1] / size, h[2] / size
                )
            share, first = through(
                panes, x[0], x[1], x[2], h[0] / size, h[1] / size, h[2] / size, lift, _FAR, walk,
                work, scratch, point, area,
            )  # fmt: skip
            any_light += w * share
            any_weight += w
            if first >= 0 and first != own and before[first]:
                continue
            weight += w
            if first == own:
                mine += w
                light += w * share
    surface(cell, 0.5, 0.5, h, hu, hv)
    size = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
    share, first = through(
        panes, x[0], x[1], x[2], h[0] / size, h[1] / size, h[2] / size, lift, _FAR, walk, work,
        scratch, point, area,
    )  # fmt: skip
    if weight > 0.0:
        found[0], found[1] = light / weight, mine / weight
        hidden = first >= 0 and first != own and before[first]
        found[2] = 0.0 if hidden else abs(found[0] - (share if first == own else 0.0))
        found[2] = max(found[2], found[1] * (1.0 - found[1]))
    else:
        found[0], found[1], found[2] = any_light / any_weight, 1.0, 0.0
    found[3] = factor


@lean
def _sides(cell, h, hu, hv):
    """1 where all of the cell runs counter-clockwise as seen, −1 clockwise, 0 both; by 9 points."""
    more = less = False
    for i in range(3):
        for j in range(3):
            sign = _seen_sign(cell, 0.02 + 0.48 * i, 0.02 + 0.48 * j, h, hu, hv)
            more |= sign > 0.0
            less |= sign < 0.0
    if more and less:
        return 0
    return 1 if more else -1


@lean
def _begin(cell, kind, solid, rounding, polygons, stack, level, region, h, hu, hv):
    """Put the cells of a pane, shifted to the receiver, on the stack; returns how many."""
    if kind == FLAT_QUAD:
        seen = _seen_sign(cell, 0.5, 0.5, h, hu, hv)
        # ∂u × ∂v is proportional to the normal for any weights: their common factor cancels.
        size = math.sqrt(
            (hu[1] * hv[2] - hu[2] * hv[1]) ** 2
            + (hu[2] * hv[0] - hu[0] * hv[2]) ** 2
            + (hu[0] * hv[1] - hu[1] * hv[0]) ** 2
        )
        if abs(seen) <= rounding * size or (solid and seen < 0.0):
            return 0
        return _push_clipped(cell, seen < 0.0, polygons[0], polygons[1], stack, level, region, 0, 0)
    for i in range(4):
        for j in range(4):
            for k in range(3):
                stack[0, i, j, k] = cell[i, j, k]
            stack[0, i, j, 3] = 0.0
    level[0], region[0] = 0, _ANY
    return 1


@lean
def _find_before(x, own, first, blockers, ranges, flat, lift, before):
    """Mark the panes (p,) that are wholly before pane ``own``, as seen from ``x``."""
    h = _height(x, first + own, blockers)
    for p in range(before.shape[0]):
        before[p] = False
        if p == own or blockers.solid[first + p] == blockers.solid[first + own]:
            continue
        if flat[own] and abs(h) > lift:
            low, high = ranges[own, p, 0], ranges[own, p, 1]
            if (low >= -lift) if h > 0.0 else (high <= lift):
                before[p] = True
                continue
        if flat[p]:
            g = _height(x, first + p, blockers)
            low, high = ranges[p, own, 0], ranges[p, own, 1]
            if abs(g) > lift and ((high <= lift) if g > 0.0 else (low >= -lift)):
                before[p] = True


@lean
def _height(x, b, blockers):
    """Height of ``x`` over the plane of a flat patch. [m]"""
    h = 0.0
    for k in range(3):
        corner = blockers.nets[b, 0, 0, k] / blockers.nets[b, 0, 0, 3]
        h += blockers.cones[b, k] * (x[k] - corner)
    return h


@parallel
def glazed_rows(
    nodes, normals, weights, panes, first, ranges, flat, tone, blockers, eps, cell_eps, tolerance,
    levels, quarterings, lift, out,
):  # fmt: skip
    """Light of sky and ground that comes to receivers (m, q, 3) through panes.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node; 0 for nodes that get no light.
    panes : Panes
        Patches that are seen through.
    first : int
        Row of the first of them among the ``blockers``; they are the last.
    ranges : (p, p, 2) array
        Least and greatest height of each pane (second) over the plane of each flat one (first). [m]
    flat : (p,) bool array
        Which are flat.
    tone : (10,) array
        Sky, as `pyramid.visible_factor` wants it.
    blockers : Blockers
        All patches.
    eps, cell_eps, levels
        As `dome.dome_rows`.
    tolerance : float
        Form factor times change of the share let through up to which a cell is not quartered.
    quarterings : int
        How often it is at most.
    lift : float
        Distance from a receiver below which there is no pane. [m]
    out : (m, COLUMNS) array
        Receives what the module says.
    """
    count = blockers.nets.shape[0]
    # Not literals: those would compile the callees once more.
    front, nowhere = tone.size * 0 + ALWAYS_FRONT, tone.size * 0 - 1
    for i in nb.prange(nodes.shape[0]):
        scratch = make_scratch(count, levels)
        listed = np.empty(count + 1, dtype=np.int64)
        before = np.empty(panes.nets.shape[0], dtype=np.bool_)
        seen, cone, plain, dark = np.empty(4), np.zeros(4), np.zeros((5, 4)), np.empty(0)
        x, n, h, hu, hv = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
        polygons = np.empty((2, 8, 3))
        stack, level = np.empty((_CELLS, 4, 4, 4)), np.empty(_CELLS, dtype=np.int64)
        region = np.empty(_CELLS, dtype=np.int64)
        walk, work = np.empty(STACK, dtype=np.int64), np.empty(WORK)
        small, point, area, mean = np.empty((7, 4)), np.empty(3), np.empty(3), np.empty(4)
        cell, low_u, high_u = np.empty((4, 4, 4)), np.empty((4, 4, 4)), np.empty((4, 4, 4))
        for q in range(nodes.shape[1]):
            w = weights[i, q]
            if w == 0.0:
                continue
            for k in range(3):
                x[k], n[k] = nodes[i, q, k], normals[i, q, k]
            rounding = horizon_tolerance(x)
            walls = looked = 0
            see_blockers(blockers, x, n, rounding, scratch.shifted, scratch.state)
            for b in range(first):
                if scratch.state[b] != NO_BLOCKER:
                    listed[walls] = b
                    walls += 1
            for p in range(panes.nets.shape[0]):
                shift_net(panes.nets[p], x, cell)
                _, _, high = heights(cell, n)
                if high <= rounding:
                    continue
                top = _begin(
                    cell, panes.kinds[p], panes.solid[p], lift, polygons, stack, level, region,
                    h, hu, hv,
                )  # fmt: skip
                _find_before(x, p, first, blockers, ranges, flat, lift, before)
                hidden = walls
                for b in range(before.shape[0]):
                    if before[b] and scratch.state[first + b] != NO_BLOCKER:
                        listed[hidden] = first + b
                        hidden += 1
                while top > 0:
                    top -= 1
                    copy_net(stack[top], cell)
                    deep, where = level[top], region[top]
                    _, _, high = heights(cell, n)
                    if high <= 0.0:
                        continue
                    last = deep >= quarterings or top + 8 > _CELLS
                    if where == _ANY:
                        least, most = _FAR, -_FAR
                        for a in range(4):
                            for b in range(4):
                                least = min(least, cell[a, b, 2])
                                most = max(most, cell[a, b, 2])
                        if least >= 0.0:
                            where = _ABOVE
                        elif most <= 0.0:
                            where = _BELOW
                        elif last or _size(cell, h, hu, hv) <= tolerance:
                            turned = _seen_sign(cell, 0.5, 0.5, h, hu, hv) < 0.0
                            top = _push_clipped(
                                cell, turned, polygons[0], polygons[1], stack, level, region,
                                top, deep,
                            )  # fmt: skip
                            continue
                    if where != _ANY:
                        facing = _sides(cell, h, hu, hv)
                        if facing < 0 and panes.solid[p]:
                            continue
                        _mean(
                            panes, p, before, cell, x, n, tone, where, lift, h, hu, hv, walk, work,
                            small, point, area, mean,
                        )  # fmt: skip
                        rough = mean[2] * mean[3] > tolerance or (
                            facing == 0 and mean[3] > tolerance
                        )
                        if last or not rough:
                            if mean[1] == 0.0:
                                continue
                            if facing < 0 or (
                                facing == 0 and _seen_sign(cell, 0.5, 0.5, h, hu, hv) < 0.0
                            ):
                                _turn(cell)
                            visible_factor(
                                cell, looked, x, n, cone, front, plain, nowhere, eps, cell_eps,
                                rounding,
                                tone if where == _ABOVE else dark, blockers, listed, hidden,
                                scratch, seen,
                            )  # fmt: skip
                            looked += 1
                            if where == _ABOVE:
                                out[i, SKY] += w * mean[0] * seen[0]
                                out[i, SKY_PLAIN] += w * mean[1] * seen[0]
                                out[i, SKY_FACTOR] += w * mean[1] * seen[3]
                                out[i, SKY_VARIANCE] += w * w * seen[1]
                            else:
                                out[i, GROUND] += w * mean[0] * seen[0]
                                out[i, GROUND_FACTOR] += w * mean[1] * seen[0]
                                out[i, GROUND_VARIANCE] += w * w * seen[1]
                            continue
                    halve_u(cell, low_u, high_u)
                    halve_v(low_u, stack[top], stack[top + 1])
                    halve_v(high_u, stack[top + 2], stack[top + 3])
                    for k in range(4):
                        level[top + k], region[top + k] = deep + 1, where
                    top += 4
