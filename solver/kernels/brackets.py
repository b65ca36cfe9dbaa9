"""Proved brackets of form factors past blockers.

A source patch is halved again and again in (u, v). Of each cell, seen through its pyramid, it is
proved that it is

* unlit: below the horizon, or seen from behind throughout;
* lit: every blocker is parted from the hull of cell and receiver by a plane;
* dark: the pieces of one connected sheet in front of the cell have neither a silhouette nor a
  shadow edge in the pyramid, so that every ray to the cell crosses the sheet equally often, and
  one ray crosses it;
* or cut: all silhouettes, shadow edges and pieces not proved to be in front lie in a wedge between
  two planes through the receiver. What is left of the cell on either side of the wedge is lit or
  dark throughout, and one ray tells which. Only what lies in the wedge is not known.

What is not known counts as [0, F]. A straight shadow edge leaves an empty wedge, a curved one a
wedge whose width falls with the square of the cell. The bracket of the patch is the sum of those of
its cells: blockers join as a set, nothing is multiplied. Cells are taken in the order of the powers
of two of their unknown part, the same for every accuracy, so that brackets are nested.

Two things are taken for granted: patches that share an edge do not cross each other besides, and a
patch flagged convex or concave by `topology.shape_flags` does not hide its own front.
"""

import math

import numba as nb
import numpy as np

from .contour import horizon_tolerance, is_great_circle, shift_net
from .nets import CONCAVE, CONVEX, PLANAR, heights, surface, weight_at
from .pieces import (
    BACK,
    FRONT,
    MIXED,
    NONE,
    angular_size,
    casts_shadow_edge,
    make_pieces,
    quarter,
    see_surfaces,
    see_tangents,
)
from .pyramid import edge_outside, make_pyramid, outside_pyramid
from .ray_patch import HIT, MISS, WORK, ray_patch_any
from .sure_contour import SAGITTA, SLACK, pyramid_factor, sure_factor

#: Cells that one pair may wait with, numbers in their lists, pieces of one receiver.
CELLS, LISTED, PIECES = 200000, 4000000, 30000
#: Points that may define a wedge.
_POINTS = 1024
_BUCKETS = 128
#: Columns of the counters.
SKIPPED, WHOLE, TRACED, VISITED, LEFT = range(5)
_TOUCH = 1e-11
#: A cell longer than this against its width is halved along its length: two shadow edges that cross
#: it would have it halved into ever thinner strips.
_STRETCH = 4.0
#: How a receiver on a hollow or bulging patch looks: off the patch, where that is all below its
#: horizon; square to it towards the rest of it; or neither.
AWAY, ALONG, ASKEW = 1, 2, 3
#: What is known of cells too wide for a pyramid: nothing; their contour up to a whole turn about
#: the receiver; their contour.
_NOTHING, _TURNS, _ALL = range(3)
#: What `_look` leaves in its ``found``: bracket, and direction to split in.
_LOW, _HIGH, _SPLIT = range(3)


@nb.njit(cache=True, error_model="numpy")
def _restrict(g, a, b, along_u, work):
    """Coefficients of ``g`` (d, d) on [a, b] of one parameter, in place."""
    d = g.shape[0]
    for m in range(d):
        for k in range(d):
            work[k] = g[k, m] if along_u else g[m, k]
        for step in range(1, d):
            for k in range(d - 1, step - 1, -1):
                work[k] = (1.0 - b) * work[k - 1] + b * work[k]
        t = a / b if b > 0.0 else 0.0
        for step in range(1, d):
            for k in range(d - step):
                work[k] = (1.0 - t) * work[k] + t * work[k + 1]
        for k in range(d):
            if along_u:
                g[k, m] = work[k]
            else:
                g[m, k] = work[k]


@nb.njit(cache=True, error_model="numpy")
def _order(s, planes, normal, depths, tolerance):
    """1 when piece ``s`` lies beyond the cell, −1 strictly in front of it, 0 when neither is sure.

    ``depths``: least and largest depth of the cell along the axis and along ``normal``.
    """
    near, far, low, high = 1e300, -1e300, 1e300, -1e300
    for i in range(4):
        for j in range(4):
            x, y, z, w = s[i, j, 0], s[i, j, 1], s[i, j, 2], s[i, j, 3]
            a = (planes[4, 0] * x + planes[4, 1] * y + planes[4, 2] * z) / w
            near, far = min(near, a), max(far, a)
            d = (normal[0] * x + normal[1] * y + normal[2] * z) / w
            low, high = min(low, d), max(high, d)
    if near >= depths[1] - tolerance:
        return 1
    # The receiver is at depth 0: a plane beyond the cell has to be beyond the receiver too.
    if low >= max(depths[3], 0.0) - tolerance:
        return 1
    if far < depths[0] - tolerance or high < depths[2] - tolerance and depths[2] > 0.0:
        return -1
    return 0


@nb.njit(cache=True, error_model="numpy")
def _one_side_of(s, plane, tolerance):
    """Whether receiver and cell lie on one side of a flat piece ``plane``, or in it."""
    ax, ay, az = 0.0, 0.0, 0.0
    w0 = plane[0, 0, 3]
    px, py, pz = plane[0, 0, 0] / w0, plane[0, 0, 1] / w0, plane[0, 0, 2] / w0
    # Diagonals span the plane also where one side is collapsed.
    d1x = plane[3, 3, 0] / plane[3, 3, 3] - px
    d1y = plane[3, 3, 1] / plane[3, 3, 3] - py
    d1z = plane[3, 3, 2] / plane[3, 3, 3] - pz
    d2x = plane[0, 3, 0] / plane[0, 3, 3] - plane[3, 0, 0] / plane[3, 0, 3]
    d2y = plane[0, 3, 1] / plane[0, 3, 3] - plane[3, 0, 1] / plane[3, 0, 3]
    d2z = plane[0, 3, 2] / plane[0, 3, 3] - plane[3, 0, 2] / plane[3, 0, 3]
    ax, ay, az = d1y * d2z - d1z * d2y, d1z * d2x - d1x * d2z, d1x * d2y - d1y * d2x
    size = math.sqrt(ax * ax + ay * ay + az * az)
    if size == 0.0:
        return False
    ax, ay, az = ax / size, ay / size, az / size
    own = -(ax * px + ay * py + az * pz)
    low = high = own
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            d = (ax * s[i, j, 0] + ay * s[i, j, 1] + az * s[i, j, 2]) / w + own
            low, high = min(low, d), max(high, d)
    return low >= -tolerance or high <= tolerance


@nb.njit(cache=True, error_model="numpy")
def _ray(surfaces, pieces, mine, count, sheet, x, h, work):
    """Whether a listed surface (of one sheet, or −1 for all) lies between ``x`` and x + h."""
    last = -1
    unsure = False
    for m in range(count):
        b = pieces.patch[mine[m]]
        if b == last or (sheet >= 0 and surfaces.sheet[b] != sheet):
            continue
        last = b
        status = ray_patch_any(
            surfaces.nets[b], surfaces.kinds[b], x[0], x[1], x[2], h[0], h[1], h[2], 1e-9,
            1.0 - 1e-7, 0, work,
        )  # fmt: skip
        if status == HIT:
            return 1
        if status != MISS:
            unsure = True
    return -1 if unsure else 0


@nb.njit(cache=True, error_model="numpy")
def _point(s, u, v, h, hu, hv):
    """Euclidean point of the cell at (u, v) into ``h``."""
    surface(s, u, v, h, hu, hv)
    w = weight_at(s, u, v)
    for k in range(3):
        h[k] /= w


@nb.njit(cache=True, error_model="numpy")
def _farthest(s, m, h, hu, hv):
    """Point of 5 x 5 inside the cell with the largest sine over plane ``m``; returns that sine."""
    best, bu, bv = -2.0, 0.5, 0.5
    for i in range(5):
        for j in range(5):
            u, v = 0.04 + 0.23 * i, 0.04 + 0.23 * j
            surface(s, u, v, h, hu, hv)
            size = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
            d = (m[0] * h[0] + m[1] * h[1] + m[2] * h[2]) / max(size, 1e-300)
            if d > best:
                best, bu, bv = d, u, v
    _point(s, bu, bv, h, hu, hv)
    return best


@nb.njit(cache=True, error_model="numpy")
def _lengths(s, out):
    """Lengths of the cell along u and along v."""
    out[0] = out[1] = 0.0
    for i in range(4):
        for k in range(3):
            out[0] += abs(s[3, i, k] / s[3, i, 3] - s[0, i, k] / s[0, i, 3])
            out[1] += abs(s[i, 3, k] / s[i, 3, 3] - s[i, 0, k] / s[i, 0, 3])


@nb.njit(cache=True, error_model="numpy")
def _clip(planes, p, q):
    """Cut the segment from ``p`` to ``q`` to what lies in the pyramid; False where nothing does."""
    t0, t1 = 0.0, 1.0
    for k in range(5):
        mx, my, mz = planes[k, 0], planes[k, 1], planes[k, 2]
        a = mx * p[0] + my * p[1] + mz * p[2]
        b = mx * q[0] + my * q[1] + mz * q[2]
        if a <= 0.0 and b <= 0.0 and (mx != 0.0 or my != 0.0 or mz != 0.0):
            return False
        if a < 0.0:
            t0 = max(t0, a / (a - b))
        elif b < 0.0:
            t1 = min(t1, a / (a - b))
    if t0 >= t1:
        return False
    for k in range(3):
        a, b = p[k], q[k]
        p[k], q[k] = a + t0 * (b - a), a + t1 * (b - a)
    return True


@nb.njit(cache=True, error_model="numpy")
def _add_point(v, frame, points, count, first):
    """Project one vector; −1 where that cannot be done."""
    if count < 0 or count >= _POINTS:
        return -1
    depth = v[0] * frame[0, 0] + v[1] * frame[0, 1] + v[2] * frame[0, 2]
    if depth <= 1e-6 * (abs(v[0]) + abs(v[1]) + abs(v[2])):
        return -1
    for k in range(2):
        points[count, k] = (
            v[0] * frame[k + 1, 0] + v[1] * frame[k + 1, 1] + v[2] * frame[k + 1, 2]
        ) / depth
    points[count, 2] = first
    return count + 1


@nb.njit(cache=True, error_model="numpy")
def _directions(points, count, angles):
    """Two directions in which shadow edges may run: of the edges each, and of all points.

    ``angles`` (3,): both, and how much the edges agree in the first (0 … 1).
    """
    sum_a = sum_b = 0.0
    items = 0
    mx = my = 0.0
    for k in range(count):
        mx, my = mx + points[k, 0] / count, my + points[k, 1] / count
    gxx = gxy = gyy = 0.0
    start = 0
    for k in range(1, count + 1):
        if k < count and points[k, 2] == 0.0:
            continue
        ox = oy = 0.0
        for m in range(start, k):
            ox, oy = ox + points[m, 0] / (k - start), oy + points[m, 1] / (k - start)
        cxx = cxy = cyy = 0.0
        for m in range(start, k):
            dx, dy = points[m, 0] - ox, points[m, 1] - oy
            cxx, cxy, cyy = cxx + dx * dx, cxy + dx * dy, cyy + dy * dy
            dx, dy = points[m, 0] - mx, points[m, 1] - my
            gxx, gxy, gyy = gxx + dx * dx, gxy + dx * dy, gyy + dy * dy
        if cxx + cyy > 0.0:
            sum_a += (cxx - cyy) / (cxx + cyy)
            sum_b += 2.0 * cxy / (cxx + cyy)
        items += 1
        start = k
    angles[0] = 0.5 * math.atan2(sum_b, sum_a)
    angles[1] = 0.5 * math.atan2(2.0 * gxy, gxx - gyy)
    angles[2] = math.hypot(sum_a, sum_b) / items


@nb.njit(cache=True, error_model="numpy")
def _make_frame(planes, frame):
    """Rows: the axis of the pyramid and two vectors square to it."""
    a = planes[4]
    k = 0
    for i in range(1, 3):
        if abs(a[i]) < abs(a[k]):
            k = i
    frame[0] = a
    e = np.zeros(3)
    e[k] = 1.0
    frame[1, 0] = e[1] * a[2] - e[2] * a[1]
    frame[1, 1] = e[2] * a[0] - e[0] * a[2]
    frame[1, 2] = e[0] * a[1] - e[1] * a[0]
    size = math.sqrt(frame[1, 0] ** 2 + frame[1, 1] ** 2 + frame[1, 2] ** 2)
    for i in range(3):
        frame[1, i] /= size
    f = frame[1]
    frame[2, 0] = a[1] * f[2] - a[2] * f[1]
    frame[2, 1] = a[2] * f[0] - a[0] * f[2]
    frame[2, 2] = a[0] * f[1] - a[1] * f[0]


@nb.njit(cache=True, error_model="numpy")
def _cut(
    s, n, x, frame, points, count, surfaces, pieces, mine, listed, total, found, normals, tri, work,
    value,
):  # fmt: skip
    """Bracket of a front-facing cell whose shadow edges are at ``points`` (count, 3)."""
    h, hu, hv = tri[0], tri[1], tri[2]
    angles = np.empty(3)
    _directions(points, count, angles)
    reach = 1.0
    for k in range(count):
        reach = max(reach, abs(points[k, 0]) + abs(points[k, 1]))
    best = 1e300
    every = listed * 0 - 1  # not a literal: it would compile the callee once more
    low = high = nx = ny = 0.0
    for choice in range(2):
        ax, ay = -math.sin(angles[choice]), math.cos(angles[choice])
        least, most = 1e300, -1e300
        for k in range(count):
            c = ax * points[k, 0] + ay * points[k, 1]
            least, most = min(least, c), max(most, c)
        # Which parameter runs across the wedge.
        du = dv = 0.0
        first, last = 1e300, -1e300
        for i in range(4):
            for j in range(4):
                depth = c = 0.0
                for k in range(3):
                    depth += frame[0, k] * s[i, j, k]
                    c += (ax * frame[1, k] + ay * frame[2, k]) * s[i, j, k]
                c /= depth
                first, last = min(first, c), max(last, c)
                if (i == 0 or i == 3) and (j == 0 or j == 3):
                    du += c if i == 3 else -c
                    dv += c if j == 3 else -c
        unknown = (min(most, last) - max(least, first)) / (last - first)
        if unknown < best:
            best = unknown
            slack = 1e-14 * reach
            low, high, nx, ny = least - slack, most + slack, ax, ay
            if unknown < 0.9 or (choice == 0 and angles[2] > 0.8):
                found[_SPLIT] = 0.0 if abs(du) >= abs(dv) else 1.0
    if best >= 0.95:
        return
    known = 0.0
    lit = 0.0
    for part in range(2):
        c = low if part == 0 else high
        sign = -1.0 if part == 0 else 1.0
        size = 0.0
        for k in range(3):
            normals[0, k] = sign * (nx * frame[1, k] + ny * frame[2, k] - c * frame[0, k])
            size += normals[0, k] ** 2
        size = math.sqrt(size)
        for k in range(3):
            normals[0, k] /= size
        if _farthest(s, normals[0], h, hu, hv) <= 1e-12:
            continue
        status = _ray(surfaces, pieces, mine, listed, every, x, h, work)
        if status < 0:
            continue
        sure_factor(s, normals[0], n, 0.0, value)
        share = min(max(value[0], 0.0), total)
        known += share
        if status == 0:
            lit += share
        found[_HIGH] += value[1]
    lit = min(lit, total)
    found[_LOW] = max(lit - (found[_HIGH] - total), 0.0)
    found[_HIGH] += lit + max(0.0, total - known) - total


@nb.njit(cache=True, error_model="numpy")
def _look(
    s, facing, wide, own_sheet, x, n, rounding, surfaces, pieces, parent, parent_count, mine, stamp,
    stamps, dirty, space, points, work, found,
):  # fmt: skip
    """Bracket of one cell into ``found``; leaves the list of what may hide it in ``mine``.

    Returns the length of the list. ``wide`` is what is known of cells without a pyramid.
    """
    planes, normal, frame = space[0:8], space[9], space[10:13]
    tri, normals, value = space[13:16], space[16:18], space[18]
    poly, other = space[20:36], space[36:52]
    _lengths(s, value)
    longer = 0.0 if value[0] >= value[1] else 1.0
    stretched = max(value[0], value[1]) > _STRETCH * min(value[0], value[1])
    found[_LOW], found[_HIGH], found[_SPLIT] = 0.0, 0.0, longer
    low, inner, high = heights(s, n)
    if high <= rounding:
        return 0
    ok = make_pyramid(s, planes)
    total, error = 1.0, 0.0
    known = facing == FRONT and (ok or wide != _NOTHING)
    if known:
        sure_factor(s, n, n, rounding, value)
        share, error = value[0], value[1]
        if not ok and wide == _TURNS:
            # The horizon may be closed the long way round, and a patch about the receiver has a
            # whole horizon besides: shares that differ by a whole are one contour.
            share -= math.floor(share)
            known = error < share < 1.0 - error
        total, error = (min(max(share, 0.0), 1.0), error) if known else (1.0, 0.0)
    if ok:
        bound = pyramid_factor(planes, n, poly, other)
        if facing != FRONT or bound < total:
            total = min(bound, total)
    if parent_count == 0 or not ok:
        found[_HIGH] = min(1.0, total + error)
        if parent_count == 0 and known:
            found[_LOW] = max(0.0, total - error)
        for m in range(parent_count):
            mine[m] = parent[m]
        return parent_count

    # A normal of the cell on the far side of which the receiver is not.
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        normal[k] = (s[3, 3, a] / s[3, 3, 3] - s[0, 0, a] / s[0, 0, 3]) * (
            s[0, 3, b] / s[0, 3, 3] - s[3, 0, b] / s[3, 0, 3]
        ) - (s[3, 3, b] / s[3, 3, 3] - s[0, 0, b] / s[0, 0, 3]) * (
            s[0, 3, a] / s[0, 3, 3] - s[3, 0, a] / s[3, 0, 3]
        )
    size = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    near, far, least, most = 1e300, -1e300, 1e300, -1e300
    sign = 1.0
    if size > 0.0:
        middle = 0.0
        for k in range(3):
            normal[k] /= size
            middle += normal[k] * (s[0, 0, k] / s[0, 0, 3] + s[3, 3, k] / s[3, 3, 3])
        sign = 1.0 if middle >= 0.0 else -1.0
    else:
        for k in range(3):
            normal[k] = planes[4, k]
    for k in range(3):
        normal[k] *= sign
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            a = b = 0.0
            for k in range(3):
                a += planes[4, k] * s[i, j, k] / w
                b += normal[k] * s[i, j, k] / w
            near, far, least, most = min(near, a), max(far, a), min(least, b), max(most, b)
    reach = np.empty(4)
    reach[0], reach[1], reach[2], reach[3] = near, far, least, most
    tolerance = 1e-11 * far
    cell_size = angular_size(s)
    c, p, q = np.empty((4, 3)), np.empty(3), np.empty(3)
    stack = np.empty(256, dtype=np.int64)
    _make_frame(planes, frame)
    count = parent_count * 0  # not a literal: it would compile the callees once more
    spots = count  # points of the wedge; −1 when they cannot tell
    for m in range(parent_count):
        stack[0] = parent[m]
        top = 1
        while top > 0:
            top -= 1
            i = stack[top]
            if outside_pyramid(planes, pieces.nets[i]):
                continue
            b = pieces.patch[i]
            order = _order(pieces.nets[i], planes, normal, reach, tolerance)
            if order > 0:
                continue
            if surfaces.flags[b] & PLANAR and _one_side_of(s, pieces.nets[i], tolerance):
                continue
            own = surfaces.sheet[b] == own_sheet
            whole = pieces.state[i] == MIXED or (order == 0 and not (own and facing == FRONT))
            bad = whole
            bent = whole
            start = spots
            if not whole:
                for side in range(4):
                    casts = casts_shadow_edge(pieces, surfaces, i, side)
                    if casts == 0:
                        continue
                    if edge_outside(planes, n, rounding, pieces.nets[i], side, c, _TOUCH):
                        continue
                    if is_great_circle(c, SAGITTA, SLACK):
                        p[:], q[:] = c[0], c[3]
                        if not _clip(planes, p, q):
                            continue
                        spots = _add_point(p, frame, points, spots, 1.0)
                        spots = _add_point(q, frame, points, spots, 0.0)
                    else:
                        bent = True
                        for k in range(4):
                            first = 1.0 if k == 0 else 0.0
                            spots = _add_point(c[k], frame, points, spots, first)
                    bad = True
                    if casts == 2:
                        bent = True
            if bent and top + 4 <= 256 and angular_size(pieces.nets[i]) > 0.5 * cell_size:
                child = quarter(pieces, surfaces, i)
                if child >= 0:
                    for k in range(4):
                        stack[top + k] = child + k
                    top += 4
                    spots = start
                    continue
            if whole:
                for k in range(16):
                    first = 1.0 if k == 0 else 0.0
                    spots = _add_point(pieces.nets[i, k // 4, k % 4], frame, points, spots, first)
            if bad:
                dirty[surfaces.sheet[b]] = stamp
            mine[count] = i
            count += 1
    found[_HIGH] = min(1.0, total + error)
    if count > 0:
        # Sheets without an edge here cover the cell or leave it free.
        h, hu, hv = tri[0], tri[1], tri[2]
        rise = _farthest(s, n, h, hu, hv)
        if rise > 1e-9:
            _point(s, 0.5, 0.5, h, hu, hv)
            size = math.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
            if n[0] * h[0] + n[1] * h[1] + n[2] * h[2] <= 1e-9 * size:
                _farthest(s, n, h, hu, hv)
            kept = 0
            for m in range(count):
                sheet = surfaces.sheet[pieces.patch[mine[m]]]
                if dirty[sheet] == stamp:
                    continue
                if stamps[sheet, 0] != stamp:
                    stamps[sheet, 0] = stamp
                    if facing != FRONT and sheet == own_sheet:
                        stamps[sheet, 1] = -1
                    else:
                        stamps[sheet, 1] = _ray(surfaces, pieces, mine, count, sheet, x, h, work)
                    if stamps[sheet, 1] > 0:
                        found[_HIGH] = 0.0
                        return 0
            for m in range(count):
                sheet = surfaces.sheet[pieces.patch[mine[m]]]
                if dirty[sheet] != stamp:
                    if stamps[sheet, 1] == 0:
                        continue
                    spots = -1
                mine[kept] = mine[m]
                kept += 1
            count = kept
        else:
            spots = -1
    if count == 0:
        if facing == FRONT:
            found[_LOW] = max(0.0, total - error)
        return 0
    if facing == FRONT and spots > 0 and low >= -rounding:
        _cut(
            s, n, x, frame, points, spots, surfaces, pieces, mine, count, total, found, normals,
            tri, work, value,
        )  # fmt: skip
        if stretched:
            found[_SPLIT] = longer
    return count


@nb.njit(cache=True, error_model="numpy")
def seen_from_itself(flags, view, state):
    """State of a patch for a receiver on it, from its shape ``flags`` and the ``view``.

    A hollow or bulging patch is seen from one side throughout: that it is edge-on at the receiver
    is no silhouette, though the heights have a double root there whose sign no halving tells.
    """
    if flags & PLANAR or view == AWAY:
        return NONE
    if flags & CONCAVE:
        return FRONT
    return BACK if flags & CONVEX else state


@nb.njit(cache=True, error_model="numpy")
def _source_side(g, slack):
    """`FRONT`, `BACK` or `MIXED`; where it is seen edge-on a source gives no light either way."""
    low, high = 1e300, -1e300
    for i in range(9):
        for j in range(9):
            low, high = min(low, g[i, j]), max(high, g[i, j])
    if high <= slack:
        return BACK
    return FRONT if low >= -slack else MIXED


@nb.njit(cache=True, error_model="numpy")
def _bucket(width):
    """Bucket of an unknown part: the smaller, the later."""
    if width <= 0.0:
        return _BUCKETS - 1
    _, exponent = math.frexp(width)
    return min(max(1 - exponent, 0), _BUCKETS - 1)


@nb.njit(cache=True, error_model="numpy")
def bracket_pair(
    net, whole, slack, state, wide, row, goal, x, n, rounding, surfaces, pieces, roots, root_count,
    most, cells, links, arena, mine, stamps, dirty, clock, space, points, work, counters, out,
):  # fmt: skip
    """Bracket of source ``net`` (surface ``row``) into ``out`` (2,), not wider than ``goal``.

    ``whole`` (9, 9) are the heights over its tangent planes, ``slack`` their rounding, ``state``
    the side it is seen from; ``wide`` as in `_look`.
    """
    s, g, line = np.empty((4, 4, 4)), np.empty((9, 9)), np.empty(9)
    found = np.empty(3)
    heads = np.full(_BUCKETS, -1, dtype=np.int64)
    tails = np.full(_BUCKETS, -1, dtype=np.int64)
    own_sheet = surfaces.sheet[row]
    shift_net(net, x, s)
    out[0], out[1] = 0.0, 0.0
    if state == BACK:
        return
    for m in range(root_count):
        arena[m] = roots[m]
    used = root_count
    clock[0] += 1
    count = _look(
        s, state, wide, own_sheet, x, n, rounding, surfaces, pieces, roots, root_count, mine,
        clock[0], stamps, dirty, space, points, work, found,
    )  # fmt: skip
    counters[VISITED] += 1
    sum_low, sum_high = found[_LOW], found[_HIGH]
    best_low, best_high = max(0.0, sum_low), min(1.0, sum_high)
    if count == 0 and state == FRONT and best_high - best_low <= max(goal, 1e-12):
        counters[WHOLE] += 1
    else:
        counters[TRACED] += 1
    made = 0
    if best_high - best_low > 0.0:
        for m in range(count):
            arena[used + m] = mine[m]
        cells[0, 0], cells[0, 1], cells[0, 2], cells[0, 3] = 0.0, 1.0, 0.0, 1.0
        cells[0, 4], cells[0, 5], cells[0, 6] = found[_LOW], found[_HIGH], found[_SPLIT]
        links[0, 0], links[0, 1], links[0, 2] = -1, used, count
        used += count
        k = _bucket(found[_HIGH] - found[_LOW])
        heads[k] = tails[k] = 0
        made = 1
    visits = 0
    bucket = 0
    while best_high - best_low > goal and visits < most:
        while bucket < _BUCKETS and heads[bucket] < 0:
            bucket += 1
        if bucket == _BUCKETS:
            break
        cell = heads[bucket]
        heads[bucket] = links[cell, 0]
        if heads[bucket] < 0:
            tails[bucket] = -1
        split = int(cells[cell, 6])
        a, b = cells[cell, 2 * split], cells[cell, 2 * split + 1]
        mid = 0.5 * (a + b)
        if b - a < 1e-12:
            continue
        sum_low -= cells[cell, 4]
        sum_high -= cells[cell, 5]
        start, length = links[cell, 1], links[cell, 2]
        for half in range(2):
            u0, u1, v0, v1 = cells[cell, 0], cells[cell, 1], cells[cell, 2], cells[cell, 3]
            if split == 0:
                u0, u1 = (a, mid) if half == 0 else (mid, b)
            else:
                v0, v1 = (a, mid) if half == 0 else (mid, b)
            shift_net(net, x, s)
            for k in range(4):
                _restrict(s[:, :, k], u0, u1, True, line)
                _restrict(s[:, :, k], v0, v1, False, line)
            facing = state
            if state == MIXED:
                g[:] = whole
                _restrict(g, u0, u1, True, line)
                _restrict(g, v0, v1, False, line)
                facing = _source_side(g, slack)
            clock[0] += 1
            visits += 1
            counters[VISITED] += 1
            if facing == BACK:
                continue
            count = _look(
                s, facing, wide, own_sheet, x, n, rounding, surfaces, pieces,
                arena[start : start + length], length, mine, clock[0], stamps, dirty, space, points,
                work, found,
            )  # fmt: skip
            sum_low += found[_LOW]
            sum_high += found[_HIGH]
            if found[_HIGH] - found[_LOW] <= 1e-16:
                continue
            if made >= cells.shape[0] or used + count > arena.shape[0]:
                counters[LEFT] += 1
                continue
            for m in range(count):
                arena[used + m] = mine[m]
            cells[made, 0], cells[made, 1], cells[made, 2], cells[made, 3] = u0, u1, v0, v1
            cells[made, 4], cells[made, 5], cells[made, 6] = (
                found[_LOW], found[_HIGH], found[_SPLIT],
            )  # fmt: skip
            links[made, 0], links[made, 1], links[made, 2] = -1, used, count
            used += count
            k = _bucket(found[_HIGH] - found[_LOW])
            if tails[k] >= 0:
                links[tails[k], 0] = made
            else:
                heads[k] = made
            tails[k] = made
            bucket = min(bucket, k)
            made += 1
        # Sums wander by rounding as cells come and go.
        slack = 1e-15 + 1e-16 * math.sqrt(visits)
        best_low = max(best_low, sum_low - slack)
        best_high = min(best_high, sum_high + slack)
    out[0], out[1] = max(best_low, 0.0), max(best_high, 0.0)


@nb.njit(cache=True, error_model="numpy", parallel=True)
def bracket_rows(
    nodes, normals, on, views, nets, flags, place, tangents, centers, goals, surfaces, sheets, hide,
    most, low, high, counters,
):  # fmt: skip
    """Brackets of the form factors from m points to n sources.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals; a receiver with normal 0 gets no light.
    on : (m,) int array
        Surface each receiver lies on, −1 for none.
    views : (m,) int array
        `AWAY`, `ALONG` or `ASKEW` where that is hollow or bulging.
    nets, flags : (n, 4, 4, 4), (n,) array
        Sources, and their shapes from `topology.shape_flags`.
    place : (n,) int array
        Surface each source is.
    tangents, centers : (n, 9, 9, 4), (n, 3) array
        Tangent planes of the sources, as in `pieces.Surfaces`.
    goals : (m, n) array
        Widths at which to stop.
    surfaces : Surfaces
        All that hides light.
    sheets : int
        Number of connected sheets.
    hide : bool
        False ignores all hiding.
    most : int
        Cells that one pair may take.
    low, high : (m, n) array
        Receive the brackets.
    counters : (m, 5) int array
        `SKIPPED` … `LEFT`.
    """
    count = surfaces.nets.shape[0]
    for i in nb.prange(nodes.shape[0]):
        x, n = nodes[i], normals[i]
        if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
            continue
        rounding = horizon_tolerance(x)
        pieces = make_pieces(count, PIECES)
        see_surfaces(surfaces, x, n, rounding, pieces)
        if on[i] >= 0:
            pieces.state[on[i]] = seen_from_itself(
                surfaces.flags[on[i]], views[i], pieces.state[on[i]]
            )
        cells, links = np.empty((CELLS, 7)), np.empty((CELLS, 3), dtype=np.int64)
        arena = np.empty(LISTED, dtype=np.int64)
        stamps = np.zeros((sheets, 2), dtype=np.int64)
        dirty = np.zeros(sheets, dtype=np.int64)
        clock = np.zeros(1, dtype=np.int64)
        space, points, work = np.empty((56, 3)), np.empty((_POINTS, 3)), np.empty(WORK)
        roots, out = np.empty(count, dtype=np.int64), np.empty(2)
        mine = np.empty(count + PIECES, dtype=np.int64)
        whole = np.empty((9, 9))
        for j in range(nets.shape[0]):
            row = place[j]
            if pieces.state[row] == NONE:
                counters[i, SKIPPED] += 1
                continue
            # A bulging patch does not hide its front, nor does a hollow one seen from its front.
            alone = flags[j] & (PLANAR | CONVEX) != 0
            if flags[j] & CONCAVE and pieces.state[row] != MIXED:
                alone = True
            k = count * 0  # not a literal: it would compile the callees once more
            for b in range(count):
                if hide and pieces.state[b] != NONE and not (alone and b == row):
                    roots[k] = b
                    k += 1
            slack = see_tangents(tangents[j], centers[j], x, whole)
            state = _source_side(whole, slack)
            if on[i] == row and flags[j] & (CONVEX | CONCAVE):
                # A surface given from both sides is one: the source may be either side of it.
                state = FRONT if flags[j] & CONCAVE else BACK
            wide = _TURNS if alone and (on[i] != row or views[i] == ALONG) else _NOTHING
            if flags[j] & PLANAR:
                wide = _ALL
            bracket_pair(
                nets[j], whole, slack, state, wide, row, goals[i, j], x, n, rounding, surfaces, pieces, roots, k,
                most, cells, links, arena, mine, stamps, dirty, clock, space, points, work,
                counters[i], out,
            )  # fmt: skip
            low[i, j], high[i, j] = out[0], out[1]
