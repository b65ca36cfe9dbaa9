"""Patches that lie on quadrics: their silhouette is a conic, cut out by a plane.

Of a quadric Pᵀ Q P = 0, with P = (p, 1), a receiver X sees the points of contact of its tangents
edge-on, and these lie in the polar plane Xᵀ Q P = 0 [1, sec. 5.2.4]. With the sign of Q such that
its gradient is the surface's +normal, the + side shows where Xᵀ Q P > 0. That is linear in the
control points: the side seen is known for sure from sixteen products, changes of side on an edge
are roots of a cubic, and the silhouette between two of them is an arc of a conic, which is
integrated like any other edge.

Besides planes, which need none of this, CAD models mostly consist of cylinders, cones and spheres.

References
----------
.. [1] J. G. Semple, G. T. Kneebone, "Algebraic Projective Geometry", Oxford University Press, 1952.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import (
    WALK,
    begin_walk,
    cubic,
    enclosed,
    end_walk,
    load_edge,
    sign_breaks,
    walk_piece,
    walk_size,
)
from .nets import heights, surface, weight_at

#: Values of Xᵀ Q P within this share of their terms are rounding: that of a fitted Q.
_ROUNDING = 1e-12
#: Curvature against the largest below which a quadric is straight: a fitted cylinder. What bends
#: the other way by as much shows its back for less than its square of a form factor.
_EVEN = 1e-10
#: Height over the quadric, against the patch, below which a receiver is on it: there the contour
#: may pass through the receiver, and the side seen is lost in rounding.
_ON = 1e-9
#: Chords shorter than this, relative to the patch, stand for their arc.
_SHORT = 1e-7
#: Height of the middle of a chord over the surface below which it lies in it.
_STRAIGHT = 1e-13
#: Accuracy of each piece of the outline against what is asked of the whole: they nearly cancel.
_SHARE = 0.03
#: What lies along a boundary at most: edges, each cut three times.
_INTERVALS = 16


@lean
def polar_plane(quadric, x, polar):
    """Coefficients (4,) of the side seen from ``x`` in shifted control vectors (H, w).

    ``quadric`` (5, 4) holds Q in coordinates (p − centre) · scale, and centre and scale in its last
    row. Returns False where the scale is 0: no quadric.
    """
    scale = quadric[4, 3]
    if scale == 0.0:
        return False
    a = (x[0] - quadric[4, 0]) * scale
    b = (x[1] - quadric[4, 1]) * scale
    c = (x[2] - quadric[4, 2]) * scale
    for k in range(4):
        polar[k] = quadric[k, 0] * a + quadric[k, 1] * b + quadric[k, 2] * c + quadric[k, 3]
    polar[3] += polar[0] * a + polar[1] * b + polar[2] * c
    for k in range(3):
        polar[k] *= scale
    return True


@lean
def side_values(s, polar, f):
    """Bernstein coefficients (4, 4) of the side seen: least, largest, and what is rounding."""
    low, high, size = 1e300, -1e300, 0.0
    for i in range(4):
        for j in range(4):
            a = polar[0] * s[i, j, 0] + polar[1] * s[i, j, 1] + polar[2] * s[i, j, 2]
            b = polar[3] * s[i, j, 3]
            value = a + b
            f[i, j] = value
            low, high = min(low, value), max(high, value)
            size = max(size, abs(a) + abs(b))
    return low, high, _ROUNDING * size


@lean
def hollow(quadric):
    """Whether the + side of a quadric is the inside of an ellipsoid, paraboloid or cylinder.

    From any place inside, all of the surface shows its + side: Pᵀ Q P > 0 is convex where the part
    of Q that is quadratic in p is negative semidefinite, which its principal minors tell.
    """
    a, b, c = -quadric[0, 0], -quadric[1, 1], -quadric[2, 2]
    d, e, f = -quadric[0, 1], -quadric[0, 2], -quadric[1, 2]
    size = a + b + c
    zero = -_EVEN * size
    if size <= 0.0 or min(a, min(b, c)) < zero:
        return False
    if min(a * b - d * d, min(a * c - e * e, b * c - f * f)) < zero * size:
        return False
    whole = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    return whole >= zero * size * size


@lean
def side_on_edge(f, k, zero, g):
    """The coefficients (4,) along boundary edge ``k`` of `contour.load_edge`."""
    for i in range(4):
        if k == 0:
            value = f[i, 0]
        elif k == 1:
            value = f[3, i]
        elif k == 2:
            value = f[3 - i, 3]
        else:
            value = f[0, 3 - i]
        g[i] = 0.0 if abs(value) <= zero else value


@lean
def restrict_cubic(c, a, b):
    """Cut the cubic ``c`` (4, 3) to [a, b], in place."""
    for k in range(3):
        p0, p1, p2, p3 = c[0, k], c[1, k], c[2, k], c[3, k]
        if b < 1.0:
            r = 1.0 - b
            q01, q12, q23 = r * p0 + b * p1, r * p1 + b * p2, r * p2 + b * p3
            q012, q123 = r * q01 + b * q12, r * q12 + b * q23
            p1, p2, p3 = q01, q012, r * q012 + b * q123
        if a > 0.0:
            t = a / b
            r = 1.0 - t
            q01, q12, q23 = r * p0 + t * p1, r * p1 + t * p2, r * p2 + t * p3
            q012, q123 = r * q01 + t * q12, r * q12 + t * q23
            p0, p1, p2 = r * q012 + t * q123, q123, q23
        c[0, k], c[1, k], c[2, k], c[3, k] = p0, p1, p2, p3


@lean
def _bernstein_value(f, u, v):
    """Value of the bicubic ``f`` (4, 4)."""
    total = 0.0
    r = 1.0 - u
    b0, b1, b2, b3 = r * r * r, 3.0 * u * r * r, 3.0 * u * u * r, u * u * u
    for j in range(4):
        row = b0 * f[0, j] + b1 * f[1, j] + b2 * f[2, j] + b3 * f[3, j]
        if j == 0:
            total += (1.0 - v) ** 3 * row
        elif j == 1:
            total += 3.0 * v * (1.0 - v) ** 2 * row
        elif j == 2:
            total += 3.0 * v * v * (1.0 - v) * row
        else:
            total += v**3 * row
    return total


@lean
def _between(f, u0, v0, u1, v1, at):
    """Point ``at`` (2,) of the silhouette square to the middle of a chord; False where none is.

    Roughly: it only tells one arc of a conic from the other.
    """
    mu, mv = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    nu, nv = v0 - v1, u1 - u0
    # As far as the unit square reaches on either side.
    least, most = -1e300, 1e300
    for k in range(2):
        m, d = (mu, nu) if k == 0 else (mv, nv)
        if d != 0.0:
            a, b = -m / d, (1.0 - m) / d
            least, most = max(least, min(a, b)), min(most, max(a, b))
    middle = _bernstein_value(f, mu, mv)
    found = False
    lo, hi, flo, fhi = 0.0, 0.0, middle, middle
    if middle == 0.0:
        at[0], at[1] = mu, mv
        return True
    for sign in range(2):
        end = most if sign == 0 else least
        # The arc is the nearer, the shorter the chord.
        for step in (0.02, 0.1, 0.25, 0.5, 1.0):
            t = min(step, end) if sign == 0 else max(-step, end)
            value = _bernstein_value(f, mu + t * nu, mv + t * nv)
            if (value > 0.0) != (middle > 0.0):
                if not found or abs(t) < abs(hi):
                    hi, fhi = t, value
                    found = True
                break
    if not found:
        return False
    for step in range(60):
        t = lo - flo * (hi - lo) / (fhi - flo)
        if step % 3 == 2:
            t = 0.5 * (lo + hi)
        value = _bernstein_value(f, mu + t * nu, mv + t * nv)
        if (value > 0.0) == (flo > 0.0):
            lo, flo = t, value
        else:
            hi, fhi = t, value
        if abs(hi - lo) < 1e-2 * abs(hi) or value == 0.0:
            break
    t = 0.5 * (lo + hi)
    at[0], at[1] = mu + t * nu, mv + t * nv
    return True


@lean
def _times(quadric, p, out):
    for k in range(4):
        out[k] = (
            quadric[k, 0] * p[0]
            + quadric[k, 1] * p[1]
            + quadric[k, 2] * p[2]
            + quadric[k, 3] * p[3]
        )


@lean
def _minor(a, b, c, i, j, k):
    """3 x 3 determinant of the columns i, j, k of three rows."""
    return (
        a[i] * (b[j] * c[k] - b[k] * c[j])
        - a[j] * (b[i] * c[k] - b[k] * c[i])
        + a[k] * (b[i] * c[j] - b[j] * c[i])
    )


@lean
def conic_arc(quadric, x, ends, work, c):
    """Rational arc of the silhouette as a cubic ``c`` (4, 3) of shifted control vectors.

    Parameters
    ----------
    quadric : (5, 4) array
        The surface.
    x : (3,) array
        Receiver.
    ends : (3, 3) array
        First and last point of the arc and one between, relative to the receiver. [m]
    work : (6, 4) array
        Scratch.

    Returns
    -------
    bool
        Whether there is one such arc.
    """
    scale = quadric[4, 3]
    first, last, inner, pole, q_first, q_last = (
        work[0], work[1], work[2], work[3], work[4], work[5],
    )  # fmt: skip
    span = 0.0
    for k in range(3):
        away = (x[k] - quadric[4, k]) * scale
        first[k] = ends[0, k] * scale + away
        last[k] = ends[1, k] * scale + away
        inner[k] = ends[2, k] * scale + away
        pole[k] = away
        span = max(span, abs(first[k] - last[k]))
    first[3] = last[3] = inner[3] = pole[3] = 1.0
    _times(quadric, first, q_first)
    _times(quadric, last, q_last)
    across = 0.0
    for k in range(4):
        across += first[k] * q_last[k]
    if span <= _SHORT or abs(across) <= _STRAIGHT:
        # A point, or a straight line of the surface.
        for i in range(4):
            for k in range(3):
                c[i, k] = ends[0, k] + (ends[1, k] - ends[0, k]) * (i / 3.0)
        return True
    # The tangents at both ends meet where the polars of the ends and of the receiver do.
    plane0, plane1, plane2, plane3 = 0.0, 0.0, 0.0, 0.0
    for k in range(4):
        plane0 += quadric[0, k] * pole[k]
        plane1 += quadric[1, k] * pole[k]
        plane2 += quadric[2, k] * pole[k]
        plane3 += quadric[3, k] * pole[k]
    pole[0], pole[1], pole[2], pole[3] = plane0, plane1, plane2, plane3
    m0 = _minor(q_first, q_last, pole, 1, 2, 3)
    m1 = -_minor(q_first, q_last, pole, 0, 2, 3)
    m2 = _minor(q_first, q_last, pole, 0, 1, 3)
    m3 = -_minor(q_first, q_last, pole, 0, 1, 2)
    size = max(max(abs(m0), abs(m1)), max(abs(m2), abs(m3)))
    if size == 0.0:
        return False
    pole[0], pole[1], pole[2], pole[3] = m0 / size, m1 / size, m2 / size, m3 / size
    bend = 0.0
    _times(quadric, pole, q_first)
    for k in range(4):
        bend += pole[k] * q_first[k]
    if bend == 0.0 or -across / bend <= 0.0:
        return False
    weight = math.sqrt(-0.5 * across / bend)
    # Either arc of the conic between the ends: the one that passes nearer to the point inside.
    best, nearest = 0.0, 1e300
    for sign in range(2):
        mu = weight if sign == 0 else -weight
        w = 0.5 + 0.5 * mu * pole[3]
        if w <= 1e-3:
            continue
        away = 0.0
        for k in range(3):
            shoulder = 0.25 * (first[k] + last[k]) + 0.5 * mu * pole[k]
            away += (shoulder / w - inner[k]) ** 2
        if away < nearest:
            best, nearest = mu, away
    if nearest > span * span:
        return False
    for i in range(4):
        b0, b1, b2 = (
            (1.0, 0.0, 0.0)
            if i == 0
            else (1.0 / 3.0, 2.0 / 3.0, 0.0)
            if i == 1
            else (0.0, 2.0 / 3.0, 1.0 / 3.0)
            if i == 2
            else (0.0, 0.0, 1.0)
        )
        w = b0 + b1 * best * pole[3] + b2
        for k in range(3):
            local = b0 * first[k] + b1 * best * pole[k] + b2 * last[k]
            c[i, k] = local / scale + (quadric[4, k] - x[k]) * w
    return True


@lean
def _edge_point(s, k, t, point):
    """Parameters of the point at ``t`` of boundary edge ``k``, and the ``point`` (3,) itself."""
    u = t if k == 0 else (1.0 if k == 1 else (1.0 - t if k == 2 else 0.0))
    v = 0.0 if k == 0 else (t if k == 1 else (1.0 if k == 2 else 1.0 - t))
    r = 1.0 - t
    b = (r * r * r, 3.0 * t * r * r, 3.0 * t * t * r, t * t * t)
    w = point[0] = point[1] = point[2] = 0.0
    for i in range(4):
        if k == 0:
            p, q = i, 0
        elif k == 1:
            p, q = 3, i
        elif k == 2:
            p, q = 3 - i, 3
        else:
            p, q = 0, 3 - i
        for c in range(3):
            point[c] += b[i] * s[p, q, c]
        w += b[i] * s[p, q, 3]
    for c in range(3):
        point[c] /= w
    return u, v


@kernel
def front_outline(s, x, quadric, f, zero, whole, pieces, breaks, ends, work):
    """Outline of the part of a net that shows its + side, where it shows both.

    Parameters
    ----------
    s : (4, 4, 4) array
        Shifted net.
    f, zero
        From `side_values`.
    whole : bool
        Whether all of it is asked for; else the silhouette alone.
    pieces : (17, 4, 3) array
        Receives the cubics along it, counter-clockwise about the + side.
    breaks, ends, work
        Scratch: (8,), (3, 3) and (9, 4) arrays.

    Returns
    -------
    int
        Number of pieces, the last of which is the silhouette; −1 where it is not one arc.
    """
    at, g, spans = work[6], work[7], np.empty((_INTERVALS, 4))
    count = 0
    for k in range(4):
        side_on_edge(f, k, zero, g)
        low = min(min(g[0], g[1]), min(g[2], g[3]))
        high = max(max(g[0], g[1]), max(g[2], g[3]))
        if low >= 0.0 or high <= 0.0:
            parts = 2
            breaks[0], breaks[1] = 0.0, 1.0
        else:
            parts = sign_breaks(g[0], g[1], g[2], g[3], breaks)
        for m in range(parts - 1):
            up = high > 0.0 and (
                low >= 0.0 or cubic(g[0], g[1], g[2], g[3], 0.5 * (breaks[m] + breaks[m + 1])) > 0.0
            )
            spans[count, 0], spans[count, 1], spans[count, 2] = k, breaks[m], breaks[m + 1]
            spans[count, 3] = 1.0 if up else 0.0
            count += 1
    changes = 0
    first = 0
    for m in range(count):
        before = spans[m - 1, 3] if m > 0 else spans[count - 1, 3]
        if spans[m, 3] != before:
            changes += 1
            if spans[m, 3] > 0.0:
                first = m
    if changes != 2:
        return -1
    made = 0
    last = first
    for step in range(count):
        m = (first + step) % count
        if spans[m, 3] == 0.0:
            break
        last = m
        if whole:
            load_edge(s, int(spans[m, 0]), pieces[made])
            restrict_cubic(pieces[made], spans[m, 1], spans[m, 2])
            made += 1
    # Of `ends`, the first is where the front is left, the second where it was entered.
    u0, v0 = _edge_point(s, int(spans[last, 0]), spans[last, 2], ends[0])
    u1, v1 = _edge_point(s, int(spans[first, 0]), spans[first, 1], ends[1])
    if not _between(f, u0, v0, u1, v1, at):
        return -1
    u, v = at[0], at[1]
    surface(s, u, v, ends[2], work[7], work[8])
    w = weight_at(s, u, v)
    for q in range(3):
        ends[2, q] /= w
    if not conic_arc(quadric, x, ends, work, pieces[made]):
        return -1
    return made + 1


@kernel
def quadric_factor(s, x, n, quadric, eps, rounding):
    """Form factor of the + side of a net on a quadric; NaN where it must be split first.

    Parameters
    ----------
    s : (4, 4, 4) array
        Shifted net.
    x, n : (3,) array
        Receiver and its normal.
    quadric : (5, 4) array
        As in `polar_plane`, not without a quadric.
    eps, rounding : float
        Relative accuracy, and `contour.horizon_tolerance`.
    """
    polar, f = np.empty(4), np.empty((4, 4))
    polar_plane(quadric, x, polar)
    if abs(polar[3]) <= _ON:
        return math.nan
    low, high, zero = side_values(s, polar, f)
    if high <= zero:
        return 0.0
    if low < -zero and polar[3] > 0.0 and hollow(quadric):
        low = 0.0  # control points outside tell less
    least, inner, most = heights(s, n)
    if most <= rounding:
        return 0.0
    dips = least > 0.0 and inner < 0.0
    if dips and low < -zero:
        return math.nan  # whether what dips is the side seen would have to be told
    breaks, walk = np.empty(8), np.empty(WALK)
    pieces = np.empty((_INTERVALS + 1, 4, 3))
    if low >= -zero:
        count = 4
        for k in range(4):
            load_edge(s, k, pieces[k])
    else:
        work, ends = np.empty((9, 4)), np.empty((3, 3))
        count = front_outline(s, x, quadric, f, zero, True, pieces, breaks, ends, work)
        if count < 0:
            return math.nan
    share = _SHARE * eps
    value = 0.0
    for _ in range(3):
        begin_walk(walk)
        for m in range(count):
            walk_piece(pieces[m], n, share, rounding, breaks, walk)
        value = end_walk(n, walk)
        # Edge-on, pieces cancel but for a small rest, which needs more digits of each.
        needed = eps * abs(value)
        if share * walk_size(walk) <= needed or share <= 1e-14:
            break
        share = max(0.3 * needed / walk_size(walk), 1e-14)
    value = enclosed(value, dips, max(2.5 * eps, 1e-9))
    return value if value >= 0.0 else math.nan
