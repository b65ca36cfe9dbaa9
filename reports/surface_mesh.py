"""Fine grids on the curved elements, for pictures only: light is computed on the exact patches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import Result, bezier

#: Cells of a whole picture, and the finest grid on an element (a quarter circle needs about 8).
MAX_CELLS, MAX_STEPS = 120_000, 8


@dataclass(frozen=True, slots=True, eq=False)
class DisplayMesh:
    """(k + 1) x (k + 1) points on each of n elements.

    Attributes
    ----------
    points : (n, k + 1, k + 1, 3) array
        On the exact surface. [m]
    values : (n, k + 1, k + 1) array
        Illuminance, interpolated between the elements of a face. [lx]
    normals : (n, k, k, 3) array
        Unit normals of the cells, towards the lit side; zero for degenerate cells.
    cell_areas : (n, k, k) array
        Areas of the cells. [m²]
    element : (n,) int array
        Rows of the result's elements.
    emitting : (n,) bool array
        Elements of luminaires.
    borders : (n, 4) bool array
        Whether the side u=0, u=1, v=0, v=1 lies on the border of a face.
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    normals: NDArray[np.float64]
    cell_areas: NDArray[np.float64]
    element: NDArray[np.int64]
    emitting: NDArray[np.bool_]
    borders: NDArray[np.bool_]

    @property
    def steps(self) -> int:
        """Cells along each side of an element."""
        return self.points.shape[1] - 1

    def thinned(self) -> DisplayMesh:
        """The same elements with one or two cells a side, to judge views with."""
        stride = self.steps if self.steps % 2 else self.steps // 2
        points = np.ascontiguousarray(self.points[:, ::stride, ::stride])
        normals, areas = _cells(points)
        return replace(
            self,
            points=points,
            values=self.values[:, ::stride, ::stride],
            normals=normals,
            cell_areas=areas,
        )

    def quads(self) -> NDArray[np.int64]:
        """Point rows (n, k, k, 4) of the cells, counter-clockwise about the normal."""
        n, k = len(self.points), self.steps
        ids = np.arange(n * (k + 1) ** 2).reshape(n, k + 1, k + 1)
        return np.stack([ids[:, :-1, :-1], ids[:, 1:, :-1], ids[:, 1:, 1:], ids[:, :-1, 1:]], -1)


def display_mesh(
    result: Result, *, max_cells: int = MAX_CELLS, steps: int | None = None
) -> DisplayMesh:
    """Evaluate the elements that receive light; coarser grids when there are many."""
    elements, scene = result.elements, result.scene
    buried = np.asarray(elements.buried)
    rows = np.flatnonzero(~buried.all(axis=1)) if buried.size else np.arange(len(elements))
    n = len(rows)
    k = steps or int(np.clip(np.sqrt(max_cells / max(n, 1)), 1, MAX_STEPS))
    t = np.linspace(0.0, 1.0, k + 1)
    b = bezier.bernstein(t)
    points = np.empty((n, k + 1, k + 1, 3))
    for start in range(0, n, 4096):  # bounds the temporary arrays
        part = slice(start, start + 4096)
        h = np.einsum("ai,bj,nijk->nabk", b, b, elements.nets[rows[part]], optimize=True)
        points[part] = h[..., :3] / h[..., 3:]
    normals, cell_areas = _cells(points)
    patch, side = elements.patch_index[rows], elements.side[rows]
    face = scene.patches.face_index[patch] * 2 + side
    corners = points[:, [0, -1, -1, 0], [0, 0, -1, -1]]
    corner_values = _corner_values(corners, face, result.illuminance_lx[rows])
    lamp = scene.luminaire_index[patch, side] >= 0
    return DisplayMesh(
        points=points,
        values=_bilinear(corner_values, t),
        normals=normals,
        cell_areas=cell_areas,
        element=rows,
        emitting=np.asarray(lamp, dtype=bool),
        borders=_borders(points, face),
    )


def _cells(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals (n, k, k, 3) and areas (n, k, k) of the cells, from their diagonals."""
    diagonal = np.cross(
        points[:, 1:, 1:] - points[:, :-1, :-1], points[:, :-1, 1:] - points[:, 1:, :-1]
    )
    length = np.linalg.norm(diagonal, axis=-1)
    normals = np.divide(
        diagonal, length[..., None], out=np.zeros_like(diagonal), where=length[..., None] > 0.0
    )
    return normals, 0.5 * length


def _keys(points: NDArray[np.float64], group: NDArray[Any]) -> NDArray[np.int64]:
    """Equal integers for points (n, 3) of one group that coincide to 1e-6 of the scene's size."""
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    low = points.min(axis=0)
    size = float(np.max(points.max(axis=0) - low)) or 1.0
    # A third of a cell as offset: coordinates often lie on round fractions of the size.
    cells = np.floor((points - low) / (1e-6 * size) + 0.3333).astype(np.uint64)
    # Mixed into one number, which sorts ten times faster than rows; two different places that mix
    # to the same 64 bits would blur one corner of a picture.
    mixed = np.asarray(group).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    for k in range(3):
        mixed = (mixed ^ cells[:, k]) * np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(29)
    return np.asarray(np.unique(mixed, return_inverse=True)[1]).ravel().astype(np.int64)


def _corner_values(
    corners: NDArray[np.float64], face: NDArray[Any], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean (n, 4) at the corners (n, 4, 3) over the elements of the same face that meet there."""
    if len(corners) == 0:
        return np.zeros((0, 4))
    key = _keys(corners.reshape(-1, 3), np.repeat(face, 4))
    weight = np.bincount(key)
    total = np.bincount(key, weights=np.repeat(values, 4))
    return np.asarray((total / weight)[key].reshape(-1, 4))


def _bilinear(c: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corner values (n, 4) at (0,0), (1,0), (1,1), (0,1) spread over the grid t x t."""
    u, v = t[None, :, None], t[None, None, :]
    c0, c1, c2, c3 = (c[:, i, None, None] for i in range(4))
    return np.asarray((1 - v) * ((1 - u) * c0 + u * c1) + v * ((1 - u) * c3 + u * c2))


def _borders(points: NDArray[np.float64], face: NDArray[Any]) -> NDArray[np.bool_]:
    """Sides that no other element of the face shares; whole or halved neighbours count."""
    if len(points) == 0:
        return np.zeros((0, 4), dtype=bool)
    sides = np.stack([points[:, 0], points[:, -1], points[:, :, 0], points[:, :, -1]], axis=1)
    ends = 0.5 * (sides[:, :, 0] + sides[:, :, -1])
    n = len(points)
    middle = sides[:, :, sides.shape[2] // 2] if sides.shape[2] % 2 else ends
    key = _keys(middle.reshape(-1, 3), np.repeat(face, 4))
    alone = (np.bincount(key)[key] == 1).reshape(n, 4)
    # Where a side meets two halves, its middle is one of their corners, and one of its ends with
    # the middle bounds them: compare with all corners of the face.
    corners = points[:, [0, -1, -1, 0], [0, 0, -1, -1]].reshape(-1, 3)
    both = _keys(
        np.concatenate([middle.reshape(-1, 3), corners]), np.concatenate([np.repeat(face, 4)] * 2)
    )
    is_corner = np.isin(both[: 4 * n], both[4 * n :]).reshape(n, 4)
    # The half's far end is a corner of the big side: its own middle is that side's quarter point.
    quarter = [0.25, 0.75]
    points_at = [sides[:, :, round(q * (sides.shape[2] - 1))] for q in quarter]
    if (sides.shape[2] - 1) % 4 == 0:
        quarters = np.concatenate([p.reshape(-1, 3) for p in points_at])
        shared = _keys(
            np.concatenate([middle.reshape(-1, 3), quarters]),
            np.concatenate([np.repeat(face, 4)] * 3),
        )
        is_half = np.isin(shared[: 4 * n], shared[4 * n :]).reshape(n, 4)
    else:
        is_half = np.zeros((n, 4), dtype=bool)
    straight = np.linalg.norm(sides[:, :, 0] - sides[:, :, -1], axis=-1) > 0.0
    length = np.linalg.norm(np.diff(sides, axis=2), axis=-1).sum(axis=2)
    return np.asarray(alone & ~is_corner & ~is_half & (straight | (length > 0.0)))
