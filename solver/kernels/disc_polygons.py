"""Parts of a disc at infinity that polygons cover, and the light they send: closed forms.

The disc is a circle on the plane perpendicular to its direction. Area and first moments of what a
polygon covers of it are a sum over the polygon's sides, of wedges between the circle's centre and a
side: triangles where the side is within the circle, sectors where it is not.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .ray_patch import WORK

#: How often a blocker is quartered, or its side halved, to tell where its outline passes.
QUARTERINGS = 8
#: Corners of a polygon at most: a square that one edge parts, cut by two horizons.
_CORNERS = 16


class Disc(NamedTuple):
    """What one thread works with; the disc is that of directions s + x e1 + y e2, x² + y² < r²."""

    axes: np.ndarray  # (3, 3) e1, e2 and s
    radius: float  # r
    horizons: np.ndarray  # (2, 3) what is seen has a + b x + c y > 0
    cells: np.ndarray  # (room, 4) lower left corner, side and level of squares
    lists: np.ndarray  # (levels + 1, patches + 1) what may hide squares of a level, and how many
    cell: np.ndarray  # (5, 4, 4) net of a square, and its middle
    sides: np.ndarray  # (patches,) from which each is seen
    planes: np.ndarray  # (8, 3) its pyramid
    edge: np.ndarray  # (4 quarterings + 8, 3) scratch
    parts: np.ndarray  # (3 quarterings + 3, 4, 4, 4) scratch
    shape: np.ndarray  # (2, corners, 2) polygons
    work: np.ndarray  # scratch of rays


@kernel
def make_disc(patches, levels, radius):
    """Scratch for a disc in scenes of so many patches, and so many quarterings."""
    return Disc(
        np.empty((3, 3)),
        radius,
        np.empty((2, 3)),
        np.empty((3 * levels + 4, 4)),
        np.empty((levels + 1, patches + 1), dtype=np.int64),
        np.zeros((5, 4, 4)),
        np.zeros(patches, dtype=np.int64),
        np.empty((8, 3)),
        np.empty((4 * QUARTERINGS + 8, 3)),
        np.empty((3 * QUARTERINGS + 3, 4, 4, 4)),
        np.empty((2, _CORNERS, 2)),
        np.empty(WORK),
    )


@lean
def _wedge(px, py, qx, qy, radius, moments):
    """Add area and first moments of the part of a circle between its centre and p to q."""
    cross = px * qy - py * qx
    if cross == 0.0:
        return
    dx, dy = qx - px, qy - py
    square = dx * dx + dy * dy
    # Places on p + t (q − p) at which the circle is crossed.
    along = -(px * dx + py * dy) / square
    left = radius * radius - (cross * cross) / square
    low = high = along
    if left > 0.0:
        half = math.sqrt(left / square)
        low, high = along - half, along + half
    low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
    ax, ay, bx, by = px + low * dx, py + low * dy, px + high * dx, py + high * dy
    # Outside the circle its own arc bounds the wedge.
    for k in range(2):
        x0, y0, x1, y1 = (px, py, ax, ay) if k == 0 else (bx, by, qx, qy)
        turn = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
        if turn != 0.0:
            r0, r1 = math.sqrt(x0 * x0 + y0 * y0), math.sqrt(x1 * x1 + y1 * y1)
            moments[0] += 0.5 * radius * radius * turn
            third = radius * radius * radius / 3.0
            moments[1] += third * (y1 / r1 - y0 / r0)
            moments[2] += third * (x0 / r0 - x1 / r1)
    area = 0.5 * (ax * by - ay * bx)
    moments[0] += area
    moments[1] += area * (ax + bx) / 3.0
    moments[2] += area * (ay + by) / 3.0


@lean
def _cut(shape, count, a, b, c, out):
    """Corners of a polygon that lie in a + b x + c y > 0, in order; returns how many."""
    made = 0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        here = a + b * shape[k, 0] + c * shape[k, 1]
        there = a + b * shape[m, 0] + c * shape[m, 1]
        if here > 0.0:
            out[made, 0], out[made, 1] = shape[k, 0], shape[k, 1]
            made += 1
        if (here > 0.0) != (there > 0.0):
            t = here / (here - there)
            out[made, 0] = shape[k, 0] + t * (shape[m, 0] - shape[k, 0])
            out[made, 1] = shape[k, 1] + t * (shape[m, 1] - shape[k, 1])
            made += 1
    return made


@lean
def polygon_light(disc, count, n, moments):
    """∫ n·(s + x e1 + y e2) dx dy over the part of a polygon that is seen of the disc."""
    shape, other = disc.shape[0], disc.shape[1]
    for k in range(2):
        a, b, c = disc.horizons[k, 0], disc.horizons[k, 1], disc.horizons[k, 2]
        if a > disc.radius * math.sqrt(b * b + c * c):
            continue
        made = _cut(shape, count, a, b, c, other)
        for m in range(made):
            shape[m, 0], shape[m, 1] = other[m, 0], other[m, 1]
        count = made
    moments[0] = moments[1] = moments[2] = 0.0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        _wedge(shape[k, 0], shape[k, 1], shape[m, 0], shape[m, 1], disc.radius, moments)
    axes, light = disc.axes, 0.0
    for k in range(3):
        light += n[k] * (
            moments[0] * axes[2, k] + moments[1] * axes[0, k] + moments[2] * axes[1, k]
        )
    return light
