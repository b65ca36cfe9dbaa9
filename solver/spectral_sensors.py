"""Colour and melanopic values of the light gathered at sensors in twenty bands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .model.arrays import FloatArray
from .model.bands import SPECTRAL
from .model.colorimetry import SpectralLight, chromaticity, melanopic_der
from .sky_color import DAYLIGHT_K, daylight_locus, daylight_weights
from .spectra import daylight_basis, temperature_and_distance

#: Step in x and in y by which it is told how colour temperature changes with them: far less than
#: what is seen, and far more than the rounding of Ohno's method.
STEP = 1e-5
#: What the cells of `light_colors` leave of the colour of a sky by its model: share of its colour
#: temperature in direct light (577 cells) and in indirect light (145), and distance Duv in both.
#: Most found against 5185 and 2305 cells in the open and behind a window, under clear and partly
#: cloudy skies with the sun at 5 to 70 degrees: 1.5 %, 0.4 % and 4e-5 by luminance, of which cells
#: at a window's head have most, and 1.5 %, 3.1 % and 1.1e-3 where colours change most at the
#: horizon.
OF_CELLS = {
    "constant": (0.0, 0.0, 0.0),
    "chain": (0.02, 0.01, 1e-4),
    "preetham": (0.02, 0.035, 1.2e-3),
}


def spectral_light(
    components: Mapping[str, FloatArray], error_lx: FloatArray, sky_color: str = "constant"
) -> SpectralLight:
    """Colour of light, and how far it may be off.

    Parameters
    ----------
    components : mapping of str to (n, 20) array
        Its parts by name, which add up to it. [lx]
    error_lx : (n,) array
        Half-width of the numerical error of its illuminance.
    sky_color : str
        Model of the colour of the sky, of which cells tell the mean that each sensor sees.
    """
    whole = sum(components.values(), np.zeros((len(error_lx), SPECTRAL)))
    xy, ratio = chromaticity(whole), melanopic_der(whole)
    told = np.stack(temperature_and_distance(xy))
    steps = (np.stack(temperature_and_distance(xy + STEP * np.eye(2)[k])) - told for k in range(2))
    slope = np.stack([step / STEP for step in steps], axis=-1)  # (2, n, 2)
    level = whole.sum(axis=1)

    def off(change: FloatArray) -> FloatArray:
        """What a change (n, 20) of the light does to the three values (3, n)."""
        found = np.einsum("knc,nc->kn", slope, chromaticity(whole + change) - xy)
        found = np.concatenate([found, (melanopic_der(whole + change) - ratio)[None]])
        return np.nan_to_num(np.abs(found))

    errors = np.zeros((3, len(error_lx)))
    for part in components.values():
        own = part.sum(axis=1)
        relative = np.divide(error_lx, own, out=np.zeros(len(own)), where=own > 0.0)
        errors = np.maximum(errors, off(part * relative[:, None]))
    *shares, distance = OF_CELLS[sky_color]
    for name, share in zip(("sky.direct", "sky.indirect"), shares, strict=True):
        if name in components and share > 0.0:
            errors += off(_bluer(components[name], share))
            own = components[name].sum(axis=1)
            errors[1] += distance * np.divide(own, level, out=np.zeros(len(own)), where=level > 0.0)
    # What is not told has no error.
    values = np.stack([*told, ratio])
    return SpectralLight(whole, told[0], told[1], *np.where(np.isfinite(values), errors, np.nan))


def _bluer(part: FloatArray, share: float) -> FloatArray:
    """How light (n, 20) changes where its colour temperature grows by a share, as of daylight."""
    cct = temperature_and_distance(chromaticity(part))[0]
    low, high = DAYLIGHT_K
    cct = np.clip(np.where(np.isfinite(cct), cct, high), low, high / (1.0 + share))
    lights = []
    for t in (cct, cct * (1.0 + share)):
        weights = daylight_weights(daylight_locus(t))
        light = np.concatenate([np.ones((len(t), 1)), weights], axis=1) @ daylight_basis(SPECTRAL)
        lights.append(light / light.sum(axis=1, keepdims=True))
    return np.asarray((lights[1] - lights[0]) * part.sum(axis=1, keepdims=True))
