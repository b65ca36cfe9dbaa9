"""What surfaces do with light: reflect it (`Material`), emit it (`Emitter`), or are air (`Air`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .arrays import FloatArray, unit_vector
from .bands import LUMINANCE_WEIGHTS, SPECTRAL
from .photometry import Photometry
from .profiles import ProfileFunction, ProfileTable, checked_profile
from .reflectance import Reflectance, checked_reflectance, checked_spectrum, in_bands

#: Sharpest lobe: a twentieth of a degree wide. Use a mirror beyond it.
MAX_EXPONENT = 1e6
#: Shares of a material, those first that keep theirs where spectra do not fit into primaries.
_SHARES = ("mirror", "specular", "reflectance")


@dataclass(frozen=True, slots=True)
class Material:
    """Opaque surface: a diffuse, a glossy and a mirroring share of reflection.

    Attributes
    ----------
    reflectance : float, (r, g, b) or sequence of (wavelength_nm, reflectance)
        Diffuse reflectance, 0 … 1: grey, per linear sRGB primary, or a spectrum, which is linear
        between the pairs and outside them as at the nearest one; see `bands` for what becomes of
        one kind where another is needed.
    specular : float, (r, g, b) or sequence of (wavelength_nm, reflectance)
        Glossy reflectance r_s of Phong's lobe r_s (n + 2)/(2π) cosⁿα about the mirrored direction.
    exponent : float
        Its sharpness n, 1 … 1e6: half of the light is within about √(1.4 / n) of its axis.
    mirror : float, (r, g, b) or sequence of (wavelength_nm, reflectance)
        Share that is reflected as by a mirror.
    back : Material, optional
        Material of the other side of a sheet; the same when not given.
    name : str
        Shown in reports.

    Raises
    ------
    InputError
        If a value is out of range, or all three shares together exceed 1 in a band.
    """

    reflectance: Reflectance = 0.5
    specular: Reflectance = field(default=0.0, kw_only=True)
    exponent: float = field(default=50.0, kw_only=True)
    mirror: Reflectance = field(default=0.0, kw_only=True)
    back: Material | None = field(default=None, kw_only=True)
    name: str = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        for share in ("reflectance", "specular", "mirror"):
            value = checked_reflectance(f"Material.{share}", getattr(self, share))
            object.__setattr__(self, share, value)
        # Of spectra the primaries are what the sum leaves: see `_share_in`.
        plain = [value for name in _SHARES if np.ndim(value := getattr(self, name)) < 2]
        sums = (
            sum(in_bands(value, 3) for value in plain),
            self.scattered_in(SPECTRAL) + self.mirror_in(SPECTRAL),
        )
        total = max(float(np.max(share)) for share in sums)
        if total > 1.0 + 1e-12:
            raise InputError(
                f"Material: reflectance + specular + mirror = {total:g}: must not exceed 1 in any "
                "band"
            )
        if not 1.0 <= self.exponent <= MAX_EXPONENT:
            raise InputError(
                f"Material.exponent = {self.exponent}: must lie between 1 and {MAX_EXPONENT:g}"
            )
        object.__setattr__(self, "exponent", float(self.exponent))

    @property
    def bands(self) -> FloatArray:
        """Diffuse reflectance in the three colour bands, shape (3,)."""
        return self._share_in("reflectance", 3)

    @property
    def specular_bands(self) -> FloatArray:
        """Glossy reflectance in the three colour bands, shape (3,)."""
        return self.specular_in(3)

    @property
    def mirror_bands(self) -> FloatArray:
        """Mirroring share in the three colour bands, shape (3,)."""
        return self.mirror_in(3)

    @property
    def scattered_bands(self) -> FloatArray:
        """Diffuse and glossy reflectance together, shape (3,): what interreflection knows."""
        return self.scattered_in(3)

    def specular_in(self, bands: int) -> FloatArray:
        """Glossy reflectance (b,) in 1, 3 or 20 bands."""
        return self._share_in("specular", bands)

    def mirror_in(self, bands: int) -> FloatArray:
        """Mirroring share (b,) in 1, 3 or 20 bands."""
        return self._share_in("mirror", bands)

    def scattered_in(self, bands: int) -> FloatArray:
        """Diffuse and glossy reflectance (b,) together in 1, 3 or 20 bands."""
        return self._share_in("reflectance", bands) + self.specular_in(bands)

    def _share_in(self, name: str, bands: int) -> FloatArray:
        """One share (b,); of a spectrum no more in a primary than the others leave of 1.

        Spectra whose sum is 1 at most in twenty bands may exceed it in three, whose gamut is
        narrower: then mirrors come first, and what is diffuse last.
        """
        value = getattr(self, name)
        if bands == SPECTRAL or np.ndim(value) < 2:
            return in_bands(value, bands)
        left, place = np.ones(3), _SHARES.index(name)
        for k, other in enumerate(_SHARES):
            if k != place and (k < place or np.ndim(getattr(self, other)) < 2):
                left = left - self._share_in(other, 3)
        return in_bands(value, bands, np.maximum(left, 0.0))

    @property
    def is_grey(self) -> bool:
        """Whether all bands reflect alike."""
        shares = (self.reflectance, self.specular, self.mirror)
        return all(np.ndim(s) < 2 and bool(np.ptp(s) == 0.0) for s in shares)

    @property
    def is_glossy(self) -> bool:
        """Whether it has a glossy share."""
        return bool(self.specular_bands.any())

    @property
    def is_mirror(self) -> bool:
        """Whether it has a mirroring share."""
        return bool(self.mirror_bands.any())

    @property
    def luminous_reflectance(self) -> float:
        """Diffuse and glossy reflectance, weighted by the luminance of the primaries."""
        return float(self.scattered_bands @ np.array(LUMINANCE_WEIGHTS))

    @property
    def luminous_mirror(self) -> float:
        """Mirroring share of grey light: luminous, and no more than any band has left."""
        left = 1.0 - max(float(self.scattered_in(bands).max()) for bands in (3, SPECTRAL))
        return min(float(self.mirror_bands @ np.array(LUMINANCE_WEIGHTS)), max(left, 0.0))


@dataclass(frozen=True, slots=True)
class Emitter:
    """Light leaving a surface: Lambertian, even over it or not, or by a photometric web.

    Attributes
    ----------
    flux_lm : float, optional
        Total flux leaving each matched part; with ``photometry``, instead of the web's own. [lm]
    luminance_cd_m2 : float, optional
        Luminance instead of a flux; with ``profile`` the mean. [cd/m²]
    cct_k : float
        Correlated colour temperature on the daylight or Planckian locus. [K]
    spectrum : sequence of (wavelength_nm, relative power), optional
        Colour of the light, instead of ``cct_k``: linear between the pairs, nothing outside them.
    profile : callable or table, optional
        How the exitance varies over the emitting faces, as relative values >= 0; the flux stays
        what it is. A function of points (m, 3) in the part's own coordinates [m], before it was
        placed in an assembly or the scene, that returns (m,) values; or values at equal steps over
        the parameters of each patch, bilinear in between: a table (k, l), one for each patch
        (p, k, l), or the four corners (u, v) = (0, 0), (1, 0), (1, 1), (0, 1).
    side : {"both", "front", "back"}
        Emitting side of a sheet; solids emit on their outside.
    group : str, optional
        Light group of the result; the part's name when not given.
    power_w : float, optional
        Electric power, for the report; that of ``photometry`` when not given. [W]
    dim : float
        Factor on the flux.
    photometry : Photometry or path, optional
        Directions that the light takes: a web, or the IES or EULUMDAT file to read it from.
    aim : (3,) vector, optional
        Where the nadir of the web points in the scene; the part's own −z when not given.
    c0 : (3,) vector, optional
        Where its C0 half-plane points; the part's own +x when not given.
    """

    flux_lm: float | None = None
    _: KW_ONLY
    luminance_cd_m2: float | None = None
    cct_k: float = 4000.0
    spectrum: Sequence[tuple[float, float]] | None = None
    profile: ProfileFunction | ProfileTable | ArrayLike | None = None
    side: str = "both"
    photometry: Photometry | str | PathLike[str] | None = None
    aim: tuple[float, float, float] | None = None
    c0: tuple[float, float, float] | None = None
    group: str | None = None
    power_w: float | None = None
    dim: float = 1.0

    def __post_init__(self) -> None:
        if self.photometry is None:
            if (self.flux_lm is None) == (self.luminance_cd_m2 is None):
                raise InputError(
                    "Emitter: give exactly one of flux_lm, luminance_cd_m2 and photometry"
                )
        elif self.luminance_cd_m2 is not None:
            raise InputError("Emitter: luminance_cd_m2 is not used together with photometry")
        elif not isinstance(self.photometry, Photometry | str | PathLike):
            raise InputError(f"Emitter.photometry = {self.photometry!r}: Photometry or a path")
        for name in ("flux_lm", "luminance_cd_m2", "power_w", "dim"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"Emitter.{name} = {value}: must be a number >= 0")
        if not 1000.0 <= self.cct_k <= 25000.0:
            raise InputError(f"Emitter.cct_k = {self.cct_k}: must lie between 1000 and 25000")
        if self.spectrum is not None:
            if self.cct_k != 4000.0:
                raise InputError("Emitter: give cct_k or spectrum, not both")
            spectrum = checked_spectrum("Emitter.spectrum", self.spectrum, "relative power")
            object.__setattr__(self, "spectrum", spectrum)
        if self.profile is not None:
            if self.photometry is not None:
                raise InputError(
                    "Emitter: profile is not used together with photometry: a web tells the light "
                    "of the lamp as a whole, not of its places"
                )
            object.__setattr__(self, "profile", checked_profile(self.profile))
        if self.side not in ("both", "front", "back"):
            raise InputError(f"Emitter.side = {self.side!r}: both, front or back")
        for name in ("aim", "c0"):
            value = getattr(self, name)
            if value is None:
                continue
            if self.photometry is None:
                raise InputError(f"Emitter.{name} is used together with photometry only")
            v = unit_vector(f"Emitter.{name}", value)
            object.__setattr__(self, name, (float(v[0]), float(v[1]), float(v[2])))


@dataclass(frozen=True, slots=True)
class Air:
    """The part is the volume of the room itself: its faces are active inside."""
