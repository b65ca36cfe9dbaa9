"""Radiosity in a box with a window under the overcast sky, mirror-symmetric in x.

The collocation of `truth_room` on half of the room, on meshes with borders at the heights of sill
and head, where what the walls get of the sky has kinks. Direct light is a sum by Gauss' rule over
the part of the opening above each point's horizon [1], at the sensors' cells too: only what is
reflected is interpolated.

References
----------
.. [1] P. Moon and D. E. Spencer, "Illumination from a non-uniform sky", Illuminating Engineering
   37, 1942, pp. 707-726: L = (1 + 2 sin γ) / 3 of the zenith's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import truth_room
from patchlight.solver.model.arrays import FloatArray
from scipy.interpolate import RegularGridInterpolator
from truth_room import FACES

#: Points of Gauss' rule over the opening: nothing lies nearer to it than 0.4 m, for which 32 leave
#: 1e-6 at worst.
_ORDER = 48
#: Meshes, by cells a coarsest cell, and weights that cancel errors of h² and h⁴.
_MESHES, _WEIGHTS = (1, 2, 3), (1.0 / 24.0, -16.0 / 15.0, 81.0 / 40.0)


@dataclass(frozen=True, eq=False)
class WindowRoom(truth_room.Room):
    """A box with an opening in the wall y = 0: (x0, x1, z0, z1), zenith luminance 1.

    ``lines`` run from 0 to half the width in x, and over all the room in y and z.
    """

    opening: tuple[float, float, float, float]


def irradiance(room: WindowRoom, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance (n,) at sensors whose normals point along axes. [W/m²]"""
    total = direct(room, points, normals)
    for pieces, weight in zip(_MESHES, _WEIGHTS, strict=True):
        total += weight * _gather(room, pieces, points, normals)
    return total


def direct(
    room: WindowRoom, points: FloatArray, normals: FloatArray, order: int = _ORDER
) -> FloatArray:
    """Irradiance (n,) that comes from the sky. [W/m²]"""
    t, w = np.polynomial.legendre.leggauss(order)
    t, w = 0.5 * (t + 1.0), 0.5 * w
    x0, x1, z0, z1 = room.opening
    out = np.zeros(len(points))
    for start in range(0, len(points), 500):
        p, n = points[start : start + 500], normals[start : start + 500]
        low = np.clip(p[:, 2], z0, z1)
        dx = (x0 + (x1 - x0) * t)[None, :, None] - p[:, 0, None, None]
        dz = (low[:, None] + (z1 - low)[:, None] * t - p[:, 2, None])[:, None, :]
        dy = -p[:, 1, None, None]
        square = dx * dx + dy * dy + dz * dz
        r = np.sqrt(np.maximum(square, 1e-300))
        up = np.maximum(n[:, 0, None, None] * dx + n[:, 1, None, None] * dy
                        + n[:, 2, None, None] * dz, 0.0)  # fmt: skip
        light = (1.0 + 2.0 * dz / r) / 3.0 * up * -dy / np.maximum(square, 1e-300) ** 2
        area = (x1 - x0) * (z1 - low)
        out[start : start + 500] = area * np.einsum("nab,a,b->n", light, w, w)
    return out


class _Mesh(truth_room._Mesh):
    @classmethod
    def of(cls, room: truth_room.Room, pieces: int) -> _Mesh:
        x, y, z = room.lines
        divided = truth_room._divided
        return cls(
            (divided(x, pieces, room.size[0]), divided(y, pieces, None), divided(z, pieces, None))
        )


def _cells(room: WindowRoom, mesh: _Mesh, face: int) -> tuple[FloatArray, FloatArray]:
    """Centres (a, b, 3) and normals (a, b, 3) of the cells of one face."""
    axis, end, i, j = FACES[face]
    u, v = mesh.centers(i), mesh.centers(j)
    at = np.zeros((len(u), len(v), 3))
    at[..., i], at[..., j], at[..., axis] = u[:, None], v[None, :], room.size[axis] * end
    normals = np.zeros_like(at)
    normals[..., axis] = -1.0 if end else 1.0
    return at, normals


def _reflectance(room: WindowRoom, mesh: _Mesh, face: int) -> FloatArray:
    out = truth_room._reflectance(room, mesh, face)
    if FACES[face][:2] == (1, 0):
        x, z = mesh.centers(0)[:, None], mesh.centers(2)[None, :]
        x0, x1, z0, z1 = room.opening
        out[(x > x0) & (x < x1) & (z > z0) & (z < z1)] = 0.0
    return out


def _reflected(room: WindowRoom, mesh: _Mesh) -> list[FloatArray]:
    """Irradiance (a, b) from other surfaces on the cells of every face."""
    cells = [_cells(room, mesh, face) for face in range(6)]
    rho = [_reflectance(room, mesh, face) for face in range(6)]
    half = len(mesh.centers(0)) // 2
    faces = (0, 1, 2, 4, 5)  # the wall at x = 0 stands for that opposite
    kept = [slice(None) if face == 2 else slice(half) for face in faces]
    shapes = [cells[f][0][k].shape[:2] for f, k in zip(faces, kept, strict=True)]
    ends = np.cumsum([0] + [a * b for a, b in shapes])
    matrix, first = np.empty((ends[-1], ends[-1])), np.empty(ends[-1])
    for face, keep, r0 in zip(faces, kept, ends, strict=False):
        at, normals = (a[keep].reshape(-1, 3) for a in cells[face])
        first[r0 : r0 + len(at)] = direct(room, at, normals)
        for start in range(0, len(at), 200):
            p, n = at[start : start + 200], normals[start : start + 200]
            f = [truth_room._factors(room, mesh, k, p, n) * rho[k][None] for k in range(6)]
            folded = [f[2] + f[3] if k == 2 else f[k][:, :half] + f[k][:, : half - 1 : -1]
                      for k in faces]  # fmt: skip
            row = slice(r0 + start, r0 + start + len(p))
            matrix[row] = np.concatenate([g.reshape(len(g), -1) for g in folded], axis=1)
    solved = np.linalg.solve(np.eye(len(matrix)) - matrix, matrix @ first)
    out = []
    for face, r0, shape in zip(faces, ends, shapes, strict=False):
        part = solved[r0 : r0 + shape[0] * shape[1]].reshape(shape)
        out += [part, part] if face == 2 else [np.concatenate([part, part[::-1]], axis=0)]
    return out


def _gather(room: WindowRoom, pieces: int, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Reflected irradiance (n,) at the sensors."""
    mesh, fine = _Mesh.of(room, pieces), _Mesh.of(room, 3 * pieces)
    total = np.zeros(len(points))
    for face, values in enumerate(_reflected(room, mesh)):
        _, _, i, j = FACES[face]
        at = RegularGridInterpolator(
            (mesh.centers(i), mesh.centers(j)), values, "cubic", bounds_error=False, fill_value=None
        )
        grid = np.stack(np.meshgrid(fine.centers(i), fine.centers(j), indexing="ij"), axis=-1)
        cells, outward = (a.reshape(-1, 3) for a in _cells(room, fine, face))
        arriving = at(grid) + direct(room, cells, outward).reshape(grid.shape[:2])
        exitance = arriving * _reflectance(room, fine, face)
        for normal in np.unique(normals, axis=0):
            rows = (normals == normal).all(axis=1)
            f = truth_room._factors(room, fine, face, points[rows], normals[rows])
            total[rows] += np.einsum("nab,ab->n", f, exitance)
    return total
