"""The sun of one cloudless day, for hours of sun on it."""

from __future__ import annotations

import contextlib
import datetime
import re
from dataclasses import dataclass

import numpy as np

from .errors import InputError
from .model.arrays import FloatArray
from .model.weather import Weather
from .sun_light import SunLight
from .sun_position import sun_positions

#: Minutes between places of the sun.
STEP_MIN = 5
#: A year that has all days.
LEAP_YEAR = 2000
_DAY = re.compile(r"[0-9]{2}-[0-9]{2}")


def check_day(day: str, year: int = LEAP_YEAR) -> datetime.date:
    """The ``day`` of a year, which is given like 03-21; without the year any that some year has.

    Raises
    ------
    InputError
        For a day that there is not, and what is written in another way.
    """
    if isinstance(day, str) and _DAY.fullmatch(day):
        with contextlib.suppress(ValueError):
            return datetime.date(year, int(day[:2]), int(day[3:]))
    there = "" if year == LEAP_YEAR else f" of {year}"
    raise InputError(f"sun_day = {day!r}: must be month and day{there}, like 03-21")


def check_above(above_deg: float) -> None:
    """Raise `InputError` for an altitude from which on the sun counts beyond 0 … 90. [deg]"""
    if not (np.isfinite(above_deg) and 0.0 <= above_deg < 90.0):
        raise InputError(f"sun_above_deg = {above_deg}: must be at least 0 and below 90")


@dataclass(frozen=True, slots=True, eq=False)
class SunDay:
    """Places (k,) of the sun on one day while it is up, `STEP_MIN` apart.

    Attributes
    ----------
    altitude_deg, azimuth_deg : (k,) array
        Of its middle; azimuths clockwise from north. [deg]
    """

    altitude_deg: FloatArray
    azimuth_deg: FloatArray

    @classmethod
    def of(cls, weather: Weather, day: str, above_deg: float = 0.0) -> SunDay:
        """Those of a ``day`` like 03-21 at the place of ``weather``, in the year of its first step.

        Parameters
        ----------
        weather : Weather
            Its radiation does not count: no cloud hides the sun.
        day : str
            Month and day.
        above_deg : float
            Altitude from which on the sun counts. [deg]

        Raises
        ------
        InputError
            For a day that there is not, and altitudes beyond 0 … 90.
        """
        check_above(above_deg)
        first = np.datetime64(check_day(day, int(str(weather.starts[0].astype("datetime64[Y]")))))
        minutes = STEP_MIN * (np.arange(24 * 60 // STEP_MIN) + 0.5)
        times = first.astype("datetime64[s]") + np.round(60.0 * minutes).astype("timedelta64[s]")
        offset = np.timedelta64(round(3600.0 * weather.utc_offset_h), "s")
        altitude, azimuth = sun_positions(weather.site, times - offset)
        up = altitude > above_deg
        return cls(altitude[up], azimuth[up])

    def hours(self, light: SunLight) -> FloatArray:
        """Hours (m,) in which any of the disc is seen by sensors that face it."""
        seen = light.light(self.altitude_deg, self.azimuth_deg) > 0.0
        return np.asarray(seen.sum(axis=1) * (STEP_MIN / 60.0))
