"""Daylight credits of LEED v4.1 and BREEAM.

References
----------
.. [1] U.S. Green Building Council, "LEED v4.1 Building Design and Construction", EQ credit
   Daylight: option 1, sDA300/50 % of the regularly occupied area on average of 40, 55 and 75 % for
   1, 2 and 3 points, with the rooms where ASE1000,250 exceeds 10 % named; option 2, between 300
   and 3000 lx at 9 h and 15 h on a clear day of the equinox over 55, 75 and 90 % of it.
.. [2] BRE Global, "BREEAM New Construction", Hea 01: average and worst-lit point by hours a year.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

#: Shares of the area for 1, 2 and 3 points of the options. [1]
OPTION_1, OPTION_2 = (0.40, 0.55, 0.75), (0.55, 0.75, 0.90)
#: ASE above which a room is to be explained, and the range of option 2. [1]
ASE_TOLD, RANGE_LX = 0.10, (300.0, 3000.0)
#: Days before and after an equinox among which the clearest is taken, and its hours. [1]
NEAR_DAYS, HOURS = 15, (9, 15)


@dataclass(frozen=True, slots=True)
class Use:
    """What BREEAM asks of a kind of space: mean and least illuminance, each with its hours. [2]"""

    mean_lx: float
    mean_h: float
    least_lx: float
    least_h: float


#: Kinds of spaces. [2]
USES = {
    "office": Use(300.0, 2000.0, 90.0, 2000.0),
    "education": Use(300.0, 2000.0, 90.0, 2000.0),
    "retail": Use(300.0, 2650.0, 90.0, 2650.0),
    "healthcare": Use(300.0, 2650.0, 90.0, 2650.0),
    "kitchen": Use(100.0, 3450.0, 30.0, 3450.0),
}


def leed_points(share: float, steps: tuple[float, float, float]) -> int:
    """Points, 0 to 3, for a share of the area by `OPTION_1` or `OPTION_2`. [1]"""
    return sum(share >= asked - 1e-9 for asked in steps)


def average_share(shares: FloatArray, areas: FloatArray) -> float:
    """Mean of the shares of rooms by their areas. [1]"""
    return float(np.dot(shares, areas) / np.sum(areas))


def in_range(illuminance: FloatArray, area: FloatArray) -> float:
    """Share of the area within 300 to 3000 lx at all of some times (m, k): option 2. [1]"""
    low, high = RANGE_LX
    both = ((illuminance >= low) & (illuminance <= high)).all(axis=1)
    return float(area @ both / area.sum())


def equinox_steps(
    times: NDArray[np.datetime64], sun_normal_lx: FloatArray, step_minutes: int
) -> NDArray[np.int64]:
    """Steps (2, 2) of 9 h and 15 h on the clearest day about 21 March and 21 September. [1]

    Clearest is the day with most sun, summed over its steps.

    Parameters
    ----------
    times : (n,) array of datetime64
        When each step begins, by clocks.
    sun_normal_lx : (n,) array
        Illuminance of the sun on a plane facing it. [lx]
    step_minutes : int
        Length of a step. [min]

    Raises
    ------
    InputError
        If the days are not all there.
    """
    days = times.astype("datetime64[D]")
    year = str(days[len(days) // 2])[:4]
    rows = []
    for middle in (f"{year}-03-21", f"{year}-09-21"):
        near = np.abs((days - np.datetime64(middle)).astype(np.int64)) <= NEAR_DAYS
        some = np.unique(days[near])
        if len(some) < 2 * NEAR_DAYS + 1:
            raise InputError(f"the weather lacks days about {middle}: option 2 needs 31 of them")
        sums = [float(sun_normal_lx[days == day].sum()) for day in some]
        day = some[int(np.argmax(sums))]
        for hour in HOURS:
            at = day.astype("datetime64[m]") + 60 * hour
            off = (at - times.astype("datetime64[m]")).astype(np.int64)
            holds = np.flatnonzero((off >= 0) & (off < step_minutes))
            if not len(holds):
                raise InputError(f"the weather lacks {at}: option 2 needs it")
            rows.append(int(holds[0]))
    return np.array(rows).reshape(2, 2)


def breeam_hours(
    illuminance: FloatArray, area: FloatArray, step_h: float, use: Use
) -> tuple[float, float, bool]:
    """Hours with enough light on average, and at the worst-lit point; whether both suffice. [2]"""
    mean = (area / area.sum()) @ illuminance
    of_mean = step_h * float((mean >= use.mean_lx).sum())
    of_least = step_h * float((illuminance >= use.least_lx).sum(axis=1).min())
    return of_mean, of_least, of_mean >= use.mean_h and of_least >= use.least_h
