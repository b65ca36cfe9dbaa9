"""The page of a year: metrics with what their light may be off by, and maps of the grids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import SceneData, SensorResult

from . import figures, formats
from .autonomy import UDI_LX, UDI_NAMES
from .levels import Scale
from .lm83 import SDA_LX, SDA_SHARE
from .plan import plan_figure
from .report import environment
from .run_files import library_versions, tool_version
from .section import patch_triangles
from .year_names import metric_name
from .year_tables import GridTable, light_errors

if TYPE_CHECKING:
    import xarray

Row = dict[str, Any]
#: Classes of maps of shares. [%]
_SHARES = np.array([0.0, 10.0, 25.0, 50.0, 75.0, 90.0, 100.0])
#: Of these a grid's first line tells, in words.
_FIRST = {
    "sDA300_50_pct": "sDA300/50 %",
    "ASE1000_250h_pct": "ASE1000,250h",
    "DA300_mean_pct": "DA300, mean",
    f"UDI_{UDI_NAMES[2]}_mean_pct": f"UDI {UDI_LX[1]:g} to {UDI_LX[2]:g} lx, mean",
    "DF_mean_pct": "DF, mean",
}


def render_year(
    dataset: xarray.Dataset,
    rows: Sequence[Row],
    tables: Sequence[GridTable],
    *,
    remarks: Sequence[str] = (),
    inputs: Sequence[Mapping[str, str]] = (),
    scene: SceneData | None = None,
    config: str = "",
) -> str:
    """HTML of the whole page.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    rows : sequence of dict
        Of `year_rows`.
    tables : sequence of GridTable
        Of its grids.
    remarks : sequence of str
        What is to be known besides.
    inputs : sequence of dict
        ``path`` and ``sha256`` of the files that were used.
    scene : SceneData, optional
        Walls and outlines of the maps are its.
    config : str
        Resolved scene file (TOML), shown.
    """
    attrs = dict(dataset.attrs)
    errors = light_errors(dataset)
    triangles = np.zeros((0, 3, 3)) if scene is None else patch_triangles(scene.patches)
    outlines = {} if scene is None else {grid.name: grid.outline for grid in scene.sensors}
    north = 0.0 if scene is None else scene.north_deg
    names = list(dict.fromkeys(row["sensor_id"] for row in rows))
    by_name = {table.name: table for table in tables}
    grids = []
    for index, name in enumerate(names):
        own = [row for row in rows if row["sensor_id"] == name]
        found = {row["quantity"]: row for row in own}
        table = by_name.get(name)
        grids.append(
            {
                "name": name,
                "first": [_told(found[key]) if key in found else "–" for key in _FIRST],
                "rows": [
                    {"key": row["quantity"], "name": metric_name(row["quantity"]),
                     "value": _value(row), "range": _range(row), "unit": row["unit"]}
                    for row in own
                ],
                "maps": [] if table is None else _maps(
                    dataset, table, outlines.get(name, ()), triangles, north, index
                ),
                "error": "" if table is None or errors is None else formats.percent(
                    float(np.quantile(errors[0, table.rows], 0.95))
                ),
            }
        )  # fmt: skip
    context = {
        "title": attrs.get("title") or "A year of daylight",
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "version": tool_version(),
        "place": attrs.get("place", ""),
        "converged": bool(attrs.get("converged", 1)),
        "accuracy": attrs.get("accuracy"),
        "steps": int(dataset.sizes["time"]),
        "has_errors": errors is not None,
        "first": list(_FIRST.values()),
        "remarks": list(remarks),
        "grids": grids,
        "settings": [
            (key.replace("_", " "), formats.setting(formats.plain(value)))
            for key, value in attrs.items()
            if key not in ("remarks", "photometry", "title") and value != ""
        ],
        "inputs": list(inputs),
        "libraries": library_versions(),
        "config": config,
    }
    return str(environment().get_template("year.html").render(context))


def _value(row: Row) -> str:
    value = row["value"]
    return formats.number(float(value)) if isinstance(value, (int, float)) else str(value)


def _range(row: Row) -> str:
    """What the value may be, by the stated errors; empty where it is one value or none is told."""
    low, high = row["low"], row["high"]
    if low is None or high is None:
        return ""
    if isinstance(low, str):
        return "" if low == high else f"{low} to {high}"
    ends = formats.number(float(low)), formats.number(float(high))
    return "" if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def _told(row: Row) -> str:
    unit = "%" if str(row["unit"]).startswith("%") else row["unit"]
    more = _range(row)
    return f"{_value(row)} {unit}" + (f" ({more})" if more else "")


def _maps(
    dataset: xarray.Dataset,
    table: GridTable,
    outline: Sequence[NDArray[np.float64]],
    triangles: NDArray[np.float64],
    north_deg: float,
    index: int,
) -> list[dict[str, Any]]:
    """Plans of a level grid: daylight autonomy, and useful illuminance."""
    from markupsafe import Markup

    if not table.is_level:
        return []

    half, (_, low, high) = 100.0 * SDA_SHARE, UDI_LX
    shares = {
        "DA300 [%]": (
            table.autonomy,
            f"Daylight autonomy: share of the hours of use with at least {SDA_LX:g} lx. The area "
            f"from {half:g} % on is that of sDA.",
        ),
        "UDI [%]": (
            table.useful[2],
            f"Useful daylight illuminance: share of the hours of use with {low:g} to {high:g} lx.",
        ),
    }
    axes = ("x", "y", "z"), ("nx", "ny", "nz")
    if any(key not in dataset.variables for keys in axes for key in keys):
        return []
    points, normals = (
        np.stack([np.asarray(dataset[key].values)[table.rows] for key in keys], axis=1)
        for keys in axes
    )
    out = []
    for k, (quantity, (share, caption)) in enumerate(shares.items()):
        if not np.isfinite(share).all():
            continue
        grid = SensorResult(
            table.name, points, normals, table.area, 100.0 * share, np.zeros(len(share)), {},
            outline=tuple(outline),
        )  # fmt: skip
        with figures.look():
            figure, how = plan_figure(
                grid, triangles, north_deg=north_deg, quantity=quantity, scale=Scale(_SHARES)
            )
            svg = figures.svg(figure, prefix=f"map{index}-{k}")
        out.append({"plan": Markup(svg), "caption": f"{caption} {how}."})
    return out
