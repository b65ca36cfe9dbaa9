"""Colour of the sky by direction: modelled chromaticities, and daylight spectra that have them.

Three models: one colour temperature for the whole sky; a colour temperature by luminance [1],
bluer where the sky is darker; and the chromaticities of the clear sky of Preetham et al. [2], of
which the luminance is not taken. Models and measurements of the same sky differ by 0.02 in x and y.

A chromaticity (x, y) is given the spectrum S0 + M1 S1 + M2 S2 of CIE daylight [3].

.. [1] C. Chain, D. Dumortier and M. Fontoynont, "A comprehensive model of luminance, correlated
   colour temperature and spectral distribution of skylight", Proc. 24th CIE Session, Warsaw 1999:
   clear skies 10⁶ / (−132.1 + 59.77 log₁₀ L), overcast ones 6514 K.
.. [2] A. J. Preetham, P. Shirley and B. Smits, "A practical analytic model for daylight", Proc.
   SIGGRAPH 1999, pp. 91-100, appendix A.2.
.. [3] CIE 015:2018, "Colorimetry", 4th ed., sec. 4.1.2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .gensky import TURBIDITY as OF_ESTIMATES
from .model.arrays import FloatArray
from .model.sky import CIESky, Sky
from .model.sky_checks import SKY_COLORS, finite_number
from .skies import luminance, sun_direction

#: Colour temperatures of daylight, and that of overcast skies. [K] [1], [3]
DAYLIGHT_K, OVERCAST_K = (4000.0, 25000.0), 6514.0
#: Types that are overcast or uniform.
_OVERCAST = (1, 2, 3, 4, 5, 16)
#: Turbidity where none is given, and the range of the fit. [2]
TURBIDITY, TURBIDITIES = 3.0, (2.0, 6.0)
#: Distribution coefficients A … E of x and y: slope in the turbidity, and constant. [2]
_SHAPE_X = ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989),
            (-0.0033, 0.0452))  # fmt: skip
_SHAPE_Y = ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537),
            (-0.0109, 0.0529))  # fmt: skip
#: Zenith values: rows by T², T, 1, columns by Z_s³, Z_s², Z_s, 1. [2]
_ZENITH_X = np.array([
    [0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394],
    [0.11693, -0.21196, 0.06052, 0.25886],
])  # fmt: skip
_ZENITH_Y = np.array([
    [0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516],
    [0.15346, -0.26756, 0.06670, 0.26688],
])  # fmt: skip
#: Least cosine of the angle from the zenith, which the gradation divides by.
_LOW = 0.01


def sky_chromaticity(
    sky: Sky, directions: ArrayLike, model: str = "constant", *, turbidity: float | None = None
) -> FloatArray:
    """Chromaticity (..., 2) x, y of the CIE 1931 observer in ``directions`` (..., 3).

    Parameters
    ----------
    sky : Sky
        With its level: darker directions are bluer in ``"chain"``.
    model : {"constant", "chain", "preetham"}
        ``"constant"`` is ``sky.cct_k`` everywhere.
    turbidity : float, optional
        Of ``"preetham"`` alone, 2 to 6; when not given that which the level of ``sky`` is estimated
        with, or else 3.

    Raises
    ------
    InputError
        For other models, a turbidity out of range or without effect, and a sky without a sun where
        the model needs it.
    """
    if model not in SKY_COLORS:
        raise InputError(f"color model {model!r}: must be one of {', '.join(SKY_COLORS)}")
    if turbidity is not None and model != "preetham":
        raise InputError(f"turbidity: the colour of model {model!r} does not depend on it")
    d = np.asarray(directions, dtype=np.float64)
    if model == "preetham":
        turbidity = _turbidity(sky) if turbidity is None else turbidity
        return _preetham(sky, d, finite_number("turbidity", turbidity, *TURBIDITIES))
    if model == "chain":
        return daylight_locus(sky_temperature(sky, d))
    return daylight_locus(np.full(d.shape[:-1], sky.cct_k))


def is_overcast(sky: Sky) -> bool:
    """Whether a sky is of a type that is overcast or uniform, and has one colour by luminance."""
    return isinstance(sky, CIESky) and sky.type in _OVERCAST


def sky_temperature(sky: Sky, directions: FloatArray) -> FloatArray:
    """Colour temperature (...) by luminance, within that of daylight. [1] [K]"""
    if is_overcast(sky):
        return np.full(directions.shape[:-1], OVERCAST_K)
    with np.errstate(divide="ignore"):
        mired = -132.1 + 59.77 * np.log10(luminance(sky, directions))
    low, high = (1e6 / end for end in DAYLIGHT_K[::-1])
    return np.asarray(1e6 / np.clip(mired, low, high))


def daylight_locus(cct_k: ArrayLike) -> FloatArray:
    """Chromaticity (..., 2) of CIE daylight of 4000 to 25 000 K. [3, eq. 4.5-4.7]"""
    t = 1e3 / np.asarray(cct_k, dtype=np.float64)
    warm = 0.244063 + t * (0.09911 + t * (2.9678 - 4.6070 * t))
    cold = 0.237040 + t * (0.24748 + t * (1.9018 - 2.0064 * t))
    x = np.where(t >= 1.0 / 7.0, warm, cold)
    return np.stack([x, -3.0 * x * x + 2.870 * x - 0.275], axis=-1)


def daylight_weights(xy: ArrayLike) -> FloatArray:
    """M1 and M2 (..., 2) of the daylight spectrum of a chromaticity (..., 2). [3, eq. 4.8]"""
    x, y = np.moveaxis(np.asarray(xy, dtype=np.float64), -1, 0)
    whole = 0.0241 + 0.2562 * x - 0.7341 * y
    first = -1.3515 - 1.7703 * x + 5.9114 * y
    second = 0.0300 - 31.4424 * x + 30.0717 * y
    return np.stack([first / whole, second / whole], axis=-1)


def _turbidity(sky: Sky) -> float:
    """That of the estimated level of a sky with a clear part, or what is usual."""
    if not isinstance(sky, CIESky) or not sky.estimated or sky.type in _OVERCAST:
        return TURBIDITY
    return OF_ESTIMATES if sky.turbidity is None else sky.turbidity


def _preetham(sky: Sky, d: FloatArray, turbidity: float) -> FloatArray:
    """The chromaticities of the clear sky. [2]"""
    if sky.sun_altitude_deg is None or sky.sun_azimuth_deg is None:
        raise InputError(
            "color model 'preetham': the sky has no sun; give sun_altitude_deg and sun_azimuth_deg"
        )
    sun = np.array(sun_direction(sky))
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    z = np.maximum(d[..., 2], _LOW)
    angle = np.arctan2(np.linalg.norm(np.cross(sun, d), axis=-1), d @ sun)
    zenith = math.radians(90.0 - sky.sun_altitude_deg)
    powers = np.array([zenith**3, zenith**2, zenith, 1.0])
    by_turbidity = np.array([turbidity**2, turbidity, 1.0])
    out = []
    for shape, table in ((_SHAPE_X, _ZENITH_X), (_SHAPE_Y, _ZENITH_Y)):
        a, b, c, fall, e = (slope * turbidity + constant for slope, constant in shape)

        def form(z, angle, a=a, b=b, c=c, fall=fall, e=e):  # type: ignore[no-untyped-def]
            glow = 1.0 + c * np.exp(fall * angle) + e * np.cos(angle) ** 2
            return (1.0 + a * np.exp(b / z)) * glow

        at_zenith = float(by_turbidity @ table @ powers)
        out.append(at_zenith * form(z, angle) / form(1.0, zenith))
    return np.stack(out, axis=-1)
