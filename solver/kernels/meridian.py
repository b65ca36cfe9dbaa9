"""Visible shares of all elements from one receiver, along meridian planes.

Half-planes through the receiver's normal cut every facet in one interval of elevation. With τ the
tangent of the elevation, the part [τ1, τ2] of one of M meridians carries the form factor
(1/(1 + τ1²) − 1/(1 + τ2²)) / M exactly, so that spans need no pixels and no solid angles. Along a
meridian the surfaces in sight are chords between the points where their outlines are crossed, and
1/ρ is linear in τ on a chord (ρ: distance from the normal's axis): depth is compared, never
interpolated between meridians.

The sums over meridians are samples. What is made of them is the ratio visible / covered of each
element, to go with its exact unoccluded form factor: it is 1 for what nothing hides, whatever the
number of meridians.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .contour import GAUSS_NODES, GAUSS_START, GAUSS_WEIGHTS
from .sky_luminance import sky_luminance

#: Stands for the tangent of the zenith.
ZENITH = 1e15


class Facets(NamedTuple):
    """Flat pieces of the elements and of what else hides them, for visible shares only.

    Attributes
    ----------
    facet_vertices : (v, 3) array
        Points of the true surfaces. [m]
    facet_corners : (f, 4) int array
        Rows of the vertices of each facet, counter-clockwise about its lit side.
    facet_planes : (f, 4) array
        Normal and its product with the facet's middle.
    facet_element : (f,) int array
        Element the facet belongs to, −1 for what only hides.
    facet_solid : (f,) int array
        Solid it belongs to.
    """

    facet_vertices: np.ndarray
    facet_corners: np.ndarray
    facet_planes: np.ndarray
    facet_element: np.ndarray
    facet_solid: np.ndarray


class Spans(NamedTuple):
    """Chords of facets along the meridians of one receiver, chained by meridian."""

    head: np.ndarray  # (lines,) first span, −1 where there is none
    chain: np.ndarray  # (capacity,) next span of the same meridian
    low: np.ndarray  # (capacity,) tangent of the lower end
    high: np.ndarray
    inverse: np.ndarray  # (capacity,) 1/ρ at tangent 0
    slope: np.ndarray  # (capacity,) change of 1/ρ with the tangent
    facet: np.ndarray  # (capacity,)


@nb.njit(cache=True, error_model="numpy")
def make_spans(lines, capacity):
    """Room for so many spans."""
    return Spans(
        np.empty(lines, dtype=np.int64),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity, dtype=np.int64),
    )


@nb.njit(cache=True, error_model="numpy")
def _turn(x, y):
    """Azimuth of (x, y) in turns, 0 … 1, to 3e-9.

    Every vertex is given one azimuth, used by all facets that meet there; how exact it is does not
    matter to what they share. Polynomial: least squares fit of atan(z)/(2 π z) in z², |z| <= 1.
    """
    ax, ay = abs(x), abs(y)
    swap = ay > ax
    z = (ax / ay) if swap else (ay / ax if ax > 0.0 else 0.0)
    q = z * z
    r = 0.00677803 + q * (-0.00254728 + q * 0.00045106)
    r = -0.02260409 + q * (0.01692892 + q * (-0.01192937 + q * r))
    turn = z * (0.15915494 + q * (-0.05305122 + q * (0.03181903 + q * r)))
    if swap:
        turn = 0.25 - turn
    if x < 0.0:
        turn = 0.5 - turn
    return 1.0 - turn if y < 0.0 else turn


@nb.njit(cache=True, error_model="numpy")
def tangent_frame(n, turn, frame):
    """Two unit vectors (2, 3) square to ``n`` and to each other, turned by ``turn`` [rad]."""
    k = 0
    if abs(n[1]) < abs(n[k]):
        k = 1
    if abs(n[2]) < abs(n[k]):
        k = 2
    ex = -n[k] * n[0] + (1.0 if k == 0 else 0.0)
    ey = -n[k] * n[1] + (1.0 if k == 1 else 0.0)
    ez = -n[k] * n[2] + (1.0 if k == 2 else 0.0)
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / size, ey / size, ez / size
    fx, fy, fz = n[1] * ez - n[2] * ey, n[2] * ex - n[0] * ez, n[0] * ey - n[1] * ex
    c, s = math.cos(turn), math.sin(turn)
    frame[0, 0], frame[0, 1], frame[0, 2] = c * ex + s * fx, c * ey + s * fy, c * ez + s * fz
    frame[1, 0], frame[1, 1], frame[1, 2] = c * fx - s * ex, c * fy - s * ey, c * fz - s * ez


@nb.njit(cache=True, error_model="numpy")
def _push(spans, count, line, low, high, inverse, slope, facet):
    """Store a chord; returns how many there are, which may be more than there is room for."""
    if count < spans.low.shape[0]:
        spans.low[count], spans.high[count] = low, high
        spans.inverse[count], spans.slope[count] = inverse, slope
        spans.facet[count] = facet
        spans.chain[count] = spans.head[line]
        spans.head[line] = count
    return count + 1


@nb.njit(cache=True, error_model="numpy")
def cut_facets(
    x, n, facets, own, frame, azimuths, rounding, local, line_of, first, spans, covered, hits
):
    """Cut all facets in sight of ``x`` with the meridians about ``n``.

    Parameters
    ----------
    own : int
        Flat element the receiver lies in: never in its own sight. −1 where there is none.
    azimuths : (lines, 2) array
        Cosine and sine of every meridian.
    rounding : float
        `contour.horizon_tolerance` of the receiver. [m]
    local, line_of, first
        Scratch: (v, 4), (v,) int and (lines, 3) arrays.
    covered : (elements,) array
        Receives the form factor of each element without anything hiding it, from its spans.
    hits : (elements,) int array
        Receives the number of meridians that meet it.

    Returns
    -------
    int
        Number of spans; if it is above the room in ``spans`` some are missing.
    """
    lines = azimuths.shape[0]
    for k in range(lines):
        spans.head[k] = -1
        first[k, 0] = -1.0
    for v in range(facets.facet_vertices.shape[0]):
        dx = facets.facet_vertices[v, 0] - x[0]
        dy = facets.facet_vertices[v, 1] - x[1]
        dz = facets.facet_vertices[v, 2] - x[2]
        lx = frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz
        ly = frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz
        local[v, 0], local[v, 1] = lx, ly
        local[v, 2] = n[0] * dx + n[1] * dy + n[2] * dz
        local[v, 3] = _turn(lx, ly) * lines
        line_of[v] = int(local[v, 3])
    count = 0
    for f in range(facets.facet_corners.shape[0]):
        plane = facets.facet_planes[f]
        above = plane[0] * x[0] + plane[1] * x[1] + plane[2] * x[2] - plane[3]
        if above <= rounding:
            continue
        c0, c1, c2, c3 = (
            facets.facet_corners[f, 0],
            facets.facet_corners[f, 1],
            facets.facet_corners[f, 2],
            facets.facet_corners[f, 3],
        )
        # A receiver on a facet, or on the back of one, is in its plane up to rounding: such a facet
        # would be the whole sky.
        margin = rounding + 1e-9 * (
            abs(local[c2, 0] - local[c0, 0])
            + abs(local[c2, 1] - local[c0, 1])
            + abs(local[c3, 0] - local[c1, 0])
            + abs(local[c3, 1] - local[c1, 1])
        )
        if above <= margin or (
            local[c0, 2] <= margin
            and local[c1, 2] <= margin
            and local[c2, 2] <= margin
            and local[c3, 2] <= margin
        ):
            continue
        element = facets.facet_element[f]
        if element == own and own >= 0:
            continue
        winding = 0
        stamp = float(f)
        for e in range(4):
            a = c0 if e == 0 else (c1 if e == 1 else (c2 if e == 2 else c3))
            b = c1 if e == 0 else (c2 if e == 1 else (c3 if e == 2 else c0))
            ka, kb = line_of[a], line_of[b]
            step = kb - ka
            turn = local[b, 3] - local[a, 3]
            if turn > 0.5 * lines:
                step -= lines
            elif turn < -0.5 * lines:
                step += lines
            winding += step
            if step == 0:
                continue
            at = ka + 1 if step > 0 else ka
            move = 1 if step > 0 else -1
            ax, ay, az = local[a, 0], local[a, 1], local[a, 2]
            ex, ey, ez = local[b, 0] - ax, local[b, 1] - ay, local[b, 2] - az
            for _ in range(abs(step)):
                k = at
                if k >= lines:
                    k -= lines
                elif k < 0:
                    k += lines
                at += move
                cos, sin = azimuths[k, 0], azimuths[k, 1]
                # Where the edge meets the plane of the meridian.
                da, de = ay * cos - ax * sin, ey * cos - ex * sin
                t = -da / de if de != 0.0 else 0.0
                rho = ax * cos + ay * sin + t * (ex * cos + ey * sin)
                z = az + t * ez
                if rho > 1e-14 * abs(z):
                    inverse = 1.0 / rho
                    tangent = z * inverse
                else:
                    # On the axis itself, at height z.
                    inverse = ZENITH / max(abs(z), 1e-300)
                    tangent = ZENITH if z > 0.0 else -ZENITH
                if first[k, 0] != stamp:
                    first[k, 0], first[k, 1], first[k, 2] = stamp, tangent, inverse
                    continue
                first[k, 0] = -1.0
                low, high = first[k, 1], tangent
                ilow, ihigh = first[k, 2], inverse
                if low > high:
                    low, high, ilow, ihigh = high, low, ihigh, ilow
                if high <= 0.0 or high <= low:
                    continue
                slope = (ihigh - ilow) / (high - low)
                # From the end that is not on the axis.
                zero = ilow - slope * low if -low < high else ihigh - slope * high
                low = max(low, 0.0)
                count = _push(spans, count, k, low, high, zero, slope, f)
                if element >= 0:
                    covered[element] += 1.0 / (1.0 + low * low) - 1.0 / (1.0 + high * high)
                    hits[element] += 1
        if winding != 0:
            # About the axis: one crossing a meridian, up to the zenith or down to the nadir.
            upright = plane[0] * n[0] + plane[1] * n[1] + plane[2] * n[2]
            if upright == 0.0:
                continue
            # Height of the plane on the axis; 1/ρ = (τ − τ_c)/height + 1/ρ_c along it.
            height = -above / upright
            for k in range(lines):
                if first[k, 0] != stamp:
                    continue
                first[k, 0] = -1.0
                slope = 1.0 / height
                zero = first[k, 2] - slope * first[k, 1]
                if height > 0.0:
                    low, high = max(first[k, 1], 0.0), ZENITH
                else:
                    low, high = 0.0, first[k, 1]
                    if high <= 0.0:
                        continue
                count = _push(spans, count, k, low, high, zero, slope, f)
                if element >= 0:
                    covered[element] += 1.0 / (1.0 + low * low) - 1.0 / (1.0 + high * high)
                    hits[element] += 1
    for k in range(lines):
        first[k, 0] = -1.0
    return count


@nb.njit(cache=True, error_model="numpy")
def _nearest(spans, active, waiting, low, high):
    """Place in ``active`` of the span that is nearest over [low, …], −1 where there is none."""
    found = 0 if waiting else -1
    for m in range(1, waiting):
        s, t = active[m], active[found]
        top = min(min(high, 1e7), min(spans.high[s], spans.high[t]))
        middle = max(low, 0.5 * (low + top))
        near = spans.inverse[s] + spans.slope[s] * middle
        if near > spans.inverse[t] + spans.slope[t] * middle:
            found = m
    return found


@nb.njit(cache=True, error_model="numpy")
def _add_gap(low, high, axis, n, tone, line_out):
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


@nb.njit(cache=True, error_model="numpy")
def _sweep_line(spans, first, element, order, active, visible, axis, n, tone, line_out):
    """Add up what is nearest along one meridian, whose spans are chained from ``first``."""
    count = 0
    s = first
    while s >= 0:
        # Insertion from the end: facets of one surface come nearly sorted.
        low = spans.low[s]
        m = count
        while m > 0 and spans.low[order[m - 1]] > low:
            order[m] = order[m - 1]
            m -= 1
        order[m] = s
        count += 1
        s = spans.chain[s]
    waiting, winner = 0, -1
    at, weight = 0.0, 1.0  # weight: 1 / (1 + at²)
    for m in range(count + 1):
        nxt = order[m] if m < count else -1
        until = spans.low[nxt] if nxt >= 0 else ZENITH
        # What ends before the next span begins.
        while at < until:
            if winner < 0:
                # Forget what has ended, and take the nearest of the others.
                kept = 0
                for a in range(waiting):
                    if spans.high[active[a]] > at:
                        active[kept] = active[a]
                        kept += 1
                waiting = kept
                found = _nearest(spans, active, waiting, at, until)
                if found < 0:
                    _add_gap(at, until, axis, n, tone, line_out)
                    at, weight = until, 1.0 / (1.0 + until * until)
                    break
                winner = active[found]
                waiting -= 1
                active[found] = active[waiting]
            end = spans.high[winner]
            if end > until:
                break
            below = 1.0 / (1.0 + end * end)
            owner = element[spans.facet[winner]]
            if owner >= 0:
                visible[owner] += weight - below
            at, weight = max(at, end), below
            winner = -1
        if nxt < 0:
            break
        if winner < 0:
            winner = nxt
            continue
        top = min(spans.high[winner], spans.high[nxt])
        middle = max(until, 0.5 * (until + min(top, 1e7)))
        mine = spans.inverse[winner] + spans.slope[winner] * middle
        other = spans.inverse[nxt] + spans.slope[nxt] * middle
        if other > mine:
            if until > at:
                below = 1.0 / (1.0 + until * until)
                owner = element[spans.facet[winner]]
                if owner >= 0:
                    visible[owner] += weight - below
                at, weight = until, below
            if spans.high[winner] > spans.high[nxt]:
                active[waiting] = winner
                waiting += 1
            winner = nxt
        elif spans.high[nxt] > spans.high[winner]:
            active[waiting] = nxt
            waiting += 1


@nb.njit(cache=True, error_model="numpy")
def sweep(spans, element, azimuths, frame, n, tone, order, active, visible, outside):
    """Add up what is nearest along every meridian, and what is seen of sky and ground.

    Parameters
    ----------
    element : (f,) int array
        Element of each facet, −1 for what only hides.
    order, active : int arrays
        Scratch with room for all spans.
    visible : (elements,) array
        Receives the visible form factor of each element, times the number of meridians.
    outside : (5,) array
        Receives luminance times form factor of the sky [cd/m²], the form factors of sky and
        ground, and variances of the first and the last.
    """
    lines = azimuths.shape[0]
    outside[:] = 0.0
    axis, now = np.empty(3), np.empty(3)
    before, start = np.empty(3), np.empty(3)
    for k in range(lines):
        for c in range(3):
            axis[c] = azimuths[k, 0] * frame[0, c] + azimuths[k, 1] * frame[1, c]
        now[:] = 0.0
        _sweep_line(spans, spans.head[k], element, order, active, visible, axis, n, tone, now)
        for c in range(3):
            outside[c] += now[c] / lines
        if k == 0:
            start[:] = now
        else:
            outside[3] += (now[0] - before[0]) ** 2
            outside[4] += (now[2] - before[2]) ** 2
        before[:] = now
    # A step between two meridians lies anywhere between them: a twelfth of its square.
    outside[3] = (outside[3] + (start[0] - before[0]) ** 2) / (12.0 * lines * lines)
    outside[4] = (outside[4] + (start[2] - before[2]) ** 2) / (12.0 * lines * lines)


@nb.njit(cache=True, error_model="numpy")
def is_hidden(spans, facets, line, tangent, point, skip, rounding):
    """Whether a facet that meridian ``line`` meets at this elevation lies before ``point``.

    For elements between two meridians. The facet's plane is asked, not its chord: the point is
    not on the meridian. Facets of solid ``skip`` (a convex one, −1 for none) hide nothing of it.
    """
    s = spans.head[line]
    while s >= 0:
        if spans.low[s] < tangent < spans.high[s]:
            f = spans.facet[s]
            plane = facets.facet_planes[f]
            depth = plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] - plane[3]
            if depth < -rounding and (skip < 0 or facets.facet_solid[f] != skip):
                return True
        s = spans.chain[s]
    return False
