"""A ray as two planes, and the scalar bicubics it makes of a patch.

All of it lives in one scratch array ``work (WORK,)`` per thread: the ray, the scalar nets, the
coefficients on the current box and a stack of boxes.

.. [1] T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
"""

import math

from .compiled import lean

#: Length of the scratch array one ray needs.
WORK = 640
#: Offsets into it: D1, D2, distance times weight, weight; the two nets on a box; rows; boxes.
D1, D2, DISTANCE, WEIGHT, SUB1, SUB2, ROWS, STACK = 16, 32, 48, 64, 80, 96, 112, 128
STACK_SIZE = (WORK - STACK) // 4
EPS = 2.220446049250313e-16
#: Rounding of a coefficient n·(X − o w) relative to the size of its terms.
ROUNDING = 16.0 * EPS


@lean
def setup_ray(ox, oy, oz, dx, dy, dz, work):
    """Store the ray and two unit normals of planes through it, n1 × n2 along d [1], in ``work``."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    x, y, z = dx / length, dy / length, dz / length
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    work[0], work[1], work[2] = ox, oy, oz
    work[3], work[4], work[5] = dx, dy, dz
    work[6], work[7], work[8] = 1.0 + sign * x * x * a, sign * b, -sign * x
    work[9], work[10], work[11] = b, sign + y * y * a, -y
    work[12] = length * length


@lean
def load_nets(net, work):
    """Scalar nets D1, D2, T (distance along the ray times w) and w; returns the error of D."""
    ox, oy, oz = work[0], work[1], work[2]
    dx, dy, dz = work[3], work[4], work[5]
    ax, ay, az = work[6], work[7], work[8]
    bx, by, bz = work[9], work[10], work[11]
    inverse = 1.0 / work[12]
    origin = abs(ox) + abs(oy) + abs(oz)
    scale = 0.0
    for i in range(4):
        for j in range(4):
            k = 4 * i + j
            w = net[i, j, 3]
            x = net[i, j, 0] - ox * w
            y = net[i, j, 1] - oy * w
            z = net[i, j, 2] - oz * w
            work[D1 + k] = ax * x + ay * y + az * z
            work[D2 + k] = bx * x + by * y + bz * z
            work[DISTANCE + k] = (dx * x + dy * y + dz * z) * inverse
            work[WEIGHT + k] = w
            size = abs(net[i, j, 0]) + abs(net[i, j, 1]) + abs(net[i, j, 2]) + origin * w
            scale = max(scale, size)
    return ROUNDING * scale


@lean
def sub_net(work, source, target, u0, u1, v0, v1):
    """Coefficients on [u0, u1] x [v0, v1] from those on the unit square, by blossoms."""
    a, b = u0, u1
    p, q = 1.0 - a, 1.0 - b
    for j in range(4):
        c0, c1 = work[source + j], work[source + 4 + j]
        c2, c3 = work[source + 8 + j], work[source + 12 + j]
        work[ROWS + j] = p * p * p * c0 + 3 * p * p * a * c1 + 3 * p * a * a * c2 + a * a * a * c3
        work[ROWS + 4 + j] = (
            p * p * q * c0
            + (p * p * b + 2 * p * a * q) * c1
            + (a * a * q + 2 * p * a * b) * c2
            + a * a * b * c3
        )
        work[ROWS + 8 + j] = (
            q * q * p * c0
            + (q * q * a + 2 * q * b * p) * c1
            + (b * b * p + 2 * q * b * a) * c2
            + b * b * a * c3
        )
        work[ROWS + 12 + j] = (
            q * q * q * c0 + 3 * q * q * b * c1 + 3 * q * b * b * c2 + b * b * b * c3
        )
    a, b = v0, v1
    p, q = 1.0 - a, 1.0 - b
    for i in range(4):
        r, s = ROWS + 4 * i, target + 4 * i
        c0, c1, c2, c3 = work[r], work[r + 1], work[r + 2], work[r + 3]
        work[s] = p * p * p * c0 + 3 * p * p * a * c1 + 3 * p * a * a * c2 + a * a * a * c3
        work[s + 1] = (
            p * p * q * c0
            + (p * p * b + 2 * p * a * q) * c1
            + (a * a * q + 2 * p * a * b) * c2
            + a * a * b * c3
        )
        work[s + 2] = (
            q * q * p * c0
            + (q * q * a + 2 * q * b * p) * c1
            + (b * b * p + 2 * q * b * a) * c2
            + b * b * a * c3
        )
        work[s + 3] = q * q * q * c0 + 3 * q * q * b * c1 + 3 * q * b * b * c2 + b * b * b * c3


@lean
def value(work, net, u, v):
    """Value of a scalar net."""
    p, q = 1.0 - u, 1.0 - v
    b0, b1, b2, b3 = q * q * q, 3 * q * q * v, 3 * q * v * v, v * v * v
    r0 = work[net] * b0 + work[net + 1] * b1 + work[net + 2] * b2 + work[net + 3] * b3
    r1 = work[net + 4] * b0 + work[net + 5] * b1 + work[net + 6] * b2 + work[net + 7] * b3
    r2 = work[net + 8] * b0 + work[net + 9] * b1 + work[net + 10] * b2 + work[net + 11] * b3
    r3 = work[net + 12] * b0 + work[net + 13] * b1 + work[net + 14] * b2 + work[net + 15] * b3
    return p * p * p * r0 + 3 * p * p * u * r1 + 3 * p * u * u * r2 + u * u * u * r3


@lean
def value_slopes(work, net, u, v):
    """Value, ∂u and ∂v of a scalar net."""
    p, q = 1.0 - u, 1.0 - v
    b0, b1, b2, b3 = q * q * q, 3 * q * q * v, 3 * q * v * v, v * v * v
    c0, c1, c2 = 3 * q * q, 6 * q * v, 3 * v * v
    w0, w1, w2, w3 = work[net], work[net + 1], work[net + 2], work[net + 3]
    r0 = w0 * b0 + w1 * b1 + w2 * b2 + w3 * b3
    s0 = (w1 - w0) * c0 + (w2 - w1) * c1 + (w3 - w2) * c2
    w0, w1, w2, w3 = work[net + 4], work[net + 5], work[net + 6], work[net + 7]
    r1 = w0 * b0 + w1 * b1 + w2 * b2 + w3 * b3
    s1 = (w1 - w0) * c0 + (w2 - w1) * c1 + (w3 - w2) * c2
    w0, w1, w2, w3 = work[net + 8], work[net + 9], work[net + 10], work[net + 11]
    r2 = w0 * b0 + w1 * b1 + w2 * b2 + w3 * b3
    s2 = (w1 - w0) * c0 + (w2 - w1) * c1 + (w3 - w2) * c2
    w0, w1, w2, w3 = work[net + 12], work[net + 13], work[net + 14], work[net + 15]
    r3 = w0 * b0 + w1 * b1 + w2 * b2 + w3 * b3
    s3 = (w1 - w0) * c0 + (w2 - w1) * c1 + (w3 - w2) * c2
    a0, a1, a2, a3 = p * p * p, 3 * p * p * u, 3 * p * u * u, u * u * u
    d0, d1, d2 = 3 * p * p, 6 * p * u, 3 * u * u
    return (
        a0 * r0 + a1 * r1 + a2 * r2 + a3 * r3,
        (r1 - r0) * d0 + (r2 - r1) * d1 + (r3 - r2) * d2,
        a0 * s0 + a1 * s1 + a2 * s2 + a3 * s3,
    )


@lean
def newton(work, u, v):
    """Root of D near (u, v): (converged, u, v)."""
    last = 1.0
    for _ in range(12):
        f, fu, fv = value_slopes(work, D1, u, v)
        g, gu, gv = value_slopes(work, D2, u, v)
        det = fu * gv - fv * gu
        du = (gv * f - fv * g) / det
        dv = (fu * g - gu * f) / det
        step = max(abs(du), abs(dv))
        if not step < 2.0:  # also catches NaN
            return False, u, v
        u -= du
        v -= dv
        # Below 1e-9 one more quadratic step is exact; stalling there is rounding.
        if step < 1e-9 or (step < 1e-6 and step >= last):
            return True, u, v
        last = step
    return False, u, v
