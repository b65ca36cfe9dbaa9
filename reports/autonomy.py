"""Daylight autonomy and useful daylight illuminance of single points.

Illuminances are (m, n) of m points in n steps; ``counted`` (n,) tells the steps that count, such as
those in which the building is used. Where none counts, shares are not a number.

References
----------
.. [1] C. F. Reinhart, J. Mardaljevic and Z. Rogers, "Dynamic daylight performance metrics for
   sustainable building design", LEUKOS 3(1), 2006, pp. 7-31: daylight autonomy and its continuous
   form.
.. [2] A. Nabil and J. Mardaljevic, "Useful daylight illuminances: a replacement for daylight
   factors", Energy and Buildings 38(7), 2006, pp. 905-913; bounds of 100, 300 and 3000 lx as in
   J. Mardaljevic et al., "Daylighting metrics: is there a relation between useful daylight
   illuminance and daylight glare probability?", Building Simulation and Optimization, 2012.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

#: Bounds of the bins of useful daylight illuminance, and the bins' names. [2] [lx]
UDI_LX = (100.0, 300.0, 3000.0)
UDI_NAMES = ("fell short", "supplementary", "autonomous", "exceeded")


_OPERATORS = {">=": np.greater_equal, ">": np.greater}


def compare(operator: str) -> np.ufunc:
    """What compares values with bounds: standards and programs differ in it.

    Raises
    ------
    InputError
        If it is neither ``">="`` nor ``">"``.
    """
    if operator not in _OPERATORS:
        raise InputError(f"operator {operator!r}: must be one of {', '.join(_OPERATORS)}")
    return _OPERATORS[operator]


def daylight_autonomy(
    illuminance: FloatArray,
    counted: NDArray[np.bool_],
    threshold_lx: float = 300.0,
    *,
    level: str = ">=",
) -> FloatArray:
    """Share (m,) of the steps that count with E ≥ threshold. [1]"""
    return _share(compare(level)(illuminance[:, counted], _positive(threshold_lx)))


def continuous_autonomy(
    illuminance: FloatArray, counted: NDArray[np.bool_], threshold_lx: float = 300.0
) -> FloatArray:
    """Mean (m,) of min(1, E / threshold) over the steps that count. [1]"""
    return _share(np.minimum(illuminance[:, counted] / _positive(threshold_lx), 1.0))


def useful_illuminance(
    illuminance: FloatArray,
    counted: NDArray[np.bool_],
    bounds_lx: tuple[float, float, float] = UDI_LX,
) -> FloatArray:
    """Shares (4, m) of the steps that count in each bin: E < 100, < 300, ≤ 3000, > 3000 lx. [2]

    They add up to 1.

    Raises
    ------
    InputError
        If the bounds do not rise.
    """
    low, middle, high = bounds_lx
    if not 0.0 < low < middle < high:
        raise InputError(f"bounds_lx = {bounds_lx}: must be positive and rise")
    found = illuminance[:, counted]
    bins = (
        found < low,
        (found >= low) & (found < middle),
        (found >= middle) & (found <= high),
        found > high,
    )
    return np.stack([_share(one) for one in bins])


def _share(values: FloatArray | NDArray[np.bool_]) -> FloatArray:
    if values.shape[1] == 0:
        return np.full(len(values), np.nan)
    return np.asarray(values.mean(axis=1, dtype=np.float64))


def _positive(threshold_lx: float) -> float:
    if not (np.isfinite(threshold_lx) and threshold_lx > 0.0):
        raise InputError(f"threshold_lx = {threshold_lx}: must be positive")
    return float(threshold_lx)
