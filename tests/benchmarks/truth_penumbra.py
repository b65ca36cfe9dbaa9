"""A square source over a plane, partly hidden by a sphere: irradiance in closed form.

What is hidden is the source inside the sphere's cone of tangents. Its outline is made of pieces of
the source's sides and of the circle where the cone meets the unit sphere about the sensor; along
both the contour integral of `truths` has a closed form. On the circle of a cone with axis c and
half-angle α, d = cos α c + sin α u with u = cos t e1 + sin t e2, so that
d × d' = sin²α c − sin α cos α u.
"""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from truths import polygon

UP = np.array([0.0, 0.0, 1.0])


def square_behind_sphere(
    points: FloatArray, side: float, height: float, center: FloatArray, radius: float
) -> FloatArray:
    """Irradiance (n,) of upward sensors; the source is centred on the z axis. [W/m²]

    The sphere must lie between the source and every sensor's horizon.
    """
    a = 0.5 * side
    corners = np.array([[-a, -a, height], [a, -a, height], [a, a, height], [-a, a, height]])
    whole = polygon(points, np.broadcast_to(UP, points.shape), corners[::-1])
    to = np.asarray(center, float) - points
    distance = np.linalg.norm(to, axis=1)
    cones = zip(points, to / distance[:, None], radius / distance, strict=True)
    return whole - np.array([inside_cone(p, corners, axis, sine) for p, axis, sine in cones])


def inside_cone(point: FloatArray, corners: FloatArray, axis: FloatArray, sine: float) -> float:
    """Irradiance of an upward sensor by what of a source lies inside a cone. [W/m²]

    The flat source has ``corners`` (4, 3), clockwise as seen from the sensor, and radiance 1; the
    cone has its tip at the sensor, a unit ``axis``, and ``sine`` is that of half its angle.
    """
    cosine = math.sqrt(1.0 - sine * sine)
    total = 0.0
    for k in range(4):
        total += _side(corners[k] - point, corners[(k + 1) % 4] - point, axis, cosine)
    return total + _circle(point, corners, axis, sine, cosine)


def _side(a: FloatArray, b: FloatArray, axis: FloatArray, cosine: float) -> float:
    """The part of the side a b that lies inside the cone."""
    e = b - a
    # (w · axis)² − cos²α w² = 0 along w = a + t e
    k2 = (e @ axis) ** 2 - cosine**2 * (e @ e)
    k1 = 2.0 * ((a @ axis) * (e @ axis) - cosine**2 * (a @ e))
    k0 = (a @ axis) ** 2 - cosine**2 * (a @ a)
    root = k1 * k1 - 4.0 * k2 * k0
    if root <= 0.0 or k2 >= 0.0:
        return 0.0
    first = (-k1 + math.sqrt(root)) / (2.0 * k2)
    last = (-k1 - math.sqrt(root)) / (2.0 * k2)
    first, last = max(first, 0.0), min(last, 1.0)
    if first >= last:
        return 0.0
    p, q = a + first * e, a + last * e
    cross = np.cross(p, q)
    size = float(np.linalg.norm(cross))
    return 0.5 * math.atan2(size, float(p @ q)) * float(cross[2]) / size


def _circle(
    point: FloatArray, corners: FloatArray, axis: FloatArray, sine: float, cosine: float
) -> float:
    """The arcs of the cone's circle that lie before the source."""
    e1 = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    # Planes through the sensor and a side, inward normals: inside the source all are positive.
    planes = [np.cross(corners[k] - point, corners[(k + 1) % 4] - point) for k in range(4)]
    cuts = [0.0, 2.0 * math.pi]
    for g in planes:
        size, turn = math.hypot(g @ e1, g @ e2), math.atan2(g @ e2, g @ e1)
        level = -cosine * float(g @ axis)
        if abs(level) < sine * size:
            opening = math.acos(level / (sine * size))
            cuts += [(turn + opening) % (2.0 * math.pi), (turn - opening) % (2.0 * math.pi)]
    cuts.sort()
    total = 0.0
    for t0, t1 in zip(cuts[:-1], cuts[1:], strict=True):
        middle = 0.5 * (t0 + t1)
        d = cosine * axis + sine * (math.cos(middle) * e1 + math.sin(middle) * e2)
        if all(g @ d > 0.0 for g in planes):
            u = (math.sin(t1) - math.sin(t0)) * e1 - (math.cos(t1) - math.cos(t0)) * e2
            total += 0.5 * (sine**2 * axis[2] * (t1 - t0) - sine * cosine * u[2])
    return total
