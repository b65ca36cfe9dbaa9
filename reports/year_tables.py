"""What metrics need of a year, point by point and step by step, from blocks of sensors.

Light of all sensors in all steps may be more than memory holds: some sensors are read at a time,
and only what does not grow with the steps is kept of them, or not with the sensors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.local_time import is_occupied
from patchlight.solver.model import weather
from patchlight.solver.model.arrays import FloatArray, IntArray

from .autonomy import continuous_autonomy, daylight_autonomy, useful_illuminance
from .en17037 import YearProvision
from .green_credits import ClimateHours, equinox_steps
from .lm83 import LM83_HOURS, blinds_states, exposed_hours, exposed_points, group_rows, in_states
from .melanopic import melanopic
from .sunlight import is_in_season, sunlight_hours

if TYPE_CHECKING:
    import xarray

#: Sensors read at a time: those of a chunk of the file.
BLOCK = 64
_NEEDED = {"illuminance", "sun_illuminance", "grid", "area", "nz", "clock", "occupied"}
#: Cosine of the tilt up to which a grid is level and faces up: half a degree.
_LEVEL = np.cos(np.radians(0.5))


@dataclass(slots=True, eq=False)
class GridTable:
    """One grid of m points in n steps.

    Attributes
    ----------
    name : str
        Of the grid.
    rows : (m,) int array
        Its sensors in the dataset.
    area : (m,) array
        Of each point. [m²]
    is_level : bool
        Whether all points face up.
    factor : (m,) array
        What light was multiplied with before anything was told of it; see `grid_tables`.
    states : (g, n) int array or None
        State of each window group in each step, by LM-83, where there are some.
    mean_lx, autonomy, continuous : (m,) array
        Over the steps in which the building is used: mean, DA300, cDA300.
    useful : (4, m) array
        Shares of these steps in the bins of useful daylight illuminance.
    exposed_h, sun_h : (m,) array
        Hours of use with more than 1000 lx straight from the sun, and of sun in the year, with
        blinds open. [h]
    exposure_lx_h : (m,) array
        Sum over all steps. [lx h]
    equinox_lx : (m, 2) array or None
        At 9 h and 15 h of clear days of the equinoxes, with blinds open; see `equinox_steps`.
    with_lamps_lx : (m,) array or None
        As ``mean_lx``, electric light included.
    melanopic, melanopic_with_lamps : (2, m) array or None
        Mean melanopic EDI over these steps [lx], and share of them in which it is enough, see
        `melanopic`; of daylight, and with electric light.
    provision : YearProvision
        Levels of EN 17037.
    climate : ClimateHours
        Hours of BREEAM.
    """

    name: str
    rows: IntArray
    area: FloatArray
    is_level: bool
    factor: FloatArray
    states: IntArray | None
    provision: YearProvision
    climate: ClimateHours
    mean_lx: FloatArray = field(init=False)
    autonomy: FloatArray = field(init=False)
    continuous: FloatArray = field(init=False)
    useful: FloatArray = field(init=False)
    exposed_h: FloatArray = field(init=False)
    sun_h: FloatArray = field(init=False)
    exposure_lx_h: FloatArray = field(init=False)
    equinox_lx: FloatArray | None = None
    with_lamps_lx: FloatArray | None = None
    melanopic: FloatArray | None = None
    melanopic_with_lamps: FloatArray | None = None


def light_errors(dataset: xarray.Dataset) -> FloatArray | None:
    """What light (k, m) of m sensors may be off by in k states, relative; None where none is told.

    That is the stated error of the even sky, and twice the root mean square of what the sun makes
    of indirect light is off by, which do not know of each other.
    """
    if "relative_error" not in dataset:
        return None
    stated = np.asarray(dataset["relative_error"].values, dtype=np.float64)
    return np.hypot(
        np.atleast_2d(stated), 2.0 * float(dataset.attrs.get("sun_indirect_error", 0.0))
    )


def grid_tables(dataset: xarray.Dataset, factor: FloatArray | None = None) -> list[GridTable]:
    """Each grid of a dataset of `simulate_year`, blinds being as they are in every step.

    Parameters
    ----------
    dataset : Dataset
        Of `simulate_year`.
    factor : (k, m) array, optional
        What the light of each sensor in each state is multiplied with, to know what its error
        makes of metrics.
        What comes straight from the sun, whose disc is exact, and from lamps stays as it is.

    Raises
    ------
    InputError
        If it is no such dataset.
    """
    lacking = _NEEDED - set(dataset.variables)
    if lacking:
        raise InputError(f"dataset: lacks {', '.join(sorted(lacking))}: not of simulate_year")
    names = np.asarray(dataset["grid"].values).astype(str)
    factors = np.ones((1, len(names))) if factor is None else np.asarray(factor)
    return [
        _table(dataset, name, np.flatnonzero(names == name), is_level, factors)
        for name, is_level in level_grids(dataset).items()
    ]


def level_grids(dataset: xarray.Dataset) -> dict[str, bool]:
    """Whether all points of each grid face up, by name."""
    names = np.asarray(dataset["grid"].values).astype(str)
    up = np.asarray(dataset["nz"].values) >= _LEVEL
    return {name: bool(up[names == name].all()) for name in dict.fromkeys(names.tolist())}


def window_groups(dataset: xarray.Dataset) -> list[str]:
    """Window group that is not in its first state, of each state of the dataset."""
    if "window_group" not in dataset.coords:
        return [""] * dataset.sizes["state"]
    return [str(name) for name in dataset["window_group"].values]


def is_whole_year(dataset: xarray.Dataset) -> bool:
    """Whether the steps of a dataset make a year, as `Weather.whole_year` has it."""
    return weather.is_whole_year(dataset.sizes["time"], int(dataset.attrs["step_minutes"]))


def has_lm83_hours(dataset: xarray.Dataset) -> bool:
    """Whether the building is used in the hours of LM-83, and in no others."""
    clock = np.asarray(dataset["clock"].values).astype("datetime64[m]")
    own = is_occupied(clock, LM83_HOURS, int(dataset.attrs["step_minutes"]))
    return bool(np.array_equal(own, np.asarray(dataset["occupied"].values, dtype=bool)))


def sunlight_key(dataset: xarray.Dataset) -> str | None:
    """Quantity of the level of sunlight by EN 17037; None where it is not told.

    That is where there are no hours of sun, or those of a day out of season.
    """
    if "sunlight_hours" not in dataset:
        return None
    day = str(dataset.attrs["sun_day"])
    year = str(np.asarray(dataset["time"].values)[0].astype("datetime64[Y]"))
    in_season = is_in_season(np.array([f"{year}-{day}"], "datetime64[D]"))[0]
    return f"EN17037_sunlight_{day}_level" if in_season else None


def _table(
    dataset: xarray.Dataset, name: str, rows: IntArray, is_level: bool, factors: FloatArray
) -> GridTable:
    occupied = np.asarray(dataset["occupied"].values, dtype=bool)
    minutes = int(dataset.attrs["step_minutes"])
    step_h = minutes / 60.0
    sky, sun_normal = (
        np.asarray(dataset[key].values, dtype=np.float64)
        for key in ("sky_horizontal", "sun_normal")
    )
    equinox = None
    if is_whole_year(dataset):
        equinox = equinox_steps(np.asarray(dataset["clock"].values), sun_normal, minutes)
    table = GridTable(
        name,
        rows,
        np.asarray(dataset["area"].values, dtype=np.float64)[rows],
        is_level,
        factors[0, rows],
        _states(dataset, rows),
        YearProvision(sky, step_h),
        ClimateHours(step_h),
    )
    parts: dict[str, list[FloatArray]] = {}
    for some in _blocks(rows):
        told, sun = _light(dataset, some)
        values = told
        if (factors[:, some] != 1.0).any():
            values = sun + (values - sun) * factors[:, some, None].astype(values.dtype)
        light = values[0] if table.states is None else in_states(values, table.states)
        area = table.area[np.searchsorted(rows, some)]
        found = {
            "mean_lx": _mean(light, occupied),
            "autonomy": daylight_autonomy(light, occupied),
            "continuous": continuous_autonomy(light, occupied),
            "useful": useful_illuminance(light, occupied),
            "exposed_h": exposed_hours(sun[0], occupied, step_h),
            "sun_h": sunlight_hours(sun[0], sun_normal, step_h),
            "exposure_lx_h": step_h * light.sum(axis=1, dtype=np.float64),
        }
        if equinox is not None:
            # Of each hour the mean of both days, last axis the hour; no blinds, see LEED.
            found["equinox_lx"] = values[0][:, equinox].mean(axis=1).T
        if "electric_on" in dataset:
            lamps = _electric(dataset, "electric_illuminance", some, table.states)
            found["with_lamps_lx"] = _mean(light + lamps, occupied)
        if "melanopic_edi" in dataset:
            # Light that is more or less has the same colour.
            change = np.divide(values, told, out=np.ones_like(told), where=told > 0.0)
            edi = change * _values(dataset, "melanopic_edi", some)
            own = edi[0] if table.states is None else in_states(edi, table.states)
            found["melanopic"] = melanopic(own, occupied)
            if "electric_on" in dataset:
                own = own + _electric(dataset, "electric_melanopic_edi", some, table.states)
                found["melanopic_with_lamps"] = melanopic(own, occupied)
        table.provision.add(light, area)
        table.climate.add(light, area)
        for key, value in found.items():
            parts.setdefault(key, []).append(value)
    for key, values_of in parts.items():
        setattr(table, key, np.concatenate(values_of, axis=-1))
    if table.equinox_lx is not None:
        table.equinox_lx = table.equinox_lx.T
    return table


def _blocks(rows: IntArray) -> Iterator[IntArray]:
    for start in range(0, len(rows), BLOCK):
        yield rows[start : start + BLOCK]


def _light(dataset: xarray.Dataset, some: IntArray) -> tuple[FloatArray, FloatArray]:
    """Light, and that straight from the sun, (k, m, n) of some sensors in k states. [lx]"""
    light, sun = (_values(dataset, key, some) for key in ("illuminance", "sun_illuminance"))
    return light, sun


def _values(dataset: xarray.Dataset, name: str, some: IntArray) -> FloatArray:
    """One variable (k, m, n) of some sensors in k states."""
    # As a slice, which files are read by much faster; grids lie one after the other.
    whole = len(some) == some[-1] - some[0] + 1
    block = dataset[name].isel(sensor=slice(some[0], some[-1] + 1) if whole else some)
    values = np.asarray(block.values)
    return values if values.ndim == 3 else values[None]


def _states(dataset: xarray.Dataset, rows: IntArray) -> IntArray | None:
    """State of each window group in each step, by the sun at the points ``rows``; None of one."""
    if "state" not in dataset["illuminance"].dims:
        return None
    names = window_groups(dataset)
    groups = group_rows(names)
    exposed = [np.zeros((len(own), dataset.sizes["time"]), dtype=np.int64) for own in groups]
    for some in _blocks(rows):
        for total, found in zip(
            exposed, exposed_points(_light(dataset, some)[1], names), strict=True
        ):
            total += found
    return blinds_states(exposed, len(rows), groups)


def _electric(
    dataset: xarray.Dataset, name: str, some: IntArray, states: IntArray | None
) -> FloatArray:
    """Electric light (m, n) of some sensors in each step, as one variable tells it. [lx]"""
    lux = np.asarray(dataset[name].isel(sensor=some).values)
    on = np.asarray(dataset["electric_on"].values, dtype=np.float64)
    if states is None:
        return np.asarray(lux.T @ on)
    return in_states(np.stack([one.T @ on for one in lux]), states)


def _mean(light: FloatArray, counted: NDArray[np.bool_]) -> FloatArray:
    """Mean (m,) over the steps that count; not a number where none does."""
    if not counted.any():
        return np.full(len(light), np.nan)
    return np.asarray(light[:, counted].mean(axis=1, dtype=np.float64))
