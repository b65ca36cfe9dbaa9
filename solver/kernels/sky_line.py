"""Light of sky and ground along one vertical half-plane through a receiver.

In the half-plane at azimuth φ a direction of altitude α is (cos α cos φ, cos α sin φ, sin α). What
the flat surfaces of the scene leave free of it is a few intervals of t = tan α. A receiver whose
normal has the component a along the horizontal direction of the half-plane and b upwards gets from
an interval

    ∫ L(α) (a cos α + b sin α) cos α dα

a luminance times one cos α for the incidence and one for the solid angle cos α dα dφ.
"""

import math

from .compiled import lean
from .sky_luminance import PATCHES, ROW_HEIGHT, ROWS, TRADITIONAL_OVERCAST, sky_luminance

#: Stands for the tangents of zenith and nadir.
STEEP = 1e15
#: Ends of intervals this close, relative to 1 + |t|, touch.
_TOUCH = 1e-12
#: Gauss' rule of eight points on 0 … 1, half of it: the other half is its mirror image.
_ABSCISSAE = (
    0.5 - 0.5 * 0.9602898564975363,
    0.5 - 0.5 * 0.7966664774136267,
    0.5 - 0.5 * 0.5255324099163290,
    0.5 - 0.5 * 0.1834346424956498,
)
_WEIGHTS = (
    0.5 * 0.1012285362903763,
    0.5 * 0.2223810344533745,
    0.5 * 0.3137066458778873,
    0.5 * 0.3626837833783620,
)
#: Widest panel of altitudes [rad], and the altitudes at which those near the horizon end, where the
#: gradation exp(b / sin α) of most skies rises.
_PANEL = 0.5
_GRADED = (0.04, 0.12, 0.3)


@lean
def hide(low, high, hidden, count):
    """Unite the interval from ``low`` to ``high`` with those hidden; returns how many there are.

    ``hidden`` (k, 2): disjoint intervals in order. Where there is no room, the two that are nearest
    to the new one become one.
    """
    if not low < high:
        return count
    gap = _TOUCH * (1.0 + min(abs(low), abs(high)))
    i = 0
    while i < count and hidden[i, 1] < low - gap:
        i += 1
    j = i
    while j < count and hidden[j, 0] <= high + gap:
        j += 1
    if i == j:
        if count == hidden.shape[0]:
            i = min(i, count - 1)
            hidden[i, 0], hidden[i, 1] = min(hidden[i, 0], low), max(hidden[i, 1], high)
            return count
        for m in range(count, i, -1):
            hidden[m, 0], hidden[m, 1] = hidden[m - 1, 0], hidden[m - 1, 1]
        hidden[i, 0], hidden[i, 1] = low, high
        return count + 1
    hidden[i, 0], hidden[i, 1] = min(hidden[i, 0], low), max(hidden[j - 1, 1], high)
    for m in range(j, count):
        hidden[i + 1 + m - j, 0], hidden[i + 1 + m - j, 1] = hidden[m, 0], hidden[m, 1]
    return count - (j - i - 1)


@lean
def plain_light(a, b, low, high):
    """∫ (a cos α + b sin α) cos α dα between two altitudes. [rad]"""
    s0, c0, s1, c1 = math.sin(low), math.cos(low), math.sin(high), math.cos(high)
    return 0.5 * (a * (high - low + s1 * c1 - s0 * c0) + b * (s1 * s1 - s0 * s0))


@lean
def _smooth_light(tone, a, b, cos, sin, start, reach, squared):
    """Light of the sky from ``start`` over ``reach`` (either sign) by one Gauss rule.

    With ``squared`` the abscissae crowd quadratically at ``start``.
    """
    total = 0.0
    for k in range(8):
        at = _ABSCISSAE[k] if k < 4 else 1.0 - _ABSCISSAE[7 - k]
        weight = _WEIGHTS[k] if k < 4 else _WEIGHTS[7 - k]
        if squared:
            weight *= 2.0 * at
            at *= at
        altitude = start + at * reach
        c, s = math.cos(altitude), math.sin(altitude)
        brightness = sky_luminance(tone, tone[7], tone[8], tone[9], c * cos, c * sin, s)
        total += weight * brightness * (a * c + b * s) * c
    return abs(reach) * total


@lean
def _patch_light(tone, a, b, cos, sin, low, high):
    """Light of patches of even luminance between two altitudes: exact."""
    total, at = 0.0, low
    for row in range(ROWS):
        top = high if row == ROWS - 1 else min(high, (row + 1) * ROW_HEIGHT)
        if not top > at:
            continue
        middle = 0.5 * (at + top)
        c, s = math.cos(middle), math.sin(middle)
        brightness = sky_luminance(tone, tone[7], tone[8], tone[9], c * cos, c * sin, s)
        total += brightness * plain_light(a, b, at, top)
        at = top
    return total


@lean
def sky_light(tone, a, b, cos, sin, low, high):
    """Light of the sky between two altitudes above the horizon.

    Panels end at the altitude next to the sun, where the luminance has its cusp or turns quickly,
    and crowd there and at the horizon.
    """
    if tone[0] == TRADITIONAL_OVERCAST:
        s0, c0, s1, c1 = math.sin(low), math.cos(low), math.sin(high), math.cos(high)
        rising = a * (c0 * c0 * c0 - c1 * c1 * c1) + b * (s1 * s1 * s1 - s0 * s0 * s0)
        return tone[6] * (plain_light(a, b, low, high) + rising / 1.5)
    if tone[0] == PATCHES:
        return _patch_light(tone, a, b, cos, sin, low, high)
    peak = -1.0
    if tone[3] != 0.0 or tone[5] != 0.0:
        peak = math.atan2(tone[9], tone[7] * cos + tone[8] * sin)
    total, at, step = 0.0, low, 0
    graded = tone[1] != 0.0
    for _ in range(64):
        if at >= high:
            break
        end = min(high, at + _PANEL)
        if graded:
            while step < 3 and _GRADED[step] <= at + 1e-9:
                step += 1
            if step < 3:
                end = min(end, _GRADED[step])
        if at < peak < end:
            end = peak
        near_low, near_high = at == peak, end == peak
        if near_high:
            total += _smooth_light(tone, a, b, cos, sin, end, at - end, True)
        else:
            total += _smooth_light(tone, a, b, cos, sin, at, end - at, near_low)
        at = end
    return total


@lean
def free_light(hidden, count, a, b, cos, sin, tone, values):
    """Light of what is not hidden of a half-plane, over π.

    Parameters
    ----------
    hidden, count
        Disjoint intervals of tangents in order, from `hide`.
    a, b : float
        Components of the receiver's normal along the half-plane and upwards.
    cos, sin : float
        Of the azimuth.
    tone : (10,) array, longer of a sky of patches, or (0,)
        As in `pyramid.visible_factor`; empty for a sky of luminance 1.
    values : (3,) array
        Receives light of the sky, and the form factors a radian of sky and ground.
    """
    values[0] = values[1] = values[2] = 0.0
    first, last = -STEEP, STEEP
    if b > 0.0:
        first = max(first, -a / b)
    elif b < 0.0:
        last = min(last, -a / b)
    elif a <= 0.0:
        return
    for m in range(count + 1):
        low = first if m == 0 else max(first, hidden[m - 1, 1])
        high = last if m == count else min(last, hidden[m, 0])
        if not low < high:
            continue
        start, end = math.atan(low), math.atan(high)
        if start < 0.0:
            values[2] += plain_light(a, b, start, min(end, 0.0))
            start = 0.0
        if end > start:
            plain = plain_light(a, b, start, end)
            values[1] += plain
            values[0] += sky_light(tone, a, b, cos, sin, start, end) if tone.size else plain
    for k in range(3):
        values[k] /= math.pi


@lean
def sort_few(values, count):
    """Sort the first ``count`` values in place."""
    for i in range(1, count):
        v = values[i]
        j = i
        while j > 0 and values[j - 1] > v:
            values[j] = values[j - 1]
            j -= 1
        values[j] = v


@lean
def make_tangent(along, up):
    """Tangent of the altitude of a point ``along`` a half-plane and ``up`` it."""
    if along > 1e-15 * abs(up):
        return min(max(up / along, -STEEP), STEEP)
    return STEEP if up > 0.0 else -STEEP
