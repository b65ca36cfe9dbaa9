"""One call from a scene and a weather file to the light of a year."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.effort import check_effort
from patchlight.solver.errors import GeometryError, InputError
from patchlight.solver.model import SceneData, Weather
from patchlight.solver.model.arrays import FloatArray

from .remarks import NO_LIGHT
from .scene import Scene
from .simulation import announce_kernels
from .year_store import Block, YearStore, key_of

if TYPE_CHECKING:
    import xarray
    from patchlight.solver.coefficients import Coefficients
    from patchlight.solver.sky_series import SkySeries

Progress = Callable[[str, int, int], None]
#: Steps of a block: a month of hours.
BLOCK = 744
#: Version of what is stored.
SCHEMA_VERSION = 1
#: Difference in latitude or longitude of scene and station that is told. [deg]
FAR_DEG = 1.0
_LX = {"units": "lx"}
VARIABLES: dict[str, dict[str, Any]] = {
    "illuminance": {**_LX, "long_name": "illuminance of sky, sun and ground"},
    "sun_illuminance": {**_LX, "long_name": "illuminance straight from the disc of the sun"},
}


def simulate_year(
    scene: Scene | SceneData,
    weather: Weather | str | os.PathLike[str],
    *,
    sensors: str | Iterable[str] | None = None,
    accuracy: float = 0.02,
    schedule: str = "08:00-18:00",
    step_minutes: int | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
) -> xarray.Dataset:
    """Daylight at the sensors of ``scene`` in every step of a weather file.

    Skies are Perez' from the irradiances of the file, the disc of the sun stands where it does in
    the middle of each step. Electric light, sky and sun of the scene do not count.

    Parameters
    ----------
    scene : Scene or SceneData
        What is lit. With states (`Scene.add_state`) each of these is solved.
    weather : Weather or path
        An EPW file, or what `read_weather` made of it.
    sensors : str or several, optional
        Names of grids; all of them when not given.
    accuracy : float
        Relative error aimed at; see `simulate`.
    schedule : str
        When the building is used, by the clocks of the scene's time zone, or in the standard time
        of the file where it has none.
    step_minutes : int, optional
        Shorter steps, each with the radiation of the one of the file that it is part of.
    out : path, optional
        NetCDF file to write. A run that is cut leaves what it has done beside it, and the next one
        goes on from there.
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    threads : int, optional
        Threads of the solver; all cores when not given.

    Returns
    -------
    xarray.Dataset
        ``illuminance`` and ``sun_illuminance`` (sensor, time), with states (state, sensor, time),
        in lx, with the places of the sensors and what there is outside in each step. ``time`` is
        when each step begins in the standard time of the file, ``clock`` what clocks show,
        ``time_utc`` its middle in universal time. Of ``out`` it reads values when they are used.

    Raises
    ------
    InputError
        For options out of range, scenes with mirrors or with panes that scatter, grids that there
        are not, and all that `Scene.freeze` and `read_weather` find.
    OutputError
        If ``out`` cannot be written.
    """
    from patchlight.solver.coefficients import check_scene
    from patchlight.solver.local_time import clock_times, is_occupied
    from patchlight.solver.sky_series import SkySeries, resampled

    check_effort(accuracy, threads)
    path = None if out is None else Path(out)
    if path is not None and path.suffix != ".nc":
        raise InputError(f"out = {str(path)!r}: must be a file that ends in .nc")
    if not isinstance(weather, Weather):
        from patchlight.importers import read_weather

        weather = read_weather(weather)
    if step_minutes is not None:
        weather = resampled(weather, step_minutes)
    scenes = {name: _with_grids(data, sensors) for name, data in _states(scene).items()}
    first = next(iter(scenes.values()))
    for data in scenes.values():
        check_scene(data)
    timezone = None if first.site is None else first.site.timezone
    far = _far(first, weather)
    if far:
        timezone = None
    clock = clock_times(weather, timezone)
    occupied = is_occupied(clock, schedule, weather.step_minutes)
    if not occupied.any():
        raise InputError(
            f"schedule = {schedule!r}: holds the middle of no step of {weather.step_minutes} "
            "minutes; give a longer one or smaller step_minutes"
        )
    announce_kernels(progress)
    skies = SkySeries.of(weather)
    key = key_of(
        SCHEMA_VERSION, _version(), accuracy, list(scenes), weather.step_minutes,
        weather.starts.astype(np.int64),
        [skies.sky_lx, skies.sun_normal_lx, skies.altitude_deg, skies.azimuth_deg, skies.shape],
        [_of_scene(data) for data in scenes.values()],
    )  # fmt: skip
    store = YearStore(path, key)
    ends = [min(start + BLOCK, len(skies)) for start in range(0, len(skies), BLOCK)]
    found = _fill(store, scenes, skies, ends, accuracy, progress, threads)
    small = _coordinates(first, weather, skies, clock, occupied)
    dims: tuple[str, ...] = ("sensor", "time")
    if isinstance(scene, Scene) and scene.states:
        small, dims = small.assign_coords(state=list(scenes)), ("state", *dims)
    notes = [text for data in scenes.values() for text in data.warnings]
    notes += [note for data in scenes.values() for note in data.notes if note != NO_LIGHT]
    remarks = [*weather.remarks, *far, *notes, *found.pop("warnings", [])]
    small.attrs = {
        "schema_version": SCHEMA_VERSION,
        "title": first.title,
        "weather": weather.source,
        "weather_sha256": weather.sha256,
        "place": weather.place,
        "latitude_deg": weather.site.latitude_deg,
        "longitude_deg": weather.site.longitude_deg,
        "utc_offset_h": weather.utc_offset_h,
        "timezone": timezone or "",
        "step_minutes": weather.step_minutes,
        "schedule": schedule,
        "accuracy": accuracy,
        "sky_model": "Perez 1993, luminous efficacies of Perez 1990",
        "patchlight": _version(),
        "remarks": "\n".join(dict.fromkeys(remarks)),
        **found,
    }
    return store.dataset(small, VARIABLES, dims, ends)


def _states(scene: Scene | SceneData) -> dict[str, SceneData]:
    """The scene in each of its states, all with the sensors of the whole scene."""
    import dataclasses

    if isinstance(scene, SceneData):
        return {"": scene}
    whole = scene.freeze()
    if not scene.states:
        return {"": whole}
    found = {}
    for name in scene.states:
        try:
            found[name] = dataclasses.replace(scene.freeze(state=name), sensors=whole.sensors)
        except (InputError, GeometryError) as error:
            raise type(error)(f"state {name!r}: {error}") from None
    return found


def _with_grids(data: SceneData, sensors: str | Iterable[str] | None) -> SceneData:
    import dataclasses

    if sensors is None:
        return data
    wanted = [sensors] if isinstance(sensors, str) else list(sensors)
    have = {grid.name: grid for grid in data.sensors}
    missing = [name for name in wanted if name not in have]
    if missing:
        raise InputError(
            f"sensors: no grid named {missing[0]!r}; grids: {', '.join(have) or 'none'}"
        )
    return dataclasses.replace(data, sensors=tuple(have[name] for name in wanted))


def _fill(
    store: YearStore,
    scenes: dict[str, SceneData],
    skies: SkySeries,
    ends: list[int],
    accuracy: float,
    progress: Progress | None,
    threads: int | None,
) -> dict[str, Any]:
    """Find all blocks that the store does not have; returns what is to be known of them."""
    from patchlight.solver.coefficients import Coefficients
    from patchlight.solver.simulation import with_threads
    from patchlight.solver.stages import Stages

    open_ = [k for k in range(len(ends)) if not store.has(k)]
    known = store.record()
    if not open_ and known is not None:
        return known
    warnings: list[str] = []
    with with_threads(threads):
        solved = []
        suns = skies.suns[skies.sun_normal_lx > 0.0]
        for name, data in scenes.items():
            stages = Stages(progress)
            solved.append(Coefficients.of(data, accuracy=accuracy, stages=stages, suns=suns))
            warnings += [f"{name}: {text}" if name else text for text in stages.warnings]
        error = max(one.sun_error(suns) for one in solved)
        found = {
            "warnings": warnings,
            "sun_indirect_error": error,
            "converged": int(all(one.converged for one in solved)),
        }
        store.put_record(found)
        for done, k in enumerate(open_):
            if progress is not None:
                progress("year", done, len(open_))
            steps = np.arange(ends[k - 1] if k else 0, ends[k])
            store.put(k, _block(solved, skies, steps, stacked=bool(next(iter(scenes)))))
    return found


def _block(
    solved: list[Coefficients], skies: SkySeries, steps: np.ndarray, *, stacked: bool
) -> Block:
    from patchlight.solver.year_light import light_in_steps

    found = [light_in_steps(one, skies, steps) for one in solved]
    of: dict[str, list[FloatArray]] = {
        "illuminance": [light.total for light in found],
        "sun_illuminance": [light.sun_direct for light in found],
    }
    return {
        name: (np.stack(parts) if stacked else parts[0]).astype(np.float32)
        for name, parts in of.items()
    }


def _coordinates(
    data: SceneData, weather: Weather, skies: SkySeries, clock: np.ndarray, occupied: np.ndarray
) -> xarray.Dataset:
    """Places of the sensors, and what there is outside in each step."""
    import xarray as xr

    points = np.concatenate([grid.points for grid in data.sensors])
    normals = np.concatenate([grid.normals for grid in data.sensors])
    counts = [len(grid) for grid in data.sensors]
    place = {"units": "m"}
    of_sensor: dict[str, Any] = {
        "grid": ("sensor", np.repeat([grid.name for grid in data.sensors], counts).astype(object)),
        "point": ("sensor", np.concatenate([np.arange(count) for count in counts])),
        **{axis: ("sensor", points[:, k], place) for k, axis in enumerate("xyz")},
        **{f"n{axis}": ("sensor", normals[:, k]) for k, axis in enumerate("xyz")},
        "area": (
            "sensor", np.concatenate([grid.area_m2 for grid in data.sensors]), {"units": "m2"},
        ),
    }  # fmt: skip
    deg = {"units": "degree"}
    of_time: dict[str, Any] = {
        "clock": ("time", clock.astype("datetime64[ns]")),
        "time_utc": ("time", weather.middles_utc.astype("datetime64[ns]")),
        "occupied": ("time", occupied),
    }
    outside: dict[str, Any] = {
        "sky_horizontal": ("time", skies.sky_lx, {**_LX, "long_name": "unobstructed sky"}),
        "sun_normal": ("time", skies.sun_normal_lx, {**_LX, "long_name": "sun, plane facing it"}),
        "sun_altitude": ("time", skies.altitude_deg, deg),
        "sun_azimuth": ("time", skies.azimuth_deg, {**deg, "long_name": "clockwise from north"}),
    }
    times = ("time", weather.starts.astype("datetime64[ns]"), {"long_name": "begin of the step"})
    return xr.Dataset(outside, coords={"time": times, **of_sensor, **of_time})


def _of_scene(data: SceneData) -> tuple[Any, ...]:
    """What of a scene decides on the light of its sensors."""
    return (
        data.patches, data.two_sided, data.closed, data.material_index, data.materials,
        data.glazings, data.glass_index, data.ground, data.sensors,
        [(part.path, part.kind) for part in data.parts],
    )  # fmt: skip


def _far(data: SceneData, weather: Weather) -> list[str]:
    """A remark where the scene stands elsewhere than the station."""
    if data.site is None:
        return []
    off = max(
        abs(data.site.latitude_deg - weather.site.latitude_deg),
        abs((data.site.longitude_deg - weather.site.longitude_deg + 180.0) % 360.0 - 180.0),
    )
    if off <= FAR_DEG:
        return []
    return [
        f"the scene is {off:.1f} degrees from the station {weather.place}: the sun is that of the "
        "station, and clocks show its standard time"
    ]


def _version() -> str:
    try:
        return version("patchlight")
    except PackageNotFoundError:
        return "unknown"
