"""A lamp close to the ceiling and to a wall of a hexagonal room: floor and three walls.

The room of T. Nishita and E. Nakamae, as drawn in fig. 2 of Nishita and Nakamae (1993), black here.
"""

import math

import numpy as np
import truths
from case import Body, Case, RadianceSetting, accuracies, samples
from patchlight.solver.model.arrays import FloatArray
from shapes import Rectangle

RADIUS, HEIGHT = 3.0, 3.0
#: Distance of the walls from the axis. [m]
APOTHEM = RADIUS * math.cos(math.pi / 6.0)


def _direction(degrees: float) -> FloatArray:
    return np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0.0])


def _lamp(length: float, width: float, inset: float, z: float) -> Rectangle:
    """Its long side along the wall at 30°, its centre ``inset`` inside that wall, facing down."""
    out, along = _direction(30.0), _direction(120.0)
    corner = (APOTHEM - inset) * out - 0.5 * length * along - 0.5 * width * out + [0.0, 0.0, z]
    return Rectangle(tuple(corner), tuple(length * along), tuple(width * out))


def _floor() -> tuple[FloatArray, FloatArray]:
    t = np.linspace(-RADIUS, RADIUS, 31)
    x, y = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    inside = np.ones(len(x), bool)
    for degrees in range(30, 390, 60):
        out = _direction(degrees)
        inside &= x * out[0] + y * out[1] < APOTHEM - 1e-3
    points = np.stack([x, y, np.full_like(x, 1e-3)], axis=1)[inside]
    return points, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def _wall(degrees: float) -> tuple[FloatArray, FloatArray]:
    """1 mm in front of a wall, and down to 2 mm from its edges."""
    heights = np.array([0.002, 0.01, 0.05, *np.arange(0.15, 2.9, 0.15), 2.95, 2.99, 2.998])
    along = (heights / HEIGHT - 0.5) * 0.999 * RADIUS
    s, z = (g.ravel() for g in np.meshgrid(along, heights, indexing="ij"))
    out, side = _direction(degrees), _direction(degrees + 90.0)
    points = (APOTHEM - 1e-3) * out + s[:, None] * side + z[:, None] * np.array([0.0, 0.0, 1.0])
    return points, np.tile(-out, (len(points), 1))


LAMP = _lamp(2.0, 0.5, 0.35, 2.999)
POINTS, NORMALS = (
    np.concatenate(a) for a in zip(_floor(), _wall(30.0), _wall(90.0), _wall(150.0), strict=True)
)
CASE = Case(
    name="A2",
    title="lamp 2.0 x 0.5 m, 1 mm below the ceiling and near a wall of a hexagonal room",
    bodies=(Body(LAMP, radiance=1.0),),
    points=POINTS,
    normals=NORMALS,
    truth=lambda: truths.polygon(POINTS, NORMALS, LAMP.corners()),
    how="closed form (Lambert's polygon formula)",
    patchlight=accuracies(1e-2, 1e-4, 1e-6),
    radiance=(
        RadianceSetting((8, 2), "-ab 0 -ds 0"),
        RadianceSetting((16, 4), "-ab 0 -ds 0.2"),
        RadianceSetting((32, 8), "-ab 0 -ds 0.2"),
        RadianceSetting((64, 16), "-ab 0 -ds 0.1"),
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, 65536),
)
