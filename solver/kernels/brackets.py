"""Proved brackets of form factors past blockers.

A source patch is halved again and again in (u, v). Of each cell, seen through its pyramid, it is
proved that it is

* unlit: below the horizon, or seen from behind throughout;
* lit: every blocker is parted from the hull of cell and receiver by a plane;
* dark: the pieces of one connected sheet in front of the cell have neither a silhouette nor a
  shadow edge in the pyramid, so that every ray to the cell crosses the sheet equally often, and
  one ray crosses it;
* or cut: all silhouettes, shadow edges and pieces not proved to be in front lie in a wedge between
  two planes through the receiver. What is left of the cell on either side of the wedge is lit or
  dark throughout, and one ray tells which. Only what lies in the wedge is not known.

What is not known counts as [0, F]. A straight shadow edge leaves an empty wedge, a curved one a
wedge whose width falls with the square of the cell. The bracket of the patch is the sum of those of
its cells: blockers join as a set, nothing is multiplied. Cells are taken in the order of the powers
of two of their unknown part, the same for every accuracy, so that brackets are nested.

Two things are taken for granted: patches that share an edge do not cross each other besides, and a
patch flagged convex or concave by `topology.shape_flags` does not hide its own front.
"""

import math

import numba as nb
import numpy as np

from .cell_brackets import ALL, NOTHING, TURNS, look
from .compiled import kernel, lean, parallel
from .contour import horizon_tolerance, shift_net
from .nets import CONCAVE, CONVEX, PLANAR, extremes
from .piece_cuts import STRIP, end_value, restrict, zero_range
from .pieces import BACK, FRONT, MIXED, NONE, forget_pieces, make_pieces, see_surfaces, see_tangents
from .ray_patch import WORK
from .wedges import HIGH, LOW, POINTS, SPLIT

#: Cells that one pair may wait with, numbers in their lists, pieces of one receiver.
CELLS, LISTED, PIECES = 200000, 4000000, 30000
_BUCKETS = 128
#: Columns of the counters.
SKIPPED, WHOLE, TRACED, VISITED, LEFT = range(5)
#: How a receiver on a hollow or bulging patch looks: off the patch, where that is all below its
#: horizon; square to it towards the rest of it; or neither.
AWAY, ALONG, ASKEW = 1, 2, 3


@lean
def see_from_itself(pieces, patch, flags, view):
    """Correct the state of a patch for a receiver on it, from its shape ``flags`` and the ``view``.

    A hollow or bulging patch is seen from one side throughout: that it is edge-on at the receiver
    is no silhouette, though the heights have a double root there whose sign no halving tells.
    """
    if flags & PLANAR or view == AWAY:
        pieces.state[patch] = NONE
    elif flags & CONCAVE:
        pieces.state[patch] = FRONT
    elif flags & CONVEX:
        pieces.state[patch] = BACK


@lean
def _source_side(g, slack):
    """`FRONT`, `BACK` or `MIXED`; where it is seen edge-on a source gives no light either way."""
    low, high = extremes(g)
    if high <= slack:
        return BACK
    return FRONT if low >= -slack else MIXED


@lean
def _silhouette_cut(whole, cell, split, g, line):
    """Parameter in which to cut a source's cell, where (0 … 1), and which half shows one side.

    Beside its silhouette where that lies along a parameter line, as on a cylinder; else in the
    middle of parameter ``split``, and of neither half it is known (−1).
    """
    for i in range(9):
        for j in range(9):
            g[i, j] = whole[i, j]
    restrict(g, cell[0], cell[1], True, line)
    restrict(g, cell[2], cell[3], False, line)
    zone = line[:2]
    for direction in range(2):
        zero_range(g, 0.0, direction == 0, zone)
        if 0.0 <= zone[1] - zone[0] <= STRIP:
            before = zone[0] > 1.0 - zone[1]
            share = zone[0] if before else zone[1]
            if 0.0 < share < 1.0:
                return direction, share, 0 if before else 1
    return split, 0.5, -1


@lean
def _bucket(width):
    """Bucket of an unknown part: the smaller, the later."""
    if width <= 0.0:
        return _BUCKETS - 1
    _, exponent = math.frexp(width)
    return min(max(1 - exponent, 0), _BUCKETS - 1)


@kernel
def bracket_pair(
    net, whole, slack, state, wide, row, goal, x, n, rounding, surfaces, pieces, roots, root_count,
    most, cells, links, arena, mine, stamps, dirty, clock, space, points, work, counters, out,
):  # fmt: skip
    """Bracket of source ``net`` (surface ``row``) into ``out`` (2,), not wider than ``goal``.

    ``whole`` (9, 9) are the heights over its tangent planes, ``slack`` their rounding, ``state``
    the side it is seen from; ``wide`` as in `look`.
    """
    s, g, line = np.empty((4, 4, 4)), np.empty((9, 9)), np.empty(9)
    found = np.empty(3)
    heads = np.full(_BUCKETS, -1, dtype=np.int64)
    tails = np.full(_BUCKETS, -1, dtype=np.int64)
    own_sheet = surfaces.sheet[row]
    shift_net(net, x, s)
    noise = 0.0
    for i in range(4):
        for j in range(4):
            for k in range(3):
                noise = max(noise, 2e-16 * abs(s[i, j, k]))
    out[0], out[1] = 0.0, 0.0
    if state == BACK:
        return
    if 2 * pieces.used[0] > pieces.nets.shape[0]:
        forget_pieces(pieces)
    for m in range(root_count):
        arena[m] = roots[m]
    used = root_count
    clock[0] += 1
    count = look(
        s, state, wide, 0.0, own_sheet, x, n, rounding, surfaces, pieces, roots, root_count, mine,
        clock[0], stamps, dirty, space, points, work, found,
    )  # fmt: skip
    counters[VISITED] += 1
    sum_low, sum_high = found[LOW], found[HIGH]
    best_low, best_high = max(0.0, sum_low), min(1.0, sum_high)
    if count == 0 and state == FRONT and best_high - best_low <= max(goal, 1e-12):
        counters[WHOLE] += 1
    else:
        counters[TRACED] += 1
    made = 0
    if best_high - best_low > 0.0:
        for m in range(count):
            arena[used + m] = mine[m]
        cells[0, 0], cells[0, 1], cells[0, 2], cells[0, 3] = 0.0, 1.0, 0.0, 1.0
        cells[0, 4], cells[0, 5], cells[0, 6] = found[LOW], found[HIGH], found[SPLIT]
        cells[0, 7] = state
        links[0, 0], links[0, 1], links[0, 2] = -1, used, count
        used += count
        k = _bucket(found[HIGH] - found[LOW])
        heads[k] = tails[k] = 0
        made = 1
    visits = 0
    bucket = 0
    while best_high - best_low > goal and visits < most:
        while bucket < _BUCKETS and heads[bucket] < 0:
            bucket += 1
        if bucket == _BUCKETS:
            break
        cell = heads[bucket]
        heads[bucket] = links[cell, 0]
        if heads[bucket] < 0:
            tails[bucket] = -1
        split, share, clear = int(cells[cell, 6]), 0.5, -1
        shown = int(cells[cell, 7])
        if shown == MIXED:
            split, share, clear = _silhouette_cut(whole, cells[cell], split, g, line)
        a, b = cells[cell, 2 * split], cells[cell, 2 * split + 1]
        mid = a + share * (b - a)
        if b - a < 1e-12:
            continue
        sum_low -= cells[cell, 4]
        sum_high -= cells[cell, 5]
        start, length = links[cell, 1], links[cell, 2]
        for half in range(2):
            u0, u1, v0, v1 = cells[cell, 0], cells[cell, 1], cells[cell, 2], cells[cell, 3]
            if split == 0:
                u0, u1 = (a, mid) if half == 0 else (mid, b)
            else:
                v0, v1 = (a, mid) if half == 0 else (mid, b)
            shift_net(net, x, s)
            for k in range(4):
                restrict(s[:, :, k], u0, u1, True, line)
                restrict(s[:, :, k], v0, v1, False, line)
            facing = shown
            if facing == MIXED:
                g[:] = whole
                restrict(g, u0, u1, True, line)
                restrict(g, v0, v1, False, line)
                facing = _source_side(g, slack)
                if half == clear:
                    facing = FRONT if end_value(g, split == 0, clear) > 0.0 else BACK
            clock[0] += 1
            visits += 1
            counters[VISITED] += 1
            if facing == BACK:
                continue
            count = look(
                s, facing, wide, noise, own_sheet, x, n, rounding, surfaces, pieces,
                arena[start : start + length], length, mine, clock[0], stamps, dirty, space, points,
                work, found,
            )  # fmt: skip
            sum_low += found[LOW]
            sum_high += found[HIGH]
            if found[HIGH] - found[LOW] <= 1e-16:
                continue
            if made >= cells.shape[0] or used + count > arena.shape[0]:
                counters[LEFT] += 1
                continue
            for m in range(count):
                arena[used + m] = mine[m]
            cells[made, 0], cells[made, 1], cells[made, 2], cells[made, 3] = u0, u1, v0, v1
            cells[made, 4], cells[made, 5], cells[made, 6] = (
                found[LOW], found[HIGH], found[SPLIT],
            )  # fmt: skip
            cells[made, 7] = facing
            links[made, 0], links[made, 1], links[made, 2] = -1, used, count
            used += count
            k = _bucket(found[HIGH] - found[LOW])
            if tails[k] >= 0:
                links[tails[k], 0] = made
            else:
                heads[k] = made
            tails[k] = made
            bucket = min(bucket, k)
            made += 1
        # Sums wander by rounding as cells come and go.
        drift = 1e-15 + 1e-16 * math.sqrt(visits)
        best_low = max(best_low, sum_low - drift)
        best_high = min(best_high, sum_high + drift)
    out[0], out[1] = max(best_low, 0.0), max(best_high, 0.0)


@parallel
def bracket_rows(
    nodes, normals, on, views, nets, flags, place, tangents, centers, goals, surfaces, sheets, hide,
    most, low, high, counters,
):  # fmt: skip
    """Brackets of the form factors from m points to n sources.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals; a receiver with normal 0 gets no light.
    on : (m, k) int array
        Surfaces each receiver lies on, −1 for none.
    views : (m, k) int array
        `AWAY`, `ALONG` or `ASKEW` where that is hollow or bulging.
    nets, flags : (n, 4, 4, 4), (n,) array
        Sources, and their shapes from `topology.shape_flags`.
    place : (n,) int array
        Surface each source is.
    tangents, centers : (n, 9, 9, 4), (n, 3) array
        Tangent planes of the sources, as in `pieces.Surfaces`.
    goals : (m, n) array
        Widths at which to stop.
    surfaces : Surfaces
        All that hides light.
    sheets : int
        Number of connected sheets.
    hide : bool
        False ignores all hiding.
    most : int
        Cells that one pair may take.
    low, high : (m, n) array
        Receive the brackets.
    counters : (m, 5) int array
        `SKIPPED` … `LEFT`.
    """
    count = surfaces.nets.shape[0]
    for i in nb.prange(nodes.shape[0]):
        x, n = nodes[i], normals[i]
        if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
            continue
        rounding = horizon_tolerance(x)
        pieces = make_pieces(count, PIECES)
        see_surfaces(surfaces, x, n, rounding, pieces)
        for k in range(on.shape[1]):
            if on[i, k] >= 0:
                see_from_itself(pieces, on[i, k], surfaces.flags[on[i, k]], views[i, k])
        cells, links = np.empty((CELLS, 8)), np.empty((CELLS, 3), dtype=np.int64)
        arena = np.empty(LISTED, dtype=np.int64)
        stamps = np.zeros((sheets, 2), dtype=np.int64)
        dirty = np.zeros(sheets, dtype=np.int64)
        clock = np.zeros(1, dtype=np.int64)
        space, points, work = np.empty((56, 3)), np.empty((POINTS, 3)), np.empty(WORK)
        roots, out = np.empty(count, dtype=np.int64), np.empty(2)
        mine = np.empty(count + PIECES, dtype=np.int64)
        whole = np.empty((9, 9))
        for j in range(nets.shape[0]):
            row = place[j]
            if pieces.state[row] == NONE:
                counters[i, SKIPPED] += 1
                continue
            # A bulging patch does not hide its front, nor does a hollow one seen from its front.
            alone = flags[j] & (PLANAR | CONVEX) != 0
            if flags[j] & CONCAVE and pieces.state[row] != MIXED:
                alone = True
            k = count * 0  # not a literal: it would compile the callees once more
            for b in range(count):
                if hide and pieces.state[b] != NONE and not (alone and b == row):
                    roots[k] = b
                    k += 1
            slack = see_tangents(tangents[j], centers[j], x, whole)
            state = _source_side(whole, slack)
            wide = TURNS if alone else NOTHING
            for m in range(on.shape[1]):
                if on[i, m] == row and flags[j] & (CONVEX | CONCAVE):
                    # A surface given from both sides is one: the source may be either side of it.
                    state = FRONT if flags[j] & CONCAVE else BACK
                    if views[i, m] != ALONG:
                        wide = NOTHING
            if flags[j] & PLANAR:
                wide = ALL
            bracket_pair(
                nets[j], whole, slack, state, wide, row, goals[i, j], x, n, rounding, surfaces,
                pieces, roots, k, most, cells, links, arena, mine, stamps, dirty, clock, space,
                points, work, counters[i], out,
            )  # fmt: skip
            low[i, j], high[i, j] = out[0], out[1]
