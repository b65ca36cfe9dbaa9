"""Bracket of one cell of a source: unlit, lit, dark, or cut by a wedge (see `brackets`)."""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import is_great_circle
from .nets import PLANAR, heights
from .pieces import FRONT, MIXED, angular_size, casts_shadow_edge, quarter
from .pyramid import edge_outside, make_pyramid, outside_pyramid
from .sure_contour import SAGITTA, SLACK, pyramid_factor, sure_factor
from .wedges import (
    HIGH,
    LOW,
    SPLIT,
    add_point,
    clip,
    cut_cell,
    farthest,
    make_frame,
    point_of,
    ray,
)

_TOUCH = 1e-11
#: A cell longer than this against its width is halved along its length: two shadow edges that cross
#: it would have it halved into ever thinner strips.
_STRETCH = 4.0
#: What is known of cells too wide for a pyramid: nothing; their contour up to a whole turn about
#: the receiver; their contour.
NOTHING, TURNS, ALL = range(3)


@lean
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


@lean
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


@lean
def _lengths(s, out):
    """Lengths of the cell along u and along v."""
    out[0] = out[1] = 0.0
    for i in range(4):
        for k in range(3):
            out[0] += abs(s[3, i, k] / s[3, i, 3] - s[0, i, k] / s[0, i, 3])
            out[1] += abs(s[i, 3, k] / s[i, 3, 3] - s[i, 0, k] / s[i, 0, 3])


@lean
def _cell_normal(s, normal):
    """Normal of the cell, from its corners, on whose far side the receiver is not.

    ``normal`` keeps what it is where the cell has none.
    """
    ax, ay, az = normal[0], normal[1], normal[2]
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        normal[k] = (s[3, 3, a] / s[3, 3, 3] - s[0, 0, a] / s[0, 0, 3]) * (
            s[0, 3, b] / s[0, 3, 3] - s[3, 0, b] / s[3, 0, 3]
        ) - (s[3, 3, b] / s[3, 3, 3] - s[0, 0, b] / s[0, 0, 3]) * (
            s[0, 3, a] / s[0, 3, 3] - s[3, 0, a] / s[3, 0, 3]
        )
    size = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    middle = 0.0
    for k in range(3):
        middle += normal[k] * (s[0, 0, k] / s[0, 0, 3] + s[3, 3, k] / s[3, 3, 3])
    if size > 0.0:
        size = size if middle >= 0.0 else -size
        for k in range(3):
            normal[k] /= size
    else:
        normal[0], normal[1], normal[2] = ax, ay, az


@lean
def _cone_factor(s, axis):
    """Largest form factor of a cone about ``axis`` that holds all control points: sin² of it."""
    most = 0.0
    for i in range(4):
        for j in range(4):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            cx, cy, cz = (
                y * axis[2] - z * axis[1],
                z * axis[0] - x * axis[2],
                x * axis[1] - y * axis[0],
            )
            most = max(most, (cx * cx + cy * cy + cz * cz) / (x * x + y * y + z * z))
    return most + 4e-16


@lean
def _depths(s, axis, reach, place):
    """Least and largest depth of the control points along ``axis`` into two places of ``reach``."""
    least, most = 1e300, -1e300
    for i in range(4):
        for j in range(4):
            d = 0.0
            for k in range(3):
                d += axis[k] * s[i, j, k]
            d /= s[i, j, 3]
            least, most = min(least, d), max(most, d)
    reach[place], reach[place + 1] = least, most


@kernel
def _wide_cell(
    s, normal, reach, surfaces, pieces, parent, parent_count, mine, known, total, error, found
):
    """Bracket of a cell without a pyramid: lit if every blocker lies beyond it, or unknown."""
    size = 0.0
    for i in range(4):
        for j in range(4):
            for k in range(3):
                size = max(size, abs(s[i, j, k] / s[i, j, 3]))
    tolerance = 1e-11 * size
    depths = np.empty(2)
    count = parent_count * 0  # not a literal: it would compile the callers once more
    for m in range(parent_count):
        i = parent[m]
        _depths(pieces.nets[i], normal, depths, 0)
        # The receiver is at depth 0: a plane beyond the cell has to be beyond the receiver too.
        if depths[0] >= max(reach[3], 0.0) - tolerance:
            continue
        if surfaces.flags[pieces.patch[i]] & PLANAR and _one_side_of(s, pieces.nets[i], tolerance):
            continue
        mine[count] = i
        count += 1
    found[HIGH] = min(1.0, total + error)
    if count == 0 and known:
        found[LOW] = max(0.0, total - error)
    return count


@kernel
def look(
    s, facing, wide, noise, own_sheet, x, n, rounding, surfaces, pieces, parent, parent_count, mine,
    stamp, stamps, dirty, space, points, work, found,
):  # fmt: skip
    """Bracket of one cell into ``found``; leaves the list of what may hide it in ``mine``.

    Returns the length of the list. ``wide`` is what is known of cells without a pyramid,
    ``noise`` the rounding of control points.
    """
    planes, normal, frame = space[0:8], space[9], space[10:13]
    tri, cut, value = space[13:16], space[16], space[18]
    poly, other = space[20:36], space[36:52]
    _lengths(s, value)
    longer = 0.0 if value[0] >= value[1] else 1.0
    stretched = max(value[0], value[1]) > _STRETCH * min(value[0], value[1])
    found[LOW], found[HIGH], found[SPLIT] = 0.0, 0.0, longer
    low, inner, high = heights(s, n)
    if high <= rounding:
        return 0
    ok = make_pyramid(s, planes)
    total, error = 1.0, 0.0
    known = facing == FRONT and (ok or wide != NOTHING)
    if known:
        sure_factor(s, n, n, rounding, noise, value)
        share, error = value[0], value[1]
        if not ok and wide == TURNS:
            # The horizon may be closed the long way round, and a patch about the receiver has a
            # whole horizon besides: shares that differ by a whole are one contour.
            share -= math.floor(share)
            known = error < share < 1.0 - error
        total, error = (min(max(share, 0.0), 1.0), error) if known else (1.0, 0.0)
    if ok:
        # Sides of a tiny strip are lost in rounding: then a cone holds it more tightly.
        bound = min(pyramid_factor(planes, n, poly, other), _cone_factor(s, planes[4]))
        if facing != FRONT or bound < total:
            total = min(bound, total)
    if parent_count == 0:
        found[HIGH] = min(1.0, total + error)
        if known:
            found[LOW] = max(0.0, total - error)
        return 0
    # Depths of the cell along the axis and along its own normal, away from the receiver.
    reach = np.empty(4)
    for k in range(3):
        normal[k] = planes[4, k] if ok else n[k]
    _cell_normal(s, normal)
    if ok:
        _depths(s, planes[4], reach, 0)
    _depths(s, normal, reach, 2)
    if not ok:
        return _wide_cell(
            s, normal, reach, surfaces, pieces, parent, parent_count, mine, known, total, error,
            found,
        )  # fmt: skip
    tolerance = 1e-11 * reach[1]
    cell_size = angular_size(s)
    c, p, q = np.empty((4, 3)), np.empty(3), np.empty(3)
    stack = np.empty(256, dtype=np.int64)
    make_frame(planes, frame)
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
                        if not clip(planes, p, q):
                            continue
                        spots = add_point(p, frame, points, spots, 1.0)
                        spots = add_point(q, frame, points, spots, 0.0)
                    else:
                        bent = True
                        for k in range(4):
                            first = 1.0 if k == 0 else 0.0
                            spots = add_point(c[k], frame, points, spots, first)
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
                    spots = add_point(pieces.nets[i, k // 4, k % 4], frame, points, spots, first)
            if bad:
                dirty[surfaces.sheet[b]] = stamp
            mine[count] = i
            count += 1
    found[HIGH] = min(1.0, total + error)
    if count > 0:
        # Sheets without an edge here cover the cell or leave it free.
        h, hu, hv = tri[0], tri[1], tri[2]
        rise = farthest(s, n, h, hu, hv)
        if rise > 1e-9:
            point_of(s, 0.5, 0.5, h, hu, hv)
            size = math.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
            if n[0] * h[0] + n[1] * h[1] + n[2] * h[2] <= 1e-9 * size:
                farthest(s, n, h, hu, hv)
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
                        stamps[sheet, 1] = ray(surfaces, pieces, mine, count, sheet, x, h, work)
                    if stamps[sheet, 1] > 0:
                        found[HIGH] = 0.0
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
            found[LOW] = max(0.0, total - error)
        return 0
    if facing == FRONT and spots > 0 and low >= -rounding:
        cut_cell(
            s, n, noise, x, frame, points, spots, surfaces, pieces, mine, count, total, error,
            found, cut, tri, work, value,
        )  # fmt: skip
        if stretched:
            found[SPLIT] = longer
    return count
