"""Colour of white light."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .errors import InputError
from .model.arrays import FloatArray, frozen
from .model.optics import LUMINANCE_WEIGHTS

#: Below it light is Planckian, from it on CIE daylight. [K]
DAYLIGHT_FROM_K = 4000.0
#: Chebyshev series, over reciprocal temperatures from 1/4000 to 1/1000 K⁻¹, of the chromaticity
#: x and y of the Planckian radiator: interpolated at 17 Chebyshev points of the sums over the CIE
#: 1931 2° observer at 1 nm with c2 = 1.438 776 877e-2 m K, and within 3e-10 of them in between.
#: So no spectrum has to be loaded for a run.
_PLANCKIAN = (
    (
        0.54471330634,
        0.132455178701,
        -0.0284576465675,
        0.00411550540948,
        0.000199639032587,
        -0.000391794708918,
        0.000141013522844,
        -2.52912388275e-05,
        -6.1316e-07,
        1.9313e-06,
        -6.0981e-07,
        6.6458e-08,
        2.3341e-08,
        -1.3418e-08,
        2.8749e-09,
        1.1119e-10,
        -2.9182e-10,
    ),
    (
        0.38201137882,
        -0.0256572969782,
        -0.0194621314697,
        0.00950136173738,
        -0.00208878153736,
        6.97447611827e-05,
        0.000132770344386,
        -5.62124903168e-05,
        1.16425879242e-05,
        -3.9286e-07,
        -6.1982e-07,
        2.2281e-07,
        -2.5381e-08,
        -9.8506e-09,
        5.9340e-09,
        -1.4341e-09,
        8.0189e-11,
    ),
)
#: CIE XYZ to linear sRGB. [IEC 61966-2-1]
_XYZ_TO_RGB = (
    (3.2406, -1.5372, -0.4986),
    (-0.9689, 1.8758, 0.0415),
    (0.0557, -0.2040, 1.0570),
)


def cct_to_rgb(cct_k: float) -> FloatArray:
    """Linear sRGB (3,) of white light of luminance 1, 0.2126 R + 0.7152 G + 0.0722 B = 1.

    Planckian radiator below 4000 K, CIE daylight locus from there to 25 000 K [1]. Light below
    about 1900 K lies outside the sRGB gamut: its negative blue is set to zero and the rest scaled
    back to luminance 1.

    .. [1] CIE 015:2018, "Colorimetry", 4th ed., sec. 4.1.2 (daylight locus); Planck's law with
       c2 = 1.438 776 877e-2 m K and the CIE 1931 2 degree observer; sRGB by IEC 61966-2-1.

    Raises
    ------
    InputError
        Outside 1000 to 25 000 K.
    """
    if not 1000.0 <= cct_k <= 25000.0:
        raise InputError(f"cct_k = {cct_k}: must lie between 1000 and 25000")
    return _rgb(float(cct_k))


@lru_cache(maxsize=256)
def _rgb(cct_k: float) -> FloatArray:
    x, y = _planckian(cct_k) if cct_k < DAYLIGHT_FROM_K else _daylight(cct_k)
    rgb = np.array(_XYZ_TO_RGB) @ np.array([x / y, 1.0, (1.0 - x - y) / y])
    rgb = np.maximum(rgb, 0.0)
    return frozen(rgb / (rgb @ np.array(LUMINANCE_WEIGHTS)))


def _planckian(cct_k: float) -> tuple[float, float]:
    """Chromaticity (x, y) of a Planckian radiator, 1000 to 4000 K."""
    low, high = 1.0 / DAYLIGHT_FROM_K, 1.0 / 1000.0
    t = (2.0 / cct_k - low - high) / (high - low)
    x, y = (float(np.polynomial.chebyshev.chebval(t, series)) for series in _PLANCKIAN)
    return x, y


def _daylight(cct_k: float) -> tuple[float, float]:
    """Chromaticity (x, y) of daylight, 4000 to 25 000 K. [CIE 015:2018, sec. 4.1.2]"""
    t = 1e3 / cct_k
    if cct_k <= 7000.0:
        x = 0.244063 + t * (0.09911 + t * (2.9678 - 4.6070 * t))
    else:
        x = 0.237040 + t * (0.24748 + t * (1.9018 - 2.0064 * t))
    return x, -0.275 + x * (2.870 - 3.000 * x)
