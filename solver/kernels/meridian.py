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
from .cuts import ZENITH, cut_polygon, place_points
from .sky_luminance import sky_luminance

#: What the meridians saw of a panel: nothing of some of its chords, or all of them.
SHOWN, HIDDEN = 1, 2
#: Overlap of chords, relative to 1 + τ, that is rounding.
_TIE = 1e-9


class Facets(NamedTuple):
    """Flat pieces of the elements and of what else hides them, for visible shares only.

    Panels hide; straight lines part those that belong to several elements into cells, u first. A
    unit is one side of one patch, as `rows.Sources.group`.

    Attributes
    ----------
    panel_points : (3, w) array
        Points of the true surfaces. [m]
    panel_corners : (p, 4) int array
        Points of each panel, counter-clockwise about its lit side.
    panel_planes : (4, p) array
        Unit normals and their products with the panels' middles.
    panel_element : (p,) int array
        Element the panel belongs to, −1 if there are several or none.
    panel_solid : (p,) int array
        Solid it belongs to.
    panel_grid : (p,) int array
        Row of the panel's grid of cells, −1 where there is none.
    unit_ranges : (g + 1, 4) int array
        First and end of the panels and of their points of each unit, and of the backs of one-sided
        patches, which belong to none.
    unit_joined : (g,) bool array
        Whether any of its panels belongs to several elements.
    grid_size : (k, 4) int array
        Cells along u and v, and rows of the first line and the first cell.
    grid_lines : (l, 2, 3) array
        A point and a direction of every line, those between columns first. Seen from the front at
        x, columns and rows are counted towards (point − x) × direction. [m]
    grid_element : (c,) int array
        Element of each cell.
    sight_units : (k,) int array
        Units whose elements are told by lines of sight: they are flat or convex.
    sight_clusters, sight_spheres : (c, 2) int array, (c, 4) array
        First and end of the rows of ``sight_units`` of one solid, and a sphere about them. [m]
    sight_start : (n + 1,) int array
        First point of each element.
    sight_points, sight_areas : (3, s) array
        Points of these elements [m], and normals times the area each stands for. [m²]
    """

    panel_points: np.ndarray
    panel_corners: np.ndarray
    panel_planes: np.ndarray
    panel_element: np.ndarray
    panel_solid: np.ndarray
    panel_grid: np.ndarray
    unit_ranges: np.ndarray
    unit_joined: np.ndarray
    grid_size: np.ndarray
    grid_lines: np.ndarray
    grid_element: np.ndarray
    sight_units: np.ndarray
    sight_clusters: np.ndarray
    sight_spheres: np.ndarray
    sight_start: np.ndarray
    sight_points: np.ndarray
    sight_areas: np.ndarray


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
                    _add_gap(at, until, axis, n, tone, line_out)
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
