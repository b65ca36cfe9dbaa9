"""Faces of a part chosen by direction, number, name, colour or CadQuery selector."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Model
from patchlight.solver.model.arrays import FloatArray, IntArray

from .describe import hex_color

if TYPE_CHECKING:
    from pathlib import Path

#: A face counts as up, down or vertical within this angle. [deg]
DIRECTION_TOLERANCE_DEG = 5.0


def part_row(model: Model, part: str | int) -> int:
    """Row of a part given by its path, its name or its row."""
    if isinstance(part, int | np.integer):
        if not 0 <= part < len(model.parts):
            raise InputError(f"part = {part}: the model has parts 0 to {len(model.parts) - 1}")
        return int(part)
    for key in ("path", "name"):
        rows = [i for i, p in enumerate(model.parts) if getattr(p, key) == part]
        if len(rows) == 1:
            return rows[0]
    known = ", ".join(p.path for p in model.parts[:5])
    raise InputError(f"part {part!r}: not found in model {model.name!r} (parts: {known}, ...)")


def cad_face(model: Model, part: str | int, number: int) -> Any:
    """The face of the CAD kernel (`TopoDS_Face`) behind a row of the certificate.

    Parameters
    ----------
    part : str or int
        Path, name or row of the part.
    number : int
        Number of the face within the part, from 1, as ``inspect`` prints it.

    Returns
    -------
    TopoDS_Face
        In part coordinates and the unit of the CAD kernel; for models read from a file the file
        is read again.

    Raises
    ------
    InputError
        If there is no such part or face, or the shapes are gone.
    """
    faces = _shapes(model)[part_row(model, part)]
    if not 1 <= number <= len(faces):
        raise InputError(f"part {part!r}: face {number}: has faces 1 to {len(faces)}")
    return faces[number - 1]


def _shapes(model: Model) -> list[list[Any]]:
    from .cadquery_model import SHAPES, remember

    found = SHAPES.get(id(model.patches.control_points))
    if found is None:
        if model.source in ("cadquery", "memory"):
            raise InputError(f"model {model.name!r}: its CAD shapes are not kept in memory")
        found = _read_again(model)
        remember(model, found)
    return found


def _read_again(model: Model) -> list[list[Any]]:
    from pathlib import Path

    from .extract import faces_of
    from .occurrences import bodies
    from .step import checked_content
    from .xcaf import read_document

    path: Path = Path(model.source)
    checked_content(path)
    occurrences, _ = read_document(str(path))
    return [faces_of(b.shape) for b in bodies(occurrences)]


def _mean_normals(model: Model, rows: list[int]) -> tuple[FloatArray, FloatArray]:
    """Unit vector areas (n, 3) of faces and how flat they are (|vector area| / area)."""
    from .moments import volume_and_vector

    normals, flatness = [], []
    for row in rows:
        nets = model.patches.control_points[model.patches.face_index == row]
        if not len(nets):
            normals.append(np.zeros(3))
            flatness.append(0.0)
            continue
        _, vector, area = volume_and_vector(nets, order=4)
        length = float(np.linalg.norm(vector))
        normals.append(vector / length if length > 0.0 else vector)
        flatness.append(length / area if area > 0.0 else 0.0)
    return np.array(normals).reshape(-1, 3), np.array(flatness)


def select_faces(model: Model, part: str | int, selector: str | None) -> list[int]:
    """Rows of `Model.faces` of one part that a selector picks.

    Parameters
    ----------
    selector : str or None
        ``up``, ``down``, ``vertical`` (flat faces by their +normal, within 5 degrees, z up; a
        curved face counts as vertical when all its normals are horizontal); ``#7``, the number in
        ``inspect``; a face's own name; a colour ``#ffcc00``; else a CadQuery selector string such
        as ``>Z`` or ``|Z``. None takes all faces.

    Raises
    ------
    InputError
        If the selector cannot be read. An empty list means that nothing matches.
    """
    row = part_row(model, part)
    rows = [i for i, f in enumerate(model.faces) if f.part == row]
    if selector is None:
        return rows
    text = selector.strip()
    if text in ("up", "down", "vertical"):
        return _by_direction(model, rows, text)
    if re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        return [i for i in rows if _same_color(_color_of(model, i), text)]
    if re.fullmatch(r"#\d+", text):
        number = int(text[1:])
        if not 1 <= number <= len(rows):
            raise InputError(
                f"faces = {selector!r}: part {model.parts[row].path!r} has faces 1 to {len(rows)}"
            )
        return [i for i in rows if model.faces[i].number == number]
    named = [i for i in rows if model.faces[i].name == text]
    return named or _by_cadquery(model, row, rows, text)


def _color_of(model: Model, i: int) -> str | None:
    face = model.faces[i]
    return hex_color(face.color or model.parts[face.part].color)


def _same_color(found: str | None, wanted: str) -> bool:
    """Whether two ``#rrggbb`` agree to one step a channel: files store rounded floats."""
    if found is None:
        return False
    pairs = ((int(found[k : k + 2], 16), int(wanted[k : k + 2], 16)) for k in (1, 3, 5))
    return all(abs(a - b) <= 1 for a, b in pairs)


def _by_direction(model: Model, rows: list[int], word: str) -> list[int]:
    limit = np.sin(np.radians(DIRECTION_TOLERANCE_DEG))
    if word == "vertical":
        grid = np.array([0.15, 0.5, 0.85])
        u, v = (a.ravel() for a in np.meshgrid(grid, grid))
        out = []
        for i in rows:
            mask: IntArray = np.flatnonzero(model.patches.face_index == i)
            if not len(mask):
                continue
            z = model.patches.take(mask).normals(u, v)[..., 2]
            if np.nanmax(np.abs(z)) <= limit:
                out.append(i)
        return out
    normals, flat = _mean_normals(model, rows)
    sign = 1.0 if word == "up" else -1.0
    cosine = np.cos(np.radians(DIRECTION_TOLERANCE_DEG))
    return [
        i for i, n, f in zip(rows, normals, flat, strict=True) if sign * n[2] >= cosine and f > 0.99
    ]


def _by_cadquery(model: Model, row: int, rows: list[int], text: str) -> list[int]:
    import cadquery as cq
    from pyparsing import ParseException

    shapes = _shapes(model)[row]
    # The selector speaks of directions in the model, so the faces are put where the part stands.
    placement = np.asarray(model.parts[row].placement)
    location = _location(placement)
    faces = [cq.Face(s.Moved(location) if location is not None else s) for s in shapes]
    try:
        chosen = cq.StringSyntaxSelector(text).filter(faces)
    except ParseException:
        raise InputError(
            f"faces = {text!r}: not up, down, vertical, #number, a face name, a colour or a "
            "CadQuery selector"
        ) from None
    picked = {id(f) for f in chosen}
    return [i for i, f in zip(rows, faces, strict=True) if id(f) in picked]


def _location(placement: FloatArray) -> Any:
    """Location of the rotation of a placement; None for the identity or a mirror image."""
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    r = placement[:3, :3]
    if np.allclose(r, np.eye(3)) or not np.allclose(r @ r.T, np.eye(3)) or np.linalg.det(r) < 0.0:
        return None
    t = gp_Trsf()
    t.SetValues(*[float(x) for i in range(3) for x in (*r[i], 0.0)])
    return TopLoc_Location(t)
