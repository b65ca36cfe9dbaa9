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

from typing import NamedTuple

import numba as nb
import numpy as np

from .cuts import ZENITH, cut_polygon, place_points
from .gaps import add_gap

#: What the meridians saw of a panel: nothing of some of its chords, or all of them.
SHOWN, HIDDEN = 1, 2
#: Overlap of chords, relative to 1 + τ, that is rounding.
_TIE = 1e-9


class Lines(NamedTuple):
    """Meridians of one receiver: chords of panels, and the pieces of them that are nearest.

    The pieces of each meridian are in order of elevation, with gaps where nothing is met.
    """

    axes: np.ndarray  # (3 lines, 2) cosine and sine of the azimuths, three times over
    ends: np.ndarray  # (3 lines, 2) scratch of `cuts.cut_polygon`
    head: np.ndarray  # (lines,) first chord of each meridian, −1 where there is none
    chain: np.ndarray  # (room,) next chord of the same meridian
    span: np.ndarray  # (room, 4) tangents of both ends, 1/ρ at tangent 0 and its slope
    panel: np.ndarray  # (room,)
    start: np.ndarray  # (lines + 1,) first piece of each meridian
    piece: np.ndarray  # (2 room, 2) tangents of both ends
    piece_panel: np.ndarray  # (2 room,)
    order: np.ndarray  # (room,) scratch
    active: np.ndarray  # (room,) scratch
    shown: np.ndarray  # (room,) `SHOWN` and `HIDDEN` of each chord


@nb.njit(cache=True, error_model="numpy")
def make_lines(azimuths, room):
    """Meridians at ``azimuths`` (lines, 2), cosines and sines, with room for so many chords."""
    lines = azimuths.shape[0]
    axes = np.empty((3 * lines, 2))
    for k in range(3 * lines):
        axes[k, 0], axes[k, 1] = azimuths[k % lines, 0], azimuths[k % lines, 1]
    return Lines(
        axes,
        np.empty((3 * lines, 2)),
        np.empty(lines, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty((room, 4)),
        np.empty(room, dtype=np.int64),
        np.empty(lines + 1, dtype=np.int64),
        np.empty((2 * room, 2)),
        np.empty(2 * room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
    )


@nb.njit(cache=True, error_model="numpy")
def carried(low, high):
    """Form factor of elevations between two tangents, times the number of meridians."""
    return (high - low) * (high + low) / ((1.0 + low * low) * (1.0 + high * high))


@nb.njit(cache=True, error_model="numpy")
def list_facing(x, n, facets, dark, frame, axes, rounding, local, listed):
    """List the panels that turn their front to ``x``, and place their points; returns how many.

    Parameters
    ----------
    dark : (g,) bool array
        Units of which nothing is seen.
    local : (w, 4) array
        Receives the places of the points of all other units.
    listed : (p + 1,) int array
        Receives the panels.
    """
    ranges, planes, points = facets.unit_ranges, facets.panel_planes, facets.panel_points
    x0, x1, x2 = x[0], x[1], x[2]
    units, count, done = dark.shape[0], 0, 0
    for g in range(ranges.shape[0]):
        if g < units and dark[g]:
            continue
        # Both sides of a sheet have the same points.
        start, end = max(done, ranges[g, 2]), ranges[g, 3]
        if g == units:
            start = ranges[g, 2]
        if end > start:
            place_points(x, n, frame, points, start, end, axes, local)
            done = end
        for f in range(ranges[g, 0], ranges[g, 1]):
            above = planes[0, f] * x0 + planes[1, f] * x1 + planes[2, f] * x2 - planes[3, f]
            listed[count] = f
            count += 1 if above > rounding else 0
    return count


@nb.njit(cache=True, error_model="numpy")
def cut_panels(
    x, n, facets, own, frame, rounding, local, listed, count, lines, covered, hits
):  # fmt: skip
    """Cut the listed panels with the meridians about ``n``.

    Parameters
    ----------
    facets : Facets
        The panels.
    own : int
        Flat element the receiver lies in: never in its own sight. −1 where there is none.
    frame : (2, 3) array
        Directions of the meridians with azimuths 0 and π/2.
    rounding : float
        `contour.horizon_tolerance` of the receiver. [m]
    local : (w, 4) array
        Of the panels' points, from `cuts.place_points`.
    listed : (p,) int array
        Panels that turn their front to ``x``, ``count`` of them.
    lines : Lines
        Receives the chords.
    covered, hits : (elements,) arrays
        Receive, for elements of panels of their own, the form factor without anything hiding them
        as the chords have it, times the number of meridians, and the number of chords.

    Returns
    -------
    int
        Number of chords; if it is above the room in ``lines`` some are missing.
    """
    head, chain, span, panel = lines.head, lines.chain, lines.span, lines.panel
    axes, ends = lines.axes, lines.ends
    corners, planes, elements = facets.panel_corners, facets.panel_planes, facets.panel_element
    room, number = panel.shape[0], head.shape[0]
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    head[:] = -1
    s = 0
    for m in range(count):
        f = listed[m]
        c0, c1, c2, c3 = corners[f, 0], corners[f, 1], corners[f, 2], corners[f, 3]
        k = int(local[c0, 3])
        if int(local[c1, 3]) == k and int(local[c2, 3]) == k and int(local[c3, 3]) == k:
            continue  # between two meridians
        top = max(max(local[c0, 2], local[c1, 2]), max(local[c2, 2], local[c3, 2]))
        if top <= rounding:
            continue
        nx, ny, nz = planes[0, f], planes[1, f], planes[2, f]
        above = nx * x0 + ny * x1 + nz * x2 - planes[3, f]
        # A receiver on a panel, or on the back of one, is in its plane up to rounding: such a panel
        # would be the whole sky.
        margin = rounding + 1e-9 * (
            abs(local[c2, 0] - local[c0, 0])
            + abs(local[c2, 1] - local[c0, 1])
            + abs(local[c3, 0] - local[c1, 0])
            + abs(local[c3, 1] - local[c1, 1])
        )
        if above <= margin or top <= margin:
            continue
        element = elements[f]
        if element == own and own >= 0:
            continue
        upright = nx * n0 + ny * n1 + nz * n2
        first, end = cut_polygon(local, corners, f, upright < 0.0, axes, ends)
        if first >= end:
            continue
        # In the plane, at distance ρ from the axis: ρ (N_x cos + N_y sin + N_z τ) = −above.
        over = -1.0 / above
        gx, gy = (nx * f0 + ny * f1 + nz * f2) * over, (nx * g0 + ny * g1 + nz * g2) * over
        slope = upright * over
        line = first % number
        for k in range(first, end):
            low, high = max(ends[k, 0], 0.0), ends[k, 1]
            if high > low:
                if s < room:
                    span[s, 0], span[s, 1] = low, high
                    span[s, 2], span[s, 3] = gx * axes[k, 0] + gy * axes[k, 1], slope
                    panel[s], chain[s] = f, head[line]
                    head[line] = s
                s += 1
                if element >= 0:
                    covered[element] += carried(low, high)
                    hits[element] += 1
            line = line + 1 if line + 1 < number else 0
    return s


@nb.njit(cache=True, error_model="numpy")
def _nearest(span, active, waiting, low, high):
    """Place in ``active`` of the chord that is nearest over [low, …], −1 where there is none."""
    found = 0 if waiting else -1
    for m in range(1, waiting):
        s, t = active[m], active[found]
        top = min(min(high, 1e7), min(span[s, 1], span[t, 1]))
        middle = max(low, 0.5 * (low + top))
        near = span[s, 2] + span[s, 3] * middle
        if near > span[t, 2] + span[t, 3] * middle:
            found = m
    return found


@nb.njit(cache=True, error_model="numpy")
def _sweep_line(
    first, span, chain, piece, piece_panel, pieces, order, active, axis, n, tone, line_out
):  # fmt: skip
    """Find what is nearest along the meridian whose chords start with ``first``.

    Stores the pieces from number ``pieces`` on, with their chords for their panels, and returns the
    number of the next one.
    """
    s, count = first, 0
    while s >= 0:
        # Insertion from the end: panels of one surface come nearly sorted.
        low = span[s, 0]
        m = count
        while m > 0 and span[order[m - 1], 0] > low:
            order[m] = order[m - 1]
            m -= 1
        order[m] = s
        count += 1
        s = chain[s]
    waiting, winner = 0, -1
    at = 0.0
    for m in range(count + 1):
        nxt = order[m] if m < count else -1
        until = span[nxt, 0] if nxt >= 0 else ZENITH
        # What ends before the next chord begins.
        while at < until:
            if winner < 0:
                # Forget what has ended, and take the nearest of the others.
                kept = 0
                for a in range(waiting):
                    if span[active[a], 1] > at:
                        active[kept] = active[a]
                        kept += 1
                waiting = kept
                found = _nearest(span, active, waiting, at, until)
                if found < 0:
                    add_gap(at, until, axis, n, tone, line_out)
                    at = until
                    break
                winner = active[found]
                waiting -= 1
                active[found] = active[waiting]
            end = span[winner, 1]
            if end > until:
                break
            if end > at:
                piece[pieces, 0], piece[pieces, 1] = at, end
                piece_panel[pieces] = winner
                pieces += 1
                at = end
            winner = -1
        if nxt < 0:
            break
        if winner < 0:
            winner = nxt
            continue
        top = min(span[winner, 1], span[nxt, 1])
        middle = max(until, 0.5 * (until + min(top, 1e7)))
        mine = span[winner, 2] + span[winner, 3] * middle
        if span[nxt, 2] + span[nxt, 3] * middle > mine:
            if until > at:
                piece[pieces, 0], piece[pieces, 1] = at, until
                piece_panel[pieces] = winner
                pieces += 1
                at = until
            if span[winner, 1] > span[nxt, 1]:
                active[waiting] = winner
                waiting += 1
            winner = nxt
        elif span[nxt, 1] > span[winner, 1]:
            active[waiting] = nxt
            waiting += 1
    return pieces


@nb.njit(cache=True, error_model="numpy")
def sweep(lines, element, frame, n, tone, state, visible, outside):
    """Find what is nearest along every meridian, and what is seen of sky and ground.

    Parameters
    ----------
    lines : Lines
        Chords from `cut_panels`; receives the pieces.
    element : (p,) int array
        Element of each panel, −1 if it is not of one alone.
    state : (p,) int array
        Receives `SHOWN` and `HIDDEN` of the panels that are met.
    visible : (elements,) array
        Receives the visible form factor of each element, times the number of meridians.
    outside : (5,) array
        Receives luminance times form factor of the sky [cd/m²], the form factors of sky and
        ground, and variances of the first and the last.
    """
    head, chain, span, panel = lines.head, lines.chain, lines.span, lines.panel
    start, piece, piece_panel = lines.start, lines.piece, lines.piece_panel
    order, active, shown, axes = lines.order, lines.active, lines.shown, lines.axes
    number = head.shape[0]
    outside[:] = 0.0
    axis, now = np.empty(3), np.empty(3)
    before, first = np.empty(3), np.empty(3)
    start[0] = 0
    for k in range(number):
        for c in range(3):
            axis[c] = axes[k, 0] * frame[0, c] + axes[k, 1] * frame[1, c]
            now[c] = 0.0
        s = head[k]
        while s >= 0:
            shown[s] = HIDDEN
            s = chain[s]
        start[k + 1] = _sweep_line(
            head[k], span, chain, piece, piece_panel, start[k], order, active, axis, n, tone, now
        )
        for m in range(start[k], start[k + 1]):
            s = piece_panel[m]
            f = panel[s]
            low, high, bottom, top = piece[m, 0], piece[m, 1], span[s, 0], span[s, 1]
            whole = low <= bottom + _TIE * (1.0 + bottom) and high >= top - _TIE * (1.0 + top)
            shown[s] = SHOWN if whole else SHOWN | HIDDEN
            piece_panel[m] = f
            if element[f] >= 0:
                visible[element[f]] += carried(low, high)
        s = head[k]
        while s >= 0:
            state[panel[s]] |= shown[s]
            s = chain[s]
        for c in range(3):
            outside[c] += now[c] / number
            if k > 0 and c != 1:
                outside[3 + c // 2] += (now[c] - before[c]) ** 2
            before[c] = now[c]
            if k == 0:
                first[c] = now[c]
    # A step between two meridians lies anywhere between them: a twelfth of its square.
    outside[3] = (outside[3] + (first[0] - before[0]) ** 2) / (12.0 * number * number)
    outside[4] = (outside[4] + (first[2] - before[2]) ** 2) / (12.0 * number * number)
