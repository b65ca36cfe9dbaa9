"""Metrics of a year at every sensor grid, from the dataset of `simulate_year`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray, IntArray

from .autonomy import UDI_NAMES, continuous_autonomy, daylight_autonomy, useful_illuminance
from .en17037 import ORDERS, highest, median_diffuse, provision_by_year
from .green_credits import (
    OPTION_1,
    OPTION_2,
    USES,
    breeam_hours,
    equinox_steps,
    in_range,
    leed_points,
)
from .lm83 import blinds_state, in_state, spatial_autonomy, sunlight_exposure

if TYPE_CHECKING:
    import xarray

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class GridYear:
    """What metrics need of one grid: m points, n steps.

    Attributes
    ----------
    name : str
        Of the grid.
    illuminance : (m, n) array
        With blinds as they are, where the dataset has states. [lx]
    sun : (m, n) array
        Straight from the sun, in the first state. [lx]
    area : (m,) array
        Of each point. [m²]
    state : (n,) int array or None
        Which state holds in each step, by LM-83.
    """

    name: str
    illuminance: FloatArray
    sun: FloatArray
    area: FloatArray
    state: IntArray | None


def grid_years(dataset: xarray.Dataset) -> list[GridYear]:
    """Each grid of a dataset of `simulate_year`, one state chosen in every step.

    Raises
    ------
    InputError
        If it is no such dataset.
    """
    lacking = {"illuminance", "sun_illuminance", "grid", "area", "occupied"} - set(
        dataset.variables
    )
    if lacking:
        raise InputError(f"dataset: lacks {', '.join(sorted(lacking))}: not of simulate_year")
    names = np.asarray(dataset["grid"].values).astype(str)
    out = []
    for name in dict.fromkeys(names.tolist()):
        some = dataset.isel(sensor=np.flatnonzero(names == name))
        light, sun = (
            np.asarray(some[key].values, dtype=np.float64)
            for key in ("illuminance", "sun_illuminance")
        )
        state = None
        if "state" in dataset["illuminance"].dims:
            state = blinds_state(sun)
            light, sun = in_state(light, state), sun[0]
        out.append(GridYear(name, light, sun, np.asarray(some["area"].values), state))
    return out


def year_rows(dataset: xarray.Dataset) -> list[Row]:
    """Metrics of all grids, one row each, with the columns of ``metrics.csv``.

    Those by hours of a whole year are left out of shorter weather.
    """
    occupied = np.asarray(dataset["occupied"].values, dtype=bool)
    sky = np.asarray(dataset["sky_horizontal"].values, dtype=np.float64)
    minutes = int(dataset.attrs["step_minutes"])
    whole = len(sky) * minutes in (365 * 1440, 366 * 1440)
    rows: list[Row] = []
    for grid in grid_years(dataset):
        rows += [_row(grid.name, *one) for one in _by_schedule(grid, occupied)]
        if whole:
            rows += [_row(grid.name, *one) for one in _by_lm83(grid, occupied, minutes / 60.0)]
            rows += [_row(grid.name, *one) for one in _by_year(grid, sky, minutes / 60.0)]
            rows += [_row(grid.name, *one) for one in _by_equinox(grid, dataset, minutes)]
    return rows


def _row(grid: str, quantity: str, value: Any, unit: str) -> Row:
    return {
        "id": f"{grid}.{quantity}",
        "quantity": quantity,
        "sensor_id": grid,
        "value": value,
        "unit": unit,
    }


def _by_schedule(grid: GridYear, occupied: NDArray[np.bool_]) -> list[tuple[str, Any, str]]:
    light, area = grid.illuminance, grid.area
    share = area / area.sum()
    found: list[tuple[str, Any, str]] = [
        ("DA300_mean_pct", 100.0 * float(share @ daylight_autonomy(light, occupied)), "%"),
        ("cDA300_mean_pct", 100.0 * float(share @ continuous_autonomy(light, occupied)), "%"),
    ]
    for name, values in zip(UDI_NAMES, useful_illuminance(light, occupied), strict=True):
        key = f"UDI_{name.replace(' ', '_')}_mean_pct"
        found.append((key, 100.0 * float(share @ values), "%"))
    if grid.state is not None:
        changed = 100.0 * float((grid.state[occupied] > 0).mean())
        found.append(("blinds_not_in_first_state_pct", changed, "% of hours"))
    return found


def _by_lm83(
    grid: GridYear, occupied: NDArray[np.bool_], step_h: float
) -> list[tuple[str, Any, str]]:
    light, area = grid.illuminance, grid.area
    sda = spatial_autonomy(light, area, occupied)
    ase = sunlight_exposure(grid.sun, area, occupied, step_h)
    return [
        ("sDA300_50_pct", 100.0 * sda, "% of area"),
        ("ASE1000_250h_pct", 100.0 * ase, "% of area"),
        ("LEED_option_1_points", leed_points(sda, OPTION_1), ""),
    ]


def _by_year(grid: GridYear, sky: FloatArray, step_h: float) -> list[tuple[str, Any, str]]:
    light, area = grid.illuminance, grid.area
    found: list[tuple[str, Any, str]] = [
        (
            "light_exposure_klx_h",
            1e-3 * step_h * float((area / area.sum()) @ light.sum(axis=1)),
            "klx h",
        ),
        ("EN17037_median_diffuse_lx", median_diffuse(sky, step_h), "lx"),
    ]
    for order in ORDERS:
        provision = provision_by_year(light, area, sky, step_h, order=order)
        key = f"EN17037_{order.replace('-', '_')}"
        found.append((f"{key}_level", highest(provision) or "none", ""))
        unit = "% of daylight hours" if order == ORDERS[0] else "% of area"
        for one in provision:
            found.append((f"{key}_{one.level}_target_pct", 100.0 * one.target, unit))
            found.append((f"{key}_{one.level}_minimum_pct", 100.0 * one.minimum, unit))
    for use, asked in USES.items():
        mean, least, enough = breeam_hours(light, area, step_h, asked)
        found.append((f"BREEAM_{use}_mean_h", mean, "h"))
        found.append((f"BREEAM_{use}_least_h", least, "h"))
        found.append((f"BREEAM_{use}", "met" if enough else "not met", ""))
    return found


def _by_equinox(
    grid: GridYear, dataset: xarray.Dataset, minutes: int
) -> list[tuple[str, Any, str]]:
    clock = np.asarray(dataset["clock"].values)
    steps = equinox_steps(clock, np.asarray(dataset["sun_normal"].values), minutes)
    # Of each hour the mean of both days.
    light = grid.illuminance[:, steps].mean(axis=1)
    share = in_range(light, grid.area)
    return [
        ("LEED_option_2_pct", 100.0 * share, "% of area"),
        ("LEED_option_2_points", leed_points(share, OPTION_2), ""),
    ]
