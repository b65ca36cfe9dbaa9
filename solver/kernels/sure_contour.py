"""Contour integrals with a proved bound of their error, cut by a plane through the receiver.

With H(t) the homogeneous edge as the receiver sees it, the contour term is ∫ n·(H × H')/(H·H) dt
(see `contour`). An interval of half-length h about t0 is split until H cannot vanish near it: with
D a bound of |H(z) − H(t0)| for complex |z − t0| <= R, |H·H| >= |H0|² − 2 |H0| D − D². The ellipse
with foci at the ends of the interval and half-axes summing to ρ h, ρ = 4, lies within R = 2.125 h;
a Gauss rule of m + 1 nodes then errs by at most (64/15) h M ρ^(−2m) / (1 − ρ^(−2)), where M bounds
the integrand on the ellipse [1, theorem 19.3]. Bounds hold up to the rounding of double precision.

.. [1] L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM, 2013.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import (
    GAUSS_NODES,
    GAUSS_START,
    GAUSS_WEIGHTS,
    TWO_PI,
    chord_term,
    cubic,
    cubic_point,
    is_great_circle,
    load_edge,
    sign_breaks,
)

#: Tolerances of `contour.is_great_circle` below which a chord errs by less than the rounding.
SAGITTA, SLACK = 1e-13, 2e-15
_ORDER = 12
_REACH = 2.125
#: (64/15) ρ^(−22) / (1 − ρ^(−2)) for 12 nodes and ρ = 4.
_GAUSS = 64.0 / 15.0 * 4.0**-22 / (1.0 - 1.0 / 16.0)
#: Rounding of a contour: sums of a few hundred terms below 2π.
_ROUNDING = 4e-15


@kernel
def _sure_curve(c, ta, tb, n, out):
    """Add the contour term of a curved edge over [ta, tb] and its error bound to ``out`` (2,)."""
    stack = np.empty((64, 2))
    stack[0, 0], stack[0, 1] = ta, tb
    top = 1
    h, d1, d2, d3 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        d3[k] = 6.0 * (c[3, k] - 3.0 * c[2, k] + 3.0 * c[1, k] - c[0, k])
    n3 = math.sqrt(d3[0] ** 2 + d3[1] ** 2 + d3[2] ** 2)
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        half, t = 0.5 * (b - a), 0.5 * (a + b)
        r = 1.0 - t
        cubic_point(c, t, h)
        for k in range(3):
            d1[k] = 3.0 * (
                r * r * (c[1, k] - c[0, k])
                + 2.0 * r * t * (c[2, k] - c[1, k])
                + t * t * (c[3, k] - c[2, k])
            )
            d2[k] = 6.0 * (
                r * (c[2, k] - 2.0 * c[1, k] + c[0, k]) + t * (c[3, k] - 2.0 * c[2, k] + c[1, k])
            )
        n0 = math.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
        n1 = math.sqrt(d1[0] ** 2 + d1[1] ** 2 + d1[2] ** 2)
        n2 = math.sqrt(d2[0] ** 2 + d2[1] ** 2 + d2[2] ** 2)
        reach = _REACH * half
        away = reach * (n1 + reach * (0.5 * n2 + reach * n3 / 6.0))
        if away > 0.35 * n0:
            if top + 2 <= 64 and half > 1e-13:
                stack[top, 0], stack[top, 1] = t, b
                stack[top + 1, 0], stack[top + 1, 1] = a, t
                top += 2
                continue
            # The edge passes through the receiver: at most half a turn is unknown.
            out[1] += math.pi
            continue
        speed = n1 + reach * (n2 + 0.5 * reach * n3)
        bound = (n0 + away) * speed / (n0 * n0 - 2.0 * n0 * away - away * away + 1e-300)
        out[1] += half * _GAUSS * bound
        part = 0.0
        for g in range(GAUSS_START[_ORDER], GAUSS_START[_ORDER + 1]):
            t = a + 2.0 * half * GAUSS_NODES[g]
            r = 1.0 - t
            cubic_point(c, t, h)
            for k in range(3):
                d1[k] = 3.0 * (
                    r * r * (c[1, k] - c[0, k])
                    + 2.0 * r * t * (c[2, k] - c[1, k])
                    + t * t * (c[3, k] - c[2, k])
                )
            num = (
                n[0] * (h[1] * d1[2] - h[2] * d1[1])
                + n[1] * (h[2] * d1[0] - h[0] * d1[2])
                + n[2] * (h[0] * d1[1] - h[1] * d1[0])
            )
            part += GAUSS_WEIGHTS[g] * num / (h[0] ** 2 + h[1] ** 2 + h[2] ** 2 + 1e-300)
        out[0] += 2.0 * half * part


@lean
def _length(p):
    return math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])


@lean
def _sure_closing(e, f, m, n, rounding, out):
    """Add the contour term from ``e`` to ``f`` in the cutting plane ``m`` to ``out`` (2,).

    It is known up to whole turns only, and half a turn may be taken in either direction. Where an
    edge touches the plane in the receiver itself, the directions of its ends are rounding: that is
    part of the bound.
    """
    cx, cy, cz = e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]
    angle = math.atan2(m[0] * cx + m[1] * cy + m[2] * cz, e[0] * f[0] + e[1] * f[1] + e[2] * f[2])
    a, b = _length(e), _length(f)
    slack = 0.1 * rounding + 2e-16 * (a + b)
    out[1] += math.pi * min(1.0, slack * (a + b) / (math.pi * a * b + 1e-300))
    out[0] += angle * (m[0] * n[0] + m[1] * n[1] + m[2] * n[2])


@kernel
def sure_factor(s, m, n, rounding, noise, out):
    """Signed form factor of the part of shifted net ``s`` with m · H > 0, and its error bound.

    Parameters
    ----------
    s : (4, 4, 4) array
        Net relative to the receiver, seen from its + side throughout.
    m, n : (3,) array
        Normal of the cutting plane through the receiver, and receiver normal. The part is to lie
        above the horizon, or m = n.
    rounding : float
        Height that counts as on the plane.
    noise : float
        Rounding of the control points: of a part that was cut out of a larger net.
    out : (2,) array
        Receives the factor and the bound of its error.
    """
    c = np.empty((4, 3))
    breaks = np.empty(8)
    p, q = np.empty(3), np.empty(3)
    e, f = np.empty(3), np.empty(3)
    out[0], out[1] = 0.0, 0.0
    above = began = have_exit = have_entry = False
    for k in range(4):
        load_edge(s, k, c)
        size = 0.0
        for i in range(1, 4):
            size = max(
                size, abs(c[i, 0] - c[0, 0]) + abs(c[i, 1] - c[0, 1]) + abs(c[i, 2] - c[0, 2])
            )
        scale = abs(c[0, 0]) + abs(c[0, 1]) + abs(c[0, 2])
        if size <= 1e-15 * scale:
            continue
        zero = rounding + 4e-16 * (scale + size)
        s0 = m[0] * c[0, 0] + m[1] * c[0, 1] + m[2] * c[0, 2]
        s1 = m[0] * c[1, 0] + m[1] * c[1, 1] + m[2] * c[1, 2]
        s2 = m[0] * c[2, 0] + m[1] * c[2, 1] + m[2] * c[2, 2]
        s3 = m[0] * c[3, 0] + m[1] * c[3, 1] + m[2] * c[3, 2]
        s0 = 0.0 if abs(s0) <= zero else s0
        s1 = 0.0 if abs(s1) <= zero else s1
        s2 = 0.0 if abs(s2) <= zero else s2
        s3 = 0.0 if abs(s3) <= zero else s3
        low, high = min(min(s0, s1), min(s2, s3)), max(max(s0, s1), max(s2, s3))
        if high <= 0.0 or low >= 0.0:
            count = 2
            breaks[0], breaks[1] = 0.0, 1.0
        else:
            count = sign_breaks(s0, s1, s2, s3, breaks)
        straight = is_great_circle(c, SAGITTA, SLACK)
        for b in range(count - 1):
            ta, tb = breaks[b], breaks[b + 1]
            up = high > 0.0 and cubic(s0, s1, s2, s3, 0.5 * (ta + tb)) > 0.0
            if up:
                cubic_point(c, ta, p)
                if not above:
                    if have_exit:
                        _sure_closing(e, p, m, n, rounding, out)
                        have_exit = False
                    elif began:
                        have_entry = True
                        f[:] = p
                    above = True
                cubic_point(c, tb, q)
                # Directions of ends close to the receiver are known no better than this.
                slack = noise if ta == 0.0 and tb == 1.0 else noise + 4e-16 * (scale + size)
                if slack > 0.0:
                    near = min(_length(p), _length(q))
                    out[1] += min(TWO_PI, 2.0 * slack / (near + 1e-300))
                if straight:
                    out[0] += chord_term(p[0], p[1], p[2], q[0], q[1], q[2], n)
                else:
                    _sure_curve(c, ta, tb, n, out)
            elif above:
                cubic_point(c, ta, e)
                have_exit = True
                above = False
            began = True
    load_edge(s, 0, c)
    if have_exit and have_entry:
        _sure_closing(e, f, m, n, rounding, out)
    elif have_exit:
        # The walk began inside and ends outside, at its first point.
        _sure_closing(e, c[0], m, n, rounding, out)
    elif above and have_entry:
        _sure_closing(c[0], f, m, n, rounding, out)
    out[0] /= -TWO_PI
    out[1] = out[1] / TWO_PI + _ROUNDING


@lean
def pyramid_factor(planes, n, poly, other):
    """Form factor of the whole cone of directions inside a pyramid and above the horizon.

    An upper bound for everything within. ``planes`` from `pyramid.make_pyramid`; ``poly`` and
    ``other`` (16, 3) are scratch. The cone starts wider than any pyramid made there (its control
    points lie within 88 degrees of the axis) and is clipped by one plane after the other.
    """
    ax, ay, az = planes[4, 0], planes[4, 1], planes[4, 2]
    # Any two vectors square to the axis and to each other.
    if abs(ax) <= abs(ay) and abs(ax) <= abs(az):
        ex, ey, ez = 0.0, -az, ay
    elif abs(ay) <= abs(az):
        ex, ey, ez = az, 0.0, -ax
    else:
        ex, ey, ez = -ay, ax, 0.0
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / size, ey / size, ez / size
    fx, fy, fz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
    for k in range(4):
        p = 30.0 if k == 0 or k == 3 else -30.0
        q = 30.0 if k < 2 else -30.0
        poly[k, 0], poly[k, 1], poly[k, 2] = (
            ax + p * ex + q * fx,
            ay + p * ey + q * fy,
            az + p * ez + q * fz,
        )
    count = 4
    for k in range(5):
        if k < 4:
            mx, my, mz = planes[k, 0], planes[k, 1], planes[k, 2]
            if mx == 0.0 and my == 0.0 and mz == 0.0:
                continue
        else:
            mx, my, mz = n[0], n[1], n[2]
        kept = 0
        for i in range(count):
            j = i + 1 if i + 1 < count else 0
            di = mx * poly[i, 0] + my * poly[i, 1] + mz * poly[i, 2]
            dj = mx * poly[j, 0] + my * poly[j, 1] + mz * poly[j, 2]
            if di >= 0.0:
                for c in range(3):
                    other[kept, c] = poly[i, c]
                kept += 1
            if (di >= 0.0) != (dj >= 0.0):
                t = di / (di - dj)
                for c in range(3):
                    other[kept, c] = poly[i, c] + t * (poly[j, c] - poly[i, c])
                kept += 1
        count = kept
        for i in range(count):
            for c in range(3):
                poly[i, c] = other[i, c]
        if count < 3:
            return 0.0
    total = 0.0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        total += chord_term(
            poly[i, 0], poly[i, 1], poly[i, 2], poly[j, 0], poly[j, 1], poly[j, 2], n
        )
    return min(1.0, abs(total) / TWO_PI + _ROUNDING)
