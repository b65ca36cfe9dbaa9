"""Control nets in kernels: splitting, points, heights above the horizon, and the side seen.

Shifted nets are relative to the receiver (`contour.shift_net`).
"""

import math

import numpy as np

from .compiled import kernel, lean

PLANAR, CONVEX, CONCAVE, ALWAYS_FRONT = 1, 2, 4, 8


@lean
def copy_net(source, target):
    """Copy a net number by number: slices compile to far more code."""
    for i in range(4):
        for j in range(4):
            for k in range(4):
                target[i, j, k] = source[i, j, k]


@lean
def halve_u(s, low, high):
    """Split a net at u = 1/2 by de Casteljau."""
    for j in range(4):
        for k in range(4):
            a, b, c, d = s[0, j, k], s[1, j, k], s[2, j, k], s[3, j, k]
            ab, bc, cd = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d)
            abc, bcd = 0.5 * (ab + bc), 0.5 * (bc + cd)
            mid = 0.5 * (abc + bcd)
            low[0, j, k], low[1, j, k], low[2, j, k], low[3, j, k] = a, ab, abc, mid
            high[0, j, k], high[1, j, k], high[2, j, k], high[3, j, k] = mid, bcd, cd, d


@lean
def halve_v(s, low, high):
    """Split a net at v = 1/2 by de Casteljau."""
    for i in range(4):
        for k in range(4):
            a, b, c, d = s[i, 0, k], s[i, 1, k], s[i, 2, k], s[i, 3, k]
            ab, bc, cd = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d)
            abc, bcd = 0.5 * (ab + bc), 0.5 * (bc + cd)
            mid = 0.5 * (abc + bcd)
            low[i, 0, k], low[i, 1, k], low[i, 2, k], low[i, 3, k] = a, ab, abc, mid
            high[i, 0, k], high[i, 1, k], high[i, 2, k], high[i, 3, k] = mid, bcd, cd, d


@lean
def surface(s, u, v, h, hu, hv):
    """Homogeneous point and derivatives (3,) of the shifted net at (u, v)."""
    ru, rv = 1.0 - u, 1.0 - v
    bu0, bu1, bu2, bu3 = ru * ru * ru, 3.0 * u * ru * ru, 3.0 * u * u * ru, u * u * u
    bv0, bv1, bv2, bv3 = rv * rv * rv, 3.0 * v * rv * rv, 3.0 * v * v * rv, v * v * v
    du0, du1, du2, du3 = (
        -3.0 * ru * ru,
        3.0 * ru * (ru - 2.0 * u),
        3.0 * u * (2.0 * ru - u),
        3.0 * u * u,
    )
    dv0, dv1, dv2, dv3 = (
        -3.0 * rv * rv,
        3.0 * rv * (rv - 2.0 * v),
        3.0 * v * (2.0 * rv - v),
        3.0 * v * v,
    )
    for k in range(3):
        r0 = bv0 * s[0, 0, k] + bv1 * s[0, 1, k] + bv2 * s[0, 2, k] + bv3 * s[0, 3, k]
        r1 = bv0 * s[1, 0, k] + bv1 * s[1, 1, k] + bv2 * s[1, 2, k] + bv3 * s[1, 3, k]
        r2 = bv0 * s[2, 0, k] + bv1 * s[2, 1, k] + bv2 * s[2, 2, k] + bv3 * s[2, 3, k]
        r3 = bv0 * s[3, 0, k] + bv1 * s[3, 1, k] + bv2 * s[3, 2, k] + bv3 * s[3, 3, k]
        h[k] = bu0 * r0 + bu1 * r1 + bu2 * r2 + bu3 * r3
        hu[k] = du0 * r0 + du1 * r1 + du2 * r2 + du3 * r3
        q0 = dv0 * s[0, 0, k] + dv1 * s[0, 1, k] + dv2 * s[0, 2, k] + dv3 * s[0, 3, k]
        q1 = dv0 * s[1, 0, k] + dv1 * s[1, 1, k] + dv2 * s[1, 2, k] + dv3 * s[1, 3, k]
        q2 = dv0 * s[2, 0, k] + dv1 * s[2, 1, k] + dv2 * s[2, 2, k] + dv3 * s[2, 3, k]
        q3 = dv0 * s[3, 0, k] + dv1 * s[3, 1, k] + dv2 * s[3, 2, k] + dv3 * s[3, 3, k]
        hv[k] = bu0 * q0 + bu1 * q1 + bu2 * q2 + bu3 * q3


@lean
def weight_at(s, u, v):
    """Weight of the net at (u, v)."""
    ru, rv = 1.0 - u, 1.0 - v
    bu = (ru * ru * ru, 3.0 * u * ru * ru, 3.0 * u * u * ru, u * u * u)
    bv = (rv * rv * rv, 3.0 * v * rv * rv, 3.0 * v * v * rv, v * v * v)
    w = 0.0
    for a in range(4):
        for c in range(4):
            w += bu[a] * bv[c] * s[a, c, 3]
    return w


@lean
def facing_at(s, u, v, h, hu, hv):
    """Positive where the receiver is on the + side at (u, v): −det(H, H_u, H_v)."""
    surface(s, u, v, h, hu, hv)
    return -(
        h[0] * (hu[1] * hv[2] - hu[2] * hv[1])
        + h[1] * (hu[2] * hv[0] - hu[0] * hv[2])
        + h[2] * (hu[0] * hv[1] - hu[1] * hv[0])
    )


@lean
def heights(s, n):
    """Least and largest n · H of the boundary and of the interior control vectors."""
    low = inner = 1e300
    high = -1e300
    for i in range(4):
        for j in range(4):
            d = n[0] * s[i, j, 0] + n[1] * s[i, j, 1] + n[2] * s[i, j, 2]
            high = max(high, d)
            if 0 < i < 3 and 0 < j < 3:
                inner = min(inner, d)
            else:
                low = min(low, d)
    return low, inner, high


@lean
def extremes(values):
    """Least and largest of an array (m, n)."""
    low = high = values[0, 0]
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            low, high = min(low, values[i, j]), max(high, values[i, j])
    return low, high


@lean
def _corner_normal(s, i, j, out):
    """Normal direction at a corner of the net from the first control vectors that span one."""
    si, sj = (1 if i == 0 else -1), (1 if j == 0 else -1)
    w0 = s[i, j, 3]
    # What is no longer than this is the rounding of a collapsed side, seen from far away.
    nothing = 1e-12 * w0 * (abs(s[i, j, 0]) + abs(s[i, j, 1]) + abs(s[i, j, 2]))
    for step in range(3):
        # At a collapsed side the next row of control points gives the limit.
        a, b = i + si, j + sj
        ui, uj, vi, vj = a, j, i, b
        if step == 1:
            vi, vj = i + si, b
        elif step == 2:
            ui, uj = a, j + sj
        ax = s[ui, uj, 0] * w0 - s[i, j, 0] * s[ui, uj, 3]
        ay = s[ui, uj, 1] * w0 - s[i, j, 1] * s[ui, uj, 3]
        az = s[ui, uj, 2] * w0 - s[i, j, 2] * s[ui, uj, 3]
        bx = s[vi, vj, 0] * w0 - s[i, j, 0] * s[vi, vj, 3]
        by = s[vi, vj, 1] * w0 - s[i, j, 1] * s[vi, vj, 3]
        bz = s[vi, vj, 2] * w0 - s[i, j, 2] * s[vi, vj, 3]
        out[0] = (ay * bz - az * by) * si * sj
        out[1] = (az * bx - ax * bz) * si * sj
        out[2] = (ax * by - ay * bx) * si * sj
        size = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
        long_a, long_b = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
        if long_a <= nothing * nothing or long_b <= nothing * nothing:
            continue
        spread = math.sqrt(long_a * long_b)
        if size > 1e-9 * spread and size > 0.0:
            out[0] /= size
            out[1] /= size
            out[2] /= size
            return True
    return False


@lean
def _is_flat(s, normal):
    """Whether all control points of a net lie in one plane, to 1e-7 of its size."""
    high = size = 0.0
    w0 = s[0, 0, 3]
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            dx = s[i, j, 0] * w0 - s[0, 0, 0] * w
            dy = s[i, j, 1] * w0 - s[0, 0, 1] * w
            dz = s[i, j, 2] * w0 - s[0, 0, 2] * w
            high = max(high, abs(normal[0] * dx + normal[1] * dy + normal[2] * dz))
            size = max(size, max(abs(dx), max(abs(dy), abs(dz))))
    return high <= 1e-7 * size


@kernel
def normal_cone(s, cone):
    """Axis (3) and sine of the half-angle of a cone about the normals of a net into ``cone`` (4).

    From the four corner normals and the centre, widened by a quarter and 0.01; a half-angle of 90
    degrees or more is given as 2, which decides nothing.
    """
    normals = np.empty((5, 3))
    count = 0
    for i in (0, 3):
        for j in (0, 3):
            if _corner_normal(s, i, j, normals[count]):
                count += 1
    h, hu, hv = np.empty(3), np.empty(3), np.empty(3)
    surface(s, 0.5, 0.5, h, hu, hv)
    w = 0.0
    wu = 0.0
    wv = 0.0
    b = (0.125, 0.375, 0.375, 0.125)
    d = (-0.75, -0.75, 0.75, 0.75)
    for i in range(4):
        for j in range(4):
            w += b[i] * b[j] * s[i, j, 3]
            wu += d[i] * b[j] * s[i, j, 3]
            wv += b[i] * d[j] * s[i, j, 3]
    for k in range(3):
        hu[k] = hu[k] * w - h[k] * wu
        hv[k] = hv[k] * w - h[k] * wv
    nx = hu[1] * hv[2] - hu[2] * hv[1]
    ny = hu[2] * hv[0] - hu[0] * hv[2]
    nz = hu[0] * hv[1] - hu[1] * hv[0]
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if size > 0.0:
        normals[count, 0], normals[count, 1], normals[count, 2] = nx / size, ny / size, nz / size
        count += 1
    ax = ay = az = 0.0
    for m in range(count):
        ax += normals[m, 0]
        ay += normals[m, 1]
        az += normals[m, 2]
    size = math.sqrt(ax * ax + ay * ay + az * az)
    cone[3] = 2.0
    if size == 0.0:
        return
    cone[0], cone[1], cone[2] = ax / size, ay / size, az / size
    low = 1.0
    for m in range(count):
        low = min(low, cone[0] * normals[m, 0] + cone[1] * normals[m, 1] + cone[2] * normals[m, 2])
    if low > 0.2:
        sine = math.sqrt(max(0.0, 1.0 - low * low))
        cone[3] = 1.25 * sine + 0.01
        if sine < 1e-7 and _is_flat(s, cone):
            cone[3] = 0.0


@lean
def facing_of(s, cone, rounding):
    """Side of the shifted net seen from the origin: 1 front, −1 back or edge-on, 0 undecided."""
    front, back = True, True
    for i in range(4):
        for j in range(4):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            d = -(x * cone[0] + y * cone[1] + z * cone[2])
            size = math.sqrt(x * x + y * y + z * z)
            slack = size * cone[3]
            if d <= slack + rounding:
                front = False
            if d >= -slack + rounding:
                back = False
    if cone[3] == 0.0 and not front:
        # One plane: either in front of it or not lit at all, whatever the rounding says.
        return -1
    if front:
        return 1
    return -1 if back else 0
