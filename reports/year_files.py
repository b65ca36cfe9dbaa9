"""Files of a year: page, metrics, values of each point, and ``run.json``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from .autonomy import UDI_NAMES
from .files import safe_names, write_text
from .run_files import SCHEMA_VERSION, csv_text, library_versions, tool_version, write_json
from .view_rows import VIEW_COLUMNS, view_columns, view_rows
from .year_caveats import year_remarks
from .year_metrics import Row, year_rows
from .year_report import render_year
from .year_tables import grid_tables

if TYPE_CHECKING:
    import xarray
    from patchlight.solver.model import SceneData
    from patchlight.solver.view_out import ViewOut

_METRICS = ("id", "quantity", "sensor_id", "value", "low", "high", "unit")
_POINTS = (
    "point_id", "x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "E_mean_lx", "DA300_pct",
    "cDA300_pct", *(f"UDI_{name.replace(' ', '_')}_pct" for name in UDI_NAMES),
    "sun_above_1000_lx_h", "sun_h",
)  # fmt: skip
_MELANOPIC = ("EDI_mean_lx", "EDI250_pct")
#: Of these, those that points of work planes have alone.
_OF_WORK_PLANES = tuple(name for name in _POINTS if "DA300" in name or "UDI" in name)


def write_year(
    dataset: xarray.Dataset,
    folder: Path,
    *,
    inputs: Iterable[Mapping[str, str]],
    scene: Mapping[str, str] | None = None,
    config: str = "",
    surroundings: SceneData | None = None,
    views: Mapping[str, ViewOut] | None = None,
) -> list[Row]:
    """Write report.html, metrics.json, metrics.csv, grids/*.csv and run.json; returns the metrics.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    folder : Path
        Output folder.
    inputs : mappings
        ``path`` and ``sha256`` of the models and the weather: what another run into the folder must
        have, too.
    scene : mapping, optional
        The same of the scene file.
    config : str
        The scene file with all defaults, for config.resolved.toml.
    surroundings : SceneData, optional
        The scene: its walls and outlines are drawn in the maps.
    views : mapping of ViewOut, optional
        View out of grids, by their name: more rows and columns.
    """
    tables, inputs = grid_tables(dataset), [dict(one) for one in inputs]
    rows, views = year_rows(dataset, tables), views or {}
    if views:
        rows += view_rows(views)
    remarks = year_remarks(dataset)
    write_json(folder / "metrics.json", {"schema_version": SCHEMA_VERSION, "metrics": rows})
    write_text(folder / "metrics.csv", csv_text(_METRICS, [[r[n] for n in _METRICS] for r in rows]))
    if config:
        write_text(folder / "config.resolved.toml", config)
    stems = safe_names([table.name for table in tables])
    for table in tables:
        keys = ("x", "y", "z", "nx", "ny", "nz", "area")
        columns: list[FloatArray] = [
            np.arange(len(table.rows), dtype=np.float64),
            *(np.asarray(dataset[key].values)[table.rows] for key in keys),
            table.mean_lx,
            *(100.0 * values for values in (table.autonomy, table.continuous, *table.useful)),
            table.exposed_h,
            table.sun_h,
        ]
        names = list(_POINTS)
        if not table.is_level:
            some = [k for k, name in enumerate(names) if name not in _OF_WORK_PLANES]
            names, columns = [names[k] for k in some], [columns[k] for k in some]
        if table.melanopic is not None:
            columns += [table.melanopic[0], 100.0 * table.melanopic[1]]
            names += _MELANOPIC
        if table.name in views:
            columns += view_columns(views[table.name])
            names += VIEW_COLUMNS
        lines = [[f"{value:.9g}" for value in line] for line in zip(*columns, strict=True)]
        write_text(folder / "grids" / f"{stems[table.name]}.csv", csv_text(names, lines))
    settings = dict(dataset.attrs)
    webs = [line.partition(" ") for line in str(settings.pop("photometry", "")).splitlines()]
    record: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": "year",
        "tool": "patchlight",
        "version": tool_version(),
        "libraries": library_versions(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "inputs": inputs,
        "scene": None if scene is None else dict(scene),
        "photometry": [{"path": source, "sha256": sha256} for sha256, _, source in webs],
        "settings": settings,
        "warnings": remarks,
    }
    page = render_year(
        dataset, rows, tables, remarks=remarks, inputs=inputs, scene=surroundings, config=config
    )
    write_text(folder / "report.html", page)
    write_json(folder / "run.json", record)
    return rows
