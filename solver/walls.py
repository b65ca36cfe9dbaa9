"""Walls of hollow spheres: from any place of one, all of it is seen by its area.

Two points of a sphere of radius R that are r apart see each other under the same angle to both
normals, cos θ = r / 2R, so that cos² θ / (π r²) = 1 / (4 π R²) however far apart they are [1]. A
part of the wall of area A has the form factor A / (4 π R²) from every other place of it, near or
far, where nothing stands between.

References
----------
.. [1] J. A. Jacquez and H. F. Kuppenheim, "Theory of the integrating sphere", Journal of the
   Optical Society of America 45 (1955), 460–470.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .model.arrays import FloatArray, IntArray, unique_rows

#: Most by which a quadric of size 1 differs from a sphere, centres and radii of what is one sphere
#: from each other against the largest radius, and places on it from it against its radius. The
#: form factor of two places r apart is off by (2R/r)² times as much: by 1e-7 for a tenth of R.
SAME = 1e-9


class Walls(NamedTuple):
    """Which sources lie on the inner sides of spheres; row j of both arrays is the same source.

    Attributes
    ----------
    wall : (n,) int array
        Row of ``wall_spheres``, −1 for other surfaces.
    wall_share : (n,) array
        Area over that of the whole sphere; 0 for other surfaces.
    wall_spheres : (k, 4) array
        Centres and radii. [m]
    """

    wall: np.ndarray
    wall_share: np.ndarray
    wall_spheres: np.ndarray


def no_walls(count: int) -> Walls:
    """Of ``count`` sources of which none is looked for."""
    return Walls(np.full(count, -1), np.zeros(count), np.empty((0, 4)))


def find_walls(quadrics: FloatArray, areas: FloatArray) -> Walls:
    """Walls among surfaces on ``quadrics`` (n, 5, 4), turned to the lit side, of ``areas`` (n,)."""
    out = no_walls(len(areas))
    level = np.trace(quadrics[:, :3, :3], axis1=1, axis2=2) / 3.0
    rows = np.flatnonzero((quadrics[:, 4, 3] > 0.0) & (level < 0.0))
    level = level[rows]
    unequal = quadrics[rows, :3, :3] / level[:, None, None] - np.eye(3)
    even = np.abs(unequal).max(axis=(1, 2), initial=0.0) <= SAME
    rows, level = rows[even], level[even]
    if not len(rows):
        return out
    # level |p|² + 2 b · p + c = 0 in the coordinates of the quadric.
    local = -quadrics[rows, :3, 3] / level[:, None]
    square = (local**2).sum(axis=1) - quadrics[rows, 3, 3] / level
    scale = quadrics[rows, 4, 3]
    spheres = np.column_stack(
        [quadrics[rows, 4, :3] + local / scale[:, None], np.sqrt(np.maximum(square, 0.0)) / scale]
    )
    # Fits to patches of one sphere differ by rounding; rows that fall apart lose nothing else.
    unit = SAME * spheres[:, 3].max()
    found, place = unique_rows(np.round(spheres / unit))
    out.wall[rows] = place
    out.wall_share[rows] = areas[rows] / (4.0 * np.pi * spheres[:, 3] ** 2)
    return out._replace(wall_spheres=found * unit)


def walls_under(
    points: FloatArray, normals: FloatArray, weights: FloatArray, spheres: FloatArray
) -> IntArray:
    """Row of the sphere (k, 4) on whose inner side receivers are, −1 for none: (m,) int.

    Of receivers at points (m, q, 3) with unit normals, all of a weight (m, q) above 0 must be.
    """
    out = np.full(len(points), -1)
    counted = weights > 0.0
    for row, sphere in enumerate(spheres):
        inward, radius = sphere[:3] - points, sphere[3]
        off = np.abs(inward - radius * normals).max(axis=2) <= 2.0 * SAME * radius
        out[(off | ~counted).all(axis=1) & counted.any(axis=1)] = row
    return out
