"""A set of patches in the form of a CAD model, so that scenes treat both alike."""

from __future__ import annotations

import hashlib

import numpy as np
from patchlight.solver.model import Certificate, Face, Model, Part, PatchSet


def model_of_patches(patches: PatchSet, name: str) -> Model:
    """Model with one part named ``name``; patches that share a face index are one face."""
    values, face_index = np.unique(patches.face_index, return_inverse=True)
    areas = np.bincount(face_index, weights=patches.areas(), minlength=len(values))
    counts = np.bincount(face_index, minlength=len(values))
    faces = tuple(
        Face(0, k + 1, "bezier", True, int(counts[k]), 0.0, 0.0, float(areas[k]))
        for k in range(len(values))
    )
    one_part = PatchSet(
        patches.control_points,
        face_index,
        np.zeros(len(patches), dtype=np.int64),
        patches.edge_index,
    )
    return Model(
        name=name,
        parts=(Part(name, "sheet", instance_of=0),),
        faces=faces,
        patches=one_part,
        certificate=Certificate((), ()),
        sha256=hashlib.sha256(patches.control_points.tobytes()).hexdigest(),
        unit="m",
    )
