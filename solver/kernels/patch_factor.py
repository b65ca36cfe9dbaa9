"""Form factor from a point to a whole curved net: facing, silhouettes and the horizon.

The contour of `contour.contour_factor` is right only where the net is seen from its + side
throughout and does not dip through the horizon inside its boundary. Elsewhere the net is
quartered; a small piece that still shows both sides is cut along its silhouette, the curve where
N · (x − P) = 0, taken as a chord in (u, v). At the silhouette the integrand of the form factor
vanishes, so a displacement δ of the cut changes the factor by O(δ²) only: with pieces of angle θ
the error falls as θ⁴.
"""

import math

import numba as nb
import numpy as np

from .contour import (
    GAUSS_NODES,
    GAUSS_START,
    GAUSS_WEIGHTS,
    contour_factor,
    cubic_point,
    edge_term,
    load_edge,
)

PLANAR, CONVEX, CONCAVE, ALWAYS_FRONT = 1, 2, 4, 8

#: Quarterings of a net nearer than its cells are large.
_DEEPEST_NEAR = 22
#: Cells that may wait on a quadtree stack: three for each level and four new ones.
_STACK = 3 * _DEEPEST_NEAR + 4
#: How far inside its edges the facing of a net is asked, in parameters.
_INWARDS = 1e-5
_TWO_PI = 2.0 * math.pi


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def facing_at(s, u, v, h, hu, hv):
    """Positive where the receiver is on the + side at (u, v): −det(H, H_u, H_v)."""
    surface(s, u, v, h, hu, hv)
    return -(
        h[0] * (hu[1] * hv[2] - hu[2] * hv[1])
        + h[1] * (hu[2] * hv[0] - hu[0] * hv[2])
        + h[2] * (hu[0] * hv[1] - hu[1] * hv[0])
    )


@nb.njit(cache=True, error_model="numpy")
def _corner_normal(s, i, j, out):
    """Normal direction at a corner of the net from the first control vectors that span one."""
    si, sj = (1 if i == 0 else -1), (1 if j == 0 else -1)
    w0 = s[i, j, 3]
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
        spread = math.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
        if size > 1e-9 * spread and size > 0.0:
            out[0] /= size
            out[1] /= size
            out[2] /= size
            return True
    return False


@nb.njit(cache=True, error_model="numpy")
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
        cone[3] = 0.0 if sine < 1e-7 else 1.25 * sine + 0.01


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def _edge_facing(s, k, t, h, hu, hv):
    """`facing_at` boundary edge ``k`` of `contour.load_edge`, a little inwards of it.

    On a collapsed edge (a pole) itself the derivatives vanish and tell nothing.
    """
    if k == 0:
        u, v = t, 0.0
    elif k == 1:
        u, v = 1.0, t
    elif k == 2:
        u, v = 1.0 - t, 1.0
    else:
        u, v = 0.0, 1.0 - t
    u = min(max(u, _INWARDS), 1.0 - _INWARDS)
    v = min(max(v, _INWARDS), 1.0 - _INWARDS)
    return facing_at(s, u, v, h, hu, hv)


@nb.njit(cache=True, error_model="numpy")
def _front_count(s, at, g, h, hu, hv):
    """How many of four edge points, at ``at`` of each edge, show the + side; facings into ``g``."""
    count = 0
    for k in range(4):
        g[k] = _edge_facing(s, k, at, h, hu, hv)
        if g[k] > 0.0:
            count += 1
    return count


@nb.njit(cache=True, error_model="numpy")
def _is_near(s, angle):
    """Whether the net is seen under more than ``angle`` [rad], estimated from its corners."""
    mx = my = mz = 0.0
    for i in (0, 3):
        for j in (0, 3):
            w = s[i, j, 3]
            if w <= 0.0:
                return False
            mx += 0.25 * s[i, j, 0] / w
            my += 0.25 * s[i, j, 1] / w
            mz += 0.25 * s[i, j, 2] / w
    reach2 = 0.0
    for i in (0, 3):
        for j in (0, 3):
            w = s[i, j, 3]
            dx, dy, dz = s[i, j, 0] / w - mx, s[i, j, 1] / w - my, s[i, j, 2] / w - mz
            reach2 = max(reach2, dx * dx + dy * dy + dz * dz)
    return 4.0 * reach2 > angle * angle * (mx * mx + my * my + mz * mz)


@nb.njit(cache=True, error_model="numpy")
def _on_edge(s, c, h):
    """Whether the receiver lies on the boundary of a small net, to 1e-6 of its edges."""
    for k in range(4):
        load_edge(s, k, c)
        dx, dy, dz = c[3, 0] - c[0, 0], c[3, 1] - c[0, 1], c[3, 2] - c[0, 2]
        size2 = dx * dx + dy * dy + dz * dz
        if size2 == 0.0:
            continue
        t = -(c[0, 0] * dx + c[0, 1] * dy + c[0, 2] * dz) / size2
        for _ in range(4):
            t = min(max(t, 0.0), 1.0)
            cubic_point(c, t, h)
            t -= (h[0] * dx + h[1] * dy + h[2] * dz) / size2
        if h[0] * h[0] + h[1] * h[1] + h[2] * h[2] <= 1e-12 * size2:
            return True
    return False


@nb.njit(cache=True, error_model="numpy")
def _silhouette_leaf(s, n, eps, g, c, h, hu, hv):
    """Contour factor of the front part of a small net; ``g`` (5,) are the facings of its corners.

    Two or four of its edges change side; ``c``, ``h``, ``hu`` and ``hv`` are scratch.
    """
    cu = (0.0, 1.0, 1.0, 0.0)
    cv = (0.0, 0.0, 1.0, 1.0)
    g[4] = g[0]
    # One walk round the boundary; cuts join the point where the front is left to the next entry.
    total = 0.0
    eu = ev = fu = fv = 0.0
    have_exit = False
    have_first = False
    for k in range(4):
        load_edge(s, k, c)
        a, b = 0.0, 1.0
        crossing = (g[k] > 0.0) != (g[k + 1] > 0.0)
        if crossing:
            lo, hi, glo, ghi = 0.0, 1.0, g[k], g[k + 1]
            for step in range(60):
                t = lo - glo * (hi - lo) / (ghi - glo)
                if step % 3 == 2 or not lo < t < hi:
                    t = 0.5 * (lo + hi)
                gt = _edge_facing(s, k, t, h, hu, hv)
                if (gt > 0.0) == (glo > 0.0):
                    lo, glo = t, gt
                else:
                    hi, ghi = t, gt
                if hi - lo < 1e-12:
                    break
            t = 0.5 * (lo + hi)
            pu = cu[k] + t * (cu[(k + 1) % 4] - cu[k])
            pv = cv[k] + t * (cv[(k + 1) % 4] - cv[k])
            if g[k] > 0.0:
                b = t
                eu, ev = pu, pv
                have_exit = True
            else:
                a = t
                if have_exit:
                    total += _chord_on_surface(s, eu, ev, pu, pv, n, h, hu, hv)
                    have_exit = False
                else:
                    fu, fv = pu, pv
                    have_first = True
        elif g[k] <= 0.0:
            continue
        total += edge_term(c, a, b, n, eps)
    if have_exit and have_first:
        total += _chord_on_surface(s, eu, ev, fu, fv, n, h, hu, hv)
    return -total / _TWO_PI


@nb.njit(cache=True, error_model="numpy")
def _chord_on_surface(s, u0, v0, u1, v1, n, h, hu, hv):
    """Contour term along the image of the (u, v) segment from (u0, v0) to (u1, v1)."""
    du, dv = u1 - u0, v1 - v0
    total = 0.0
    for m in range(GAUSS_START[6], GAUSS_START[7]):
        t = GAUSS_NODES[m]
        surface(s, u0 + t * du, v0 + t * dv, h, hu, hv)
        gx, gy, gz = hu[0] * du + hv[0] * dv, hu[1] * du + hv[1] * dv, hu[2] * du + hv[2] * dv
        num = (
            n[0] * (h[1] * gz - h[2] * gy)
            + n[1] * (h[2] * gx - h[0] * gz)
            + n[2] * (h[0] * gy - h[1] * gx)
        )
        total += GAUSS_WEIGHTS[m] * num / (h[0] ** 2 + h[1] ** 2 + h[2] ** 2 + 1e-100)
    return total


@nb.njit(cache=True, error_model="numpy")
def _centre_estimate(s, n, h, hu, hv):
    """One-point estimate max(0, cos) max(0, cos) dA / (π r²) at the centre of a tiny net."""
    g = facing_at(s, 0.5, 0.5, h, hu, hv)
    r2 = h[0] ** 2 + h[1] ** 2 + h[2] ** 2
    up = n[0] * h[0] + n[1] * h[1] + n[2] * h[2]
    if g <= 0.0 or up <= 0.0 or r2 == 0.0:
        return 0.0
    # dF = (n · H) (−det) / (π |H|⁴): the weights cancel as in the contour.
    return g * up / (math.pi * r2 * r2)


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def _modulo_whole(value):
    """A contour's value moved by a whole where it is far from the share of a hemisphere it is."""
    if value < -0.25:
        return value + 1.0
    if value > 1.25:
        return value - 1.0
    return value


@nb.njit(cache=True, error_model="numpy")
def patch_factor(s, n, cone, flags, eps, rounding):
    """Form factor, ignoring other surfaces, of the lit side of shifted net ``s`` above the horizon.

    Parameters
    ----------
    s : (4, 4, 4) array
        Net relative to the receiver (`contour.shift_net`).
    n : (3,) array
        Receiver normal.
    cone : (4,) array
        Axis and sine of the half-angle of the net's normals (`normal_cone`).
    flags : int
        `ALWAYS_FRONT` skips the facing tests.
    eps : float
        Relative accuracy wanted.
    rounding : float
        `contour.horizon_tolerance` of the receiver.
    """
    low, inner, high = heights(s, n)
    if high <= rounding:
        return 0.0
    facing = 1 if flags & ALWAYS_FRONT else facing_of(s, cone, rounding)
    if facing < 0:
        return 0.0
    # Where the contour is closed along the horizon the long way round, it is a whole off.
    doubt = max(2.5 * eps, 1e-9)
    if facing > 0 and not (low > 0.0 and inner < 0.0):
        value = _modulo_whole(contour_factor(s, n, eps, rounding))
        if -doubt <= value <= 1.0 + doubt:
            return max(0.0, value)

    stack = np.empty((_STACK, 4, 4, 4))
    depth = np.empty(_STACK, dtype=np.int64)
    low_u, high_u = np.empty((4, 4, 4)), np.empty((4, 4, 4))
    h, hu, hv = np.empty(3), np.empty(3), np.empty(3)
    own, edge, g, middles = np.empty(4), np.empty((4, 3)), np.empty(5), np.empty(4)
    # θ⁴ ~ eps: see the module's text. 9 levels resolve 1/512 of a quarter turn.
    angle = 1.5 * eps**0.25
    deepest = min(9, max(2, int(math.ceil(math.log2(1.6 / angle)))))
    stack[0] = s
    depth[0] = 0
    top = 1
    total = 0.0
    while top > 0:
        top -= 1
        cell = stack[top]
        level = depth[top]
        low, inner, high = heights(cell, n)
        if high <= rounding:
            continue
        facing = 1
        if not flags & ALWAYS_FRONT:
            normal_cone(cell, own)
            if 0.0 < own[3] < 1.5:
                # What the sampled normals miss falls by four with each quartering.
                own[3] -= 0.01 * (1.0 - 0.25**level)
            facing = facing_of(cell, own, rounding)
        if facing < 0:
            continue
        dips = low > 0.0 and inner < 0.0
        last = level >= deepest + 2
        if level >= deepest and facing == 0:
            front = _front_count(cell, 0.0, g, h, hu, hv)
            near = _is_near(cell, min(4.0 * angle, 1.5))
            if near and front == 4:
                # A bend between the corners shows at the middles of the edges.
                front = _front_count(cell, 0.5, middles, h, hu, hv)
                # On the net's own edge the contour says nothing; what is near is edge-on there.
                if front == 4 and _on_edge(cell, edge, h):
                    front, near = -1, False
            if front == 4:
                facing = 1
            elif near and level < _DEEPEST_NEAR:
                last = False
            elif front == 0:
                continue
            elif front > 0 and min(low, inner) > 0.0:
                total += max(0.0, _silhouette_leaf(cell, n, eps, g, edge, h, hu, hv))
                continue
        if facing > 0 and (last or not dips):
            value = _modulo_whole(contour_factor(cell, n, eps, rounding))
            if last or -doubt <= value <= 1.0 + doubt:
                total += max(0.0, value)
                continue
        if last:
            total += _centre_estimate(cell, n, h, hu, hv)
            continue
        halve_u(cell, low_u, high_u)
        halve_v(low_u, stack[top], stack[top + 1])
        halve_v(high_u, stack[top + 2], stack[top + 3])
        for k in range(4):
            depth[top + k] = level + 1
        top += 4
    return total
