"""Radiosity in an empty box that is mirror-symmetric in x and y, by collocation of its own.

Piecewise constant exitance on rectangles that grow away from the edges, collocated at their
centres with exact factors from a point to a rectangle [1, B-3 and B-4], three meshes of half the
cell size each, extrapolated for an error of second order. At the sensors the solved irradiance is
interpolated to cells of a third of the size, for sensors near an edge see the steps.

References
----------
.. [1] J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", 3rd ed., B-3
   (parallel) and B-4 (perpendicular rectangle, a corner at the foot of the normal).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from scipy.interpolate import RegularGridInterpolator
from truths import polygon


@dataclass(frozen=True, eq=False)
class Room:
    """A box from the origin to ``size`` [m] with black panels of radiance 1 in its ceiling.

    ``lines`` are the coarsest cells' borders from 0 to half the size in x and y and from 0 to the
    height in z; borders of panels (m, 4; x0, x1, y0, y1) must be among them.

    ``image`` is what light from the half beyond the middle in x counts. Less than 1, that half is
    the image of the other one in a mirror that stands between them and reflects so much; sensors
    are then on this side of it.
    """

    size: tuple[float, float, float]
    floor: float
    walls: float
    ceiling: float
    panels: FloatArray
    lines: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
    image: float = field(default=1.0, kw_only=True)


def irradiance(
    room: Room, points: FloatArray, normals: FloatArray, *, quick: bool = False
) -> FloatArray:
    """Irradiance (n,) at sensors whose normals point along axes, ``quick`` on two meshes. [W/m²]"""
    direct = _direct(room, points, normals)
    one, two = (_gather(room, k, points, normals) for k in (1, 2))
    # Errors of h² leave (4 fine - coarse) / 3, those of h⁴ then (16 fine - coarse) / 15.
    first = np.asarray((4.0 * two - one) / 3.0)
    if quick:
        return direct + first
    second = (4.0 * _gather(room, 4, points, normals) - two) / 3.0
    return direct + np.asarray((16.0 * second - first) / 15.0)


def _direct(room: Room, points: FloatArray, normals: FloatArray) -> FloatArray:
    z = room.size[2]
    total = np.zeros(len(points))
    open_to = ~((normals[:, 2] < 0.0) & (points[:, 2] <= z))
    for x0, x1, y0, y1 in room.panels:
        corners = np.array([[x0, y0, z], [x0, y1, z], [x1, y1, z], [x1, y0, z]])
        share = room.image if x0 >= 0.5 * room.size[0] else 1.0
        total[open_to] += share * polygon(points[open_to], normals[open_to], corners)
    return total


def _divided(lines: tuple[float, ...], pieces: int, whole: float | None) -> FloatArray:
    """Borders with every cell cut into ``pieces``, mirrored up to ``whole``."""
    t = np.arange(pieces) / pieces
    a = np.array(lines)
    cut = np.append((a[:-1, None] + np.diff(a)[:, None] * t).ravel(), a[-1])
    return cut if whole is None else np.concatenate([cut[:-1], whole - cut[::-1]])


#: Faces: axis of the normal, whether at the far end, the axes along and across.
FACES = ((2, 0, 0, 1), (2, 1, 0, 1), (0, 0, 1, 2), (0, 1, 1, 2), (1, 0, 0, 2), (1, 1, 0, 2))


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Borders (k,) of the cells along x, y and z, over the whole room."""

    borders: tuple[FloatArray, FloatArray, FloatArray]

    @classmethod
    def of(cls, room: Room, pieces: int) -> _Mesh:
        x, y, z = room.lines
        return cls(
            (
                _divided(x, pieces, room.size[0]),
                _divided(y, pieces, room.size[1]),
                _divided(z, pieces, None),
            )
        )

    def centers(self, axis: int) -> FloatArray:
        return 0.5 * (self.borders[axis][1:] + self.borders[axis][:-1])


def _reflectance(room: Room, mesh: _Mesh, face: int) -> FloatArray:
    axis, end, i, j = FACES[face]
    rho = (room.walls, room.walls, room.ceiling if end else room.floor)[axis]
    out = np.full((len(mesh.centers(i)), len(mesh.centers(j))), rho)
    if (axis, end) == (2, 1):
        x, y = mesh.centers(0)[:, None], mesh.centers(1)[None, :]
        for x0, x1, y0, y1 in room.panels:
            out[(x > x0) & (x < x1) & (y > y0) & (y < y1)] = 0.0
    return out


def _shares(room: Room, mesh: _Mesh, face: int) -> FloatArray:
    """What the cells of a face count: less where they are images in a mirror."""
    axis, end, i, j = FACES[face]
    x = mesh.centers(0) if i == 0 else np.full(len(mesh.centers(i)), room.size[0] * end)
    beyond = (axis == 0 or i == 0) & (x > 0.5 * room.size[0])
    share = np.where(beyond, room.image, 1.0)
    return np.tile(share[:, None], (1, len(mesh.centers(j))))


def _factors(room: Room, mesh: _Mesh, face: int, points: FloatArray, normals: FloatArray):
    """Factors (n, a, b) from points to the cells of one face."""
    axis, end, i, j = FACES[face]
    away = np.abs(room.size[axis] * end - points[:, axis])[:, None, None]
    s = mesh.borders[i][None, :, None] - points[:, i, None, None]
    t = mesh.borders[j][None, None, :] - points[:, j, None, None]
    out = np.zeros((len(points), s.shape[1] - 1, t.shape[2] - 1))
    turned = int(np.argmax(np.abs(normals[0])))
    if not (np.abs(normals) == np.abs(normals[0])).all() or abs(normals[0, turned]) != 1.0:
        raise ValueError("truth_room: normals must point along one axis")
    sign = normals[0, turned]
    with np.errstate(divide="ignore", invalid="ignore"):
        if turned == axis:
            if (sign > 0.0) != bool(end):
                return out
            p, q = np.hypot(away, s), np.hypot(away, t)
            corner = (s / p * np.arctan(t / p) + t / q * np.arctan(s / q)) / (2.0 * np.pi)
        elif turned == i:
            up = np.maximum(sign * s, 0.0)
            corner = _upright(t, up, away) * sign
        else:
            up = np.maximum(sign * t, 0.0)
            corner = _upright(s, up, away) * sign
    return np.diff(np.diff(np.nan_to_num(corner), axis=1), axis=2)


def _upright(along: FloatArray, up: FloatArray, away: FloatArray) -> FloatArray:
    r = np.hypot(away, up)
    return (np.arctan(along / away) - away / r * np.arctan(along / r)) / (2.0 * np.pi)


def _solved(room: Room, mesh: _Mesh) -> list[FloatArray]:
    """Irradiance on the cells of every face: solved on a quarter, the rest are mirror images."""
    quarter = []
    for axis, end, i, j in FACES:
        if axis < 2 and end:
            continue
        u, v = mesh.centers(i), mesh.centers(j)
        u, v = (c[: len(c) // 2] if k < 2 else c for c, k in ((u, i), (v, j)))
        at = np.zeros((len(u), len(v), 3))
        at[..., i], at[..., j] = u[:, None], v[None, :]
        at[..., axis] = room.size[axis] * end
        normal = np.zeros(3)
        normal[axis] = -1.0 if end else 1.0
        quarter.append((at.reshape(-1, 3), normal, (len(u), len(v))))
    rho = [_reflectance(room, mesh, face) for face in range(6)]
    ends = np.cumsum([0] + [len(at) for at, _, _ in quarter])
    matrix, direct = np.empty((ends[-1], ends[-1])), np.empty(ends[-1])
    for (at, normal, _), r0 in zip(quarter, ends, strict=False):
        normals = np.broadcast_to(normal, at.shape)
        direct[r0 : r0 + len(at)] = _direct(room, at, normals)
        for start in range(0, len(at), 200):
            rows = slice(start, start + 200)
            row = slice(r0 + start, r0 + min(start + 200, len(at)))
            f = [_factors(room, mesh, k, at[rows], normals[rows]) * rho[k][None] for k in range(6)]
            # The far walls are images of the near ones.
            m = room.image
            folded = [_fold(f[0], 0, 1, m), _fold(f[1], 0, 1, m)]
            folded += [_fold(f[2] + m * f[3], 1, 2, m), _fold(f[4] + f[5], 0, 2, m)]
            matrix[row] = np.concatenate([g.reshape(len(g), -1) for g in folded], axis=1)
    solved = np.linalg.solve(np.eye(len(matrix)) - matrix, direct)
    out = []
    for (_, _, shape), r0, (i, j) in zip(
        quarter, ends, ((0, 1), (0, 1), (1, 2), (0, 2)), strict=False
    ):
        part = solved[r0 : r0 + shape[0] * shape[1]].reshape(shape)
        part = np.concatenate([part, part[::-1]], axis=0) if i < 2 else part
        out.append(np.concatenate([part, part[:, ::-1]], axis=1) if j < 2 else part)
    floor, ceiling, x_wall, y_wall = out
    return [floor, ceiling, x_wall, x_wall, y_wall, y_wall]


def _fold(f: FloatArray, i: int, j: int, image: float) -> FloatArray:
    if i < 2:
        half = f.shape[1] // 2
        f = f[:, :half] + (image if i == 0 else 1.0) * f[:, : half - 1 : -1]
    if j < 2:
        half = f.shape[2] // 2
        f = f[:, :, :half] + f[:, :, : half - 1 : -1]
    return f


def _gather(room: Room, pieces: int, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Reflected irradiance (n,) at the sensors."""
    mesh, fine = _Mesh.of(room, pieces), _Mesh.of(room, 3 * pieces)
    total = np.zeros(len(points))
    for face, values in enumerate(_solved(room, mesh)):
        _, _, i, j = FACES[face]
        at = RegularGridInterpolator(
            (mesh.centers(i), mesh.centers(j)), values, "cubic", bounds_error=False, fill_value=None
        )
        grid = np.stack(np.meshgrid(fine.centers(i), fine.centers(j), indexing="ij"), axis=-1)
        exitance = at(grid) * _reflectance(room, fine, face) * _shares(room, fine, face)
        for normal in np.unique(normals, axis=0):
            rows = (normals == normal).all(axis=1)
            f = _factors(room, fine, face, points[rows], normals[rows])
            total[rows] += np.einsum("nab,ab->n", f, exitance)
    return total
