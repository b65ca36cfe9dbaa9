"""Weather of a place, step by step through a period, mostly a typical year."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import FloatArray
from .sky import Site


def is_whole_year(steps: int, step_minutes: int) -> bool:
    """Whether so many steps make 365 or 366 days."""
    return steps * step_minutes in (365 * 1440, 366 * 1440)


@dataclass(frozen=True, slots=True, eq=False)
class Weather:
    """Radiation of n steps of equal length that follow one another; read-only arrays.

    Attributes
    ----------
    site : Site
        Place of the station.
    place : str
        Its name.
    utc_offset_h : float
        Local standard time less universal time; there is no daylight saving. [h]
    step_minutes : int
        Length of a step. [min]
    starts : (n,) array of datetime64
        When each step begins, in local standard time. Months of typical years are of different
        years; here all are of one.
    direct_normal_w_m2, diffuse_horizontal_w_m2 : (n,) array
        Mean irradiance by the sun on a plane facing it, and by the sky on a level one. [W/m²]
    direct_normal_lx, diffuse_horizontal_lx : (n,) array or None
        Mean illuminances as the file states them, mostly modelled, NaN where missing. [lx]
    dew_point_c : (n,) array
        NaN where missing. [°C]
    albedo : (n,) array
        Reflectance of the ground, NaN where missing.
    source, sha256 : str
        File and its hash.
    remarks : tuple of str
        What is to be known of the file, for reports.
    """

    site: Site
    place: str
    utc_offset_h: float
    step_minutes: int
    starts: NDArray[np.datetime64]
    direct_normal_w_m2: FloatArray
    diffuse_horizontal_w_m2: FloatArray
    direct_normal_lx: FloatArray | None
    diffuse_horizontal_lx: FloatArray | None
    dew_point_c: FloatArray
    albedo: FloatArray
    source: str
    sha256: str
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def middles_utc(self) -> NDArray[np.datetime64]:
        """Middle (n,) of each step in universal time: where the sun stands meanwhile."""
        offset_s = round(3600.0 * self.utc_offset_h)
        return np.asarray(self.starts.astype("datetime64[s]") + (30 * self.step_minutes - offset_s))

    @property
    def whole_year(self) -> bool:
        """Whether the steps make 365 or 366 days."""
        return is_whole_year(len(self), self.step_minutes)

    def __repr__(self) -> str:
        first, last = self.starts[0], self.starts[-1]
        return (
            f"<Weather {self.place!r}: {len(self)} steps of {self.step_minutes} min, {first} to "
            f"{last}, UTC{self.utc_offset_h:+g} h>"
        )
