"""One call from a scene and a weather file to the light of a year."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.effort import check_effort
from patchlight.solver.errors import GeometryError, InputError
from patchlight.solver.memory import GB, limited
from patchlight.solver.model import SceneData, Weather
from patchlight.solver.model.bands import SPECTRAL

from .doctoring import version
from .remarks import NO_LIGHT
from .scene import Scene
from .simulation import announce_kernels
from .states import Setting, settings_of
from .year_fill import Filler, Progress
from .year_key import of_scene
from .year_parts import YearParts, electric_schedules, photometry_lines, small_dataset
from .year_store import YearStore, key_of

if TYPE_CHECKING:
    import xarray

#: Version of what is stored.
SCHEMA_VERSION = 5
#: Difference in latitude or longitude of scene and station that is told. [deg]
FAR_DEG = 1.0
_LX = {"units": "lx"}
VARIABLES = {
    "illuminance": {**_LX, "long_name": "illuminance of sky, sun and ground"},
    "sun_illuminance": {**_LX, "long_name": "illuminance straight from the disc of the sun"},
}
#: Where a grid asks for the spectrum.
MELANOPIC = {
    **_LX,
    "long_name": "melanopic equivalent daylight (D65) illuminance of sky, sun and ground",
    "spectrum": "modelled: daylight of 6500 K (sky) and 5500 K (sun)",
}


def simulate_year(
    scene: Scene | SceneData,
    weather: Weather | str | os.PathLike[str],
    *,
    sensors: str | Iterable[str] | None = None,
    accuracy: float = 0.02,
    schedule: str = "08:00-18:00",
    step_minutes: int | None = None,
    electric: Mapping[str, str] | None = None,
    sun_day: str = "03-21",
    sun_above_deg: float = 0.0,
    out: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
    memory_gb: float | None = None,
) -> xarray.Dataset:
    """Daylight at the sensors of ``scene`` in every step of a weather file.

    Skies are Perez' from the irradiances of the file, the disc of the sun stands where it does in
    the middle of each step. Sky and sun of the scene do not count.

    Parameters
    ----------
    scene : Scene or SceneData
        What is lit. With states (`Scene.add_state`) each of these is solved, those of several
        window groups one group at a time.
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
    electric : mapping, optional
        Light groups of lamps that burn, and when: a schedule as above, or ``"always"``. Their light
        is told beside daylight.
    sun_day : str
        Month and day of which hours of sun are told, without clouds.
    sun_above_deg : float
        Altitude from which on the sun counts on that day. [deg]
    out : path, optional
        NetCDF file to write. A run that is cut leaves what it has done beside it, and the next one
        goes on from there.
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    threads : int, optional
        Threads of the solver; all cores when not given.
    memory_gb : float, optional
        Most memory that the process may take; what is free when not given. [GB]

    Returns
    -------
    xarray.Dataset
        ``illuminance`` and ``sun_illuminance`` (sensor, time), with states (state, sensor, time),
        in lx, with the places of the sensors and what there is outside in each step; where any grid
        has ``spectral=True`` also ``melanopic_edi`` of all of them, sky and sun being daylight of
        6500 and 5500 K. ``time`` is when each step begins in the standard time of the file,
        ``clock`` what clocks show, ``time_utc`` its middle in universal time. Also
        ``daylight_factor`` under the overcast sky of type 16, ``sunlight_hours`` on the day, in
        steps of 5 minutes, ``relative_error``, what the light of an even sky may be off by at each
        sensor, and with ``electric`` the light of each group, ``electric_illuminance`` and
        ``electric_melanopic_edi`` (lamps, sensor), and when it burns, ``electric_on``
        (lamps, time).
        Of ``out`` it reads values when they are used.

    Raises
    ------
    InputError
        For options out of range, scenes with mirrors or with panes that scatter, grids and groups
        that there are not, and all that `Scene.freeze` and `read_weather` find.
    OutOfMemoryError
        If it needs more memory than there is, or than ``memory_gb``.
    OutputError
        If ``out`` cannot be written.
    """
    from patchlight.solver.daylit import check_scene
    from patchlight.solver.local_time import clock_times, is_occupied
    from patchlight.solver.simulation import with_threads
    from patchlight.solver.sky_series import SkySeries, resampled
    from patchlight.solver.sun_day import SunDay
    from patchlight.solver.year_memory import YearMemory

    check_effort(accuracy, threads)
    path = None if out is None else Path(out)
    if path is not None and path.suffix != ".nc":
        raise InputError(f"out = {str(path)!r}: must be a file that ends in .nc")
    if not isinstance(weather, Weather):
        from patchlight.importers import read_weather

        weather = read_weather(weather)
    if step_minutes is not None:
        weather = resampled(weather, step_minutes)
    settings, scenes = _settings(scene, sensors)
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
    burns = electric_schedules(electric, scenes.values(), clock, weather.step_minutes)
    day = SunDay.of(weather, sun_day, sun_above_deg)
    announce_kernels(progress)
    skies = SkySeries.of(weather)
    program = version("patchlight")
    key = key_of(
        SCHEMA_VERSION, program, accuracy, list(scenes), weather.step_minutes, list(burns), day,
        weather.starts.astype(np.int64),
        [skies.sky_lx, skies.sun_normal_lx, skies.altitude_deg, skies.azimuth_deg, skies.shape],
        [of_scene(data, bool(burns)) for data in scenes.values()],
    )  # fmt: skip
    with limited(memory_gb), with_threads(threads):
        memory = YearMemory.of(
            first, accuracy=accuracy, steps=len(skies), states=len(scenes), in_memory=path is None
        )
        memory.check()
        told = memory.most
        if progress is not None:
            progress(f"up to {told / GB:.1f} GB of memory besides the program", 0, 1)
        store = YearStore(path, key)
        filler = Filler(store, skies, day, tuple(burns), accuracy, progress, memory.result)
        filled = filler.fill(scenes)
    parts = YearParts(first, weather, skies, clock, occupied, burns, settings)
    small, dims = small_dataset(parts, filled)
    notes = [text for data in scenes.values() for text in data.warnings]
    notes += [note for data in scenes.values() for note in data.notes if note != NO_LIGHT]
    remarks = [*weather.remarks, *far, *notes, *filled.warnings]
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
        "electric": ", ".join(f"{group} {when}" for group, when in (electric or {}).items()),
        "photometry": "\n".join(photometry_lines(scenes.values(), burns)),
        "sun_day": sun_day,
        "sun_above_deg": sun_above_deg,
        "accuracy": accuracy,
        "sky_model": "Perez 1993, luminous efficacies of Perez 1990",
        "patchlight": program,
        "memory_bytes": told,
        "remarks": "\n".join(dict.fromkeys(remarks)),
        "sun_indirect_error": filled.sun_indirect_error,
        "converged": int(filled.converged),
    }
    spectral = first.bands == SPECTRAL
    variables = {**VARIABLES, "melanopic_edi": MELANOPIC} if spectral else VARIABLES
    return store.dataset(small, variables, dims, filled.pieces)


def _settings(
    scene: Scene | SceneData, sensors: str | Iterable[str] | None
) -> tuple[list[Setting], dict[str, SceneData]]:
    """The settings of a scene's states, none without states, and the scene in each of them.

    All have the sensors of the whole scene.
    """
    if isinstance(scene, SceneData):
        return [], {"": with_grids(scene, sensors)}
    whole = with_grids(scene.freeze(), sensors)
    if not scene.states:
        return [], {"": whole}
    settings = settings_of(scene.states.values())
    found = {}
    for one in settings:
        try:
            data = scene.freeze(state=one.states)
        except (InputError, GeometryError) as error:
            raise type(error)(f"state {one.name!r}: {error}") from None
        found[one.name] = dataclasses.replace(data, sensors=whole.sensors)
    return settings, found


def with_grids(data: SceneData, sensors: str | Iterable[str] | None) -> SceneData:
    """The scene with some of its grids alone; with all where none is named."""
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
