"""Machine-readable files of a run: ``run.json``, metrics, sensor grids and patches."""

from __future__ import annotations

import csv
import io
import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.errors import OutputError
from patchlight.solver.model import Certificate, Result, SensorResult

from .files import safe_names, write_atomic, write_text
from .formats import plain
from .inputs import web_rows
from .metrics import evaluate_requirements, metric_rows

#: Version of the layout of all files written here; grows when a reader would have to change.
SCHEMA_VERSION = 1
_LIBRARIES = ("numpy", "scipy", "numba", "cadquery", "cadquery-ocp", "OpenEXR", "pyvista", "vtk")
_METRIC_COLUMNS = (
    "id", "quantity", "sensor_id", "value", "unit", "uncertainty", "requirement", "verdict",
)  # fmt: skip


def tool_version() -> str:
    """Version of the installed distribution."""
    return _version("patchlight") or "unknown"


def library_versions() -> dict[str, str]:
    """Versions of Python and of the libraries that can change a number or a picture."""
    found = {name: _version(name) for name in _LIBRARIES}
    return {"python": platform.python_version()} | {k: v for k, v in found.items() if v}


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def certificate_totals(certificate: Certificate) -> dict[str, Any]:
    """Totals of a conversion certificate, as in ``inspect --json``, with the failed faces."""
    names = (
        "faces_total", "faces_exact", "faces_approximated", "faces_failed", "max_deviation_m",
        "max_angle_deg", "max_area_error", "max_gap_m", "free_edge_m", "normals_left_out",
        "edges", "patches", "seconds",
    )  # fmt: skip
    totals = {name: getattr(certificate, name) for name in names}
    paths = certificate.part_paths
    totals["failed"] = [
        {
            "part": paths[f.part] if 0 <= f.part < len(paths) else str(f.part),
            "number": f.number,
            "kind": f.kind,
            "reason": f.reason,
        }
        for f in certificate.failures
    ]
    totals["notes"] = list(certificate.notes)
    return totals


def row_sum_statistics(result: Result) -> dict[str, float]:
    """Lowest, mean and highest raw row sum of the form factors; empty without any."""
    sums = np.asarray(result.row_sums, dtype=np.float64)
    sums = sums[np.isfinite(sums)]
    if sums.size == 0:
        return {}
    return {
        "count": int(sums.size),
        "min": float(sums.min()),
        "mean": float(sums.mean()),
        "max": float(sums.max()),
        "above_1": int((sums > 1.0 + 1e-9).sum()),
    }


def run_record(result: Result) -> dict[str, Any]:
    """Content of ``run.json``."""
    scene, settings = result.scene, dict(result.settings)
    now = datetime.now(UTC).isoformat(timespec="seconds")
    balance = result.balance
    requirements = evaluate_requirements(result)
    record = {
        "schema_version": SCHEMA_VERSION,
        "tool": {"name": "patchlight", "version": tool_version()},
        "title": scene.title,
        "status": "ok" if result.converged else "not converged",
        "converged": result.converged,
        "started": settings.get("started", now),
        "ended": settings.get("ended", now),
        "host": {"cores": os.cpu_count(), "system": platform.system()},
        "libraries": library_versions(),
        "inputs": [
            {
                "path": s.file,
                "sha256": s.sha256,
                "name": s.name,
                "unit": s.unit,
                "scale": s.scale,
                "certificate": certificate_totals(s.certificate),
            }
            for s in scene.sources
        ],
        "photometry": web_rows(scene),
        "settings": settings,
        "maintenance_factor": scene.maintenance_factor,
        "north_deg": scene.north_deg,
        "elements": len(result.elements),
        "patches": len(scene.patches),
        "default_faces": int(np.count_nonzero(scene.default_faces)),
        "stages": {name: {"seconds": s} for name, s in result.stages.items()},
        "skipped": dict(result.skipped),
        "counters": dict(result.counters),
        "flux": {
            "emitted_lm": balance.emitted_lm,
            "entered_lm": balance.entered_lm,
            "absorbed_lm": balance.absorbed_lm,
            "escaped_lm": balance.escaped_lm,
            "residual_lm": balance.residual_lm,
            "residual_fraction": balance.residual_fraction,
            "absorbed_by_material_lm": dict(balance.absorbed_by_material),
            "emitted_by_group_lm": dict(balance.emitted_by_group),
        },
        "row_sums": row_sum_statistics(result),
        "requirements": [
            {
                "sensors": r.sensors,
                "metric": r.metric,
                "value": r.value,
                "uncertainty": r.uncertainty,
                "unit": r.unit,
                "min": r.minimum,
                "max": r.maximum,
                "verdict": r.verdict,
                "reason": r.reason,
            }
            for r in requirements
        ],
        "warnings": list(result.warnings),
        "notes": list(scene.notes),
    }
    return dict(plain(record))


def write_json(path: Path, data: Any) -> Path:
    """Write strict JSON (no NaN) atomically."""
    text = json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)
    return write_text(path, text + "\n")


def csv_text(columns: tuple[str, ...] | list[str], rows: list[list[Any]]) -> str:
    """CSV with a header row, point decimals and Unix line ends."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()


def write_metrics(result: Result, folder: Path) -> dict[str, Path]:
    """``metrics.json`` and ``metrics.csv``."""
    rows = metric_rows(result)
    table = [["" if row[c] is None else row[c] for c in _METRIC_COLUMNS] for row in rows]
    return {
        "metrics.json": write_json(
            folder / "metrics.json", {"schema_version": SCHEMA_VERSION, "metrics": rows}
        ),
        "metrics.csv": write_text(folder / "metrics.csv", csv_text(_METRIC_COLUMNS, table)),
    }


def write_grids(result: Result, folder: Path) -> dict[str, Path]:
    """One CSV a sensor grid below ``grids/``."""
    written = {}
    for name, stem in safe_names(result.sensors).items():
        key = f"grids/{stem}.csv"
        written[key] = write_text(folder / key, grid_csv(result.sensors[name]))
    return written


def grid_csv(grid: SensorResult) -> str:
    """Points, normals [m], areas [m²], illuminance and its components [lx] of a grid.

    Colour and melanopic values, where they were asked for, are not numbers where light has none.
    """
    columns = ["point_id", "x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "E_lx", "error_lx"]
    values = [
        *np.asarray(grid.points).T,
        *np.asarray(grid.normals).T,
        grid.area_m2,
        grid.illuminance_lx,
        grid.error_lx,
    ]
    for component, lux in grid.components.items():
        columns.append(f"E_{component}_lx")
        values.append(lux)
    if grid.daylight is not None:
        shares = grid.daylight
        columns += ["DF_percent", "DF_error_percent", "SC_percent", "ERC_percent", "IRC_percent"]
        found = (shares.total, shares.error, shares.sky, shares.external, shares.internal)
        values += [100.0 * v for v in found]
    if grid.spectral is not None:
        told = grid.spectral
        columns += ["CCT_K", "CCT_error_K", "Duv", "Duv_error", "x", "y"]
        values += [told.cct_k, told.cct_error_k, told.duv, told.duv_error, *told.chromaticity.T]
        columns += ["EDI_melanopic_lx", "EDI_error_lx", "DER_melanopic", "DER_error"]
        values += [told.melanopic_edi_lx, grid.edi_error_lx]
        values += [told.melanopic_der, told.der_error]
    rows = [[i, *(f"{float(v[i]):.9g}" for v in values)] for i in range(len(grid.illuminance_lx))]
    return csv_text(columns, rows)


def write_patches(result: Result, folder: Path) -> Path:
    """``patches.npz``: the elements as exact control nets with everything computed on them."""
    scene, elements = result.scene, result.elements
    patch = elements.patch_index
    arrays: Mapping[str, Any] = {
        "schema_version": np.int64(SCHEMA_VERSION),
        "nets": elements.nets,
        "boxes": elements.boxes,
        "patch_index": patch,
        "side": elements.side,
        "part_index": scene.patches.part_index[patch],
        "face_index": scene.patches.face_index[patch],
        "part_paths": np.array([p.path for p in scene.parts], dtype=np.str_),
        "area_m2": elements.areas,
        "illuminance_lx": result.illuminance_lx,
        "error_lx": result.element_error_lx,
        "exitance_lm_m2": result.exitance,
        "components": np.array(list(result.components), dtype=np.str_),
        **{f"irradiance.{name}": values for name, values in result.components.items()},
    }

    def write(path: Path) -> None:
        with open(path, "wb") as stream:
            np.savez_compressed(stream, **arrays)

    try:
        return write_atomic(folder / "patches.npz", write)
    except ValueError as error:  # NumPy's zip writer on a full disk
        raise OutputError(f"cannot write {folder / 'patches.npz'}: {error}") from error
