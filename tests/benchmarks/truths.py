"""Irradiance in closed form, or by quadrature of its own; nothing here calls the solver.

Every source has radiance 1. Sums along contours use [1]: the irradiance of a uniform source is half
the integral of n · (d × dd) once around its outline, d the unit vector to it; for a polygon these
are the sides' angles times the cosines of their planes.

References
----------
.. [1] J. H. Lambert, "Photometria", 1760; J. R. Howell, M. P. Mengüç, K. Daun and R. Siegel,
   "Thermal Radiation Heat Transfer", 7th ed., CRC Press, 2020, section 4.3.3 (contour integration).
.. [2] J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", 3rd ed., B-43
   (plane element to sphere, with the element's horizon).
"""

from __future__ import annotations

import numpy as np
from patchlight.solver.model.arrays import FloatArray


def polygon(points: FloatArray, normals: FloatArray, corners: FloatArray) -> FloatArray:
    """Irradiance (n,) of a flat polygon (k, 3) that lies wholly above every sensor's horizon.

    Corners count counter-clockwise seen from the lit side. [W/m²]
    """
    to = corners[None, :, :] - points[:, None, :]
    if ((to * normals[:, None, :]).sum(-1) < -1e-12).any():
        raise ValueError("polygon: a corner lies below a sensor's horizon")
    total = np.zeros(len(points))
    for k in range(len(corners)):
        a, b = to[:, k], to[:, (k + 1) % len(corners)]
        cross = np.cross(a, b)
        size = np.linalg.norm(cross, axis=1)
        angle = np.arctan2(size, (a * b).sum(-1))
        cosine = (cross * normals).sum(-1) / np.where(size > 0.0, size, 1.0)
        total -= 0.5 * angle * cosine
    return total


def sphere(
    points: FloatArray, normals: FloatArray, center: FloatArray, radius: float
) -> FloatArray:
    """Irradiance (n,) of a sphere, cut by the sensors' horizons [2]. [W/m²]"""
    to = np.asarray(center, dtype=float) - points
    d = np.linalg.norm(to, axis=1)
    tilt = np.arccos(np.clip((to * normals).sum(-1) / d, -1.0, 1.0))
    reach = np.arcsin(radius / d)
    whole = np.pi * np.cos(tilt) * (radius / d) ** 2
    x = np.sqrt((d / radius) ** 2 - 1.0)
    with np.errstate(all="ignore"):
        y = -x / np.tan(tilt)
        q = np.sin(tilt) * np.sqrt(1.0 - y * y)
        part = (np.cos(tilt) * np.arccos(y) - x * q) * (radius / d) ** 2 + np.arctan(q / x)
    below = tilt >= 0.5 * np.pi + reach
    return np.where(below, 0.0, np.where(tilt <= 0.5 * np.pi - reach, whole, part))


def cylinder_above(
    points: FloatArray, height: float, half: float, radius: float, order: int = 200
) -> FloatArray:
    """Irradiance (n,) of upward sensors wholly below a cylinder about y = 0, z = ``height``.

    The cylinder runs from x = −half to half. Along a line of it with distance h the numerators A, B
    of both cosines are constant, and ∫ A B / (x² + h²)² dx = A B (atan(x/h) + x h / (x² + h²)) /
    (2 h³); what remains is a smooth integral over the visible arc, |angle| < acos(radius / d) about
    the direction to the sensor. [W/m²]
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    y, z = -points[:, 1], height - points[:, 2]
    if (z < radius).any():
        raise ValueError("cylinder_above: a sensor is not wholly below the cylinder")
    limit = np.arccos(radius / np.hypot(y, z))[:, None]
    angle = np.arctan2(-z, -y)[:, None] + limit * nodes
    sy, sz = y[:, None] + radius * np.cos(angle), z[:, None] + radius * np.sin(angle)
    facing = np.maximum(-(np.cos(angle) * sy + np.sin(angle) * sz), 0.0)
    h = np.hypot(sy, sz)

    def along(x: FloatArray) -> FloatArray:
        return (np.arctan(x / h) + x * h / (x * x + h * h)) / (2.0 * h**3)

    ends = along(half - points[:, :1]) - along(-half - points[:, :1])
    return (sz * facing * ends * weights).sum(1) * limit[:, 0] * radius


def disk(
    points: FloatArray,
    normals: FloatArray,
    center: FloatArray,
    radius: float,
    axis: FloatArray,
    order: int = 512,
) -> FloatArray:
    """Irradiance (n,) of a disk wholly above every sensor's horizon, shining along ``axis``.

    The contour integral is that of a periodic smooth function, for which equal steps converge
    geometrically in ``order`` divided by radius over distance. [W/m²]
    """
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    e1 = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    t = 2.0 * np.pi * np.arange(order) / order
    rim = radius * (np.cos(t)[:, None] * e1 + np.sin(t)[:, None] * e2)
    step = radius * (-np.sin(t)[:, None] * e1 + np.cos(t)[:, None] * e2)
    to = np.asarray(center, dtype=float) + rim[None] - points[:, None]
    r2 = (to * to).sum(-1)
    integrand = (np.cross(to, step[None]) * normals[:, None]).sum(-1) / r2
    return -0.5 * integrand.sum(1) * (2.0 * np.pi / order)
