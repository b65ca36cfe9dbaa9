"""Daylight through an opening into a black room: sky through the roof, sun's disc by a window.

The sky through a roof is Gauss' rule over the opening, as `truth_window` has it for a wall. The
disc is what of the sun's cone lies inside the window: the contour integral of `truth_penumbra`.
"""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from truth_penumbra import inside_cone
from truth_window import crowded, relative_luminance

#: Points of Gauss' rule in each of the four parts about the sun. For sensors 1.9 m below an opening
#: of 1.2 m, 40 change no value by more than 2e-11, and under the overcast sky by 1e-14.
_ORDER = 24


def through_roof(
    points: FloatArray,
    opening: tuple[float, float, float, float],
    height: float,
    sun: tuple[float, float, float] | None = None,
    order: int = _ORDER,
) -> FloatArray:
    """Irradiance (n,) of upward sensors below an opening (x0, x1, y0, y1). [W/m²]

    The sky is the overcast one, or the clear one with its glow about ``sun``; see `truth_window`.
    """
    x0, x1, y0, y1 = opening
    dz = height - points[:, 2]
    # Where the sun would be seen in the plane of the opening, or the place next to that.
    east, north = (0.0, 0.0) if sun is None else (sun[0] / sun[2], sun[1] / sun[2])
    x, wx = crowded(x0, np.clip(points[:, 0] + east * dz, x0, x1), x1, order)
    y, wy = crowded(y0, np.clip(points[:, 1] + north * dz, y0, y1), y1, order)
    dx, dy = (x - points[:, 0, None])[:, :, None], (y - points[:, 1, None])[:, None, :]
    up = dz[:, None, None]
    square = dx * dx + dy * dy + up * up
    light = relative_luminance(sun, dx, dy, up, np.sqrt(square)) * (up / square) ** 2
    return np.asarray(np.einsum("nab,na,nb->n", light, wx, wy))


def disc_through_window(
    points: FloatArray,
    corners: FloatArray,
    sun: tuple[float, float, float],
    radius_deg: float,
) -> FloatArray:
    """Illuminance (n,) of upward sensors by the disc; 1 lx falls on a plane that faces it.

    ``corners`` (4, 3) of the window go round it clockwise as seen from the sensors.
    """
    sine = math.sin(math.radians(radius_deg))
    axis = np.asarray(sun, dtype=float)
    found = [inside_cone(p, corners, axis, sine) for p in points]
    return np.array(found) / (math.pi * sine**2)
