"""One year from a scene file and a weather file to an output folder, as `patchlight year` does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlight.solver.compile_ahead import compile_ahead
from patchlight.solver.effort import check_effort
from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.local_time import schedule_minutes
from patchlight.solver.memory import check_limit

from .output import file_hash, prepare_output
from .year import simulate_year
from .year_parts import ALWAYS

if TYPE_CHECKING:
    from patchlight.solver.view_out import ViewOut

    from .scene import Scene
    from .scene_schema import SceneFile
    from .talk import Talk


@dataclass(slots=True)
class YearOptions:
    """Settings of `run_year`."""

    weather: Path
    output: Path | None = None
    accuracy: float | None = None
    threads: int | None = None
    sensors: tuple[str, ...] = ()
    schedule: str = "08:00-18:00"
    step_minutes: int | None = None
    electric: tuple[str, ...] = ()
    sun_day: str = "03-21"
    sun_above_deg: float = 0.0
    memory_gb: float | None = None
    force: bool = False
    cache: bool = True


@dataclass(slots=True)
class YearRun:
    """A finished year: its folder and metrics, one row each."""

    folder: Path
    rows: list[dict[str, Any]]
    warnings: tuple[str, ...]
    converged: bool


def run_year(path: Path, options: YearOptions, talk: Talk) -> YearRun:
    """Simulate a year and write report.html, grids/annual.nc, metrics and run.json.

    The folder may hold what an earlier run left that was cut: it goes on from there.
    """
    from patchlight.importers import read_weather
    from patchlight.reports import write_year, year_remarks
    from patchlight.solver.sun_day import check_above, check_day

    from .scene_file import build_scene, read_scene_file, resolved_config

    check_effort(options.accuracy, options.threads)
    with _of("--schedule"):
        schedule_minutes(options.schedule)
    electric = _schedules(options.electric)
    with _of("--sun-day"):
        check_day(options.sun_day)
    with _of("--sun-above"):
        check_above(options.sun_above_deg)
    with _of("--memory"):
        check_limit(options.memory_gb)
    if not path.exists():
        raise MissingFileError(f"{path}: no such file")
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: a year needs a scene file that ends in .toml, with sensors")
    weather = read_weather(options.weather)
    with _of("--sun-day"):
        check_day(options.sun_day, weather.starts[0].astype(object).year)
    compile_ahead()
    folder = options.output or Path(f"{path.stem}-patchlight-year")
    file = read_scene_file(path, parts=True)
    for key, usual in (("method", "default"), ("basis", None), ("balanced_mesh", False)):
        if (given := getattr(file, key)) != usual:
            raise InputError(f"{path}: {key} = {given!r}: a year has no such choice; leave it out")
    if options.accuracy is not None:
        file = file.model_copy(update={"accuracy": options.accuracy})
    models = [path.parent / table.file for table in file.model]
    used = [*models, options.weather]
    prepare_output(folder, used, force=options.force, own=("grids",))
    talk.progress("reading models", 0, len(file.model))
    scene = build_scene(file, path, cache=options.cache)
    views = _views(scene, file, talk)
    target = folder / "grids" / "annual.nc"
    target.parent.mkdir(parents=True, exist_ok=True)
    dataset = simulate_year(
        scene,
        weather,
        sensors=options.sensors or None,
        accuracy=scene.accuracy,
        schedule=options.schedule,
        step_minutes=options.step_minutes,
        electric=electric,
        sun_day=options.sun_day,
        sun_above_deg=options.sun_above_deg,
        out=target,
        progress=talk.progress,
        threads=options.threads,
        memory_gb=options.memory_gb,
    )
    with dataset:
        warnings = tuple(year_remarks(dataset))
        converged = bool(dataset.attrs["converged"])
        rows = write_year(
            dataset,
            folder,
            inputs=[_named(one) for one in used],
            scene=_named(path),
            config=resolved_config(file, path.parent),
            surroundings=scene.freeze(),
            views=views,
        )
    talk.stop()
    for warning in warnings:
        talk.warn(warning)
    return YearRun(folder, rows, warnings, converged)


def _views(scene: Scene, file: SceneFile, talk: Talk) -> dict[str, ViewOut]:
    """View out of the grids that the scene file asks for; none where it does not."""
    if file.view_out is None:
        return {}
    from .viewing import view_out

    asked = file.view_out
    return view_out(
        scene,
        sensors=asked.sensors or None,
        outside=asked.outside,
        ground=asked.ground,
        progress=talk.progress,
    )


def _named(path: Path) -> dict[str, str]:
    """A file and its hash, for run.json."""
    return {"path": str(path.resolve()), "sha256": file_hash(path)}


def _schedules(given: tuple[str, ...]) -> dict[str, str]:
    """Schedules of light groups, of words like ceiling=08:00-18:00."""
    out: dict[str, str] = {}
    for word in given:
        group, sign, when = word.rpartition("=")
        if not (group and sign and when):
            raise InputError(f"--electric {word!r}: must be like ceiling=08:00-18:00")
        if group in out:
            raise InputError(
                f"--electric: {group!r} is given twice, {out[group]} and {when}: give it one "
                "schedule, from the first time to the last"
            )
        if when != ALWAYS:
            with _of(f"--electric {word!r}", f", or {ALWAYS!r}"):
                schedule_minutes(when)
        out[group] = when
    return out


@contextmanager
def _of(option: str, more: str = "") -> Iterator[None]:
    """Put the name of an option before what is said of its value, and perhaps more after it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{option}: {error}{more}") from None


def year_text(run: YearRun) -> str:
    """The metrics as a table, and where they are."""
    grids = list(dict.fromkeys(row["sensor_id"] for row in run.rows))
    lines = []
    for grid in grids:
        lines.append(f"{grid}:")
        for row in run.rows:
            if row["sensor_id"] == grid:
                told = _shown(row["value"]) + _between(row)
                lines.append(f"  {row['quantity']:40} {told} {row['unit']}".rstrip())
    return "\n".join([*lines, str(run.folder / "report.html")])


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _between(row: dict[str, Any]) -> str:
    """What a metric may be by the stated error of its light, in brackets; empty for one value."""
    if row["low"] is None:
        return ""
    low, high = _shown(row["low"]), _shown(row["high"])
    return "" if low == high else f" ({low} to {high})"
