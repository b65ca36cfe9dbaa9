"""Shafts from points to what they see, and whether balls reach into them."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import lean, parallel

#: Rounding of distances, relative to them.
_ROUNDING = 1e-9


class Seen(NamedTuple):
    """What shafts end on; row j of every array is the same element of n.

    Attributes
    ----------
    spheres : (4, n) array
        About the elements. [m]
    planes : (n, 4) array
        Unit normal and offset of flat elements: nothing behind them is on the way. Others have a
        normal of 0 and an offset of −∞. [m]
    corners : (n, 4, 3) array
        Of flat elements that lie within them, counter-clockwise about the normal; all alike for
        others. [m]
    """

    spheres: np.ndarray
    planes: np.ndarray
    corners: np.ndarray


class Places(NamedTuple):
    """Balls about what has moved, where it was and where it is: in three levels, each in the next.

    Attributes
    ----------
    wholes, whole_ranges : (w, 4) and (w, 2) int array
        About all of it [m], and first and end of the parts in each.
    parts, part_ranges : (h, 4) and (h, 2) int array
        About the parts, and first and end of the patches in each.
    patches : (b, 4) array
        About the patches.
    """

    wholes: np.ndarray
    whole_ranges: np.ndarray
    parts: np.ndarray
    part_ranges: np.ndarray
    patches: np.ndarray


@lean
def meets(x, y, z, sphere, plane, ball, more):
    """Whether a ball, grown by ``more``, reaches into the hull of a point and a sphere.

    What lies wholly behind ``plane``, that of a flat element in the sphere, does not.
    """
    radius = ball[3] + more
    before = radius - plane[3] + plane[0] * ball[0] + plane[1] * ball[1] + plane[2] * ball[2]
    if before <= 0.0:
        return False
    bx, by, bz = ball[0] - x, ball[1] - y, ball[2] - z
    sx, sy, sz = sphere[0] - x, sphere[1] - y, sphere[2] - z
    length2 = max(sx * sx + sy * sy + sz * sz, 1e-300)
    along = (bx * sx + by * sy + bz * sz) / length2
    # The shaft lies in a cone with a cap: as wide at t as t times the sphere.
    reach = (radius + sphere[3]) / math.sqrt(length2)
    t = min(max(along, 0.0), 1.0)
    dx, dy, dz = bx - t * sx, by - t * sy, bz - t * sz
    wide = radius + min(1.0, max(0.0, along) + reach) * sphere[3]
    return dx * dx + dy * dy + dz * dz < wide * wide


@lean
def is_before(x, y, z, normal, ball, more):
    """Whether any of a ball, grown by ``more``, is before the plane of a receiver."""
    bx, by, bz = ball[0] - x, ball[1] - y, ball[2] - z
    return normal[0] * bx + normal[1] * by + normal[2] * bz + ball[3] + more > 0.0


@lean
def _beside(x, y, z, plane, corners, ball, more):
    """Whether a ball lies wholly beside the pyramid of a flat element that is seen from its front.

    The pyramid's sides hold the receiver and two corners each.
    """
    if plane[0] * x + plane[1] * y + plane[2] * z <= plane[3]:
        return False
    bx, by, bz, radius = ball[0] - x, ball[1] - y, ball[2] - z, ball[3] + more
    ax, ay, az = corners[3, 0] - x, corners[3, 1] - y, corners[3, 2] - z
    for k in range(4):
        cx, cy, cz = corners[k, 0] - x, corners[k, 1] - y, corners[k, 2] - z
        ex, ey, ez = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
        out = ex * bx + ey * by + ez * bz
        # Inside a pyramid seen from the front of its element all are negative.
        wide = radius * radius * (ex * ex + ey * ey + ez * ez) * (1.0 + _ROUNDING)
        if out > 0.0 and out * out > wide:
            return True
        ax, ay, az = cx, cy, cz
    return False


@lean
def find_near(x, y, z, ball, more, spheres, near):
    """Mark in ``near`` (n,) the elements that may meet a ball; nearly all do not.

    As `meets`, with a cylinder in place of the cone.
    """
    bx, by, bz, radius = ball[0] - x, ball[1] - y, ball[2] - z, ball[3] + more
    square = bx * bx + by * by + bz * bz
    cx, cy, cz, radii = spheres[0], spheres[1], spheres[2], spheres[3]
    for j in range(near.shape[0]):
        sx, sy, sz = cx[j] - x, cy[j] - y, cz[j] - z
        dot = bx * sx + by * sy + bz * sz
        length2 = max(sx * sx + sy * sy + sz * sz, 1e-300)
        t = min(max(dot / length2, 0.0), 1.0)
        wide = radius + radii[j]
        away = square - t * (2.0 * dot - t * length2)
        near[j] = away <= wide * wide * (1.0 + _ROUNDING)


@lean
def meets_parts(x, y, z, normal, more, seen, j, places, whole):
    """Whether any part of a ``whole`` place may reach into the shaft to element ``j``."""
    sphere, plane, corners = seen.spheres[:, j], seen.planes[j], seen.corners[j]
    for h in range(places.whole_ranges[whole, 0], places.whole_ranges[whole, 1]):
        ball = places.parts[h]
        if not is_before(x, y, z, normal, ball, more) or not meets(
            x, y, z, sphere, plane, ball, more
        ):
            continue
        if not _beside(x, y, z, plane, corners, ball, more):
            return True
    return False


@lean
def _meets_patches(x, y, z, normal, more, seen, j, places, whole):
    """Whether any patch of a ``whole`` place reaches into the shaft to element ``j``."""
    sphere, plane, corners = seen.spheres[:, j], seen.planes[j], seen.corners[j]
    for h in range(places.whole_ranges[whole, 0], places.whole_ranges[whole, 1]):
        if not meets(x, y, z, sphere, plane, places.parts[h], more):
            continue
        if _beside(x, y, z, plane, corners, places.parts[h], more):
            continue
        for b in range(places.part_ranges[h, 0], places.part_ranges[h, 1]):
            ball = places.patches[b]
            if not is_before(x, y, z, normal, ball, more):
                continue
            if not meets(x, y, z, sphere, plane, ball, more):
                continue
            if not _beside(x, y, z, plane, corners, ball, more):
                return True
    return False


@parallel
def find_touched_points(points, normals, seen, places, touched):
    """Mark points from which something of a place may be in the way to anything.

    Parameters
    ----------
    points, normals : (m, 3) array
        Points [m] and unit normals.
    seen : Seen
        What is looked at.
    places : Places
        What may be in the way; what lies wholly behind a point's surface is not.
    touched : (m,) bool array
        Set where it is so.
    """
    for i in nb.prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        near = np.empty(seen.spheres.shape[1], dtype=np.bool_)
        for w in range(places.wholes.shape[0]):
            ball = places.wholes[w]
            if touched[i] or not is_before(x, y, z, normals[i], ball, 0.0):
                continue
            find_near(x, y, z, ball, 0.0, seen.spheres, near)
            for j in range(near.shape[0]):
                if near[j] and _meets_patches(x, y, z, normals[i], 0.0, seen, j, places, w):
                    touched[i] = True
                    break


@parallel
def find_touched_pairs(nodes, normals, lifts, factors, seen, places, open_rows, touched, again):
    """Mark pairs of receiver and element whose shaft something of a place may reach into.

    Where no shaft to anything that is seen is met, the places are out of sight, and no pair is.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    lifts : (m,) array
        By how much the balls are larger for each receiver. [m]
    factors : (m, n) array
        Form factors: what a receiver sees is what has one above 0.
    seen : Seen
        The elements.
    places : Places
        What matters; what lies wholly behind a receiver does not.
    open_rows : (m,) bool array
        Receivers that see something besides the elements: they see any ball before them.
    touched : (m, n) bool array
        Set where it is so. What is set before, as for elements that have moved, stays only where
        places are in sight.
    again : (m,) bool array
        Receivers of which all is set before; set where places are in sight.
    """
    for i in nb.prange(nodes.shape[0]):
        if again[i]:
            continue
        some, near = False, np.empty(factors.shape[1], dtype=np.bool_)
        for q in range(nodes.shape[1]):
            x, y, z, more = nodes[i, q, 0], nodes[i, q, 1], nodes[i, q, 2], lifts[i]
            normal = normals[i, q]
            if open_rows[i]:
                for b in range(places.patches.shape[0]):
                    some |= is_before(x, y, z, normal, places.patches[b], more)
            for w in range(places.wholes.shape[0]):
                ball = places.wholes[w]
                if not is_before(x, y, z, normal, ball, more):
                    continue
                find_near(x, y, z, ball, more, seen.spheres, near)
                for j in range(factors.shape[1]):
                    if not near[j]:
                        continue
                    in_sight = factors[i, j] > 0.0
                    if touched[i, j] and (some or not in_sight):
                        continue
                    if _meets_patches(x, y, z, normal, more, seen, j, places, w):
                        touched[i, j] = True
                        some |= in_sight
        again[i] = some
        if not some:
            for j in range(factors.shape[1]):
                touched[i, j] = False
