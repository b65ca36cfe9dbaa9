"""Luminous intensity of a lamp over all directions, as photometric files tell it.

Directions are C and γ of CIE 121 [1]: γ = 0 is the nadir of the lamp, γ = 180° its zenith; seen
from the zenith, C runs counter-clockwise from the C0 half-plane. Between the measured directions
the intensity is bilinear in C and γ; outside the measured γ it is zero.

References
----------
.. [1] CIE 121-1996, "The Photometry and Goniophotometry of Luminaires", section 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .arrays import FloatArray, check_finite, check_shape, frozen, unit_vector
from .reprs import photometry_repr

#: Shapes of the luminous opening.
SHAPES = ("point", "rectangle", "circle")


@dataclass(frozen=True, slots=True, eq=False)
class Photometry:
    """A photometric web: intensity over C and γ, symmetry written out.

    Attributes
    ----------
    c_deg : (k,) array
        Half-planes, ascending from 0 to 360; the last repeats the first. [deg]
    gamma_deg : (g,) array
        Angles from the nadir, ascending within 0 … 180. [deg]
    candela : (k, g) array
        Luminous intensity, all factors of the file applied. [cd]
    name : str
        Of the luminaire.
    shape : {"point", "rectangle", "circle"}
        Luminous opening.
    size_m : (3,) tuple
        Luminous opening along C0, along C90, and its height. [m]
    lamp : str
        Lamps it was measured with.
    lamp_flux_lm : float, optional
        Rated flux of the lamps; None for absolute photometry. [lm]
    power_w : float, optional
        Input power. [W]
    source, sha256 : str
        File it was read from and its hash.
    format : str
        As the file calls itself.
    remarks : tuple of str
        What a user should know of the file.
    """

    c_deg: FloatArray
    gamma_deg: FloatArray
    candela: FloatArray
    name: str = ""
    shape: str = "point"
    size_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lamp: str = ""
    lamp_flux_lm: float | None = None
    power_w: float | None = None
    source: str = ""
    sha256: str = ""
    format: str = ""
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return photometry_repr(self)

    def __post_init__(self) -> None:
        for key in ("c_deg", "gamma_deg", "candela"):
            array = frozen(getattr(self, key))
            check_finite(f"Photometry.{key}", array)
            object.__setattr__(self, key, array)
        check_shape("Photometry.c_deg", self.c_deg, (None,))
        check_shape("Photometry.gamma_deg", self.gamma_deg, (None,))
        c, gamma = self.c_deg, self.gamma_deg
        check_shape("Photometry.candela", self.candela, (len(c), len(gamma)))
        if len(c) < 2 or (np.diff(c) <= 0.0).any() or c[0] != 0.0 or c[-1] != 360.0:
            raise InputError("Photometry.c_deg: must ascend from 0 to 360")
        if len(gamma) < 2 or (np.diff(gamma) <= 0.0).any() or gamma[0] < 0.0 or gamma[-1] > 180.0:
            raise InputError("Photometry.gamma_deg: must ascend within 0 … 180, two at least")
        if (self.candela < 0.0).any():
            k, g = (int(i) for i in np.argwhere(self.candela < 0.0)[0])
            raise InputError(f"Photometry.candela[{k}, {g}] = {self.candela[k, g]:g}: must be >= 0")
        if not self.candela.any():
            raise InputError("Photometry.candela: all zero; the lamp gives no light")
        if self.shape not in SHAPES:
            raise InputError(f"Photometry.shape = {self.shape!r}: must be one of {SHAPES}")

    def intensity(self, c_deg: ArrayLike, gamma_deg: ArrayLike) -> FloatArray:
        """Luminous intensity in directions of any shape, bilinear in C and γ. [cd]

        Parameters
        ----------
        c_deg, gamma_deg : array
            Any C, and γ of 0 … 180. [deg]
        """
        c, gamma = np.broadcast_arrays(
            np.mod(np.asarray(c_deg, dtype=np.float64), 360.0),
            np.asarray(gamma_deg, dtype=np.float64),
        )
        i, x = _between(self.c_deg, c)
        j, y = _between(self.gamma_deg, gamma)
        table = self.candela
        low = table[i, j] * (1.0 - y) + table[i, j + 1] * y
        high = table[i + 1, j] * (1.0 - y) + table[i + 1, j + 1] * y
        known = (gamma >= self.gamma_deg[0]) & (gamma <= self.gamma_deg[-1])
        return np.where(known, low * (1.0 - x) + high * x, 0.0)

    @property
    def zonal_lm(self) -> FloatArray:
        """Flux (g − 1,) between successive γ, the exact integral of the bilinear web. [lm]"""
        a, b = np.radians(self.gamma_deg[:-1]), np.radians(self.gamma_deg[1:])
        slope = (np.sin(b) - np.sin(a)) / (b - a)
        # Means over C of a function linear between its half-planes.
        width = np.radians(np.diff(self.c_deg))
        around = width @ (0.5 * (self.candela[:-1] + self.candela[1:]))
        return np.asarray(
            around[:-1] * (np.cos(a) - slope) + around[1:] * (slope - np.cos(b)), dtype=np.float64
        )

    @property
    def flux_lm(self) -> float:
        """Flux into all directions. [lm]"""
        return float(self.zonal_lm.sum())

    @property
    def downward_fraction(self) -> float:
        """Share of the flux below γ = 90°."""
        if self.gamma_deg[-1] <= 90.0:
            return 1.0
        if self.gamma_deg[0] >= 90.0:
            return 0.0
        gamma = np.unique(np.append(self.gamma_deg, 90.0))
        both = Photometry(self.c_deg, gamma, self.intensity(self.c_deg[:, None], gamma[None]))
        zones = both.zonal_lm
        return float(zones[gamma[1:] <= 90.0].sum() / zones.sum())


def _between(grid: FloatArray, values: FloatArray) -> tuple[np.ndarray, FloatArray]:
    """Interval of ``grid`` each value lies in, and how far along it, 0 … 1."""
    k = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    return k, np.clip((values - grid[k]) / (grid[k + 1] - grid[k]), 0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Web:
    """A photometric web and how it is turned.

    Attributes
    ----------
    photometry : Photometry
        The web.
    axes : (3, 3) array
        Unit rows: directions of C0 and C90 at γ = 90°, and the nadir.
    """

    photometry: Photometry
    axes: FloatArray

    def __post_init__(self) -> None:
        axes = frozen(self.axes)
        check_shape("Web.axes", axes, (3, 3))
        object.__setattr__(self, "axes", axes)

    @classmethod
    def aimed(cls, photometry: Photometry, aim: ArrayLike, c0: ArrayLike) -> Web:
        """The web with its nadir along ``aim`` (3,) and C0 towards ``c0`` (3,).

        ``c0`` need not be square to ``aim``; what lies along it does not count.

        Raises
        ------
        InputError
            If one has no direction, or they are parallel within 0.1°.
        """
        nadir, towards = unit_vector("aim", aim), unit_vector("c0", c0)
        across = towards - (towards @ nadir) * nadir
        if np.linalg.norm(across) < np.sin(np.radians(0.1)):
            raise InputError(f"c0 = {_triple(towards)}: must not be parallel to aim")
        across /= np.linalg.norm(across)
        return cls(photometry, np.stack([across, np.cross(across, nadir), nadir]))


def _triple(v: FloatArray) -> str:
    return "(" + ", ".join(f"{x:g}" for x in v) + ")"
