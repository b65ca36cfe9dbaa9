"""Results of a run for a terminal and for scripts."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from patchlight.solver.model import Result, SensorResult
    from patchlight.solver.model.arrays import FloatArray

    from .runs import Run


def result_text(done: Run) -> str:
    """One line a metric with its error, one a requirement, and where the report is."""
    from patchlight.reports import evaluate_requirements
    from patchlight.reports.formats import console, with_error
    from patchlight.reports.metrics import QUANTITIES, grid_metrics

    lines = []
    for name, grid in done.result.sensors.items():
        values, errors = grid_metrics(grid)
        lines.append(f"{name}: {len(grid.illuminance_lx)} sensors")
        for metric, value in values.items():
            unit = QUANTITIES[metric][1]
            unit = "" if unit == "1" else f" {unit}"
            lines.append(f"  {metric:<18} {console(with_error(value, errors.get(metric)))}{unit}")
    lines += [requirement.line for requirement in evaluate_requirements(done.result)]
    report = done.folder / "report.html"
    lines.append(str(report if report.is_file() else done.folder))
    return "\n".join(lines)


def accuracies_reached(result: Result) -> dict[str, float]:
    """Relative error kept by 95 % of the sensors of each grid, as `accuracy` is meant.

    Values below 1 % of their grid's mean are taken as 1 % of it; dark grids are left out.
    """
    reached = {}
    for name, grid in result.sensors.items():
        relative = _relative_errors(grid)
        if len(relative):
            reached[name] = float(np.quantile(relative, 0.95, method="lower"))
    return reached


def accuracy_reached(result: Result) -> float:
    """The largest of `accuracies_reached`."""
    return max(accuracies_reached(result).values(), default=0.0)


def accuracy_message(result: Result) -> str:
    """Which grids missed the accuracy that was asked for, by how much, and where most."""
    from patchlight.reports.formats import console, with_error

    asked = float(result.settings["accuracy"])
    missed = []
    for name, reached in accuracies_reached(result).items():
        if reached <= asked:
            continue
        grid = result.sensors[name]
        worst = int(np.argmax(_relative_errors(grid)))
        found = console(with_error(grid.illuminance_lx[worst], grid.error_lx[worst]))
        # Sensors stand a little before their surface: no digits of that.
        extent = float(np.ptp(grid.points, axis=0).max())
        x, y, z = (
            "0" if abs(c) <= 1e-4 * extent else f"{c:.4g}" for c in grid.points[worst].tolist()
        )
        missed.append(f"{name} {_rounded_up(reached)}, worst {found} lx at ({x}, {y}, {z}) m")
    return f"accuracy {asked:g} was not reached: " + "; ".join(missed)


def _relative_errors(grid: SensorResult) -> FloatArray:
    """Error of each sensor relative to its value; empty for a dark grid."""
    mean = grid.mean(grid.illuminance_lx)
    if not mean > 0.0:
        return np.zeros(0)
    return np.asarray(grid.error_lx / np.maximum(grid.illuminance_lx, 0.01 * mean))


def _rounded_up(value: float) -> str:
    """Two digits, never below ``value``: 0.0502 must not look like the 0.05 that was asked."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / step - 1e-9) * step:.2g}"


def result_json(done: Run) -> str:
    """Metrics, requirements and the state of a run."""
    from patchlight.reports.metrics import metric_rows

    result = done.result
    return json.dumps(
        {
            "schema_version": 1,
            "output": str(done.folder),
            "converged": result.converged,
            "accuracy_reached": accuracy_reached(result),
            "accuracy_reached_by_grid": accuracies_reached(result),
            "seconds": round(done.seconds, 3),
            "faces": len(result.scene.faces),
            "patches": len(result.scene.patches),
            "metrics": metric_rows(result),
            "balance_residual": result.balance.residual_fraction,
            "warnings": list(result.warnings),
        },
        indent=2,
    )
