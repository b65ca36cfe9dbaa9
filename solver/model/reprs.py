"""Results as a Python prompt shows them: what they are about, not their arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .result import Result, SensorResult

#: Grids that are listed.
MOST_GRIDS = 8


def result_repr(result: Result) -> str:
    """Size, accuracy and a line a grid."""
    scene = result.scene
    accuracy = result.settings.get("accuracy")
    asked = "" if accuracy is None else f" {accuracy:g}"
    counts = (
        _many(len(scene.parts), "part"),
        _many(len(scene.patches), "patch", "patches"),
        _many(len(result.elements), "element"),
    )
    reached = "reached" if result.converged else "not reached"
    lines = [f"Result {scene.title!r}: {', '.join(counts)}; accuracy{asked} {reached}"]
    lines += [f"  {name}: {grid_text(grid)}" for name, grid in result.sensors.items()][:MOST_GRIDS]
    more = len(result.sensors) - MOST_GRIDS
    if more > 0:
        lines.append(f"  and {_many(more, 'more grid')}")
    if result.images:
        lines.append(f"  pictures: {', '.join(result.images)}")
    if result.warnings:
        lines.append(f"  {_many(len(result.warnings), 'warning')}, the first: {result.warnings[0]}")
    return "<" + "\n".join(lines) + ">"


def sensors_repr(grid: SensorResult) -> str:
    """Name and numbers of one grid."""
    return f"<SensorResult {grid.name!r}: {grid_text(grid)}>"


def grid_text(grid: SensorResult) -> str:
    """Number of sensors and their mean with its error."""
    count = _many(len(grid.illuminance_lx), "sensor")
    if not len(grid.illuminance_lx) or not float(grid.area_m2.sum()) > 0.0:
        return count
    mean, error = grid.mean(grid.illuminance_lx), grid.mean(grid.error_lx)
    low, high = (lux_text(float(f(grid.illuminance_lx))) for f in (np.min, np.max))
    return f"{count}, E_avg {lux_text(mean)} ± {lux_text(error, 2)} lx, {low} to {high} lx"


def _many(count: int, one: str, more: str = "") -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"


def lux_text(value: float, digits: int = 4) -> str:
    """``digits`` significant digits without exponent for what illuminances can be."""
    if not math.isfinite(value) or value == 0.0 or abs(value) < 1e-4:
        return f"{value:.{digits}g}"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, decimals):.{max(decimals, 0)}f}"
