"""Results of a run for a terminal and for scripts."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from patchlight.solver.model import Result

    from .runs import Run

#: Digits a value is printed with.
DIGITS = 4


def result_text(done: Run) -> str:
    """One line a metric with its error, one a requirement, and where the report is."""
    from patchlight.reports import evaluate_requirements
    from patchlight.reports.metrics import QUANTITIES, grid_metrics

    lines = []
    for name, grid in done.result.sensors.items():
        values, errors = grid_metrics(grid)
        lines.append(f"{name}: {len(grid.illuminance_lx)} sensors")
        for metric, value in values.items():
            unit = QUANTITIES[metric][1]
            unit = "" if unit == "1" else f" {unit}"
            error = f" ± {errors[metric]:.2g}" if metric in errors else ""
            lines.append(f"  {metric:<18} {value:.{DIGITS}g}{error}{unit}")
    lines += [requirement.line for requirement in evaluate_requirements(done.result)]
    report = done.folder / "report.html"
    lines.append(str(report if report.is_file() else done.folder))
    return "\n".join(lines)


def accuracy_reached(result: Result) -> float:
    """Relative error kept by 95 % of the sensors of each grid, as `accuracy` is meant.

    Values below 1 % of their grid's mean are taken as 1 % of it.
    """
    reached = 0.0
    for grid in result.sensors.values():
        mean = grid.mean(grid.illuminance_lx)
        if mean > 0.0:
            relative = grid.error_lx / np.maximum(grid.illuminance_lx, 0.01 * mean)
            reached = max(reached, float(np.quantile(relative, 0.95, method="lower")))
    return reached


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
            "seconds": round(done.seconds, 3),
            "faces": len(result.scene.faces),
            "patches": len(result.scene.patches),
            "metrics": metric_rows(result),
            "balance_residual": result.balance.residual_fraction,
            "warnings": list(result.warnings),
        },
        indent=2,
    )
