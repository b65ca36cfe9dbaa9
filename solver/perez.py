"""All-weather sky of Perez, Seals and Michalsky: shape and level of a sky from irradiance [1], [2].

Clearness ε and brightness Δ of the hour choose shape coefficients and luminous efficacies. With Z
the angle from the zenith and χ that from the sun, luminance is proportional to

    (1 + a exp(b / cos Z)) (1 + c exp(d χ) + e cos² χ)

which is the form of CIE S 011 with c and e divided by 1 + c exp(d π/2).

.. [1] R. Perez, R. Seals and J. Michalsky, "All-weather model for sky luminance distribution -
   preliminary configuration and validation", Solar Energy 50(3), 1993, pp. 235-245; erratum 51,
   p. 423.
.. [2] R. Perez, P. Ineichen, R. Seals, J. Michalsky and R. Stewart, "Modeling daylight availability
   and irradiance components from direct and global irradiance", Solar Energy 44(5), 1990,
   pp. 271-289.
.. [3] F. Kasten, "A new table and approximation formula for the relative optical air mass", Archiv
   für Meteorologie, Geophysik und Bioklimatologie B 14, 1966, pp. 206-223.
.. [4] G. Ward, "gendaylit" in Radiance, whose limits of ε and Δ are taken here.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .model.arrays import FloatArray
from .model.sky import PerezSky, Sun

#: Irradiance outside the atmosphere at the mean distance of the sun. [W/m²]
SOLAR_CONSTANT_W_M2 = 1367.0
#: Upper ends of the bins of ε. [1]
_BINS = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)
#: Limits of ε and Δ, and the least Δ of skies between overcast and clear. [4]
CLEARNESS, BRIGHTNESS, BRIGHTNESS_BETWEEN = (1.0, 12.01), (0.01, 0.6), 0.2
#: Largest b: of 0 a black zenith would leave all of the sky black.
STEEPEST = -0.01
#: x₁ … x₄ of a, b, c, d, e for each bin: x = x₁ + x₂ Z + Δ (x₃ + x₄ Z). [1, table 1]
_SHAPE = np.array([
    [[1.3525, -0.2576, -0.2690, -1.4366], [-0.7670, 0.0007, 1.2734, -0.1233],
     [2.8000, 0.6004, 1.2375, 1.0000], [1.8734, 0.6297, 0.9738, 0.2809],
     [0.0356, -0.1246, -0.5718, 0.9938]],
    [[-1.2219, -0.7730, 1.4148, 1.1016], [-0.2054, 0.0367, -3.9128, 0.9156],
     [6.9750, 0.1774, 6.4477, -0.1239], [-1.5798, -0.5081, -1.7812, 0.1080],
     [0.2624, 0.0672, -0.2190, -0.4285]],
    [[-1.1000, -0.2515, 0.8952, 0.0156], [0.2782, -0.1812, -4.5000, 1.1766],
     [24.7219, -13.0812, -37.7000, 34.8438], [-5.0000, 1.5218, 3.9229, -2.6204],
     [-0.0156, 0.1597, 0.4199, -0.5562]],
    [[-0.5484, -0.6654, -0.2672, 0.7117], [0.7234, -0.6219, -5.6812, 2.6297],
     [33.3389, -18.3000, -62.2500, 52.0781], [-3.5000, 0.0016, 1.1477, 0.1062],
     [0.4659, -0.3296, -0.0876, -0.0329]],
    [[-0.6000, -0.3566, -2.5000, 2.3250], [0.2937, 0.0496, -5.6812, 1.8415],
     [21.0000, -4.7656, -21.5906, 7.2492], [-3.5000, -0.1554, 1.4062, 0.3988],
     [0.0032, 0.0766, -0.0656, -0.1294]],
    [[-1.0156, -0.3670, 1.0078, 1.4051], [0.2875, -0.5328, -3.8500, 3.3750],
     [14.0000, -0.9999, -7.1406, 7.5469], [-3.4000, -0.1078, -1.0750, 1.5702],
     [-0.0672, 0.4016, 0.3017, -0.4844]],
    [[-1.0000, 0.0211, 0.5025, -0.5119], [-0.3000, 0.1922, 0.7023, -1.6317],
     [19.0000, -5.0000, 1.2438, -1.9094], [-4.0000, 0.0250, 0.3844, 0.2656],
     [1.0468, -0.3788, -2.4517, 1.4656]],
    [[-1.0500, 0.0289, 0.4260, 0.3590], [-0.3250, 0.1156, 0.7781, 0.0025],
     [31.0625, -14.5000, -46.1148, 55.3750], [-7.2312, 0.4050, 13.3500, 0.6234],
     [1.5000, -0.6426, 1.8564, 0.5636]],
])  # fmt: skip
#: a … d of the efficacies of the sky and of the sun for each bin. [2, table 4] [lm/W]
_OF_SKY = np.array([
    [97.24, -0.46, 12.00, -8.91], [107.22, 1.15, 0.59, -3.95], [104.97, 2.96, -5.53, -8.77],
    [102.39, 5.59, -13.95, -13.90], [100.71, 5.94, -22.75, -23.74], [106.42, 3.83, -36.15, -28.83],
    [141.88, 1.90, -53.24, -14.03], [152.23, 0.35, -45.27, -7.98],
])  # fmt: skip
_OF_SUN = np.array([
    [57.20, -4.55, -2.98, 117.12], [98.99, -3.46, -1.21, 12.38], [109.83, -4.90, -1.71, -8.81],
    [110.34, -5.84, -1.99, -4.56], [106.36, -3.97, -1.75, -6.16], [107.19, -1.25, -1.51, -26.73],
    [105.75, 0.77, -1.26, -34.44], [101.18, 1.58, -1.10, -8.29],
])  # fmt: skip


def air_mass(zenith: FloatArray) -> FloatArray:
    """Relative optical air mass at the angle ``zenith`` [rad] from the zenith. [3]"""
    below = 93.885 - np.degrees(np.minimum(zenith, 0.5 * math.pi))
    return np.asarray(1.0 / (np.cos(np.minimum(zenith, 0.5 * math.pi)) + 0.15 * below**-1.253))


def clearness(direct: FloatArray, diffuse: FloatArray, zenith: FloatArray) -> FloatArray:
    """ε, from 1 (overcast) to some 12 (clear). [1, eq. 1]"""
    turn = 1.041 * zenith**3
    with np.errstate(divide="ignore", invalid="ignore"):
        found = ((diffuse + direct) / diffuse + turn) / (1.0 + turn)
    return np.asarray(np.clip(np.nan_to_num(found, nan=1.0), *CLEARNESS))


def brightness(diffuse: FloatArray, zenith: FloatArray, nearness: FloatArray) -> FloatArray:
    """Δ, sky irradiance over that outside the atmosphere. [1, eq. 2]

    ``nearness`` is the square of the sun's mean distance over its distance.
    """
    found = diffuse * air_mass(zenith) / (SOLAR_CONSTANT_W_M2 * nearness)
    return np.asarray(np.clip(found, *BRIGHTNESS))


def shapes(epsilon: FloatArray, delta: FloatArray, zenith: FloatArray) -> FloatArray:
    """a, b, c, d, e (n, 5) of skies (n,), as Perez has them. [1]"""
    number = np.searchsorted(_BINS, epsilon, side="right")
    between = (epsilon > _BINS[0]) & (epsilon < _BINS[4])
    delta = np.where(between, np.maximum(delta, BRIGHTNESS_BETWEEN), delta)
    x = np.moveaxis(_SHAPE[number], -1, 0)
    out = x[0] + x[1] * zenith[:, None] + delta[:, None] * (x[2] + x[3] * zenith[:, None])
    some = number == 0
    near, turn = delta[some], zenith[some]
    c, d = _SHAPE[0, 2], _SHAPE[0, 3]
    out[some, 2] = np.exp((near * (c[0] + c[1] * turn)) ** c[2]) - c[3]
    out[some, 3] = -np.exp(near * (d[0] + d[1] * turn)) + d[2] + near * d[3]
    return np.asarray(out)


def efficacies(
    epsilon: FloatArray, delta: FloatArray, zenith: FloatArray, dew_point_c: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Luminous efficacies (n,) of sky and sun. [2, eq. 7 and 8] [lm/W]"""
    number = np.searchsorted(_BINS, epsilon, side="right")
    water = np.exp(0.07 * dew_point_c - 0.075)  # precipitable [cm], [2, eq. 3]
    a, b, c, d = _OF_SKY[number].T
    of_sky = a + b * water + c * np.cos(zenith) + d * np.log(delta)
    a, b, c, d = _OF_SUN[number].T
    of_sun = a + b * water + c * np.exp(5.73 * zenith - 5.0) + d * delta
    return np.asarray(of_sky), np.asarray(np.maximum(of_sun, 0.0))


def in_form_of_cie(shape: FloatArray) -> FloatArray:
    """The same shapes (n, 5) as CIE S 011 has them, up to a factor.

    Rare combinations of ε and Δ make the horizon infinitely bright (b > 0), or the zenith or the
    surroundings of the sun darker than black (1 + a exp b < 0, 1 + c + e < 0): there b is
    `STEEPEST`, and these are black.
    """
    out = np.array(shape, dtype=np.float64)
    out[:, 1] = np.minimum(out[:, 1], STEEPEST)
    out[:, 0] = np.maximum(out[:, 0], -np.exp(-out[:, 1]))
    out[:, 2] = np.maximum(out[:, 2], -1.0 - out[:, 4])
    whole = 1.0 + out[:, 2] * np.exp(0.5 * math.pi * out[:, 3])
    out[:, 2] /= whole
    out[:, 4] /= whole
    return out


def _of(sky: PerezSky) -> tuple[FloatArray, FloatArray, FloatArray]:
    """ε, Δ and angle of the sun from the zenith, each (1,)."""
    zenith = np.radians([90.0 - sky.sun_altitude_deg])
    direct, diffuse = np.array([[sky.direct_normal_w_m2], [sky.diffuse_horizontal_w_m2]])
    nearness = np.array([sky.sun_nearness])
    return clearness(direct, diffuse, zenith), brightness(diffuse, zenith, nearness), zenith


@lru_cache(maxsize=64)
def sky_shape(sky: PerezSky) -> tuple[float, float, float, float, float]:
    """a, b, c, d, e of the sky in the form of CIE S 011."""
    a, b, c, d, e = in_form_of_cie(shapes(*_of(sky)))[0].tolist()
    return a, b, c, d, e


def sky_illuminance(sky: PerezSky) -> float:
    """Illuminance of the unobstructed sky, without the sun, on a level plane. [lx]"""
    epsilon, delta, zenith = _of(sky)
    of_sky, _ = efficacies(epsilon, delta, zenith, np.array([sky.dew_point_c]))
    return float(of_sky[0] * sky.diffuse_horizontal_w_m2)


def sun_of(sky: PerezSky) -> Sun:
    """The sun that belongs to the sky, of the illuminance that its irradiance makes."""
    epsilon, delta, zenith = _of(sky)
    _, of_sun = efficacies(epsilon, delta, zenith, np.array([sky.dew_point_c]))
    level = float(of_sun[0] * sky.direct_normal_w_m2)
    return Sun(sky.sun_altitude_deg, sky.sun_azimuth_deg, normal_illuminance_lx=level)
