"""Cuts of the scene with a plane: the walls, columns and furniture drawn in plans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import PatchSet

#: Cells drawn at most for the cut of a whole scene.
_MAX_CELLS = 400_000


def patch_triangles(patches: PatchSet) -> NDArray[np.float64]:
    """Triangles (t, 3, 3) of a display grid on every patch, finer when there are few. [m]"""
    n = len(patches)
    if n == 0:
        return np.zeros((0, 3, 3))
    k = int(np.clip(np.sqrt(_MAX_CELLS / n), 1, 12))
    t = np.linspace(0.0, 1.0, k + 1)
    points = patches.evaluate(t[:, None], t[None, :])
    a, b, c, d = points[:, :-1, :-1], points[:, 1:, :-1], points[:, 1:, 1:], points[:, :-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)])
    return np.asarray(triangles.reshape(-1, 3, 3))


def cut(
    triangles: NDArray[np.float64], origin: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Segments (s, 2, 3) in which the triangles (t, 3, 3) meet the plane. [m]"""
    height = (triangles - origin) @ normal
    # A corner exactly on the plane counts as above: each crossing is found once.
    above = height >= 0.0
    crossing = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    tri, h, up = triangles[crossing], height[crossing], above[crossing]
    ends = np.empty((len(crossing), 2, 3))
    filled = np.zeros(len(crossing), dtype=np.int64)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        rows = np.flatnonzero(up[:, i] != up[:, j])
        t = h[rows, i] / (h[rows, i] - h[rows, j])
        ends[rows, filled[rows]] = tri[rows, i] + t[:, None] * (tri[rows, j] - tri[rows, i])
        filled[rows] += 1
    return ends
