"""The penumbra of a sphere under a square source."""

import numpy as np
import truth_penumbra
from case import Body, Case, RadianceSetting, accuracies, samples
from shapes import Rectangle, Sphere

SOURCE = Rectangle((-0.5, -0.5, 2.5), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
CENTER, RADIUS = (0.0, 0.0, 1.2), 0.3


def _points():
    t = np.linspace(-1.5, 1.5, 41)
    x, y = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    return np.stack([x, y, np.zeros_like(x)], axis=1)


POINTS = _points()
CASE = Case(
    name="B",
    title="square source 1 x 1 m, 2.5 m up, behind a sphere of radius 0.3 m",
    bodies=(Body(SOURCE, radiance=1.0), Body(Sphere(CENTER, RADIUS), solid=0)),
    points=POINTS,
    normals=np.tile([0.0, 0.0, 1.0], (len(POINTS), 1)),
    truth=lambda: truth_penumbra.square_behind_sphere(POINTS, 1.0, 2.5, CENTER, RADIUS),
    how="closed form (contour of the hidden part of the source)",
    patchlight=accuracies(1e-2, 1e-3, 1e-4),
    radiance=(
        RadianceSetting((8, 8), "-ab 0 -ds 0"),
        RadianceSetting((16, 16), "-ab 0 -ds 0"),
        RadianceSetting((32, 32), "-ab 0 -ds 0"),
        RadianceSetting((64, 64), "-ab 0 -ds 0"),
        RadianceSetting((128, 128), "-ab 0 -ds 0"),
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, 65536),
)
