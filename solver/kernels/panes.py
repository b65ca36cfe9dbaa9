"""Light through panes: what is left of it along a line, and of pairs of receiver and element.

A ray that enters a solid pane, or crosses a sheet, keeps the share τ(θ) of the slab law (see
`patchlight.solver.glass`); leaving a solid costs nothing more. The factor of a pair keeps the mean
of that over the element, weighted as the form factor is and over its visible points only: beside a
window there is a wall.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .bvh import STACK, trace_ray
from .compiled import lean, parallel
from .ray_nets import WORK as WORK_SIZE
from .ray_patch import MISS
from .webs import _surface

#: Panes that one line may cross.
MOST_CROSSED = 64
#: Columns of `Panes.laws`: index, absorption times thickness, share let straight through, and where
#: its table begins and ends.
INDEX, DEPTH, STRAIGHT, FIRST, LAST = range(5)
#: Points on each element: 2 x 2 on the whole, then 2 x 2 on each quarter.
WHOLE, SAMPLES = 4, 20
#: Sums over points: of transmittance and of weight, of all points and of visible ones.
ALL_LIGHT, ALL, LIGHT, VIEW = range(4)
#: Share of a line at both of its ends on which nothing is met: it begins and ends on surfaces.
_ENDS = 1e-7
_GAUSS = 0.5 - 0.5 / math.sqrt(3.0)


class Panes(NamedTuple):
    """See-through patches; row p of ``nets`` … ``law`` is the same patch.

    Attributes
    ----------
    bounds, links, piece_patch, piece_box, nets, kinds
        Tree over them, as `RayCaster.arrays`.
    solid : (p,) bool array
        Whether it bounds a solid.
    law : (p,) int array
        Row of ``laws``.
    laws : (g, 5) array
        Columns `INDEX` … `LAST`.
    angles, values : (k,) array
        Tables of transmittance, one after the other. [rad]
    """

    bounds: np.ndarray
    links: np.ndarray
    piece_patch: np.ndarray
    piece_box: np.ndarray
    nets: np.ndarray
    kinds: np.ndarray
    solid: np.ndarray
    law: np.ndarray
    laws: np.ndarray
    angles: np.ndarray
    values: np.ndarray


@lean
def transmittance(panes, law, c):
    """Share of light that goes straight through at cosine of incidence ``c``."""
    n, depth, straight = panes.laws[law, INDEX], panes.laws[law, DEPTH], panes.laws[law, STRAIGHT]
    first, last = int(panes.laws[law, FIRST]), int(panes.laws[law, LAST])
    c = min(c, 1.0)
    if last > first:
        angle = math.acos(c)
        k = first
        while k < last - 2 and panes.angles[k + 1] <= angle:
            k += 1
        t = (angle - panes.angles[k]) / (panes.angles[k + 1] - panes.angles[k])
        return straight * (panes.values[k] + min(t, 1.0) * (panes.values[k + 1] - panes.values[k]))
    inside = math.sqrt((n * n - 1.0) + c * c) / n
    if inside == 0.0:
        return 0.0 if depth > 0.0 else straight
    left = math.exp(-depth / inside)
    total = 0.0
    for polarisation in range(2):
        a = c if polarisation == 0 else n * c
        b = n * inside if polarisation == 0 else inside
        lost = 4.0 * a * b / ((a + b) * (a + b))
        rest = (1.0 - left) + lost * left
        rest *= 1.0 + (1.0 - lost) * left
        if rest > 0.0:
            total += 0.5 * lost * lost * left / rest
    return straight * total


@lean
def through(panes, x, y, z, dx, dy, dz, t_min, t_max, stack, work, scratch, point, area):
    """Share left of the light along a line, and the first pane it meets, −1 for none.

    ``stack (STACK,) int64``, ``work (WORK,)``, ``scratch (7, 4)``, ``point (3,)`` and ``area (3,)``
    are scratch.
    """
    share, first = 1.0, -1
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    for _ in range(MOST_CROSSED):
        # Not literals: those would compile the callee once more.
        both, find_any = first * 0, length < 0.0
        status, p, t, u, v, facing = trace_ray(
            panes.bounds, panes.links, panes.piece_patch, panes.piece_box, panes.nets, panes.kinds,
            x, y, z, dx, dy, dz, t_min, t_max, both, find_any, stack, work,
        )  # fmt: skip
        if status == MISS:
            break
        # Patches side by side are met at the same place: one crossing.
        t_min = t + 1e-9 * max(abs(t), 1e-3)
        if panes.solid[p] and facing <= 0:
            continue
        _surface(panes.nets[p], u, v, length / length, scratch, point, area)
        size = math.sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2]) * length
        cosine = abs(area[0] * dx + area[1] * dy + area[2] * dz)
        share *= transmittance(panes, panes.law[p], cosine / size if size > 0.0 else 1.0)
        if first < 0:
            first = p
    return share, first


@parallel
def shares_along(panes, origins, directions, t_min, t_max, out, first):
    """What is left (m,) of light along lines (m, 3), and the first pane (m,) each meets."""
    count = origins.shape[0]
    groups = (count + 255) // 256
    for group in nb.prange(groups):
        stack, work = np.empty(STACK, dtype=np.int64), np.empty(WORK_SIZE)
        scratch, point, area = np.empty((7, 4)), np.empty(3), np.empty(3)
        for r in range(group * 256, min(count, group * 256 + 256)):
            out[r], first[r] = through(
                panes, origins[r, 0], origins[r, 1], origins[r, 2], directions[r, 0],
                directions[r, 1], directions[r, 2], t_min, t_max[r], stack, work, scratch, point,
                area,
            )  # fmt: skip


@lean
def _sample(panes, tree, x, n, at, facing, stack, work, scratch, point, area, found):
    """Add the line to a point ``at`` of an element, its area vector being ``facing``."""
    a, b, c = at[0] - x[0], at[1] - x[1], at[2] - x[2]
    here = a * n[0] + b * n[1] + c * n[2]
    there = -(a * facing[0] + b * facing[1] + c * facing[2])
    if here <= 0.0 or there <= 0.0:
        return
    square = a * a + b * b + c * c
    view = here * there / (square * square)
    share, _ = through(
        panes, x[0], x[1], x[2], a, b, c, _ENDS * view / view, 1.0 - _ENDS, stack, work, scratch,
        point, area,
    )  # fmt: skip
    found[ALL_LIGHT] += share * view
    found[ALL] += view
    both, find_any = stack.shape[0] * 0, square >= 0.0
    status, _, _, _, _, _ = trace_ray(
        tree.bounds, tree.links, tree.piece_patch, tree.piece_box, tree.nets, tree.kinds,
        x[0], x[1], x[2], a, b, c, _ENDS * view / view, 1.0 - 10.0 * _ENDS, both, find_any, stack,
        work,
    )  # fmt: skip
    if status == MISS:
        found[LIGHT] += share * view
        found[VIEW] += view


@lean
def _quarter(
    panes, tree, x, n, net, u, v, size, stack, work, scratch, point, area, at, facing, found
):
    """What the square of parameters at (u, v) gives, by 2 x 2 Gauss points."""
    for k in range(4):
        found[k] = 0.0
    for i in range(2):
        for j in range(2):
            a = u + size * (_GAUSS if i == 0 else 1.0 - _GAUSS)
            b = v + size * (_GAUSS if j == 0 else 1.0 - _GAUSS)
            _surface(net, a, b, 0.25 * size * size, scratch, at, facing)
            _sample(panes, tree, x, n, at, facing, stack, work, scratch, point, area, found)


@lean
def _mean_share(
    panes, tree, x, n, net, points, areas, wanted, levels, cells, parts, stack, work, scratch,
    point, area, at, facing, found,
):  # fmt: skip
    """Fill ``found (4,)`` with the sums over an element seen from one node.

    Cells are quartered until that changes their share of the mean by no more than ``wanted``.
    """
    whole = parts[4]
    for k in range(4):
        found[k] = whole[k] = 0.0
    for s in range(WHOLE):
        _sample(panes, tree, x, n, points[s], areas[s], stack, work, scratch, point, area, whole)
    total = 0.0
    for k in range(4):
        for c in range(4):
            parts[k, c] = 0.0
        for s in range(WHOLE + 4 * k, WHOLE + 4 * k + 4):
            _sample(
                panes, tree, x, n, points[s], areas[s], stack, work, scratch, point, area, parts[k]
            )
        total += parts[k, ALL]
    if total == 0.0:
        return
    light = parts[0, LIGHT] + parts[1, LIGHT] + parts[2, LIGHT] + parts[3, LIGHT]
    view = parts[0, VIEW] + parts[1, VIEW] + parts[2, VIEW] + parts[3, VIEW]
    mean = light / view if view > 0.0 else 1.0
    change = light - whole[LIGHT] - mean * (view - whole[VIEW])
    if abs(change) <= wanted * total:
        for k in range(4):
            for c in range(4):
                found[c] += parts[k, c]
        return
    top = 0
    for k in range(4):
        cells[top, 0], cells[top, 1], cells[top, 2] = 0.5 * (k // 2), 0.5 * (k % 2), 1.0
        cells[top, 3], cells[top, 4] = parts[k, LIGHT], parts[k, VIEW]
        cells[top, 5], cells[top, 6] = parts[k, ALL_LIGHT], parts[k, ALL]
        top += 1
    while top > 0:
        top -= 1
        u, v, level = cells[top, 0], cells[top, 1], cells[top, 2]
        half = 0.5 ** (level + 1.0)
        was_light, was_view = cells[top, 3], cells[top, 4]
        now_light = now_view = 0.0
        for k in range(4):
            _quarter(
                panes, tree, x, n, net, u + half * (k // 2), v + half * (k % 2), half, stack, work,
                scratch, point, area, at, facing, parts[k],
            )  # fmt: skip
            now_light += parts[k, LIGHT]
            now_view += parts[k, VIEW]
        change = now_light - was_light - mean * (now_view - was_view)
        if abs(change) <= wanted * total or level + 1.0 >= levels:
            for k in range(4):
                for c in range(4):
                    found[c] += parts[k, c]
            continue
        for k in range(4):
            cells[top, 0], cells[top, 1] = u + half * (k // 2), v + half * (k % 2)
            cells[top, 2] = level + 1.0
            cells[top, 3], cells[top, 4] = parts[k, LIGHT], parts[k, VIEW]
            top += 1


@lean
def _may_cross(low, high, near, far, boxes, planes, heights, j, below, above):
    """Whether a line from the box ``low``, ``high`` to element ``j`` may cross a pane."""
    for p in range(boxes.shape[0]):
        apart = False
        for k in range(3):
            if max(high[k], far[j, k]) < boxes[p, k] or min(low[k], near[j, k]) > boxes[p, k + 3]:
                apart = True
                break
        if apart:
            continue
        if planes[p, 3] > 0.0:  # flat, and this is its thickness of rounding
            if below[p] >= -planes[p, 3] and heights[p, j, 0] >= -planes[p, 3]:
                continue
            if above[p] <= planes[p, 3] and heights[p, j, 1] <= planes[p, 3]:
                continue
        return True
    return False


@parallel
def pane_rows(
    nodes, normals, weights, panes, tree, boxes, planes, origins, near, far, heights, nets, points,
    areas, tolerance, levels, chunks, factors, variances, counters,
):  # fmt: skip
    """Take from form factors (m, c n) of n elements what panes keep back, in place.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node.
    panes, tree : Panes, paths.Tree
        What is crossed, and what hides.
    boxes, planes, origins : (p, 6), (p, 4), (p, 3) array
        Box of each pane patch; unit normal of flat ones and the distance that counts as none, which
        is 0 for others; a point of it.
    near, far, heights : (n, 3), (n, 3), (p, n, 2) array
        Corners of the elements' boxes, least and greatest height over each plane.
    nets, points, areas : (n, 4, 4, 4), (n, SAMPLES, 3) arrays
        Elements, points on them and area vectors.
    tolerance : float
        Change of a form factor that does not matter.
    levels : int
        How often an element is quartered at most.
    chunks : int
        How many threads to spread the receivers over.
    counters : (m,) int array
        Receives the number of pairs that were looked at.
    """
    count, n = nodes.shape[0], nets.shape[0]
    columns = factors.shape[1] // n
    size = (count + chunks - 1) // chunks
    for chunk in nb.prange(chunks):
        stack, work = np.empty(STACK, dtype=np.int64), np.empty(WORK_SIZE)
        scratch, point, area = np.empty((7, 4)), np.empty(3), np.empty(3)
        at, facing, found, parts = np.empty(3), np.empty(3), np.empty(4), np.empty((5, 4))
        cells = np.empty((3 * levels + 8, 7))
        low, high = np.empty(3), np.empty(3)
        below, above = np.empty(planes.shape[0]), np.empty(planes.shape[0])
        for i in range(chunk * size, min(count, (chunk + 1) * size)):
            for k in range(3):
                low[k], high[k] = math.inf, -math.inf
                for q in range(nodes.shape[1]):
                    low[k] = min(low[k], nodes[i, q, k])
                    high[k] = max(high[k], nodes[i, q, k])
            for p in range(planes.shape[0]):
                below[p], above[p] = math.inf, -math.inf
                for q in range(nodes.shape[1]):
                    h = 0.0
                    for k in range(3):
                        h += planes[p, k] * (nodes[i, q, k] - origins[p, k])
                    below[p], above[p] = min(below[p], h), max(above[p], h)
            for j in range(n):
                value = 0.0
                for c in range(j * columns, (j + 1) * columns):
                    value += factors[i, c]
                if value <= 0.0:
                    continue
                if not _may_cross(low, high, near, far, boxes, planes, heights, j, below, above):
                    continue
                counters[i] += 1
                wanted = min(tolerance / value, 1.0)
                light = view = all_light = whole = 0.0
                for q in range(nodes.shape[1]):
                    if weights[i, q] == 0.0:
                        continue
                    _mean_share(
                        panes, tree, nodes[i, q], normals[i, q], nets[j], points[j], areas[j],
                        wanted, levels, cells, parts, stack, work, scratch, point, area, at,
                        facing, found,
                    )  # fmt: skip
                    light += weights[i, q] * found[LIGHT]
                    view += weights[i, q] * found[VIEW]
                    all_light += weights[i, q] * found[ALL_LIGHT]
                    whole += weights[i, q] * found[ALL]
                share = light / view if view > 0.0 else (all_light / whole if whole > 0.0 else 1.0)
                for c in range(j * columns, (j + 1) * columns):
                    factors[i, c] *= share
                    variances[i, c] *= share * share
