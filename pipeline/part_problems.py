"""Patterns of a scene file that match no part, told beside whatever else is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.errors import PatchlightError

from .assigning import find_faces, matched_parts
from .frames import up_matrix
from .scene import Entry, Scene

Named = tuple[str, str, dict[str, str | None]]


def part_problems(values: Mapping[str, Any], folder: Path) -> list[str]:
    """Patterns without a match in the tables of a scene file that may have other faults, too.

    Models that cannot be read are left to whoever tells of them. Without all models only patterns
    are looked at that start with the name of one that is there.

    Parameters
    ----------
    values : mapping
        Unchecked tables.
    folder : Path
        Of the scene file.
    """
    patterns = list(_patterns(values))
    if not patterns:
        return []
    scene, complete = _models(values, folder)
    problems = []
    for key, pattern, narrowed in patterns:
        if not complete and pattern.split("/")[0] not in scene.entries:
            continue
        try:
            if narrowed:
                find_faces(
                    scene.entries, pattern, label=repr(pattern), faces=narrowed.get("faces"),
                    layer=narrowed.get("layer"), color=narrowed.get("color"),
                )  # fmt: skip
            else:
                matched_parts(scene.entries, pattern, label=repr(pattern))
        except PatchlightError as error:
            problems.append(f"{key}: {error}")
    return problems


def _models(values: Mapping[str, Any], folder: Path) -> tuple[Scene, bool]:
    """A scene of the models that can be read, and whether these are all."""
    from patchlight.importers import read_step
    from pydantic import ValidationError

    from .scene_schema import ModelTable

    scene, complete = Scene(), True
    tables = values.get("model")
    for raw in tables if isinstance(tables, list) else []:
        try:
            table = ModelTable.model_validate(raw)
            model = read_step(
                folder / table.file, scale=table.scale, unit=table.unit, tolerance=table.tolerance,
                angle_deg=table.angle_deg, heal=table.heal, timeout_s=table.timeout_s,
                memory_gb=table.memory_gb,
            )  # fmt: skip
            placement = up_matrix(table.up)
            placement[:3, 3] = np.asarray(table.at_m)
            named = table.name or model.name
            given = table.name is not None
            scene.add_entry(Entry(named, model, placement, given_name=given, scale=table.scale))
        except (ValidationError, PatchlightError):
            complete = False
    return scene, complete and bool(scene.entries)


def _patterns(values: Mapping[str, Any]) -> Iterator[Named]:
    """Key, pattern, and what narrows the faces of it, of all tables that have patterns."""
    for k, table in _tables(values, "assign"):
        narrowed = {n: _text(table.get(n)) for n in ("faces", "layer", "color")}
        yield from _told(f"assign[{k}]", table.get("parts"), narrowed)
    for k, table in _tables(values, "sensors"):
        yield from _told(f"sensors[{k}].over", table.get("over"), {"faces": None})
        yield from _told(f"sensors[{k}]", table.get("parts"), {"faces": _text(table.get("faces"))})
    for k, table in _tables(values, "state"):
        for key in ("present", "absent"):
            yield from _told(f"state[{k}].{key}", table.get(key), {})
    view = values.get("view_out")
    if isinstance(view, dict):
        for key in ("outside", "ground"):
            yield from _told(f"view_out.{key}", view.get(key), {})


def _told(key: str, given: Any, narrowed: dict[str, str | None]) -> Iterator[Named]:
    """One pattern or several; what is no text is left to the schema."""
    for pattern in given if isinstance(given, list) else [given]:
        if isinstance(pattern, str) and pattern:
            yield key, pattern, narrowed


def _tables(values: Mapping[str, Any], key: str) -> Iterator[tuple[int, dict[str, Any]]]:
    tables = values.get(key)
    for k, table in enumerate(tables if isinstance(tables, list) else []):
        if isinstance(table, dict):
            yield k, table


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None
