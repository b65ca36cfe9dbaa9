"""Models and converted parts as files of arrays and JSON, which no other version can misread.

What the reading process hands to its parent and what the cache keeps is the same file.
"""

from __future__ import annotations

import json
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.errors import PatchlightError
from patchlight.solver.model import CadEdges, Certificate, Face, Model, Part, PatchSet
from patchlight.solver.model.arrays import MatrixArray

#: Name of the entry that holds what is no array.
HEAD = "head"
#: What is known of a face, its colour last.
FACE = (
    "part", "number", "kind", "exact", "patches", "deviation_m", "angle_deg", "area_m2",
    "area_error", "gap_m", "free_edge_m", "normals_left_out", "reason", "name", "color",
)  # fmt: skip
#: What is known of edges.
EDGES = ("kind", "part", "faces", "angle_deg")
#: What reading a damaged or foreign file raises.
DAMAGED = (
    OSError, EOFError, KeyError, IndexError, TypeError, ValueError, zipfile.BadZipFile,
    zlib.error, PatchlightError, MemoryError,
)  # fmt: skip

Contents = tuple[dict[str, Any], dict[str, MatrixArray]]


def write(path: Path, head: dict[str, Any], arrays: dict[str, MatrixArray]) -> None:
    """Write a file whole or not at all; ``head`` is what JSON can hold.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    text = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    handle, name = tempfile.mkstemp(prefix=path.stem, suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **{HEAD: text, **arrays})  # type: ignore[arg-type]  # none is a flag
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def read(path: Path) -> Contents:
    """Head and arrays of a file; raises one of `DAMAGED`. Sums of the file are checked."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    return json.loads(arrays.pop(HEAD).tobytes()), arrays


def from_model(model: Model) -> Contents:
    """A model as head and arrays."""
    c, p = model.certificate, model.patches
    head = {
        "name": model.name,
        "parts": [
            (q.path, q.kind, q.color, q.layer, q.material, q.instance_of) for q in model.parts
        ],
        "faces": [
            [getattr(f, name) for name in FACE] for f in model.faces
        ],
        "seconds": c.seconds,
        "reading_seconds": c.reading_seconds,
        "area_seconds": c.area_seconds,
        "notes": c.notes,
        "source": model.source,
        "sha256": model.sha256,
        "unit": model.unit,
        "warnings": model.warnings,
    }  # fmt: skip
    arrays = {
        "placements": np.array([q.placement for q in model.parts]),
        "control_points": p.control_points,
        "face_index": p.face_index,
        "part_index": p.part_index,
        "edge_index": p.edge_index,
        **{f"edge_{name}": getattr(model.edges, name) for name in EDGES},
    }
    return head, arrays


def to_model(contents: Contents) -> Model:
    """The model that `from_model` took apart."""
    head, arrays = contents
    parts = tuple(
        Part(path, kind, _color(color), layer, material, placement, instance_of)
        for (path, kind, color, layer, material, instance_of), placement in zip(
            head["parts"], arrays["placements"], strict=True
        )
    )
    faces = tuple(
        Face(**{**dict(zip(FACE, row, strict=True)), "color": _color(row[-1])})
        for row in head["faces"]
    )
    edges = CadEdges(*(arrays[f"edge_{name}"] for name in EDGES))
    certificate = Certificate(
        faces, tuple(p.path for p in parts), head["seconds"], tuple(head["notes"]),
        head["reading_seconds"], head["area_seconds"], edges.counts(len(parts)),
    )  # fmt: skip
    patches = PatchSet(
        *(arrays[k] for k in ("control_points", "face_index", "part_index", "edge_index"))
    )
    return Model(
        head["name"], parts, faces, patches, certificate, head["source"], head["sha256"],
        head["unit"], tuple(head["warnings"]), edges,
    )  # fmt: skip


def _color(row: list[float] | None) -> tuple[float, float, float] | None:
    return None if row is None else (row[0], row[1], row[2])
