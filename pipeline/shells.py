"""Closed shells of the solids of a model: outsides, and voids that no light can enter."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model import Model, PatchSet
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import gauss_rule, tangents


def part_shells(model: Model, part_row: int) -> list[np.ndarray]:
    """Patch rows of each connected shell of a part, joined along shared B-rep edges."""
    rows = np.flatnonzero(model.patches.part_index == part_row)
    parent: dict[int, int] = {}

    def root(face: int) -> int:
        while parent.setdefault(face, face) != face:
            parent[face] = parent[parent[face]]
            face = parent[face]
        return face

    first_face: dict[int, int] = {}
    faces = model.patches.face_index
    for row in rows:
        face = root(int(faces[row]))
        for edge in model.patches.edge_index[row]:
            if edge >= 0:
                other = root(first_face.setdefault(int(edge), face))
                parent[other] = root(face)
    roots = np.array([root(int(faces[row])) for row in rows])
    return [rows[roots == r] for r in dict.fromkeys(roots.tolist())]


def enclosed_volume(patches: PatchSet) -> float:
    """Volume that closed ``patches`` enclose, negative when +normals point inwards. [m³]

    Divergence theorem, V = 1/3 ∮ x · n dA, by 6 x 6 Gauss points a patch.
    """
    x, w = gauss_rule(6)
    u, v = np.meshgrid(x, x, indexing="ij")
    total = 0.0
    origin = _centre(patches)
    for net in patches.control_points:
        point, su, sv = tangents(net, u, v)
        flux = np.einsum("abk,abk->ab", point - origin, np.cross(su, sv))
        total += float(w @ flux @ w)
    return total / 3.0


def _centre(patches: PatchSet) -> FloatArray:
    low, high = patches.bounds()
    return 0.5 * (low + high)
