"""Models for scene tests, small enough to be written by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from patchlight.solver.model import Certificate, Face, Model, Part, PatchSet


def box_model(
    name: str = "house",
    boxes: dict[str, tuple[tuple, tuple, bool]] | None = None,
    *,
    colors: dict[str, tuple[float, float, float]] | None = None,
    kind: str = "solid",
) -> Model:
    """Model of boxes: path to (size, centre, inward); every side of a box is a face."""
    boxes = boxes or {"room": ((4.0, 3.0, 2.8), (2.0, 1.5, 1.4), True)}
    colors = colors or {}
    parts, faces, sets = [], [], []
    for row, (path, (size, center, inward)) in enumerate(boxes.items()):
        parts.append(Part(path, kind, color=colors.get(path), instance_of=row))
        patches = PatchSet.box(size, center, inward=inward)
        sets.append(
            dataclasses.replace(
                patches,
                face_index=patches.face_index + len(faces),
                part_index=np.full(len(patches), row),
            )
        )
        faces += [
            Face(row, k + 1, "plane", True, 1, 0.0, 0.0, float(a))
            for k, a in enumerate(patches.areas())
        ]
    certificate = Certificate(tuple(faces), tuple(p.path for p in parts))
    patches = PatchSet.concatenated(*sets)
    return Model(name, tuple(parts), tuple(faces), patches, certificate, sha256="0" * 64)


@pytest.fixture
def make_model():
    """`box_model`, for tests that build their own."""
    return box_model


@pytest.fixture
def house() -> Model:
    """A room 4 x 3 x 2.8 m as an inward box, with two lamps and a desk in it."""
    return box_model(
        "house",
        {
            "room": ((4.0, 3.0, 2.8), (2.0, 1.5, 1.4), True),
            "lights/lamp:1": ((0.4, 0.2, 0.1), (1.0, 1.5, 2.5), False),
            "lights/lamp:2": ((0.4, 0.2, 0.1), (3.0, 1.5, 2.5), False),
            "desk": ((1.4, 0.7, 0.7), (2.0, 1.5, 0.35), False),
        },
        colors={"desk": (0.5, 0.25, 0.1)},
    )


@pytest.fixture
def folder(tmp_path, monkeypatch, house):
    """A folder with a room.step whose reading gives `house`."""
    (tmp_path / "room.step").write_text("ISO-10303-21;")
    monkeypatch.setattr("patchlight.importers.read_step", lambda path, **options: house)
    return tmp_path
