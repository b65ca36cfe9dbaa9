"""What a year's dataset holds besides the light of its steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.local_time import is_occupied
from patchlight.solver.model import SceneData, Weather

from .states import Setting
from .year_fill import EDI, LUX, Filled

if TYPE_CHECKING:
    import xarray
    from patchlight.solver.sky_series import SkySeries

#: Schedule of lamps that always burn.
ALWAYS = "always"
_LX, _DEG = {"units": "lx"}, {"units": "degree"}
_OF_LAMPS = {
    LUX: ("electric_illuminance", "electric light"),
    EDI: ("electric_melanopic_edi", "melanopic EDI of electric light"),
}


@dataclass(frozen=True, slots=True, eq=False)
class YearParts:
    """What the year is of: one scene, n steps.

    Attributes
    ----------
    scene : SceneData
        With the sensors.
    weather, skies : Weather, SkySeries
        Of the steps.
    clock : (n,) array of datetime64
        What clocks show when each step begins.
    occupied : (n,) bool array
        Whether the building is used.
    burns : dict of (n,) bool arrays
        When each group of lamps burns.
    settings : list of Setting
        What the scene is solved in; none where it has no states.
    """

    scene: SceneData
    weather: Weather
    skies: SkySeries
    clock: NDArray[np.datetime64]
    occupied: NDArray[np.bool_]
    burns: dict[str, NDArray[np.bool_]]
    settings: list[Setting]


def small_dataset(parts: YearParts, filled: Filled) -> tuple[xarray.Dataset, tuple[str, ...]]:
    """Coordinates, what there is outside, and what is told of each sensor; and the dimensions."""
    import xarray as xr
    from patchlight.solver.sun_day import STEP_MIN

    data, weather, skies = parts.scene, parts.weather, parts.skies
    points = np.concatenate([grid.points for grid in data.sensors])
    normals = np.concatenate([grid.normals for grid in data.sensors])
    counts = [len(grid) for grid in data.sensors]
    place = {"units": "m"}
    coords: dict[str, Any] = {
        "time": ("time", weather.starts.astype("datetime64[ns]"), {"long_name": "begin of step"}),
        "grid": ("sensor", np.repeat([grid.name for grid in data.sensors], counts).astype(object)),
        "point": ("sensor", np.concatenate([np.arange(count) for count in counts])),
        **{axis: ("sensor", points[:, k], place) for k, axis in enumerate("xyz")},
        **{f"n{axis}": ("sensor", normals[:, k]) for k, axis in enumerate("xyz")},
        "area": (
            "sensor", np.concatenate([grid.area_m2 for grid in data.sensors]), {"units": "m2"},
        ),
        "clock": ("time", parts.clock.astype("datetime64[ns]")),
        "time_utc": ("time", weather.middles_utc.astype("datetime64[ns]")),
        "occupied": ("time", parts.occupied),
    }  # fmt: skip
    stacked = bool(parts.settings)
    of_sensor: tuple[str, ...] = ("state", "sensor") if stacked else ("sensor",)
    which: Any = slice(None) if stacked else 0
    if stacked:
        coords["state"] = ("state", np.array([s.name for s in parts.settings], dtype=object))
        coords["window_group"] = (
            "state", np.array([s.group for s in parts.settings], dtype=object),
            {"long_name": "group that is not in its first state"},
        )  # fmt: skip
    variables: dict[str, Any] = {
        "sky_horizontal": ("time", skies.sky_lx, {**_LX, "long_name": "unobstructed sky"}),
        "sun_normal": ("time", skies.sun_normal_lx, {**_LX, "long_name": "sun, plane facing it"}),
        "sun_altitude": ("time", skies.altitude_deg, _DEG),
        "sun_azimuth": ("time", skies.azimuth_deg, {**_DEG, "long_name": "clockwise from north"}),
        "daylight_factor": (
            of_sensor, filled.points["daylight_factor"][which],
            {"units": "1", "long_name": "under the overcast sky of CIE type 16"},
        ),
        "sunlight_hours": (
            of_sensor, filled.points["sunlight_hours"][which],
            {"units": "h", "long_name": "sun on a day without clouds", "step_minutes": STEP_MIN},
        ),
    }  # fmt: skip
    variables["relative_error"] = (
        of_sensor, filled.points["relative_error"][which],
        {"units": "1", "long_name": "stated error of the light of an even sky, relative to it"},
    )  # fmt: skip
    if parts.burns:
        coords["lamps"] = ("lamps", np.array(list(parts.burns), dtype=object))
        dims = ("state", "lamps", "sensor") if stacked else ("lamps", "sensor")
        for key, (name, what) in _OF_LAMPS.items():
            if key in filled.electric:
                told = {**_LX, "long_name": what}
                variables[name] = dims, filled.electric[key][which], told
        on = np.stack(list(parts.burns.values()))
        variables["electric_on"] = ("lamps", "time"), on, {"long_name": "whether lamps burn"}
    return xr.Dataset(variables, coords=coords), (*of_sensor, "time")


def electric_schedules(
    electric: Mapping[str, str] | None,
    scenes: Iterable[SceneData],
    clock: NDArray[np.datetime64],
    step_minutes: int,
) -> dict[str, NDArray[np.bool_]]:
    """When each group of lamps burns (n,), given its schedule or `ALWAYS`.

    Raises
    ------
    InputError
        For groups that no lamp is in, and schedules that are none.
    """
    have = list(dict.fromkeys(lamp.group for data in scenes for lamp in data.luminaires))
    out = {}
    for group, when in (electric or {}).items():
        if group not in have:
            groups = ", ".join(have) or "none"
            raise InputError(f"electric: no lamps in a light group {group!r}; groups: {groups}")
        if when == ALWAYS:
            out[group] = np.ones(len(clock), dtype=bool)
            continue
        try:
            out[group] = is_occupied(clock, when, step_minutes)
        except InputError as error:
            raise InputError(f"electric: {group}: {error}, or {ALWAYS!r}") from None
    return out


def photometry_lines(scenes: Iterable[SceneData], burning: Iterable[str]) -> list[str]:
    """Hash and name of the photometric files of groups of lamps that burn, each once."""
    groups = set(burning)
    webs = [
        lamp.web.photometry
        for data in scenes
        for lamp in data.luminaires
        if lamp.web is not None and lamp.group in groups
    ]
    return list(dict.fromkeys(f"{web.sha256} {web.source}" for web in webs if web.sha256))
