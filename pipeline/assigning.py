"""Which faces an assignment means: part patterns, layers, colours and face selectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Air, Emitter, Glass, Material, Part
from patchlight.solver.model.result import matching

if TYPE_CHECKING:
    from .scene import Entry

#: Largest difference of an 8-bit sRGB channel at which two colours are the same.
COLOR_STEPS = 2


@dataclass(frozen=True, slots=True)
class Assignment:
    """Something given to the faces that match.

    ``models`` names the models in the scene when it was made: later ones are not touched.
    """

    pattern: str
    what: Material | Glass | Emitter | Air
    faces: str | None
    layer: str | None
    color: str | None
    models: frozenset[str]

    @property
    def label(self) -> str:
        """How error messages call it."""
        narrowed = [
            f"{key}={value!r}"
            for key in ("faces", "layer", "color")
            if (value := getattr(self, key)) is not None
        ]
        return ", ".join([f"assign {self.pattern!r}", *narrowed])


@dataclass(frozen=True, slots=True)
class Match:
    """Matched faces of one part: rows of the model's faces."""

    entry: str
    part: int
    rows: tuple[int, ...]


def full_path(entry: Entry, part: Part) -> str:
    """Path of a part in the scene."""
    return entry.name if entry.kind != "cad" else f"{entry.name}/{part.path}"


def matched_parts(
    entries: Mapping[str, Entry], pattern: str, *, label: str, models: frozenset[str] | None = None
) -> list[tuple[str, int]]:
    """(model name, part row) of all parts that match ``pattern``.

    Paths start with the model's name. Where that finds nothing, models whose name was not chosen
    by the user are compared without it: their paths start below the file's root. A path as
    ``inspect`` prints it, letter for letter, means that part of any model.
    """
    names = [n for n in entries if models is None or n in models]
    every = [(n, k, part) for n in names for k, part in enumerate(entries[n].model.parts)]
    hits = matching(pattern, [full_path(entries[n], part) for n, _, part in every])
    if not hits:
        free = [i for i, (n, _, _) in enumerate(every) if not entries[n].given_name]
        hits = [free[i] for i in matching(pattern, [every[i][2].path for i in free])]
    if not hits:
        hits = [i for i, (_, _, part) in enumerate(every) if pattern == part.path]
    if not hits:
        paths = [full_path(entries[n], part) for n, _, part in every]
        raise InputError(f"{label}: no part matches{nearest(pattern, paths)}")
    return [every[i][:2] for i in hits]


def nearest(pattern: str, candidates: list[str]) -> str:
    """``; nearest: a, b, c`` for an error message."""
    unique = list(dict.fromkeys(candidates))
    if not unique:
        return "; the scene has no parts"
    if "/" not in pattern:  # such patterns mean the last segment
        by_name: dict[str, str] = {}
        for path in unique:
            by_name.setdefault(path.rsplit("/", 1)[-1], path)
        names = get_close_matches(pattern, list(by_name), n=3, cutoff=0.0)
        return "; nearest: " + ", ".join(by_name[name] for name in names)
    return "; nearest: " + ", ".join(get_close_matches(pattern, unique, n=3, cutoff=0.0))


def matched_faces(entries: Mapping[str, Entry], assignment: Assignment) -> list[Match]:
    """Faces that ``assignment`` means, by part; `InputError` when there is none."""
    found = find_faces(
        entries,
        assignment.pattern,
        label=assignment.label,
        faces=assignment.faces,
        layer=assignment.layer,
        color=assignment.color,
        models=assignment.models,
    )
    if isinstance(assignment.what, Air):
        _check_air(entries, found, assignment)
    if isinstance(assignment.what, Emitter) and assignment.what.side == "back":
        _check_back(entries, found, assignment.label)
    return found


def find_faces(
    entries: Mapping[str, Entry],
    pattern: str,
    *,
    label: str,
    faces: str | None = None,
    layer: str | None = None,
    color: str | None = None,
    models: frozenset[str] | None = None,
) -> list[Match]:
    """Faces of the parts that match, narrowed by a selector, a layer and a colour."""
    hits = matched_parts(entries, pattern, label=label, models=models)
    wanted = None if color is None else srgb8(color, label)
    found = []
    for name, part_row in hits:
        entry = entries[name]
        part = entry.model.parts[part_row]
        if layer is not None and part.layer != layer:
            continue
        rows = entry.face_rows[part_row]
        if faces is not None:
            rows = select(entry, part_row, faces)
        if wanted is not None:
            rows = [
                r for r in rows if _same_color(entry.model.faces[r].color or part.color, wanted)
            ]
        if rows:
            found.append(Match(name, part_row, tuple(rows)))
    if not found:
        paths = ", ".join(full_path(entries[n], entries[n].model.parts[k]) for n, k in hits[:3])
        raise InputError(f"{label}: the pattern matches {len(hits)} parts ({paths}), but no face")
    return found


def row_offsets(entries: Mapping[str, Entry]) -> tuple[dict[str, int], dict[str, int]]:
    """First part row and first face row of every model in the scene's tables."""
    part_start, face_start, parts, faces = {}, {}, 0, 0
    for name, entry in entries.items():
        part_start[name], face_start[name] = parts, faces
        parts += len(entry.model.parts)
        faces += len(entry.model.faces)
    return part_start, face_start


def select(entry: Entry, part_row: int, selector: str) -> list[int]:
    """Rows of the model's faces that a selector means.

    Up, down and vertical are directions of the scene, seen from the active side; CadQuery
    selectors see the shape as it is in its file.
    """
    from patchlight.importers import select_faces

    directions = ("up", "down", "vertical")
    model = entry.placed if selector.strip() in directions else entry.model
    return list(select_faces(model, part_row, selector))


def _check_air(entries: Mapping[str, Entry], found: list[Match], assignment: Assignment) -> None:
    if assignment.faces is not None:
        raise InputError(f"{assignment.label}: air is a whole part; leave out faces")
    for match in found:
        entry = entries[match.entry]
        part = entry.model.parts[match.part]
        if entry.kind != "cad" or part.kind != "solid":
            raise InputError(
                f"{assignment.label}: {full_path(entry, part)} is no closed solid, so it has no "
                "inside that could be air"
            )


def _check_back(entries: Mapping[str, Entry], found: list[Match], label: str) -> None:
    for match in found:
        entry = entries[match.entry]
        part = entry.model.parts[match.part]
        if entry.kind == "patches" or (entry.kind == "cad" and part.kind != "sheet"):
            raise InputError(
                f"{label}: side 'back' of {full_path(entry, part)} is not lit or seen; only "
                "sheets have a back"
            )


def srgb8(color: str, label: str) -> np.ndarray:
    """8-bit sRGB (3,) of ``#rrggbb``."""
    text = color.removeprefix("#")
    try:
        if len(text) != 6:
            raise ValueError
        return np.array([int(text[k : k + 2], 16) for k in (0, 2, 4)])
    except ValueError:
        raise InputError(f"{label}: color {color!r}: write it as #rrggbb") from None


def _same_color(linear: tuple[float, float, float] | None, wanted: np.ndarray) -> bool:
    if linear is None:
        return False
    c = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    # IEC 61966-2-1: linear to sRGB.
    encoded = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055)
    return bool((np.abs(255.0 * encoded - wanted) <= COLOR_STEPS).all())
