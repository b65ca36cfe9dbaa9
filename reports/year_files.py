"""Files of a year: metrics, values of each point, and ``run.json``."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from .autonomy import UDI_NAMES, continuous_autonomy, daylight_autonomy, useful_illuminance
from .files import safe_names, write_text
from .lm83 import ASE_LX
from .run_files import SCHEMA_VERSION, library_versions, tool_version
from .year_metrics import Row, grid_years, year_rows

if TYPE_CHECKING:
    import xarray

_METRICS = ("id", "quantity", "sensor_id", "value", "unit")
_POINTS = (
    "point_id", "x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "E_mean_lx", "DA300_pct",
    "cDA300_pct", *(f"UDI_{name.replace(' ', '_')}_pct" for name in UDI_NAMES),
    "sun_above_1000_lx_h",
)  # fmt: skip


def write_year(
    dataset: xarray.Dataset,
    folder: Path,
    *,
    inputs: Iterable[Mapping[str, str]],
    config: str = "",
) -> list[Row]:
    """Write metrics.json, metrics.csv, grids/*.csv and run.json of a year; returns the metrics.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    folder : Path
        Output folder.
    inputs : mappings
        ``path`` and ``sha256`` of the files that the year was made of.
    config : str
        The scene file with all defaults, for config.resolved.toml.
    """
    rows = year_rows(dataset)
    known = {"schema_version": SCHEMA_VERSION, "metrics": rows}
    write_text(folder / "metrics.json", json.dumps(known, indent=2, ensure_ascii=False) + "\n")
    table = ([row[name] for name in _METRICS] for row in rows)
    write_text(folder / "metrics.csv", _csv(_METRICS, table))
    if config:
        write_text(folder / "config.resolved.toml", config)
    occupied = np.asarray(dataset["occupied"].values, dtype=bool)
    step_h = float(dataset.attrs["step_minutes"]) / 60.0
    grids = grid_years(dataset)
    stems = safe_names([grid.name for grid in grids])
    names = np.asarray(dataset["grid"].values).astype(str)
    for grid in grids:
        some = np.flatnonzero(names == grid.name)
        columns: list[FloatArray] = [np.arange(len(some), dtype=np.float64)]
        keys = ("x", "y", "z", "nx", "ny", "nz", "area")
        columns += [np.asarray(dataset[key].values)[some] for key in keys]
        columns.append(
            grid.illuminance[:, occupied].mean(axis=1)
            if occupied.any()
            else np.full(len(some), np.nan)
        )
        columns.append(100.0 * daylight_autonomy(grid.illuminance, occupied))
        columns.append(100.0 * continuous_autonomy(grid.illuminance, occupied))
        columns += list(100.0 * useful_illuminance(grid.illuminance, occupied))
        columns.append(step_h * (grid.sun[:, occupied] > ASE_LX).sum(axis=1))
        lines = ([f"{value:.9g}" for value in line] for line in zip(*columns, strict=True))
        write_text(folder / "grids" / f"{stems[grid.name]}.csv", _csv(_POINTS, lines))
    record: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": "year",
        "tool": "patchlight",
        "version": tool_version(),
        "libraries": library_versions(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "inputs": [dict(one) for one in inputs],
        "settings": {key: _plain(value) for key, value in dataset.attrs.items()},
        "warnings": [text for text in str(dataset.attrs["remarks"]).splitlines() if text],
    }
    write_text(folder / "run.json", json.dumps(record, indent=2, ensure_ascii=False) + "\n")
    return rows


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _csv(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()
