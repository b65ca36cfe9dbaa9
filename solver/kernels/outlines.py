"""Outlines of surfaces from one receiver: the curves at which what they hide may end.

They are of two kinds: silhouettes, and edges of a sheet that are free or beyond which the sheet
turns back. Both are cubics of control vectors relative to the receiver, directed so that the
surface lies on their left. Silhouettes are known of quadrics, of whole regions (`regions`) or else
patch by patch (`quadric`); a patch of another kind that shows both sides is `ODD`, and so is what
needs its outline.

A receiver looks at a sheet when something of it is in the way, not before.
"""

from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .contour import cubic, load_edge, shift_net, sign_breaks
from .nets import PLANAR, copy_net, extremes, halve_u, halve_v, heights
from .pieces import BACK, COLLAPSED, FREE, FRONT, MIXED, NONE, see_tangents
from .quadric import front_outline, polar_plane, restrict_cubic, side_values
from .regions import (
    PATCHES,
    ROUND,
    Cuts,
    cut_boundary,
    make_cuts,
    round_arcs,
    ruled_lines,
    side_along,
)

#: A patch that shows both sides, but not where they meet.
ODD = 4
#: Stands for the direction of an edge over which the surface goes on smoothly: it casts no shadow.
SMOOTH = 2
#: How much is known of a sheet: nothing, the sides seen, and its outlines too.
UNKNOWN, SIDES, OUTLINED = 0, 1, 2
#: Quarterings of a patch whose silhouette is not a single arc.
_LEVELS = 6


class Outlines(NamedTuple):
    """Surfaces as one receiver sees them, and their outlines."""

    nets: np.ndarray  # (p, 4, 4, 4) relative to the receiver
    shifted: np.ndarray  # (p,) bool: whether `nets` and `low` are known
    low: np.ndarray  # (p,) bool: wholly below the horizon
    viewed: np.ndarray  # (s,) bool: whether the view cones of a sheet's patches are known
    looked: np.ndarray  # (s,) what is known of each sheet: `UNKNOWN`, `SIDES`, `OUTLINED`
    arcs: np.ndarray  # (r,) bool: whether the silhouette of a region is among the curves
    state: np.ndarray  # (p,) `FRONT`, `BACK`, `MIXED`, `ODD`, or `NONE` for edge-on
    polar: np.ndarray  # (p, 4) functional of (H, w) that is positive where the + side is seen
    whole: np.ndarray  # (p,) bool: all curves of the patch are known
    curve: np.ndarray  # (k, 4, 3)
    sides: np.ndarray  # (k, 3) patches that meet in it, −1 for none, and region, −1 for none
    count: np.ndarray  # (1,) number of curves
    cuts: Cuts
    work: np.ndarray  # (9, 4)
    values: np.ndarray  # (4, 4)
    tangents: np.ndarray  # (9, 9)
    pieces: np.ndarray  # (17, 4, 3)
    breaks: np.ndarray  # (2, 8)
    ends: np.ndarray  # (3, 3)
    stack: np.ndarray  # (levels, 4, 4, 4)
    level: np.ndarray  # (levels,)


@kernel
def make_outlines(patches, sheets, regions):
    """Room for so many patches."""
    return Outlines(
        np.empty((patches, 4, 4, 4)),
        np.zeros(patches, dtype=np.bool_),
        np.zeros(patches, dtype=np.bool_),
        np.zeros(sheets, dtype=np.bool_),
        np.zeros(sheets, dtype=np.int64),
        np.zeros(regions, dtype=np.bool_),
        np.zeros(patches, dtype=np.int64),
        np.empty((patches, 4)),
        np.zeros(patches, dtype=np.bool_),
        np.empty((12 * patches + 32, 4, 3)),
        np.empty((12 * patches + 32, 3), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        make_cuts(patches),
        np.empty((9, 4)),
        np.empty((4, 4)),
        np.empty((9, 9)),
        np.empty((17, 4, 3)),
        np.empty((2, 8)),
        np.empty((3, 3)),
        np.empty((3 * _LEVELS + 4, 4, 4, 4)),
        np.empty(3 * _LEVELS + 4, dtype=np.int64),
    )


@lean
def forget_outlines(out):
    """Make ready for the next receiver."""
    for b in range(out.shifted.shape[0]):
        out.shifted[b] = False
    for s in range(out.looked.shape[0]):
        out.viewed[s] = False
        out.looked[s] = UNKNOWN
    for r in range(out.arcs.shape[0]):
        out.arcs[r] = False
    out.count[0] = 0


@lean
def is_low(b, nets, x, n, rounding, shifted, low, out):
    """Whether patch ``b`` is wholly below the horizon of receiver ``x`` with normal ``n``.

    Its net is shifted to the receiver, into ``out``, if it is not there yet.
    """
    if not shifted[b]:
        shift_net(nets[b], x, out[b])
        _, _, high = heights(out[b], n)
        low[b] = high <= rounding
        shifted[b] = True
    return low[b]


@lean
def _see_side(net, cone, quadric, x, rounding, polar, values):
    """How a plane or quadric is seen; writes ``polar``."""
    if polar_plane(quadric, x, polar):
        low, high, zero = side_values(net, polar, values)
    else:
        low = 0.0
        for k in range(3):
            low -= cone[k] * net[0, 0, k]
        high = low
        zero = rounding * net[0, 0, 3]
        polar[0] = polar[1] = polar[2] = 0.0
        polar[3] = 1.0 if low > 0.0 else -1.0
    if high <= zero and low >= -zero:
        polar[0] = polar[1] = polar[2] = polar[3] = 0.0
        return NONE
    if low >= -zero:
        return FRONT
    return BACK if high <= zero else MIXED


@lean
def _see_odd(tangents, center, x, polar, values):
    """How a patch of another kind is seen."""
    zero = see_tangents(tangents, center, x, values)
    low, high = extremes(values)
    polar[0] = polar[1] = polar[2] = 0.0
    polar[3] = 1.0 if low > -zero else -1.0
    if high <= zero and low >= -zero:
        polar[3] = 0.0
        return NONE
    if low >= -zero:
        return FRONT
    return BACK if high <= zero else ODD


@lean
def _sides_on(c, w, polar, g):
    """Side seen along an edge, as `side_along`, into ``g`` (4,); what is rounding is 0."""
    g[0], g[1], g[2], g[3], size = side_along(c, w, polar)
    for i in range(4):
        # An edge along the outline itself: what is left of it is rounding.
        g[i] = 0.0 if abs(g[i]) <= 1e-13 * size else g[i]


@lean
def _edge_weights(s, k, w):
    for i in range(4):
        if k == 0:
            w[i] = s[i, 0, 3]
        elif k == 1:
            w[i] = s[3, i, 3]
        elif k == 2:
            w[i] = s[3 - i, 3, 3]
        else:
            w[i] = s[0, 3 - i, 3]


@lean
def reverse_cubic(c):
    """Turn the direction of a cubic, in place."""
    for k in range(3):
        c[0, k], c[3, k] = c[3, k], c[0, k]
        c[1, k], c[2, k] = c[2, k], c[1, k]


@lean
def _add_edge(b, side, o, turn, nets, state, polar, work, breaks, curve, sides, count):
    """Add the parts of an edge of patch ``b`` at which its sheet ends; −1 for no room.

    ``o`` is the patch beyond it, −1 for none, and ``turn`` is −1 where that faces the other way.
    """
    own, other, weight = work[0], work[1], work[2]
    cuts, more = breaks[0], breaks[1]
    if count + 8 > curve.shape[0]:
        return -1
    c = curve[count]
    load_edge(nets[b], side, c)
    _edge_weights(nets[b], side, weight)
    _sides_on(c, weight, polar[b], own)
    parts = sign_breaks(own[0], own[1], own[2], own[3], cuts)
    if o >= 0:
        _sides_on(c, weight, polar[o], other)
        for i in range(4):
            other[i] *= turn
        extra = sign_breaks(other[0], other[1], other[2], other[3], more)
        # Sorted into the first list; both begin with 0 and end with 1.
        for m in range(1, extra - 1):
            k = parts
            while k > 0 and cuts[k - 1] > more[m]:
                cuts[k] = cuts[k - 1]
                k -= 1
            cuts[k] = more[m]
            parts += 1
    for m in range(parts - 1):
        a, z = cuts[m], cuts[m + 1]
        if z - a <= 1e-14:
            continue
        t = 0.5 * (a + z)
        front = cubic(own[0], own[1], own[2], own[3], t) > 0.0
        if o >= 0:
            beyond = cubic(other[0], other[1], other[2], other[3], t) > 0.0
            if state[b] == NONE and state[o] != NONE:
                front = not beyond  # what is seen edge-on ends the picture of the other
            elif state[o] != NONE and beyond == front:
                continue
            elif state[b] == NONE:
                continue
        c = curve[count]
        load_edge(nets[b], side, c)
        if a > 0.0 or z < 1.0:
            restrict_cubic(c, a, z)
        if not front:
            reverse_cubic(c)
        sides[count, 0], sides[count, 1], sides[count, 2] = b, max(o, -1), -1
        count += 1
    return count


@kernel
def _silhouette_of(b, quadric, x, out, count):
    """Add the arcs of the silhouette of a quadric patch; −1 where they are not found."""
    stack, level, f, pieces = out.stack, out.level, out.values, out.pieces
    low_u, high_u = np.empty((4, 4, 4)), np.empty((4, 4, 4))
    copy_net(out.nets[b], stack[0])
    level[0] = 0
    top = 1
    while top > 0:
        top -= 1
        low, high, zero = side_values(stack[top], out.polar[b], f)
        if low >= -zero or high <= zero:
            continue
        made = front_outline(
            stack[top], x, quadric, f, zero, False, pieces, out.breaks[0], out.ends, out.work
        )
        if made > 0:
            if count >= out.curve.shape[0]:
                return -1
            out.curve[count] = pieces[0]
            out.sides[count, 0], out.sides[count, 1], out.sides[count, 2] = b, -1, -1
            count += 1
            continue
        deep = level[top]
        if deep == _LEVELS:
            # What shows both sides no wider than this is a rounded corner of the outline.
            return -1
        halve_u(stack[top], low_u, high_u)
        halve_v(low_u, stack[top], stack[top + 1])
        halve_v(high_u, stack[top + 2], stack[top + 3])
        for k in range(4):
            level[top + k] = deep + 1
        top += 4
    return count


@lean
def _cut_region(r, neighbors, regions, x, out):
    """Find where the silhouette of a region crosses its boundary; False where it is not known."""
    c, w, quadric = out.pieces[0], out.work[2], regions.quadric[r]
    nets, polar, breaks, cuts, patch = out.nets, out.polar, out.breaks[0], out.cuts, regions.patch
    cuts.count[0] = 0
    for m in range(regions.first[r], regions.first[r + 1]):
        b = patch[m]
        for side in range(4):
            if neighbors[b, side, 0] == COLLAPSED or neighbors[b, side, 2] == SMOOTH:
                continue
            load_edge(nets[b], side, c)
            _edge_weights(nets[b], side, w)
            if not cut_boundary(r, c, w, polar[b], quadric, x, breaks, cuts):
                return False
    return True


@lean
def _corner_signs(patch, first, end, nets, polars):
    """Whether both sides are seen at corners of a region's patches."""
    up = down = False
    for m in range(first, end):
        b = patch[m]
        for i in (0, 3):
            for j in (0, 3):
                value = polars[b, 3] * nets[b, i, j, 3]
                for k in range(3):
                    value += polars[b, k] * nets[b, i, j, k]
                up = up or value > 0.0
                down = down or value < 0.0
    return up and down


@lean
def _silhouettes_of(r, neighbors, regions, x, out, count):
    """Add the silhouette of a region that shows both sides; −1 where it is not found."""
    first, end, bounded = regions.first[r], regions.first[r + 1], regions.bounded[r]
    nets, polar, sides, curve = out.nets, out.polar, out.sides, out.curve
    b = regions.patch[first]
    out.cuts.count[0] = 0
    if bounded and not _cut_region(r, neighbors, regions, x, out):
        return -1
    inside = not bounded or _corner_signs(regions.patch, first, end, nets, polar)
    quadric, center = regions.quadric[r], regions.center[r]
    if regions.kind[r] == ROUND:
        made = round_arcs(r, inside, quadric, center, x, out.cuts, out.work, curve, count)
    else:
        made = ruled_lines(r, quadric, center, polar[b], x, out.cuts, out.work, curve, count)
        if made == count and inside:
            return -1
    for k in range(count, made):
        sides[k, 0], sides[k, 1], sides[k, 2] = b, -1, r
    return made


@lean
def see_ellipsoid(r, b, quadric, center, x, out):
    """Find the silhouette of region ``r``, a whole ellipsoid with patch ``b``; whether it is known.

    That is all there is to know of it, as long as nothing depends on its single patches.
    """
    if not out.arcs[r]:
        polar_plane(quadric, x, out.polar[b])
        out.cuts.count[0] = 0
        count, sides = out.count[0], out.sides
        made = round_arcs(r, True, quadric, center, x, out.cuts, out.work, out.curve, count)
        if made < 0:
            return False
        for k in range(count, made):
            sides[k, 0], sides[k, 1], sides[k, 2] = b, -1, r
        out.count[0] = made
        out.arcs[r] = True
    return True


@lean
def see_sides(sheet, surfaces, cones, regions, x, n, rounding, out):
    """Find the sides seen of the patches of a sheet.

    Parameters
    ----------
    surfaces, cones, regions
        Of all patches.
    x, n, rounding
        Receiver, its normal, and `contour.horizon_tolerance`.
    out : Outlines
        Receives what is found.
    """
    out.looked[sheet] = SIDES
    all_nets, flags, quadrics = surfaces.nets, surfaces.flags, regions.quadric
    firsts, patch = regions.first, regions.patch
    nets, polar, state, whole = out.nets, out.polar, out.state, out.whole
    shifted, low, values = out.shifted, out.low, out.values
    for r in range(regions.start[sheet], regions.start[sheet + 1]):
        for m in range(firsts[r], firsts[r + 1]):
            b = patch[m]
            is_low(b, all_nets, x, n, rounding, shifted, low, nets)
            if quadrics[r, 4, 3] != 0.0 or flags[b] & PLANAR:
                state[b] = _see_side(nets[b], cones[b], quadrics[r], x, rounding, polar[b], values)
            else:
                state[b] = _see_odd(
                    surfaces.tangents[b], surfaces.centers[b], x, polar[b], out.tangents
                )
            whole[b] = True


@lean
def find_outlines(sheet, surfaces, regions, x, out):
    """Find the outlines of a sheet of which the sides are known. Parameters as of `see_sides`."""
    out.looked[sheet] = OUTLINED
    start, end = regions.start[sheet], regions.start[sheet + 1]
    neighbors, quadrics = surfaces.neighbors, regions.quadric
    firsts, patch, kind = regions.first, regions.patch, regions.kind
    nets, polar, state, whole = out.nets, out.polar, out.state, out.whole
    work, breaks, curve, sides, arcs = out.work, out.breaks, out.curve, out.sides, out.arcs
    count = out.count[0]
    for m in range(firsts[start], firsts[end]):
        b = patch[m]
        for side in range(4):
            o = neighbors[b, side, 0]
            if (
                o == COLLAPSED
                or neighbors[b, side, 2] == SMOOTH
                or (o != FREE and (o < b or (o == b and neighbors[b, side, 1] < side)))
            ):
                continue  # no length, no shadow, or done from the other side
            if o == FREE and state[b] == NONE:
                continue
            found = count * 0 - 1
            if state[b] != ODD and not (o >= 0 and state[o] == ODD):
                turn = 1.0 if neighbors[b, side, 3] > 0 else -1.0
                found = _add_edge(
                    b, side, o, turn, nets, state, polar, work, breaks, curve, sides, count
                )
            if found < 0:
                _forget_about(b, neighbors, whole)
            else:
                count = found
    for r in range(start, end):
        front = back = False
        for m in range(firsts[r], firsts[r + 1]):
            s = state[patch[m]]
            front = front or s == FRONT or s == MIXED
            back = back or s == BACK or s == MIXED
        if not (front and back):
            continue
        if arcs[r]:
            continue
        if kind[r] != PATCHES:
            found = _silhouettes_of(r, neighbors, regions, x, out, count)
            if found >= 0:
                count = found
                arcs[r] = True
                continue
        for m in range(firsts[r], firsts[r + 1]):
            b = patch[m]
            if state[b] != MIXED:
                continue
            found = _silhouette_of(b, quadrics[r], x, out, count)
            if found < 0:
                _forget_about(b, neighbors, whole)
            else:
                _settle(b, found > count, out)
                count = found
    out.count[0] = count


@lean
def _settle(b, mixed, out):
    """Note that a patch shows one side only, in spite of its control points, unless ``mixed``."""
    if not mixed:
        f = out.values
        side_values(out.nets[b], out.polar[b], f)
        out.state[b] = FRONT if f[0, 0] + f[0, 3] + f[3, 0] + f[3, 3] > 0.0 else BACK


@lean
def side_of(b, quadric, x, out):
    """How a patch of a known sheet is seen, for sure: not by its control points alone."""
    if out.state[b] == MIXED:
        count = out.count[0]
        _settle(b, _silhouette_of(b, quadric, x, out, count) != count, out)
    return out.state[b]


@lean
def _forget_about(b, neighbors, whole):
    """Note that outlines of a patch, and those of its neighbours found with it, are not known."""
    whole[b] = False
    for side in range(4):
        if neighbors[b, side, 0] >= 0:
            whole[neighbors[b, side, 0]] = False
