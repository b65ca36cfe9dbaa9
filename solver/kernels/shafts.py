"""Shafts from points to what they see, and whether balls reach into them."""

import math

import numba as nb

from .compiled import kernel, lean, parallel


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
def _before(x, y, z, normal, ball, more):
    """Whether any of a ball, grown by ``more``, is before the plane of a receiver."""
    bx, by, bz = ball[0] - x, ball[1] - y, ball[2] - z
    return normal[0] * bx + normal[1] * by + normal[2] * bz + ball[3] + more > 0.0


@kernel
def find_touched(nodes, normals, factors, spheres, planes, balls, open_rows, touched):
    """Mark receivers whose sight of anything may pass through a ball.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    factors : (m, n) array
        Form factors: what a receiver sees is what has one above 0.
    spheres : (n, 4) array
        About the elements.
    planes : (n, 4) array
        Unit normal and offset of flat elements: nothing behind them is on the way. Others have a
        normal of 0 and an offset of −∞. [m]
    balls : (b, 4) array
        What matters; those wholly behind a receiver do not.
    open_rows : (m,) bool array
        Receivers that see something besides the elements: any ball before them matters.
    touched : (m,) bool array
        Set where it is so.
    """
    for i in range(nodes.shape[0]):
        for q in range(nodes.shape[1]):
            x, y, z = nodes[i, q, 0], nodes[i, q, 1], nodes[i, q, 2]
            for b in range(balls.shape[0]):
                if touched[i]:
                    break
                if not _before(x, y, z, normals[i, q], balls[b], 0.0):
                    continue
                if open_rows[i]:
                    touched[i] = True
                    break
                for j in range(spheres.shape[0]):
                    if factors[i, j] > 0.0 and meets(x, y, z, spheres[j], planes[j], balls[b], 0.0):
                        touched[i] = True
                        break


@parallel
def find_touched_pairs(
    nodes, normals, lifts, factors, spheres, planes, hulls, ranges, balls, open_rows, touched, again
):  # fmt: skip
    """Mark pairs of receiver and element whose shaft a ball may reach into.

    Where no shaft to anything that is seen is met, the balls are out of sight, and no pair is.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    lifts : (m,) array
        By how much the balls are larger for each receiver. [m]
    factors, spheres, planes
        As in `find_touched`.
    hulls : (h, 4) array
        Balls about some balls each.
    ranges : (h, 2) int array
        First and end of these.
    balls : (b, 4) array
        What matters; those wholly behind a receiver do not.
    open_rows : (m,) bool array
        Receivers that see something besides the elements: they see any ball before them.
    touched : (m, n) bool array
        Set where it is so. What is set before, as for elements that have moved, stays only where
        balls are in sight.
    again : (m,) bool array
        Receivers of which all is set before; set where balls are in sight.
    """
    for i in nb.prange(nodes.shape[0]):
        if again[i]:
            continue
        some = False
        for q in range(nodes.shape[1]):
            x, y, z, more = nodes[i, q, 0], nodes[i, q, 1], nodes[i, q, 2], lifts[i]
            for h in range(hulls.shape[0]):
                if not _before(x, y, z, normals[i, q], hulls[h], more):
                    continue
                bx, by, bz = hulls[h, 0] - x, hulls[h, 1] - y, hulls[h, 2] - z
                ball2, radius = bx * bx + by * by + bz * bz, hulls[h, 3] + more
                if open_rows[i]:
                    for b in range(ranges[h, 0], ranges[h, 1]):
                        some |= _before(x, y, z, normals[i, q], balls[b], more)
                for j in range(spheres.shape[0]):
                    seen = factors[i, j] > 0.0
                    if touched[i, j] and (some or not seen):
                        continue
                    # Most are far off: as for `meets`, with a cylinder in place of the cone.
                    sx, sy, sz = spheres[j, 0] - x, spheres[j, 1] - y, spheres[j, 2] - z
                    dot = bx * sx + by * sy + bz * sz
                    length2 = max(sx * sx + sy * sy + sz * sz, 1e-300)
                    t = min(max(dot / length2, 0.0), 1.0)
                    wide = radius + spheres[j, 3]
                    if ball2 - t * (2.0 * dot - t * length2) > wide * wide * (1.0 + 1e-9):
                        continue
                    if not meets(x, y, z, spheres[j], planes[j], hulls[h], more):
                        continue
                    for b in range(ranges[h, 0], ranges[h, 1]):
                        if _before(x, y, z, normals[i, q], balls[b], more) and meets(
                            x, y, z, spheres[j], planes[j], balls[b], more
                        ):
                            touched[i, j] = True
                            some |= seen
                            break
        again[i] = some
        if not some:
            for j in range(spheres.shape[0]):
                touched[i, j] = False
