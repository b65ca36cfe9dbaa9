"""Glossy reflection at points: light times Phong's lobe, over the solid angles of what shines.

Lamps are integrated over their surface: cells are quartered until they are small against the lobe,
or give too little to matter [1, sec. 4.2.3]. Whether a Gauss point of a cell is seen is told by a
ray. All else, which has no such contrast, is found by rays that are spread as the lobe is.

References
----------
.. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .bvh import STACK, trace_ray
from .compiled import lean, parallel
from .dimmed import left_on_ray
from .paths import LEAST_SHARE, MOST_MIRRORS, Walk, element_at, frame_at, mirrored, next_hit
from .ray_patch import MISS, WORK
from .sky_luminance import sky_luminance

#: How often a lamp's element is quartered at most, and a cell for a shadow edge on it.
_LEVELS, _SHADOW_LEVELS = 12, 7
#: Square of the relative deviation of what rays find from which more of them are asked.
_UNEVEN = 0.05**2
#: Points a thread takes at a time.
_GROUP = 16
#: Gauss' rule of three points on [0, 1].
_AT = (0.1127016653792583, 0.5, 0.8872983346207417)
_WEIGHT = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


class Shining(NamedTuple):
    """What lamps are, in k elements and c columns of light.

    Attributes
    ----------
    nets : (k, 4, 4, 4) array
        Homogeneous nets, +normal towards the side that shines.
    spheres : (k, 4) array
        About them.
    scales : (k,) array
        Their areas against what 3 x 3 Gauss points tell of them.
    luminance : (k, c) array
        By column. [cd/m²]
    brightness : (k,) array
        What counts for tolerances. [cd/m²]
    """

    nets: np.ndarray
    spheres: np.ndarray
    scales: np.ndarray
    luminance: np.ndarray
    brightness: np.ndarray


class Beyond(NamedTuple):
    """What is around the scene.

    Attributes
    ----------
    tone : (10,) array, or (0,)
        Luminance of the sky.
    sky, ground : (c,) array
        Columns of the sky by its luminance, and luminances of the ground. [cd/m²]
    sun : (5,) array
        Direction of the sun, cosine of its radius (2 without a sun) and solid angle. [sr]
    sun_light : (c,) array
        Its luminance. [cd/m²]
    """

    tone: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    sun: np.ndarray
    sun_light: np.ndarray


class Lobe(NamedTuple):
    """How glossy reflection is computed.

    Attributes
    ----------
    cosine : bool
        Whether light counts by its cosine; without, the lobe is that of [1, eq. 15].
    trace : bool
        Whether anything hides anything.
    eps : float
        Relative accuracy of lamps.
    rays, rounds : int
        Rays a direction for all else: as many squared a point, and as many times more at most where
        their deviation is more than a twentieth.
    near : float
        Distance within which rays do not hit what they start on. [m]
    """

    cosine: bool
    trace: bool
    eps: float
    rays: int
    rounds: int
    near: float


@lean
def albedo(exponent, cosine, rule):
    """Share of light from all directions that the lobe sends where its axis is at ``cosine``.

    ``rule`` (k, 2) are nodes and weights on [0, 1]: the integral over (cos α)^(n + 1); that about
    the axis is in closed form.
    """
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    total = 0.0
    for k in range(rule.shape[0]):
        c = rule[k, 0] ** (1.0 / (exponent + 1.0))
        a, b = c * cosine, math.sqrt(max(1.0 - c * c, 0.0)) * sine
        if a >= b:
            total += rule[k, 1] * a
        elif a > -b:
            turn = math.acos(-a / b)
            total += rule[k, 1] * (a * turn + b * math.sin(turn)) / math.pi
    return total * (exponent + 2.0) / (exponent + 1.0)


@lean
def _hidden(x, y, z, dx, dy, dz, reach, near, tree, walk):
    """Whether anything is met from (x, y, z) along the unit vector d before ``reach``. [m]"""
    facing_filter = tree.kinds.shape[0] * 0  # not literals: they would compile the callees anew
    found, _, _, _, _, _ = trace_ray(
        tree.bounds, tree.links, tree.piece_patch, tree.piece_box, tree.nets, tree.kinds,
        x, y, z, dx, dy, dz, near, reach - near,
        facing_filter, facing_filter == 0, walk.stack, walk.work,
    )  # fmt: skip
    return found != MISS


@lean
def _cell(x, n, axis, exponent, net, box, lobe, tree, panes, walk, pane, found):
    """One cell by 3 x 3 Gauss points into ``found`` (5,).

    Its share of the lobe, sine of its radius from the receiver, whether it is partly hidden (1, or
    0), its solid angle, and the least angle that it may have to the lobe's axis.
    """
    share = angle = 0.0
    seen, turned = 0, 0
    cx = cy = cz = 0.0
    widest = 0.0
    for k in range(9):
        # The middle first: the others are measured against it.
        at = 4 if k == 0 else (k - 1 if k <= 4 else k)
        i, j = at // 3, at % 3
        u = box[0] + (box[1] - box[0]) * _AT[i]
        v = box[2] + (box[3] - box[2]) * _AT[j]
        area = frame_at(net, u, v, walk.place)
        dx, dy, dz = walk.place[0] - x[0], walk.place[1] - x[1], walk.place[2] - x[2]
        r2 = dx * dx + dy * dy + dz * dz
        r = math.sqrt(max(r2, 1e-300))
        dx, dy, dz = dx / r, dy / r, dz / r
        if k == 0:
            cx, cy, cz = dx, dy, dz
        off = (dx - cx) ** 2 + (dy - cy) ** 2 + (dz - cz) ** 2
        widest = max(widest, off)
        there = -(dx * walk.place[3] + dy * walk.place[4] + dz * walk.place[5])
        here = dx * n[0] + dy * n[1] + dz * n[2]
        if there <= 0.0 or here <= 0.0:
            continue
        turned += 1
        solid = _WEIGHT[i] * _WEIGHT[j] * area * there / r2
        solid *= (box[1] - box[0]) * (box[3] - box[2])
        angle += solid
        cosine = dx * axis[0] + dy * axis[1] + dz * axis[2]
        if cosine <= 0.0:
            seen += 1
            continue
        if lobe.trace and _hidden(x[0], x[1], x[2], dx, dy, dz, r, lobe.near, tree, walk):
            continue
        seen += 1
        left = left_on_ray(
            panes, x[0], x[1], x[2], dx, dy, dz, lobe.near, r - lobe.near, walk, pane
        )
        share += left * solid * cosine**exponent * (here if lobe.cosine else 1.0)
    radius = 1.3 * math.sqrt(widest)  # to the corners, beyond the outer Gauss points
    middle = cx * axis[0] + cy * axis[1] + cz * axis[2]
    least = math.acos(min(max(middle, -1.0), 1.0)) - 2.0 * math.asin(min(0.5 * radius, 1.0))
    found[0], found[1] = share, radius
    found[2] = 1.0 if 0 < seen < 9 and (seen < turned or turned < 9) else 0.0
    found[3], found[4] = angle, max(least, 0.0)


@lean
def lamp_share(
    x, n, axis, exponent, net, scale, bright, floor, lobe, tree, panes, walk, pane, boxes, level,
    found,
):  # fmt: skip
    """Share of the lobe, without its factor, that one lamp element fills.

    ``scale`` is that of `Shining`, ``bright`` the luminance of the element and ``floor`` what is no
    longer seen beside it; ``pane`` (6,), ``boxes`` (s, 4), ``level`` (s,) and ``found`` (5,)
    are scratch.
    """
    sharp = max(exponent, 8.0)
    # Gauss' rule of degree 5 is off by the third power of this.
    small = 2.0 * lobe.eps ** (1.0 / 3.0)
    total = 0.0
    boxes[0, 0], boxes[0, 1], boxes[0, 2], boxes[0, 3] = 0.0, 1.0, 0.0, 1.0
    level[0] = 0
    top = 1
    while top > 0:
        top -= 1
        box = boxes[top]
        deep = level[top]
        _cell(x, n, axis, exponent, net, box, lobe, tree, panes, walk, pane, found)
        peak = 0.0
        if found[4] < 0.5 * math.pi:
            peak = math.cos(found[4]) ** exponent
        most = (exponent + 2.0) / (2.0 * math.pi) * peak * found[3] * bright
        wide = found[1] * found[1] * sharp > small and deep < _LEVELS
        torn = found[2] > 0.0 and deep < _SHADOW_LEVELS
        # A cell of which no point is above the horizon, or in front, may have some that are.
        unknown = found[3] == 0.0 and found[1] > 0.2 and deep < 3
        if ((wide or torn) and most > lobe.eps * floor) or unknown:
            u, v = 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3])
            u0, u1, v0, v1 = box[0], box[1], box[2], box[3]
            for k in range(4):
                boxes[top, 0], boxes[top, 1] = (u0, u) if k < 2 else (u, u1)
                boxes[top, 2], boxes[top, 3] = (v0, v) if k % 2 == 0 else (v, v1)
                level[top] = deep + 1
                top += 1
            continue
        total += found[0] * (scale if deep == 0 else 1.0)
    return total


@lean
def _in_lobe(x, n, axis, exponent, sphere, bright, floor, lobe):
    """Whether what is in a sphere may give more than the tolerance."""
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    if d <= 1.001 * sphere[3]:
        return True
    if dx * n[0] + dy * n[1] + dz * n[2] <= -sphere[3]:
        return False
    sine = sphere[3] / d
    cosine = (dx * axis[0] + dy * axis[1] + dz * axis[2]) / d
    least = math.acos(min(max(cosine, -1.0), 1.0)) - math.asin(sine)
    if least >= 0.5 * math.pi:
        return False
    peak = math.cos(max(least, 0.0)) ** exponent
    solid = 2.0 * math.pi * (1.0 - math.sqrt(1.0 - sine * sine))
    return (exponent + 2.0) / (2.0 * math.pi) * peak * solid * bright > 0.1 * lobe.eps * floor


@lean
def _sun_share(x, n, axis, exponent, sun, lobe, tree, panes, walk, pane):
    """Share of the lobe, without its factor, that the sun's disc fills: 1 + 6 + 12 places."""
    s = math.sqrt(max(1.0 - sun[3] * sun[3], 0.0))
    # Any two directions across the sun's.
    k = 0 if abs(sun[0]) < 0.6 else 1
    ax, ay, az = (0.0, sun[2], -sun[1]) if k == 0 else (-sun[2], 0.0, sun[0])
    size = math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / size, ay / size, az / size
    bx, by = sun[1] * az - sun[2] * ay, sun[2] * ax - sun[0] * az
    bz = sun[0] * ay - sun[1] * ax
    total = 0.0
    for place in range(19):
        ring = 0 if place == 0 else (1 if place < 7 else 2)
        # Middles of rings of equal area a place.
        r = 0.0 if ring == 0 else (0.483 if ring == 1 else 0.815)
        turn = 2.0 * math.pi * ((place - 1) / 6.0 if ring == 1 else (place - 6.5) / 12.0)
        p, q = r * s * math.cos(turn), r * s * math.sin(turn)
        dx, dy = sun[0] + p * ax + q * bx, sun[1] + p * ay + q * by
        dz = sun[2] + p * az + q * bz
        size = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / size, dy / size, dz / size
        here = dx * n[0] + dy * n[1] + dz * n[2]
        cosine = dx * axis[0] + dy * axis[1] + dz * axis[2]
        if here <= 0.0 or cosine <= 0.0:
            continue
        value = cosine**exponent * (here if lobe.cosine else 1.0)
        if value < 1e-12:
            continue
        if lobe.trace and _hidden(x[0], x[1], x[2], dx, dy, dz, 1e300, lobe.near, tree, walk):
            continue
        total += value * left_on_ray(
            panes, x[0], x[1], x[2], dx, dy, dz, lobe.near, 1e300, walk, pane
        )
    return sun[4] * total / 19.0


@lean
def _look(
    x, direction, share, light, emitted, beyond, tree, panes, sides, near, walk, pane, out
):  # fmt: skip
    """Add ``share`` times what is seen along a ray, over mirrors, to ``out`` (c,).

    Lamps count in mirrors only: those seen as such are integrated by themselves.
    """
    for k in range(3):
        walk.ray[k], walk.ray[3 + k] = x[k], direction[k]
    start, ray = share, walk.ray
    for turn in range(MOST_MIRRORS):
        hit, u, v = next_hit(tree, walk, near)
        if panes.nets.shape[0]:
            reach = 1e300 * start / start  # not a literal, as above
            if hit >= 0:
                reach = 0.0
                for k in range(3):
                    reach += (walk.place[k] - ray[k]) * ray[3 + k]
                reach -= near
            share *= left_on_ray(
                panes, ray[0], ray[1], ray[2], ray[3], ray[4], ray[5], near, reach, walk, pane
            )
        if hit < 0:
            if walk.ray[5] <= 0.0:
                for c in range(out.shape[0]):
                    out[c] += share * beyond.ground[c]
            elif beyond.tone.size:
                tone = beyond.tone
                level = sky_luminance(
                    tone, tone[7], tone[8], tone[9], walk.ray[3], walk.ray[4], walk.ray[5]
                )
                for c in range(out.shape[0]):
                    out[c] += share * level * beyond.sky[c]
            return
        e = element_at(sides, hit, u, v)
        if e < 0:
            return
        for c in range(out.shape[0]):
            out[c] += share * light[e, c]
            if turn > 0:
                out[c] += share * emitted[e, c]
        share *= sides.mirror[hit]
        if share <= LEAST_SHARE * start:
            return
        mirrored(walk.ray, walk.place)


@parallel
def lobe_light(
    points, normals, axes, exponents, floors, lobe, rule, shining, light, emitted, beyond, tree,
    panes, sides, out,
):  # fmt: skip
    """Radiance from glossy points for a glossy reflectance of 1.

    Parameters
    ----------
    points, normals : (m, 3) array
        Points [m] and unit normals.
    axes : (m, 3) array
        Where the view is mirrored to, of unit length.
    exponents, floors : (m,) array
        Sharpness of the lobes, and luminance that does not matter for each unit of accuracy.
    lobe, rule, shining, beyond, tree, panes, sides
        `Lobe`, the rule of `albedo`, `Shining`, `Beyond`, `paths.Tree`, `panes.Panes`, which are
        not in the tree, and `paths.Sides`.
    light, emitted : (n, c) array
        Luminance of the elements by what they reflect, and by what they emit. [cd/m²]
    out : (m, c + 1) array
        Receives the radiance by column, and the `albedo` of the lobe. [cd/m²]
    """
    columns = light.shape[1]
    for group in nb.prange((points.shape[0] + _GROUP - 1) // _GROUP):
        walk = Walk(np.empty(6), np.empty(6), np.empty(STACK, dtype=np.int64), np.empty(WORK))
        boxes, level = np.empty((4 * _LEVELS, 4)), np.empty(4 * _LEVELS, dtype=np.int64)
        found, d, seen, pane = np.empty(5), np.empty(3), np.empty(columns), np.empty(6)
        for i in range(group * _GROUP, min((group + 1) * _GROUP, points.shape[0])):
            x, n, axis, exponent = points[i], normals[i], axes[i], exponents[i]
            power = exponent + 2.0 if lobe.cosine else exponent + 1.0
            factor = power / (2.0 * math.pi)
            for k in range(shining.nets.shape[0]):
                bright = shining.brightness[k]
                if _in_lobe(x, n, axis, exponent, shining.spheres[k], bright, floors[i], lobe):
                    share = factor * lamp_share(
                        x, n, axis, exponent, shining.nets[k], shining.scales[k], bright, floors[i],
                        lobe, tree, panes, walk, pane, boxes, level, found,
                    )  # fmt: skip
                    for c in range(columns):
                        out[i, c] += share * shining.luminance[k, c]
            if beyond.sun[3] <= 1.0:
                share = factor * _sun_share(
                    x, n, axis, exponent, beyond.sun, lobe, tree, panes, walk, pane
                )
                for c in range(columns):
                    out[i, c] += share * beyond.sun_light[c]
            cosine = axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2]
            whole = albedo(exponent, cosine, rule) if lobe.cosine else 1.0
            out[i, columns] = whole
            if lobe.rays == 0:
                continue
            k = 0 if abs(axis[0]) < 0.6 else 1
            ax, ay, az = (0.0, axis[2], -axis[1]) if k == 0 else (-axis[2], 0.0, axis[0])
            size = math.sqrt(ax * ax + ay * ay + az * az)
            ax, ay, az = ax / size, ay / size, az / size
            bx, by = axis[1] * az - axis[2] * ay, axis[2] * ax - axis[0] * az
            bz = axis[0] * ay - axis[1] * ax
            seed = (i * 7919 + 12345) & 0x7FFFFFFF
            sum_of = first = second = 0.0
            shot = 0
            for c in range(columns):
                seen[c] = 0.0
            for _ in range(lobe.rounds):
                for a in range(lobe.rays):
                    for b in range(lobe.rays):
                        seed = (seed * 1103515245 + 12345) & 0x7FFFFFFF
                        s = (a + (seed >> 8) / 8388608.0) / lobe.rays
                        seed = (seed * 1103515245 + 12345) & 0x7FFFFFFF
                        turn = 2.0 * math.pi * (b + (seed >> 8) / 8388608.0) / lobe.rays
                        cosine = s ** (1.0 / (exponent + 1.0))
                        r = math.sqrt(max(1.0 - cosine * cosine, 0.0))
                        p, q = r * math.cos(turn), r * math.sin(turn)
                        d[0] = cosine * axis[0] + p * ax + q * bx
                        d[1] = cosine * axis[1] + p * ay + q * by
                        d[2] = cosine * axis[2] + p * az + q * bz
                        here = d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
                        shot += 1
                        if here <= 0.0:
                            continue
                        share = here if lobe.cosine else 1.0
                        sum_of += share
                        before = 0.0
                        for c in range(columns):
                            before -= seen[c]
                        _look(
                            x, d, share, light, emitted, beyond, tree, panes, sides, lobe.near,
                            walk, pane, seen,
                        )  # fmt: skip
                        for c in range(columns):
                            before += seen[c]
                        first += before
                        second += before * before
                if second <= first * first * (1.0 / shot + _UNEVEN):
                    break
            if sum_of > 0.0:
                if not lobe.cosine:
                    whole = sum_of / shot
                for c in range(columns):
                    out[i, c] += whole * seen[c] / sum_of
