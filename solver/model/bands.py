"""Bands of light: one, the three linear sRGB primaries, or twenty of 20 nm from 380 to 780 nm.

In one band light is its illuminance [lx]. In three it is linear sRGB, scaled so that the luminance
of the primaries weighs it to its illuminance. In twenty it is the illuminance that each band has a
share in, so that the shares add up to it.

What is known of light is its mean power in each of the twenty. Its tristimulus values [1] and what
it is to melanopsin [2] are those of the smoothest spectrum with these means: the derivative of the
cubic spline through its power summed up from 380 nm. Daylight of 4000 to 10 000 K keeps its colour
temperature to 0.08 % and its melanopic ratio to 0.02 %, white LEDs to 0.4 % and 0.3 %, fluorescent
lamps, whose lines are narrow against 20 nm, to 5 % and 5 %.

Reflectances in linear sRGB become spectra by the three of [3], which are smooth, add up to 1 and
are nowhere negative: white stays white, nothing exceeds what was given, and shares of one surface
that add up to 1 still do. They are mixed, by no more than 0.005, so that under D65 the twenty bands
have the linear sRGB that was given.

.. [1] CIE 015:2018, "Colorimetry", 4th ed., observer of 1931, 2 degrees.
.. [2] CIE S 026/E:2018, "CIE System for Metrology of Optical Radiation for ipRGC-Influenced
   Responses to Light"; action spectrum: CIE 2018, DOI 10.25039/CIE.DS.vqqhzp5a, at every 5 nm.
.. [3] I. Mallett and C. Yuksel, "Spectral primary decomposition for rendering with sRGB
   reflectance", Eurographics Symposium on Rendering 2019.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .arrays import FloatArray, frozen

#: Luminance of linear sRGB primaries (IEC 61966-2-1), the weights of the three colour bands.
LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)
#: Bands where colour temperatures or melanopic values are asked for, and their ends. [nm]
SPECTRAL = 20
ENDS_NM = frozen(np.linspace(380.0, 780.0, SPECTRAL + 1))
#: For each band the integrals of X, Y, Z [1] and of melanopic action [2] that mean power 1 has, the
#: power of D65, and the reflectance of the red, green and blue primary [3]. [nm, nm, nm, nm, 1 …]
_TABLE = np.array([
    (0.0546614, 0.00245227, 0.26095, 0.0225557, 60.5067, 0.3017, 0.32222, 0.37608),
    (0.731778, 0.0140589, 3.45929, 0.801876, 89.7897, 0.13159, 0.18852, 0.67989),
    (5.58078, 0.218757, 27.1156, 4.99473, 92.9153, 0.02442, 0.04326, 0.93232),
    (7.11195, 0.736308, 37.371, 11.0332, 114.173, 0.01232, 0.0287, 0.95898),
    (3.89643, 1.80337, 25.8183, 17.2831, 115.864, 0.01076, 0.04438, 0.94486),
    (0.503114, 3.95564, 8.87403, 20.291, 110.725, 0.00899, 0.44321, 0.5478),
    (0.0670606, 10.0635, 2.96236, 17.3778, 107.437, 0.00316, 0.93689, 0.05995),
    (3.16541, 17.4508, 0.744773, 10.3581, 106.143, 0.00131, 0.9738, 0.02489),
    (8.63984, 20.0567, 0.167713, 4.17627, 103.124, 0.00276, 0.97727, 0.01997),
    (15.281, 19.1672, 0.0355758, 1.08095, 97.1141, 0.01204, 0.97288, 0.01508),
    (20.7932, 15.1984, 0.0251135, 0.206643, 90.7913, 0.52608, 0.46285, 0.01107),
    (20.3578, 10.0485, 0.00718068, 0.0391504, 89.2258, 0.95845, 0.03138, 0.01017),
    (12.9431, 5.26799, 0.000922565, 0.00730658, 84.4938, 0.95341, 0.03168, 0.01491),
    (5.50313, 2.06229, 3.32949e-05, 0.00160496, 80.9918, 0.90214, 0.06428, 0.03358),
    (1.66274, 0.607204, -5.88543e-06, 0.000345342, 80.7636, 0.74529, 0.16, 0.09471),
    (0.423099, 0.152895, 1.57685e-06, 9.11976e-05, 72.334, 0.48931, 0.28699, 0.2237),
    (0.104878, 0.0378738, -4.21974e-07, 2.27072e-05, 70.4778, 0.37224, 0.32555, 0.30221),
    (0.0268767, 0.0097055, 1.11046e-07, 6.92045e-06, 69.1155, 0.3417, 0.33178, 0.32652),
    (0.00607612, 0.00219424, -2.59107e-08, 2.06982e-06, 62.1726, 0.3347, 0.33292, 0.33238),
    (0.00137265, 0.000495685, 3.70153e-09, 6.04462e-07, 60.853, 0.33316, 0.33315, 0.33369),
])  # fmt: skip
#: Tristimulus values X, Y, Z (20, 3) and melanopic action (20,) of mean power 1 in a band. [nm]
OBSERVER, MELANOPIC = frozen(_TABLE[:, :3]), frozen(_TABLE[:, 3])
#: Power of D65 (20,), and reflectances of the linear sRGB primaries (3, 20).
D65, PRIMARIES = frozen(_TABLE[:, 4]), frozen(_TABLE[:, 5:].T)
#: Linear sRGB of X, Y, Z. [IEC 61966-2-1]
TO_RGB = np.array([
    [3.2406, -1.5372, -0.4986],
    [-0.9689, 1.8758, 0.0415],
    [0.0557, -0.2040, 1.0570],
])  # fmt: skip


def band_means(wavelength_nm: ArrayLike, values: ArrayLike, *, held: bool = False) -> FloatArray:
    """Means (20,) over the bands of what is linear between ``values`` (w,).

    Outside the wavelengths it is 0, or with ``held`` as at the nearest one.
    """
    x, y = (np.asarray(a, dtype=np.float64) for a in (wavelength_nm, values))
    outside = (None, None) if held else (0.0, 0.0)
    out = np.empty(SPECTRAL)
    for k, (low, high) in enumerate(zip(ENDS_NM[:-1], ENDS_NM[1:], strict=True)):
        at = np.array(sorted({low, high, *x[(x > low) & (x < high)]}))
        whole = 0.0
        for a, b in zip(at[:-1], at[1:], strict=True):
            whole += (b - a) * float(np.interp(0.5 * (a + b), x, y, *outside))
        out[k] = whole / (high - low)
    return out


def luminous_shares(power: ArrayLike) -> FloatArray:
    """Shares (..., 20) of 1 lx that light of mean spectral power (..., 20) has in the bands."""
    seen = np.asarray(power, dtype=np.float64) * OBSERVER[:, 1]
    return np.asarray(seen / seen.sum(axis=-1, keepdims=True))


def tristimulus(light: FloatArray) -> FloatArray:
    """X, Y, Z (..., 3) of light (..., 20) in twenty bands, Y being its illuminance."""
    return np.asarray(light @ (OBSERVER / OBSERVER[:, 1:2]))


def in_primaries(light: FloatArray) -> FloatArray:
    """Linear sRGB (..., 3) of light (..., 20), of the same illuminance.

    What lies outside the gamut is brought back by setting negative values to 0.
    """
    rgb = np.maximum(tristimulus(light) @ TO_RGB.T, 0.0)
    told = rgb @ np.array(LUMINANCE_WEIGHTS)
    level = light.sum(axis=-1) / np.where(told > 0.0, told, 1.0)
    return np.asarray(rgb * level[..., None])


def spectral_reflectance(rgb: ArrayLike) -> FloatArray:
    """Reflectance (..., 20) in twenty bands of a linear sRGB one (..., 3). [3]"""
    return np.asarray(np.asarray(rgb, dtype=np.float64) @ PRIMARIES)


def primary_reflectance(reflectance: FloatArray, most: ArrayLike = 1.0) -> FloatArray:
    """Linear sRGB (..., 3) of a reflectance (..., 20): what it makes of D65, 0 to ``most`` (3,).

    What lies outside the gamut is brought back by setting negative values to 0 and values above the
    most to that. All others are scaled so that luminance stays, as far as the most allows.
    """
    light, weights = luminous_shares(D65), np.array(LUMINANCE_WEIGHTS)
    seen = tristimulus(reflectance * light) @ TO_RGB.T / (tristimulus(light) @ TO_RGB.T)
    level = np.asarray(seen @ weights)[..., None]
    # More than nothing, so that it can be scaled where all others are full.
    free, most = np.maximum(seen, 1e-9), np.broadcast_to(most, seen.shape)
    out, full = free, np.zeros(seen.shape, dtype=bool)
    for _ in range(3):  # each time one more primary may be full
        rest = level - np.where(full, weights * most, 0.0).sum(axis=-1, keepdims=True)
        known = np.where(full, 0.0, weights * free).sum(axis=-1, keepdims=True)
        scale = np.maximum(rest, 0.0) / np.where(known > 0.0, known, 1.0)
        out = np.where(full, most, scale * free)
        full = full | (out > most)
    return np.asarray(np.minimum(out, most))
