"""One run from a file to an output folder, as `patchlight run` and the batch do it."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlight.solver.compile_ahead import compile_ahead
from patchlight.solver.effort import check_effort
from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.model import Result

from .output import prepare_output
from .remarks import model_warnings
from .scene import Scene
from .simulation import COMPILING, compiling_is_news, simulate, with_requirements

if TYPE_CHECKING:
    from .scene_schema import SceneFile
    from .talk import Talk

#: Name ends of STEP files.
STEP_SUFFIXES = (".step", ".stp", ".p21")
#: A scene that may take longer than this is announced. [s]
LONG_SECONDS = 10.0


@dataclass(slots=True)
class RunOptions:
    """Settings of `run_file`; None leaves the choice to the scene file or the default."""

    output: Path | None = None
    accuracy: float | None = None
    threads: int | None = None
    scale: float | None = None
    unit: str | None = None
    up: str | None = None
    tolerance: float | None = None
    scene: Path | None = None
    pdf: bool = False
    force: bool = False
    own_files: tuple[str, ...] = ()
    method: str | None = None
    cache: bool = True
    timeout_s: float | None = None
    memory_gb: float | None = None

    @property
    def limits(self) -> dict[str, float]:
        """Those for reading models that are given."""
        limits = {"timeout_s": self.timeout_s, "memory_gb": self.memory_gb}
        return {key: value for key, value in limits.items() if value is not None}


@dataclass(slots=True)
class Run:
    """A finished run."""

    result: Result
    folder: Path
    seconds: float


def run_file(path: Path, options: RunOptions, talk: Talk) -> Run:
    """Simulate a scene file or a bare STEP file and write its output folder."""
    began = time.perf_counter()
    check_effort(options.accuracy, options.threads)
    if not path.exists():
        raise MissingFileError(f"{path}: no such file")
    compile_ahead()
    folder = options.output or Path(f"{path.stem}-patchlight")
    is_new = not folder.exists()
    try:
        result = _run(path, options, folder, talk)
    except BaseException:
        if is_new:  # nothing was written: leave no empty folder behind
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
    return Run(result, folder, time.perf_counter() - began)


def _run(path: Path, options: RunOptions, folder: Path, talk: Talk) -> Result:
    if path.suffix.lower() == ".toml":
        scene, config = _from_scene_file(path, options, folder, talk)
    elif path.suffix.lower() in STEP_SUFFIXES:
        scene, config = _from_step(path, options, folder, talk)
    else:
        known = ", ".join((".toml", *STEP_SUFFIXES))
        raise InputError(f"{path}: neither a scene file nor a STEP file; known endings: {known}")
    accuracy = scene.accuracy if options.accuracy is None else options.accuracy
    with _doubts_if_refused(model_warnings(scene), talk):
        data = scene.freeze()
    for warning in data.warnings:
        talk.warn(warning)
    for note in data.notes:
        if not note.startswith("default: "):  # said already
            talk.note(f"note: {note}")
    from patchlight.solver.simulation import estimate_seconds

    method = scene.method if options.method is None else options.method
    basis = scene.basis if method == "default" else None
    least, most = estimate_seconds(data, accuracy, basis)
    size = f"{len(data.patches)} patches of {len(data.faces)} faces, accuracy {accuracy:g}"
    announce = talk.note if most > LONG_SECONDS else talk.detail
    if method == "default":
        announce(f"{size}: should take {_duration(least)} to {_duration(most)} on two idle cores")
    else:
        talk.note(f"{size}: by the method of 1993, which takes a multiple of the default's time")
    result = simulate(
        data,
        accuracy=accuracy,
        method=method,
        basis=basis,
        balanced_mesh=scene.balanced_mesh,
        progress=talk.progress,
        threads=options.threads,
    )
    result = with_requirements(result, scene)
    from patchlight.reports import write_run
    from patchlight.reports.files import write_text

    write_run(
        result,
        folder,
        config=config,
        pdf=options.pdf,
        log=talk.warn,
        progress=talk.progress,
    )
    talk.stop()
    for warning in result.warnings:
        if warning not in data.warnings:  # said already
            talk.warn(warning)
    write_text(folder / "log.jsonl", talk.log_text())
    return result


@contextlib.contextmanager
def _doubts_if_refused(warnings: Iterable[str], talk: Talk) -> Iterator[None]:
    """Say what is doubtful about models before their scene is refused, which may be why."""
    try:
        yield
    except InputError:
        for warning in warnings:
            talk.warn(warning)
        raise


def _from_scene_file(
    path: Path, options: RunOptions, folder: Path, talk: Talk, *, model: Path | None = None
) -> tuple[Scene, str]:
    """Scene and resolved configuration of a scene file."""
    from .scene_file import build_scene, read_scene_file, resolved_config

    _refuse(options, ("scale", "unit", "up", "tolerance"), "stand in the scene file")
    if model is None:
        _refuse(options, ("scene",), "is for a STEP file")
    file = read_scene_file(path, model=model, parts=True)
    models = [table.model_copy(update=options.limits) for table in file.model]
    file = file.model_copy(update={"model": models})
    _prepare(folder, (path.parent / table.file for table in file.model), options)
    talk.progress("reading models", 0, len(file.model))
    if file.view_out is not None:
        talk.note("note: [view_out] is told by `patchlight year` alone")
    scene = build_scene(file, path, cache=options.cache)
    _announce_kernels(talk)
    return scene, resolved_config(_with_options(file, options), path.parent)


def _from_step(path: Path, options: RunOptions, folder: Path, talk: Talk) -> tuple[Scene, str]:
    """Scene of defaults around a bare STEP file, or of a scene file it is put into."""
    if options.scene is not None:
        inner = dataclasses.replace(options, scene=None)
        return _from_scene_file(options.scene, inner, folder, talk, model=path)
    from patchlight.importers import read_step

    from .bare import bare_scene
    from .scene_file import checked_scene_file, resolved_config

    _prepare(folder, (path,), options)
    talk.progress("reading models", 0, 1)
    given: dict[str, Any] = {
        key: value
        for key in ("scale", "unit", "tolerance")
        if (value := getattr(options, key)) is not None
    }
    given |= options.limits
    model = read_step(path, **given, cache=options.cache)
    _announce_kernels(talk)  # asking what lies inside a solid needs them
    with _doubts_if_refused(model.warnings, talk):
        bare = bare_scene(model, path, up=options.up or "z", scale=options.scale or 1.0)
    talk.note(f"{path.name}: no scene file, so it runs with defaults")
    for remark in bare.remarks:
        talk.note(f"  {remark}")
    bare.values["model"][0].update(given)
    file = _with_options(checked_scene_file(bare.values, path), options)
    return bare.scene, resolved_config(file, path.parent, remarks=tuple(bare.remarks))


def _prepare(folder: Path, inputs: Iterable[Path], options: RunOptions) -> None:
    prepare_output(folder, inputs, force=options.force, own=options.own_files)


def _announce_kernels(talk: Talk) -> None:
    if compiling_is_news():
        talk.note(COMPILING)


def _refuse(options: RunOptions, keys: tuple[str, ...], why: str) -> None:
    for key in keys:
        if getattr(options, key) is not None:
            raise InputError(f"--{key}: {why}; leave it out here")


def _with_options(file: SceneFile, options: RunOptions) -> SceneFile:
    """A scene file with what was asked for in its place."""
    asked = {"accuracy": options.accuracy, "method": options.method}
    return file.model_copy(update={k: value for k, value in asked.items() if value is not None})


def _duration(seconds: float) -> str:
    if seconds < 1.0:
        return "less than a second"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
