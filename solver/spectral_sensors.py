"""Colour and melanopic values of the light gathered at sensors in twenty bands."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .model.arrays import FloatArray
from .model.bands import SPECTRAL
from .model.colorimetry import SpectralLight, chromaticity, melanopic_der
from .spectra import temperature_and_distance

#: Step in x and in y by which it is told how colour temperature changes with them: far less than
#: what is seen, and far more than the rounding of Ohno's method.
STEP = 1e-5


def spectral_light(components: Iterable[FloatArray], error_lx: FloatArray) -> SpectralLight:
    """Colour of light, and how far it may be off.

    Parameters
    ----------
    components : (n, 20) arrays
        Its parts, which add up to it. [lx]
    error_lx : (n,) array
        Half-width of the numerical error of its illuminance.
    """
    parts = list(components)
    whole = sum(parts, np.zeros((len(error_lx), SPECTRAL)))
    xy, ratio = chromaticity(whole), melanopic_der(whole)
    told = np.stack(temperature_and_distance(xy))
    steps = (np.stack(temperature_and_distance(xy + STEP * np.eye(2)[k])) - told for k in range(2))
    slope = np.stack([step / STEP for step in steps], axis=-1)  # (2, n, 2)
    errors = np.zeros((3, len(error_lx)))
    for part in parts:
        level = part.sum(axis=1)
        lit = np.flatnonzero((level > 0.0) & np.isfinite(told[0]))
        other = whole[lit] + part[lit] * (error_lx[lit] / level[lit])[:, None]
        off = np.einsum("knc,nc->kn", slope[:, lit], chromaticity(other) - xy[lit])
        off = np.abs(np.concatenate([off, (melanopic_der(other) - ratio[lit])[None]]))
        errors[:, lit] = np.maximum(errors[:, lit], np.nan_to_num(off))
    return SpectralLight(whole, told[0], told[1], *errors)
