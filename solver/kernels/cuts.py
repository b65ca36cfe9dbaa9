"""Where meridian half-planes about a receiver's normal cut convex polygons.

Every vertex is given a place on the circle of the meridians once, so that both neighbours of an
edge find the same meridians crossing it. Seen from a receiver at the origin, the plane through an
edge a b has the normal m = a × b, and a point of the edge at azimuth φ has the tangent of elevation

    τ = −(m_x cos φ + m_y sin φ) / m_z

The reversed edge has −m, and gets the same τ to the bit.
"""

import math

import numpy as np

from .compiled import lean

#: Stands for the tangent of the zenith.
ZENITH = 1e15
#: Error of `azimuth_turn`.
TURN_ERROR = 1e-8


@lean
def azimuth_turn(x, y):
    """Azimuth of (x, y) in turns, 0 … 1, to 3e-9.

    Polynomial: least squares fit of atan(z)/(2 π z) in z², |z| <= 1.
    """
    ax, ay = abs(x), abs(y)
    z = min(ax, ay) / max(max(ax, ay), 1e-300)
    q = z * z
    r = 0.00677803 + q * (-0.00254728 + q * 0.00045106)
    r = -0.02260409 + q * (0.01692892 + q * (-0.01192937 + q * r))
    turn = z * (0.15915494 + q * (-0.05305122 + q * (0.03181903 + q * r)))
    turn = 0.25 - turn if ay > ax else turn
    turn = 0.5 - turn if x < 0.0 else turn
    return 1.0 - turn if y < 0.0 else turn


@lean
def tangent_frame(n, turn, frame):
    """Two unit vectors (2, 3) square to ``n`` and to each other, turned by ``turn`` [rad]."""
    k = 0
    if abs(n[1]) < abs(n[k]):
        k = 1
    if abs(n[2]) < abs(n[k]):
        k = 2
    ex = -n[k] * n[0] + (1.0 if k == 0 else 0.0)
    ey = -n[k] * n[1] + (1.0 if k == 1 else 0.0)
    ez = -n[k] * n[2] + (1.0 if k == 2 else 0.0)
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / size, ey / size, ez / size
    fx, fy, fz = n[1] * ez - n[2] * ey, n[2] * ex - n[0] * ez, n[0] * ey - n[1] * ex
    c, s = math.cos(turn), math.sin(turn)
    frame[0, 0], frame[0, 1], frame[0, 2] = c * ex + s * fx, c * ey + s * fy, c * ez + s * fz
    frame[1, 0], frame[1, 1], frame[1, 2] = c * fx - s * ex, c * fy - s * ey, c * fz - s * ez


@lean
def place_points(x, n, frame, points, first, end, axes, local, before):
    """Places of points about a receiver.

    Parameters
    ----------
    points : (3, v) array
        The points [m]; ``first`` … ``end`` of them are placed.
    axes : (3 lines, 2) array
        Cosine and sine of the azimuths of the meridians, three times over.
    local : (4, v) array
        Receives along the frame and the normal where each point is [m], and the number of the last
        meridian before it, with a fraction.
    before : (v,) int array
        Receives these numbers without fraction.
    """
    lines = axes.shape[0] // 3
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    # Indices from 0 on: only then are several points done at a time.
    px, py, pz = points[0, first:end], points[1, first:end], points[2, first:end]
    along, across, up = local[0, first:end], local[1, first:end], local[2, first:end]
    place, line = local[3, first:end], before[first:end]
    for v in range(px.shape[0]):
        dx, dy, dz = px[v] - x0, py[v] - x1, pz[v] - x2
        along[v] = f0 * dx + f1 * dy + f2 * dz
        across[v] = g0 * dx + g1 * dy + g2 * dz
        up[v] = n0 * dx + n1 * dy + n2 * dz
    # Close to a meridian the side must be the true one: edges would not end where they seem to.
    near, close = TURN_ERROR * lines, 0
    for v in range(px.shape[0]):
        turn = azimuth_turn(along[v], across[v]) * lines
        place[v] = turn
        line[v] = int(turn)
        close += 1 if abs(turn - np.floor(turn + 0.5)) <= near else 0
    if close == 0:
        return
    for v in range(px.shape[0]):
        k = int(place[v] + 0.5)
        if abs(place[v] - k) > near:
            continue
        if across[v] * axes[k, 0] - along[v] * axes[k, 1] >= 0.0:
            place[v] = float(k if k < lines else 0)
        else:
            place[v] = (k if k > 0 else lines) - 0.5 * near
        line[v] = int(place[v])


@lean
def _step(pa, pb, lines):
    """How many meridians an edge between two places crosses, with the sign of its direction."""
    step = int(pb) - int(pa)
    if pb - pa > 0.5 * lines:
        step -= lines
    elif pb - pa < -0.5 * lines:
        step += lines
    return step


@lean
def _tangent(ax, ay, az, bx, by, bz, cos, sin):
    """Tangent of the elevation of an edge that lies nearly in its meridian or crosses the axis."""
    da, db = ay * cos - ax * sin, by * cos - bx * sin
    across = abs(da) + abs(db)
    t = abs(da) / across if across > 0.0 else 0.5
    z = (1.0 - t) * az + t * bz
    rho = (1.0 - t) * (ax * cos + ay * sin) + t * (bx * cos + by * sin)
    if rho > 1e-14 * abs(z):
        return min(max(z / rho, -ZENITH), ZENITH)
    return ZENITH if z > 0.0 else -ZENITH


@lean
def cut_polygon(local, corners, f, upward, axes, ends):
    """Cut a polygon of four corners that shows its front with all meridians.

    Parameters
    ----------
    local : (4, v) array
        From `place_points`.
    corners : (f, 4) int array
        Columns of ``local`` of each polygon, counter-clockwise as they are seen.
    f : int
        Which one.
    upward : bool
        Whether it is above the receiver where its axis meets it.
    axes : (3 lines, 2) array
        As in `place_points`.
    ends : (3 lines, 2) array
        Receives the tangents between which each meridian lies in the polygon.

    Returns
    -------
    first, end : int
        The meridians that cross it, modulo ``lines``: rows of ``ends``.
    """
    lines = axes.shape[0] // 3
    a = corners[f, 3]
    ax, ay, az, pa = local[0, a], local[1, a], local[2, a], local[3, a]
    at = lines + int(pa)
    start, first, end = at, at, at
    before, turns = 0, 0
    for e in range(4):
        b = corners[f, e]
        bx, by, bz, pb = local[0, b], local[1, b], local[2, b], local[3, b]
        step = _step(pa, pb, lines)
        if step != 0:
            turns += 1 if step * before < 0 else 0
            before = step
            mz = ax * by - ay * bx
            known = 1e-12 * (abs(ax) + abs(ay)) * (abs(bx) + abs(by))
            # The upper side of a polygon that is seen from its front runs upwards in azimuth.
            side, low, high = (1, at + 1, at + step + 1) if step > 0 else (0, at + step + 1, at + 1)
            if low < 0 or high > 3 * lines:
                turns = 3  # three times about the axis: it crosses itself
                break
            if (mz if step > 0 else -mz) > known:
                p, q = (az * by - bz * ay) / mz, (bz * ax - az * bx) / mz
                for k in range(low, high):
                    ends[k, side] = p * axes[k, 0] + q * axes[k, 1]
            else:
                for k in range(low, high):
                    ends[k, side] = _tangent(ax, ay, az, bx, by, bz, axes[k, 0], axes[k, 1])
            at += step
            first, end = min(first, at), max(end, at)
        ax, ay, az, pa = bx, by, bz, pb
    if at != start or turns > 2:
        _cut_oddly(local, corners, f, upward, at != start, axes, ends)
        return lines, 2 * lines
    return first + 1, end + 1


@lean
def _cut_oddly(local, corners, f, upward, about_axis, axes, ends):
    """Cut a polygon about the axis, or a warped one that crosses itself as it is seen."""
    lines = axes.shape[0] // 3
    for k in range(lines, 2 * lines):
        ends[k, 0], ends[k, 1] = np.inf, -np.inf
    for e in range(4):
        a, b = corners[f, e], corners[f, (e + 1) % 4]
        step = _step(local[3, a], local[3, b], lines)
        start = int(local[3, a])
        if step < 0:
            start += step
        ax, ay, az = local[0, a], local[1, a], local[2, a]
        bx, by, bz = local[0, b], local[1, b], local[2, b]
        mz = ax * by - ay * bx
        known = 1e-12 * (abs(ax) + abs(ay)) * (abs(bx) + abs(by))
        plain = (mz if step > 0 else -mz) > known
        for m in range(start + 1, start + abs(step) + 1):
            k = lines + m % lines
            if plain:
                p, q = (az * by - bz * ay) / mz, (bz * ax - az * bx) / mz
                tangent = p * axes[k, 0] + q * axes[k, 1]
            else:
                tangent = _tangent(ax, ay, az, bx, by, bz, axes[k, 0], axes[k, 1])
            ends[k, 0], ends[k, 1] = min(ends[k, 0], tangent), max(ends[k, 1], tangent)
    if about_axis:
        # One crossing a meridian: up to the zenith or down to the nadir.
        for k in range(lines, 2 * lines):
            if upward:
                ends[k, 0], ends[k, 1] = min(ends[k, 0], ZENITH), ZENITH
            else:
                ends[k, 0] = -ZENITH
