"""Directions in which receivers see the sky, past flat surfaces, with their weights.

Half-planes around a receiver are swept as in `sky_sweep`: what flat surfaces leave free of each is
known exactly. Here no light is integrated: the nodes of the rule that would do it are written down,
so that any number of skies can be summed over them.
"""

import math

import numba as nb
import numpy as np

from .compiled import lean, parallel
from .contour import horizon_tolerance
from .pyramid import see_blockers
from .sky_line import STEEP, hide
from .sky_sweep import add_breaks, cut_patch, list_sector, make_sweep

#: What is said of a sector: its nodes are written down, something else has to find them, or there
#: is no room for all of them.
TOLD, ELSEWHERE, NO_ROOM = range(3)
#: Gauss' rule of two points on 0 … 1.
_FIRST, _SECOND = 0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)


@lean
def _free(hidden, hid, a, b, cos, sin, weight, panel, out, count):
    """Write down nodes on what is free of a half-plane above the horizon; see `open_directions`.

    Returns how many there are, −`NO_ROOM` where there is no room for them.
    """
    first, last = 0.0, STEEP
    if b > 0.0:
        first = max(first, -a / b)
    elif b < 0.0:
        last = min(last, -a / b)
    elif a <= 0.0:
        return count
    for m in range(hid + 1):
        low = first if m == 0 else max(first, hidden[m - 1, 1])
        high = last if m == hid else min(last, hidden[m, 0])
        if not low < high:
            continue
        start, end = math.atan(low), math.atan(high)
        panels = int((end - start) / panel) + 1
        step = (end - start) / panels
        if count + 2 * panels > out.shape[0]:
            return -NO_ROOM
        for k in range(panels):
            for g in range(2):
                altitude = start + step * (k + (_FIRST if g == 0 else _SECOND))
                c, s = math.cos(altitude), math.sin(altitude)
                out[count, 0], out[count, 1], out[count, 2] = c * cos, c * sin, s
                out[count, 3] = 0.5 * step * weight * (a * c + b * s) * c
                count += 1
    return count


@lean
def _sector(x, n, start, end, count, blockers, tone, width, panel, work, out, found):
    """Add the nodes of one sector to ``found`` of them; −`ELSEWHERE` or −`NO_ROOM` where not."""
    breaks = add_breaks(start, end, count, n, blockers, tone, work)
    if breaks < 0:
        return -ELSEWHERE
    for i in range(breaks - 1):
        low, high = work.breaks[i], work.breaks[i + 1]
        if high - low < 1e-11:
            work.breaks[i + 1] = low
            continue
        parts = int((high - low) / width) + 1
        step = (high - low) / parts
        for k in range(parts):
            for g in range(2):
                azimuth = low + step * (k + (_FIRST if g == 0 else _SECOND))
                cos, sin = math.cos(azimuth), math.sin(azimuth)
                hid = 0
                for m in range(count):
                    cuts = cut_patch(m, cos, sin, work)
                    for c in range(0, cuts - 1, 2):
                        hid = hide(work.cuts[c], work.cuts[c + 1], work.hidden, hid)
                    if hid == 1 and work.hidden[0, 0] <= 0.0 and work.hidden[0, 1] >= STEEP:
                        break
                along = n[0] * cos + n[1] * sin
                found = _free(
                    work.hidden, hid, along, n[2], cos, sin, 0.5 * step, panel, out, found
                )
                if found < 0:
                    return found
    return found


@parallel
def open_directions(
    nodes, normals, blockers, planar, curvy, trace, width, panel, out, counts, left
):
    """Nodes of a rule over the directions in which m receivers see the sky.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals.
    blockers : Blockers
        What hides.
    planar : (p,) bool array
        Which of them are flat.
    curvy : (p, 4) bool array
        Which of their sides are no straight lines.
    trace : bool
        Whether anything hides anything.
    width, panel : float
        Largest width in azimuth and height in altitude that two nodes stand for. [rad]
    out : (m, k, 4) array
        Receives unit vectors, and solid angle times cosine at the receiver. [sr]
    counts : (m,) int array
        Receives how many there are.
    left : (m, sectors) int array
        Receives `TOLD`, `ELSEWHERE` or `NO_ROOM` of each sector of azimuth, counted from +x
        towards +y. None but the first have any of their nodes here: in the second a curved surface
        may hide something, or there are too many edges.
    """
    sectors, tone = left.shape[1], np.empty(0)
    for i in nb.prange(nodes.shape[0]):
        work = make_sweep(blockers.nets.shape[0])
        x, n = nodes[i], normals[i]
        if trace:
            see_blockers(blockers, x, n, horizon_tolerance(x), work.shifted, work.state)
        found = 0
        for k in range(sectors):
            start, end = 2.0 * math.pi * k / sectors, 2.0 * math.pi * (k + 1) / sectors
            x0, y0, x1, y1 = math.cos(start), math.sin(start), math.cos(end), math.sin(end)
            away = n[0] * x0 + n[1] * y0 <= 0.0 and n[0] * x1 + n[1] * y1 <= 0.0
            if away and n[2] <= 0.0:
                continue
            count = 0
            if trace:
                count = list_sector(x0, y0, x1, y1, blockers, planar, curvy, work)
            now = -ELSEWHERE
            if count >= 0:
                now = _sector(
                    x, n, start, end, count, blockers, tone, width, panel, work, out[i], found
                )
            left[i, k] = TOLD if now >= 0 else -now
            if now >= 0:
                found = now
        counts[i] = found
