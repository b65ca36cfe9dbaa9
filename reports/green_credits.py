"""Daylight credits of LEED v4.1 and BREEAM.

References
----------
.. [1] U.S. Green Building Council, "LEED v4.1 Building Design and Construction", EQ credit
   Daylight: option 1, sDA300/50 % of the regularly occupied area on average of 40, 55 and 75 % for
   1, 2 and 3 points, with the rooms where ASE1000,250 exceeds 10 % named; option 2, between 300
   and 3000 lx at 9 h and 15 h on a clear day of the equinox over 55, 75 and 90 % of it, without
   blinds or shades.
.. [2] BRE Global, "BREEAM New Construction", Hea 01: average and worst-lit point by hours a year,
   over a share of the area.
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
    """What BREEAM asks of a kind of space: mean and least illuminance, each with its hours. [2]

    The least one is that of the worst-lit point of a share of the ``area``, the best-lit one.
    """

    mean_lx: float
    mean_h: float
    least_lx: float
    least_h: float
    area: float


@dataclass(frozen=True, slots=True)
class Climate:
    """What a space reaches of that.

    Attributes
    ----------
    mean_h, least_h : float
        Hours with the mean illuminance, and with the least one at the worst-lit point of the share
        of the area that is asked for. [h]
    share : float
        Share of the area whose points have the least illuminance long enough.
    met : bool
        Whether both hours suffice.
    """

    mean_h: float
    least_h: float
    share: float
    met: bool


#: Kinds of spaces. [2]
USES = {
    "office": Use(300.0, 2000.0, 90.0, 2000.0, 0.8),
    "education": Use(300.0, 2000.0, 90.0, 2000.0, 0.8),
    "education_one_credit": Use(300.0, 2000.0, 90.0, 2000.0, 0.6),
    "retail": Use(300.0, 2650.0, 90.0, 2650.0, 0.8),
    "healthcare": Use(300.0, 2650.0, 90.0, 2650.0, 0.8),
    "kitchen": Use(100.0, 3450.0, 30.0, 3450.0, 1.0),
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


class ClimateHours:
    """BREEAM's hours with enough light, on average and at points. [2]

    Points are added some at a time.

    Parameters
    ----------
    step_h : float
        Length of a step. [h]
    """

    def __init__(self, step_h: float) -> None:
        self._step_h = step_h
        self._sum: FloatArray = np.zeros(1)
        self._areas: list[FloatArray] = []
        #: Hours of each point, by what is asked of the worst-lit one.
        self._hours: dict[float, list[FloatArray]] = {use.least_lx: [] for use in USES.values()}

    def add(self, illuminance: FloatArray, area: FloatArray) -> None:
        """Add points with illuminances (m, n) in each step [lx] and areas (m,) [m²]."""
        self._sum = self._sum + area @ illuminance
        self._areas.append(np.asarray(area, dtype=np.float64))
        for lux, hours in self._hours.items():
            hours.append(self._step_h * (illuminance >= lux).sum(axis=1))

    def of(self, use: Use) -> Climate:
        """What a kind of space reaches."""
        area = np.concatenate(self._areas)
        mean_h = self._step_h * float((self._sum / area.sum() >= use.mean_lx).sum())
        hours = np.concatenate(self._hours[use.least_lx])
        order = np.argsort(-hours, kind="stable")
        within = np.cumsum(area[order]) / area.sum()
        last = int(np.searchsorted(within, use.area - 1e-9))
        least_h = float(hours[order[last]])
        share = float(area @ (hours >= use.least_h) / area.sum())
        return Climate(mean_h, least_h, share, mean_h >= use.mean_h and least_h >= use.least_h)
