"""Spatial daylight autonomy, annual sunlight exposure, and when blinds are closed, by LM-83 [1].

Of points with areas (m,), in n steps of ``step_h`` hours. The text of LM-83 compares in part with
"at least" and in part with "more than", and programs differ: each comparison here is an argument.

References
----------
.. [1] IES LM-83-12, "Approved method: IES spatial daylight autonomy (sDA) and annual sunlight
   exposure (ASE)": 300 lx in half of 3650 hours, 1000 lx in 250 hours, blinds closed while more
   than 2 % of the points get more than 1000 lx straight from the sun. The edition of 2022
   (ANSI/IES LM-83-22) keeps these figures as defaults.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray, IntArray

#: sDA: illuminance, and share of the hours. ASE: direct illuminance, and hours. [1]
SDA_LX, SDA_SHARE, ASE_LX, ASE_HOURS = 300.0, 0.5, 1000.0, 250.0
#: Share of the points in direct sun beyond which blinds are closed. [1]
BLINDS_SHARE = 0.02

_OPERATORS = {">=": np.greater_equal, ">": np.greater}


def spatial_autonomy(
    illuminance: FloatArray,
    area: FloatArray,
    counted: NDArray[np.bool_],
    *,
    threshold_lx: float = SDA_LX,
    share: float = SDA_SHARE,
    level: str = ">=",
    time: str = ">=",
) -> float:
    """Share of the area with enough light in enough of the steps that count: sDA300/50 %. [1]

    Parameters
    ----------
    illuminance : (m, n) array
        With blinds as they are. [lx]
    area : (m,) array
        Area of each point. [m²]
    counted : (n,) bool array
        Steps that count.
    threshold_lx, share : float
        Illuminance, and share of the steps.
    level, time : {">=", ">"}
        How each is compared.
    """
    if not counted.any():
        return float("nan")
    lit = _compare(level)(illuminance[:, counted], threshold_lx)
    enough = _compare(time)(lit.mean(axis=1), share)
    return float(area @ enough / area.sum())


def sunlight_exposure(
    sun_illuminance: FloatArray,
    area: FloatArray,
    counted: NDArray[np.bool_],
    step_h: float,
    *,
    threshold_lx: float = ASE_LX,
    hours: float = ASE_HOURS,
    level: str = ">",
    time: str = ">",
) -> float:
    """Share of the area with too much sun in too many hours: ASE1000,250h. [1]

    ``sun_illuminance`` (m, n) is straight from the sun, with blinds open. By default both are
    exceeded when they are more than the bound, as the text has it; some programs take 250 h for
    too many (``time=">="``).
    """
    sunny = _compare(level)(sun_illuminance[:, counted], threshold_lx)
    much = _compare(time)(step_h * sunny.sum(axis=1), hours)
    return float(area @ much / area.sum())


def blinds_state(
    sun_illuminance: FloatArray,
    *,
    threshold_lx: float = ASE_LX,
    share: float = BLINDS_SHARE,
) -> IntArray:
    """Which of k states holds in each step (n,), given the sun (k, m, n) in each of them. [1]

    The first state in which no more than 2 % of the points get more than 1000 lx straight from the
    sun; where there is none, the last one.
    """
    exposed = (sun_illuminance > threshold_lx).mean(axis=1)
    fine = exposed <= share
    fine[-1] = True
    return np.asarray(np.argmax(fine, axis=0))


def in_state(values: FloatArray, state: IntArray) -> FloatArray:
    """Values (m, n) of those (k, m, n) in the state (n,) that holds in each step."""
    return np.asarray(np.take_along_axis(values, state[None, None, :], axis=0)[0])


def _compare(operator: str) -> np.ufunc:
    if operator not in _OPERATORS:
        raise InputError(f"operator {operator!r}: must be one of {', '.join(_OPERATORS)}")
    return _OPERATORS[operator]
