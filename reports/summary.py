"""Facts of a result in the words and tables of the report; no layout here."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from patchlight.solver.model import CIESky, Result, SceneData, SensorResult

from . import formats as f
from .metrics import FAIL, PASS, UNDECIDED, RequirementResult, grid_metrics

#: The ledger must close better than this; otherwise the report says so.
RESIDUAL_BOUND = 1e-3

#: Sky types of ISO 15469:2004 (CIE S 011), table 1; 16 is the traditional overcast sky of the CIE.
SKY_TYPES = {
    1: "CIE standard overcast sky",
    2: "overcast, steep gradation, slightly brighter towards the sun",
    3: "overcast, moderate gradation, the same in all azimuths",
    4: "overcast, moderate gradation, slightly brighter towards the sun",
    5: "sky of uniform luminance",
    6: "partly cloudy, no gradation, slightly brighter towards the sun",
    7: "partly cloudy, no gradation, brighter around the sun",
    8: "partly cloudy, no gradation, distinct solar corona",
    9: "partly cloudy, sun obscured",
    10: "partly cloudy, brighter around the sun",
    11: "white-blue sky with distinct solar corona",
    12: "CIE standard clear sky, low turbidity",
    13: "CIE standard clear sky, polluted atmosphere",
    14: "cloudless turbid sky with broad solar corona",
    15: "white-blue turbid sky with broad solar corona",
    16: "traditional CIE overcast sky (Moon and Spencer)",
}


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
        return Verdict("open", head, f"Not decidable within the numerical error: {names}.{late}")
    if not result.converged:
        return Verdict("open", "Accuracy not reached", f"All {total} requirements are met." + late)
    word = "The requirement is" if total == 1 else f"All {total} requirements are"
    return Verdict("pass", f"{word} met", "Each holds over its whole range of numerical error.")


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
        "Errors stand behind ± as half-widths that cover import, quadrature, visibility, mesh and "
        "solver. Material data, luminaire data and the sky model are taken as given."
    )


def finite_points(grid: SensorResult) -> SensorResult:
    """``grid`` without points whose value is not a number."""
    keep = np.isfinite(grid.illuminance_lx)
    if keep.all():
        return grid
    daylight = grid.daylight_factor
    return replace(
        grid,
        points=grid.points[keep],
        normals=grid.normals[keep],
        area_m2=grid.area_m2[keep],
        illuminance_lx=grid.illuminance_lx[keep],
        error_lx=grid.error_lx[keep],
        components={k: np.asarray(v)[keep] for k, v in grid.components.items()},
        daylight_factor=None if daylight is None else daylight[keep],
    )


def grid_row(name: str, grid: SensorResult) -> dict[str, str]:
    """Row of the results table."""
    values, errors = grid_metrics(finite_points(grid))
    row = {"name": name, "points": f.count(len(grid.illuminance_lx))}
    row["area"] = f"{f.number(float(np.sum(grid.area_m2)), 3)}" if values else f.MISSING
    for key in ("E_avg_lx", "E_min_lx", "E_max_lx", "U0", "DF_avg_percent", "DF_median_percent"):
        row[key] = f.with_error(values.get(key), errors.get(key))
    return row


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
    return [
        {
            "group": group,
            "direct": f.number(direct),
            "indirect": f.number(indirect),
            "total": f.number(direct + indirect),
            "share": f.percent((direct + indirect) / whole, 3) if whole > 0.0 else f.MISSING,
        }
        for group, direct, indirect in rows
    ]


def sky_text(sky: CIESky | None) -> str:
    """Sky model and its absolute level."""
    if sky is None:
        return "none"
    number = int(sky.type)
    text = f"CIE type {number}, {SKY_TYPES[number]}"
    if sky.diffuse_illuminance_lx is not None:
        text += f"; {f.number(sky.diffuse_illuminance_lx)} lx diffuse horizontal"
    elif sky.zenith_luminance_cd_m2 is not None:
        text += f"; zenith luminance {f.number(sky.zenith_luminance_cd_m2)} cd/m²"
    else:
        text += "; no level given: scaled to 10 000 lx diffuse horizontal (relative)"
    if sky.needs_sun:
        text += f"; sun at {_position(sky.sun_altitude_deg, sky.sun_azimuth_deg)}"
    return text + f"; {f.number(sky.cct_k, 4)} K"


def _position(altitude: float | None, azimuth: float | None) -> str:
    return f"altitude {f.number(altitude, 4)}°, azimuth {f.number(azimuth, 4)}° from north"


def light_facts(scene: SceneData) -> list[tuple[str, str]]:
    """Sky, sun, ground, site, north and maintenance factor."""
    sun, ground, site = scene.sun, scene.ground, scene.site
    daylight = scene.sky is not None or sun is not None
    facts = [("Sky", sky_text(scene.sky))]
    if sun is None:
        facts.append(("Sun", "none"))
    else:
        facts.append((
            "Sun",
            f"{_position(sun.altitude_deg, sun.azimuth_deg)}; "
            f"{f.number(sun.normal_illuminance_lx)} lx normal; disc of radius "
            f"{f.number(sun.angular_radius_arcmin)}′; {f.number(sun.cct_k, 4)} K",
        ))  # fmt: skip
    if daylight:
        known = ground is not None and ground.reflectance is not None
        facts.append(
            ("Ground", f"uniform, reflectance {ground.reflectance:g}" if known else "none")  # type: ignore[union-attr]
        )
    if site is not None:
        place = (
            f"{abs(site.latitude_deg):g}° {'N' if site.latitude_deg >= 0 else 'S'}, "
            f"{abs(site.longitude_deg):g}° {'E' if site.longitude_deg >= 0 else 'W'}, "
            f"{site.elevation_m:g} m"
        )
        facts.append(("Site", place + (f", {site.timezone}" if site.timezone else "")))
    if daylight or scene.north_deg:
        facts.append(("True north", f"{scene.north_deg:g}° clockwise from +y of the model"))
    if scene.luminaires:
        facts.append(("Maintenance factor", f"{scene.maintenance_factor:g}, on all luminaires"))
    return facts


def material_rows(scene: SceneData) -> list[dict[str, Any]]:
    """Materials in use with swatch, reflectance, number of faces and area. [m²]"""
    areas = scene.patches.areas() if len(scene.patches) else np.zeros(0)
    rows = []
    sides = np.asarray(scene.material_index)
    active = np.column_stack([np.ones(len(areas), dtype=bool), scene.two_sided])
    default = np.zeros(max(len(scene.faces), 1), dtype=bool)
    default[: len(scene.default_faces)] = scene.default_faces
    for k, material in enumerate(scene.materials):
        used = (sides == k) & active
        patches = used.any(axis=1)
        if not patches.any():
            continue
        faces = np.unique(scene.patches.face_index[patches])
        color = material.bands
        text = f"{material.luminous_reflectance:.2f}"
        if not material.is_grey:
            text += " (RGB " + ", ".join(f"{b:.2f}" for b in color) + ")"
        on_default = int(default[faces[faces < len(default)]].sum())
        rows.append(
            {
                "name": material.name or f"material {k + 1}",
                "swatch": f.srgb_hex(color),
                "reflectance": text,
                "faces": f.count(len(faces)),
                "area": f.number(float((areas[:, None] * used).sum())),
                "default": f.count(on_default) if on_default else "",
            }
        )
    black = (sides == -1) & active & (np.asarray(scene.luminaire_index) < 0)
    if black.any():
        rows.append(
            {
                "name": "black",
                "swatch": "#000000",
                "reflectance": "0",
                "faces": f.count(len(np.unique(scene.patches.face_index[black.any(axis=1)]))),
                "area": f.number(float((areas[:, None] * black).sum())),
                "default": "",
            }
        )
    return rows


def default_faces(scene: SceneData, *, limit: int = 40) -> tuple[int, list[str]]:
    """Number of faces on the default material, and their names by part, the first ``limit``."""
    rows = np.flatnonzero(scene.default_faces)
    by_part: dict[str, list[int]] = defaultdict(list)
    for row in rows:
        face = scene.faces[row]
        by_part[scene.parts[face.part].path].append(face.number)
    lines = []
    for path, numbers in list(by_part.items())[:limit]:
        shown = ", ".join(f"#{n}" for n in sorted(numbers)[:12])
        more = f" and {len(numbers) - 12} more" if len(numbers) > 12 else ""
        lines.append(f"{path}: {shown}{more}")
    if len(by_part) > limit:
        lines.append(f"and {len(by_part) - limit} more parts")
    return len(rows), lines


def luminaire_rows(scene: SceneData) -> list[dict[str, str]]:
    """Luminaires with what was computed with; equal ones of a group are counted together."""
    merged: dict[tuple[Any, ...], list[str]] = defaultdict(list)
    for lamp in scene.luminaires:
        # Rounded: copies of one lamp differ by rounding of their area.
        area = float(f"{lamp.area_m2:.6g}")
        key = (
            lamp.group,
            lamp.flux_lm,
            lamp.cct_k,
            lamp.power_w,
            area,
            f.srgb_hex(_bright(lamp.color)),
        )
        merged[key].append(lamp.part)
    rows = []
    for (group, flux, cct, power, area, swatch), parts in merged.items():
        new = flux / scene.maintenance_factor
        rows.append(
            {
                "part": parts[0] + (f" … {parts[-1]}" if len(parts) > 1 else ""),
                "count": f.count(len(parts)),
                "group": group,
                "flux": f.number(flux, 4),
                "cct": f.number(cct, 4),
                "power": f.number(power) if power else f.MISSING,
                "efficacy": f.number(new / power) if power else f.MISSING,
                "area": f.number(area),
                "luminance": f.number(flux / area / np.pi) if area > 0.0 else f.MISSING,
                "swatch": swatch,
            }
        )
    return rows


def _bright(color: Any) -> Any:
    """Light colours are scaled to luminance 1 and may leave the display's range."""
    c = np.maximum(np.asarray(color, dtype=np.float64), 0.0)
    return c / max(float(c.max()), 1e-9)


def luminaire_totals(scene: SceneData) -> str:
    """Sum of flux and power, when there is more than one luminaire."""
    if len(scene.luminaires) < 2:
        return ""
    flux = sum(lamp.flux_lm for lamp in scene.luminaires)
    powers = [lamp.power_w for lamp in scene.luminaires]
    text = f"Together {f.number(flux, 4)} lm"
    if all(p is not None for p in powers):
        text += f" and {f.number(sum(p for p in powers if p is not None))} W"
    return text


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
    return rows


def verdict_class(verdict: str) -> str:
    """CSS class of a verdict."""
    return {PASS: "pass", FAIL: "fail"}.get(verdict, "open")
