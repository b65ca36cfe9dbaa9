"""A black room with a window or an opening in its roof under two skies: the work plane."""

import dataclasses
from functools import partial
from itertools import pairwise

import truth_opening
import truth_window
from case import Body, Case, OurSetting, RadianceSetting, accuracies
from shapes import Rectangle

from .d2_window import CASE as REFLECTING
from .d2_window import CLEAR_ROOM, PLANE, ROOM, SIZE, SUN, UPWARD

#: Opening in the roof (x0, x1, y0, y1). [m]
ROOF = (1.4, 2.6, 2.4, 3.6)
#: Radiance: sources of 1 to 256 polygons, each parted into up to 64 pieces.
_RADIANCE = (
    RadianceSetting((1, 1), "-ab 0 -ds 0.2"),
    RadianceSetting((1, 1), "-ab 0 -ds 0.02"),
    RadianceSetting((2, 2), "-ab 0 -ds 0.02"),
    RadianceSetting((4, 4), "-ab 0 -ds 0.05"),
    RadianceSetting((8, 8), "-ab 0 -ds 0.02"),
    RadianceSetting((16, 16), "-ab 0 -ds 0.02"),
)
#: Light that comes straight, and what the stages of a whole simulation cost besides.
_PATCHLIGHT = (*accuracies(0.1, 0.01, 0.001), OurSetting(0.1, whole=True))


def _below_roof() -> tuple[Body, ...]:
    """The roof is eight rectangles about its opening; the wall of the window is whole."""
    x, y, z = SIZE
    bodies = [body for body in BLACK if body.shape.corners()[:, 1].max() > 0.0]
    bodies = [body for body in bodies if body.shape.corners()[:, 2].min() < z]
    bodies.append(Body(Rectangle((0.0, 0.0, 0.0), (0.0, 0.0, z), (x, 0.0, 0.0))))
    x0, x1, y0, y1 = ROOF
    for a, b in pairwise((0.0, x0, x1, x)):
        for c, d in pairwise((0.0, y0, y1, y)):
            piece = Rectangle((a, c, z), (0.0, d - c, 0.0), (b - a, 0.0, 0.0))
            opening = (a, b, c, d) == ROOF
            bodies.append(Body(piece, 1.0, sky=True) if opening else Body(piece))
    return tuple(bodies)


BLACK = tuple(dataclasses.replace(body, reflectance=0.0) for body in REFLECTING.bodies)
WINDOW_OVERCAST = Case(
    name="D1_window",
    title="black room 4 x 6 x 2.7 m with one window under the overcast sky, work plane",
    bodies=BLACK,
    points=PLANE,
    normals=UPWARD,
    truth=lambda: truth_window.direct(ROOM, PLANE, UPWARD),
    how="Gauss over the window (1e-9)",
    patchlight=_PATCHLIGHT,
    radiance=_RADIANCE,
)
WINDOW_CLEAR = dataclasses.replace(
    WINDOW_OVERCAST,
    name="D1_window_clear",
    title="the same room under the clear sky, its sun left out, work plane",
    truth=lambda: truth_window.direct(CLEAR_ROOM, PLANE, UPWARD, 40),
    sun=SUN,
)
ROOF_OVERCAST = dataclasses.replace(
    WINDOW_OVERCAST,
    name="D1_roof",
    title="black room 4 x 6 x 2.7 m open in its roof to the overcast sky, work plane",
    bodies=_below_roof(),
    truth=partial(truth_opening.through_roof, PLANE, ROOF, SIZE[2]),
    how="Gauss over the opening (1e-10)",
)
ROOF_CLEAR = dataclasses.replace(
    ROOF_OVERCAST,
    name="D1_roof_clear",
    title="the same room open in its roof to the clear sky, its sun left out, work plane",
    truth=partial(truth_opening.through_roof, PLANE, ROOF, SIZE[2], CLEAR_ROOM.sun),
    sun=SUN,
)
