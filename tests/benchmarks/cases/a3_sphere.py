"""A luminous sphere seen from its surface to far away, tilted through the horizon."""

import math

import numpy as np
import truths
from case import Body, Case, RadianceSetting, accuracies, samples
from shapes import Sphere

RADIUS = 0.25
DISTANCES = (1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
TILTS = (0, 15, 30, 45, 60, 70, 80, 85, 90, 95, 100, 110, 120, 130)


def _sensors():
    """Two directions for each distance; tilts until the sphere has set."""
    points, normals = [], []
    for distance in DISTANCES:
        for out in (np.array([0.8, 0.0, -0.6]), np.array([0.18, 0.7795, -0.6])):
            out = out / np.linalg.norm(out)
            side = np.cross(out, [0.3, -0.2, 0.9])
            side /= np.linalg.norm(side)
            for tilt in TILTS:
                if math.radians(tilt) < 0.5 * math.pi + math.asin(1.0 / distance):
                    a = math.radians(tilt)
                    points.append(RADIUS * distance * out)
                    normals.append(-math.cos(a) * out + math.sin(a) * side)
    return np.array(points), np.array(normals)


POINTS, NORMALS = _sensors()
CASE = Case(
    name="A3",
    title="sphere of radius 0.25 m, 1.02 to 20 radii away, tilted through the horizon",
    bodies=(Body(Sphere((0.0, 0.0, 0.0), RADIUS), radiance=1.0, solid=0),),
    points=POINTS,
    normals=NORMALS,
    truth=lambda: truths.sphere(POINTS, NORMALS, (0.0, 0.0, 0.0), RADIUS),
    how="closed form (Howell B-43)",
    patchlight=accuracies(1e-2, 1e-4, 1e-6),
    radiance=(
        RadianceSetting((12, 1), "-ab 0 -ds 0.1"),
        RadianceSetting((24, 1), "-ab 0 -ds 0.1"),
        RadianceSetting((48, 1), "-ab 0 -ds 0.1"),
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, 65536),
)
