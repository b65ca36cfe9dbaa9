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
"""

import math

from .compiled import lean
from .ray_nets import (
    D1,
    D2,
    DISTANCE,
    EPS,
    STACK,
    STACK_SIZE,
    SUB1,
    SUB2,
    WEIGHT,
    WORK,
    load_nets,
    newton,
    setup_ray,
    sub_net,
    value,
    value_slopes,
)
from .ray_quad import FLAT_QUAD, GENERAL, classify_patches, hit_quad, quad_parameters

__all__ = [
    "FLAT_QUAD",
    "GENERAL",
    "HIT",
    "MISS",
    "UNDECIDED",
    "WORK",
    "classify_patches",
    "hit_general",
    "hit_quad",
    "quad_parameters",
    "ray_patch",
    "ray_patch_any",
    "setup_ray",
]

#: Results of a test; undecided means that the bound on the work was reached at a possible hit.
MISS, HIT, UNDECIDED = 0, 1, 2
#: Boxes looked at before giving up; a tangent ray needs about 150.
_MAX_BOXES = 1000
#: Boxes are clipped no narrower: below, the rounding of their own limits would lose roots.
_NARROWEST = 1e-8
#: Largest tolerance in parameters, for rays along the surface.
_MAX_TOLERANCE = 1e-5


@lean
def _edge_on(work, error):
    """Whether the ray sees the patch as a line within rounding: it has no area to hit."""
    best, k = -1.0, 0
    for i in range(16):
        r = abs(work[D1 + i]) + abs(work[D2 + i])
        if r > best:
            best, k = r, i
    a, b = work[D1 + k], work[D2 + k]
    for i in range(16):
        if abs(a * work[D2 + i] - b * work[D1 + i]) > best * error:
            return False
    return True


@lean
def _facing(work, u, v, error):
    """+1 where the ray runs against the +normal, −1 along it, 0 where they are square."""
    for _ in range(2):
        _, fu, fv = value_slopes(work, D1, u, v)
        _, gu, gv = value_slopes(work, D2, u, v)
        det = fu * gv - fv * gu
        if abs(det) > 4.0 * error * (abs(fu) + abs(fv) + abs(gu) + abs(gv)):
            break
        # On a collapsed edge the slopes vanish: look a little further inside the patch.
        u += 1e-4 * (0.5 - u)
        v += 1e-4 * (0.5 - v)
    return -1 if det > 0.0 else (1 if det < 0.0 else 0)


@lean
def hit_general(net, box_u0, box_u1, box_v0, box_v1, t_min, t_max, facing_filter, find_any, work):
    """Nearest (or any) hit of the ray in ``work`` with the given parameter box of the patch.

    Returns (status, t, u, v, facing) as `ray_patch`.
    """
    error = load_nets(net, work)
    status, t_hit, u_hit, v_hit, facing_hit = MISS, t_max, 0.0, 0.0, 0
    below = True
    for k in range(16):
        if work[DISTANCE + k] >= t_min * work[WEIGHT + k]:
            below = False
            break
    if below:
        return status, t_hit, u_hit, v_hit, facing_hit
    beyond = True
    for k in range(16):
        if work[DISTANCE + k] <= t_max * work[WEIGHT + k]:
            beyond = False
            break
    if beyond:
        return status, t_hit, u_hit, v_hit, facing_hit

    work[STACK], work[STACK + 1] = box_u0, box_u1
    work[STACK + 2], work[STACK + 3] = box_v0, box_v1
    top = 1
    for count in range(_MAX_BOXES):
        if top == 0:
            break
        if count == 48 and _edge_on(work, error):
            return MISS, t_max, 0.0, 0.0, 0
        top -= 1
        at = STACK + 4 * top
        u0, u1, v0, v1 = work[at], work[at + 1], work[at + 2], work[at + 3]
        sub_net(work, D1, SUB1, u0, u1, v0, v1)
        low, high = work[SUB1], work[SUB1]
        for k in range(1, 16):
            low = min(low, work[SUB1 + k])
            high = max(high, work[SUB1 + k])
        if low > error or high < -error:
            continue
        size = max(high, -low)
        sub_net(work, D2, SUB2, u0, u1, v0, v1)
        low, high = work[SUB2], work[SUB2]
        for k in range(1, 16):
            low = min(low, work[SUB2 + k])
            high = max(high, work[SUB2 + k])
        if low > error or high < -error:
            continue
        size = max(size, max(high, -low))

        # Mean slopes over the box, in its own coordinates 0 … 1.
        fu = 0.5 * (work[SUB1 + 12] + work[SUB1 + 15] - work[SUB1] - work[SUB1 + 3])
        fv = 0.5 * (work[SUB1 + 3] + work[SUB1 + 15] - work[SUB1] - work[SUB1 + 12])
        gu = 0.5 * (work[SUB2 + 12] + work[SUB2 + 15] - work[SUB2] - work[SUB2 + 3])
        gv = 0.5 * (work[SUB2 + 3] + work[SUB2 + 15] - work[SUB2] - work[SUB2 + 12])
        det = fu * gv - fv * gu
        found, u, v = False, 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        clipped = False
        if size <= error:
            # The whole box lies on the ray within rounding.
            found = True
        elif det != 0.0:
            a11, a12, a21, a22 = gv / det, -fv / det, -gu / det, fu / det
            ulo, uhi, vlo, vhi = math.inf, -math.inf, math.inf, -math.inf
            g1u, g1v, g2u, g2v = 0.0, 0.0, 0.0, 0.0
            for i in range(4):
                for j in range(4):
                    k = 4 * i + j
                    f, g = work[SUB1 + k], work[SUB2 + k]
                    x = i / 3.0 - a11 * f - a12 * g
                    y = j / 3.0 - a21 * f - a22 * g
                    work[SUB1 + k], work[SUB2 + k] = x, y
                    ulo, uhi = min(ulo, x), max(uhi, x)
                    vlo, vhi = min(vlo, y), max(vhi, y)
                    if i > 0:
                        g1u = max(g1u, abs(x - work[SUB1 + k - 4]))
                        g2u = max(g2u, abs(y - work[SUB2 + k - 4]))
                    if j > 0:
                        g1v = max(g1v, abs(x - work[SUB1 + k - 1]))
                        g2v = max(g2v, abs(y - work[SUB2 + k - 1]))
            tol_u = min(error * (abs(a11) + abs(a12)) + 4 * EPS / (u1 - u0), _MAX_TOLERANCE)
            tol_v = min(error * (abs(a21) + abs(a22)) + 4 * EPS / (v1 - v0), _MAX_TOLERANCE)
            if uhi < -tol_u or ulo > 1.0 + tol_u or vhi < -tol_v or vlo > 1.0 + tol_v:
                continue
            wide_u, wide_v = uhi - ulo, vhi - vlo
            ulo, uhi = max(ulo - tol_u, 0.0), min(uhi + tol_u, 1.0)
            vlo, vhi = max(vlo - tol_v, 0.0), min(vhi + tol_v, 1.0)
            if max(3.0 * (g1u + g1v), 3.0 * (g2u + g2v)) < 0.9 and max(wide_u, wide_v) < 0.5:
                # At most one root in this box.
                du, dv = u1 - u0, v1 - v0
                ok, u, v = newton(work, u0 + 0.5 * (ulo + uhi) * du, v0 + 0.5 * (vlo + vhi) * dv)
                if ok:
                    x, y = (u - u0) / du, (v - v0) / dv
                    found = x >= -tol_u and x <= 1.0 + tol_u and y >= -tol_v and y <= 1.0 + tol_v
            # A box that would become a line keeps some width, so that slopes stay defined; two
            # roots on one parameter line leave it narrow in one direction only.
            least_u = min(max(0.02, _NARROWEST / (u1 - u0)), 1.0)
            least_v = min(max(0.02, _NARROWEST / (v1 - v0)), 1.0)
            if uhi - ulo < least_u:
                ulo = max(0.0, min(0.5 * (ulo + uhi - least_u), 1.0 - least_u))
                uhi = ulo + least_u
            if vhi - vlo < least_v:
                vlo = max(0.0, min(0.5 * (vlo + vhi - least_v), 1.0 - least_v))
                vhi = vlo + least_v
            clipped = not found and (uhi - ulo) * (vhi - vlo) < 0.7
        if found:
            t = value(work, DISTANCE, u, v) / value(work, WEIGHT, u, v)
            facing = _facing(work, u, v, error)
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
        if top + 2 > STACK_SIZE or not (can_u or can_v):
            t = value(work, DISTANCE, um, vm) / value(work, WEIGHT, um, vm)
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
        at = STACK + 4 * (top - 1)
        u, v = 0.5 * (work[at] + work[at + 1]), 0.5 * (work[at + 2] + work[at + 3])
        t = value(work, DISTANCE, u, v) / value(work, WEIGHT, u, v)
        if t > t_min and t < t_max:
            status, t_hit, u_hit, v_hit = UNDECIDED, t, u, v
    return status, t_hit, u_hit, v_hit, facing_hit


@lean
def _longer_in_u(work, u0, u1, v0, v1):
    """Whether the box extends further along u than along v across the ray."""
    size_u, size_v = 0.0, 0.0
    for net in (D1, D2):
        c00, c10 = value(work, net, u0, v0), value(work, net, u1, v0)
        c01, c11 = value(work, net, u0, v1), value(work, net, u1, v1)
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        mid = value(work, net, um, vm)
        # The middle counts too: opposite edges may coincide (a half circle seen from its axis).
        a, b = abs(value(work, net, u0, vm) - mid), abs(value(work, net, u1, vm) - mid)
        size_u += max(max(abs(c10 - c00), abs(c11 - c01)), a + b)
        a, b = abs(value(work, net, um, v0) - mid), abs(value(work, net, um, v1) - mid)
        size_v += max(max(abs(c01 - c00), abs(c11 - c10)), a + b)
    return size_u >= size_v


@lean
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
    # Not literals: those would compile the callee once more.
    facing_filter, find_any = kind * 0, kind < 0
    return hit_general(net, 0.0, 1.0, 0.0, 1.0, t_min, t_max, facing_filter, find_any, work)


@lean
def ray_patch_any(net, kind, ox, oy, oz, dx, dy, dz, t_min, t_max, facing_filter, work):
    """Whether the ray hits the patch at all; see `ray_patch`.

    ``facing_filter`` 0 takes any hit, +1 only those with d·normal < 0, −1 those with d·normal > 0.
    """
    setup_ray(ox, oy, oz, dx, dy, dz, work)
    if kind == FLAT_QUAD:
        hit, _, facing = hit_quad(net, t_min, t_max, work)
        return HIT if hit and facing * facing_filter >= 0 else MISS
    status, _, _, _, _ = hit_general(
        net, 0.0, 1.0, 0.0, 1.0, t_min, t_max, facing_filter, kind >= 0, work
    )
    return status
