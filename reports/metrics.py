"""Metrics of the sensor grids and their verdict against requirements."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from patchlight.solver.model import Result, SensorResult

from .formats import console, with_error

PASS, FAIL, UNDECIDED = "pass", "fail", "not decidable"

#: What each metric is, and its unit.
QUANTITIES = {
    "E_avg_lx": ("mean illuminance", "lx"),
    "E_min_lx": ("lowest illuminance", "lx"),
    "E_max_lx": ("highest illuminance", "lx"),
    "U0": ("uniformity E_min / E_avg", "1"),
    "DF_avg_percent": ("mean daylight factor", "%"),
    "DF_median_percent": ("median daylight factor", "%"),
    "SC_avg_percent": ("mean sky component", "%"),
    "ERC_avg_percent": ("mean externally reflected component", "%"),
    "IRC_avg_percent": ("mean internally reflected component", "%"),
    "VSC_avg_percent": ("mean vertical sky component", "%"),
    "EDI_avg_lx": ("mean melanopic equivalent daylight illuminance, modelled", "lx"),
    "EDI_min_lx": ("lowest melanopic equivalent daylight illuminance, modelled", "lx"),
    "CCT_avg_K": ("mean correlated colour temperature, modelled", "K"),
    "Duv_avg": ("mean distance from the Planckian locus, modelled", "1"),
    "DER_avg": ("mean melanopic daylight efficacy ratio, modelled", "1"),
}


@dataclass(frozen=True, slots=True)
class RequirementResult:
    """A requirement and what became of it.

    Attributes
    ----------
    sensors, metric : str
        Grid and metric it is about.
    value, uncertainty : float or None
        Result and the half-width of its numerical error, in ``unit``; None when there is none.
    minimum, maximum : float or None
        Bounds asked for.
    verdict : {"pass", "fail", "not decidable"}
        See `verdict`.
    reason : str
        Why it cannot be decided; empty otherwise.
    """

    sensors: str
    metric: str
    value: float | None
    uncertainty: float | None
    unit: str
    minimum: float | None
    maximum: float | None
    verdict: str
    reason: str = ""

    @property
    def bounds(self) -> str:
        """``>= 500``, ``<= 3000`` or both."""
        parts = []
        if self.minimum is not None:
            parts.append(f">= {self.minimum:.10g}")
        if self.maximum is not None:
            parts.append(f"<= {self.maximum:.10g}")
        return " and ".join(parts)

    @property
    def line(self) -> str:
        """One line for a terminal."""
        found = "no value"
        if self.value is not None:
            found = console(with_error(self.value, self.uncertainty))
        unit = "" if self.unit == "1" else f" {self.unit}"
        text = f"{self.verdict}: {self.sensors} {self.metric} = {found}{unit}, asked {self.bounds}"
        return f"{text} ({self.reason})" if self.reason else text


def verdict(
    value: float, uncertainty: float, minimum: float | None = None, maximum: float | None = None
) -> str:
    """Whether ``value ± uncertainty`` meets its bounds whatever the error is.

    Pass if value − u >= minimum, fail if value + u < minimum, not decidable in between; the mirror
    image for a maximum. With two bounds one failure fails, and both must pass.
    """
    verdicts = []
    if minimum is not None:
        low = PASS if value - uncertainty >= minimum else UNDECIDED
        verdicts.append(FAIL if value + uncertainty < minimum else low)
    if maximum is not None:
        high = PASS if value + uncertainty <= maximum else UNDECIDED
        verdicts.append(FAIL if value - uncertainty > maximum else high)
    if FAIL in verdicts:
        return FAIL
    return PASS if verdicts and all(v == PASS for v in verdicts) else UNDECIDED


def grid_metrics(grid: SensorResult) -> tuple[dict[str, float], dict[str, float]]:
    """Metrics and their errors; both empty for a grid without points or area."""
    if len(grid.illuminance_lx) == 0 or not np.isfinite(grid.illuminance_lx).all():
        return {}, {}
    if not float(np.sum(grid.area_m2)) > 0.0:
        return {}, {}
    return dict(grid.metrics), dict(grid.metric_errors)


def evaluate_requirements(result: Result) -> list[RequirementResult]:
    """Verdict on each of ``result.settings["requirements"]``.

    Each requirement is a mapping with ``sensors``, ``metric`` and at least one of ``min`` and
    ``max``. A requirement on a grid or metric that the result does not have is not decidable and
    says why, so that a long run is not lost over a misspelled name.
    """
    return [_evaluate(result, r) for r in result.settings.get("requirements") or ()]


def _evaluate(result: Result, requirement: Mapping[str, Any]) -> RequirementResult:
    grid_name = str(requirement.get("sensors", ""))
    metric = str(requirement.get("metric", ""))
    low, high = requirement.get("min"), requirement.get("max")
    unit = QUANTITIES.get(metric, ("", ""))[1]
    value = error = None
    reason = ""
    if grid_name not in result.sensors:
        near = get_close_matches(grid_name, list(result.sensors), n=3, cutoff=0.0)
        reason = f"no sensors named {grid_name!r}; there are: {', '.join(near) or 'none'}"
    elif metric not in QUANTITIES:
        reason = f"no metric named {metric!r}; there are: {', '.join(QUANTITIES)}"
    else:
        values, errors = grid_metrics(result.sensors[grid_name])
        value, error = values.get(metric), errors.get(metric)
        if not values:
            reason = f"{grid_name} has no valid points"
        elif value is None:
            reason = _why_none(metric)
    if low is None and high is None and not reason:
        reason = "neither min nor max is given"
    found = UNDECIDED
    if value is not None and not reason:
        error = 0.0 if error is None or not math.isfinite(error) else error
        found = verdict(value, error, low, high)
        if found == UNDECIDED:
            reason = "the bound lies within the numerical error; run with a smaller accuracy"
    return RequirementResult(
        sensors=grid_name,
        metric=metric,
        value=value,
        uncertainty=error,
        unit=unit,
        minimum=None if low is None else float(low),
        maximum=None if high is None else float(high),
        verdict=found,
        reason=reason,
    )


def _why_none(metric: str) -> str:
    """Why a grid with values has none of a metric."""
    if metric.startswith(("EDI", "CCT", "Duv", "DER")):
        return (
            "colour and melanopic values need spectral = true in its [[sensors]], and light that "
            "has a colour temperature"
        )
    upright = "; VSC is of upright sensors" if metric.startswith("VSC") else ""
    return (
        "daylight factors need daylight_factor = true, or an overcast sky (type 1 or 16) "
        f"without a sun{upright}"
    )


def metric_rows(result: Result) -> list[dict[str, Any]]:
    """Every metric of every grid with its requirement, as written to ``metrics.json``."""
    verdicts: dict[tuple[str, str], list[RequirementResult]] = {}
    for found in evaluate_requirements(result):
        verdicts.setdefault((found.sensors, found.metric), []).append(found)
    rows: list[dict[str, Any]] = []
    for name, grid in result.sensors.items():
        values, errors = grid_metrics(grid)
        for metric, value in values.items():
            quantity, unit = QUANTITIES.get(metric, (metric, ""))
            # Several requirements on one metric make several rows.
            asked: list[RequirementResult | None] = [*verdicts.pop((name, metric), [])]
            for r in asked or [None]:
                rows.append(
                    {
                        "id": metric,
                        "quantity": quantity,
                        "sensor_id": name,
                        "value": value,
                        "unit": unit,
                        "uncertainty": errors.get(metric),
                        "requirement": r.bounds if r else None,
                        "verdict": r.verdict if r else None,
                    }
                )
    for leftover in verdicts.values():
        for lost in leftover:
            rows.append(
                {
                    "id": lost.metric,
                    "quantity": QUANTITIES.get(lost.metric, (lost.metric, ""))[0],
                    "sensor_id": lost.sensors,
                    "value": None,
                    "unit": lost.unit,
                    "uncertainty": None,
                    "requirement": lost.bounds,
                    "verdict": lost.verdict,
                }
            )
    return rows
