"""A room with a window under the overcast and under the clear sky: the work plane."""

import dataclasses
from itertools import pairwise

import numpy as np
import truth_window
from case import Body, Case, RadianceSetting, accuracies, samples
from patchlight.solver.model.sky import direction
from shapes import Rectangle

SIZE = (4.0, 6.0, 2.7)
FLOOR, WALLS, CEILING = 0.2, 0.5, 0.7
OPENING = (0.8, 3.2, 0.9, 2.3)
ROOM = truth_window.WindowRoom(
    SIZE,
    FLOOR,
    WALLS,
    CEILING,
    np.zeros((0, 4)),
    (
        (0.0, 0.05, 0.2, 0.45, 0.8, 1.1, 1.5, 2.0),
        (0.0, 0.05, 0.2, 0.5, 0.9, 1.4, 2.0, 2.7, 3.5, 4.3, 5.0, 5.5, 5.8, 5.95, 6.0),
        (0.0, 0.05, 0.2, 0.5, 0.9, 1.2, 1.6, 2.0, 2.3, 2.5, 2.65, 2.7),
    ),
    OPENING,
)


def _bodies() -> tuple[Body, ...]:
    """The wall of the window is eight rectangles about it."""
    x, y, z = SIZE
    bodies = [
        Body(Rectangle((0.0, 0.0, 0.0), (x, 0.0, 0.0), (0.0, y, 0.0)), 0.0, FLOOR),
        Body(Rectangle((0.0, 0.0, z), (0.0, y, 0.0), (x, 0.0, 0.0)), 0.0, CEILING),
        Body(Rectangle((0.0, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)), 0.0, WALLS),
        Body(Rectangle((x, 0.0, 0.0), (0.0, 0.0, z), (0.0, y, 0.0)), 0.0, WALLS),
        Body(Rectangle((0.0, y, 0.0), (x, 0.0, 0.0), (0.0, 0.0, z)), 0.0, WALLS),
    ]
    x0, x1, z0, z1 = OPENING
    for a, b in pairwise((0.0, x0, x1, x)):
        for c, d in pairwise((0.0, z0, z1, z)):
            piece = Rectangle((a, 0.0, c), (0.0, 0.0, d - c), (b - a, 0.0, 0.0))
            window = (a, b, c, d) == OPENING
            bodies.append(Body(piece, 1.0, sky=True) if window else Body(piece, 0.0, WALLS))
    return tuple(bodies)


PLANE = np.stack(
    [g.ravel() for g in np.meshgrid(np.arange(0.25, 4, 0.5), np.arange(0.25, 6, 0.5), [0.8])], 1
)
UPWARD = np.tile([0.0, 0.0, 1.0], (len(PLANE), 1))
CASE = Case(
    name="D2",
    title="room 4 x 6 x 2.7 m with one window under the overcast sky, work plane",
    bodies=_bodies(),
    points=PLANE,
    normals=UPWARD,
    truth=lambda: truth_window.irradiance(ROOM, PLANE, UPWARD),
    how="collocation on three meshes, extrapolated (1e-5)",
    patchlight=accuracies(0.2, 0.1, 0.05, 0.02, 0.01),
    radiance=(
        RadianceSetting((4, 4), "-ds 0.1 -ab 6 -ad 64 -lw 2.5e-3"),
        RadianceSetting((4, 4), "-ds 0.1 -ab 6 -ad 256 -lw 6.3e-4"),
        RadianceSetting((4, 4), "-ds 0.1 -ab 6 -aa 0.2 -ar 64 -ad 512 -as 128"),
        RadianceSetting((4, 4), "-ds 0.1 -ab 6 -aa 0.15 -ar 128 -ad 1024 -as 256"),
    ),
    mitsuba=samples(256, 1024, 4096, 16384, depth=24, direct="mis"),
)
#: The sun stands 30 degrees from south towards east, so that its glow is seen through the window.
SUN = (40.0, 150.0)
CLEAR_ROOM = dataclasses.replace(ROOM, sun=direction(*SUN))
CLEAR = dataclasses.replace(
    CASE,
    name="D2_clear",
    title="the same room under the clear sky, its sun left out, work plane",
    truth=lambda: truth_window.irradiance(CLEAR_ROOM, PLANE, UPWARD),
    how="collocation on three meshes, extrapolated (1e-5)",
    mitsuba=(),
    sun=SUN,
)
