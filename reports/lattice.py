"""Sensor grids as pictures: plane coordinates, regular cells, smooth fields between points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import SensorResult

Array = NDArray[np.float64]

#: Ratio of neighbouring values above which there is an edge of shadow between them.
EDGE = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class PlaneFrame:
    """Plane a grid is drawn in.

    Attributes
    ----------
    origin, right, up, normal : (3,) array
        ``right`` and ``up`` are +x and +y of the scene as its author wrote it, seen from above, for
        horizontal grids. [m]
    horizontal, flat : bool
        Whether north and x, y make sense, and whether the points lie in the plane.
    """

    origin: Array
    right: Array
    up: Array
    normal: Array
    horizontal: bool
    flat: bool

    def project(self, points: Array) -> Array:
        """Plane coordinates (n, 2) of points (n, 3). [m]"""
        # Horizontal plans keep world coordinates, so that the axes can be read against the CAD.
        relative = points if self.horizontal else points - self.origin
        return np.stack([relative @ self.right, relative @ self.up], axis=-1)


def plane_frame(grid: SensorResult, north_deg: float = 0.0) -> PlaneFrame:
    """Drawing plane of ``grid`` from its mean normal.

    Results are in world axes with north along +y. Plans are drawn in the axes of the scene, in
    which true north lies ``north_deg`` clockwise from +y: the world turned clockwise. [deg]
    """
    points = np.asarray(grid.points, dtype=np.float64)
    normal = np.asarray(grid.normals, dtype=np.float64).mean(axis=0)
    length = float(np.linalg.norm(normal))
    normal = normal / length if length > 1e-3 else np.array([0.0, 0.0, 1.0])
    origin = points.mean(axis=0)
    if abs(normal[2]) > 0.9:
        c, s = math.cos(math.radians(north_deg)), math.sin(math.radians(north_deg))
        right, up, horizontal = np.array([c, s, 0.0]), np.array([-s, c, 0.0]), True
    else:
        up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
        up /= np.linalg.norm(up)
        right, horizontal = np.cross(up, normal), False
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    off_plane = float(np.abs((points - origin) @ normal).max()) if len(points) else 0.0
    return PlaneFrame(origin, right, up, normal, horizontal, off_plane <= 1e-3 * max(extent, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Regular cells of a grid.

    Attributes
    ----------
    u, v : (nu,), (nv,) array
        Cell centres. [m]
    step_u, step_v : float
        Cell size. [m]
    row : (nv, nu) int array
        Sensor of each cell; −1 where the grid has no point.
    """

    u: Array
    v: Array
    step_u: float
    step_v: float
    row: NDArray[np.int64]

    @property
    def edges(self) -> tuple[float, float, float, float]:
        """Outer borders u0, u1, v0, v1. [m]"""
        return (
            float(self.u[0] - 0.5 * self.step_u),
            float(self.u[-1] + 0.5 * self.step_u),
            float(self.v[0] - 0.5 * self.step_v),
            float(self.v[-1] + 0.5 * self.step_v),
        )


def find_lattice(uv: Array, areas: Array) -> Lattice | None:
    """The regular lattice that ``uv`` (n, 2) lies on; None for scattered points or fewer than 2."""
    if len(uv) < 2:
        return None
    extent = float(np.ptp(uv, axis=0).max())
    axes = [_regular_axis(uv[:, k], 1e-4 * extent) for k in range(2)]
    if axes[0] is None or axes[1] is None:
        return None
    (u, step_u, iu), (v, step_v, iv) = axes[0], axes[1]
    # A single row has no spacing across: its cells are as wide as their area says, within what
    # can be seen and still looks like a row.
    largest = float(np.max(areas))
    if step_u == step_v == 0.0:  # all points in one place
        return None
    along = step_u or step_v
    across = float(np.clip(largest / along, max(along, 0.04 * extent), max(along, 0.12 * extent)))
    step_u, step_v = step_u or across, step_v or across
    if len(uv) < 0.15 * len(u) * len(v):
        return None
    row = np.full((len(v), len(u)), -1, dtype=np.int64)
    row[iv, iu] = np.arange(len(uv))
    if np.count_nonzero(row >= 0) != len(uv):  # two points in one cell
        return None
    return Lattice(u, v, step_u, step_v, row)


def _regular_axis(x: Array, tolerance: float) -> tuple[Array, float, NDArray[np.int64]] | None:
    order = np.unique(x)
    distinct = order[np.concatenate([[True], np.diff(order) > tolerance])]
    if len(distinct) == 1:
        return distinct, 0.0, np.zeros(len(x), dtype=np.int64)
    step = float(np.diff(distinct).min())
    index = (x - distinct[0]) / step
    nearest = np.rint(index).astype(np.int64)
    if np.abs(index - nearest).max() > 0.02 or nearest.max() > 4000:
        return None
    return distinct[0] + step * np.arange(nearest.max() + 1), step, nearest


def fill_missing(field: Array) -> Array:
    """NaN cells of a field (nv, nu) replaced by the mean of their neighbours, outwards."""
    field = field.copy()
    while np.isnan(field).any():
        padded = np.pad(field, 1, constant_values=np.nan)
        shifts = np.stack(
            [padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]]
        )
        known = np.isfinite(shifts)
        if not known.any():
            return np.zeros_like(field)
        total = np.where(known, shifts, 0.0).sum(axis=0)
        mean = np.divide(total, known.sum(axis=0), out=np.full(field.shape, np.nan),
                         where=known.any(axis=0))  # fmt: skip
        field = np.where(np.isnan(field), mean, field)
    return field


def upsampling(n: int, factor: int) -> tuple[Array, Array]:
    """Positions and matrix of a smooth interpolation of n >= 2 cell centres to the cells' borders.

    Positions are in cells from the first centre, from −1/2 to n − 1/2. Catmull–Rom cubics inside,
    straight continuation over the outer half cells.
    """
    x = np.linspace(-0.5, n - 0.5, n * factor + 1)
    matrix = np.zeros((len(x), n))
    for row, position in enumerate(x):
        i = int(np.clip(np.floor(position), 0, n - 2))
        t = position - i
        if not 0.0 <= t <= 1.0:
            matrix[row, i], matrix[row, i + 1] = 1.0 - t, t
            continue
        weights = (
            (-1, t * (-0.5 + t * (1.0 - 0.5 * t))),
            (0, 1.0 + t * t * (-2.5 + 1.5 * t)),
            (1, t * (0.5 + t * (2.0 - 1.5 * t))),
            (2, t * t * (-0.5 + 0.5 * t)),
        )
        for offset, w in weights:
            j = i + offset
            if j < 0:  # mirrored through the first value: 2 f0 − f1
                matrix[row, 0] += 2.0 * w
                matrix[row, 1] -= w
            elif j >= n:
                matrix[row, n - 1] += 2.0 * w
                matrix[row, n - 2] -= w
            else:
                matrix[row, j] += w
    return x, matrix


def smooth_field(lattice: Lattice, values: Array) -> tuple[Array, Array, Array]:
    """Field (m, l) of ``values`` (n,) on a finer grid with its coordinates u (l,), v (m,).

    At least 2 x 2 cells; the field stays within the range of the values, and at edges of shadow
    within that of the two neighbours: no isoline stands for a level that no point reaches.
    """
    field = np.where(lattice.row >= 0, values[lattice.row], np.nan)
    field = fill_missing(field)
    nv, nu = field.shape
    factor = int(np.clip(240 // max(nu, nv), 1, 8))
    xu, mu = upsampling(nu, factor)
    xv, mv = upsampling(nv, factor)
    fine = _without_islands(mv @ field @ mu.T, field, xu, xv)
    fine = np.clip(fine, float(values.min()), float(values.max()))
    return lattice.u[0] + xu * lattice.step_u, lattice.v[0] + xv * lattice.step_v, fine


def _without_islands(fine: Array, field: Array, xu: Array, xv: Array) -> Array:
    """``fine`` kept within the range of the four cells of ``field`` around, at edges of shadow.

    Cubics swing beyond the values on both sides of a jump: islands that are not there. The rim of
    half a cell, where values are continued, is left alone.
    """
    nv, nu = field.shape
    corners = np.stack([field[a : nv - 1 + a, b : nu - 1 + b] for a in (0, 1) for b in (0, 1)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    # A cubic feels the steps in the squares around its own too.
    padded = np.pad(high > EDGE * low, 1)
    sharp = np.any([padded[a : nv - 1 + a, b : nu - 1 + b] for a in range(3) for b in range(3)], 0)
    iu, iv = (np.clip(np.floor(x), 0, n - 2).astype(int) for x, n in ((xu, nu), (xv, nv)))
    inside = np.outer((xv >= 0.0) & (xv <= nv - 1.0), (xu >= 0.0) & (xu <= nu - 1.0))
    at = np.ix_(iv, iu)
    return np.where(inside & sharp[at], np.clip(fine, low[at], high[at]), fine)
