"""Visible shares of all elements from one receiver.

What the meridians see of the panels is handed on to the elements. Where all chords of a unit, one
side of one patch, are wholly in sight, its elements are; where none is, none of them is. Only the
elements of units that are partly hidden are cut themselves. An element that no meridian meets is
told by one point and the two meridians next to it.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .cuts import ZENITH, azimuth_turn, tangent_frame
from .meridian import HIDDEN, SHOWN, carried, cut_panels, list_facing, make_lines, sweep
from .sights import share_bright

#: Chords a meridian is given room for at first.
ROOM = 40
#: Standard deviation of the share of an element that one meridian meets, 0 < share < 1, relative
#: to its unoccluded factor: falls with the number of meridians.
SHARE_DEVIATION = 0.25
#: The same for an element between the meridians, told by one point.
POINT_DEVIATION = 0.3
#: Added to what is seen of the panels of a unit that is partly hidden.
_PARTLY = 4


class Shares(NamedTuple):
    """What one receiver sees of every element, and scratch."""

    share: np.ndarray  # (n,) visible share
    deviation: np.ndarray  # (n,) its standard deviation
    outside: np.ndarray  # (5,) sky and ground, as `meridian.sweep`
    covered: np.ndarray  # (n,)
    visible: np.ndarray  # (n,)
    hits: np.ndarray  # (n,)
    frame: np.ndarray  # (2, 3)
    unit: np.ndarray  # (g,) `SHOWN` and `HIDDEN` of every unit
    listed: np.ndarray  # (p,)
    state: np.ndarray  # (p,)
    panel_local: np.ndarray  # (w, 4)
    views: np.ndarray  # (g + p, 6) as `sights.view_blockers`
    blocking: np.ndarray  # (g + p, 2)
    every: np.ndarray  # (g + p,) 0, 1, 2 …
    close: np.ndarray  # (g + p + 1,)
    near: np.ndarray  # (g + p + 1,)
    sight_place: np.ndarray  # (3, k) points of one unit
    sight_weight: np.ndarray  # (k,)
    sight_seen: np.ndarray  # (k,)


@nb.njit(cache=True, error_model="numpy")
def make_shares(sources):
    """Arrays for the elements and panels of ``sources``."""
    n, p, k = sources.nets.shape[0], sources.panel_corners.shape[0], 0
    views = sources.group.shape[0] + p
    for m in range(sources.sight_units.shape[0]):
        g = sources.sight_units[m]
        first, end = sources.group[g, 0], sources.group[g, 1]
        k = max(k, sources.sight_start[end] - sources.sight_start[first])
    return Shares(
        np.empty(n),
        np.empty(n),
        np.empty(5),
        np.empty(n),
        np.empty(n),
        np.empty(n, dtype=np.int64),
        np.empty((2, 3)),
        np.empty(sources.group.shape[0], dtype=np.int64),
        np.empty(p + 1, dtype=np.int64),
        np.empty(p, dtype=np.int64),
        np.empty((sources.panel_points.shape[1], 4)),
        np.empty((views, 6)),
        np.empty((views, 2), dtype=np.int64),
        np.arange(views),
        np.empty(views + 1, dtype=np.int64),
        np.empty(views + 1, dtype=np.int64),
        np.empty((3, k)),
        np.empty(k),
        np.empty(k),
    )


@nb.njit(cache=True, error_model="numpy")
def scan(x, n, own, turn, dark, sources, rounding, tone, lines, found):
    """Cut and sweep all panels about ``x``.

    Parameters
    ----------
    own : int
        Flat element the receiver lies in, −1 where there is none.
    turn : float
        Azimuth of the first meridian. [rad]
    dark : (g,) bool array
        Units of which nothing is seen.
    rounding : float
        `contour.horizon_tolerance` of the receiver. [m]
    tone : (10,) array
        Sky, as `meridian.sweep`.

    Returns
    -------
    chords, count : int
        Chords for which there must be room; if there is not, nothing is found. Number of panels
        that are listed.
    """
    tangent_frame(n, turn, found.frame)
    found.covered[:] = 0.0
    found.visible[:] = 0.0
    found.hits[:] = 0
    found.state[:] = 0
    count = list_facing(
        x, n, sources, dark, found.frame, lines.axes, rounding, found.panel_local, found.listed
    )
    chords = cut_panels(
        x, n, sources, own, found.frame, rounding, found.panel_local, found.listed, count, lines,
        found.covered, found.hits,
    )  # fmt: skip
    if chords <= lines.panel.shape[0]:
        sweep(
            lines, sources.panel_element, found.frame, n, tone, found.state, found.visible,
            found.outside,
        )  # fmt: skip
    return chords, count


@nb.njit(cache=True, error_model="numpy")
def _beyond(lines, i, x0, x1, x2, d0, d1, d2):
    """On which side of a grid's line ``i`` direction d points, seen from x: its sign."""
    p0, p1, p2 = lines[i, 0, 0] - x0, lines[i, 0, 1] - x1, lines[i, 0, 2] - x2
    e0, e1, e2 = lines[i, 1, 0], lines[i, 1, 1], lines[i, 1, 2]
    return (p1 * e2 - p2 * e1) * d0 + (p2 * e0 - p0 * e2) * d1 + (p0 * e1 - p1 * e0) * d2


@nb.njit(cache=True, error_model="numpy")
def _column(lines, first, count, x0, x1, x2, d0, d1, d2):
    """Between which of ``count`` lines from row ``first`` on direction d points: 0 … ``count``."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if _beyond(lines, first + middle, x0, x1, x2, d0, d1, d2) > 0.0:
            low = middle + 1
        else:
            high = middle
    return low


@nb.njit(cache=True, error_model="numpy")
def share_grids(x, n, sources, lines, found):
    """Add up what is nearest of the cells of panels that are partly hidden, and of their units."""
    head, chain, span, panels = lines.head, lines.chain, lines.span, lines.panel
    start, piece, piece_panel, axes = lines.start, lines.piece, lines.piece_panel, lines.axes
    grid_of, state, unit, ranges = (
        sources.panel_grid,
        found.state,
        found.unit,
        sources.unit_ranges,
    )
    sizes, parts, elements = sources.grid_size, sources.grid_lines, sources.grid_element
    covered, visible, hits, frame = found.covered, found.visible, found.hits, found.frame
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    for g in range(unit.shape[0]):
        seen = 0
        for f in range(ranges[g, 0], ranges[g, 1]):
            seen |= state[f]
        unit[g] = seen
        for f in range(ranges[g, 0], ranges[g, 1]):
            state[f] |= _PARTLY if seen == SHOWN | HIDDEN else 0
    for k in range(head.shape[0]):
        d0 = axes[k, 0] * frame[0, 0] + axes[k, 1] * frame[1, 0]
        d1 = axes[k, 0] * frame[0, 1] + axes[k, 1] * frame[1, 1]
        d2 = axes[k, 0] * frame[0, 2] + axes[k, 1] * frame[1, 2]
        s = head[k]
        while s >= 0:
            f, low, high = panels[s], span[s, 0], span[s, 1]
            s = chain[s]
            g = grid_of[f]
            if g < 0 or state[f] < _PARTLY:
                continue
            nu, nv, u_first, cell = sizes[g, 0], sizes[g, 1], sizes[g, 2], sizes[g, 3]
            v_first = u_first + nu - 1
            b0, b1, b2 = d0 + low * n0, d1 + low * n1, d2 + low * n2
            i = _column(parts, u_first, nu - 1, x0, x1, x2, b0, b1, b2)
            j = _column(parts, v_first, nv - 1, x0, x1, x2, b0, b1, b2)
            b0, b1, b2 = d0 + high * n0, d1 + high * n1, d2 + high * n2
            left_u = _column(parts, u_first, nu - 1, x0, x1, x2, b0, b1, b2) - i
            left_v = _column(parts, v_first, nv - 1, x0, x1, x2, b0, b1, b2) - j
            m, at = start[k], low
            tu, tv = -1.0, -1.0
            for _ in range(abs(left_u) + abs(left_v) + 1):
                # Where the chord leaves the cell.
                if tu < 0.0:
                    tu = high
                    if left_u != 0:
                        q = u_first + (i if left_u > 0 else i - 1)
                        across = _beyond(parts, q, x0, x1, x2, n0, n1, n2)
                        tu = -_beyond(parts, q, x0, x1, x2, d0, d1, d2) / across
                        tu = tu if 0.0 < tu < high else high
                if tv < 0.0:
                    tv = high
                    if left_v != 0:
                        q = v_first + (j if left_v > 0 else j - 1)
                        across = _beyond(parts, q, x0, x1, x2, n0, n1, n2)
                        tv = -_beyond(parts, q, x0, x1, x2, d0, d1, d2) / across
                        tv = tv if 0.0 < tv < high else high
                until = min(tu, tv)
                if until > at + 1e-13 * (1.0 + at):
                    e = elements[cell + i * nv + j]
                    covered[e] += carried(at, until)
                    hits[e] += 1
                    while m < start[k + 1] and piece[m, 1] <= at:
                        m += 1
                    q = m
                    while q < start[k + 1] and piece[q, 0] < until:
                        if piece_panel[q] == f:
                            visible[e] += carried(max(piece[q, 0], at), min(piece[q, 1], until))
                        q += 1
                    at = until
                if tu <= tv and left_u != 0:
                    step = 1 if left_u > 0 else -1
                    i, left_u, tu = i + step, left_u - step, -1.0
                elif left_v != 0:
                    step = 1 if left_v > 0 else -1
                    j, left_v, tv = j + step, left_v - step, -1.0


@nb.njit(cache=True, error_model="numpy")
def share_elements(x, n, own, factors, sources, blockers, lines, found):
    """Visible share and deviation of all elements with an unoccluded factor.

    An element that no meridian is known to meet is hidden as far as what the two next to it see at
    the elevation of its middle lies before it. The panel's plane is asked, not its chord: the
    point is not on the meridian. Panels of the element's own unit or convex solid hide nothing
    of it.

    Parameters
    ----------
    own : int
        Element the receiver lies in, −1 where there is none.
    factors : (n,) array
        Unoccluded form factors.
    """
    number = lines.head.shape[0]
    start, piece, piece_panel = lines.start, lines.piece, lines.piece_panel
    share, deviation, unit = found.share, found.deviation, found.unit
    covered, visible, hits = found.covered, found.visible, found.hits
    group, joined, spheres = sources.group, sources.unit_joined, sources.spheres
    ranges = sources.unit_ranges
    solids, planes = sources.panel_solid, sources.panel_planes
    solid_of, bulging = blockers.solid, blockers.bulging
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    f0, f1, f2 = found.frame[0, 0], found.frame[0, 1], found.frame[0, 2]
    g0, g1, g2 = found.frame[1, 0], found.frame[1, 1], found.frame[1, 2]
    for g in range(group.shape[0]):
        seen = unit[g] if joined[g] else 0
        solid = solid_of[group[g, 2]]
        for j in range(group[g, 0], group[g, 1]):
            deviation[j] = 0.0
            if factors[j] <= 0.0:
                share[j] = 0.0
            elif j == own:
                share[j] = 1.0
            elif covered[j] > 0.0:
                part = visible[j] / covered[j]
                # What nothing hides adds up to rounding.
                share[j] = 1.0 if part > 1.0 - 1e-9 else part
                if 0.0 < share[j] < 1.0:
                    deviation[j] = SHARE_DEVIATION / hits[j]
            else:
                dx, dy, dz = spheres[j, 0] - x0, spheres[j, 1] - x1, spheres[j, 2] - x2
                lx, ly = f0 * dx + f1 * dy + f2 * dz, g0 * dx + g1 * dy + g2 * dz
                place = azimuth_turn(lx, ly) * number
                rho = math.sqrt(lx * lx + ly * ly)
                tangent = (n0 * dx + n1 * dy + n2 * dz) / rho if rho > 0.0 else ZENITH
                margin = -1e-6 * spheres[j, 3]
                part, away = 0.0, place - int(place)
                for side in range(2):
                    k = int(place) + side
                    k = k if k < number else k - number
                    m = start[k]
                    while m < start[k + 1] and piece[m, 1] <= tangent:
                        m += 1
                    hidden = False
                    if m < start[k + 1] and piece[m, 0] < tangent:
                        f = piece_panel[m]
                        depth = planes[0, f] * (x0 + dx) + planes[1, f] * (x1 + dy)
                        depth += planes[2, f] * (x2 + dz) - planes[3, f]
                        same = ranges[g, 0] <= f < ranges[g, 1]
                        same |= bulging[solid] and solids[f] == solid
                        hidden = depth < margin and not same
                    if not hidden:
                        part += away if side == 1 else 1.0 - away
                share[j] = part
                # Where the unit's chords say the same, the element is taken for met by them.
                sure = 1.0 if seen == SHOWN else (0.0 if seen == HIDDEN else -1.0)
                deviation[j] = 0.0 if part == sure else POINT_DEVIATION


@nb.njit(cache=True, error_model="numpy")
def find_shares(
    x, n, own, flat, turn, dark, factors, sources, blockers, rounding, tone, lines, found
):  # fmt: skip
    """Shares of all elements, with as much room as it takes; returns the meridians."""
    chords, count = scan(x, n, flat, turn, dark, sources, rounding, tone, lines, found)
    if chords > lines.panel.shape[0]:
        lines = make_lines(sources.azimuths, 2 * chords)
        scan(x, n, flat, turn, dark, sources, rounding, tone, lines, found)
    share_grids(x, n, sources, lines, found)
    share_elements(x, n, own, factors, sources, blockers, lines, found)
    if sources.sight_units.shape[0]:
        share_bright(
            x, n, flat, dark, factors, sources, blockers, rounding, found.listed, count,
            found.panel_local, found,
        )  # fmt: skip
    return lines
