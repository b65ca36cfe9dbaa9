"""Light of sky and ground at receivers, by sweeping a vertical half-plane around each.

What flat surfaces hide of a half-plane is known exactly: their boundaries cross it at the roots of
linear or cubic functions. So is, nearly, the light of what they leave free (`sky_line`). As a
function of azimuth it is smooth between the azimuths of the corners at which shadow edges begin and
end, where it is integrated by nested Gauss-Kronrod rules of 3 and 7 points; intervals in which the
two differ, as where two shadow edges cross in the receiver's view, are halved.

The circle is parted into sectors. One in which a curved surface may hide something, or in which
there is too much to hide, is left to the pyramids.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .contour import cubic, horizon_tolerance, load_edge, sign_breaks
from .pyramid import NO_BLOCKER, see_blockers
from .sky_line import STEEP, free_light, hide, make_tangent, sort_few
from .sky_luminance import COUNTS, PATCHES, ROWS

#: Kronrod's rule of 7 points on -1 … 1 from its middle outwards, and Gauss' of 3 points in it.
_KRONROD = (0.0, 0.4342437493468025, 0.7745966692414834, 0.9604912687080203)
_WEIGHTS = (0.4509165386584741, 0.4013974147759622, 0.2684880898683334, 0.1046562260264673)
_GAUSS = (0.8888888888888888, 0.0, 0.5555555555555556, 0.0)
#: Intervals of azimuth of one sector, how often they are halved, and flat surfaces in a sector.
INTERVALS, DEPTH, MOST = 512, 30, 2048
#: Corners of a sector up to which none of them is tested for being hidden.
_FEW = 12
#: Share of the tolerance that one interval may use up: few are as bad as that.
_SHARE = 0.1
#: Share of the luminance of all directions below which light is not told more precisely.
_LEAST = 1e-6


class Sweep(NamedTuple):
    """Scratch of one thread."""

    shifted: np.ndarray  # (p, 4, 4, 4)
    state: np.ndarray  # (p,)
    listed: np.ndarray  # (p,) flat surfaces in the sector
    sides: np.ndarray  # (p, 4, 4, 3) their boundaries
    curved: np.ndarray  # (p, 4) whether these are curves
    axis: np.ndarray  # (p,) on which side of the receiver each meets its vertical
    hidden: np.ndarray  # (2 p + 8, 2)
    breaks: np.ndarray  # (INTERVALS + 1,)
    ends: np.ndarray  # (INTERVALS, 2) intervals yet to do
    depth: np.ndarray  # (INTERVALS,)
    found: np.ndarray  # (INTERVALS, 6) their integrals and errors
    line: np.ndarray  # (3,)
    roots: np.ndarray  # (8,)
    cuts: np.ndarray  # (12,)
    edge: np.ndarray  # (4, 3)
    sums: np.ndarray  # (6,)


@kernel
def make_sweep(p):
    return Sweep(
        np.empty((p, 4, 4, 4)),
        np.zeros(p, dtype=np.int64),
        np.empty(p, dtype=np.int64),
        np.empty((p, 4, 4, 3)),
        np.empty((p, 4), dtype=np.bool_),
        np.empty(p),
        np.empty((2 * p + 8, 2)),
        np.empty(INTERVALS + 1),
        np.empty((INTERVALS, 2)),
        np.empty(INTERVALS, dtype=np.int64),
        np.empty((INTERVALS, 6)),
        np.empty(3),
        np.empty(8),
        np.empty(12),
        np.empty((4, 3)),
        np.empty(6),
    )


@lean
def _misses(s, x0, y0, x1, y1):
    """Whether a shifted net lies outside the sector between two horizontal directions."""
    before = beyond = True
    for i in range(4):
        for j in range(4):
            before = before and x0 * s[i, j, 1] - y0 * s[i, j, 0] <= 0.0
            beyond = beyond and x1 * s[i, j, 1] - y1 * s[i, j, 0] >= 0.0
    return before or beyond


@lean
def list_sector(x0, y0, x1, y1, blockers, planar, curvy, work):
    """List the flat surfaces of a sector; −1 where it is to be left to the pyramids."""
    count = 0
    for b in range(work.state.shape[0]):
        if work.state[b] == NO_BLOCKER or _misses(work.shifted[b], x0, y0, x1, y1):
            continue
        if not planar[b] or count >= MOST:
            return -1
        for side in range(4):
            load_edge(work.shifted[b], side, work.sides[count, side])
            work.curved[count, side] = curvy[b, side]
        c = blockers.cones[b]
        s = work.shifted[b]
        height = c[0] * s[0, 0, 0] + c[1] * s[0, 0, 1] + c[2] * s[0, 0, 2]
        work.axis[count] = STEEP if height * c[2] > 0.0 else -STEEP
        work.listed[count] = b
        count += 1
    return count


@lean
def cut_patch(m, cos, sin, work):
    """Tangents at which the half-plane cuts flat surface ``m``, in order, into ``work.cuts``."""
    count = behind = 0
    for side in range(4):
        c = work.sides[m, side]
        s0 = cos * c[0, 1] - sin * c[0, 0]
        s3 = cos * c[3, 1] - sin * c[3, 0]
        if not work.curved[m, side]:
            if (s0 > 0.0) == (s3 > 0.0):
                continue
            t = s0 / (s0 - s3)
            along = (1.0 - t) * (cos * c[0, 0] + sin * c[0, 1])
            along += t * (cos * c[3, 0] + sin * c[3, 1])
            if along > 0.0:
                work.cuts[count] = make_tangent(along, (1.0 - t) * c[0, 2] + t * c[3, 2])
                count += 1
            else:
                behind += 1
            continue
        s1 = cos * c[1, 1] - sin * c[1, 0]
        s2 = cos * c[2, 1] - sin * c[2, 0]
        parts = sign_breaks(s0, s1, s2, s3, work.roots)
        for k in range(1, parts - 1):
            t = work.roots[k]
            px = cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], t)
            py = cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], t)
            along = cos * px + sin * py
            if along > 0.0:
                up = cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], t)
                work.cuts[count] = make_tangent(along, up)
                count += 1
            else:
                behind += 1
    if (count + behind) % 2 == 0 and count % 2 == 1 and count < 12:
        # The vertical through the receiver meets it.
        work.cuts[count] = work.axis[m]
        count += 1
    sort_few(work.cuts, count)
    return count


@lean
def _line(azimuth, count, n, tone, work):
    """Light along one half-plane into ``work.line``."""
    cos, sin = math.cos(azimuth), math.sin(azimuth)
    hidden = 0
    for m in range(count):
        cuts = cut_patch(m, cos, sin, work)
        for k in range(0, cuts - 1, 2):
            hidden = hide(work.cuts[k], work.cuts[k + 1], work.hidden, hidden)
        if hidden == 1 and work.hidden[0, 0] <= -STEEP and work.hidden[0, 1] >= STEEP:
            break
    a = n[0] * cos + n[1] * sin
    free_light(work.hidden, hidden, a, n[2], cos, sin, tone, work.line)


@lean
def _interval(start, end, count, n, tone, work, found):
    """Integrals over an interval of azimuths, and their errors, into ``found`` (6,)."""
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    for k in range(6):
        found[k] = 0.0
    for k in range(7):
        i = abs(k - 3)
        at = _KRONROD[i] if k > 3 else -_KRONROD[i]
        _line(middle + half * at, count, n, tone, work)
        for j in range(3):
            found[j] += half * _WEIGHTS[i] * work.line[j]
            found[3 + j] += half * _GAUSS[i] * work.line[j]
    for j in range(3):
        found[3 + j] = abs(found[3 + j] - found[j])


@lean
def _is_hidden(x, y, z, count, work):
    """Whether a corner lies well inside the outline of a surface as the receiver sees them."""
    along = math.sqrt(x * x + y * y)
    cos, sin = x / along, y / along
    t = make_tangent(along, z)
    slack = 1e-9 * (1.0 + abs(t))
    for m in range(count):
        cuts = cut_patch(m, cos, sin, work)
        for k in range(0, cuts - 1, 2):
            if work.cuts[k] < t - slack and t + slack < work.cuts[k + 1]:
                return True
    return False


@lean
def _add_patch_edges(start, width, breaks, work):
    """Azimuths in a sector at which patches of the sky end; −1 for too many."""
    for row in range(ROWS - 1):
        step = 2.0 * math.pi / COUNTS[row]
        # Patches have their middles at whole steps from north, which is y: edges lie half way.
        first = math.ceil((start - 0.5 * math.pi) / step - 0.5)
        for k in range(COUNTS[row]):
            angle = 0.5 * math.pi + (first + k + 0.5) * step - start
            if angle >= width - 1e-12:
                break
            if angle > 1e-12:
                if breaks + 4 >= INTERVALS:
                    return -1
                work.breaks[breaks] = start + angle
                breaks += 1
    return breaks


@lean
def add_breaks(start, end, count, n, blockers, tone, work):
    """Azimuths, in order, at which the light of a sector may have kinks; −1 for too many."""
    breaks, width = 1, end - start
    work.breaks[0] = start
    cos, sin = math.cos(start), math.sin(start)
    corners = 0
    for turn in range(2):
        for m in range(count):
            b = work.listed[m]
            before = blockers.adjacent[b, 3]
            open_before = before < 0 or work.state[before] != work.state[b]
            for side in range(4):
                other = blockers.adjacent[b, side]
                opened = other < 0 or work.state[other] != work.state[b]
                c = work.sides[m, side]
                casts = opened or open_before
                open_before = opened
                if not casts:
                    continue
                x, y, z = c[0, 0], c[0, 1], c[0, 2]
                across, along = cos * y - sin * x, cos * x + sin * y
                angle = math.atan2(across, along)
                if not 1e-12 < angle < width - 1e-12:
                    continue
                if turn == 0:
                    corners += 1
                    continue
                if corners > _FEW and _is_hidden(x, y, z, count, work):
                    continue
                if breaks + 4 >= INTERVALS:
                    return -1
                work.breaks[breaks] = start + angle
                breaks += 1
    # Beyond the sun, and where the receiver's horizon passes that of the world.
    for k in range(3):
        x, y = (-n[1], n[0]) if k == 0 else (n[1], -n[0])
        if k == 2:
            if tone.size == 0 or tone[3] == 0.0:
                continue
            x, y = tone[7], tone[8]
        angle = math.atan2(cos * y - sin * x, cos * x + sin * y)
        if 1e-12 < angle < width - 1e-12:
            work.breaks[breaks] = start + angle
            breaks += 1
    if tone.size and tone[0] == PATCHES:
        breaks = _add_patch_edges(start, width, breaks, work)
        if breaks < 0:
            return -1
    work.breaks[breaks] = end
    breaks += 1
    sort_few(work.breaks, breaks)
    return breaks


@lean
def _sum_sector(first, count, n, tone, eps, sent, seen, work):
    """Integrate the first ``first`` intervals; sums and errors into ``work.sums``.

    Each is halved until its error is a small share of what is allowed for all; ``sent`` and
    ``seen`` are the light and the form factor of other sectors. Returns how many lines were looked
    at.
    """
    top, sums, stored = first, work.sums, work.found
    for k in range(6):
        sums[k] = 0.0
    for i in range(top):
        for k in range(3):
            sums[k] += stored[i, k]
    goal = _SHARE * eps * (sums[0] + sent)
    plain = _SHARE * eps * (sums[1] + sums[2] + seen)
    for k in range(3):
        sums[k] = 0.0
    lines = 0
    while top > 0:
        top -= 1
        row = stored[top]
        start, end, level = work.ends[top, 0], work.ends[top, 1], work.depth[top]
        middle = 0.5 * (start + end)
        if (
            (row[3] <= goal and row[4] <= plain and row[5] <= plain)
            or level >= DEPTH
            or (top + 2 > INTERVALS or not start < middle < end)
        ):
            for k in range(6):
                sums[k] += row[k]
            continue
        for half in range(2):
            work.ends[top + half, 0] = start if half == 0 else middle
            work.ends[top + half, 1] = middle if half == 0 else end
            work.depth[top + half] = level + 1
            _interval(
                work.ends[top + half, 0], work.ends[top + half, 1], count, n, tone, work,
                stored[top + half],
            )  # fmt: skip
            lines += 7
        top += 2
    return lines


@lean
def _sweep_node(x, n, weight, tone, blockers, planar, curvy, trace, eps, work, out):
    """Add the light on one node, times ``weight``, to ``out`` (sectors, 6); returns the lines."""
    sectors, lines = out.shape[0], 0
    # What all sectors so far send, and a little of what all could send.
    sent, seen = _LEAST, _LEAST
    if tone.size:
        sent = _LEAST * tone[6]
    if trace:
        see_blockers(blockers, x, n, horizon_tolerance(x), work.shifted, work.state)
    for k in range(sectors):
        if out[k, 5] < 0.0:
            continue
        start, end = 2.0 * math.pi * k / sectors, 2.0 * math.pi * (k + 1) / sectors
        x0, y0, x1, y1 = math.cos(start), math.sin(start), math.cos(end), math.sin(end)
        away = n[0] * x0 + n[1] * y0 <= 0.0 and n[0] * x1 + n[1] * y1 <= 0.0
        if away and n[2] == 0.0:
            continue
        count = 0
        if trace:
            count = list_sector(x0, y0, x1, y1, blockers, planar, curvy, work)
        breaks = -1
        if count >= 0:
            breaks = add_breaks(start, end, count, n, blockers, tone, work)
        if breaks < 0:
            out[k, 5] = -1.0
            continue
        first = 0
        for m in range(breaks - 1):
            if work.breaks[m + 1] - work.breaks[m] < 1e-11:
                work.breaks[m + 1] = work.breaks[m]
                continue
            work.ends[first, 0], work.ends[first, 1] = work.breaks[m], work.breaks[m + 1]
            work.depth[first] = 0
            _interval(work.breaks[m], work.breaks[m + 1], count, n, tone, work, work.found[first])
            first += 1
        lines += 7 * first + _sum_sector(first, count, n, tone, eps, sent, seen, work)
        for j in range(6):
            out[k, j] += weight * work.sums[j]
        sent += work.sums[0]
        seen += work.sums[1] + work.sums[2]
    return lines


@parallel
def sweep_rows(nodes, normals, weights, tone, blockers, planar, curvy, trace, eps, out, counters):
    """Light of sky and ground on receivers with q nodes each, by sectors of azimuth.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node; 0 for nodes that get no light.
    tone : (10,) array, or (0,)
        As in `pyramid.visible_factor`.
    blockers : Blockers
        What hides.
    planar : (p,) bool array
        Which of them are flat.
    curvy : (p, 4) bool array
        Which of their sides are no straight lines.
    trace : bool
        Whether anything hides anything.
    eps : float
        Relative accuracy of the light of a sector.
    out : (m, sectors, 6) array
        Receives luminance x form factor of the sky, the form factors of sky and ground, and what
        each of them is uncertain by; −1 in the last place for sectors left to other methods.
    counters : (m,) int array
        Half-planes looked at.
    """
    for i in nb.prange(nodes.shape[0]):
        work = make_sweep(blockers.nets.shape[0])
        for q in range(nodes.shape[1]):
            if weights[i, q] != 0.0:
                counters[i] += _sweep_node(
                    nodes[i, q], normals[i, q], weights[i, q], tone, blockers, planar, curvy,
                    trace, eps, work, out[i],
                )  # fmt: skip
