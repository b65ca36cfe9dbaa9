"""Daylight provision by EN 17037, by both of its methods, and by both readings of the second.

A space with openings in walls or sloping roofs has a target illuminance over half of its reference
plane, and a lower one over 95 %, in half of the daylight hours; one with diffusing openings in a
level roof has the target over 95 % [1, table A.1, A.2].

References
----------
.. [1] EN 17037:2018+A1:2021, "Daylight in buildings", 5.1 and annex A and B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

#: Levels from the lowest on: target, and minimum over 95 % of the plane. [1, table A.1] [lx]
LEVELS = {"minimum": (300.0, 100.0), "medium": (500.0, 300.0), "high": (750.0, 500.0)}
#: Shares of the plane for target and minimum, and of the daylight hours. [1, table A.1]
TARGET_AREA, MINIMUM_AREA, TIME = 0.5, 0.95, 0.5
#: Daylight hours of a year: half of it. [1, 3.1]
DAYLIGHT_HOURS = 4380.0
#: Which is counted first: the area in each hour, or the hours of each point.
ORDERS = ("hour-first", "sensor-first")


@dataclass(frozen=True, slots=True)
class Provision:
    """How far one level is reached.

    Attributes
    ----------
    level : str
        Of `LEVELS`.
    target, minimum : float
        ``"hour-first"``: share of the daylight hours in which enough of the plane has the
        illuminance; ``"sensor-first"``: share of the plane that has it in enough of them.
    reached : bool
        Whether both suffice.
    """

    level: str
    target: float
    minimum: float
    reached: bool


def daylight_hours(sky_lx: FloatArray, step_h: float) -> NDArray[np.bool_]:
    """The steps (n,) of the 4380 h with most diffuse horizontal illuminance. [1, 3.1]

    Of less than a year as large a share; of steps alike, the earlier.
    """
    count = int(round(min(DAYLIGHT_HOURS / step_h, 0.5 * len(sky_lx))))
    out = np.zeros(len(sky_lx), dtype=bool)
    out[np.argsort(-np.asarray(sky_lx), kind="stable")[:count]] = True
    return out


def median_diffuse(sky_lx: FloatArray, step_h: float) -> float:
    """Median diffuse horizontal illuminance of the daylight hours, E_v,d,med. [1, annex A] [lx]"""
    return float(np.median(sky_lx[daylight_hours(sky_lx, step_h)]))


def provision_by_factor(
    daylight_factor: FloatArray, area: FloatArray, median_lx: float, *, level_roof: bool = False
) -> list[Provision]:
    """Method 1: the levels by daylight factors (m,), with D = E / E_v,d,med. [1, annex B.3]

    Parameters
    ----------
    daylight_factor : (m,) array
        Under the overcast sky, as shares of 1.
    area : (m,) array
        Area of each point. [m²]
    median_lx : float
        Of `median_diffuse`, or of a national table. [lx]
    level_roof : bool
        Whether light comes by diffusing openings in a level roof: target over 95 %, no minimum.

    Returns
    -------
    list of Provision
        With the shares of the plane that have target and minimum.
    """
    if not median_lx > 0.0:
        raise InputError(f"median_lx = {median_lx}: must be positive")
    out = []
    asked = _areas(level_roof)
    for level, bounds in LEVELS.items():
        shares = [float(area @ (daylight_factor >= lux / median_lx) / area.sum()) for lux in bounds]
        out.append(_judged(level, shares, asked, level_roof))
    return out


class YearProvision:
    """Method 2: the levels by illuminances of a year. [1, annex B.3]

    Points are added some at a time.

    Parameters
    ----------
    sky_lx : (n,) array
        Diffuse horizontal illuminance outside, which tells the daylight hours. [lx]
    step_h : float
        Length of a step. [h]
    """

    def __init__(self, sky_lx: FloatArray, step_h: float) -> None:
        self._counted = daylight_hours(sky_lx, step_h)
        self._bounds = sorted({lux for pair in LEVELS.values() for lux in pair})
        #: Area with as much light in each daylight hour, and share of them and area of each point.
        self._lit = np.zeros((len(self._bounds), int(self._counted.sum())))
        self._shares: list[FloatArray] = []
        self._areas: list[FloatArray] = []

    def add(self, illuminance: FloatArray, area: FloatArray) -> None:
        """Add points with illuminances (m, n) in each step [lx] and areas (m,) [m²]."""
        found = illuminance[:, self._counted]
        lit = [found >= lux for lux in self._bounds]
        self._lit += np.stack([area @ one for one in lit])
        self._shares.append(np.stack([one.mean(axis=1) for one in lit]))
        self._areas.append(np.asarray(area, dtype=np.float64))

    def levels(self, order: str = "hour-first", *, level_roof: bool = False) -> list[Provision]:
        """How far each level is reached.

        Parameters
        ----------
        order : {"hour-first", "sensor-first"}
            By the standard the area is told in each hour, and then the hours are counted; some
            programs tell the hours of each point, and count the area.
        level_roof : bool
            As in `provision_by_factor`.
        """
        if order not in ORDERS:
            raise InputError(f"order = {order!r}: must be one of {', '.join(ORDERS)}")
        area = np.concatenate(self._areas)
        points = np.concatenate(self._shares, axis=1)
        out = []
        of_area = _areas(level_roof)
        for level, bounds in LEVELS.items():
            shares = []
            for lux, part in zip(bounds, of_area, strict=True):
                row = self._bounds.index(lux)
                if order == "hour-first":
                    shares.append(float(np.mean(_reaches(self._lit[row] / area.sum(), part))))
                else:
                    shares.append(float(area @ _reaches(points[row], TIME) / area.sum()))
            asked = (TIME, TIME) if order == "hour-first" else of_area
            out.append(_judged(level, shares, asked, level_roof))
        return out


def _areas(level_roof: bool) -> tuple[float, float]:
    """Shares of the plane for target and minimum."""
    return (MINIMUM_AREA if level_roof else TARGET_AREA), MINIMUM_AREA


def _judged(
    level: str, shares: list[float], asked: tuple[float, float], level_roof: bool
) -> Provision:
    """A level, of which the minimum is not asked of level roofs."""
    target, minimum = (bool(_reaches(*pair)) for pair in zip(shares, asked, strict=True))
    return Provision(level, shares[0], shares[1], target and (level_roof or minimum))


def _reaches(share: FloatArray | float, asked: float) -> NDArray[np.bool_]:
    """Whether shares are as large as asked, but for the rounding of sums of areas."""
    return np.asarray(np.asarray(share) >= asked - 1e-9)


def highest(found: list[Provision]) -> str | None:
    """The highest level that is reached, None where none is."""
    reached = [one.level for one in found if one.reached]
    return reached[-1] if reached else None
