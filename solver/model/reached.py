"""Which accuracy the errors of a result amount to, in the sense of the ``accuracy`` asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from .arrays import FloatArray
from .reprs import lux_text

if TYPE_CHECKING:
    from .result import Result, SensorResult

#: Share of the sensors of a grid that keep the accuracy.
KEPT_BY = 0.95
#: Least value of a sensor that its error is compared with, against the mean of its grid.
FLOOR = 0.01
#: Of grids that are nowhere brighter.
NOWHERE: Mapping[str, float] = MappingProxyType({})


def relative_errors(grid: SensorResult, brightest: float = 0.0) -> FloatArray:
    """Error (m,) of each sensor relative to its value; empty for a dark grid.

    ``brightest`` is the mean of the grid where it is brighter, as with open blinds: light that is
    nothing beside that is not told any better than that is. [lx]
    """
    mean = max(grid.mean(grid.illuminance_lx), brightest)
    if mean == 0.0:
        return np.zeros(0)
    return np.asarray(grid.error_lx / np.maximum(grid.illuminance_lx, FLOOR * mean))


def accuracies_reached(
    sensors: Mapping[str, SensorResult], brightest: Mapping[str, float] = NOWHERE
) -> dict[str, float]:
    """Relative error kept by 95 % of the sensors of each grid, as ``accuracy`` is meant.

    Values below 1 % of their grid's mean are taken as 1 % of it, or of its mean in the
    ``brightest`` of several states [lx]; dark grids are left out.
    """
    reached = {}
    for name, grid in sensors.items():
        relative = relative_errors(grid, brightest.get(name, 0.0))
        if len(relative):
            reached[name] = float(np.quantile(relative, KEPT_BY, method="lower"))
    return reached


def accuracy_reached(result: Result) -> float:
    """The largest of `accuracies_reached`."""
    return max(accuracies_reached(result.sensors).values(), default=0.0)


def accuracy_message(
    sensors: Mapping[str, SensorResult],
    asked: float,
    *,
    as_factors: bool = False,
    brightest: Mapping[str, float] = NOWHERE,
) -> str:
    """Which grids missed the accuracy that was asked for, by how much, and where most.

    With ``as_factors`` light is told by the daylight factors that it stands for; ``brightest`` is
    that of `accuracies_reached`.
    """
    missed = []
    for name, reached in accuracies_reached(sensors, brightest).items():
        if reached <= asked:
            continue
        grid = sensors[name]
        relative = relative_errors(grid, brightest.get(name, 0.0))
        worst, many = int(np.argmax(relative)), int((relative > asked).sum())
        light, error, unit = grid.illuminance_lx[worst], grid.error_lx[worst], "lx"
        if as_factors and grid.daylight is not None:
            light, error = 100.0 * grid.daylight.total[worst], 100.0 * grid.daylight.error[worst]
            unit = "%"
        found = f"{lux_text(float(light))} ± {lux_text(float(error), 2)} {unit}"
        # Sensors stand a little before their surface: no digits of that.
        extent = float(np.ptp(grid.points, axis=0).max())
        x, y, z = (
            "0" if abs(c) <= 1e-4 * extent else f"{c:.4g}" for c in grid.points[worst].tolist()
        )
        missed.append(
            f"{name} {_rounded_up(reached)}, above it at {many} of {len(relative)} sensors, worst "
            f"{found} at ({x}, {y}, {z}) m"
        )
    return f"accuracy {asked:g} was not reached: " + "; ".join(missed)


def _rounded_up(value: float) -> str:
    """Two digits, never below ``value``: 0.0502 must not look like the 0.05 that was asked."""
    if not math.isfinite(value):
        return str(value)
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / step - 1e-9) * step:.2g}"
