"""Rays against flat convex quads with straight edges, by far the most common patches.

Such a patch covers exactly its quad, whatever its parametrisation: plane and edges decide.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .ray_nets import D1, D2, EPS, ROUNDING, load_nets, value_slopes

#: Kinds of patches, see `classify_patches`.
GENERAL, FLAT_QUAD = 0, 1


@lean
def hit_quad(net, t_min, t_max, work):
    """Ray in ``work`` against a `FLAT_QUAD`: (hit, t, facing); u and v by `quad_parameters`.

    The four edge tests are 2 x 2 determinants of homogeneous coordinates across the ray. Swapping
    the ends of an edge only flips their sign, so two quads sharing an edge cannot both miss.
    """
    ox, oy, oz = work[0], work[1], work[2]
    ax, ay, az = work[6], work[7], work[8]
    bx, by, bz = work[9], work[10], work[11]
    w0, w1, w2, w3 = net[0, 0, 3], net[3, 0, 3], net[3, 3, 3], net[0, 3, 3]
    x0, y0, z0 = net[0, 0, 0] - ox * w0, net[0, 0, 1] - oy * w0, net[0, 0, 2] - oz * w0
    x1, y1, z1 = net[3, 0, 0] - ox * w1, net[3, 0, 1] - oy * w1, net[3, 0, 2] - oz * w1
    x2, y2, z2 = net[3, 3, 0] - ox * w2, net[3, 3, 1] - oy * w2, net[3, 3, 2] - oz * w2
    x3, y3, z3 = net[0, 3, 0] - ox * w3, net[0, 3, 1] - oy * w3, net[0, 3, 2] - oz * w3
    f0, g0 = ax * x0 + ay * y0 + az * z0, bx * x0 + by * y0 + bz * z0
    f1, g1 = ax * x1 + ay * y1 + az * z1, bx * x1 + by * y1 + bz * z1
    f2, g2 = ax * x2 + ay * y2 + az * z2, bx * x2 + by * y2 + bz * z2
    f3, g3 = ax * x3 + ay * y3 + az * z3, bx * x3 + by * y3 + bz * z3
    s0, s1 = f0 * g1 - g0 * f1, f1 * g2 - g1 * f2
    s2, s3 = f2 * g3 - g2 * f3, f3 * g0 - g3 * f0
    origin = abs(ox) + abs(oy) + abs(oz)
    error = ROUNDING * max(
        max(abs(net[0, 0, 0]) + abs(net[0, 0, 1]) + abs(net[0, 0, 2]) + origin * w0,
            abs(net[3, 0, 0]) + abs(net[3, 0, 1]) + abs(net[3, 0, 2]) + origin * w1),
        max(abs(net[3, 3, 0]) + abs(net[3, 3, 1]) + abs(net[3, 3, 2]) + origin * w2,
            abs(net[0, 3, 0]) + abs(net[0, 3, 1]) + abs(net[0, 3, 2]) + origin * w3),
    )  # fmt: skip
    e0 = error * (abs(f1 - f0) + abs(g1 - g0))
    e1 = error * (abs(f2 - f1) + abs(g2 - g1))
    e2 = error * (abs(f3 - f2) + abs(g3 - g2))
    e3 = error * (abs(f0 - f3) + abs(g0 - g3))
    inside = s0 >= -e0 and s1 >= -e1 and s2 >= -e2 and s3 >= -e3
    if not inside and not (s0 <= e0 and s1 <= e1 and s2 <= e2 and s3 <= e3):
        return False, t_max, 0
    # Plane from the diagonals: defined as long as the quad has area.
    px, py, pz = x2 / w2 - x0 / w0, y2 / w2 - y0 / w0, z2 / w2 - z0 / w0
    qx, qy, qz = x3 / w3 - x1 / w1, y3 / w3 - y1 / w1, z3 / w3 - z1 / w1
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    slope = nx * work[3] + ny * work[4] + nz * work[5]
    length = math.sqrt((nx * nx + ny * ny + nz * nz) * work[12])
    if abs(slope) <= 8.0 * EPS * length:
        return False, t_max, 0  # seen edge-on, without area
    t = (nx * x0 + ny * y0 + nz * z0) / w0 / slope
    if not (t > t_min and t < t_max):
        return False, t_max, 0
    return True, t, (-1 if slope > 0.0 else 1)


@lean
def quad_parameters(net, work):
    """Parameters (u, v) at which the ray in ``work`` hits a `FLAT_QUAD`."""
    load_nets(net, work)
    u, v = 0.5, 0.5
    for _ in range(30):
        f, fu, fv = value_slopes(work, D1, u, v)
        g, gu, gv = value_slopes(work, D2, u, v)
        det = fu * gv - fv * gu
        if det == 0.0:
            break
        a = min(max(u - (gv * f - fv * g) / det, 0.0), 1.0)
        b = min(max(v - (fu * g - gu * f) / det, 0.0), 1.0)
        step = max(abs(a - u), abs(b - v))
        u, v = a, b
        if step < 1e-14:
            break
    return u, v


@kernel
def classify_patches(nets):
    """Kinds (p,) of nets (p, 4, 4, 4): `FLAT_QUAD` for a flat convex quad with straight edges.

    Convex corners and monotone edges make the patch cover exactly its quad when its parameters do
    not fold; folding is excluded by the signs of all products of control-net differences.
    """
    n = nets.shape[0]
    kinds = np.zeros(n, dtype=np.int64)
    points = np.empty((4, 4, 3))
    for p in range(n):
        size = 0.0
        for i in range(4):
            for j in range(4):
                for k in range(3):
                    points[i, j, k] = nets[p, i, j, k] / nets[p, i, j, 3]
        for i in range(4):
            for j in range(4):
                for k in range(3):
                    size = max(size, abs(points[i, j, k] - points[0, 0, k]))
        if _is_flat_quad(points, size):
            kinds[p] = FLAT_QUAD
    return kinds


@kernel
def _is_flat_quad(points, size):
    tolerance = 1e-13 * size
    for k in range(3):
        for i in range(4):
            for j in range(4):
                tolerance = max(tolerance, 2 * EPS * abs(points[i, j, k]))
    # Number by number: array expressions compile to far more code.
    p, q, center, r = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        p[k], q[k] = points[3, 3, k] - points[0, 0, k], points[0, 3, k] - points[3, 0, k]
        center[k] = 0.25 * (points[0, 0, k] + points[3, 0, k] + points[3, 3, k] + points[0, 3, k])
    nx, ny, nz = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return False
    nx, ny, nz = nx / length, ny / length, nz / length
    flat = np.empty((4, 4, 2))
    # Coordinates in the plane along its longest diagonal.
    pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    qq = q[0] * q[0] + q[1] * q[1] + q[2] * q[2]
    diagonal = math.sqrt(max(pp, qq))
    for k in range(3):
        r[k] = (p[k] if pp >= qq else q[k]) / diagonal
    sx, sy, sz = ny * r[2] - nz * r[1], nz * r[0] - nx * r[2], nx * r[1] - ny * r[0]
    for i in range(4):
        for j in range(4):
            x, y, z = (
                points[i, j, 0] - center[0],
                points[i, j, 1] - center[1],
                points[i, j, 2] - center[2],
            )
            if abs(nx * x + ny * y + nz * z) > tolerance:
                return False
            flat[i, j, 0] = r[0] * x + r[1] * y + r[2] * z
            flat[i, j, 1] = sx * x + sy * y + sz * z
    # Straight edges: both inner control points on the chord, in order.
    for side in range(4):
        for k in range(1, 3):
            if side == 0:
                a, b, c, d = flat[0, 0], flat[k, 0], flat[3, 0], flat[k - 1, 0]
            elif side == 1:
                a, b, c, d = flat[3, 0], flat[3, k], flat[3, 3], flat[3, k - 1]
            elif side == 2:
                a, b, c, d = flat[0, 3], flat[k, 3], flat[3, 3], flat[k - 1, 3]
            else:
                a, b, c, d = flat[0, 0], flat[0, k], flat[0, 3], flat[0, k - 1]
            cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            chord = math.hypot(c[0] - a[0], c[1] - a[1])
            if abs(cross) > tolerance * chord + tolerance * tolerance:
                return False
            forward = (b[0] - d[0]) * (c[0] - a[0]) + (b[1] - d[1]) * (c[1] - a[1])
            rest = (c[0] - b[0]) * (c[0] - a[0]) + (c[1] - b[1]) * (c[1] - a[1])
            if forward < 0.0 or rest < 0.0:
                return False
    # Convex corners.
    ring = np.empty((4, 2))
    for k in range(2):
        ring[0, k], ring[1, k] = flat[0, 0, k], flat[3, 0, k]
        ring[2, k], ring[3, k] = flat[3, 3, k], flat[0, 3, k]
    for k in range(4):
        a, b, c = ring[k], ring[(k + 1) % 4], ring[(k + 2) % 4]
        cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        if cross < -tolerance * size:
            return False
    return _does_not_fold(flat, tolerance * size)


@lean
def _does_not_fold(flat, slack):
    """Whether all inner control points stay inside: differences along u and v turn one way."""
    for i in range(3):
        for j in range(4):
            ux, uy = flat[i + 1, j, 0] - flat[i, j, 0], flat[i + 1, j, 1] - flat[i, j, 1]
            for a in range(4):
                for b in range(3):
                    vx = flat[a, b + 1, 0] - flat[a, b, 0]
                    vy = flat[a, b + 1, 1] - flat[a, b, 1]
                    if ux * vy - uy * vx < -slack:
                        return False
    return True
