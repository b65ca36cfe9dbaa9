"""Visible shares of all elements from one receiver.

What the meridians see of the panels is handed on to the elements. Where all chords of a unit, one
side of one patch, are wholly in sight, its elements are; where none is, none of them is. Only the
elements of units that are partly hidden are cut themselves. An element that no meridian meets is
told by one point and the two meridians next to it, unless both see all, or nothing, of its unit.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .cuts import ZENITH, azimuth_turn, place_points, tangent_frame
from .grids import find_partly, share_grids
from .meridian import (
    cut_panels,
    list_crossing,
    list_facing,
    list_runs,
    make_lines,
    want_lines,
)
from .sights import share_bright
from .sweep import HIDDEN, SHOWN, height_bin, index_pieces, sweep

#: Points that are placed at a time: so few stay in the processor's nearest cache.
AT_ONCE = 512
#: Chords a meridian is given room for at first.
ROOM = 40
#: Standard deviation of the share of an element that one meridian meets, 0 < share < 1, relative
#: to its unoccluded factor: falls with the number of meridians.
SHARE_DEVIATION = 0.25
#: The same for an element between the meridians, told by one point.
POINT_DEVIATION = 0.3


class Shares(NamedTuple):
    """What one receiver sees of every element, and scratch."""

    share: np.ndarray  # (n,) visible share
    deviation: np.ndarray  # (n,) its standard deviation
    outside: np.ndarray  # (5,) sky and ground, as `sweep.sweep`
    covered: np.ndarray  # (n,) form factor of the chords of each element, times their number
    visible: np.ndarray  # (n,) what is in sight of it
    hits: np.ndarray  # (n,) number of chords
    asked: np.ndarray  # (n,) elements that no meridian meets
    place: np.ndarray  # (n,) number of the meridian before each of these, with a fraction
    height: np.ndarray  # (n,) tangent of the elevation of their middles
    met: np.ndarray  # (n, 2) pieces of both meridians next to them, −1 where there is none
    frame: np.ndarray  # (2, 3)
    unit: np.ndarray  # (g,) `SHOWN` and `HIDDEN` of every unit
    runs: np.ndarray  # (g, 2) as `meridian.list_runs`
    above: np.ndarray  # (p,) as `meridian.list_facing`
    listed: np.ndarray  # (p + 1,)
    crossing: np.ndarray  # (p + 1,)
    state: np.ndarray  # (p,)
    panel_local: np.ndarray  # (4, w) as `cuts.place_points`
    panel_before: np.ndarray  # (w,)
    panel_unit: np.ndarray  # (p,) unit of each panel
    crossed: np.ndarray  # (g + 1, lines) which meridians have chords of each unit
    moment: np.ndarray  # (l, 4) of the grids' lines, as `grids.find_partly`
    views: np.ndarray  # (6, g + p) as `sights.view_blockers`
    blocking: np.ndarray  # (g + p, 2)
    meets: np.ndarray  # (g + p,)
    close: np.ndarray  # (g + p + 1,)
    edges: np.ndarray  # (4, 3) as `sights.may_hide`
    sight_place: np.ndarray  # (3, k) points of one cluster
    sight_weight: np.ndarray  # (k,)
    sight_seen: np.ndarray  # (k,)


@kernel
def make_shares(sources):
    """Arrays for the elements and panels of ``sources``."""
    n, p, k = sources.nets.shape[0], sources.panel_corners.shape[0], 0
    views = sources.group.shape[0] + p
    for c in range(sources.sight_clusters.shape[0]):
        total = 0
        for m in range(sources.sight_clusters[c, 0], sources.sight_clusters[c, 1]):
            g = sources.sight_units[m]
            first, end = sources.group[g, 0], sources.group[g, 1]
            total += sources.sight_start[end] - sources.sight_start[first]
        k = max(k, total)
    unit = np.zeros(p, dtype=np.int64)
    for g in range(sources.unit_ranges.shape[0]):
        unit[sources.unit_ranges[g, 0] : sources.unit_ranges[g, 1]] = g
    return Shares(
        np.empty(n),
        np.empty(n),
        np.empty(5),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n, dtype=np.int64),
        np.empty(n),
        np.empty(n),
        np.empty((n, 2), dtype=np.int64),
        np.empty((2, 3)),
        np.empty(sources.group.shape[0], dtype=np.int64),
        np.empty((sources.group.shape[0], 2), dtype=np.int64),
        np.empty(p),
        np.empty(p + 1, dtype=np.int64),
        np.empty(p + 1, dtype=np.int64),
        np.empty(p, dtype=np.int64),
        np.empty((4, sources.panel_points.shape[1])),
        np.empty(sources.panel_points.shape[1], dtype=np.int64),
        unit,
        np.empty((sources.group.shape[0] + 1, sources.azimuths.shape[0]), dtype=np.bool_),
        np.empty((sources.grid_lines.shape[0], 4)),
        np.empty((6, views)),
        np.empty((views, 2), dtype=np.int64),
        np.empty(views, dtype=np.bool_),
        np.empty(views + 1, dtype=np.int64),
        np.empty((4, 3)),
        np.empty((3, k)),
        np.empty(k),
        np.empty(k),
    )


@kernel
def scan(x, n, own, turn, view, dark, sources, rounding, tone, lines, found):
    """Cut and sweep all panels about ``x``.

    Parameters
    ----------
    own : int
        Flat element the receiver lies in, −1 where there is none.
    turn : float
        Azimuth of the first meridian. [rad]
    view : (7,) array
        View cone, as `rows.view_cone`: only meridians that pass through it are cut.
    dark : (g,) bool array
        Units of which nothing is seen.
    rounding : float
        `contour.horizon_tolerance` of the receiver. [m]
    tone : (10,) array
        Sky, as `sweep.sweep`.

    Returns
    -------
    chords, count : int
        Chords for which there must be room; if there is not, nothing is found. Number of panels
        that are listed.
    """
    tangent_frame(n, turn, found.frame)
    want_lines(view, n, found.frame, lines.wanted)
    found.covered[:] = 0.0
    found.visible[:] = 0.0
    found.hits[:] = 0.0
    found.state[:] = 0
    runs, points = found.runs, sources.unit_points
    some = list_runs(dark, sources.unit_ranges, points, runs)
    for r in range(some):
        first, end = points[runs[r, 0], 0], points[runs[r, 1] - 1, 1]
        for start in range(first, end, AT_ONCE):
            place_points(
                x, n, found.frame, sources.panel_points, start, min(start + AT_ONCE, end),
                lines.axes, found.panel_local, found.panel_before,
            )  # fmt: skip
    count = list_facing(
        x, sources.panel_planes, sources.unit_ranges, dark, runs, some, rounding, found.above,
        found.listed,
    )  # fmt: skip
    crossing = list_crossing(
        sources.panel_corners, found.panel_before, found.listed, count, found.crossing
    )
    chords = cut_panels(
        n, sources, own, found.frame, rounding, found.panel_local, found.panel_before, found.above,
        found.crossing, crossing, found.panel_unit, lines, found.covered, found.hits, found.crossed,
    )  # fmt: skip
    if chords <= lines.panel.shape[0]:
        sweep(
            lines, sources.panel_element, found.frame, n, view, tone, found.state, found.visible,
            found.outside,
        )  # fmt: skip
        index_pieces(lines)
    return chords, count


@lean
def share_met(own, factors, found):
    """Share and deviation of the elements that meridians meet; lists and counts the others.

    Parameters
    ----------
    own : int
        Element the receiver lies in, −1 where there is none.
    factors : (n,) array
        Unoccluded form factors.
    """
    share, deviation, asked = found.share, found.deviation, found.asked
    covered, visible, hits = found.covered, found.visible, found.hits
    for j in range(share.shape[0]):
        part = visible[j] / max(covered[j], 1e-300)
        # What nothing hides adds up to rounding.
        part = 1.0 if part > 1.0 - 1e-9 else part
        share[j] = part if factors[j] > 0.0 else 0.0
        deviation[j] = SHARE_DEVIATION / max(hits[j], 1.0) if (part > 0.0) & (part < 1.0) else 0.0
    if own >= 0 and factors[own] > 0.0:
        share[own], deviation[own] = 1.0, 0.0
    count = 0
    for j in range(share.shape[0]):
        asked[count] = j
        count += 1 if (factors[j] > 0.0) & (covered[j] <= 0.0) & (j != own) else 0
    return count


@lean
def share_between(x, n, count, sources, lines, found):
    """Shares of elements between two meridians that see all, or nothing, of their whole unit.

    The others of the first ``count`` that are asked for stay so, with their places; returns how
    many they are.
    """
    number, kept, g = lines.head.shape[0], 0, 0
    asked, place, height, crossed = found.asked, found.place, found.height, found.crossed
    unit, share, deviation = found.unit, found.share, found.deviation
    group, joined, spheres = sources.group, sources.unit_joined, sources.spheres
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = found.frame[0, 0], found.frame[0, 1], found.frame[0, 2]
    g0, g1, g2 = found.frame[1, 0], found.frame[1, 1], found.frame[1, 2]
    for m in range(count):
        j = asked[m]
        while group[g, 1] <= j:
            g += 1
        dx, dy, dz = spheres[j, 0] - x0, spheres[j, 1] - x1, spheres[j, 2] - x2
        lx, ly = f0 * dx + f1 * dy + f2 * dz, g0 * dx + g1 * dy + g2 * dz
        at, rho = azimuth_turn(lx, ly) * number, math.sqrt(lx * lx + ly * ly)
        asked[kept], place[kept] = j, at
        height[kept] = (n0 * dx + n1 * dy + n2 * dz) / rho if rho > 0.0 else ZENITH
        k = int(at)
        k = k if k < number else 0
        after = k + 1 if k + 1 < number else 0
        alike = joined[g] & ((unit[g] == SHOWN) | (unit[g] == HIDDEN))
        known = alike & crossed[g, k] & crossed[g, after]
        share[j], deviation[j] = 1.0 if unit[g] == SHOWN else 0.0, 0.0
        kept += 0 if known else 1
    return kept


@lean
def find_pieces(count, lines, found):
    """Find what the meridians next to the elements asked for meet at the height of their middles.

    Apart from finding their places: these searches then wait for nothing.
    """
    start, piece, number = lines.start, lines.piece, lines.head.shape[0]
    place, height, met = found.place, found.height, found.met
    for m in range(count):
        k, row = int(place[m]), height_bin(height[m])
        for side in range(2):
            k = k if k < number else k - number
            q, end = lines.above[k, row], start[k + 1]
            while q < end and piece[q, 1] <= height[m]:
                q += 1
            met[m, side] = q if (q < end) & (piece[q, 0] < height[m]) else -1
            k += 1


@lean
def share_asked(count, sources, blockers, lines, found):
    """Share and deviation of elements that no meridian is known to meet.

    Such an element is hidden as far as what the two next to it see at the elevation of its middle
    lies before it. The panel's plane is asked, not its chord: the point is not on the meridian.
    Panels of the element's own unit or convex solid hide nothing of it.

    Parameters
    ----------
    count : int
        How many elements are asked for.
    """
    piece_panel, asked, place, met = lines.piece_panel, found.asked, found.place, found.met
    share, deviation, unit = found.share, found.deviation, found.unit
    group, joined, spheres = sources.group, sources.unit_joined, sources.spheres
    ranges, solids, planes = sources.unit_ranges, sources.panel_solid, sources.panel_planes
    g = 0
    for m in range(count):
        j = asked[m]
        while group[g, 1] <= j:
            g += 1
        seen = unit[g] if joined[g] else 0
        solid = blockers.solid[group[g, 2]]
        first, end, bulging = ranges[g, 0], ranges[g, 1], blockers.bulging[solid]
        margin = -1e-6 * spheres[j, 3]
        part, away = 0.0, place[m] - int(place[m])
        for side in range(2):
            q = met[m, side]
            f = piece_panel[q] if q >= 0 else 0
            depth = planes[0, f] * spheres[j, 0] + planes[1, f] * spheres[j, 1]
            depth += planes[2, f] * spheres[j, 2] - planes[3, f]
            same = ((f >= first) & (f < end)) | (bulging & (solids[f] == solid))
            hidden = (q >= 0) & (depth < margin) & (not same)
            part += 0.0 if hidden else (away if side == 1 else 1.0 - away)
        share[j] = part
        # Where the unit's chords say the same, the element is taken for met by them.
        sure = 1.0 if seen == SHOWN else (0.0 if seen == HIDDEN else -1.0)
        deviation[j] = 0.0 if part == sure else POINT_DEVIATION


@kernel
def find_shares(
    x, n, own, flat, turn, view, dark, factors, sources, blockers, rounding, tone, lines, found
):  # fmt: skip
    """Shares of all elements in view, with as much room as it takes; returns the meridians.

    Units apart from the view cone, as `rows.view_cone`, may be taken for ``dark``: they hide
    nothing in it.
    """
    chords, count = scan(x, n, flat, turn, view, dark, sources, rounding, tone, lines, found)
    if chords > lines.panel.shape[0]:
        lines = make_lines(sources.azimuths, 2 * chords)
        scan(x, n, flat, turn, view, dark, sources, rounding, tone, lines, found)
    find_partly(x, n, dark, sources, found)
    share_grids(sources, lines, found)
    asked = share_met(own, factors, found)
    asked = share_between(x, n, asked, sources, lines, found)
    find_pieces(asked, lines, found)
    share_asked(asked, sources, blockers, lines, found)
    if sources.sight_units.shape[0]:
        share_bright(x, n, flat, dark, factors, sources, blockers, rounding, count, found)
    return lines
