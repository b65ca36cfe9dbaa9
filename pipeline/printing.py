"""Results of a run for a terminal and for scripts."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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


def result_json(done: Run) -> str:
    """Metrics, requirements and the state of a run."""
    from patchlight.reports.metrics import metric_rows
    from patchlight.solver.model.reached import accuracies_reached, accuracy_reached

    result = done.result
    return json.dumps(
        {
            "schema_version": 1,
            "output": str(done.folder),
            "converged": result.converged,
            "accuracy_reached": accuracy_reached(result),
            "accuracy_reached_by_grid": accuracies_reached(result.sensors),
            "seconds": round(done.seconds, 3),
            "faces": len(result.scene.faces),
            "patches": len(result.scene.patches),
            "metrics": metric_rows(result),
            "balance_residual": result.balance.residual_fraction,
            "warnings": list(result.warnings),
        },
        indent=2,
    )
