"""A luminous tube over grids on the floor and close below it."""

import numpy as np
import truths
from case import Body, Case, RadianceSetting, accuracies, samples
from shapes import Cylinder

RADIUS, HALF, HEIGHT = 0.15, 1.0, 2.0


def _points():
    t = np.linspace(-2.0, 2.0, 21)
    x, y = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    return np.concatenate([np.stack([x, y, np.full_like(x, z)], axis=1) for z in (0.0, 1.5, 1.8)])


POINTS = _points()
CASE = Case(
    name="A4",
    title="tube of radius 0.15 m and length 2 m, grids 2, 0.5 and 0.2 m below its axis",
    bodies=(Body(Cylinder((-HALF, 0.0, HEIGHT), (HALF, 0.0, HEIGHT), RADIUS), radiance=1.0),),
    points=POINTS,
    normals=np.tile([0.0, 0.0, 1.0], (len(POINTS), 1)),
    truth=lambda: truths.cylinder_above(POINTS, HEIGHT, HALF, RADIUS),
    how="closed form along the tube, Gauss quadrature around it (1e-12)",
    patchlight=accuracies(1e-2, 1e-4, 1e-6),
    radiance=(
        RadianceSetting((4, 1), "-ab 0 -ds 0.1"),
        RadianceSetting((8, 1), "-ab 0 -ds 0.1"),
        RadianceSetting((16, 1), "-ab 0 -ds 0.1"),
        RadianceSetting((16, 1), "-ab 0 -ds 0.05"),
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, 65536, direct="mis"),
)
