"""Luminance of skies, of the ground below them, and of the sun.

Types 1 to 15 are gradation times indicatrix [1], with Z the angle from the zenith and χ that from
the sun:

    L / L_z = φ(Z) f(χ) / (φ(0) f(Z_s))
    φ(Z) = 1 + a exp(b / cos Z),   f(χ) = 1 + c (exp(d χ) − exp(d π/2)) + e cos² χ

Type 16 is the traditional overcast sky [2], L / L_z = (1 + 2 sin γ) / 3. Others are in `perez`,
`gensky` and `patch_sky`.

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

from .gensky import (
    CLEAR,
    at_zenith,
    estimated_zenith_luminance,
    intermediate_form,
    intermediate_terms,
)
from .model.arrays import FloatArray, frozen
from .model.bezier import gauss_rule
from .model.patch_sky import PatchSky
from .model.sky import OWN_FORMULAS, CIESky, Ground, PerezSky, Sky, Sun, direction
from .patch_sky import patch_illuminance, patch_numbers
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
    """φ f in ``directions`` (..., 3), or what has its place in other skies."""
    d = np.asarray(directions, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    z = np.maximum(d[..., 2], 0.0)
    if isinstance(sky, PatchSky):
        return np.asarray(np.array(sky.luminance_cd_m2)[patch_numbers(d)])
    if sky_form(sky) == 16:
        return np.asarray(1.0 + 2.0 * z)
    s = np.array(sun_direction(sky))
    angle = np.arctan2(np.linalg.norm(np.cross(s, d), axis=-1), d @ s)
    if sky_form(sky) == "intermediate":
        zenith = np.arctan2(np.hypot(d[..., 0], d[..., 1]), z)
        return intermediate_form(float(sky.sun_altitude_deg or 0.0), zenith, angle)
    return np.asarray(_gradation(sky, z) * _indicatrix(sky, angle))


def sky_form(sky: Sky) -> int | str:
    """Which formula a sky follows: its type where that has one of its own, else ``""``."""
    own = isinstance(sky, CIESky) and sky.type in (16, "intermediate")
    return sky.type if isinstance(sky, CIESky) and own else ""


def _shape(sky: Sky) -> tuple[float, float, float, float, float]:
    """a, b, c, d, e of a sky that has them."""
    if isinstance(sky, PerezSky):
        return sky_shape(sky)
    assert isinstance(sky, CIESky) and not sky_form(sky)
    return CLEAR if sky.type == "clear" else _TYPES[int(sky.type) - 1]


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
    if isinstance(sky, PatchSky):
        return patch_illuminance(sky)
    if sky_form(sky) == 16:
        return 7.0 * math.pi / 3.0
    # At the zenith, on the way, the intermediate sky has a cusp: 1e-7 by more points.
    intermediate = sky_form(sky) == "intermediate"
    x, w = gauss_rule(4 * _ORDER if intermediate else _ORDER)
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
    if intermediate:
        level = intermediate_form(float(sky.sun_altitude_deg or 0.0), np.arccos(z), chi[:, None])
        return float((weight * np.sin(chi) * 2.0 * psi_end * ((level * z) @ w)).sum())
    arcs = 2.0 * psi_end * ((_gradation(sky, z) * z) @ w)
    return float((weight * np.sin(chi) * _indicatrix(sky, chi) * arcs).sum())


def _level(sky: Sky) -> float:
    """Luminance over φ f. [cd/m²]"""
    if isinstance(sky, CIESky):
        given = estimated_zenith_luminance(sky) if sky.estimated else sky.zenith_luminance_cd_m2
        if given is not None:
            own = sky.estimated and sky.type in OWN_FORMULAS
            return float(given / (at_zenith(sky) if own else _form(sky, (0.0, 0.0, 1.0))))
    if isinstance(sky, PatchSky) and sky.diffuse_illuminance_lx is None:
        return 1.0
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
    if isinstance(sky, CIESky) and (sky.estimated or sky.zenith_luminance_cd_m2 is not None):
        return _level(sky) * _integral(sky)
    level = sky.diffuse_illuminance_lx
    if isinstance(sky, PatchSky) and level is None:
        return patch_illuminance(sky)
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
    """What kernels need of a sky (10,): `sky_parameters` and the direction of the sun.

    Of patches their relative luminances besides (155,).
    """
    tone = np.concatenate([sky_parameters(sky), sun_direction(sky)])
    return with_patches(tone, sky)


def with_patches(packed: FloatArray, sky: Sky | None) -> FloatArray:
    """``packed`` parameters with the relative luminances of a sky of patches at their end."""
    if not isinstance(sky, PatchSky):
        return packed
    out = np.concatenate([packed, patch_luminances(sky) / sky_parameters(sky)[6]])
    out[2] = len(packed)
    return np.asarray(out)


def patch_luminances(sky: PatchSky) -> FloatArray:
    """Luminance (145,) of the patches at the level of the sky. [cd/m²]"""
    return _level(sky) * np.array(sky.luminance_cd_m2)


@lru_cache(maxsize=64)
def sky_parameters(sky: Sky) -> FloatArray:
    """Parameters of `kernels.sky_luminance.sky_luminance`: form, a, b, c, d, e, factor [cd/m²].

    The factor holds the level, so that the kernel returns cd/m².
    """
    from .kernels import sky_luminance as kernel

    if isinstance(sky, PatchSky):
        # Where the luminances stand is told when they are packed; 1 for a black sky.
        mean = horizontal_illuminance(sky) / math.pi
        return frozen([kernel.PATCHES, 0.0, 0.0, 0.0, 0.0, 0.0, mean or 1.0])
    form = sky_form(sky)
    if form == 16:
        return frozen([kernel.TRADITIONAL_OVERCAST, 0.0, 0.0, 0.0, 0.0, 0.0, _level(sky)])
    if form == "intermediate":
        sine, low = intermediate_terms(float(sky.sun_altitude_deg or 0.0))
        # The fourth says that the sky is brightest at the sun.
        return frozen([kernel.INTERMEDIATE, 0.0, sine, 1.0, low, 0.0, _level(sky)])
    return frozen([kernel.GENERAL, *_shape(sky), _level(sky)])
