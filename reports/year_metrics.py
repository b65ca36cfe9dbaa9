"""Metrics of a year at every sensor grid, from the dataset of `simulate_year`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .autonomy import UDI_NAMES
from .en17037 import ORDERS, Provision, highest, median_diffuse, provision_by_factor
from .green_credits import (
    ASE_TOLD,
    OPTION_1,
    OPTION_2,
    USES,
    average_share,
    in_range,
    leed_points,
)
from .lm83 import spatial_autonomy, sunlight_exposure
from .sunlight import sunlight_level
from .year_tables import (
    GridTable,
    grid_tables,
    has_lm83_hours,
    is_whole_year,
    light_errors,
    sunlight_key,
    window_groups,
)

if TYPE_CHECKING:
    import xarray

Row = dict[str, Any]
_Found = list[tuple[str, Any, str]]
#: What stands for the grid in rows of all that are level together.
LEVEL_GRIDS = "level grids"


def year_rows(dataset: xarray.Dataset, tables: list[GridTable] | None = None) -> list[Row]:
    """Metrics of all grids, one row each, with the columns of ``metrics.csv``.

    ``low`` and ``high`` are the least and most that a metric comes to if all light is less or more
    by its stated error, see `light_errors`: both are the value of what only the sun's disc makes,
    and None where the dataset tells no errors.

    Those by hours of a whole year are left out of shorter weather, and those of LM-83 where the
    building is not used in its hours. Of grids that do not face up, such as those of eyes or walls,
    illuminance, melanopic or not, and hours of sun are told, but nothing that is defined on a work
    plane: see `year_remarks`. Level grids have some together, as LEED adds rooms up, where there
    are several.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    tables : list of GridTable, optional
        Of its grids, where they are known already.
    """
    rows = _rows(dataset, grid_tables(dataset) if tables is None else tables)
    errors = light_errors(dataset)
    if errors is None:
        return [{**row, "low": None, "high": None} for row in rows]
    less, more = (
        _rows(dataset, grid_tables(dataset, np.maximum(1.0 + sign * errors, 0.0)))
        for sign in (-1.0, 1.0)
    )
    for row, *others in zip(rows, less, more, strict=True):
        ends = [row["value"], *(other["value"] for other in others)]
        # Levels in words go up with the light; shares of hours in a range may go either way.
        words = isinstance(row["value"], str)
        row["low"], row["high"] = ends[1:] if words else (min(ends), max(ends))
    return rows


def _rows(dataset: xarray.Dataset, tables: list[GridTable]) -> list[Row]:
    """The same without ``low`` and ``high``."""
    whole = is_whole_year(dataset)
    by_lm83 = whole and has_lm83_hours(dataset)
    rows: list[Row] = []
    for table in tables:
        found = _by_schedule(table, dataset)
        if table.is_level:
            found[1:1] = _autonomies(table)
        found += _by_day(table, dataset)
        if whole:
            found += _by_lm83(table) if by_lm83 and table.is_level else []
            found += _by_year(table)
            found += [*_provisions(table, dataset), *_by_equinox(table)] if table.is_level else []
        rows += [_row(table.name, *one) for one in found]
    level = [table for table in tables if table.is_level]
    if by_lm83 and len(level) > 1:
        rows += [_row(LEVEL_GRIDS, *one) for one in _together(level)]
    return rows


def _row(grid: str, quantity: str, value: Any, unit: str) -> Row:
    return {
        "id": f"{grid}.{quantity}",
        "quantity": quantity,
        "sensor_id": grid,
        "value": value,
        "unit": unit,
    }


def _by_schedule(table: GridTable, dataset: xarray.Dataset) -> _Found:
    share = table.area / table.area.sum()
    occupied = np.asarray(dataset["occupied"].values, dtype=bool)
    found: _Found = [("E_mean_lx", float(share @ table.mean_lx), "lx")]
    if table.states is not None:
        changed = 100.0 * float((table.states[:, occupied] > 0).any(axis=0).mean())
        found.append(("blinds_not_in_first_state_pct", changed, "% of hours"))
        if len(table.states) > 1:
            groups = dict.fromkeys(name for name in window_groups(dataset) if name)
            for name, states in zip(groups, table.states, strict=True):
                own = 100.0 * float((states[occupied] > 0).mean())
                found.append((f"blinds_{name}_not_in_first_state_pct", own, "% of hours"))
    if table.with_lamps_lx is not None:
        found.append(("E_mean_with_electric_lx", float(share @ table.with_lamps_lx), "lx"))
        step_h = float(dataset.attrs["step_minutes"]) / 60.0
        lamps, on = dataset["lamps"].values, dataset["electric_on"].values
        for group, burns in zip(lamps, on, strict=True):
            found.append((f"electric_{group}_h", step_h * float(burns.sum()), "h"))
    for more, values in (("", table.melanopic), ("_with_electric", table.melanopic_with_lamps)):
        if values is not None:
            mean, enough = (float(share @ part) for part in values)
            found.append((f"EDI_mean{more}_lx", mean, "lx"))
            found.append((f"EDI250_mean{more}_pct", 100.0 * enough, "% of hours"))
    return found


def _autonomies(table: GridTable) -> _Found:
    """Means over the area of what each point of a work plane gets in the hours of use."""
    share = table.area / table.area.sum()
    found: _Found = [
        ("DA300_mean_pct", 100.0 * float(share @ table.autonomy), "% of hours"),
        ("cDA300_mean_pct", 100.0 * float(share @ table.continuous), "%"),
    ]
    for name, values in zip(UDI_NAMES, table.useful, strict=True):
        key = f"UDI_{name.replace(' ', '_')}_mean_pct"
        found.append((key, 100.0 * float(share @ values), "% of hours"))
    return found


def _by_day(table: GridTable, dataset: xarray.Dataset) -> _Found:
    """Exposure to sunlight by EN 17037, of a day in its season, at the sunniest point."""
    if "sunlight_hours" not in dataset:
        return []
    day = str(dataset.attrs["sun_day"])
    hours = _of_first_state(dataset, "sunlight_hours", table)
    most = float(hours.max())
    key = f"sunlight_{day}"
    found: _Found = [
        (f"{key}_mean_h", float(table.area @ hours / table.area.sum()), "h"),
        (f"{key}_most_h", most, "h"),
    ]
    if (level := sunlight_key(dataset)) is not None:
        found.append((level, sunlight_level(most) or "none", ""))
    return found


def _by_lm83(table: GridTable) -> _Found:
    sda = spatial_autonomy(table.autonomy, table.area)
    ase = sunlight_exposure(table.exposed_h, table.area)
    return [
        ("sDA300_50_pct", 100.0 * sda, "% of area"),
        ("ASE1000_250h_pct", 100.0 * ase, "% of area"),
        ("LEED_option_1_points", leed_points(sda, OPTION_1), ""),
        ("LEED_option_1_sun_to_be_explained", "yes" if ase > ASE_TOLD else "no", ""),
    ]


def _by_year(table: GridTable) -> _Found:
    exposure = 1e-3 * float(table.area @ table.exposure_lx_h / table.area.sum())
    return [("light_exposure_klx_h", exposure, "klx h")]


def _provisions(table: GridTable, dataset: xarray.Dataset) -> _Found:
    """Daylight provision by EN 17037 and BREEAM of a work plane."""
    sky = np.asarray(dataset["sky_horizontal"].values, dtype=np.float64)
    step_h = float(dataset.attrs["step_minutes"]) / 60.0
    median = median_diffuse(sky, step_h)
    found: _Found = [("EN17037_median_diffuse_lx", median, "lx")]
    if "daylight_factor" in dataset and median > 0.0:
        factor = table.factor * _of_first_state(dataset, "daylight_factor", table)
        mean = float(table.area @ factor / table.area.sum())
        found.append(("DF_mean_pct", 100.0 * mean, "%"))
        provision = provision_by_factor(factor, table.area, median)
        found += _of_levels("EN17037_by_factor", provision, "% of area")
    for order in ORDERS:
        unit = "% of daylight hours" if order == ORDERS[0] else "% of area"
        key = f"EN17037_{order.replace('-', '_')}"
        found += _of_levels(key, table.provision.levels(order), unit)
    for name, use in USES.items():
        climate = table.climate.of(use)
        found.append((f"BREEAM_{name}_mean_h", climate.mean_h, "h"))
        found.append((f"BREEAM_{name}_least_h", climate.least_h, "h"))
        found.append((f"BREEAM_{name}_least_pct", 100.0 * climate.share, "% of area"))
        found.append((f"BREEAM_{name}", "met" if climate.met else "not met", ""))
    return found


def _of_levels(key: str, provision: list[Provision], unit: str) -> _Found:
    found: _Found = [(f"{key}_level", highest(provision) or "none", "")]
    for one in provision:
        found.append((f"{key}_{one.level}_target_pct", 100.0 * one.target, unit))
        found.append((f"{key}_{one.level}_minimum_pct", 100.0 * one.minimum, unit))
    return found


def _by_equinox(table: GridTable) -> _Found:
    if table.equinox_lx is None:
        return []
    share = in_range(table.equinox_lx, table.area)
    return [
        ("LEED_option_2_pct", 100.0 * share, "% of area"),
        ("LEED_option_2_points", leed_points(share, OPTION_2), ""),
    ]


def _together(tables: list[GridTable]) -> _Found:
    """LEED's first option, by the mean of some grids."""
    areas = np.array([table.area.sum() for table in tables])
    shares = np.array([spatial_autonomy(table.autonomy, table.area) for table in tables])
    sda = average_share(shares, areas)
    return [
        ("sDA300_50_pct", 100.0 * sda, "% of area"),
        ("LEED_option_1_points", leed_points(sda, OPTION_1), ""),
    ]


def _of_first_state(dataset: xarray.Dataset, name: str, table: GridTable) -> np.ndarray:
    """Values (m,) of the points of a grid; of scenes with states in the first one."""
    values = np.asarray(dataset[name].values, dtype=np.float64)
    return (values if values.ndim == 1 else values[0])[table.rows]
