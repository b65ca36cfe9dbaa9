"""Scenes of bodies named a, b, c, … without materials of interest."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model import BLACK, Material, PatchSet, SceneData, SceneFace, ScenePart


def scene_of(*bodies, **more):
    """Scene of (PatchSet, kind) bodies named a, b, c, …"""
    sets, parts = [], []
    for k, (patches, kind) in enumerate(bodies):
        n = len(patches)
        sets.append(
            PatchSet(patches.control_points, np.arange(n) + sum(map(len, sets)), np.full(n, k))
        )
        parts.append(ScenePart("abcdefgh"[k], "model", kind))
    patches = PatchSet.concatenated(*sets)
    n = len(patches)
    kinds = np.array([parts[p].kind for p in patches.part_index])
    arrays = dict(
        two_sided=kinds == "sheet",
        closed=(kinds == "solid") | (kinds == "air"),
        material_index=np.zeros((n, 2), dtype=int),
        luminaire_index=np.full((n, 2), BLACK),
    )
    return SceneData(
        patches=patches,
        parts=tuple(parts),
        faces=tuple(SceneFace(int(p), 1, "plane") for p in patches.part_index),
        materials=(Material(),),
        **(arrays | more),
    )
