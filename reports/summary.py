"""Results in the words and tables of the report; no layout here."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from patchlight.solver.model import Result, SensorResult

from . import formats as f
from .metrics import FAIL, PASS, QUANTITIES, UNDECIDED, RequirementResult, grid_metrics


@dataclass(frozen=True, slots=True)
class Verdict:
    """Headline of the report: ``kind`` is one of pass, fail, open and none."""

    kind: str
    headline: str
    detail: str


def overall_verdict(result: Result, requirements: Sequence[RequirementResult]) -> Verdict:
    """One line over all requirements; a run that did not converge passes nothing."""
    failed = [r for r in requirements if r.verdict == FAIL]
    undecided = [r for r in requirements if r.verdict == UNDECIDED]
    total = len(requirements)
    all_met = ("The requirement is" if total == 1 else f"All {total} requirements are") + " met"
    late = "" if result.converged else " The accuracy asked for was not reached."
    if not total:
        if not result.converged:
            return Verdict("open", "Accuracy not reached", "No requirements are stated." + late)
        return Verdict("none", "No requirements stated", headline_numbers(result))
    if failed:
        names = ", ".join(f"{r.sensors} {r.metric}" for r in failed)
        head = f"{len(failed)} of {total} requirements failed"
        return Verdict("fail", head, f"Failed: {names}.{late}")
    if undecided:
        names = ", ".join(f"{r.sensors} {r.metric}" for r in undecided)
        head = f"{len(undecided)} of {total} requirements not decidable"
        return Verdict("open", head, f"Not decidable: {names}; the reasons stand below.{late}")
    if not result.converged:
        return Verdict("open", "Accuracy not reached", f"{all_met}.{late}")
    return Verdict("pass", all_met, "This holds over the whole range of numerical error.")


def headline_numbers(result: Result) -> str:
    """Mean illuminance of each grid, for runs without requirements."""
    parts = []
    for name, grid in result.sensors.items():
        values, errors = grid_metrics(grid)
        if values:
            parts.append(f"{name}: {f.with_error(values['E_avg_lx'], errors['E_avg_lx'])} lx")
    return "Mean illuminance " + "; ".join(parts) if parts else "No sensor grids."


def accuracy_statement(result: Result) -> str:
    """What the stated errors are and how large they became."""
    asked = result.settings.get("accuracy")
    text = f"Relative error asked for: {f.percent(float(asked))}. " if asked else ""
    shares = []
    for name, grid in result.sensors.items():
        values, errors = grid_metrics(grid)
        if values and values["E_avg_lx"] > 0.0:
            share = errors["E_avg_lx"] / values["E_avg_lx"]
            shares.append(f"{name} {f.percent(share)}")
    if shares:
        text += f"Estimated error of the mean illuminance: {', '.join(shares)}. "
    if not result.converged:
        text += "The computation stopped before the error asked for was reached. "
    return text + (
        "Errors stand behind ± as half-widths that cover quadrature, visibility, mesh and solver. "
        "Deviations of converted surfaces are listed with the import; material data, luminaire "
        "data and the sky model are taken as given."
    )


def finite_points(grid: SensorResult) -> SensorResult:
    """``grid`` without points whose value is not a number."""
    keep = np.isfinite(grid.illuminance_lx)
    if keep.all():
        return grid
    return replace(
        grid,
        points=grid.points[keep],
        normals=grid.normals[keep],
        area_m2=grid.area_m2[keep],
        illuminance_lx=grid.illuminance_lx[keep],
        error_lx=grid.error_lx[keep],
        components={k: np.asarray(v)[keep] for k, v in grid.components.items()},
        daylight=None if grid.daylight is None else grid.daylight.take(np.flatnonzero(keep)),
        spectral=None if grid.spectral is None else grid.spectral.take(np.flatnonzero(keep)),
    )


def grid_row(name: str, grid: SensorResult) -> dict[str, str]:
    """Row of the results table."""
    values, errors = grid_metrics(finite_points(grid))
    row = {"name": name, "points": f.count(len(grid.illuminance_lx))}
    row["area"] = f"{f.number(float(np.sum(grid.area_m2)), 3)}" if values else f.MISSING
    for key in ("E_avg_lx", "E_min_lx", "E_max_lx", "U0", "DF_avg_percent", "DF_median_percent"):
        row[key] = f.with_error(values.get(key), errors.get(key))
    return row


def daylight_rows(grid: SensorResult) -> list[dict[str, str]]:
    """Mean daylight factor and its shares. [%]"""
    grid = finite_points(grid)
    values, errors = grid_metrics(grid)
    names = ["SC_avg_percent", "ERC_avg_percent", "IRC_avg_percent", "DF_avg_percent"]
    return [
        {
            "name": "daylight factor" if key.startswith("DF") else QUANTITIES[key][0][5:],
            "value": f.with_error(values[key], errors.get(key)),
        }
        for key in names
        if key in values
    ]


def spectral_rows(grid: SensorResult) -> list[dict[str, str]]:
    """Colour temperature and melanopic values, where they were asked for and there are any."""
    values, errors = grid_metrics(finite_points(grid))
    names = ("CCT_avg_K", "Duv_avg", "EDI_avg_lx", "EDI_min_lx", "DER_avg")
    rows = []
    for key in names:
        if key in values:
            quantity, unit = QUANTITIES[key]
            text = f.with_error(values[key], errors.get(key))
            name = quantity.removesuffix(", modelled")
            rows.append({"name": name, "value": text if unit == "1" else f"{text} {unit}"})
    return rows


def component_rows(grid: SensorResult) -> list[dict[str, str]]:
    """Mean direct and indirect illuminance by light group. [lx]"""
    grid = finite_points(grid)
    values, _ = grid_metrics(grid)
    if not values or not grid.components:
        return []
    means: dict[str, dict[str, float]] = defaultdict(lambda: {"direct": 0.0, "indirect": 0.0})
    for name, lux in grid.components.items():
        group, _, kind = name.rpartition(".")
        means[group][kind if kind in ("direct", "indirect") else "direct"] += grid.mean(lux)
    whole = values["E_avg_lx"]
    rows = [(group, v["direct"], v["indirect"]) for group, v in means.items()]
    rows.append(("all", sum(r[1] for r in rows), sum(r[2] for r in rows)))
    place = f.decimals(whole, 4)
    return [
        {
            "group": group,
            "direct": f.addend(direct, place),
            "indirect": f.addend(indirect, place),
            "total": f.addend(direct + indirect, place),
            "share": _share((direct + indirect) / whole) if whole > 0.0 else f.MISSING,
        }
        for group, direct, indirect in rows
    ]


def _share(fraction: float) -> str:
    return f"{f.with_error(100.0 * fraction, digits=3)} %"


def balance_rows(result: Result) -> list[dict[str, str]]:
    """Flux ledger, line by line. [lm]"""
    b = result.balance
    total = b.emitted_lm + b.entered_lm

    def row(name: str, value: float, level: str) -> dict[str, str]:
        share = f.percent(value / total, 3) if total > 0.0 else f.MISSING
        return {"name": name, "flux": f.number(value, 4), "share": share, "level": level}

    rows = [row("emitted by luminaires", b.emitted_lm, "main")]
    if len(b.emitted_by_group) > 1:
        rows += [row(group, lm, "sub") for group, lm in b.emitted_by_group.items()]
    rows.append(row("entered from sky, sun and ground", b.entered_lm, "main"))
    rows.append(row("absorbed by materials", b.absorbed_lm, "main"))
    ordered = sorted(b.absorbed_by_material.items(), key=lambda item: -item[1])
    rows += [row(name, lm, "sub") for name, lm in ordered if lm > 0.0]
    rows.append(row("left the scene", b.escaped_lm, "main"))
    rows.append(row("residual", b.residual_lm, "total"))
    rows[-1]["flux"] = f.number(b.residual_lm, 2)  # a small difference of large numbers
    rows[-1]["share"] = f.percent(b.residual_fraction, 2)
    return rows


def verdict_class(verdict: str) -> str:
    """CSS class of a verdict."""
    return {PASS: "pass", FAIL: "fail"}.get(verdict, "open")
