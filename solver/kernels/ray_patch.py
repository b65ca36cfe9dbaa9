"""Ray against one rational bicubic patch: the exact surface, no triangles.

The ray is the meeting of two planes, n1·(x − o) = 0 and n2·(x − o) = 0. Put into the homogeneous
net, each plane gives a scalar bicubic in Bernstein form, D_k = n_k·(X − o w), free of divisions,
and the ray meets the patch where D_1 = D_2 = 0 [1]. Boxes of (u, v) are tested with the convex
hull of their coefficients, always taken from the original ones. With J the mean slope of
D = (D_1, D_2) over a box, the Bernstein coefficients of g = (u, v) − J⁻¹ D bound g over the box,
and every root is a fixed point of g. So a box disjoint from its image holds no root, any other may
be clipped to the image, and a box on which g contracts holds one root at most [2, sec. 5.1], which
Newton's iteration then finds.

Everything is accepted within the rounding error of the coefficients, so that a ray through an edge
that two patches share hits at least one of them.

.. [1] T. Nishita, T. W. Sederberg and M. Kakimoto, "Ray tracing trimmed rational surface
   patches", Computer Graphics (SIGGRAPH) 24(4), 1990, pp. 337-345.
.. [2] A. Neumaier, "Interval Methods for Systems of Equations", Cambridge University Press, 1990.
.. [3] T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
"""

import math

import numba as nb
import numpy as np

#: Results of a test; undecided means that the bound on the work was reached at a possible hit.
MISS, HIT, UNDECIDED = 0, 1, 2
#: Kinds of patches, see `classify_patches`.
GENERAL, FLAT_QUAD = 0, 1

#: Length of the scratch array one ray needs.
WORK = 640
_D1, _D2, _T, _W, _S1, _S2, _ROWS, _STACK = 16, 32, 48, 64, 80, 96, 112, 128
_STACK_SIZE = (WORK - _STACK) // 4
#: Boxes looked at before giving up; a tangent ray needs about 150.
_MAX_BOXES = 1000
_EPS = 2.220446049250313e-16
#: Rounding of a coefficient n·(X − o w) relative to the size of its terms.
_ROUNDING = 16.0 * _EPS
#: Largest tolerance in parameters, for rays along the surface.
_MAX_TOLERANCE = 1e-5


@nb.njit(cache=True, error_model="numpy")
def setup_ray(ox, oy, oz, dx, dy, dz, work):
    """Store the ray and two unit normals of planes through it, n1 × n2 along d [3], in ``work``."""
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


@nb.njit(cache=True, error_model="numpy")
def _load(net, work):
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
            work[_D1 + k] = ax * x + ay * y + az * z
            work[_D2 + k] = bx * x + by * y + bz * z
            work[_T + k] = (dx * x + dy * y + dz * z) * inverse
            work[_W + k] = w
            size = abs(net[i, j, 0]) + abs(net[i, j, 1]) + abs(net[i, j, 2]) + origin * w
            scale = max(scale, size)
    return _ROUNDING * scale


@nb.njit(cache=True, error_model="numpy")
def _sub_net(work, source, target, u0, u1, v0, v1):
    """Coefficients on [u0, u1] x [v0, v1] from those on the unit square, by blossoms."""
    a, b = u0, u1
    p, q = 1.0 - a, 1.0 - b
    for j in range(4):
        c0, c1 = work[source + j], work[source + 4 + j]
        c2, c3 = work[source + 8 + j], work[source + 12 + j]
        work[_ROWS + j] = p * p * p * c0 + 3 * p * p * a * c1 + 3 * p * a * a * c2 + a * a * a * c3
        work[_ROWS + 4 + j] = (
            p * p * q * c0
            + (p * p * b + 2 * p * a * q) * c1
            + (a * a * q + 2 * p * a * b) * c2
            + a * a * b * c3
        )
        work[_ROWS + 8 + j] = (
            q * q * p * c0
            + (q * q * a + 2 * q * b * p) * c1
            + (b * b * p + 2 * q * b * a) * c2
            + b * b * a * c3
        )
        work[_ROWS + 12 + j] = (
            q * q * q * c0 + 3 * q * q * b * c1 + 3 * q * b * b * c2 + b * b * b * c3
        )
    a, b = v0, v1
    p, q = 1.0 - a, 1.0 - b
    for i in range(4):
        r, s = _ROWS + 4 * i, target + 4 * i
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


@nb.njit(cache=True, error_model="numpy")
def _value(work, net, u, v):
    """Value of a scalar net."""
    p, q = 1.0 - u, 1.0 - v
    b0, b1, b2, b3 = q * q * q, 3 * q * q * v, 3 * q * v * v, v * v * v
    r0 = work[net] * b0 + work[net + 1] * b1 + work[net + 2] * b2 + work[net + 3] * b3
    r1 = work[net + 4] * b0 + work[net + 5] * b1 + work[net + 6] * b2 + work[net + 7] * b3
    r2 = work[net + 8] * b0 + work[net + 9] * b1 + work[net + 10] * b2 + work[net + 11] * b3
    r3 = work[net + 12] * b0 + work[net + 13] * b1 + work[net + 14] * b2 + work[net + 15] * b3
    return p * p * p * r0 + 3 * p * p * u * r1 + 3 * p * u * u * r2 + u * u * u * r3


@nb.njit(cache=True, error_model="numpy")
def _value_slopes(work, net, u, v):
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


@nb.njit(cache=True, error_model="numpy")
def _newton(work, u, v):
    """Root of D near (u, v): (converged, u, v, determinant of the slopes)."""
    last = 1.0
    for _ in range(12):
        f, fu, fv = _value_slopes(work, _D1, u, v)
        g, gu, gv = _value_slopes(work, _D2, u, v)
        det = fu * gv - fv * gu
        du = (gv * f - fv * g) / det
        dv = (fu * g - gu * f) / det
        step = max(abs(du), abs(dv))
        if not step < 2.0:  # also catches NaN
            return False, u, v, det
        u -= du
        v -= dv
        # Below 1e-9 one more quadratic step is exact; stalling there is rounding.
        if step < 1e-9 or (step < 1e-6 and step >= last):
            return True, u, v, det
        last = step
    return False, u, v, 0.0


@nb.njit(cache=True, error_model="numpy")
def _edge_on(work, error):
    """Whether the ray sees the patch as a line within rounding: it has no area to hit."""
    best, k = -1.0, 0
    for i in range(16):
        r = abs(work[_D1 + i]) + abs(work[_D2 + i])
        if r > best:
            best, k = r, i
    a, b = work[_D1 + k], work[_D2 + k]
    for i in range(16):
        if abs(a * work[_D2 + i] - b * work[_D1 + i]) > best * error:
            return False
    return True


@nb.njit(cache=True, error_model="numpy")
def hit_general(net, box_u0, box_u1, box_v0, box_v1, t_min, t_max, facing_filter, find_any, work):
    """Nearest (or any) hit of the ray in ``work`` with the given parameter box of the patch.

    Returns (status, t, u, v, facing) as `ray_patch`.
    """
    error = _load(net, work)
    status, t_hit, u_hit, v_hit, facing_hit = MISS, t_max, 0.0, 0.0, 0
    below = True
    for k in range(16):
        if work[_T + k] >= t_min * work[_W + k]:
            below = False
            break
    if below:
        return status, t_hit, u_hit, v_hit, facing_hit
    beyond = True
    for k in range(16):
        if work[_T + k] <= t_max * work[_W + k]:
            beyond = False
            break
    if beyond:
        return status, t_hit, u_hit, v_hit, facing_hit

    work[_STACK], work[_STACK + 1] = box_u0, box_u1
    work[_STACK + 2], work[_STACK + 3] = box_v0, box_v1
    top = 1
    for count in range(_MAX_BOXES):
        if top == 0:
            break
        if count == 48 and _edge_on(work, error):
            return MISS, t_max, 0.0, 0.0, 0
        top -= 1
        at = _STACK + 4 * top
        u0, u1, v0, v1 = work[at], work[at + 1], work[at + 2], work[at + 3]
        _sub_net(work, _D1, _S1, u0, u1, v0, v1)
        low, high = work[_S1], work[_S1]
        for k in range(1, 16):
            low = min(low, work[_S1 + k])
            high = max(high, work[_S1 + k])
        if low > error or high < -error:
            continue
        size = max(high, -low)
        _sub_net(work, _D2, _S2, u0, u1, v0, v1)
        low, high = work[_S2], work[_S2]
        for k in range(1, 16):
            low = min(low, work[_S2 + k])
            high = max(high, work[_S2 + k])
        if low > error or high < -error:
            continue
        size = max(size, max(high, -low))

        # Mean slopes over the box, in its own coordinates 0 … 1.
        fu = 0.5 * (work[_S1 + 12] + work[_S1 + 15] - work[_S1] - work[_S1 + 3])
        fv = 0.5 * (work[_S1 + 3] + work[_S1 + 15] - work[_S1] - work[_S1 + 12])
        gu = 0.5 * (work[_S2 + 12] + work[_S2 + 15] - work[_S2] - work[_S2 + 3])
        gv = 0.5 * (work[_S2 + 3] + work[_S2 + 15] - work[_S2] - work[_S2 + 12])
        det = fu * gv - fv * gu
        found, u, v, slope = False, 0.5 * (u0 + u1), 0.5 * (v0 + v1), 0.0
        clipped = False
        if size <= error:
            # The whole box lies on the ray within rounding.
            found = True
            _, fu, fv = _value_slopes(work, _D1, u, v)
            _, gu, gv = _value_slopes(work, _D2, u, v)
            slope = fu * gv - fv * gu
        elif det != 0.0:
            a11, a12, a21, a22 = gv / det, -fv / det, -gu / det, fu / det
            ulo, uhi, vlo, vhi = math.inf, -math.inf, math.inf, -math.inf
            g1u, g1v, g2u, g2v = 0.0, 0.0, 0.0, 0.0
            for i in range(4):
                for j in range(4):
                    k = 4 * i + j
                    f, g = work[_S1 + k], work[_S2 + k]
                    x = i / 3.0 - a11 * f - a12 * g
                    y = j / 3.0 - a21 * f - a22 * g
                    work[_S1 + k], work[_S2 + k] = x, y
                    ulo, uhi = min(ulo, x), max(uhi, x)
                    vlo, vhi = min(vlo, y), max(vhi, y)
                    if i > 0:
                        g1u = max(g1u, abs(x - work[_S1 + k - 4]))
                        g2u = max(g2u, abs(y - work[_S2 + k - 4]))
                    if j > 0:
                        g1v = max(g1v, abs(x - work[_S1 + k - 1]))
                        g2v = max(g2v, abs(y - work[_S2 + k - 1]))
            tol_u = min(error * (abs(a11) + abs(a12)) + 4 * _EPS / (u1 - u0), _MAX_TOLERANCE)
            tol_v = min(error * (abs(a21) + abs(a22)) + 4 * _EPS / (v1 - v0), _MAX_TOLERANCE)
            if uhi < -tol_u or ulo > 1.0 + tol_u or vhi < -tol_v or vlo > 1.0 + tol_v:
                continue
            wide_u, wide_v = uhi - ulo, vhi - vlo
            ulo, uhi = max(ulo - tol_u, 0.0), min(uhi + tol_u, 1.0)
            vlo, vhi = max(vlo - tol_v, 0.0), min(vhi + tol_v, 1.0)
            if max(3.0 * (g1u + g1v), 3.0 * (g2u + g2v)) < 0.9 and max(wide_u, wide_v) < 0.5:
                # At most one root in this box.
                du, dv = u1 - u0, v1 - v0
                ok, u, v, slope = _newton(
                    work, u0 + 0.5 * (ulo + uhi) * du, v0 + 0.5 * (vlo + vhi) * dv
                )
                if ok:
                    x, y = (u - u0) / du, (v - v0) / dv
                    found = x >= -tol_u and x <= 1.0 + tol_u and y >= -tol_v and y <= 1.0 + tol_v
            if not found and (uhi - ulo) * (vhi - vlo) < 0.7:
                # A box that would become a line keeps some width, so that slopes stay defined.
                if uhi - ulo < 0.02:
                    ulo = max(0.0, min(0.5 * (ulo + uhi) - 0.01, 0.98))
                    uhi = ulo + 0.02
                if vhi - vlo < 0.02:
                    vlo = max(0.0, min(0.5 * (vlo + vhi) - 0.01, 0.98))
                    vhi = vlo + 0.02
                clipped = True
        if found:
            t = _value(work, _T, u, v) / _value(work, _W, u, v)
            facing = -1 if slope > 0.0 else (1 if slope < 0.0 else 0)
            if t > t_min and t < t_hit and facing * facing_filter >= 0:
                status, t_hit, facing_hit = HIT, t, facing
                u_hit, v_hit = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
                if find_any:
                    break
            continue
        if clipped:
            du, dv = u1 - u0, v1 - v0
            a, b = u0 + ulo * du, u0 + uhi * du
            c, d = v0 + vlo * dv, v0 + vhi * dv
            if (b > a and d > c) and (b < u1 or a > u0 or d < v1 or c > v0):
                work[at], work[at + 1], work[at + 2], work[at + 3] = a, b, c, d
                top += 1
                continue
        # Halve the direction in which the box is longer as the ray sees it.
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        can_u, can_v = um > u0 and um < u1, vm > v0 and vm < v1
        if top + 2 > _STACK_SIZE or not (can_u or can_v):
            t = _value(work, _T, um, vm) / _value(work, _W, um, vm)
            if t > t_min and t < t_hit:
                status, t_hit, u_hit, v_hit, facing_hit = UNDECIDED, t, um, vm, 0
            continue
        if _longer_in_u(work, u0, u1, v0, v1) and can_u or not can_v:
            work[at], work[at + 1], work[at + 2], work[at + 3] = u0, um, v0, v1
            work[at + 4], work[at + 5], work[at + 6], work[at + 7] = um, u1, v0, v1
        else:
            work[at], work[at + 1], work[at + 2], work[at + 3] = u0, u1, v0, vm
            work[at + 4], work[at + 5], work[at + 6], work[at + 7] = u0, u1, vm, v1
        top += 2
    if top > 0 and status == MISS:
        at = _STACK + 4 * (top - 1)
        u, v = 0.5 * (work[at] + work[at + 1]), 0.5 * (work[at + 2] + work[at + 3])
        t = _value(work, _T, u, v) / _value(work, _W, u, v)
        if t > t_min and t < t_max:
            status, t_hit, u_hit, v_hit = UNDECIDED, t, u, v
    return status, t_hit, u_hit, v_hit, facing_hit


@nb.njit(cache=True, error_model="numpy")
def _longer_in_u(work, u0, u1, v0, v1):
    """Whether the box extends further along u than along v across the ray."""
    size_u, size_v = 0.0, 0.0
    for net in (_D1, _D2):
        c00, c10 = _value(work, net, u0, v0), _value(work, net, u1, v0)
        c01, c11 = _value(work, net, u0, v1), _value(work, net, u1, v1)
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        mid = _value(work, net, um, vm)
        # The middle counts too: opposite edges may coincide (a half circle seen from its axis).
        a, b = abs(_value(work, net, u0, vm) - mid), abs(_value(work, net, u1, vm) - mid)
        size_u += max(max(abs(c10 - c00), abs(c11 - c01)), a + b)
        a, b = abs(_value(work, net, um, v0) - mid), abs(_value(work, net, um, v1) - mid)
        size_v += max(max(abs(c01 - c00), abs(c11 - c10)), a + b)
    return size_u >= size_v


@nb.njit(cache=True, error_model="numpy")
def hit_quad(net, t_min, t_max, work):
    """Ray in ``work`` against a `FLAT_QUAD`: (hit, t, facing); u and v by `quad_parameters`.

    The four edge tests are 2 x 2 determinants of homogeneous coordinates across the ray. Swapping
    the ends of an edge only flips their sign, so two quads sharing an edge cannot both miss.
    """
    ox, oy, oz = work[0], work[1], work[2]
    ax, ay, az = work[6], work[7], work[8]
    bx, by, bz = work[9], work[10], work[11]
    w0, w1, w2, w3 = net[0, 0, 3], net[3, 0, 3], net[3, 3, 3], net[0, 3, 3]
    x0, y0, z0 = net[0, 0, 0] - ox * w0, net[0, 0, 1] - oy * w0, net[0, 0, 2] - oz * w0
    x1, y1, z1 = net[3, 0, 0] - ox * w1, net[3, 0, 1] - oy * w1, net[3, 0, 2] - oz * w1
    x2, y2, z2 = net[3, 3, 0] - ox * w2, net[3, 3, 1] - oy * w2, net[3, 3, 2] - oz * w2
    x3, y3, z3 = net[0, 3, 0] - ox * w3, net[0, 3, 1] - oy * w3, net[0, 3, 2] - oz * w3
    f0, g0 = ax * x0 + ay * y0 + az * z0, bx * x0 + by * y0 + bz * z0
    f1, g1 = ax * x1 + ay * y1 + az * z1, bx * x1 + by * y1 + bz * z1
    f2, g2 = ax * x2 + ay * y2 + az * z2, bx * x2 + by * y2 + bz * z2
    f3, g3 = ax * x3 + ay * y3 + az * z3, bx * x3 + by * y3 + bz * z3
    s0, s1 = f0 * g1 - g0 * f1, f1 * g2 - g1 * f2
    s2, s3 = f2 * g3 - g2 * f3, f3 * g0 - g3 * f0
    origin = abs(ox) + abs(oy) + abs(oz)
    error = _ROUNDING * max(
        max(abs(net[0, 0, 0]) + abs(net[0, 0, 1]) + abs(net[0, 0, 2]) + origin * w0,
            abs(net[3, 0, 0]) + abs(net[3, 0, 1]) + abs(net[3, 0, 2]) + origin * w1),
        max(abs(net[3, 3, 0]) + abs(net[3, 3, 1]) + abs(net[3, 3, 2]) + origin * w2,
            abs(net[0, 3, 0]) + abs(net[0, 3, 1]) + abs(net[0, 3, 2]) + origin * w3),
    )  # fmt: skip
    e0 = error * (abs(f1 - f0) + abs(g1 - g0))
    e1 = error * (abs(f2 - f1) + abs(g2 - g1))
    e2 = error * (abs(f3 - f2) + abs(g3 - g2))
    e3 = error * (abs(f0 - f3) + abs(g0 - g3))
    inside = s0 >= -e0 and s1 >= -e1 and s2 >= -e2 and s3 >= -e3
    if not inside and not (s0 <= e0 and s1 <= e1 and s2 <= e2 and s3 <= e3):
        return False, t_max, 0
    # Plane from the diagonals: defined as long as the quad has area.
    px, py, pz = x2 / w2 - x0 / w0, y2 / w2 - y0 / w0, z2 / w2 - z0 / w0
    qx, qy, qz = x3 / w3 - x1 / w1, y3 / w3 - y1 / w1, z3 / w3 - z1 / w1
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    slope = nx * work[3] + ny * work[4] + nz * work[5]
    length = math.sqrt((nx * nx + ny * ny + nz * nz) * work[12])
    if abs(slope) <= 8.0 * _EPS * length:
        return False, t_max, 0  # seen edge-on, without area
    t = (nx * x0 + ny * y0 + nz * z0) / w0 / slope
    if not (t > t_min and t < t_max):
        return False, t_max, 0
    return True, t, (-1 if slope > 0.0 else 1)


@nb.njit(cache=True, error_model="numpy")
def quad_parameters(net, work):
    """Parameters (u, v) at which the ray in ``work`` hits a `FLAT_QUAD`."""
    _load(net, work)
    u, v = 0.5, 0.5
    for _ in range(30):
        f, fu, fv = _value_slopes(work, _D1, u, v)
        g, gu, gv = _value_slopes(work, _D2, u, v)
        det = fu * gv - fv * gu
        if det == 0.0:
            break
        a = min(max(u - (gv * f - fv * g) / det, 0.0), 1.0)
        b = min(max(v - (fu * g - gu * f) / det, 0.0), 1.0)
        step = max(abs(a - u), abs(b - v))
        u, v = a, b
        if step < 1e-14:
            break
    return u, v


@nb.njit(cache=True, error_model="numpy")
def ray_patch(net, kind, ox, oy, oz, dx, dy, dz, t_min, t_max, work):
    """Nearest hit of o + t d with the exact patch, t_min < t < t_max.

    Parameters
    ----------
    net : (4, 4, 4) array
        Homogeneous control net, all weights positive. [m]
    kind : int
        From `classify_patches`.
    ox, oy, oz, dx, dy, dz : float
        Ray; d need not be a unit vector.
    work : (WORK,) array
        Scratch.

    Returns
    -------
    status, t, u, v, facing
        `MISS`, `HIT` or `UNDECIDED` (bound on the work reached; best estimate given); distance in
        units of |d|; parameters; +1 when d runs against the +normal, −1 along it, 0 tangent.
    """
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    if kind == FLAT_QUAD:
        hit, t, facing = hit_quad(net, t_min, t_max, work)
        if not hit:
            return MISS, t_max, 0.0, 0.0, 0
        u, v = quad_parameters(net, work)
        return HIT, t, u, v, facing
    return hit_general(net, 0.0, 1.0, 0.0, 1.0, t_min, t_max, 0, False, work)


@nb.njit(cache=True, error_model="numpy")
def ray_patch_any(net, kind, ox, oy, oz, dx, dy, dz, t_min, t_max, facing_filter, work):
    """Whether the ray hits the patch at all; see `ray_patch`.

    ``facing_filter`` 0 takes any hit, +1 only those with d·normal < 0, −1 those with d·normal > 0.
    """
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    if kind == FLAT_QUAD:
        hit, _, facing = hit_quad(net, t_min, t_max, work)
        return HIT if hit and facing * facing_filter >= 0 else MISS
    status, _, _, _, _ = hit_general(
        net, 0.0, 1.0, 0.0, 1.0, t_min, t_max, facing_filter, True, work
    )
    return status


@nb.njit(cache=True, error_model="numpy")
def classify_patches(nets):
    """Kinds (p,) of nets (p, 4, 4, 4): `FLAT_QUAD` for a flat convex quad with straight edges.

    Convex corners and monotone edges make the patch cover exactly its quad when its parameters do
    not fold; folding is excluded by the signs of all products of control-net differences.
    """
    n = nets.shape[0]
    kinds = np.zeros(n, dtype=np.int64)
    points = np.empty((4, 4, 3))
    for p in range(n):
        size = 0.0
        for i in range(4):
            for j in range(4):
                for k in range(3):
                    points[i, j, k] = nets[p, i, j, k] / nets[p, i, j, 3]
        for i in range(4):
            for j in range(4):
                for k in range(3):
                    size = max(size, abs(points[i, j, k] - points[0, 0, k]))
        if _is_flat_quad(points, size):
            kinds[p] = FLAT_QUAD
    return kinds


@nb.njit(cache=True, error_model="numpy")
def _is_flat_quad(points, size):
    tolerance = 1e-13 * size
    for k in range(3):
        for i in range(4):
            for j in range(4):
                tolerance = max(tolerance, 2 * _EPS * abs(points[i, j, k]))
    p, q = points[3, 3] - points[0, 0], points[0, 3] - points[3, 0]
    nx, ny, nz = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return False
    nx, ny, nz = nx / length, ny / length, nz / length
    center = 0.25 * (points[0, 0] + points[3, 0] + points[3, 3] + points[0, 3])
    flat = np.empty((4, 4, 2))
    # Coordinates in the plane along its longest diagonal.
    r = p if np.sum(p * p) >= np.sum(q * q) else q
    r = r / math.sqrt(np.sum(r * r))
    for i in range(4):
        for j in range(4):
            x, y, z = points[i, j] - center
            if abs(nx * x + ny * y + nz * z) > tolerance:
                return False
            flat[i, j, 0] = r[0] * x + r[1] * y + r[2] * z
            flat[i, j, 1] = (
                (ny * r[2] - nz * r[1]) * x
                + (nz * r[0] - nx * r[2]) * y
                + (nx * r[1] - ny * r[0]) * z
            )
    # Straight edges: both inner control points on the chord, in order.
    for side in range(4):
        for k in range(1, 3):
            if side == 0:
                a, b, c, d = flat[0, 0], flat[k, 0], flat[3, 0], flat[k - 1, 0]
            elif side == 1:
                a, b, c, d = flat[3, 0], flat[3, k], flat[3, 3], flat[3, k - 1]
            elif side == 2:
                a, b, c, d = flat[0, 3], flat[k, 3], flat[3, 3], flat[k - 1, 3]
            else:
                a, b, c, d = flat[0, 0], flat[0, k], flat[0, 3], flat[0, k - 1]
            cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            chord = math.hypot(c[0] - a[0], c[1] - a[1])
            if abs(cross) > tolerance * chord + tolerance * tolerance:
                return False
            forward = (b[0] - d[0]) * (c[0] - a[0]) + (b[1] - d[1]) * (c[1] - a[1])
            rest = (c[0] - b[0]) * (c[0] - a[0]) + (c[1] - b[1]) * (c[1] - a[1])
            if forward < 0.0 or rest < 0.0:
                return False
    # Convex corners.
    ring = np.empty((4, 2))
    ring[0], ring[1], ring[2], ring[3] = flat[0, 0], flat[3, 0], flat[3, 3], flat[0, 3]
    for k in range(4):
        a, b, c = ring[k], ring[(k + 1) % 4], ring[(k + 2) % 4]
        cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        if cross < -tolerance * size:
            return False
    return _does_not_fold(flat, tolerance * size)


@nb.njit(cache=True, error_model="numpy")
def _does_not_fold(flat, slack):
    """Whether all inner control points stay inside: differences along u and v turn one way."""
    for i in range(3):
        for j in range(4):
            ux, uy = flat[i + 1, j, 0] - flat[i, j, 0], flat[i + 1, j, 1] - flat[i, j, 1]
            for a in range(4):
                for b in range(3):
                    vx = flat[a, b + 1, 0] - flat[a, b, 0]
                    vy = flat[a, b + 1, 1] - flat[a, b, 1]
                    if ux * vy - uy * vx < -slack:
                        return False
    return True
