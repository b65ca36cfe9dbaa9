"""Faces that lie on each other and look the same way: one of them carries the light.

A file may hold a face twice, and a lamp's lit face may be drawn once more on its housing. Both
would take and send the light of one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from patchlight.solver.model import BLACK, PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray, IntArray

#: Distance of control points within which two patches are one, relative to the scene's size.
SAME = 1e-7
#: Weights of the six numbers of a box whose sum tells boxes apart: no drawing has these ratios.
_WEIGHTS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])


def with_one_of_each(data: SceneData, order: IntArray) -> SceneData:
    """The scene with dark sides where another face with the same patches looks the same way.

    The emitter wins, then what was given a material, then the later assignment, then the later
    face.

    Parameters
    ----------
    order : (f,) int array
        Number of the last assignment to each face.

    Returns
    -------
    SceneData
        With a note that names the first such face, or as it was.
    """
    patches = data.patches
    material, lamp = np.array(data.material_index), np.array(data.luminaire_index)
    dark: list[tuple[int, int]] = []
    for own, other, alike in _same_faces(patches):
        first, second = (int(patches.face_index[rows[0]]) for rows in (own, other))
        for side in (0, 1):
            there = side if alike else 1 - side
            sides = [(own, side, first), (other, there, second)]
            if any(_is_dark(material[r[0], s], lamp[r[0], s]) for r, s, _ in sides):
                continue
            (rows, s, loser), (_, _, winner) = sorted(
                sides,
                key=lambda x: (
                    lamp[x[0][0], x[1]] >= 0, not data.default_faces[x[2]], order[x[2]], x[2]
                ),
            )  # fmt: skip
            material[rows, s], lamp[rows, s] = BLACK, -1
            dark.append((loser, winner))
    if not dark:
        return data
    names = [f"{data.parts[data.faces[f].part].path} #{data.faces[f].number}" for f in dark[0]]
    count = len({loser for loser, _ in dark})
    note = (
        f"{names[0]} lies on {names[1]} and looks the same way: it is dark"
        if count == 1
        else f"{count} faces lie on others that look the same way and are dark, the first "
        f"{names[0]} on {names[1]}"
    )
    return replace(data, material_index=material, luminaire_index=lamp, notes=(*data.notes, note))


def _is_dark(material: int, lamp: int) -> bool:
    return bool(material == BLACK and lamp < 0)


def _same_faces(patches: PatchSet) -> list[tuple[IntArray, IntArray, bool]]:
    """Rows of the patches of two faces that are the same, and whether they look the same way."""
    order = np.argsort(patches.face_index, kind="stable")
    _, starts = np.unique(patches.face_index[order], return_index=True)
    own = np.split(order, starts[1:])
    points = patches.control_points[..., :3] / patches.control_points[..., 3:]
    low = np.minimum.reduceat(points.min(axis=(1, 2))[order], starts)
    high = np.maximum.reduceat(points.max(axis=(1, 2))[order], starts)
    slack = SAME * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
    boxes = np.concatenate([low, high], axis=1)
    sums = boxes @ _WEIGHTS
    by_sum = np.argsort(sums, kind="stable")
    ends = np.searchsorted(sums[by_sum], sums[by_sum] + slack * _WEIGHTS.sum(), side="right")
    found = []
    for k in np.flatnonzero(ends > np.arange(len(ends)) + 1).tolist():
        i = int(by_sum[k])
        for j in by_sum[k + 1 : ends[k]].tolist():
            near = np.abs(boxes[i] - boxes[j]).max() <= slack and len(own[i]) == len(own[j])
            if near and (alike := _alike(points[own[i]], points[own[j]], slack)) is not None:
                found.append((own[min(i, j)], own[max(i, j)], alike))
    return found


def _alike(a: FloatArray, b: FloatArray, slack: float) -> bool | None:
    """Whether the same patches (n, 4, 4, 3) look the same way; None if they are others."""
    left = np.ones(len(b), dtype=bool)
    senses = set()
    for patch in a:
        for turns in range(8):
            view = b[:, ::-1] if turns & 1 else b
            view = view[:, :, ::-1] if turns & 2 else view
            view = view.swapaxes(1, 2) if turns & 4 else view
            close = left & (np.abs(view - patch).max(axis=(1, 2, 3)) <= slack)
            if close.any():
                left[np.argmax(close)] = False
                senses.add(turns.bit_count() % 2 == 0)
                break
        else:
            return None
    return senses.pop() if len(senses) == 1 else None
