"""Form factor from a point to a curved patch by Gauss quadrature of its boundary contour.

With r = p − x on the boundary, counter-clockwise about the source's +normal, and receiver normal n,

    F = −(1/2π) ∮ n · (r × dr) / |r|²                                     [1, eq. 4.31; 2]

In homogeneous form H(t) = A(t) − x w(t) the weights cancel: (r × dr)/|r|² = (H × H')/|H|² dt, so a
rational cubic edge needs no division by w, and an edge at infinity (w = 0, a direction) is an edge
like any other. Parts below the receiver's horizon are cut off at the roots of n · H(t) and closed
along the horizon plane, where the integrand is the angle turned through; which way round is known
modulo a whole only, and `enclosed` settles it.

Shifted nets ``s`` are (4, 4, 4): ``s[i, j, :3]`` = A − x w, ``s[i, j, 3]`` = w.

References
----------
.. [1] J. R. Howell, M. P. Mengüç, K. Daun, R. Siegel, "Thermal Radiation Heat Transfer", 7th ed.,
   CRC Press, 2020.
.. [2] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993, eq. 4 (an irradiance for unit radiance: π times a form factor).
"""

import math

import numpy as np

from .compiled import kernel, lean

TWO_PI = 2.0 * math.pi


def _rules() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss rules on [0, 1] of every order up to 12, packed one behind the other."""
    nodes, weights, start = [], [], [0]
    for order in range(13):
        if order:
            x, w = np.polynomial.legendre.leggauss(order)
            nodes.extend(0.5 * (x + 1.0))
            weights.extend(0.5 * w)
        start.append(len(nodes))
    return np.array(nodes), np.array(weights), np.array(start)


GAUSS_NODES, GAUSS_WEIGHTS, GAUSS_START = _rules()


@lean
def shift_net(net, x, s):
    """Write the net relative to point ``x`` into ``s``.

    Weights that are all very large or small are brought near 1, as tolerances are lengths.
    """
    scale = 1.0
    if 0.0 < net[0, 0, 3] < 1e-3 or net[0, 0, 3] > 1e3:
        scale = 1.0 / net[0, 0, 3]
    for i in range(4):
        for j in range(4):
            w = net[i, j, 3] * scale
            s[i, j, 0] = net[i, j, 0] * scale - x[0] * w
            s[i, j, 1] = net[i, j, 1] * scale - x[1] * w
            s[i, j, 2] = net[i, j, 2] * scale - x[2] * w
            s[i, j, 3] = w


@lean
def load_edge(s, k, c):
    """Copy edge ``k`` (v=0, u=1, v=1, u=0; counter-clockwise) of ``s`` into ``c`` (4, 3)."""
    for i in range(4):
        if k == 0:
            a, b = i, 0
        elif k == 1:
            a, b = 3, i
        elif k == 2:
            a, b = 3 - i, 3
        else:
            a, b = 0, 3 - i
        c[i, 0] = s[a, b, 0]
        c[i, 1] = s[a, b, 1]
        c[i, 2] = s[a, b, 2]


@lean
def cubic_point(c, t, h):
    """Evaluate the cubic ``c`` at ``t`` into ``h`` (3,)."""
    r = 1.0 - t
    b0, b1, b2, b3 = r * r * r, 3.0 * t * r * r, 3.0 * t * t * r, t * t * t
    for k in range(3):
        h[k] = b0 * c[0, k] + b1 * c[1, k] + b2 * c[2, k] + b3 * c[3, k]


@lean
def turning(h, gx, gy, gz, n):
    """Integrand n · (H × H')/|H|² of the contour at a point H with derivative g."""
    num = n[0] * (h[1] * gz - h[2] * gy) + n[1] * (h[2] * gx - h[0] * gz)
    num += n[2] * (h[0] * gy - h[1] * gx)
    return num / (h[0] ** 2 + h[1] ** 2 + h[2] ** 2 + 1e-100)


@lean
def chord_term(px, py, pz, qx, qy, qz, n):
    """Contour term of a straight edge (great-circle arc) from p to q: n · (p × q) β / |p × q|."""
    cx = py * qz - pz * qy
    cy = pz * qx - px * qz
    cz = px * qy - py * qx
    size = math.sqrt(cx * cx + cy * cy + cz * cz)
    if size == 0.0:
        return 0.0
    beta = math.atan2(size, px * qx + py * qy + pz * qz)
    return (n[0] * cx + n[1] * cy + n[2] * cz) * (beta / size)


@lean
def is_great_circle(c, sagitta, rounding):
    """Whether all control vectors lie in one plane through the receiver.

    Within ``sagitta`` and ``rounding``, which grows as the ends come to lie in one direction.
    """
    mx = c[0, 1] * c[3, 2] - c[0, 2] * c[3, 1]
    my = c[0, 2] * c[3, 0] - c[0, 0] * c[3, 2]
    mz = c[0, 0] * c[3, 1] - c[0, 1] * c[3, 0]
    m = math.sqrt(mx * mx + my * my + mz * mz)
    ends = math.sqrt(
        (c[0, 0] ** 2 + c[0, 1] ** 2 + c[0, 2] ** 2) * (c[3, 0] ** 2 + c[3, 1] ** 2 + c[3, 2] ** 2)
    )
    if m <= 1e-13 * ends:
        return False
    tolerance = sagitta + rounding * ends / m
    for i in range(1, 3):
        d = abs(mx * c[i, 0] + my * c[i, 1] + mz * c[i, 2])
        size = math.sqrt(c[i, 0] ** 2 + c[i, 1] ** 2 + c[i, 2] ** 2)
        if d > tolerance * m * size:
            return False
    return True


@lean
def _curve_order(c, a, b, log_eps):
    """Gauss points that reach exp(−``log_eps``) on [a, b]; more than 12 where it must be halved.

    From the pole of 1/|H|² nearest to the interval (Bernstein ellipse).
    """
    half = 0.5 * (b - a)
    t = a + half
    r = 1.0 - t
    b0, b1, b2, b3 = r * r * r, 3.0 * t * r * r, 3.0 * t * t * r, t * t * t
    e0, e1, e2 = 3.0 * r * r, 6.0 * t * r, 3.0 * t * t
    hx = b0 * c[0, 0] + b1 * c[1, 0] + b2 * c[2, 0] + b3 * c[3, 0]
    hy = b0 * c[0, 1] + b1 * c[1, 1] + b2 * c[2, 1] + b3 * c[3, 1]
    hz = b0 * c[0, 2] + b1 * c[1, 2] + b2 * c[2, 2] + b3 * c[3, 2]
    gx = e0 * (c[1, 0] - c[0, 0]) + e1 * (c[2, 0] - c[1, 0]) + e2 * (c[3, 0] - c[2, 0])
    gy = e0 * (c[1, 1] - c[0, 1]) + e1 * (c[2, 1] - c[1, 1]) + e2 * (c[3, 1] - c[2, 1])
    gz = e0 * (c[1, 2] - c[0, 2]) + e1 * (c[2, 2] - c[1, 2]) + e2 * (c[3, 2] - c[2, 2])
    mx, my, mz = hy * gz - hz * gy, hz * gx - hx * gz, hx * gy - hy * gx
    turn2 = mx * mx + my * my + mz * mz
    ga, reach_a = _length_and_reach(c, a, hx, hy, hz)
    gb, reach_b = _length_and_reach(c, b, hx, hy, hz)
    # Near a cusp the tangent at the middle says nothing of where the curve goes. (Directions that
    # differ by less than 1e-8 are one.)
    h2 = hx * hx + hy * hy + hz * hz
    if max(reach_a, reach_b) > 2.5 * half * half * turn2 + 1e-16 * h2 * ga * ga:
        return 99
    speed2 = gx * gx + gy * gy + gz * gz
    if speed2 == 0.0:
        return 3
    foot = -(hx * gx + hy * gy + hz * gz) / speed2 / half
    away = math.sqrt(turn2) / speed2 / half
    away2 = away * away
    big = 0.5 * (math.sqrt((foot - 1.0) ** 2 + away2) + math.sqrt((foot + 1.0) ** 2 + away2))
    rho = big + math.sqrt(max(big * big - 1.0, 0.0))
    # Far away the integrand's pole is where |H|, then the weight, would vanish: estimated from its
    # slope and its bend over the interval.
    mean = 0.5 * (ga + gb)
    slope = 0.5 * abs(gb - ga) / mean
    bend = abs(1.0 - math.sqrt(h2) / mean)
    if slope > 1e-3:
        rho = min(rho, 1.0 / slope + math.sqrt(max(1.0 / (slope * slope) - 1.0, 0.0)))
    if bend > 1e-6:
        z2 = max(1.0 / bend - 1.0, 0.0)
        rho = min(rho, math.sqrt(z2) + math.sqrt(z2 + 1.0))
    if rho > 1.5:
        return max(3, int(log_eps / (2.0 * math.log(rho))) + 2)
    return 99


@lean
def _length_and_reach(c, t, hx, hy, hz):
    """|H(t)|, and |H(t) × h|² with another point of the curve."""
    x = cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], t)
    y = cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], t)
    z = cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], t)
    mx, my, mz = y * hz - z * hy, z * hx - x * hz, x * hy - y * hx
    return math.sqrt(x * x + y * y + z * z), mx * mx + my * my + mz * mz


@lean
def _curve_part(c, a, b, n, order):
    """∫ n · (H × H')/|H|² dt over [a, b] by Gauss' rule of one order."""
    part = 0.0
    for g in range(GAUSS_START[order], GAUSS_START[order + 1]):
        t = a + (b - a) * GAUSS_NODES[g]
        r = 1.0 - t
        b0, b1, b2, b3 = r * r * r, 3.0 * t * r * r, 3.0 * t * t * r, t * t * t
        e0, e1, e2 = 3.0 * r * r, 6.0 * t * r, 3.0 * t * t
        hx = b0 * c[0, 0] + b1 * c[1, 0] + b2 * c[2, 0] + b3 * c[3, 0]
        hy = b0 * c[0, 1] + b1 * c[1, 1] + b2 * c[2, 1] + b3 * c[3, 1]
        hz = b0 * c[0, 2] + b1 * c[1, 2] + b2 * c[2, 2] + b3 * c[3, 2]
        gx = e0 * (c[1, 0] - c[0, 0]) + e1 * (c[2, 0] - c[1, 0]) + e2 * (c[3, 0] - c[2, 0])
        gy = e0 * (c[1, 1] - c[0, 1]) + e1 * (c[2, 1] - c[1, 1]) + e2 * (c[3, 1] - c[2, 1])
        gz = e0 * (c[1, 2] - c[0, 2]) + e1 * (c[2, 2] - c[1, 2]) + e2 * (c[3, 2] - c[2, 2])
        top = n[0] * (hy * gz - hz * gy) + n[1] * (hz * gx - hx * gz) + n[2] * (hx * gy - hy * gx)
        part += GAUSS_WEIGHTS[g] * top / (hx * hx + hy * hy + hz * hz + 1e-100)
    return part * (b - a)


@kernel
def curve_term(c, ta, tb, n, eps):
    """∫ n · (H × H')/|H|² dt of a curved edge over [ta, tb].

    Where the order would exceed 12 the interval is halved. At most 64 intervals wait and 400 are
    visited, which reaches 1e-12 of the edge; a point on the edge itself then gets the principal
    value.
    """
    log_eps = -math.log(eps)
    order = _curve_order(c, ta, tb, log_eps)
    if order <= 12:
        return _curve_part(c, ta, tb, n, order)
    stack = np.empty((64, 2))
    mid = 0.5 * (ta + tb)
    stack[0, 0], stack[0, 1] = mid, tb
    stack[1, 0], stack[1, 1] = ta, mid
    top = 2
    total = 0.0
    for _ in range(400):
        if top == 0:
            break
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        order = _curve_order(c, a, b, log_eps)
        if order > 12:
            if top + 2 <= 64 and b - a > 2e-13:
                mid = 0.5 * (a + b)
                stack[top, 0], stack[top, 1] = mid, b
                stack[top + 1, 0], stack[top + 1, 1] = a, mid
                top += 2
                continue
            order = 12
        total += _curve_part(c, a, b, n, order)
    return total


@lean
def edge_term(c, ta, tb, n, eps):
    """Contour term of edge ``c`` over [ta, tb]; closed form where it is straight seen from x."""
    # Below 1e-11 the sagitta is invisible.
    if is_great_circle(c, 1e-11, 1e-15):
        return chord_term(
            cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], ta),
            cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], ta),
            cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], ta),
            cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], tb),
            cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], tb),
            cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], tb),
            n,
        )
    return curve_term(c, ta, tb, n, eps)


@lean
def cubic(s0, s1, s2, s3, t):
    r = 1.0 - t
    return r * r * r * s0 + 3.0 * t * r * r * s1 + 3.0 * t * t * r * s2 + t * t * t * s3


@lean
def _monotone_root(s0, s1, s2, s3, lo, hi):
    """Sign change of a Bernstein cubic where it is monotone; −1 where it has none."""
    flo, fhi = cubic(s0, s1, s2, s3, lo), cubic(s0, s1, s2, s3, hi)
    if (flo > 0.0) == (fhi > 0.0):
        return -1.0
    for step in range(200):  # bisection with a secant guess: never leaves the bracket
        mid = 0.5 * (lo + hi)
        if fhi != flo:
            guess = lo - flo * (hi - lo) / (fhi - flo)
            if lo < guess < hi and step % 3 != 2:
                mid = guess
        if hi - lo <= 2e-16 or mid <= lo or mid >= hi:
            break
        fm = cubic(s0, s1, s2, s3, mid)
        if fm == 0.0:
            return mid
        if (fm > 0.0) == (flo > 0.0):
            lo, flo = mid, fm
        else:
            hi, fhi = mid, fm
    return 0.5 * (lo + hi)


@lean
def sign_breaks(s0, s1, s2, s3, out):
    """Write 0, the sign changes of a Bernstein cubic inside (0, 1), and 1 into ``out`` (8,).

    The extrema of the cubic bound intervals on which it is monotone; each holds at most one root.
    """
    out[0] = 0.0
    count = 1
    if not (
        (s0 > 0.0 and s1 > 0.0 and s2 > 0.0 and s3 > 0.0)
        or (s0 <= 0.0 and s1 <= 0.0 and s2 <= 0.0 and s3 <= 0.0)
    ):
        a = s3 - 3.0 * s2 + 3.0 * s1 - s0
        b = s2 - 2.0 * s1 + s0
        c = s1 - s0
        t1 = t2 = -1.0
        if a == 0.0:
            if b != 0.0:
                t1 = -0.5 * c / b
        else:
            disc = b * b - a * c
            if disc > 0.0:
                # Stable roots of a t² + 2 b t + c.
                q = -(b + math.copysign(math.sqrt(disc), b))
                t1, t2 = q / a, (c / q if q != 0.0 else -1.0)
                if t1 > t2:
                    t1, t2 = t2, t1
        lo = 0.0
        for k in range(3):
            hi = t1 if k == 0 else (t2 if k == 1 else 1.0)
            if not lo < hi or hi > 1.0:
                continue
            root = _monotone_root(s0, s1, s2, s3, lo, hi)
            if root > out[count - 1] and root < 1.0:
                out[count] = root
                count += 1
            lo = hi
    out[count] = 1.0
    return count + 1


@lean
def _closing_angle(ax, ay, az, bx, by, bz, n):
    """Signed angle from direction a to b about n: the contour term along the horizon."""
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    # Both lie in the horizon plane up to rounding.
    return math.atan2(n[0] * cx + n[1] * cy + n[2] * cz, ax * bx + ay * by + az * bz)


@lean
def _ends_span(c):
    """Whether a cubic in the horizon stays on one side of a line through the receiver.

    Then it turns less than half a turn, and its ends tell the angle.
    """
    a = math.sqrt(c[0, 0] ** 2 + c[0, 1] ** 2 + c[0, 2] ** 2)
    b = math.sqrt(c[3, 0] ** 2 + c[3, 1] ** 2 + c[3, 2] ** 2)
    # The line is square to the bisector of the ends.
    mx = c[0, 0] * b + c[3, 0] * a
    my = c[0, 1] * b + c[3, 1] * a
    mz = c[0, 2] * b + c[3, 2] * a
    for i in range(4):
        if mx * c[i, 0] + my * c[i, 1] + mz * c[i, 2] <= 0.0:
            return False
    return True


@kernel
def _turned_angle(c, n):
    """Angle about n that a cubic in the horizon turns through: its contour term, exactly.

    Pieces are halved until the ends of each tell its angle; at most 60 wait and 400 are visited,
    which reaches the rounding of a receiver on the edge itself.
    """
    if _ends_span(c):
        return _closing_angle(c[0, 0], c[0, 1], c[0, 2], c[3, 0], c[3, 1], c[3, 2], n)
    stack = np.empty((64, 4, 3))
    for i in range(4):
        for k in range(3):
            stack[0, i, k] = c[i, k]
    top = 1
    total = 0.0
    for _ in range(400):
        if top == 0:
            break
        top -= 1
        piece = stack[top]
        if top + 2 > 64 or _ends_span(piece):
            total += _closing_angle(
                piece[0, 0], piece[0, 1], piece[0, 2], piece[3, 0], piece[3, 1], piece[3, 2], n
            )
            continue
        for k in range(3):
            p, q, r, s = piece[0, k], piece[1, k], piece[2, k], piece[3, k]
            pq, qr, rs = 0.5 * (p + q), 0.5 * (q + r), 0.5 * (r + s)
            pqr, qrs = 0.5 * (pq + qr), 0.5 * (qr + rs)
            mid = 0.5 * (pqr + qrs)
            stack[top + 1, 0, k], stack[top + 1, 1, k] = p, pq
            stack[top + 1, 2, k], stack[top + 1, 3, k] = pqr, mid
            piece[0, k], piece[1, k], piece[2, k], piece[3, k] = mid, qrs, rs, s
        top += 2
    return total


@lean
def horizon_tolerance(x):
    """Height below which a point counts as on the horizon: rounding of the coordinates."""
    return 4e-15 * (abs(x[0]) + abs(x[1]) + abs(x[2]))


#: Slots of the state of a walk along a closed contour: the sum so far, whether it is above the
#: horizon, has begun, has an open exit, has a first entry, the sum of the sizes of its pieces; then
#: the points of exit and entry, and of its beginning.
_TOTAL, _ABOVE, _BEGAN, _HAS_EXIT, _HAS_ENTRY, _SIZE, _EXIT, _ENTRY, _START = (
    0, 1, 2, 3, 4, 5, 6, 9, 12,
)  # fmt: skip
WALK = 15


@lean
def begin_walk(walk):
    """Make the state ``walk`` (`WALK`,) ready for a closed contour."""
    for k in range(_EXIT):
        walk[k] = 0.0


@lean
def walk_piece(c, n, eps, rounding, breaks, walk):
    """Add the part above the horizon of the contour's next piece, the cubic ``c`` (4, 3).

    ``breaks`` (8,) is scratch.
    """
    size = 0.0
    for i in range(1, 4):
        size = max(size, abs(c[i, 0] - c[0, 0]) + abs(c[i, 1] - c[0, 1]) + abs(c[i, 2] - c[0, 2]))
    scale = abs(c[0, 0]) + abs(c[0, 1]) + abs(c[0, 2])
    if walk[_BEGAN] == 0.0:
        for k in range(3):
            walk[_START + k] = c[0, k]
    if size <= 1e-15 * scale:
        return  # collapsed edge (a pole): no length, no light
    s0 = n[0] * c[0, 0] + n[1] * c[0, 1] + n[2] * c[0, 2]
    s1 = n[0] * c[1, 0] + n[1] * c[1, 1] + n[2] * c[1, 2]
    s2 = n[0] * c[2, 0] + n[1] * c[2, 1] + n[2] * c[2, 2]
    s3 = n[0] * c[3, 0] + n[1] * c[3, 1] + n[2] * c[3, 2]
    zero = rounding + 4e-16 * (scale + size)
    if abs(s0) <= zero:
        s0 = 0.0
    if abs(s1) <= zero:
        s1 = 0.0
    if abs(s2) <= zero:
        s2 = 0.0
    if abs(s3) <= zero:
        s3 = 0.0
    low = min(min(s0, s1), min(s2, s3))
    high = max(max(s0, s1), max(s2, s3))
    # An edge in the horizon may wrap far about the receiver: it is followed, not closed.
    level = low == 0.0 and high == 0.0
    if low >= 0.0 or high <= 0.0:
        count = 2
        breaks[0], breaks[1] = 0.0, 1.0
    else:
        count = sign_breaks(s0, s1, s2, s3, breaks)
    for m in range(count - 1):
        ta, tb = breaks[m], breaks[m + 1]
        up = level or (high > 0.0 and cubic(s0, s1, s2, s3, 0.5 * (ta + tb)) > 0.0)
        if up == (walk[_ABOVE] > 0.0) and not up:
            walk[_BEGAN] = 1.0
            continue
        if up != (walk[_ABOVE] > 0.0):
            hx = cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], ta)
            hy = cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], ta)
            hz = cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], ta)
            if not up:
                walk[_EXIT], walk[_EXIT + 1], walk[_EXIT + 2] = hx, hy, hz
                walk[_HAS_EXIT] = 1.0
            elif walk[_HAS_EXIT] > 0.0:
                walk[_TOTAL] += _closing_angle(
                    walk[_EXIT], walk[_EXIT + 1], walk[_EXIT + 2], hx, hy, hz, n
                )
                walk[_HAS_EXIT] = 0.0
            elif walk[_BEGAN] > 0.0:
                walk[_ENTRY], walk[_ENTRY + 1], walk[_ENTRY + 2] = hx, hy, hz
                walk[_HAS_ENTRY] = 1.0
            walk[_ABOVE] = 1.0 if up else 0.0
        if up:
            part = _turned_angle(c, n) if level else edge_term(c, ta, tb, n, eps)
            walk[_TOTAL] += part
            walk[_SIZE] += abs(part)
        walk[_BEGAN] = 1.0


@lean
def end_walk(n, walk):
    """Signed form factor of what the contour encloses above the horizon."""
    if walk[_HAS_EXIT] > 0.0:
        # Without an entry it began above the horizon and ends below it, at its first point.
        to = _ENTRY if walk[_HAS_ENTRY] > 0.0 else _START
        walk[_TOTAL] += _closing_angle(
            walk[_EXIT], walk[_EXIT + 1], walk[_EXIT + 2], walk[to], walk[to + 1], walk[to + 2], n
        )
    elif walk[_ABOVE] > 0.0 and walk[_HAS_ENTRY] > 0.0:
        # It began below and ends above: the first entry closes at the first point.
        walk[_TOTAL] += _closing_angle(
            walk[_START], walk[_START + 1], walk[_START + 2],
            walk[_ENTRY], walk[_ENTRY + 1], walk[_ENTRY + 2], n,
        )  # fmt: skip
    return -walk[_TOTAL] / TWO_PI


@lean
def walk_size(walk):
    """Form factor that the pieces above the horizon would add up to if none cancelled."""
    return walk[_SIZE] / TWO_PI


@kernel
def contour_factor(s, n, eps, rounding):
    """Signed form factor of the part of the shifted net ``s`` above the horizon.

    Positive when the +normal side is seen. ``rounding`` is `horizon_tolerance` of the receiver.
    """
    c, breaks, walk = np.empty((4, 3)), np.empty(8), np.empty(WALK)
    begin_walk(walk)
    for k in range(4):
        load_edge(s, k, c)
        walk_piece(c, n, eps, rounding, breaks, walk)
    return end_walk(n, walk)


@lean
def enclosed(value, dips, doubt):
    """Form factor of what shows its + side throughout by its contour's value; −1 for unknown.

    Closed along the horizon the long way round, a contour is a whole off. So it is where the net
    ``dips``: its boundary is above the horizon throughout, but some of what it encloses may be
    below. As that shows its + side too, and ends in the horizon, it fills all of the lower
    hemisphere and counts −1. Values within ``doubt`` of 0 leave open whether there is any.
    """
    if value < -0.25:
        value += 1.0
    elif dips and value <= doubt:
        return -1.0
    elif value > 1.25:
        value -= 1.0
    if -doubt <= value <= 1.0 + doubt:
        return max(0.0, value)
    return -1.0
