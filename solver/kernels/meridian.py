"""Chords of panels from one receiver, along meridian planes.

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

import numpy as np

from .compiled import kernel, lean
from .cuts import TURN_ERROR, ZENITH, azimuth_turn, cut_polygon

#: Points of dark units that are placed all the same, rather than to begin a loop anew.
BRIDGED = 128
#: Elevations that the pieces of a meridian are indexed by.
BINS = 32


class Lines(NamedTuple):
    """Meridians of one receiver: chords of panels, and the pieces of them that are nearest.

    The pieces of each meridian are in order of elevation, with gaps where nothing is met.
    """

    axes: np.ndarray  # (3 lines, 2) cosine and sine of the azimuths, three times over
    ends: np.ndarray  # (3 lines, 2) scratch of `cuts.cut_polygon`
    wanted: np.ndarray  # (lines,) those that are cut and swept
    head: np.ndarray  # (lines,) first chord of each meridian, −1 where there is none
    chain: np.ndarray  # (room,) next chord of the same meridian
    span: np.ndarray  # (room, 4) tangents of both ends, 1/ρ at tangent 0 and its slope
    panel: np.ndarray  # (room,)
    start: np.ndarray  # (lines + 1,) first piece of each meridian
    piece: np.ndarray  # (2 room, 2) tangents of both ends
    piece_panel: np.ndarray  # (2 room,)
    above: np.ndarray  # (lines, `BINS`) first piece of each meridian that reaches above a height
    order: np.ndarray  # (room,) scratch
    active: np.ndarray  # (room,) scratch
    shown: np.ndarray  # (room,) `SHOWN` and `HIDDEN` of each chord


@kernel
def make_lines(azimuths, room):
    """Meridians at ``azimuths`` (lines, 2), cosines and sines, with room for so many chords."""
    lines = azimuths.shape[0]
    axes = np.empty((3 * lines, 2))
    for k in range(3 * lines):
        axes[k, 0], axes[k, 1] = azimuths[k % lines, 0], azimuths[k % lines, 1]
    return Lines(
        axes,
        np.empty((3 * lines, 2)),
        np.ones(lines, dtype=np.bool_),
        np.empty(lines, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty((room, 4)),
        np.empty(room, dtype=np.int64),
        np.empty(lines + 1, dtype=np.int64),
        np.empty((2 * room, 2)),
        np.empty(2 * room, dtype=np.int64),
        np.empty((lines, BINS), dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
    )


@lean
def want_lines(view, n, frame, wanted):
    """Mark the meridians about ``n`` that pass through a view cone, and those next to it.

    ``frame`` (2, 3) are the directions of the meridians with azimuths 0 and π/2.
    """
    lines = wanted.shape[0]
    if view[3] > 1.0:
        wanted[:] = True
        return
    along = view[0] * frame[0, 0] + view[1] * frame[0, 1] + view[2] * frame[0, 2]
    across = view[0] * frame[1, 0] + view[1] * frame[1, 1] + view[2] * frame[1, 2]
    off = math.sqrt(along * along + across * across)
    # A cone about the normal meets all of them, one off it by θ azimuths to asin(sin α / sin θ).
    half = 0.25 * lines
    if view[3] < off:
        half = math.asin(view[3] / off) / (2.0 * math.pi) * lines
    if view[3] >= off or 2.0 * half + 3.0 >= lines:
        wanted[:] = True
        return
    wanted[:] = False
    middle = azimuth_turn(along, across) * lines
    first = int(math.floor(middle - half - TURN_ERROR * lines))
    for k in range(first, int(math.floor(middle + half + TURN_ERROR * lines)) + 2):
        wanted[k % lines] = True


@lean
def carried(low, high):
    """Form factor of elevations between two tangents, times the number of meridians."""
    return (high - low) * (high + low) / ((1.0 + low * low) * (1.0 + high * high))


@lean
def list_runs(dark, ranges, points, runs):
    """List runs of units that something may be seen of; returns how many there are.

    Parameters
    ----------
    dark : (g,) bool array
        Units of which nothing is seen.
    ranges, points
        `facets.Facets.unit_ranges` and ``unit_points``.
    runs : (g, 2) int array
        Receives first and end of each run.
    """
    units, count = dark.shape[0], 0
    if ranges[units, 0] < ranges[units, 1]:
        # Backs hide from where their fronts are dark: all points are asked for.
        runs[0, 0], runs[0, 1] = 0, units
        return 1
    for g in range(units):
        if dark[g]:
            continue
        if count == 0 or points[g, 0] > points[runs[count - 1, 1] - 1, 1] + BRIDGED:
            runs[count, 0] = g
            count += 1
        runs[count - 1, 1] = g + 1
    return count


@lean
def list_facing(x, planes, ranges, dark, runs, some, rounding, above, listed):
    """List the panels of all lit units that turn their front to ``x``; returns how many.

    Parameters
    ----------
    planes, ranges
        `facets.Facets.panel_planes` and ``unit_ranges``.
    dark : (g,) bool array
        Units of which nothing is seen.
    runs : (g, 2) int array
        From `list_runs`, ``some`` of them.
    rounding : float
        Distance that counts as none. [m]
    above : (p,) array
        Receives how far ``x`` is before the plane of each panel of the runs. [m]
    listed : (p + 1,) int array
        Receives the panels, in order.
    """
    x0, x1, x2 = x[0], x[1], x[2]
    units, count = dark.shape[0], 0
    for r in range(some):
        last = runs[r, 1] if runs[r, 1] == units else runs[r, 1] - 1
        first, end = ranges[runs[r, 0], 0], ranges[last, 1]
        nx, ny, nz = planes[0, first:end], planes[1, first:end], planes[2, first:end]
        offset, out = planes[3, first:end], above[first:end]
        for f in range(out.shape[0]):
            out[f] = nx[f] * x0 + ny[f] * x1 + nz[f] * x2 - offset[f]
    for g in range(ranges.shape[0]):
        if g < units and dark[g]:
            continue
        for f in range(ranges[g, 0], ranges[g, 1]):
            listed[count] = f
            count += 1 if above[f] > rounding else 0
    return count


@lean
def list_crossing(corners, before, listed, count, crossing):
    """List those of the listed panels that do not lie between two meridians; returns how many.

    Parameters
    ----------
    before : (w,) int array
        From `cuts.place_points`.
    crossing : (p + 1,) int array
        Receives the panels.
    """
    found = 0
    for m in range(count):
        f = listed[m]
        k = before[corners[f, 0]]
        crossing[found] = f
        same = (before[corners[f, 1]] == k) & (before[corners[f, 2]] == k)
        found += 0 if same & (before[corners[f, 3]] == k) else 1
    return found


@lean
def cut_panels(
    n, facets, own, frame, rounding, local, before, above, crossing, count, unit, lines, covered,
    hits, crossed,
):  # fmt: skip
    """Cut the panels that cross meridians about ``n``.

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
    local, before : (4, w) array and (w,) int array
        Of the panels' points, from `cuts.place_points`.
    above : (p,) array
        Of the panels, from `list_facing`. [m]
    crossing : (p,) int array
        Panels that turn their front to the receiver, ``count`` of them, from `list_crossing`.
    unit : (p,) int array
        Unit of each panel.
    lines : Lines
        Receives the chords.
    covered, hits : (elements,) arrays
        Receive, for elements of panels of their own, the form factor without anything hiding them
        as the chords have it, times the number of meridians, and the number of chords.
    crossed : (g + 1, lines) bool array
        Receives which meridians have chords of each unit.

    Returns
    -------
    int
        Number of chords; if it is above the room in ``lines`` some are missing.
    """
    head, chain, span, panel = lines.head, lines.chain, lines.span, lines.panel
    axes, ends, wanted = lines.axes, lines.ends, lines.wanted
    corners, planes, elements = facets.panel_corners, facets.panel_planes, facets.panel_element
    along, across, up = local[0], local[1], local[2]
    room, number = panel.shape[0], head.shape[0]
    n0, n1, n2 = n[0], n[1], n[2]
    f0, f1, f2 = frame[0, 0], frame[0, 1], frame[0, 2]
    g0, g1, g2 = frame[1, 0], frame[1, 1], frame[1, 2]
    head[:] = -1
    crossed[:] = False
    s, every = 0, True
    for k in range(number):
        every &= wanted[k]
    for m in range(count):
        f = crossing[m]
        c0, c1, c2, c3 = corners[f, 0], corners[f, 1], corners[f, 2], corners[f, 3]
        if not every:
            # Most are small: they cross one meridian, or two.
            p0, p1, p2, p3 = before[c0], before[c1], before[c2], before[c3]
            low, high = min(min(p0, p1), min(p2, p3)), max(max(p0, p1), max(p2, p3))
            if high <= low + 2 and not (wanted[low + 1] or wanted[high]):
                continue
        top = max(max(up[c0], up[c1]), max(up[c2], up[c3]))
        if top <= rounding:
            continue
        # A receiver on a panel, or on the back of one, is in its plane up to rounding: such a panel
        # would be the whole sky.
        margin = rounding + 1e-9 * (
            abs(along[c2] - along[c0])
            + abs(across[c2] - across[c0])
            + abs(along[c3] - along[c1])
            + abs(across[c3] - across[c1])
        )
        if above[f] <= margin or top <= margin:
            continue
        element = elements[f]
        if element == own and own >= 0:
            continue
        nx, ny, nz = planes[0, f], planes[1, f], planes[2, f]
        upright = nx * n0 + ny * n1 + nz * n2
        first, end = cut_polygon(local, corners, f, upright < 0.0, axes, ends)
        if first >= end:
            continue
        # In the plane, at distance ρ from the axis: ρ (N_x cos + N_y sin + N_z τ) = −above.
        over = -1.0 / above[f]
        gx, gy = (nx * f0 + ny * f1 + nz * f2) * over, (nx * g0 + ny * g1 + nz * g2) * over
        slope = upright * over
        line = first % number
        for k in range(first, end):
            # Beside a corner on the axis the tangent has no bound; sweeps end at the zenith.
            low, high = max(ends[k, 0], 0.0), min(ends[k, 1], ZENITH)
            if (high > low) & wanted[line]:
                if s < room:
                    span[s, 0], span[s, 1] = low, high
                    span[s, 2], span[s, 3] = gx * axes[k, 0] + gy * axes[k, 1], slope
                    panel[s], chain[s] = f, head[line]
                    head[line] = s
                s += 1
                crossed[unit[f], line] = True
                if element >= 0:
                    covered[element] += carried(low, high)
                    hits[element] += 1
            line = line + 1 if line + 1 < number else 0
    return s
