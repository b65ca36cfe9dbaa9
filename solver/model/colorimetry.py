"""Colour of the light at sensors, and what it is to the inner clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import FloatArray, IntArray
from .bands import D65, MELANOPIC, OBSERVER, luminous_shares, tristimulus

#: Melanopic action of 1 lx in each band (20,), and of 1 lx of D65. [nm, in one unit]
_ACTION = MELANOPIC / OBSERVER[:, 1]
_OF_D65 = float(luminous_shares(D65) @ _ACTION)


@dataclass(frozen=True, slots=True, eq=False)
class SpectralLight:
    """Light in twenty bands at n sensors; row i of every array is the same sensor.

    What is stated as error is the most that a value changes when the numerical error of the
    illuminance is light of one of the groups, direct or indirect; and where the colour of the sky
    is modelled by direction what the cells leave of its mean. Spectra of sky, sun, lamps and
    surfaces are taken as given or modelled, and 20 bands as what is known of them.

    Attributes
    ----------
    bands_lx : (n, 20) array
        Share of the illuminance in each band, see `bands`. [lx]
    cct_k : (n,) array
        Correlated colour temperature; not a number for light that has none. [K]
    duv : (n,) array
        Distance from the Planckian locus in (u', 2/3 v'), positive above it. [1]
    cct_error_k, duv_error, der_error : (n,) array
        Half-widths of the errors of `cct_k`, `duv` and `melanopic_der`; not numbers where these
        are none. [K, 1, 1]
    """

    bands_lx: FloatArray
    cct_k: FloatArray
    duv: FloatArray
    cct_error_k: FloatArray
    duv_error: FloatArray
    der_error: FloatArray

    @property
    def chromaticity(self) -> FloatArray:
        """x and y (n, 2) of the CIE 1931 observer; not a number in the dark."""
        return chromaticity(self.bands_lx)

    @property
    def melanopic_edi_lx(self) -> FloatArray:
        """Melanopic equivalent daylight (D65) illuminance (n,) of CIE S 026. [lx]"""
        return melanopic_edi(self.bands_lx)

    @property
    def melanopic_der(self) -> FloatArray:
        """Melanopic daylight (D65) efficacy ratio (n,); not a number in the dark. [1]"""
        return melanopic_der(self.bands_lx)

    def take(self, rows: IntArray) -> SpectralLight:
        """That at some sensors."""
        return SpectralLight(*(getattr(self, name)[rows] for name in self.__slots__))


def chromaticity(light: FloatArray) -> FloatArray:
    """x and y (..., 2) of light (..., 20); not a number in the dark."""
    xyz = tristimulus(light)
    whole = xyz.sum(axis=-1, keepdims=True)
    return np.asarray(xyz[..., :2] / np.where(whole > 0.0, whole, np.nan))


def melanopic_edi(light: FloatArray) -> FloatArray:
    """Illuminance (...) by D65 of the melanopic action of light (..., 20). [lx]"""
    return np.asarray(light @ _ACTION / _OF_D65)


def melanopic_der(light: FloatArray) -> FloatArray:
    """The same for 1 lx of the light; not a number in the dark. [1]"""
    level = light.sum(axis=-1)
    return np.asarray(melanopic_edi(light) / np.where(level > 0.0, level, np.nan))
