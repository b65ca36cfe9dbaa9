"""Plane figures cut out of patches: outlines of flat faces, and sections of solids.

They only decide where sensors stand; light never sees a polygon.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.model import PatchSet
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

#: Largest sag of a chord, and grid on which points are joined, relative to the size of the scene.
CHORD, SNAP = 2e-5, 1e-8
#: How far a flat face may leave its plane, relative to the size of the scene.
FLAT = 1e-6


def corner_points(patches: PatchSet) -> FloatArray:
    """Euclidean control points (p, 4, 4, 3). [m]"""
    nets = patches.control_points
    return np.asarray(nets[..., :3] / nets[..., 3:])


def boundary(net: FloatArray, size: float) -> FloatArray:
    """Boundary (k, 3) of one net (4, 4, 4), counter-clockwise about its +normal. [m]"""
    sides = (net[:, 0], net[3, :], net[::-1, 3], net[0, ::-1])
    return np.concatenate([_polyline(side, size)[:-1] for side in sides])


def _polyline(curve: FloatArray, size: float) -> FloatArray:
    """Points (k, 3) on a rational cubic (4, 4); straight lines keep their two ends."""
    points = curve[:, :3] / curve[:, 3:]
    chord = points[3] - points[0]
    length = float(np.linalg.norm(chord))
    inner = points[1:3] - points[0]
    if length > 0.0:
        inner = inner - np.outer(inner @ chord / length**2, chord)
    sag = float(np.linalg.norm(inner, axis=1).max())
    # The sag of n chords falls with 1/n².
    n = min(400, max(1, math.ceil(math.sqrt(sag / (CHORD * size)))))
    h = bernstein(np.linspace(0.0, 1.0, n + 1)) @ curve
    return np.asarray(h[:, :3] / h[:, 3:])


def joined(polygons: list[Any], size: float) -> BaseGeometry:
    """Union of polygons that share edges up to rounding."""
    import shapely

    valid = [p if p.is_valid else shapely.make_valid(p) for p in polygons]
    return shapely.union_all(valid, grid_size=SNAP * size)


def plane_polygons(
    patches: PatchSet, origin: FloatArray, e1: FloatArray, e2: FloatArray, size: float
) -> list[Any]:
    """Shapely polygons of flat patches in the coordinates (e1, e2) of their plane. [m]"""
    import shapely

    polygons = []
    for net in patches.control_points:
        loop = boundary(net, size) - origin
        polygon = shapely.Polygon(np.stack([loop @ e1, loop @ e2], axis=-1))
        if polygon.area > 0.0:
            polygons.append(polygon)
    return polygons


def flat_normals(patches: PatchSet, size: float) -> FloatArray:
    """Unit normals (p, 3) of flat patches; NaN where a patch is curved or has no area."""
    points = corner_points(patches).reshape(len(patches), 16, 3)
    normals = np.full((len(patches), 3), np.nan)
    for k, net in enumerate(patches.control_points):
        loop = boundary(net, size)
        centre = loop.mean(axis=0)
        a, b = loop - centre, np.roll(loop, -1, axis=0) - centre
        area = 0.5 * np.cross(a, b).sum(axis=0)
        length = float(np.linalg.norm(area))
        if length <= (FLAT * size) ** 2:
            continue
        n = area / length
        if float(np.abs((points[k] - centre) @ n).max()) <= FLAT * size:
            normals[k] = n
    return normals


def section(patches: PatchSet, z: float, size: float) -> list[Any]:
    """Regions that the surfaces of closed solids cut out of the plane at height ``z`` [m].

    Returns every region that the section curves enclose, whether material or hole: the caller asks
    which by a point of it.
    """
    import shapely

    heights = corner_points(patches)[..., 2]
    spans = (heights.min(axis=(1, 2)) < z) & (heights.max(axis=(1, 2)) >= z)
    segments = [segment for net in patches.control_points[spans] for segment in _cut(net, z, size)]
    if not segments:
        return []
    lines = shapely.union_all(shapely.linestrings(np.array(segments)), grid_size=SNAP * size)
    return list(shapely.get_parts(shapely.polygonize(shapely.get_parts(lines))))


def _cut(net: FloatArray, z: float, size: float) -> list[FloatArray]:
    """Segments (2, 2) in x, y along which one patch crosses the height ``z``."""
    points = net[..., :3] / net[..., 3:]
    bend = max(
        float(np.abs(np.diff(points, n=2, axis=0)).max()),
        float(np.abs(np.diff(points, n=2, axis=1)).max()),
    )
    n = min(64, max(1, math.ceil(math.sqrt(bend / (CHORD * size)))))
    t = np.linspace(0.0, 1.0, n + 1)
    b = bernstein(t)
    grid = np.einsum("ai,bj,ijk->abk", b, b, net)
    above = grid[..., 2] >= z * grid[..., 3]
    segments = []
    for i, j in np.argwhere(_mixed(above)):
        corner = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        for triangle in ((0, 1, 2), (0, 2, 3)):
            ends = []
            for a, c in ((0, 1), (1, 2), (2, 0)):
                p, q = corner[triangle[a]], corner[triangle[c]]
                if above[p] != above[q]:
                    first, second = sorted((p, q))  # neighbours must find the same point
                    ends.append(
                        _crossing(net, (t[first[0]], t[first[1]]), (t[second[0]], t[second[1]]), z)
                    )
            if len(ends) == 2 and not np.array_equal(ends[0], ends[1]):
                segments.append(np.array(ends))
    return segments


def _mixed(above: np.ndarray) -> np.ndarray:
    """Cells whose corners are not all on the same side."""
    count = above[:-1, :-1].astype(int) + above[1:, :-1] + above[:-1, 1:] + above[1:, 1:]
    return np.asarray((count > 0) & (count < 4))


def _crossing(
    net: FloatArray, start: tuple[float, float], end: tuple[float, float], z: float
) -> FloatArray:
    """Point (2,) where the line between two parameter pairs crosses ``z``, by regula falsi."""

    def at(s: float) -> FloatArray:
        u, v = (a + s * (b - a) for a, b in zip(start, end, strict=True))
        h = np.einsum("i,j,ijk->k", bernstein(u), bernstein(v), net)
        return np.asarray(h[:3] / h[3])

    low, high = 0.0, 1.0
    p, q = at(low), at(high)
    middle = p
    for _ in range(8):
        if q[2] == p[2]:
            return np.asarray(p[:2])
        s = low + (high - low) * float(np.clip((z - p[2]) / (q[2] - p[2]), 0.0, 1.0))
        middle = at(s)
        if abs(middle[2] - z) < 1e-12 * max(1.0, abs(z)):
            break
        if (middle[2] >= z) == (p[2] >= z):
            low, p = s, middle
        else:
            high, q = s, middle
    return np.asarray(middle[:2])
