"""Light of a small disc at infinity, the sun's, past flat surfaces with straight sides: exact.

Seen from a receiver such a surface is an intersection of half-spaces through it, one a side; on the
plane perpendicular to the direction of the disc, one of half-planes. The disc is swept by parallel
lines: on each a surface hides one interval, and what is left over is a sum of lengths. Between the
places at which lines of sides cross each other or the rim, it is smooth, and integrated by Gauss'
rule in the angle of the rim.
"""

import math

import numba as nb
import numpy as np

from .compiled import lean, parallel
from .contour import horizon_tolerance
from .pyramid import NO_BLOCKER, see_blockers
from .sky_line import hide, sort_few

#: What is returned where the disc cannot be told.
LEFT = -1.0
#: Surfaces and lines of their sides that may lie across a disc.
_SURFACES, _LINES = 12, 32
#: Gauss' rule of six points on 0 … 1.
_AT = (0.0337652428984240, 0.1693953067668677, 0.3806904069584016)
_WEIGHT = (0.0856622461895852, 0.1803807865240693, 0.2339569672863455)
#: Sine of an angle that is rounding.
_TINY = 1e-13


@lean
def frame(s, e1, e2):
    """Unit vectors perpendicular to ``s`` and to each other."""
    if abs(s[2]) < 0.9:
        size = math.sqrt(s[0] * s[0] + s[1] * s[1])
        e1[0], e1[1], e1[2] = -s[1] / size, s[0] / size, 0.0
    else:
        size = math.sqrt(s[1] * s[1] + s[2] * s[2])
        e1[0], e1[1], e1[2] = 0.0, s[2] / size, -s[1] / size
    e2[0] = s[1] * e1[2] - s[2] * e1[1]
    e2[1] = s[2] * e1[0] - s[0] * e1[2]
    e2[2] = s[0] * e1[1] - s[1] * e1[0]


@lean
def cone_of(sphere, x, sine, cosine, cone):
    """Direction of the middle of ``sphere`` (4,) from ``x``, and the cosine of how far from it the
    middle of a disc, of a radius of this ``sine`` and ``cosine``, may be and still meet the sphere.

    ``cone`` (4,) receives both; -1 for the cosine within the sphere.
    """
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    away = math.sqrt(dx * dx + dy * dy + dz * dz)
    cone[3] = -1.0
    if away > sphere[3]:
        reach = sphere[3] / away
        cone[0], cone[1], cone[2] = dx / away, dy / away, dz / away
        cone[3] = math.sqrt(1.0 - reach * reach) * cosine - reach * sine


@lean
def meets_cone(cone, s):
    """Whether a disc about ``s`` may meet the sphere of ``cone``."""
    return cone[3] <= -1.0 or cone[0] * s[0] + cone[1] * s[1] + cone[2] * s[2] >= cone[3]


@lean
def side_planes(shifted, planes):
    """Inward planes (4, 3) of the cone that a flat surface with straight sides fills.

    Sides of no length have none: zeros. Returns whether there is a cone.
    """
    mx = my = mz = 0.0
    for k in range(4):
        i, j = (0 if k < 2 else 3), (0 if k == 0 or k == 3 else 3)
        w = shifted[i, j, 3]
        mx, my, mz = mx + shifted[i, j, 0] / w, my + shifted[i, j, 1] / w, mz + shifted[i, j, 2] / w
    some = False
    for k in range(4):
        i, j = (0 if k < 2 else 3), (0 if k == 0 or k == 3 else 3)
        a, b = (0 if (k + 1) % 4 < 2 else 3), (0 if (k + 1) % 4 == 0 or (k + 1) % 4 == 3 else 3)
        px, py, pz = shifted[i, j, 0], shifted[i, j, 1], shifted[i, j, 2]
        qx, qy, qz = shifted[a, b, 0], shifted[a, b, 1], shifted[a, b, 2]
        x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        size = math.sqrt(x * x + y * y + z * z)
        length = math.sqrt((px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz))
        if size <= _TINY * length:
            planes[k, 0] = planes[k, 1] = planes[k, 2] = 0.0
            continue
        inside = x * mx + y * my + z * mz
        sign = 1.0 / size if inside > 0.0 else -1.0 / size
        planes[k, 0], planes[k, 1], planes[k, 2] = sign * x, sign * y, sign * z
        some = True
    return some


@lean
def _across(planes, s, sine):
    """Whether a cone hides all of the disc about ``s`` (1), none of it (0), or some (−1)."""
    covered = 1
    for k in range(4):
        x, y, z = planes[k, 0], planes[k, 1], planes[k, 2]
        if x == 0.0 and y == 0.0 and z == 0.0:
            continue
        height = x * s[0] + y * s[1] + z * s[2]
        if height <= -sine:
            return 0
        if height < sine:
            covered = -1
    return covered


@lean
def _add_crossings(lines, count, radius, breaks):
    """Places along the first axis, as angles on the rim, at which the light has kinks."""
    made = 0
    for i in range(count):
        a, b, c = lines[i, 0], lines[i, 1], lines[i, 2]
        square = b * b + c * c
        if square <= 0.0:
            continue
        far = square * radius * radius - a * a
        if far > 0.0:
            root = math.sqrt(far)
            for sign in (-1.0, 1.0):
                x = (-a * b + sign * c * root) / square
                if abs(x) < radius and made < breaks.shape[0] - 2:
                    breaks[made] = math.asin(x / radius)
                    made += 1
        for j in range(i):
            det = b * lines[j, 2] - c * lines[j, 1]
            if abs(det) <= 1e-15:
                continue
            x = (c * lines[j, 0] - a * lines[j, 2]) / det
            y = (a * lines[j, 1] - b * lines[j, 0]) / det
            if x * x + y * y < radius * radius and made < breaks.shape[0] - 2:
                breaks[made] = math.asin(x / radius)
                made += 1
    return made


@lean
def _free(x, half, cover, owners, lines, hidden, p, q, r):
    """∫ (p + q x + r y) dy over what is free of the line at ``x`` of half length ``half``."""
    hid = 0
    first = 0
    for m in range(cover):
        low, high = -half, half
        for k in range(first, owners[m]):
            level = lines[k, 0] + lines[k, 1] * x
            slope = lines[k, 2]
            if slope > 0.0:
                low = max(low, -level / slope)
            elif slope < 0.0:
                high = min(high, -level / slope)
            elif level < 0.0:
                high = low
        first = owners[m]
        hid = hide(low, high, hidden, hid)
    total, at = 0.0, -half
    for k in range(hid + 1):
        end = half if k == hid else min(hidden[k, 0], half)
        if end > at:
            total += (end - at) * (p + q * x + 0.5 * r * (end + at))
        if k < hid:
            at = max(at, hidden[k, 1])
    return total


@lean
def disc_light(s, n, radius, planes, usable, cover_list, count, work):
    """Light of a disc of 1 lx facing it, about ``s``, on a receiver with normal ``n``; or `LEFT`.

    Parameters
    ----------
    s, n : (3,) array
        Unit vectors.
    radius : float
        Tangent of the angular radius.
    planes : (p, 4, 3) array
        Of `side_planes`.
    usable : (p,) bool array
        Which surfaces have them.
    cover_list : (k,) int array
        The first ``count``: surfaces that may lie across the disc.
    work : Disc
        Scratch.
    """
    cosine = n[0] * s[0] + n[1] * s[1] + n[2] * s[2]
    sine = radius / math.sqrt(1.0 + radius * radius)
    lines, owners, cover, used = work[0], work[1], 0, 0
    e1, e2 = work[4], work[5]
    made = False
    for i in range(count):
        b = cover_list[i]
        if not usable[b]:
            return LEFT
        across = _across(planes[b], s, sine)
        if across == 0:
            continue
        if across == 1:
            return 0.0
        if cover == owners.shape[0] or used + 4 > lines.shape[0]:
            return LEFT
        if not made:
            frame(s, e1, e2)
            made = True
        for k in range(4):
            a = planes[b, k]
            if a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0:
                continue
            height = a[0] * s[0] + a[1] * s[1] + a[2] * s[2]
            if height >= sine:
                continue
            lines[used, 0] = height
            lines[used, 1] = a[0] * e1[0] + a[1] * e1[1] + a[2] * e1[2]
            lines[used, 2] = a[0] * e2[0] + a[1] * e2[1] + a[2] * e2[2]
            used += 1
        owners[cover] = used
        cover += 1
    if cover == 0 and cosine >= sine and s[2] >= sine:
        return cosine
    for k in range(2):  # what is below the receiver's own horizon, or that of all, is hidden by it
        ux, uy, uz = (n[0], n[1], n[2]) if k == 0 else (0.0, 0.0, 1.0)
        height = ux * s[0] + uy * s[1] + uz * s[2]
        if height >= sine:
            continue
        if cover == owners.shape[0] or used == lines.shape[0]:
            return LEFT
        if not made:
            frame(s, e1, e2)
            made = True
        lines[used, 0] = -height
        lines[used, 1] = -(ux * e1[0] + uy * e1[1] + uz * e1[2])
        lines[used, 2] = -(ux * e2[0] + uy * e2[1] + uz * e2[2])
        used += 1
        owners[cover] = used
        cover += 1
    breaks, hidden = work[2], work[3]
    made_breaks = _add_crossings(lines, used, radius, breaks)
    breaks[made_breaks], breaks[made_breaks + 1] = -0.5 * math.pi, 0.5 * math.pi
    sort_few(breaks, made_breaks + 2)
    q = n[0] * e1[0] + n[1] * e1[1] + n[2] * e1[2]
    r = n[0] * e2[0] + n[1] * e2[1] + n[2] * e2[2]
    total = 0.0
    for i in range(made_breaks + 1):
        width = breaks[i + 1] - breaks[i]
        if width <= 1e-12:
            continue
        for k in range(6):
            at = _AT[k] if k < 3 else 1.0 - _AT[5 - k]
            weight = _WEIGHT[k] if k < 3 else _WEIGHT[5 - k]
            angle = breaks[i] + at * width
            half = radius * math.cos(angle)
            x = radius * math.sin(angle)
            light = _free(x, half, cover, owners, lines, hidden, cosine, q, r)
            total += weight * width * half * light
    return max(total, 0.0) / (math.pi * radius * radius)


@parallel
def disc_rows(nodes, normals, suns, radius, blockers, straight, trace, out):
    """Light of the sun at k places on m receivers, by 1 lx on a plane facing it.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals.
    suns : (k, 3) array
        Unit vectors to the sun.
    radius : float
        Tangent of its angular radius.
    blockers : Blockers
        What hides.
    straight : (p,) bool array
        Which are flat, convex, and have straight sides.
    trace : bool
        Whether anything hides anything.
    out : (m, k) array
        Receives the light; `LEFT` where it cannot be told here.
    """
    p = blockers.nets.shape[0]
    sine = radius / math.sqrt(1.0 + radius * radius)
    cos_r = math.sqrt(1.0 - sine * sine)
    for i in nb.prange(nodes.shape[0]):
        shifted, state = np.empty((p, 4, 4, 4)), np.empty(p, dtype=np.int64)
        planes, usable = np.empty((p, 4, 3)), np.empty(p, dtype=np.bool_)
        cones, near = np.empty((p, 4)), np.empty(p, dtype=np.int64)
        cover = np.empty(p, dtype=np.int64)
        work = (
            np.empty((_LINES, 3)),
            np.empty(_SURFACES, dtype=np.int64),
            np.empty(_LINES * (_LINES + 3)),
            np.empty((_SURFACES + 1, 2)),
            np.empty(3),
            np.empty(3),
        )
        x, n = nodes[i], normals[i]
        listed = 0
        if trace:
            see_blockers(blockers, x, n, horizon_tolerance(x), shifted, state)
            for b in range(p):
                if state[b] == NO_BLOCKER:
                    continue
                cone_of(blockers.spheres[b], x, sine, cos_r, cones[listed])
                usable[b] = straight[b] and side_planes(shifted[b], planes[b])
                near[listed] = b
                listed += 1
        for k in range(suns.shape[0]):
            s = suns[k]
            if n[0] * s[0] + n[1] * s[1] + n[2] * s[2] <= -sine or s[2] <= -sine:
                out[i, k] = 0.0
                continue
            count = 0
            for c in range(listed):
                if meets_cone(cones[c], s):
                    cover[count] = near[c]
                    count += 1
            out[i, k] = disc_light(s, n, radius, planes, usable, cover, count, work)
