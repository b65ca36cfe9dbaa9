"""What is left of a cell beside the wedges that hold all shadow edges in its pyramid.

A wedge lies between two planes through the receiver, along the shadow edges. What is left of the
cell before the first, between two, and beyond the last wedge is lit or dark throughout: one ray
tells.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .nets import surface, weight_at
from .ray_patch import HIT, MISS, ray_patch_any
from .sure_contour import sure_factor

#: Points that may define wedges, and wedges.
POINTS, SPANS = 1024, 64
#: What is found of a cell: bracket, and direction to split in.
LOW, HIGH, SPLIT = range(3)


@lean
def ray(surfaces, pieces, mine, count, sheet, x, h, work):
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


@lean
def point_of(s, u, v, h, hu, hv):
    """Euclidean point of the cell at (u, v) into ``h``."""
    surface(s, u, v, h, hu, hv)
    w = weight_at(s, u, v)
    for k in range(3):
        h[k] /= w


@lean
def farthest(s, m, h, hu, hv):
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
    point_of(s, bu, bv, h, hu, hv)
    return best


@lean
def clip(planes, p, q):
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


@lean
def add_point(v, frame, points, count, first):
    """Project one vector; −1 where that cannot be done."""
    if count < 0 or count >= POINTS:
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


@lean
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


@kernel
def make_frame(planes, frame):
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


@lean
def _spans(points, count, ax, ay, slack, spans):
    """Ranges (k, 2) across the direction in which the shadow edges lie, apart and in order.

    Returns their number. When there are too many, the last gap is given up.
    """
    number = start = 0
    for k in range(1, count + 1):
        if k < count and points[k, 2] == 0.0:
            continue
        least, most = 1e300, -1e300
        for m in range(start, k):
            c = ax * points[m, 0] + ay * points[m, 1]
            least, most = min(least, c - slack), max(most, c + slack)
        start = k
        i = 0
        while i < number and spans[i, 1] < least:
            i += 1
        j = i
        while j < number and spans[j, 0] <= most:
            j += 1
        if i == j and number == SPANS:
            i, j = min(i, number - 1), min(i, number - 1) + 1
        if i == j:
            for m in range(number, i, -1):
                spans[m, 0], spans[m, 1] = spans[m - 1, 0], spans[m - 1, 1]
            number += 1
        else:
            least, most = min(least, spans[i, 0]), max(most, spans[j - 1, 1])
            for m in range(j, number):
                spans[i + 1 + m - j, 0], spans[i + 1 + m - j, 1] = spans[m, 0], spans[m, 1]
            number -= j - i - 1
        spans[i, 0], spans[i, 1] = least, most
    return number


@lean
def _across(s, frame, ax, ay, u, v, tri):
    """Coordinate across the direction of the cell's point at (u, v), which is left in tri[0]."""
    h = tri[0]
    point_of(s, u, v, h, tri[1], tri[2])
    depth = c = 0.0
    for k in range(3):
        depth += frame[0, k] * h[k]
        c += (ax * frame[1, k] + ay * frame[2, k]) * h[k]
    return c / depth


@lean
def _sample(s, frame, ax, ay, a, b, ends, tri):
    """Point of the cell well between two planes into tri[0]; whether there is one.

    ``ends`` (2, 3): coordinate, u and v of the outermost points of the cell.
    """
    low, high = max(a, ends[0, 0]), min(b, ends[1, 0])
    if high - low <= 1e-9 * (ends[1, 0] - ends[0, 0]):
        return False
    goal = 0.5 * (low + high)
    t0, t1 = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (t0 + t1)
        u = ends[0, 1] + t * (ends[1, 1] - ends[0, 1])
        v = ends[0, 2] + t * (ends[1, 2] - ends[0, 2])
        c = _across(s, frame, ax, ay, u, v, tri)
        if abs(c - goal) <= 0.1 * (high - low):
            return True
        if c < goal:
            t0 = t
        else:
            t1 = t
    return False


@lean
def _share_beyond(s, n, noise, frame, ax, ay, c, m, value):
    """Factor of the part of the cell beyond coordinate ``c``, and its error, into ``value``."""
    size = 0.0
    for k in range(3):
        m[k] = ax * frame[1, k] + ay * frame[2, k] - c * frame[0, k]
        size += m[k] ** 2
    size = math.sqrt(size)
    for k in range(3):
        m[k] /= size
    sure_factor(s, m, n, 0.0, noise, value)


@kernel
def cut_cell(
    s, n, noise, x, frame, points, count, surfaces, pieces, mine, listed, total, error, found, m,
    tri, work, value,
):  # fmt: skip
    """Bracket of a front-facing cell whose shadow edges are at ``points`` (count, 3).

    ``total``, ``error``: factor of the whole cell.
    """
    angles, ends = np.empty(3), np.empty((2, 3))
    spans, other = np.empty((SPANS, 2)), np.empty((SPANS, 2))
    _directions(points, count, angles)
    reach = 1.0
    for k in range(count):
        reach = max(reach, abs(points[k, 0]) + abs(points[k, 1]))
    best = 1e300
    number = 0
    every = listed * 0 - 1  # not a literal: it would compile the callee once more
    nx = ny = begin = end = 0.0
    for choice in range(2):
        ax, ay = -math.sin(angles[choice]), math.cos(angles[choice])
        # Which parameter runs across the wedges.
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
        found_spans = _spans(points, count, ax, ay, 1e-14 * reach, other)
        unknown = 0.0
        for k in range(found_spans):
            unknown += max(0.0, min(other[k, 1], last) - max(other[k, 0], first))
        unknown /= last - first
        if unknown < best:
            best, number = unknown, found_spans
            nx, ny, begin, end = ax, ay, first, last
            for k in range(number):
                spans[k, 0], spans[k, 1] = other[k, 0], other[k, 1]
            if unknown < 0.9 or (choice == 0 and angles[2] > 0.8):
                found[SPLIT] = 0.0 if abs(du) >= abs(dv) else 1.0
    if best >= 0.95:
        return
    ends[0, 0], ends[1, 0] = 1e300, -1e300
    for i in range(5):
        for j in range(5):
            u, v = 0.002 + 0.249 * i, 0.002 + 0.249 * j
            c = _across(s, frame, nx, ny, u, v, tri)
            if c < ends[0, 0]:
                ends[0, 0], ends[0, 1], ends[0, 2] = c, u, v
            if c > ends[1, 0]:
                ends[1, 0], ends[1, 1], ends[1, 2] = c, u, v
    lit = dark = 0.0
    for k in range(number + 1):
        a = begin if k == 0 else max(begin, spans[k - 1, 1])
        b = end if k == number else min(end, spans[k, 0])
        if a >= b or not _sample(s, frame, nx, ny, a, b, ends, tri):
            continue
        status = ray(surfaces, pieces, mine, listed, every, x, tri[0], work)
        if status < 0:
            continue
        share = total - error
        if a > begin:
            _share_beyond(s, n, noise, frame, nx, ny, a, m, value)
            share = value[0] - value[1]
        if b < end:
            _share_beyond(s, n, noise, frame, nx, ny, b, m, value)
            share -= value[0] + value[1]
        if status == 0:
            lit += max(0.0, share)
        else:
            dark += max(0.0, share)
    found[LOW] = min(lit, total + error)
    found[HIGH] = max(found[LOW], min(1.0, total + error - dark))
