"""Hours of sun at points, and exposure to sunlight by EN 17037.

References
----------
.. [1] EN 17037:2018+A1:2021, "Daylight in buildings", 5.3: 1.5, 3 or 4 hours on one day between
   1 February and 21 March, the sun above a least altitude.
.. [2] World Meteorological Organization, "Guide to instruments and methods of observation",
   WMO-No. 8, chapter 8: the sun shines while its direct irradiance exceeds 120 W/m².
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.arrays import FloatArray

#: Illuminance on a plane facing the sun from which on it shines: of 120 W/m² at 92 lm/W, as Perez'
#: efficacies have a low sun. [2] [lx]
SHINES_LX = 11_000.0
#: Hours of sun of each level. [1]
SUNLIGHT_LEVELS = {"minimum": 1.5, "medium": 3.0, "high": 4.0}


def sunlight_hours(
    sun_illuminance: FloatArray, sun_normal_lx: FloatArray, step_h: float
) -> FloatArray:
    """Hours (m,) in which points get sun while it shines. [2]

    Parameters
    ----------
    sun_illuminance : (m, n) array
        Straight from the sun. [lx]
    sun_normal_lx : (n,) array
        Illuminance of the sun on a plane facing it. [lx]
    step_h : float
        Length of a step. [h]
    """
    sunny = sun_illuminance[:, sun_normal_lx > SHINES_LX] > 0.0
    return np.asarray(step_h * sunny.sum(axis=1), dtype=np.float64)


def sunlight_level(hours: float) -> str | None:
    """The highest level of EN 17037 that so many hours on the chosen day reach. [1]"""
    reached = [name for name, asked in SUNLIGHT_LEVELS.items() if hours >= asked]
    return reached[-1] if reached else None


def is_in_season(times: NDArray[np.datetime64]) -> NDArray[np.bool_]:
    """Whether times (n,) lie from 1 February to 21 March, when a day is chosen. [1]"""
    days = times.astype("datetime64[D]")
    year = days.astype("datetime64[Y]")
    first = year.astype("datetime64[D]")
    of_year = (days - first).astype(np.int64)
    leap = ((year + 1).astype("datetime64[D]") - first).astype(np.int64) - 365
    return np.asarray((of_year >= 31) & (of_year <= 79 + leap))
