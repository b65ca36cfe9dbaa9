"""The HTML report: facts, figures and template put together into one self-contained page."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.ledger import RESIDUAL_BOUND
from patchlight.solver.model import Result, SensorResult

from . import figures, formats, inputs, summary
from .histogram import histogram_figure
from .images import Picture
from .metrics import QUANTITIES, RequirementResult, evaluate_requirements, grid_metrics
from .plan import plan_figure
from .run_files import certificate_totals, library_versions, row_sum_statistics, tool_version
from .section import patch_triangles
from .still import Still

#: Failed faces listed in the report; ``run.json`` has all.
MAX_FACES = 50


@cache
def environment() -> Any:
    """Jinja environment of the package's templates, escaping everything."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    env = Environment(
        loader=PackageLoader("patchlight.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    env.filters.update(
        number=formats.number,
        percent=formats.percent,
        whole=formats.count,
        metres=formats.length,
        angle=formats.angle,
        duration=formats.seconds,
        scientific=formats.scientific,
        verdict_class=summary.verdict_class,
    )
    return env


def render_report(
    result: Result,
    *,
    pictures: Sequence[Picture] = (),
    still: Still | None = None,
    viewer: str = "",
    config: str | None = None,
    problems: Sequence[str] = (),
) -> str:
    """HTML of the whole report.

    Parameters
    ----------
    pictures, still : camera pictures and 3-D still
        Shown when given.
    viewer : str
        Interactive scene, HTML to be placed in the page.
    config : str, optional
        Resolved scene file.
    problems : sequence of str
        What went wrong while writing the output, shown with the warnings.
    """
    from markupsafe import Markup

    requirements = evaluate_requirements(result)
    scene = result.scene
    balance = result.balance
    triangles = patch_triangles(scene.patches) if result.sensors else np.zeros((0, 3, 3))
    count, names = inputs.default_faces(scene)
    settings = {k: v for k, v in result.settings.items() if k != "requirements"}
    context = {
        "title": scene.title,
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "version": tool_version(),
        "verdict": summary.overall_verdict(result, requirements),
        "accuracy": summary.accuracy_statement(result),
        "warnings": [*result.warnings, *problems],
        "notes": list(scene.notes),
        "requirements": [_requirement(r) for r in requirements],
        "grids": [
            _grid(name, grid, result, requirements, index, triangles)
            for index, (name, grid) in enumerate(result.sensors.items())
        ],
        "has_daylight_factor": any(
            g.daylight_factor is not None for g in result.sensors.values()
        ),
        "sources": [_source(s) for s in scene.sources],
        "light": inputs.light_facts(scene),
        "materials": inputs.material_rows(scene),
        "default_count": count,
        "default_names": names,
        "luminaires": inputs.luminaire_rows(scene),
        "webs": inputs.web_rows(scene),
        "luminaire_totals": inputs.luminaire_totals(scene),
        "maintenance_factor": scene.maintenance_factor,
        "still": still and {
            "uri": figures.data_uri(still.png), "caption": still.caption, "note": still.note,
        },
        "viewer": Markup(viewer),
        "pictures": [_picture(p) for p in pictures],
        "balance": summary.balance_rows(result),
        "residual": balance.residual_fraction,
        "residual_ok": abs(balance.residual_fraction) <= RESIDUAL_BOUND,
        "residual_bound": RESIDUAL_BOUND,
        "row_sums": row_sum_statistics(result),
        "elements": len(result.elements),
        "patches": len(scene.patches),
        "stages": list(result.stages.items()),
        "stage_total": sum(result.stages.values()),
        "skipped": list(result.skipped.items()),
        "counters": [(k.replace("_", " "), n) for k, n in result.counters.items()],
        "settings": [
            (k.replace("_", " "), formats.setting(formats.plain(v))) for k, v in settings.items()
        ],
        "libraries": library_versions(),
        "cores": os.cpu_count(),
        "config": config,
    }  # fmt: skip
    return str(environment().get_template("report.html").render(context))


def _requirement(r: RequirementResult) -> dict[str, Any]:
    unit = "" if r.unit == "1" else r.unit
    return {
        "sensors": r.sensors,
        "metric": r.metric,
        "quantity": QUANTITIES.get(r.metric, (r.metric, ""))[0],
        "value": formats.with_error(r.value, r.uncertainty),
        "has_value": r.value is not None,
        "unit": unit,
        "bounds": r.bounds.replace(">=", "≥").replace("<=", "≤"),
        "verdict": r.verdict,
        "reason": r.reason,
    }


def _grid(
    name: str, grid: SensorResult, result: Result, requirements: Sequence[RequirementResult],
    index: int, triangles: NDArray[np.float64],
) -> dict[str, Any]:  # fmt: skip
    """One sensor grid: numbers, plan and distribution."""
    from markupsafe import Markup

    valid = summary.finite_points(grid)
    lost = len(grid.illuminance_lx) - len(valid.illuminance_lx)
    entry: dict[str, Any] = {
        "name": name,
        "row": summary.grid_row(name, grid),
        "components": summary.component_rows(grid),
        "daylight": summary.daylight_rows(grid),
        "daylight_sky": inputs.overcast_text(grid),
        "spectral": summary.spectral_rows(grid),
        "plan": "",
        "histogram": "",
        "facts": "",
        "caption": "",
        "remark": "",
    }
    if not grid_metrics(valid)[0]:
        entry["remark"] = "This grid has no points with a value."
        return entry
    if lost:
        entry["remark"] = f"{lost} of {len(grid.illuminance_lx)} points have no value."
    if float(np.max(valid.illuminance_lx)) < formats.NEGLIGIBLE:
        entry["remark"] += " Every point is dark: no light reaches this grid."
    entry["facts"] = _grid_facts(valid)
    mine = [r for r in requirements if r.sensors == name]
    with figures.look():
        figure, caption = plan_figure(valid, triangles, north_deg=result.scene.north_deg)
        entry["plan"] = Markup(figures.svg(figure, prefix=f"plan{index}"))
        entry["caption"] = caption
        distribution = histogram_figure(valid, mine)
        if distribution is not None:
            entry["histogram"] = Markup(figures.svg(distribution, prefix=f"hist{index}"))
    return entry


def _grid_facts(grid: SensorResult) -> str:
    """Number of points, height, spacing and area in one line."""
    points = np.asarray(grid.points)
    n = len(points)
    parts = [f"{formats.count(n)} point{'s' if n != 1 else ''}"]
    z = points[:, 2]
    extent = float(np.ptp(points, axis=0).max())
    low, high = (formats.coordinate(float(end), extent) for end in (z.min(), z.max()))
    if float(np.ptp(z)) <= 1e-6 * max(1.0, float(np.abs(z).max())):
        parts.append(f"height {low} m")
    else:
        parts.append(f"heights {low} to {high} m")
    mean = np.asarray(grid.normals).mean(axis=0)
    if mean[2] > 0.999:
        parts.append("facing up")
    elif mean[2] < -0.999:
        parts.append("facing down")
    parts.append(f"area {formats.number(float(np.sum(grid.area_m2)))} m²")
    return ", ".join(parts)


def _source(source: Any) -> dict[str, Any]:
    totals = certificate_totals(source.certificate)
    return {
        "name": source.name,
        "file": source.file,
        "sha256": source.sha256,
        "unit": source.unit,
        "scale": source.scale,
        "certificate": totals,
        "failed": totals["failed"][:MAX_FACES],
        "failed_more": max(len(totals["failed"]) - MAX_FACES, 0),
        "approximated": [
            {
                "part": _path(source.certificate, face.part),
                "number": face.number,
                "kind": face.kind,
                "deviation": formats.length(face.deviation_m),
                "angle": formats.angle(face.angle_deg),
                "reason": face.reason,
            }
            for face in sorted(source.certificate.faces, key=lambda face: -face.deviation_m)
            if not face.exact and not face.failed
        ][:10],
    }


def _path(certificate: Any, part: int) -> str:
    paths = certificate.part_paths
    return paths[part] if 0 <= part < len(paths) else str(part)


def _picture(p: Picture) -> dict[str, Any]:
    text = ", ".join(f"{k} {formats.number(v)}" for k, v in p.statistics.items())
    return {
        "name": p.name,
        "caption": p.caption,
        "tone_mapped": figures.data_uri(p.tone_mapped),
        "false_color": figures.data_uri(p.false_color),
        "statistics": f"Luminance in cd/m²: {text}" if text else "",
    }
