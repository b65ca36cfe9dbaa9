"""Where two curves cross as the receiver sees them.

A curve is a cubic H(t) of control vectors in a frame whose third axis looks at the scene, so that
(H₁/H₃, H₂/H₃) is its picture. A curve that is a straight line in the picture lies in a plane
through the receiver, which the other meets at the roots of a cubic; two bent ones are halved until
they are nearly straight, and Newton's iteration ends it.
"""

import math

from .compiled import lean
from .contour import cubic, sign_breaks
from .quadric import restrict_cubic

#: Crossings of two curves at most.
MOST = 9
#: Values within this share of their terms are rounding: the curve runs in the plane itself.
_ROUNDING = 1e-13
#: Pieces straighter than this together, against their length, are left to Newton's iteration if the
#: angle between them is more than `_TURN` times as much: a cubic turns from its chord by three
#: times the distance of its control points at most, over its length, and a third is to spare.
_STRAIGHT, _TURN = 0.04, 4.0
#: Pieces of this length that still may cross touch.
_SHORTEST = 1e-7
#: Samples along a curve that a point is looked for on.
_SAMPLES = 16
#: Distance, against their length, within which curves run along each other.
OVERLAP = 1e-9
#: How close to the ends of both they do so there: ends that are 1e-10 off may cross within the
#: square root of that.
_END = 1e-4
_STACK = 64
_VISITS = 2000


@lean
def is_straight(c):
    """Whether a cubic is a straight line in the picture, to rounding."""
    mx = c[0, 1] * c[3, 2] - c[0, 2] * c[3, 1]
    my = c[0, 2] * c[3, 0] - c[0, 0] * c[3, 2]
    mz = c[0, 0] * c[3, 1] - c[0, 1] * c[3, 0]
    m = math.sqrt(mx * mx + my * my + mz * mz)
    for i in range(1, 3):
        d = abs(mx * c[i, 0] + my * c[i, 1] + mz * c[i, 2])
        if d > 1e-13 * m * (abs(c[i, 0]) + abs(c[i, 1]) + abs(c[i, 2])):
            return False
    return m > 0.0


@lean
def _roots_in_plane(mx, my, mz, c, breaks):
    """Breaks of the sign of m · H(t) along ``c``; 2 where it runs in the plane."""
    s0 = mx * c[0, 0] + my * c[0, 1] + mz * c[0, 2]
    s1 = mx * c[1, 0] + my * c[1, 1] + mz * c[1, 2]
    s2 = mx * c[2, 0] + my * c[2, 1] + mz * c[2, 2]
    s3 = mx * c[3, 0] + my * c[3, 1] + mz * c[3, 2]
    size = 0.0
    for i in range(4):
        size = max(size, abs(mx * c[i, 0]) + abs(my * c[i, 1]) + abs(mz * c[i, 2]))
    zero = _ROUNDING * size
    if abs(s0) <= zero and abs(s1) <= zero and abs(s2) <= zero and abs(s3) <= zero:
        return 2
    if (s0 > 0.0 and s1 > 0.0 and s2 > 0.0 and s3 > 0.0) or (
        s0 < 0.0 and s1 < 0.0 and s2 < 0.0 and s3 < 0.0
    ):
        return 2
    return sign_breaks(s0, s1, s2, s3, breaks)


@lean
def _straight_crossings(a, b, breaks, more, at, count):
    """Crossings of the straight ``a`` with ``b``: parameters into ``at`` (`MOST`, 2)."""
    mx = a[0, 1] * a[3, 2] - a[0, 2] * a[3, 1]
    my = a[0, 2] * a[3, 0] - a[0, 0] * a[3, 2]
    mz = a[0, 0] * a[3, 1] - a[0, 1] * a[3, 0]
    parts = _roots_in_plane(mx, my, mz, b, breaks)
    for k in range(1, parts - 1):
        t = breaks[k]
        hx = cubic(b[0, 0], b[1, 0], b[2, 0], b[3, 0], t)
        hy = cubic(b[0, 1], b[1, 1], b[2, 1], b[3, 1], t)
        hz = cubic(b[0, 2], b[1, 2], b[2, 2], b[3, 2], t)
        # The plane through the receiver, that point, and square to the first.
        px, py, pz = hy * mz - hz * my, hz * mx - hx * mz, hx * my - hy * mx
        found = _roots_in_plane(px, py, pz, a, more)
        for q in range(1, found - 1):
            s = more[q]
            if count < MOST:
                at[count, 0], at[count, 1] = s, t
            count += 1
    return count


@lean
def picture_box(c, box):
    """Box of the picture of a cubic with positive depths."""
    box[0], box[1], box[2], box[3] = 1e300, -1e300, 1e300, -1e300
    for i in range(4):
        x, y = c[i, 0] / c[i, 2], c[i, 1] / c[i, 2]
        box[0], box[1] = min(box[0], x), max(box[1], x)
        box[2], box[3] = min(box[2], y), max(box[3], y)


@lean
def _bend(c):
    """Largest distance of inner control points from the chord in the picture, over its length."""
    x0, y0 = c[0, 0] / c[0, 2], c[0, 1] / c[0, 2]
    dx, dy = c[3, 0] / c[3, 2] - x0, c[3, 1] / c[3, 2] - y0
    length2 = dx * dx + dy * dy
    if length2 == 0.0:
        return 0.0
    most = 0.0
    for i in range(1, 3):
        x, y = c[i, 0] / c[i, 2] - x0, c[i, 1] / c[i, 2] - y0
        most = max(most, abs(x * dy - y * dx))
    return most / length2


@lean
def _apart_across(a, b):
    """Whether a line along the chord of ``a`` has ``a`` on one side and ``b`` on the other."""
    x0, y0 = a[0, 0] / a[0, 2], a[0, 1] / a[0, 2]
    dx, dy = a[3, 0] / a[3, 2] - x0, a[3, 1] / a[3, 2] - y0
    low, high, b_low, b_high = 0.0, 0.0, 1e300, -1e300
    for i in range(4):
        if 0 < i < 3:
            d = (a[i, 1] / a[i, 2] - y0) * dx - (a[i, 0] / a[i, 2] - x0) * dy
            low, high = min(low, d), max(high, d)
        d = (b[i, 1] / b[i, 2] - y0) * dx - (b[i, 0] / b[i, 2] - x0) * dy
        b_low, b_high = min(b_low, d), max(b_high, d)
    return b_low > high or b_high < low


@lean
def picture_point(c, t, out):
    """Point and derivative of the picture at ``t`` into ``out`` (4,)."""
    r = 1.0 - t
    e0, e1, e2 = 3.0 * r * r, 6.0 * t * r, 3.0 * t * t
    x = cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], t)
    y = cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], t)
    w = cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], t)
    dx = e0 * (c[1, 0] - c[0, 0]) + e1 * (c[2, 0] - c[1, 0]) + e2 * (c[3, 0] - c[2, 0])
    dy = e0 * (c[1, 1] - c[0, 1]) + e1 * (c[2, 1] - c[1, 1]) + e2 * (c[3, 1] - c[2, 1])
    dw = e0 * (c[1, 2] - c[0, 2]) + e1 * (c[2, 2] - c[1, 2]) + e2 * (c[3, 2] - c[2, 2])
    out[0], out[1] = x / w, y / w
    out[2], out[3] = (dx - out[0] * dw) / w, (dy - out[1] * dw) / w


@lean
def _newton(a, b, s, t, pa, pb, root):
    """Crossing near (s, t) into ``root`` (2,); False where the iteration does not end."""
    for _ in range(20):
        picture_point(a, s, pa)
        picture_point(b, t, pb)
        gx, gy = pb[0] - pa[0], pb[1] - pa[1]
        det = pa[3] * pb[2] - pa[2] * pb[3]
        if det == 0.0:
            return False
        ds = (pb[2] * gy - pb[3] * gx) / det
        dt = (pa[2] * gy - pa[3] * gx) / det
        s, t = s + ds, t + dt
        if not (-0.5 < s < 1.5 and -0.5 < t < 1.5):
            return False
        if abs(ds) + abs(dt) < 1e-14:
            break
    root[0], root[1] = s, t
    return abs(ds) + abs(dt) < 1e-9


@lean
def _bent_crossings(a, b, space, spans, at):
    """Crossings of two bent curves; −1 where they are not found, as where they touch."""
    ca, cb = space[0], space[1]
    box_a, box_b, pa, pb, root = space[2, 0], space[2, 1], space[2, 2], space[2, 3], space[3, 0]
    spans[0, 0], spans[0, 1], spans[0, 2], spans[0, 3] = 0.0, 1.0, 0.0, 1.0
    top, count = 1, 0
    for _ in range(_VISITS):
        if top == 0:
            return count
        top -= 1
        a0, a1, b0, b1 = spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3]
        for i in range(4):
            for k in range(3):
                ca[i, k], cb[i, k] = a[i, k], b[i, k]
        restrict_cubic(ca, a0, a1)
        restrict_cubic(cb, b0, b1)
        picture_box(ca, box_a)
        picture_box(cb, box_b)
        if (
            box_a[1] < box_b[0] or box_b[1] < box_a[0] or box_a[3] < box_b[2]
            or box_b[3] < box_a[2]
        ):  # fmt: skip
            continue
        # Curves that touch, as an edge and the silhouette that ends in it, are apart across only.
        if _apart_across(ca, cb) or _apart_across(cb, ca):
            continue
        small = a1 - a0 < _SHORTEST or b1 - b0 < _SHORTEST
        bend = _bend(ca) + _bend(cb)
        if small or bend < _STRAIGHT:
            ux = ca[3, 0] / ca[3, 2] - ca[0, 0] / ca[0, 2]
            uy = ca[3, 1] / ca[3, 2] - ca[0, 1] / ca[0, 2]
            vx = cb[3, 0] / cb[3, 2] - cb[0, 0] / cb[0, 2]
            vy = cb[3, 1] / cb[3, 2] - cb[0, 1] / cb[0, 2]
            turn = abs(ux * vy - uy * vx)
            if turn > _TURN * bend * math.sqrt((ux * ux + uy * uy) * (vx * vx + vy * vy)):
                # Their directions nowhere agree: one crossing at most.
                if _newton(a, b, 0.5 * (a0 + a1), 0.5 * (b0 + b1), pa, pb, root):
                    s, t = root[0], root[1]
                    if a0 <= s < a1 and b0 <= t < b1:
                        if count >= MOST:
                            return -1
                        at[count, 0], at[count, 1] = s, t
                        count += 1
                    continue
            if small:
                if (a0 < _END or a1 > 1.0 - _END) and (b0 < _END or b1 > 1.0 - _END):
                    continue  # one goes on where the other ends
                return -1
        if top + 2 > _STACK:
            return -1
        long_a = (box_a[1] - box_a[0]) + (box_a[3] - box_a[2])
        long_b = (box_b[1] - box_b[0]) + (box_b[3] - box_b[2])
        if long_a >= long_b:
            mid = 0.5 * (a0 + a1)
            spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3] = a0, mid, b0, b1
            spans[top + 1, 0], spans[top + 1, 1] = mid, a1
            spans[top + 1, 2], spans[top + 1, 3] = b0, b1
        else:
            mid = 0.5 * (b0 + b1)
            spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3] = a0, a1, b0, mid
            spans[top + 1, 0], spans[top + 1, 1] = a0, a1
            spans[top + 1, 2], spans[top + 1, 3] = mid, b1
        top += 2
    return -1


@lean
def foot_on(c, x, y, work):
    """Parameter of the point of ``c`` nearest to (x, y) in the picture, and its distance.

    From every sample that is nearer than its neighbours: seen edge-on, a curve turns sharply.
    """
    best, foot = 1e300, 0.0
    before = here = 1e300
    for m in range(_SAMPLES + 2):
        after = 1e300
        if m <= _SAMPLES:
            picture_point(c, m / _SAMPLES, work)
            after = (work[0] - x) ** 2 + (work[1] - y) ** 2
        if m > 0 and here <= before and here <= after:
            t = (m - 1) / _SAMPLES
            for _ in range(30):
                picture_point(c, t, work)
                size2 = work[2] * work[2] + work[3] * work[3]
                if size2 == 0.0:
                    break
                step = ((x - work[0]) * work[2] + (y - work[1]) * work[3]) / size2
                step = min(max(step, -1.0 / _SAMPLES), 1.0 / _SAMPLES)
                new = min(max(t + step, 0.0), 1.0)
                if abs(new - t) < 1e-15:
                    break
                t = new
            picture_point(c, t, work)
            away = (work[0] - x) ** 2 + (work[1] - y) ** 2
            if away < best:
                best, foot = away, t
        before, here = here, after
    return foot, math.sqrt(best)


@lean
def _overlap(a, b, work, other, at):
    """Cuts that make parts of two curves equal where one runs along the other.

    Returns how many there are: at (s, −1) of the first, (−1, t) of the second; −1 where the curves
    do not run along each other.
    """
    count = common = 0
    size = 0.0
    for k in range(2):
        size += abs(a[3, k] / a[3, 2] - a[0, k] / a[0, 2])
        size += abs(b[3, k] / b[3, 2] - b[0, k] / b[0, 2])
    first = last = -1.0
    for turn in range(2):
        for end in range(2):
            if turn == 0:
                picture_point(b, float(end), work)
                t, away = foot_on(a, work[0], work[1], other)
            else:
                picture_point(a, float(end), work)
                t, away = foot_on(b, work[0], work[1], other)
            if away > OVERLAP * size:
                continue
            # The same on the first curve, for its middle.
            s = t if turn == 0 else float(end)
            if common == 0:
                first = s
            elif abs(s - first) > abs(last - first) or last < 0.0:
                last = s
            common += 1
            if 1e-9 < t < 1.0 - 1e-9:
                at[count, 0], at[count, 1] = (t, -1.0) if turn == 0 else (-1.0, t)
                count += 1
    if last < 0.0 or abs(last - first) < 1e-6:
        return -1
    for m in range(1, 4):
        picture_point(a, first + 0.25 * m * (last - first), work)
        _, away = foot_on(b, work[0], work[1], other)
        if away > OVERLAP * size:
            return -1
    return count


@lean
def crossings(a, straight_a, b, straight_b, breaks, more, space, spans, at):
    """Parameters (`MOST`, 2) of the crossings of two curves.

    Parameters
    ----------
    a, b : (4, 3) arrays
        Curves of positive depth.
    straight_a, straight_b : bool
        From `is_straight`.
    breaks, more, space, spans
        Scratch: twice (8,), (4, 4, 4) and (64, 4).
    at : (`MOST`, 2) array
        Receives the parameters; −1 where only one of the curves is to be cut.

    Returns
    -------
    count : int
        Number of crossings, −1 where they are not found.
    along : bool
        Whether a part of one curve runs along the other.
    """
    count = 0
    work, other = space[3, 1], space[3, 2]
    if straight_a and straight_b:
        mx = a[0, 1] * a[3, 2] - a[0, 2] * a[3, 1]
        my = a[0, 2] * a[3, 0] - a[0, 0] * a[3, 2]
        mz = a[0, 0] * a[3, 1] - a[0, 1] * a[3, 0]
        along = True
        for i in (0, 3):
            size = abs(mx * b[i, 0]) + abs(my * b[i, 1]) + abs(mz * b[i, 2])
            along = along and abs(mx * b[i, 0] + my * b[i, 1] + mz * b[i, 2]) <= 1e-11 * size
        if along:
            count = _overlap(a, b, work, other, at)
            return max(count, 0), count >= 0
    if straight_a:
        count = _straight_crossings(a, b, breaks, more, at, count)
    elif straight_b:
        count = _straight_crossings(b, a, breaks, more, at, count)
        for k in range(min(count, MOST)):
            at[k, 0], at[k, 1] = at[k, 1], at[k, 0]
    else:
        count = _bent_crossings(a, b, space, spans, at)
        if count < 0:
            count = _overlap(a, b, work, other, at)
            return count, count >= 0
    return (count if count <= MOST else -1), False
