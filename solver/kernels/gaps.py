"""Sky and ground where a meridian meets nothing."""

import math

from .compiled import lean
from .contour import GAUSS_NODES, GAUSS_START, GAUSS_WEIGHTS
from .sky_luminance import sky_luminance


@lean
def add_gap(low, high, axis, n, tone, line_out):
    """Add what is seen of sky and ground from tangent ``low`` to ``high`` of one meridian.

    Parameters
    ----------
    axis : (3,) array
        Direction of the meridian in the receiver's plane.
    tone : (10,) array
        7 parameters of `sky_luminance` and the sun's direction.
    line_out : (3,) array
        Luminance times form factor of the sky [cd/m²], and the form factors of sky and ground.
    """
    if high <= low:
        return
    start = math.atan(low)
    end = math.atan(high)
    # Where the meridian crosses the world's horizon.
    turn = math.atan2(-axis[2], n[2]) if n[2] > 0.0 else math.atan2(axis[2], -n[2])
    for piece in range(2):
        a = start if piece == 0 else max(start, turn)
        b = min(end, turn) if piece == 0 else end
        if b <= a:
            continue
        share = math.sin(b) ** 2 - math.sin(a) ** 2
        middle = 0.5 * (a + b)
        if math.cos(middle) * axis[2] + math.sin(middle) * n[2] < 0.0:
            line_out[2] += share
            continue
        line_out[1] += share
        parts = 1 + int((b - a) / 0.4)
        step = (b - a) / parts
        total = weights = 0.0
        for m in range(parts):
            for g in range(GAUSS_START[3], GAUSS_START[4]):
                angle = a + step * (m + GAUSS_NODES[g])
                c, s = math.cos(angle), math.sin(angle)
                weight = GAUSS_WEIGHTS[g] * c * s
                weights += weight
                total += weight * sky_luminance(
                    tone, tone[7], tone[8], tone[9],
                    c * axis[0] + s * n[0], c * axis[1] + s * n[1], c * axis[2] + s * n[2],
                )  # fmt: skip
        if weights > 0.0:
            line_out[0] += share * total / weights
