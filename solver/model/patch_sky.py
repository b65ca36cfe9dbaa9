"""A sky measured patch by patch, as sky scanners do.

The sky is parted into 145 patches of nearly the same solid angle [1]: rows of 12° from the horizon
upwards with 30, 30, 24, 24, 18, 12 and 6 of them, and a cap of 6° radius around the zenith.

.. [1] P. R. Tregenza, "Subdivision of the sky hemisphere for luminance measurements", Lighting
   Research and Technology 19(1), 1987, pp. 13-14.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .arrays import FloatArray
from .sky_checks import check_sky_color, store_number

#: Patches of each row, from the horizon to the zenith, and the altitudes at which rows end. [deg]
ROW_COUNTS = (30, 30, 24, 24, 18, 12, 6, 1)
ROW_ENDS_DEG = (0.0, 12.0, 24.0, 36.0, 48.0, 60.0, 72.0, 84.0, 90.0)
PATCH_COUNT = sum(ROW_COUNTS)
#: Brightest patch that is believed: the sun itself is no part of the sky. [cd/m²]
MOST_CD_M2 = 1e7


@dataclass(frozen=True, slots=True)
class PatchSky:
    """Sky of 145 patches, each of one luminance; `read_patch_sky` reads one from a file.

    Attributes
    ----------
    luminance_cd_m2 : (145,) sequence of float
        Of the patches from the lowest row upwards, in each row clockwise from the one whose middle
        is north. [cd/m²]
    sun_altitude_deg, sun_azimuth_deg : float, optional
        Where the sun stood, to be compared with that of the scene. [deg]
    diffuse_illuminance_lx : float, optional
        Horizontal illuminance the luminances are scaled to; as they are when not given. [lx]
    cct_k : float
        Colour of the whole sky. [K]
    color : {"constant", "chain", "preetham"}
        Colour by direction, in scenes whose light has a colour: ``cct_k`` everywhere, or modelled;
        see `patchlight.solver.sky_color`.
    """

    luminance_cd_m2: Sequence[float]
    sun_altitude_deg: float | None = None
    sun_azimuth_deg: float | None = None
    diffuse_illuminance_lx: float | None = None
    cct_k: float = 6500.0
    color: str = "constant"

    def __post_init__(self) -> None:
        try:
            values = np.asarray(self.luminance_cd_m2, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError("PatchSky.luminance_cd_m2: must be 145 numbers") from None
        if values.shape != (PATCH_COUNT,):
            raise InputError(
                f"PatchSky.luminance_cd_m2: shape {values.shape}: must be ({PATCH_COUNT},)"
            )
        bad = np.flatnonzero(~((values >= 0.0) & (values <= MOST_CD_M2)))
        if len(bad):
            raise InputError(
                f"PatchSky.luminance_cd_m2[{bad[0]}] = {values[bad[0]]}: must lie between 0 and "
                f"{MOST_CD_M2:g}"
            )
        # As numbers: skies are compared, and kept under their hash.
        object.__setattr__(self, "luminance_cd_m2", tuple(values.tolist()))
        if (self.sun_altitude_deg is None) != (self.sun_azimuth_deg is None):
            raise InputError("PatchSky: give sun_altitude_deg and sun_azimuth_deg together")
        store_number(self, "sun_altitude_deg", 0.0, 90.0, optional=True)
        store_number(self, "sun_azimuth_deg", -360.0, 360.0, optional=True)
        store_number(self, "diffuse_illuminance_lx", 0.0, 1e7, optional=True)
        check_sky_color(self)
        if self.diffuse_illuminance_lx and not values.any():
            raise InputError("PatchSky: a black sky cannot be scaled to diffuse_illuminance_lx")

    @property
    def needs_sun(self) -> bool:
        """Whether the luminance depends on the position of the sun."""
        return False

    @property
    def relative(self) -> bool:
        """Whether the level is the default one and not a given one."""
        return False

    @property
    def of_daylight_factors(self) -> bool:
        """Whether daylight factors are defined under it."""
        return False


def patch_middles() -> tuple[FloatArray, FloatArray]:
    """Altitude and azimuth (145,) of the middles of the patches; the last is the zenith. [deg]"""
    altitude, azimuth = [], []
    for row, count in enumerate(ROW_COUNTS):
        top = row == len(ROW_COUNTS) - 1
        middle = 90.0 if top else 0.5 * (ROW_ENDS_DEG[row] + ROW_ENDS_DEG[row + 1])
        altitude += [middle] * count
        azimuth += [360.0 * k / count for k in range(count)]
    return np.array(altitude), np.array(azimuth)


def patch_weights() -> FloatArray:
    """∫ sin γ dω (145,) of the patches, which add up to π. [sr]"""
    ends = np.sin(np.radians(ROW_ENDS_DEG)) ** 2
    rows = np.pi * np.diff(ends) / np.array(ROW_COUNTS)
    return np.repeat(rows, ROW_COUNTS)
