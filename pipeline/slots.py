"""What every face is made of, a material or glass, and its lamp: the last assignment wins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.model import BLACK, Emitter, Glass, Material
from patchlight.solver.model.bands import LUMINANCE_WEIGHTS, band_means, primary_reflectance
from patchlight.solver.model.reflectance import Reflectance

from .assigning import matched_faces, row_offsets

if TYPE_CHECKING:
    from .scene import Scene

#: Material of faces that were given none.
DEFAULT = Material(0.5, name="default grey 0.5")
#: Reflectances that a CAD colour can stand for: paints are neither black nor perfect.
COLOR_RANGE = (0.05, 0.9)


@dataclass(slots=True)
class Slots:
    """What was assigned; f faces counted through the scene.

    Attributes
    ----------
    material, luminaire : (f, 2) int array
        Rows of ``materials`` and ``lamps`` for the + and − side.
    default_faces : (f,) bool array
        Faces on the default material.
    lamps : list of (part row, Emitter)
        One a part and assignment.
    glass : list of Glass or None
        Of each face.
    order : (f,) int array
        Number of the last assignment to each face, −1 where there is none.
    """

    material: np.ndarray
    luminaire: np.ndarray
    default_faces: np.ndarray
    materials: tuple[Material, ...]
    lamps: list[tuple[int, Emitter]]
    glass: list[Glass | None]
    order: np.ndarray


def filled_slots(scene: Scene) -> Slots:
    """Resolve all assignments of ``scene``."""
    part_start, face_start = row_offsets(scene.entries)
    faces = sum(len(entry.model.faces) for entry in scene.entries.values())
    given: list[Material | Glass | None] = [None] * faces
    lamp_of_face = np.full(faces, -1)
    lamps: list[tuple[int, Emitter]] = []
    order = np.full(faces, -1)
    for number, assignment in enumerate(scene.assignments):
        for match in matched_faces(scene.entries, assignment):
            part_row = part_start[match.entry] + match.part
            rows = face_start[match.entry] + np.asarray(match.rows)
            order[rows] = number
            if isinstance(assignment.what, Emitter):
                lamp_of_face[rows] = len(lamps)
                lamps.append((part_row, assignment.what))
            elif isinstance(assignment.what, Material | Glass):
                for row in rows:
                    given[row] = assignment.what
    lamps, lamp_of_face = _used(lamps, lamp_of_face)
    table: dict[Material, int] = {}
    material = np.full((faces, 2), BLACK)
    default = np.zeros(faces, dtype=bool)
    glass: list[Glass | None] = [None] * faces
    colors = _cad_colors(scene) if scene.colors == "reflectance" else [None] * faces
    for row in range(faces):
        front = given[row] or colors[row]
        if isinstance(front, Glass):
            glass[row] = front
            continue
        if front is None:
            if lamp_of_face[row] >= 0:
                continue  # an emitting face without a material reflects nothing
            front, default[row] = DEFAULT, True
        back = front.back or front
        material[row] = [_row_of(m, table) for m in (front, back)]
    luminaire = np.full((faces, 2), -1)
    for row in np.flatnonzero(lamp_of_face >= 0):
        side = lamps[lamp_of_face[row]][1].side
        luminaire[row] = [
            lamp_of_face[row] if side in ("both", here) else -1 for here in ("front", "back")
        ]
    return Slots(material, luminaire, default, tuple(table), lamps, glass, order)


def _used(
    lamps: list[tuple[int, Emitter]], lamp_of_face: np.ndarray
) -> tuple[list[tuple[int, Emitter]], np.ndarray]:
    """Lamps that still own a face after later assignments, renumbered."""
    kept = sorted({int(k) for k in lamp_of_face if k >= 0})
    number = {old: new for new, old in enumerate(kept)}
    renumbered = np.array([number.get(int(k), -1) for k in lamp_of_face], dtype=np.int64)
    return [lamps[k] for k in kept], renumbered


def _row_of(material: Material, table: dict[Material, int]) -> int:
    """Row of a material in ``table``, to which it is added if it is new.

    Others that it would be named alike without having a name are told apart by a number.
    """
    named = _named(material)
    if not material.name and named not in table:
        taken, plain, number = {m.name for m in table}, named.name, 2
        while named not in table and named.name in taken:
            named, number = replace(named, name=f"{plain} ({number})"), number + 1
    return table.setdefault(named, len(table))


def _named(material: Material) -> Material:
    """The material without its back, named after what it reflects where it has no name."""
    name = material.name
    if not name:
        name = _shares("grey", "rgb", material.reflectance)
        if material.is_glossy:
            name += f", specular {_shares('', '', material.specular)} n {material.exponent:g}"
        if material.is_mirror:
            name += f", mirror {_shares('', '', material.mirror)}"
    return replace(material, back=None, name=name)


def _shares(grey: str, rgb: str, r: Reflectance) -> str:
    if np.ndim(r) == 2:
        low, high = (pair[0] for pair in (r[0], r[-1]))  # type: ignore[index]
        level = primary_reflectance(band_means(*np.array(r).T, held=True)) @ LUMINANCE_WEIGHTS
        return f"spectrum {low:g} to {high:g} nm, {level:.3g}"
    values = (grey, f"{r:g}") if isinstance(r, float) else (rgb, *(f"{x:g}" for x in r))
    return " ".join(text for text in values if text)


def _cad_colors(scene: Scene) -> list[Material | None]:
    """Grey of the luminance of each face's CAD colour."""
    found: list[Material | None] = []
    for entry in scene.entries.values():
        for face in entry.model.faces:
            color = face.color or entry.model.parts[face.part].color
            if color is None:
                found.append(None)
                continue
            y = float(np.clip(np.dot(color, LUMINANCE_WEIGHTS), *COLOR_RANGE))
            found.append(Material(y, name=f"colour, grey {y:.2f}"))
    return found
