"""Radiosity in a box with a window under the sky; the box is mirror-symmetric in x.

The collocation of `truth_room` on half of the room, on meshes with borders at the heights of sill
and head, where what the walls get of the sky has kinks. Light that is not symmetric is the sum of
an even and an odd part. Direct light is a sum by Gauss' rule over the part of the opening above
each point's horizon, at the sensors' cells too: only what is reflected is interpolated.

References
----------
.. [1] P. Moon and D. E. Spencer, "Illumination from a non-uniform sky", Illuminating Engineering
   37, 1942, pp. 707-726: L = (1 + 2 sin γ) / 3 of the zenith's.
.. [2] CIE S 011/E:2003, "Spatial distribution of daylight - CIE standard general sky", type 12:
   (1 − exp(−0.32 / sin γ)) (1 + 10 (exp(−3 χ) − exp(−3 π/2)) + 0.45 cos² χ), over its value in the
   zenith; χ is the angle from the sun.
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
#: The same in each of the four parts about the sun, towards which points crowd as the cube of their
#: number: the luminance has a cusp there.
_ORDER_CUSP = 20
#: Meshes, by cells a coarsest cell, and weights that cancel errors of h² and h⁴.
_MESHES, _WEIGHTS = (1, 2, 3), (1.0 / 24.0, -16.0 / 15.0, 81.0 / 40.0)


@dataclass(frozen=True, eq=False)
class WindowRoom(truth_room.Room):
    """A box with an opening in the wall y = 0: (x0, x1, z0, z1), zenith luminance 1.

    ``lines`` run from 0 to half the width in x, and over all the room in y and z. The sky is the
    overcast one [1], or the clear one [2] with its glow about ``sun``, a unit vector outwards.
    """

    opening: tuple[float, float, float, float]
    sun: tuple[float, float, float] | None = None


def irradiance(room: WindowRoom, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance (n,) at sensors whose normals point along axes. [W/m²]"""
    total = direct(room, points, normals)
    for pieces, weight in zip(_MESHES, _WEIGHTS, strict=True):
        total += weight * _gather(room, pieces, points, normals)
    return total


def direct(
    room: WindowRoom, points: FloatArray, normals: FloatArray, order: int | None = None
) -> FloatArray:
    """Irradiance (n,) that comes from the sky. [W/m²]"""
    x0, x1, z0, z1 = room.opening
    out = np.zeros(len(points))
    for start in range(0, len(points), 500):
        p, n = points[start : start + 500], normals[start : start + 500]
        low = np.clip(p[:, 2], z0, z1)
        if room.sun is None:
            (x, wx), (z, wz) = (_rule(a, b, order or _ORDER) for a, b in ((x0, x1), (low, z1)))
        else:
            # Where the sun would be seen in the plane of the opening, or the place next to that.
            away = p[:, 1] / -room.sun[1]
            at = np.clip(p[:, 0] + away * room.sun[0], x0, x1)
            height = np.clip(p[:, 2] + away * room.sun[2], low, z1)
            x, wx = crowded(x0, at, x1, order or _ORDER_CUSP)
            z, wz = crowded(low, height, z1, order or _ORDER_CUSP)
        dx, dz = (x - p[:, 0, None])[:, :, None], (z - p[:, 2, None])[:, None, :]
        dy = -p[:, 1, None, None]
        square = np.maximum(dx * dx + dy * dy + dz * dz, 1e-300)
        up = np.maximum(n[:, 0, None, None] * dx + n[:, 1, None, None] * dy
                        + n[:, 2, None, None] * dz, 0.0)  # fmt: skip
        light = relative_luminance(room.sun, dx, dy, dz, np.sqrt(square)) * up * -dy / square**2
        out[start : start + 500] = np.einsum("nab,na,nb->n", light, wx, wz)
    return out


def _rule(low, high, order: int) -> tuple[FloatArray, FloatArray]:
    """Abscissae and weights (n, order), or (1, order), of Gauss' rule between bounds."""
    t, w = np.polynomial.legendre.leggauss(order)
    low, size = np.atleast_1d(low)[:, None], np.atleast_1d(high - low)[:, None]
    return low + size * 0.5 * (t + 1.0), size * 0.5 * w


def crowded(low, at: FloatArray, high, order: int) -> tuple[FloatArray, FloatArray]:
    """Abscissae and weights (n, 2 order) on both sides of ``at`` (n,), crowded towards it."""
    t, w = _rule(0.0, 1.0, order)
    ends = np.stack(np.broadcast_arrays(low - at, high - at), axis=1)[:, :, None]
    shape = (len(at), 2 * order)
    return (at[:, None, None] + ends * t**3).reshape(shape), (
        np.abs(ends) * 3.0 * t**2 * w
    ).reshape(shape)


def relative_luminance(sun: tuple[float, float, float] | None, dx, dy, dz, r) -> FloatArray:
    """Luminance of the sky in some directions of length ``r``; 1 in the zenith."""
    sine = dz / r
    if sun is None:
        return np.asarray((1.0 + 2.0 * sine) / 3.0)
    cosine = (dx * sun[0] + dy * sun[1] + dz * sun[2]) / r
    # The length of what is across tells small angles to all digits.
    across = np.sqrt(
        (dy * sun[2] - dz * sun[1]) ** 2
        + (dz * sun[0] - dx * sun[2]) ** 2
        + (dx * sun[1] - dy * sun[0]) ** 2
    )
    with np.errstate(divide="ignore"):
        gradation = 1.0 - np.exp(-0.32 / np.maximum(sine, 0.0))
    glow = _glow(np.arctan2(across / r, cosine))
    return np.asarray(gradation * glow / ((1.0 - np.exp(-0.32)) * _glow(np.arccos(sun[2]))))


def _glow(angle) -> FloatArray:
    return np.asarray(
        1.0 + 10.0 * (np.exp(-3.0 * angle) - np.exp(-1.5 * np.pi)) + 0.45 * np.cos(angle) ** 2
    )


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
    # Even and odd light: what cells beyond the middle count.
    signs = (1.0,) if room.sun is None else (1.0, -1.0)
    matrices, first = np.empty((len(signs), ends[-1], ends[-1])), np.empty((2, ends[-1]))
    for face, keep, r0 in zip(faces, kept, ends, strict=False):
        at, normals = (a[keep].reshape(-1, 3) for a in cells[face])
        rows = slice(r0, r0 + len(at))
        first[0, rows] = direct(room, at, normals)
        other = at * (-1.0, 1.0, 1.0) + (room.size[0], 0.0, 0.0)
        first[1, rows] = (
            direct(room, other, normals * (-1.0, 1.0, 1.0)) if room.sun else first[0, rows]
        )
        for start in range(0, len(at), 200):
            p, n = at[start : start + 200], normals[start : start + 200]
            f = [truth_room._factors(room, mesh, k, p, n) * rho[k][None] for k in range(6)]
            row = slice(r0 + start, r0 + start + len(p))
            for sign, matrix in zip(signs, matrices, strict=True):
                folded = [f[2] + sign * f[3] if k == 2
                          else f[k][:, :half] + sign * f[k][:, : half - 1 : -1]
                          for k in faces]  # fmt: skip
                matrix[row] = np.concatenate([g.reshape(len(g), -1) for g in folded], axis=1)
    near, far = np.zeros((2, ends[-1]))
    for sign, matrix in zip(signs, matrices, strict=True):
        part = 0.5 * (first[0] + sign * first[1])
        solved = np.linalg.solve(np.eye(len(matrix)) - matrix, matrix @ part)
        near, far = near + solved, far + sign * solved
    out = []
    for face, r0, shape in zip(faces, ends, shapes, strict=False):
        one, two = (a[r0 : r0 + shape[0] * shape[1]].reshape(shape) for a in (near, far))
        out += [one, two] if face == 2 else [np.concatenate([one, two[::-1]], axis=0)]
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
