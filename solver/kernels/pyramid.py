"""Pyramid tracing: which part of a curved cell a point sees past curved blockers.

The pyramid of a cell has its apex in the receiver; its four side planes go through the receiver
and contain every control point of the cell on their inner side, so all tests are made on control
points in homogeneous form, valid across the plane of the receiver [1, eq. 14].

A cell's visibility is constant when no *shadow edge* meets its pyramid: an edge of a blocker whose
other side does not continue as a blocker seen from the same side. Then one ray decides the whole
cell. Edges between two blockers seen from the same side cast no shadow line, so blockers that
touch are one blocker: nothing leaks between them. Other cells are quartered until their form
factor is below the tolerance, and then sampled.

Blockers that bound a closed solid block with their front only: what a ray hits first, from outside.

References
----------
.. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993, sec. 4.2.2.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .contour import load_edge
from .nets import (
    ALWAYS_FRONT,
    copy_net,
    facing_at,
    facing_of,
    halve_u,
    halve_v,
    heights,
    normal_cone,
    surface,
    weight_at,
)
from .patch_factor import patch_factor
from .ray_patch import MISS, WORK, ray_patch_any
from .sky_luminance import PATCHES, sky_luminance

#: States of a blocker seen from a receiver.
NO_BLOCKER, FRONT, BACK, MIXED = 0, 1, 2, 3
_STACK = 64
#: Cells looked at for one pair before the rest is sampled at the size it has.
MAX_CELLS = 200000
#: Points this close to a side plane, relative to their size, count as outside: neighbours touch.
_TOUCH = 1e-11


class Scratch(NamedTuple):
    """Arrays one thread works in, made once a row by `make_scratch`."""

    stack: np.ndarray
    depth: np.ndarray
    parts: np.ndarray
    small: np.ndarray
    planes: np.ndarray
    work: np.ndarray
    lists: np.ndarray
    shifted: np.ndarray
    state: np.ndarray
    views: np.ndarray
    active: np.ndarray


@kernel
def make_scratch(patches, levels):
    """Scratch arrays for scenes of so many patches and quarterings of so many levels."""
    return Scratch(
        np.empty((_STACK, 4, 4, 4)),
        np.empty(_STACK, dtype=np.int64),
        np.empty((14, 4, 4, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty(WORK),
        np.empty((levels + 1, patches + 1), dtype=np.int64),
        np.empty((patches, 4, 4, 4)),
        np.zeros(patches, dtype=np.int64),
        np.empty((patches, 7)),
        np.empty(patches, dtype=np.int64),
    )


class Blockers(NamedTuple):
    """Patches that hide light; row b of every array is the same patch.

    Attributes
    ----------
    nets : (p, 4, 4, 4) array
        Homogeneous control nets. [m]
    kinds : (p,) int array
        `ray_patch.classify_patches`.
    closed : (p,) bool array
        Bounds a closed solid: blocks with its front only.
    adjacent : (p, 4) int array
        Patch on the other side of each boundary edge, −1 where none.
    cones : (p, 4) array
        Axis and sine of the half-angle of the normals.
    flags : (p,) int array
        `nets.PLANAR`, `CONVEX`, `CONCAVE`.
    solid : (p,) int array
        Solid (part) the patch belongs to.
    bulging : (solids,) bool array
        The solid is convex: from outside, no patch of it sees or hides another one.
    hollow : (solids,) bool array
        The solid is a convex cavity: from inside, no patch of it hides another one.
    spheres : (p, 4) array
        Centre and radius of a bounding sphere. [m]
    """

    nets: np.ndarray
    kinds: np.ndarray
    closed: np.ndarray
    adjacent: np.ndarray
    cones: np.ndarray
    flags: np.ndarray
    solid: np.ndarray
    bulging: np.ndarray
    hollow: np.ndarray
    spheres: np.ndarray


@lean
def see_blockers(blockers, x, n, rounding, shifted, state):
    """Shift all blockers to receiver ``x`` and tell from which side each is seen.

    Blockers wholly below the horizon, and closed ones seen from behind, are no blockers.
    """
    for b in range(blockers.nets.shape[0]):
        state[b] = NO_BLOCKER
        dx = blockers.spheres[b, 0] - x[0]
        dy = blockers.spheres[b, 1] - x[1]
        dz = blockers.spheres[b, 2] - x[2]
        if n[0] * dx + n[1] * dy + n[2] * dz <= -blockers.spheres[b, 3]:
            continue
        high = -1e300
        for i in range(4):
            for j in range(4):
                w = blockers.nets[b, i, j, 3]
                px = blockers.nets[b, i, j, 0] - x[0] * w
                py = blockers.nets[b, i, j, 1] - x[1] * w
                pz = blockers.nets[b, i, j, 2] - x[2] * w
                shifted[b, i, j, 0] = px
                shifted[b, i, j, 1] = py
                shifted[b, i, j, 2] = pz
                shifted[b, i, j, 3] = w
                high = max(high, n[0] * px + n[1] * py + n[2] * pz)
        if high <= rounding:
            continue
        facing = facing_of(shifted[b], blockers.cones[b], rounding)
        if blockers.cones[b, 3] == 0.0 and facing < 0:
            # A plane: behind it, or in it (then it is seen edge-on and hides nothing).
            h = shifted[b, 0, 0]
            c = blockers.cones[b]
            if abs(h[0] * c[0] + h[1] * c[1] + h[2] * c[2]) <= rounding:
                continue
        if facing > 0:
            state[b] = FRONT
        elif facing < 0:
            state[b] = NO_BLOCKER if blockers.closed[b] else BACK
        else:
            state[b] = MIXED


@lean
def make_pyramid(s, planes):
    """Side planes (4, 3), unit normals inward, of shifted cell ``s``, its view axis and depths.

    ``planes`` (8, 3): rows 0–3 side planes; row 4 the axis; row 5 (nearest, farthest) depth of the
    control points along the axis; returns False where the cell is too wide for a pyramid.
    """
    ax = ay = az = 0.0
    for i in (0, 3):
        for j in (0, 3):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            size = math.sqrt(x * x + y * y + z * z)
            if size == 0.0:
                return False
            ax += x / size
            ay += y / size
            az += z / size
    size = math.sqrt(ax * ax + ay * ay + az * az)
    if size < 1e-6:
        return False
    ax, ay, az = ax / size, ay / size, az / size
    planes[4, 0], planes[4, 1], planes[4, 2] = ax, ay, az
    near, far = 1e300, -1e300
    for i in range(4):
        for j in range(4):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            depth = ax * x + ay * y + az * z
            length = math.sqrt(x * x + y * y + z * z)
            if depth <= 0.05 * length:
                return False
            w = s[i, j, 3]
            if w > 0.0:
                near = min(near, depth / w)
                far = max(far, depth / w)
            else:
                near = far = 1e300
    planes[5, 0], planes[5, 1] = near, far
    for k in range(4):
        if k == 0:
            p, q = s[0, 0], s[3, 0]
        elif k == 1:
            p, q = s[3, 0], s[3, 3]
        elif k == 2:
            p, q = s[3, 3], s[0, 3]
        else:
            p, q = s[0, 3], s[0, 0]
        mx = p[1] * q[2] - p[2] * q[1]
        my = p[2] * q[0] - p[0] * q[2]
        mz = p[0] * q[1] - p[1] * q[0]
        length = math.sqrt(mx * mx + my * my + mz * mz)
        ends = math.sqrt((p[0] ** 2 + p[1] ** 2 + p[2] ** 2) * (q[0] ** 2 + q[1] ** 2 + q[2] ** 2))
        if length <= 1e-12 * ends:
            # A collapsed side bounds nothing: a plane that is never separating.
            planes[k, 0], planes[k, 1], planes[k, 2] = 0.0, 0.0, 0.0
            continue
        mx, my, mz = mx / length, my / length, mz / length
        if mx * ax + my * ay + mz * az < 0.0:
            mx, my, mz = -mx, -my, -mz
        # Curved sides bulge: turn the plane outwards until it holds all control points.
        turn = 0.0
        for i in range(4):
            for j in range(4):
                x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
                d = mx * x + my * y + mz * z
                if d < 0.0:
                    turn = max(turn, -d / (ax * x + ay * y + az * z))
        if turn > 1e-12:
            mx, my, mz = mx + turn * ax, my + turn * ay, mz + turn * az
            length = math.sqrt(mx * mx + my * my + mz * mz)
            mx, my, mz = mx / length, my / length, mz / length
        planes[k, 0], planes[k, 1], planes[k, 2] = mx, my, mz
    return True


@lean
def outside_pyramid(planes, s):
    """Whether all control points of ``s`` lie outside one side plane or behind the receiver."""
    for k in range(4):
        mx, my, mz = planes[k, 0], planes[k, 1], planes[k, 2]
        if mx == 0.0 and my == 0.0 and mz == 0.0:
            continue
        outside = True
        for i in range(4):
            for j in range(4):
                x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
                if mx * x + my * y + mz * z > _TOUCH * (abs(x) + abs(y) + abs(z)):
                    outside = False
                    break
            if not outside:
                break
        if outside:
            return True
    mx, my, mz = planes[4, 0], planes[4, 1], planes[4, 2]
    for i in range(4):
        for j in range(4):
            if mx * s[i, j, 0] + my * s[i, j, 1] + mz * s[i, j, 2] > 0.0:
                return False
    return True


@lean
def all_beyond(mx, my, mz, c, touch):
    """Whether control vectors ``c`` (4, 3) lie beyond a plane, but for ``touch`` of their size."""
    for m in range(4):
        x, y, z = c[m, 0], c[m, 1], c[m, 2]
        if mx * x + my * y + mz * z > touch * (abs(x) + abs(y) + abs(z)):
            return False
    return True


@lean
def edge_outside(planes, n, rounding, s, side, c, touch):
    """Whether a side of ``s`` lies below the horizon or outside one side plane of the pyramid.

    The control vectors of the side are left in ``c`` (4, 3).
    """
    load_edge(s, side, c)
    high = -1e300
    for m in range(4):
        high = max(high, n[0] * c[m, 0] + n[1] * c[m, 1] + n[2] * c[m, 2])
    if high <= rounding:
        return True
    for k in range(4):
        mx, my, mz = planes[k, 0], planes[k, 1], planes[k, 2]
        if mx == 0.0 and my == 0.0 and mz == 0.0:
            continue
        if all_beyond(mx, my, mz, c, touch):
            return True
    return False


@kernel
def _one_sided_within(planes, s, rounding, parts):
    """Side from which all of blocker ``s`` that meets the pyramid is seen; 0 when there are two.

    The blocker is quartered twice at most; ``parts`` (14, 4, 4, 4) is scratch.
    """
    cone = np.empty(4)
    low_u, high_u = parts[12], parts[13]
    level = np.zeros(12, dtype=np.int64)
    copy_net(s, parts[0])
    top = 1
    seen = 0
    while top > 0:
        top -= 1
        if outside_pyramid(planes, parts[top]):
            continue
        normal_cone(parts[top], cone)
        facing = facing_of(parts[top], cone, rounding)
        if facing != 0:
            if seen == -facing:
                return 0
            seen = facing
            continue
        deep = level[top]
        if deep == 2:
            return 0
        halve_u(parts[top], low_u, high_u)
        halve_v(low_u, parts[top], parts[top + 1])
        halve_v(high_u, parts[top + 2], parts[top + 3])
        for k in range(4):
            level[top + k] = deep + 1
        top += 4
    return seen if seen != 0 else 1


@lean
def _cell_depths(s, cone, depths):
    """Least and largest N · P over the cell, N its mean normal turned away from the receiver."""
    low, high = 1e300, -1e300
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            if w <= 0.0:
                depths[0], depths[1] = 1e300, 1e300
                return
            d = -(cone[0] * s[i, j, 0] + cone[1] * s[i, j, 1] + cone[2] * s[i, j, 2]) / w
            low = min(low, d)
            high = max(high, d)
    depths[0], depths[1] = low, high


@lean
def _depth_of(s, cone, planes, depths, front_facing, tolerance):
    """Order of blocker ``s`` and the cell: 1 wholly beyond, −1 wholly in front, 0 neither."""
    low, high = 1e300, -1e300
    near, far = 1e300, -1e300
    for i in range(4):
        for j in range(4):
            x, y, z, w = s[i, j, 0], s[i, j, 1], s[i, j, 2], s[i, j, 3]
            d = -(cone[0] * x + cone[1] * y + cone[2] * z) / w
            low, high = min(low, d), max(high, d)
            a = (planes[4, 0] * x + planes[4, 1] * y + planes[4, 2] * z) / w
            near, far = min(near, a), max(far, a)
    # depths are distances below the receiver along −N: the cell lies between them.
    if near >= planes[5, 1] - tolerance:
        return 1
    if front_facing and low >= depths[1] - tolerance:
        return 1
    if far <= planes[5, 0] + tolerance:
        return -1
    if front_facing and high <= depths[0] + tolerance:
        return -1
    return 0


@lean
def blocked(blockers, listed, first, count, x, dx, dy, dz, t_max, work):
    """Whether a blocker listed from ``first`` to ``count`` meets x + t d, 0 < t < t_max."""
    length2 = dx * dx + dy * dy + dz * dz
    for m in range(first, count):
        b = listed[m]
        cx = blockers.spheres[b, 0] - x[0]
        cy = blockers.spheres[b, 1] - x[1]
        cz = blockers.spheres[b, 2] - x[2]
        along = (cx * dx + cy * dy + cz * dz) / length2
        ex, ey, ez = cx - along * dx, cy - along * dy, cz - along * dz
        if ex * ex + ey * ey + ez * ez > blockers.spheres[b, 3] ** 2:
            continue
        facing = int(blockers.closed[b])  # not literals, which would compile the callee for each
        status = ray_patch_any(
            blockers.nets[b], blockers.kinds[b], x[0], x[1], x[2], dx, dy, dz, 1e-9, t_max,
            facing, work,
        )  # fmt: skip
        if status != MISS:
            return True
    return False


@lean
def _point_blocked(s, u, v, x, blockers, listed, first, count, work, h, hu, hv):
    """Whether a listed blocker hides the point (u, v) of the cell from the receiver."""
    surface(s, u, v, h, hu, hv)
    w = weight_at(s, u, v)
    t_max = 1.0 - 1e-7
    if w == 0.0:
        w, t_max = 1.0, 1e300
    return blocked(blockers, listed, first, count, x, h[0] / w, h[1] / w, h[2] / w, t_max, work)


@lean
def _height_seen(s, n, front, u, v, h, hu, hv):
    """Height of the point (u, v) of the cell above the receiver's horizon, over its distance.

    Unless the whole cell is in ``front``, −1 for points on the far side of its own outline: like
    those below the horizon they are not in its form factor.
    """
    if not front and facing_at(s, u, v, h, hu, hv) <= 0.0:
        return -1.0
    surface(s, u, v, h, hu, hv)
    size = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
    return (n[0] * h[0] + n[1] * h[1] + n[2] * h[2]) / max(size, 1e-300)


@lean
def _centre_blocked(s, n, front, x, blockers, listed, first, count, work, h, hu, hv):
    """Whether a listed blocker hides the middle of what the receiver may see of the cell.

    Below the horizon nothing blocks, and on the far side of its outline the cell hides itself, so
    that a point there would prove nothing: the highest of 5 x 5 points stands in for the middle.
    """
    bu, bv = 0.5, 0.5
    if _height_seen(s, n, front, bu, bv, h, hu, hv) <= 0.0:
        best = -1.0
        for i in range(5):
            for j in range(5):
                height = _height_seen(s, n, front, 0.25 * i, 0.25 * j, h, hu, hv)
                if height > best:
                    best, bu, bv = height, 0.25 * i, 0.25 * j
        # A little inwards: the rim belongs to the neighbours too.
        bu, bv = 0.5 + 0.9 * (bu - 0.5), 0.5 + 0.9 * (bv - 0.5)
    return _point_blocked(s, bu, bv, x, blockers, listed, first, count, work, h, hu, hv)


@lean
def _scrambled(seed):
    """Next number of a linear congruential sequence modulo 2^31."""
    return (seed * 1103515245 + 12345) & 0x7FFFFFFF


@lean
def _hashed(number):
    """A number below 2^31 of which every bit follows from all bits of ``number``."""
    seed = number & 0x7FFFFFFF
    for _ in range(2):
        seed = ((seed ^ (seed >> 15)) * 0x2C1B3C6D) & 0x7FFFFFFF
        seed = ((seed ^ (seed >> 12)) * 0x297A2D39) & 0x7FFFFFFF
    return seed ^ (seed >> 15)


@lean
def _visible_share(s, n, front, x, blockers, listed, count, samples, seed, work, h, hu, hv):
    """Share that the receiver sees of the points in the cell's factor, of samples x samples strata.

    Points lie anywhere in their stratum: at fixed places the errors of all the cells along one
    shadow edge would have one sign.
    """
    first = count * 0  # not a literal: it would compile the callees once more
    seen = up = 0
    for i in range(samples):
        for j in range(samples):
            seed = _scrambled(seed)
            u = (i + (seed >> 8) / 8388608.0) / samples
            seed = _scrambled(seed)
            v = (j + (seed >> 8) / 8388608.0) / samples
            if _height_seen(s, n, front, u, v, h, hu, hv) <= 0.0:
                continue
            up += 1
            if not _point_blocked(s, u, v, x, blockers, listed, first, count, work, h, hu, hv):
                seen += 1
    if up == 0:
        blocked = _centre_blocked(s, n, front, x, blockers, listed, first, count, work, h, hu, hv)
        return 0.0 if blocked else 1.0
    return seen / up


@lean
def _is_small(planes):
    """Whether the luminance of the sky is smooth over the pyramid: less than 8 degrees wide."""
    for k in range(2):
        a, b = planes[k], planes[k + 2]
        if (a[0] == 0.0 and a[1] == 0.0) or (b[0] == 0.0 and b[1] == 0.0):
            continue
        # Inward normals of opposite sides are the more opposed the narrower the pyramid is.
        if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > -0.99:
            return False
    return True


@lean
def _mean_luminance(s, n, tone, seed, h, hu, hv):
    """Mean luminance of a small cell at infinity, 2 x 2 points weighted as in dF. [cd/m²]

    Gauss' points for a negative seed, else anywhere in their quarters: across the edge of a patch
    the errors of all cells along it would have one sign.
    """
    total = 0.0
    weights = 0.0
    for i in range(2):
        for j in range(2):
            u = 0.21132486540518713 if i == 0 else 0.7886751345948129
            v = 0.21132486540518713 if j == 0 else 0.7886751345948129
            if seed >= 0:
                seed = _scrambled(seed)
                u = 0.5 * (i + (seed >> 8) / 8388608.0)
                seed = _scrambled(seed)
                v = 0.5 * (j + (seed >> 8) / 8388608.0)
            surface(s, u, v, h, hu, hv)
            r2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
            size = math.sqrt(r2)
            det = (
                h[0] * (hu[1] * hv[2] - hu[2] * hv[1])
                + h[1] * (hu[2] * hv[0] - hu[0] * hv[2])
                + h[2] * (hu[0] * hv[1] - hu[1] * hv[0])
            )
            up = n[0] * h[0] + n[1] * h[1] + n[2] * h[2]
            # A cell cut by the horizon keeps a little weight everywhere, so that none is empty.
            w = abs(det) * max(up, 1e-6 * size) / (r2 * r2)
            weights += w
            total += w * sky_luminance(
                tone, tone[7], tone[8], tone[9], h[0] / size, h[1] / size, h[2] / size
            )
    return total / weights if weights > 0.0 else 0.0


@lean
def _is_even(s, tone, h, hu, hv):
    """Whether the sky is of one luminance at 3 x 3 points of a cell, or varies smoothly."""
    if tone[0] != PATCHES:
        return True
    first = -1.0
    for i in range(3):
        for j in range(3):
            surface(s, 0.5 * i, 0.5 * j, h, hu, hv)
            size = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
            level = sky_luminance(
                tone, tone[7], tone[8], tone[9], h[0] / size, h[1] / size, h[2] / size
            )
            if i == 0 and j == 0:
                first = level
            elif level != first:
                return False
    return True


@kernel
def visible_factor(
    s0, number, x, n, cone0, flags, quadric, solid, eps, cell_eps, rounding, tone, blockers,
    listed0, count0, scratch, out,
):  # fmt: skip
    """Form factor of a cell past the listed blockers, weighted with luminance for the sky.

    Parameters
    ----------
    s0 : (4, 4, 4) array
        Cell relative to receiver ``x`` with normal ``n``.
    number : int
        Of the cell among others, whose samples are then at other places: one edge often cuts many
        cells alike.
    cone0, flags, quadric, solid
        Normal cone, flags, quadric and solid (−1 where it has none) of the cell.
    eps : float
        Relative accuracy of unoccluded factors.
    cell_eps : float
        Cells whose form factor is below this are sampled instead of quartered.
    tone : (10,) array, or (0,)
        Luminance of a cell at infinity: 7 parameters of `sky_luminance` and the sun's direction;
        empty for a plain form factor.
    listed0, count0
        Rows of the blockers that may lie in the way.
    scratch : Scratch
        From `make_scratch`, with the blockers as `see_blockers` left them.
    out : (4,) array
        Receives the (weighted) form factor, the sum of squares of sampled undecided factors (a
        variance), the number of cells visited, and the plain form factor.
    """
    out[0], out[1], out[2], out[3] = 0.0, 0.0, 0.0, 0.0
    stack, depth, parts = scratch.stack, scratch.depth, scratch.parts
    planes, lists, work = scratch.planes, scratch.lists, scratch.work
    shifted, state = scratch.shifted, scratch.state
    h, hu, hv = scratch.small[0], scratch.small[1], scratch.small[2]
    depths, cone, edge = np.empty(2), np.empty(4), np.empty((4, 3))
    low_u, high_u = parts[12], parts[13]
    deepest = lists.shape[0] - 1
    nothing = count0 * 0  # not a literal: it would compile the callees once more
    copy_net(s0, stack[0])
    depth[0] = 0
    top = 1
    at_infinity = s0[0, 0, 3] == 0.0
    while top > 0:
        top -= 1
        cell = stack[top]
        level = depth[top]
        out[2] += 1.0
        low, inner, high = heights(cell, n)
        if high <= rounding:
            continue
        facing = 1
        if at_infinity:
            cone[0], cone[1], cone[2], cone[3] = 0.0, 0.0, 0.0, 2.0
        else:
            if level == 0 or cone0[3] == 0.0:
                for k in range(4):
                    cone[k] = cone0[k]
            else:
                normal_cone(cell, cone)
            if not flags & ALWAYS_FRONT:
                facing = facing_of(cell, cone, rounding)
                if facing < 0:
                    continue
        ok = make_pyramid(cell, planes)
        parent, parent_count = (listed0, count0) if level == 0 else (lists[level - 1], -1)
        if level > 0:
            parent_count = lists[level - 1, lists.shape[1] - 1]
        mine = lists[level]
        count = nothing
        if ok and not at_infinity:
            _cell_depths(cell, cone, depths)
            tolerance = 1e-9 * planes[5, 1]
        else:
            tolerance = 0.0
        dark = False
        run_start, run_clean, run_solid, run_facing = nothing, True, -1, 0
        for m in range(parent_count + 1):
            b = parent[m] if m < parent_count else -1
            if ok and (b < 0 or blockers.solid[b] != run_solid):
                # A solid without shadow edge in the pyramid covers the cell or leaves it free.
                if run_clean and count > run_start:
                    if _centre_blocked(
                        cell, n, facing > 0, x, blockers, mine, run_start, count, work, h, hu, hv
                    ):
                        dark = True
                        break
                    count = run_start
                if b >= 0:
                    run_start, run_clean, run_solid = count, True, blockers.solid[b]
                    run_facing = 0
            if b < 0:
                break
            if ok:
                if outside_pyramid(planes, shifted[b]):
                    continue
                if not at_infinity:
                    order = _depth_of(shifted[b], cone, planes, depths, facing > 0, tolerance)
                    if order > 0:
                        continue
                    if order == 0 and blockers.solid[b] != solid:
                        run_clean = False
            mine[count] = b
            count += 1
            if not run_clean or not ok:
                continue
            if state[b] == MIXED:
                side_seen = _one_sided_within(planes, shifted[b], rounding, parts)
                # Two neighbours seen from different sides meet at a silhouette.
                if side_seen == 0 or side_seen * run_facing < 0:
                    run_clean = False
                    continue
                run_facing = side_seen
            for side in range(4):
                other = blockers.adjacent[b, side]
                if other >= 0 and state[other] == state[b]:
                    continue
                if not edge_outside(planes, n, rounding, shifted[b], side, edge, _TOUCH):
                    run_clean = False
                    break
        if dark:
            continue
        mine[lists.shape[1] - 1] = count
        lit = count == 0
        uneven = lit and tone.size > 0 and not _is_even(cell, tone, h, hu, hv)
        if lit and not uneven and (tone.size == 0 or (ok and _is_small(planes))):
            value = patch_factor(cell, x, n, cone, flags, quadric, eps, rounding)
            out[3] += value
            if tone.size:
                value *= _mean_luminance(cell, n, tone, np.int64(-1), h, hu, hv)
            out[0] += value
            continue
        surface(cell, 0.5, 0.5, h, hu, hv)
        r2 = h[0] ** 2 + h[1] ** 2 + h[2] ** 2
        det = abs(
            h[0] * (hu[1] * hv[2] - hu[2] * hv[1])
            + h[1] * (hu[2] * hv[0] - hu[0] * hv[2])
            + h[2] * (hu[0] * hv[1] - hu[1] * hv[0])
        )
        reach = math.sqrt(r2)
        estimate = (
            det
            / (math.pi * r2 * r2)
            * max(n[0] * h[0] + n[1] * h[1] + n[2] * h[2], 0.1 * reach if ok else reach)
        )
        if (
            (ok and estimate < cell_eps)
            or level >= deepest
            or top + 4 > _STACK
            or out[2] > MAX_CELLS
        ):
            value = patch_factor(cell, x, n, cone, flags, quadric, max(eps, 1e-4), rounding)
            if value > 0.0:
                share = 1.0
                samples = 2 if value > 0.125 * cell_eps else 1
                # The same for every receiver, so that moving a scene changes no sample.
                seed = _scrambled(np.int64(out[2]) * 7919 + level) + _hashed(number)
                if not lit:
                    share = _visible_share(
                        cell, n, facing > 0, x, blockers, mine, count, samples, seed, work,
                        h, hu, hv,
                    )  # fmt: skip
                out[3] += value * share
                if tone.size:
                    patches = tone[0] == PATCHES
                    value *= _mean_luminance(cell, n, tone, seed if patches else -1, h, hu, hv)
                out[0] += value * share
                if uneven:
                    # Of patches as different as they are bright, told by the same four points.
                    out[1] += value * value * 0.03125
                if not lit:
                    # Deviation of the share of a cell: a single sample of one that an edge cuts
                    # anywhere is off by 0.41, the root of the mean of s (1 - s); four that
                    # differ tell an edge (0.18), four alike make one unlikely (0.06).
                    spread = 1.0 / 6.0
                    if samples == 2:
                        spread = 0.03125 if 0.0 < share < 1.0 else 0.0039
                    out[1] += value * value * spread
            continue
        halve_u(cell, low_u, high_u)
        halve_v(low_u, stack[top], stack[top + 1])
        halve_v(high_u, stack[top + 2], stack[top + 3])
        for k in range(4):
            depth[top + k] = level + 1
        top += 4
