"""Reflectances and spectra as they are given, and what they are in the bands of light."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .arrays import FloatArray, check_finite
from .bands import SPECTRAL, band_means, primary_reflectance, spectral_reflectance

#: Value by wavelength. [nm]
Spectrum = tuple[tuple[float, float], ...]
Reflectance = float | tuple[float, float, float] | Sequence[tuple[float, float]]


def checked_spectrum(name: str, value: object, what: str) -> Spectrum:
    """Pairs of ascending wavelength [nm] and ``what``, >= 0."""
    try:
        pairs = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        pairs = np.empty(0)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) < 2:
        raise InputError(
            f"{name}: shape {pairs.shape}: expected two or more pairs (wavelength_nm, {what})"
        )
    check_finite(name, pairs)
    wavelength, values = pairs.T
    down = np.flatnonzero(np.diff(wavelength) <= 0.0)
    if len(down):
        k = int(down[0])
        raise InputError(
            f"{name}: wavelength {wavelength[k + 1]:g} nm follows {wavelength[k]:g} nm; "
            "they must ascend"
        )
    if (values < 0.0).any():
        k = int(np.argmin(values))
        raise InputError(
            f"{name}: {what.rsplit(' ', 1)[-1]} {values[k]:g} at {wavelength[k]:g} nm: must be >= 0"
        )
    return tuple((float(x), float(y)) for x, y in pairs)


def checked_reflectance(name: str, value: object) -> Reflectance:
    """A scalar, a linear RGB triple, or pairs of wavelength and value, in [0, 1]."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim == 2:
        pairs = checked_spectrum(name, value, "reflectance")
        wavelength, array = np.array(pairs).T
        if (array > 1.0).any():
            k = int(np.argmax(array))
            raise InputError(
                f"{name}: reflectance {array[k]:g} at {wavelength[k]:g} nm: must not exceed 1"
            )
        return float(array[0]) if (array == array[0]).all() else pairs
    if array.shape not in ((), (3,)):
        raise InputError(
            f"{name} = {value!r}: expected a number, a linear (r, g, b) triple or pairs "
            "(wavelength_nm, reflectance)"
        )
    check_finite(name, array)
    if (array < 0.0).any() or (array > 1.0).any():
        raise InputError(f"{name} = {value}: must lie between 0 and 1")
    if array.shape == ():
        return float(array)
    return (float(array[0]), float(array[1]), float(array[2]))


def in_bands(value: Reflectance, bands: int, most: ArrayLike = 1.0) -> FloatArray:
    """A reflectance (b,) in 1, 3 or 20 bands; in 1 it is that of a grey one.

    A spectrum exceeds its own greatest value and ``most`` (3,) in none of 3, see
    `primary_reflectance`.
    """
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 2:
        array = band_means(*array.T, held=True)
        if bands == SPECTRAL:
            return array
        # A primary that reflected more than any wavelength does would be sent back and forth.
        return primary_reflectance(array, np.minimum(most, array.max()))[:bands]
    if array.ndim == 1 and bands == SPECTRAL:
        return spectral_reflectance(array)
    return np.broadcast_to(array, (max(bands, 3),))[:bands]
