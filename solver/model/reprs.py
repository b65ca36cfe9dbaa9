"""Results as a Python prompt shows them: what they are about, not their arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .cad import Model
    from .photometry import Photometry
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
    counted = grid.illuminance_lx[grid.area_m2 > 0.0]
    low, high = (lux_text(float(f(counted))) for f in (np.min, np.max))
    return f"{count}, E_avg {lux_text(mean)} ± {lux_text(error, 2)} lx, {low} to {high} lx"


def model_repr(model: Model) -> str:
    """Name and numbers of a CAD model, and where it came from."""
    counts = (
        _many(len(model.parts), "part"),
        _many(len(model.faces), "face"),
        _many(len(model.patches), "patch", "patches"),
    )
    failed = model.certificate.faces_failed
    parts = [", ".join(counts)]
    parts += [_many(failed, "failed face")] if failed else []
    parts += [_many(len(model.warnings), "warning")] if model.warnings else []
    origin = "" if model.source in ("", model.name) else f" of {model.source}"
    return f"<Model {model.name!r}{origin}: {'; '.join(parts)}>"


def photometry_repr(web: Photometry) -> str:
    """Name, flux and grid of a photometric web, and its file."""
    grid = f"{len(web.c_deg)} half-planes x {len(web.gamma_deg)} angles"
    flux = "" if web.lamp_flux_lm is None else f" of lamps with {web.lamp_flux_lm:g} lm"
    power = "" if web.power_w is None else f", {web.power_w:g} W"
    remarks = f"; {_many(len(web.remarks), 'remark')}" if web.remarks else ""
    return (
        f"<Photometry {web.name!r}: {web.flux_lm:.4g} lm{flux}{power}, "
        f"{grid}, up to {float(web.candela.max()):.4g} cd; "
        f"{web.source or 'no file'}{remarks}>"
    )


def _many(count: int, one: str, more: str = "") -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"


def lux_text(value: float, digits: int = 4) -> str:
    """``digits`` significant digits without exponent for what illuminances can be."""
    if not math.isfinite(value) or value == 0.0 or abs(value) < 1e-4:
        return f"{value:.{digits}g}"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, decimals):.{max(decimals, 0)}f}"
