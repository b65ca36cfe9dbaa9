"""Luminance of skies, of the ground below them, and of the sun.

Types 1 to 15 are gradation times indicatrix [1], with Z the angle from the zenith and χ that from
the sun:

    L / L_z = φ(Z) f(χ) / (φ(0) f(Z_s))
    φ(Z) = 1 + a exp(b / cos Z),   f(χ) = 1 + c (exp(d χ) − exp(d π/2)) + e cos² χ

Type 16 is the traditional overcast sky [2], L / L_z = (1 + 2 sin γ) / 3.

.. [1] CIE S 011/E:2003 / ISO 15469:2004, "Spatial distribution of daylight - CIE standard general
   sky", eq. 1-8 and table 1.
.. [2] P. Moon and D. E. Spencer, "Illumination from a non-uniform sky", Illuminating Engineering
   37, 1942, pp. 707-726.
.. [3] J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-43: plane
   element to a sphere that is partly below its horizon.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from .model.arrays import FloatArray, frozen
from .model.bezier import gauss_rule
from .model.sky import CIESky, Ground, PerezSky, Sky, Sun, direction
from .perez import sky_illuminance, sky_shape

#: Gradation a, b and indicatrix c, d, e of types 1 to 15. [1, table 1]
_TYPES = (
    (4.0, -0.70, 0.0, -1.0, 0.0),
    (4.0, -0.70, 2.0, -1.5, 0.15),
    (1.1, -0.80, 0.0, -1.0, 0.0),
    (1.1, -0.80, 2.0, -1.5, 0.15),
    (0.0, -1.00, 0.0, -1.0, 0.0),
    (0.0, -1.00, 2.0, -1.5, 0.15),
    (0.0, -1.00, 5.0, -2.5, 0.30),
    (0.0, -1.00, 10.0, -3.0, 0.45),
    (-1.0, -0.55, 2.0, -1.5, 0.15),
    (-1.0, -0.55, 5.0, -2.5, 0.30),
    (-1.0, -0.55, 10.0, -3.0, 0.45),
    (-1.0, -0.32, 10.0, -3.0, 0.45),
    (-1.0, -0.32, 16.0, -3.0, 0.30),
    (-1.0, -0.15, 16.0, -3.0, 0.30),
    (-1.0, -0.15, 24.0, -2.8, 0.15),
)
#: Level of a sky for which none is given. [lx]
DEFAULT_DIFFUSE_ILLUMINANCE_LX = 10_000.0
#: Gauss points a direction of the hemisphere integral: 1e-9 for all types and sun positions.
_ORDER = 64


def sun_direction(sky: Sky) -> tuple[float, float, float]:
    """Unit vector towards the sun of the sky; the zenith for skies that do not depend on it."""
    if sky.sun_altitude_deg is None or sky.sun_azimuth_deg is None:
        return (0.0, 0.0, 1.0)
    return direction(sky.sun_altitude_deg, sky.sun_azimuth_deg)


def relative_luminance(sky: Sky, directions: ArrayLike) -> FloatArray:
    """Luminance over zenith luminance, L / L_z, in ``directions`` (..., 3): (...) array. [1]

    Directions need not be unit vectors. At and below the horizon the gradation is that of the
    horizon; whether the ground is seen there is up to the caller.
    """
    return _form(sky, directions) / _form(sky, (0.0, 0.0, 1.0))


def _form(sky: Sky, directions: ArrayLike) -> FloatArray:
    """φ f in ``directions`` (..., 3); 1 + 2 cos Z for type 16."""
    d = np.asarray(directions, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    z = np.maximum(d[..., 2], 0.0)
    if _is_traditional(sky):
        return np.asarray(1.0 + 2.0 * z)
    s = np.array(sun_direction(sky))
    angle = np.arctan2(np.linalg.norm(np.cross(s, d), axis=-1), d @ s)
    return np.asarray(_gradation(sky, z) * _indicatrix(sky, angle))


def _is_traditional(sky: Sky) -> bool:
    return isinstance(sky, CIESky) and sky.type == 16


def _shape(sky: Sky) -> tuple[float, float, float, float, float]:
    """a, b, c, d, e; not of type 16."""
    return sky_shape(sky) if isinstance(sky, PerezSky) else _TYPES[int(sky.type) - 1]


def _gradation(sky: Sky, z: FloatArray) -> FloatArray:
    """φ as a function of z = cos Z; 1 at the horizon. [1, eq. 3, 4]"""
    a, b = _shape(sky)[:2]
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 + a * np.exp(b / z))


def _indicatrix(sky: Sky, angle: FloatArray) -> FloatArray:
    """f as a function of the angle from the sun. [1, eq. 5]"""
    c, d, e = _shape(sky)[2:]
    glow = np.exp(d * angle) - math.exp(0.5 * d * math.pi)
    return np.asarray(1.0 + c * glow + e * np.cos(angle) ** 2)


def diffuse_to_zenith_ratio(sky: Sky) -> float:
    """Horizontal illuminance over zenith luminance, ∫ (L / L_z) cos Z dω. [sr]"""
    return float(_integral(sky) / _form(sky, (0.0, 0.0, 1.0)))


def _integral(sky: Sky) -> float:
    """∫ φ f cos Z dω of the upper hemisphere. [sr]

    Integrated in polar coordinates about the sun, where the indicatrix depends on one variable and
    its cusp lies at the end of an interval.
    """
    if _is_traditional(sky):
        return 7.0 * math.pi / 3.0
    x, w = gauss_rule(_ORDER)
    if not sky.needs_sun:
        return float(2.0 * math.pi * (w * x * _gradation(sky, x)).sum())
    altitude = math.radians(float(sky.sun_altitude_deg or 0.0))
    sine, cosine = math.sin(altitude), math.cos(altitude)
    # Whole circles about the sun up to its altitude; beyond it arcs above the horizon. Their
    # length starts and ends like a square root, which the sine substitution makes smooth.
    half = 0.5 * math.pi - altitude
    s = math.pi * (x - 0.5)
    chi = np.concatenate([altitude * x, 0.5 * math.pi + half * np.sin(s)])
    weight = np.concatenate([altitude * w, half * np.cos(s) * math.pi * w])
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = np.where(
            chi <= altitude, -1.0, -np.cos(chi) * sine / np.maximum(np.sin(chi) * cosine, 1e-300)
        )
    psi_end = np.arccos(np.clip(limit, -1.0, 1.0))
    psi = psi_end[:, None] * x
    z = np.cos(chi)[:, None] * sine + np.sin(chi)[:, None] * cosine * np.cos(psi)
    z = np.maximum(z, 0.0)
    arcs = 2.0 * psi_end * ((_gradation(sky, z) * z) @ w)
    return float((weight * np.sin(chi) * _indicatrix(sky, chi) * arcs).sum())


def _level(sky: Sky) -> float:
    """Luminance over φ f. [cd/m²]"""
    if isinstance(sky, CIESky) and sky.zenith_luminance_cd_m2 is not None:
        return float(sky.zenith_luminance_cd_m2 / _form(sky, (0.0, 0.0, 1.0)))
    # Not by the zenith, which may be black.
    return horizontal_illuminance(sky) / _integral(sky)


def zenith_luminance(sky: Sky) -> float:
    """Zenith luminance L_z: as given, or from the diffuse illuminance. [cd/m²]"""
    return float(_level(sky) * _form(sky, (0.0, 0.0, 1.0)))


def luminance(sky: Sky, directions: ArrayLike) -> FloatArray:
    """Luminance in ``directions`` (..., 3): (...) array; see `relative_luminance`. [cd/m²]"""
    return _level(sky) * _form(sky, directions)


def horizontal_illuminance(sky: Sky) -> float:
    """Illuminance of the unobstructed sky, without the sun, on a horizontal plane. [lx]"""
    if isinstance(sky, PerezSky):
        return sky_illuminance(sky)
    if sky.zenith_luminance_cd_m2 is not None:
        return float(sky.zenith_luminance_cd_m2 * diffuse_to_zenith_ratio(sky))
    level = sky.diffuse_illuminance_lx
    return DEFAULT_DIFFUSE_ILLUMINANCE_LX if level is None else float(level)


def sun_luminance(sun: Sun) -> float:
    """Luminance of the sun's disc, E_n / (π sin² r). [cd/m²]"""
    radius = math.radians(sun.angular_radius_arcmin / 60.0)
    return sun.normal_illuminance_lx / (math.pi * math.sin(radius) ** 2)


def sun_horizontal_illuminance(sun: Sun) -> float:
    """Illuminance of the part of the sun's disc above the horizon on a horizontal plane. [lx]"""
    radius = math.radians(sun.angular_radius_arcmin / 60.0)
    altitude = math.radians(sun.altitude_deg)
    if altitude >= radius:
        return sun.normal_illuminance_lx * math.sin(altitude)
    if altitude <= -radius:
        return 0.0
    # [3] with H = 1 / sin r and θ = π/2 − altitude; the factor times π L, and E_n = π L sin² r.
    h = 1.0 / math.sin(radius)
    root = math.sqrt(h * h - 1.0)
    cosine, sine = math.sin(altitude), math.cos(altitude)
    factor = (
        0.5
        - math.asin(min(root / (h * sine), 1.0)) / math.pi
        + (
            cosine * math.acos(min(max(-root * cosine / sine, -1.0), 1.0))
            - root * math.sqrt(max(1.0 - h * h * cosine * cosine, 0.0))
        )
        / (math.pi * h * h)
    )
    return sun.normal_illuminance_lx * max(factor, 0.0) * h * h


def ground_luminance(ground: Ground | None, sky: Sky | None, sun: Sun | None) -> float:
    """Luminance ρ (E_sky + E_sun) / π of the uniform ground; 0 where it is modelled. [cd/m²]"""
    if ground is None or ground.reflectance is None:
        return 0.0
    total = horizontal_illuminance(sky) if sky is not None else 0.0
    if sun is not None:
        total += sun_horizontal_illuminance(sun)
    return ground.reflectance * total / math.pi


def sky_tone(sky: Sky) -> FloatArray:
    """What kernels need of a sky (10,): `sky_parameters` and the direction of the sun."""
    return np.concatenate([sky_parameters(sky), sun_direction(sky)])


@lru_cache(maxsize=64)
def sky_parameters(sky: Sky) -> FloatArray:
    """Parameters of `kernels.sky_luminance.sky_luminance`: form, a, b, c, d, e, factor [cd/m²].

    The factor holds the level, so that the kernel returns cd/m².
    """
    if _is_traditional(sky):
        return frozen([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, _level(sky)])
    return frozen([0.0, *_shape(sky), _level(sky)])
