"""Reading scene.toml: everything wrong with it is said at once."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.errors import InputError, MissingFileError, PatchlightError
from patchlight.solver.model import Emitter, Photometry, Site, Sky, Sun

from .frames import up_matrix
from .grids import check_pattern
from .output import file_hash
from .problems import Problems
from .requirements import unknown_grid
from .scene import Entry, Scene
from .webs import with_web

if TYPE_CHECKING:
    from pydantic import ValidationError

    from .scene_schema import SceneFile


def load_scene(path: str | Path, *, cache: bool = True) -> Scene:
    """Scene described by a TOML file; file names in it are relative to its folder.

    With ``cache`` models are taken from the cache where it has them, as by `read_step`.

    Raises
    ------
    MissingFileError
        If there is no such file.
    InputError
        Naming every unknown key, value out of bounds, missing model and pattern without a match.
    """
    path = Path(path)
    return build_scene(read_scene_file(path, parts=True), path, cache=cache)


def read_scene_file(path: Path, *, model: Path | None = None, parts: bool = False) -> SceneFile:
    """The checked contents of a scene file, with ``model`` in place of its first model file.

    Where anything is wrong with it and ``parts`` are asked for, its models are read to tell of
    patterns without a match, too; `build_scene` does that of a file that is right.
    """
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        values = tomllib.loads(raw.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from None
    if model is not None and _tables(values, "model"):
        _tables(values, "model")[0]["file"] = str(model.resolve())
    return checked_scene_file(values, path, parts=parts)


def checked_scene_file(values: dict[str, Any], path: Path, *, parts: bool = False) -> SceneFile:
    """Check the tables of a scene file; ``path`` names it and roots relative files."""
    from pydantic import ValidationError

    from .scene_schema import SceneFile

    problems = Problems(str(path))
    file = None
    try:
        file = SceneFile.model_validate(values)
    except ValidationError as error:
        problems.add(_problems(error))
    problems.add(_across_tables(values, path.parent))
    if problems.lines and parts:
        from .part_problems import part_problems

        problems.add(part_problems(values, path.parent))
    problems.raise_any()
    if file is None:  # a validation error always has a problem; for the type checker
        raise InputError(f"{path}: cannot be used")
    return file


def _problems(error: ValidationError) -> list[str]:
    """One line a problem, with its key path."""
    from .scene_schema import SceneFile

    lines: list[str] = []
    seen: set[str] = set()
    for item in error.errors(include_url=False):
        key = _key(item["loc"])
        if key and key in seen:
            continue  # further members of a union
        seen.add(key)
        if item["type"] == "extra_forbidden":
            known = _known_keys(SceneFile, item["loc"][:-1])
            near = get_close_matches(str(item["loc"][-1]), known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"
            lines.append(f"{key}: unknown key; {hint}")
        elif item["type"] == "missing":
            lines.append(f"{key}: missing")
        elif item["type"] == "value_error":
            lines.append(f"{key}: {item['ctx']['error']}" if key else str(item["ctx"]["error"]))
        else:
            given = item.get("input")
            shown = f" (is {given!r})" if isinstance(given, str | int | float | list) else ""
            lines.append(f"{key}: {item['msg']}{shown}")
    return lines


def _key(loc: tuple[int | str, ...]) -> str:
    """``assign[0].material.reflectance``; names of union members are left out."""
    text = ""
    for step in loc:
        if isinstance(step, int):
            text += f"[{step}]"
        elif not any(c in step for c in "[(-") and step not in ("float", "int", "str", "literal"):
            text += f".{step}" if text else step
    return text


def _known_keys(table: Any, loc: tuple[int | str, ...]) -> list[str]:
    """Keys of the table at ``loc``."""
    from typing import get_args

    for step in loc:
        if isinstance(step, int) or step not in getattr(table, "model_fields", {}):
            continue
        kind = table.model_fields[step].annotation
        while not hasattr(kind, "model_fields"):
            inner = [a for a in get_args(kind) if a is not type(None)]
            if not inner:
                return []
            kind = inner[0]
        table = kind
    return list(table.model_fields)


def _across_tables(values: dict[str, Any], folder: Path) -> list[str]:
    """Problems that concern more than one table, or the disk; works on unchecked values."""
    problems = []
    for k, table in enumerate(_tables(values, "model")):
        name = table.get("file")
        if isinstance(name, str) and name and not (folder / name).is_file():
            problems.append(f"model[{k}].file: {folder / name}: no such file")
    for k, name in _photometry_names(values):
        if not (folder / name).is_file():
            problems.append(f"assign[{k}].emitter.photometry: {folder / name}: no such file")
    for kind in ("sensors", "cameras", "state"):
        seen: set[str] = set()
        for k, table in enumerate(_tables(values, kind)):
            name = table.get("name")
            if isinstance(name, str) and name in seen:
                problems.append(f"{kind}[{k}].name: {name!r} is taken")
            seen.add(str(name))
    grids = [str(t.get("name")) for t in _tables(values, "sensors")]
    for k, table in enumerate(_tables(values, "requirements")):
        name = table.get("sensors")
        if isinstance(name, str) and name not in grids:
            problems.append(f"requirements[{k}].sensors: {unknown_grid(name, grids)}")
    view = values.get("view_out")
    eyes = view.get("sensors", []) if isinstance(view, dict) else []
    for name in [eyes] if isinstance(eyes, str) else eyes if isinstance(eyes, list) else []:
        if isinstance(name, str) and name not in grids:
            problems.append(f"view_out.sensors: {unknown_grid(name, grids)}")
    sky = values.get("sky")
    name = sky.get("file") if isinstance(sky, dict) else None
    if isinstance(name, str) and name and not (folder / name).is_file():
        return [*problems, f"sky.file: {folder / name}: no such file"]
    problems += _light_problems(values, grids, folder)
    return problems


def _photometry_names(values: dict[str, Any]) -> Iterator[tuple[int, str]]:
    """Number and photometric file of assignments that have one, in unchecked values."""
    for k, table in enumerate(_tables(values, "assign")):
        emitter = table.get("emitter")
        name = emitter.get("photometry") if isinstance(emitter, dict) else None
        if isinstance(name, str) and name:
            yield k, name


def photometry_files(file: SceneFile, folder: Path) -> list[Path]:
    """Photometric files that a scene file names, each once."""
    emitters = [a.emitter for a in file.assign if a.emitter is not None]
    return list(dict.fromkeys(folder / e.photometry for e in emitters if e.photometry))


def _light_problems(values: dict[str, Any], grids: list[str], folder: Path) -> list[str]:
    """What is wrong with the sky, which may take the sun's position, and with asking for it."""
    from pydantic import ValidationError

    from .freezing import check_sun
    from .light_tables import SkyTable, SunTable
    from .scene_schema import RequirementTable, SiteTable

    sun = sky = site = disc = None
    try:
        site = SiteTable.model_validate(values.get("site") or {}).build()
    except ValidationError:  # reported with its key; any place serves to check the rest
        site = Site(0.0, 0.0, timezone="UTC")
    if values.get("sun") is not None:
        try:
            sun = SunTable.model_validate(values["sun"])
        except ValidationError:  # as above
            sun = SunTable(altitude_deg=45.0, azimuth_deg=180.0, normal_illuminance_lx=0.0)
    try:
        disc = None if sun is None else sun.build_at(site)
    except PatchlightError as error:
        return [f"sun: {error}"]
    try:
        if values.get("sky") is not None:
            sky, _ = SkyTable.model_validate(values["sky"]).build_with(disc, folder)
            check_sun(sky, disc)
    except ValidationError:
        return []  # reported with its key
    except PatchlightError as error:
        return [f"sky: {error}"]
    problems = []
    try:
        lit_by = None if sun is None else sun.build_with(sky, site)
    except PatchlightError as error:
        return [f"sun: {error}"]
    for k, table in enumerate(_tables(values, "requirements")):
        try:
            asked = RequirementTable.model_validate(table).build()
        except ValidationError:
            continue  # reported with its key
        beside = bool(values.get("daylight_factor"))
        spectral = [t.get("name") for t in _tables(values, "sensors") if t.get("spectral") is True]
        lit = asked.problem(
            [asked.sensors, *grids],
            sky,
            lit_by,
            daylight_factor=beside,
            spectral=[str(name) for name in spectral],
        )
        if lit:
            problems.append(f"requirements[{k}]: {lit}")
    return problems


def _tables(values: dict[str, Any], key: str) -> list[dict[str, Any]]:
    tables = values.get(key)
    return [t for t in tables if isinstance(t, dict)] if isinstance(tables, list) else []


@dataclasses.dataclass(frozen=True, slots=True)
class FileLight:
    """Sky and sun of a scene file, and remarks on the files that tell them."""

    sky: Sky | None
    sun: Sun | None
    remarks: tuple[str, ...] = ()


def light_of_file(path: Path) -> FileLight:
    """Sky and sun of a scene file; its models are not read."""
    return _light(read_scene_file(path), path)


def _light(file: SceneFile, path: Path) -> FileLight:
    site = file.site.build()
    disc = None if file.sun is None else file.sun.build_at(site)
    sky, remarks = (None, ()) if file.sky is None else file.sky.build_with(disc, path.parent)
    return FileLight(sky, None if file.sun is None else file.sun.build_with(sky, site), remarks)


def build_scene(file: SceneFile, path: Path, *, cache: bool = True) -> Scene:
    """Read the models of a checked scene file and apply it; ``path`` is the scene file."""
    from patchlight.importers import read_step

    scene = Scene(
        north_deg=file.site.north_deg,
        site=file.site.build(),
        maintenance_factor=file.maintenance_factor,
        colors=file.colors,
    )
    scene.title = file.title or path.stem
    scene.accuracy, scene.method = file.accuracy, file.method
    scene.basis, scene.balanced_mesh = file.basis, file.balanced_mesh
    problems = Problems(str(path))
    for k, table in enumerate(file.model):
        with problems.under(f"model[{k}].file"):
            model = read_step(
                path.parent / table.file,
                scale=table.scale,
                unit=table.unit,
                tolerance=table.tolerance,
                angle_deg=table.angle_deg,
                heal=table.heal,
                timeout_s=table.timeout_s,
                memory_gb=table.memory_gb,
                cache=cache,
            )
            placement = up_matrix(table.up)
            placement[:3, 3] = np.asarray(table.at_m)
            named, own = table.name or model.name, table.name is not None
            entry = Entry(named, model, placement, given_name=own, scale=table.scale)
            with problems.under(f"model[{k}].name"):
                scene.add_entry(entry)
    if problems.lines:
        from .part_problems import part_problems

        problems.add(part_problems(file.model_dump(mode="json"), path.parent))
    problems.raise_any()
    for k, assign in enumerate(file.assign):
        for what in assign.build():
            if isinstance(what, Emitter) and isinstance(what.photometry, str):
                what = dataclasses.replace(what, photometry=path.parent / what.photometry)
                with problems.under(f"assign[{k}].emitter.photometry"):
                    what = with_web(what, scene.webs)
                if not isinstance(what.photometry, Photometry):
                    continue
            with problems.under(f"assign[{k}]"):
                scene.assign(
                    assign.parts,
                    what,
                    faces=assign.faces,
                    layer=assign.layer,
                    color=assign.color,
                )
    light = _light(file, path)
    scene.sky, scene.sun = light.sky, light.sun
    scene.notes += light.remarks
    scene.ground = None if file.ground is None else file.ground.build()
    beside = file.daylight_factor
    scene.daylight_factor = beside if isinstance(beside, bool) else beside.build()
    for k, grid in enumerate(file.sensors):
        with problems.under(f"sensors[{k}]"):
            built = grid.build()
            scene.add(built)
            check_pattern(scene, built)
    for k, camera in enumerate(file.cameras):
        with problems.under(f"cameras[{k}]"):
            scene.add(camera.build())
    for k, state in enumerate(file.state):
        with problems.under(f"state[{k}]"):
            scene.add_state(
                state.name, present=state.present, absent=state.absent, group=state.group
            )
    scene.requirements = [r.build() for r in file.requirements]
    problems.raise_any()
    return scene


def resolved_config(file: SceneFile, folder: Path, *, remarks: tuple[str, ...] = ()) -> str:
    """The scene file with all defaults written out and absolute file names, as TOML.

    Hashes of the models and photometric files, and ``remarks``, stand in comments at the top, so
    that the text can be run again as it is.
    """
    import tomli_w

    values = file.model_dump(mode="json", exclude_none=True)
    lines = ["# All settings of this run, defaults included; can be run again.", ""]
    lines[1:1] = [f"# {remark}" for remark in remarks]
    for table in values["model"]:
        full = (folder / table["file"]).resolve()
        table["file"] = str(full)
        lines.insert(-1, f"# sha256 {file_hash(full)} {full.name}")
    for full in photometry_files(file, folder):
        lines.insert(-1, f"# sha256 {file_hash(full)} {full.name}")
    if "file" in values.get("sky", {}):
        full = (folder / values["sky"]["file"]).resolve()
        values["sky"]["file"] = str(full)
        lines.insert(-1, f"# sha256 {file_hash(full)} {full.name}")
    for table in values["assign"]:
        if "photometry" in table.get("emitter", {}):
            full = (folder / table["emitter"]["photometry"]).resolve()
            table["emitter"]["photometry"] = str(full)
    return "\n".join(lines) + "\n" + tomli_w.dumps(values)
