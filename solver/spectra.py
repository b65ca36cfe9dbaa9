"""Colour of light; the only module of the solver that knows colour-science."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache

import numpy as np

from .errors import InputError
from .model.arrays import FloatArray, frozen
from .model.bands import (
    ENDS_NM,
    LUMINANCE_WEIGHTS,
    OBSERVER,
    SPECTRAL,
    TO_RGB,
    band_means,
    luminous_shares,
    tristimulus,
)
from .model.reflectance import Spectrum
from .sky_color import daylight_locus, daylight_weights

#: Below it light is Planckian, from it on CIE daylight. [K]
DAYLIGHT_FROM_K = 4000.0
#: Distance from the Planckian locus beyond which light has no colour temperature.
OFF_WHITE = 0.05
#: Second radiation constant, CODATA 2018. [m K]
_C2 = 1.438776877e-2
#: Greatest luminous efficacy of a spectrum. [lm/W]
_LUMENS_PER_W = 683.002


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


def cct_color(cct_k: float, bands: int) -> FloatArray:
    """Colour (b,) of white light in 1, 3 or 20 bands, of illuminance 1; see `cct_to_rgb`."""
    if bands == 1:
        return np.ones(1)
    return cct_to_rgb(cct_k) if bands == 3 else _cct_bands(float(cct_k))


@lru_cache(maxsize=256)
def spectrum_bands(spectrum: Spectrum) -> FloatArray:
    """Shares (20,) of 1 lx that light of a spectrum has in twenty bands.

    Parameters
    ----------
    spectrum : pairs of (wavelength_nm, relative power)
        Linear in between, nothing outside them.

    Raises
    ------
    InputError
        If the bands have none of its light that is visible.
    """
    wavelength, power = np.array(spectrum).T
    means = band_means(wavelength, power)
    if not means @ OBSERVER[:, 1] > 1e-9 * power.max():
        raise InputError(
            f"spectrum from {wavelength[0]:g} to {wavelength[-1]:g} nm: no light between "
            f"{ENDS_NM[0]:g} and {ENDS_NM[-1]:g} nm, the bands of spectral sensors, is visible"
        )
    return frozen(luminous_shares(means))


@lru_cache(maxsize=8)
def daylight_basis(bands: int) -> FloatArray:
    """S0, S1 and S2 of CIE daylight in 3 or 20 bands, shape (3, b), in one unit of illuminance."""
    import colour

    basis = colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    wavelength = np.asarray(basis["S0"].wavelengths)
    power = [band_means(wavelength, np.asarray(basis[name].values)) for name in ("S0", "S1", "S2")]
    light = np.array(power) * OBSERVER[:, 1]
    # Not `in_primaries`: what is out of the gamut comes back when they are mixed.
    return frozen(light if bands == SPECTRAL else tristimulus(light) @ TO_RGB.T)


@lru_cache(maxsize=256)
def spectrum_color(spectrum: tuple[tuple[float, float], ...]) -> tuple[FloatArray, float]:
    """Linear sRGB (3,) of light of luminance 1, and its correlated colour temperature. [K]

    Parameters
    ----------
    spectrum : pairs of (wavelength_nm, relative power)
        Wavelengths ascend; linear in between, nothing outside them.

    Returns
    -------
    rgb : (3,) array
        By the CIE 1931 2 degree observer at every nanometre from 360 to 830 nm; clipped to the
        gamut as in `cct_to_rgb`.
    cct_k : float
        By Ohno's method [2]; not a number where the chromaticity is more than 0.05 off the
        Planckian locus in (u', 2/3 v'), where the term is not to be used [1].

    .. [1] CIE 015:2018, "Colorimetry", 4th ed., section 9.5.
    .. [2] Y. Ohno, "Practical use and calculation of CCT and Duv", LEUKOS 10 (2014), 47–55.

    Raises
    ------
    InputError
        If none of the light is visible.
    """
    import colour

    wavelength, power = np.array(spectrum).T
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    at = np.asarray(observer.wavelengths)
    xyz = np.interp(at, wavelength, power, left=0.0, right=0.0) @ np.asarray(observer.values)
    if not xyz[1] > 1e-9 * power.max():
        raise InputError(
            f"spectrum from {wavelength[0]:g} to {wavelength[-1]:g} nm: no light between "
            f"{at[0]:g} and {at[-1]:g} nm is visible"
        )
    x, y = xyz[:2] / xyz.sum()
    u, v = 4.0 * x / (3.0 - 2.0 * x + 12.0 * y), 6.0 * y / (3.0 - 2.0 * x + 12.0 * y)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of light far from white, which is told by its distance
        cct, off = colour.temperature.uv_to_CCT(np.array([u, v]), method="Ohno 2013")
    known = abs(off) <= OFF_WHITE and 1000.0 <= cct <= 1e5
    return _rgb_of_chromaticity(float(x), float(y)), float(cct) if known else math.nan


def daylight_spectra(weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Spectra of luminance 1 that are S0 + M1 S1 + M2 S2 of CIE daylight.

    Parameters
    ----------
    weights : (..., 2) array
        M1 and M2, from `sky_color.daylight_weights`.

    Returns
    -------
    wavelength_nm : (w,) array
        300 to 830 nm in steps of 5 nm.
    power : (..., w) array
        Spectral radiance for 1 cd/m²; what would be negative, far from daylight, is 0.
        [W/(m² sr nm)]
    """
    import colour

    basis = colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    wavelength = np.asarray(basis["S0"].wavelengths)
    s0, s1, s2 = (np.asarray(basis[name].values) for name in ("S0", "S1", "S2"))
    power = np.maximum(s0 + weights[..., :1] * s1 + weights[..., 1:] * s2, 0.0)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    seen = np.interp(wavelength, observer.wavelengths, np.asarray(observer.values)[:, 1], 0.0, 0.0)
    step = float(wavelength[1] - wavelength[0])
    return wavelength, power / (_LUMENS_PER_W * step * (power @ seen))[..., None]


def temperature_and_distance(xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Correlated colour temperature [K] and distance Duv of chromaticities (..., 2).

    The distance from the Planckian locus is that in (u', 2/3 v'), positive above it, by Ohno's
    method. Neither is a number more than 0.05 off it, where the terms are not to be used, nor
    outside 1000 to 100 000 K.
    """
    import colour

    xy = np.asarray(xy, dtype=np.float64)
    found = np.full(xy.shape, np.nan)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of light far from white, which is told by its distance
        known = np.isfinite(xy).all(axis=-1)
        if known.any():
            found[known] = colour.temperature.uv_to_CCT(_uv(xy[known]), method="Ohno 2013")
        cct, off = np.moveaxis(found, -1, 0)
        white = (np.abs(off) <= OFF_WHITE) & (cct >= 1000.0) & (cct <= 1e5)
    return np.where(white, cct, np.nan), np.where(white, off, np.nan)


def _uv(xy: FloatArray) -> FloatArray:
    """u and v (..., 2) of 1960 of chromaticities."""
    x, y = np.moveaxis(xy, -1, 0)
    below = 3.0 - 2.0 * x + 12.0 * y
    return np.stack([4.0 * x / below, 6.0 * y / below], axis=-1)


def correlated_temperature(xy: FloatArray) -> FloatArray:
    """Correlated colour temperature (...) of chromaticities (..., 2), by Ohno 2013. [K]"""
    import colour

    uv = _uv(np.asarray(xy, dtype=np.float64))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of light far from white
        return np.asarray(colour.temperature.uv_to_CCT(uv, method="Ohno 2013")[..., 0])


@lru_cache(maxsize=256)
def _cct_bands(cct_k: float) -> FloatArray:
    """Shares (20,) of 1 lx that white light has in twenty bands."""
    import colour

    if cct_k >= DAYLIGHT_FROM_K:
        wavelength, power = daylight_spectra(daylight_weights(daylight_locus(cct_k)))
    else:
        wavelength = np.arange(380.0, 781.0, 5.0)
        power = np.asarray(colour.colorimetry.planck_law(wavelength * 1e-9, cct_k, c2=_C2))
    return frozen(luminous_shares(band_means(wavelength, power)))


@lru_cache(maxsize=256)
def _rgb(cct_k: float) -> FloatArray:
    import colour

    if cct_k < DAYLIGHT_FROM_K:
        observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
        xyz = (
            colour.colorimetry.planck_law(observer.wavelengths * 1e-9, cct_k, c2=_C2)
            @ observer.values
        )
        x, y = xyz[:2] / xyz.sum()
    else:
        x, y = colour.temperature.CCT_to_xy_CIE_D(cct_k)
    return _rgb_of_chromaticity(float(x), float(y))


def _rgb_of_chromaticity(x: float, y: float) -> FloatArray:
    """Linear sRGB (3,) of chromaticity (x, y), clipped to the gamut, with luminance 1."""
    import colour

    space = colour.RGB_COLOURSPACES["sRGB"]
    rgb = np.asarray(space.matrix_XYZ_to_RGB) @ np.array([x / y, 1.0, (1.0 - x - y) / y])
    rgb = np.maximum(rgb, 0.0)
    return frozen(rgb / (rgb @ np.array(LUMINANCE_WEIGHTS)))
