"""Form factor from a point to a whole curved net: facing, silhouettes and the horizon.

The contour of `contour.contour_factor` is right only where the net is seen from its + side
throughout and does not dip through the horizon inside its boundary. Elsewhere the net is
quartered; a piece that shows both sides is cut along its silhouette, which is a conic where the
surface is a quadric (`quadric`), or else found by Newton's iteration (`silhouette`). Where that is
no single smooth arc, down to small pieces, a chord in (u, v) stands for it. At the silhouette the
integrand of the form factor vanishes, so a displacement δ of the cut changes the factor by O(δ²)
only: with pieces of angle θ the error falls as θ⁴.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import contour_factor, cubic_point, enclosed, load_edge
from .nets import (
    ALWAYS_FRONT,
    copy_net,
    facing_at,
    facing_of,
    halve_u,
    halve_v,
    heights,
    normal_cone,
)
from .quadric import quadric_factor
from .silhouette import ALL_BACK, ALL_FRONT, arc_leaf, chord_leaf, front_count

#: Quarterings of a net nearer than its cells are large.
_DEEPEST_NEAR = 22
#: Cells that may wait on a quadtree stack: three for each level and four new ones.
_STACK = 3 * _DEEPEST_NEAR + 4


@lean
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


@lean
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


@lean
def _centre_estimate(s, n, h, hu, hv):
    """One-point estimate max(0, cos) max(0, cos) dA / (π r²) at the centre of a tiny net."""
    g = facing_at(s, 0.5, 0.5, h, hu, hv)
    r2 = h[0] ** 2 + h[1] ** 2 + h[2] ** 2
    up = n[0] * h[0] + n[1] * h[1] + n[2] * h[2]
    if g <= 0.0 or up <= 0.0 or r2 == 0.0:
        return 0.0
    # dF = (n · H) (−det) / (π |H|⁴): the weights cancel as in the contour.
    return g * up / (math.pi * r2 * r2)


@kernel
def patch_factor(s, x, n, cone, flags, quadric, eps, rounding):
    """Form factor, ignoring other surfaces, of the lit side of shifted net ``s`` above the horizon.

    Parameters
    ----------
    s : (4, 4, 4) array
        Net relative to the receiver (`contour.shift_net`).
    x, n : (3,) array
        Receiver and its normal.
    cone : (4,) array
        Axis and sine of the half-angle of the net's normals (`normal_cone`).
    flags : int
        `ALWAYS_FRONT` skips the facing tests.
    quadric : (5, 4) array
        Quadric the net lies on, as in `quadric.polar_plane`.
    eps : float
        Relative accuracy wanted.
    rounding : float
        `contour.horizon_tolerance` of the receiver.
    """
    low, inner, high = heights(s, n)
    if high <= rounding:
        return 0.0
    curved = quadric[4, 3] != 0.0 and not flags & ALWAYS_FRONT
    if curved:
        value = quadric_factor(s, x, n, quadric, eps, rounding)
        if value >= 0.0:
            return value
    facing = 1 if flags & ALWAYS_FRONT else facing_of(s, cone, rounding)
    if facing < 0:
        return 0.0
    doubt = max(2.5 * eps, 1e-9)
    if facing > 0:
        value = enclosed(contour_factor(s, n, eps, rounding), low > 0.0 and inner < 0.0, doubt)
        if value >= 0.0:
            return value

    stack = np.empty((_STACK, 4, 4, 4))
    depth = np.empty(_STACK, dtype=np.int64)
    low_u, high_u = np.empty((4, 4, 4)), np.empty((4, 4, 4))
    h, hu, hv = np.empty(3), np.empty(3), np.empty(3)
    own, edge, g, middles = np.empty(4), np.empty((4, 3)), np.empty(5), np.empty(4)
    work = np.empty((6, 3))
    # θ⁴ ~ eps: see the module's text. 9 levels resolve 1/512 of a quarter turn.
    angle = 1.5 * eps**0.25
    deepest = min(9, max(2, int(math.ceil(math.log2(1.6 / angle)))))
    copy_net(s, stack[0])
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
        if curved and level > 0:
            value = quadric_factor(cell, x, n, quadric, eps, rounding)
            if value >= 0.0:
                total += value
                continue
        facing, sampled = 1, False
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
        if facing == 0 and level >= 1 and min(low, inner) > 0.0 and not _is_near(cell, 0.8):
            value = arc_leaf(cell, n, eps, 0.1 * eps * total + 1e-13, g, edge, h, hu, hv, work)
            if value >= 0.0:
                total += value
                continue
            if value == ALL_BACK:
                continue
            if value == ALL_FRONT:
                facing = 1
        if level >= deepest and facing == 0:
            front = front_count(cell, 0.0, g, h, hu, hv)
            near = _is_near(cell, min(4.0 * angle, 1.5))
            if near and front == 4:
                # A bend between the corners shows at the middles of the edges.
                front = front_count(cell, 0.5, middles, h, hu, hv)
                # On the net's own edge the contour says nothing; what is near is edge-on there.
                if front == 4 and _on_edge(cell, edge, h):
                    front, near = -1, False
            if front == 4:
                facing, sampled = 1, True
            elif near and level < _DEEPEST_NEAR:
                last = False
            elif front == 0:
                continue
            elif front > 0 and min(low, inner) > 0.0:
                total += max(0.0, chord_leaf(cell, n, eps, g, edge, h, hu, hv))
                continue
        if facing > 0 and (last or not (dips and sampled)):
            value = enclosed(contour_factor(cell, n, eps, rounding), dips, doubt)
            if value >= 0.0:
                total += value
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
