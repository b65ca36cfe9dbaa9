"""Spatial daylight autonomy, annual sunlight exposure, and when blinds are closed, by LM-83 [1].

Of points with areas (m,), in n steps of ``step_h`` hours. The text of LM-83 compares in part with
"at least" and in part with "more than", and programs differ: each comparison here is an argument.

References
----------
.. [1] IES LM-83-12, "Approved method: IES spatial daylight autonomy (sDA) and annual sunlight
   exposure (ASE)": 300 lx in half of 3650 hours, 1000 lx in 250 hours, blinds of each window group
   closed while more than 2 % of the points get more than 1000 lx straight from the sun through it.
   The edition of 2022 (ANSI/IES LM-83-22) keeps these figures as defaults.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.arrays import FloatArray, IntArray

from .autonomy import compare

#: sDA: illuminance, and share of the hours. ASE: direct illuminance, and hours. [1]
SDA_LX, SDA_SHARE, ASE_LX, ASE_HOURS = 300.0, 0.5, 1000.0, 250.0
#: Time of every day that these are of: 3650 hours of 365 days. [1]
LM83_HOURS = "08:00-18:00"
#: Share of the points in direct sun beyond which blinds are closed. [1]
BLINDS_SHARE = 0.02


def spatial_autonomy(
    autonomy: FloatArray, area: FloatArray, *, share: float = SDA_SHARE, time: str = ">="
) -> float:
    """Share of the area with enough light in enough of the steps that count: sDA300/50 %. [1]

    Parameters
    ----------
    autonomy : (m,) array
        Share of these steps with `SDA_LX`, blinds being as they are, by `daylight_autonomy`; not a
        number where no step counts.
    area : (m,) array
        Area of each point. [m²]
    share : float
        Of the steps.
    time : {">=", ">"}
        How the share is compared.
    """
    if np.isnan(autonomy).any():
        return float("nan")
    return float(area @ compare(time)(autonomy, share) / area.sum())


def exposed_hours(
    sun_illuminance: FloatArray,
    counted: NDArray[np.bool_],
    step_h: float,
    *,
    threshold_lx: float = ASE_LX,
    level: str = ">",
) -> FloatArray:
    """Hours (m,), among the steps that count, with too much sun (m, n), blinds being open. [1]"""
    sunny = compare(level)(sun_illuminance[:, counted], threshold_lx)
    return np.asarray(step_h * sunny.sum(axis=1), dtype=np.float64)


def sunlight_exposure(
    exposed_h: FloatArray, area: FloatArray, *, hours: float = ASE_HOURS, time: str = ">"
) -> float:
    """Share of the area with too much sun in too many hours: ASE1000,250h. [1]

    ``exposed_h`` (m,) is by `exposed_hours`. By default both bounds are exceeded when values are
    more than them, as the text has it; some programs take 250 h for too many (``time=">="``).
    """
    return float(area @ compare(time)(exposed_h, hours) / area.sum())


def group_rows(window_group: Sequence[str]) -> list[IntArray]:
    """Rows of the states of each window group, the first state first, given the group of each.

    Row 0 is all groups in their first state, and belongs to each of them. Where no row has a group,
    the whole scene is one.
    """
    names = np.asarray(window_group).astype(str)
    rows = [np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist()) if name]
    return [np.append(0, own) for own in rows] or [np.arange(len(names))]


def exposed_points(
    sun_illuminance: FloatArray,
    window_group: Sequence[str],
    *,
    threshold_lx: float = ASE_LX,
) -> list[IntArray]:
    """Points (states, n) with too much sun through each window group, in each of its states. [1]

    The sun (k, m, n) comes through one group or another: what a group lets through is what there is
    more than in that state of it which lets through least. Blinds through which the sun shines are
    counted for the other groups by that, and so is what windows without blinds do. Where no state
    has a group, all sun is that of the one that the whole scene is.

    Parameters
    ----------
    sun_illuminance : (k, m, n) array
        Straight from the sun, in k states. [lx]
    window_group : (k,) sequence of str
        As of `group_rows`.
    """
    out, named = [], any(window_group)
    for rows in group_rows(window_group):
        through = sun_illuminance[rows]
        if named:
            through = through - through.min(axis=0)
        out.append(np.asarray((through > threshold_lx).sum(axis=1)))
    return out


def blinds_states(
    exposed: list[IntArray], points: int, groups: list[IntArray], *, share: float = BLINDS_SHARE
) -> IntArray:
    """Row of the state (g, n) that each of g window groups is in, in each step. [1]

    The first state in which no more than 2 % of the points get more than 1000 lx straight from the
    sun through the group; where there is none, the last one.

    Parameters
    ----------
    exposed : list of (states, n) int arrays
        Of `exposed_points`, summed over all ``points``.
    groups : list of int arrays
        Of `group_rows`.
    """
    out = []
    for counts, rows in zip(exposed, groups, strict=True):
        fine = counts <= share * points
        fine[-1] = True
        out.append(rows[np.argmax(fine, axis=0)])
    return np.stack(out)


def in_states(values: FloatArray, states: IntArray) -> FloatArray:
    """Values (m, n) of those (k, m, n) in the states (g, n) that hold in each step.

    Light through different windows adds: what each group changes, with the others in their first
    state, is summed. That is exact for direct light; of reflected light it leaves out what the
    blinds of one group send back of the light through another.
    """
    taken = [np.take_along_axis(values, one[None, None, :], axis=0)[0] for one in states]
    if len(taken) == 1:
        return np.asarray(taken[0])
    first = values[0]
    change = sum((one - first for one in taken[1:]), taken[0] - first)
    return np.maximum(first + change, 0.0)
