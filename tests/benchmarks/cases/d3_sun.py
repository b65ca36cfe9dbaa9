"""The sun's disc through the window of a black room: penumbrae of its head and of a jamb."""

import dataclasses
from functools import partial

import numpy as np
import truth_opening
from case import Case, Disc, OurSetting, RadianceSetting, accuracies, samples
from patchlight.solver.model.sky import direction

from .d1_daylight import BLACK
from .d2_window import OPENING

DISC = Disc(altitude=35.0, azimuth=160.0, radius=0.2665)
X0, X1, Z0, Z1 = OPENING
#: Clockwise as seen from the room. [m]
CORNERS = np.array([[X0, 0, Z0], [X1, 0, Z0], [X1, 0, Z1], [X0, 0, Z1]])
_HEIGHT = 0.8
_TOWARD = direction(DISC.altitude, DISC.azimuth)


def _points() -> np.ndarray:
    """Lines of 1 mm across the penumbra of the head, and of 0.5 mm 1 m inside across a jamb's.

    Both reach a little into full light and into the dark: they are 42 and 12 mm wide.
    """
    head = (Z1 - _HEIGHT) * -_TOWARD[1] / _TOWARD[2]
    jamb = X0 + _TOWARD[0] / _TOWARD[1]
    across = 1e-3 * (np.arange(61) - 30.0)
    first = np.stack([np.full(61, 1.5), head + across, np.full(61, _HEIGHT)], axis=1)
    second = np.stack([jamb + 0.5 * across, np.ones(61), np.full(61, _HEIGHT)], axis=1)
    return np.concatenate([first, second])


POINTS = _points()
CASE = Case(
    name="D3",
    title="penumbrae of head and jamb of a window in the sun, 1 and 0.5 mm apart",
    bodies=tuple(dataclasses.replace(b, radiance=0.0) for b in BLACK),
    points=POINTS,
    normals=np.tile([0.0, 0.0, 1.0], (len(POINTS), 1)),
    truth=partial(truth_opening.disc_through_window, POINTS, CORNERS, _TOWARD, DISC.radius),
    how="contour of the visible part, closed form",
    patchlight=(*accuracies(0.1, 0.001), OurSetting(0.1, whole=True)),
    radiance=(
        RadianceSetting((8, 8), "-ab 0"),
        RadianceSetting((16, 16), "-ab 0"),
        RadianceSetting((32, 32), "-ab 0"),
        RadianceSetting((64, 64), "-ab 0"),
    ),
    mitsuba=samples(256, 1024, 4096, 16384, 65536),
    disc=DISC,
)
