"""Outlines of surfaces from one receiver: the curves at which what they hide may end.

They are of two kinds: arcs of silhouettes, and edges of a sheet that are free or beyond which the
sheet turns back. Both are cubics of control vectors relative to the receiver, directed so that the
surface lies on their left. Silhouettes are known of quadrics (`quadric`); a patch of another kind
that shows both sides is `ODD`, and so is what needs its outline.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from .contour import cubic, load_edge, shift_net, sign_breaks
from .nets import PLANAR, halve_u, halve_v, heights
from .pieces import BACK, COLLAPSED, FREE, FRONT, MIXED, NONE, see_tangents
from .quadric import front_outline, polar_plane, restrict_cubic, side_values

#: A patch that shows both sides, but not where they meet.
ODD = 4
#: Stands for the direction of an edge over which the surface goes on smoothly: it casts no shadow.
SMOOTH = 2
#: Quarterings of a patch whose silhouette is not a single arc.
_LEVELS = 6


class Outlines(NamedTuple):
    """Surfaces as one receiver sees them, and their outlines."""

    nets: np.ndarray  # (p, 4, 4, 4) relative to the receiver
    state: np.ndarray  # (p,) `FRONT`, `BACK`, `MIXED`, `ODD`, or `NONE` for edge-on
    polar: np.ndarray  # (p, 4) functional of (H, w) that is positive where the + side is seen
    low: np.ndarray  # (p,) bool: wholly below the horizon
    curve: np.ndarray  # (k, 4, 3)
    sides: np.ndarray  # (k, 2) patches that meet in it, −1 for none
    count: np.ndarray  # (1,) number of curves
    whole: np.ndarray  # (p,) bool: all curves of the patch are known


@nb.njit(cache=True, error_model="numpy")
def make_outlines(patches):
    """Room for so many patches."""
    return Outlines(
        np.empty((patches, 4, 4, 4)),
        np.zeros(patches, dtype=np.int64),
        np.empty((patches, 4)),
        np.zeros(patches, dtype=np.bool_),
        np.empty((12 * patches + 32, 4, 3)),
        np.empty((12 * patches + 32, 2), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        np.zeros(patches, dtype=np.bool_),
    )


@nb.njit(cache=True, error_model="numpy")
def shift_surfaces(surfaces, x, n, rounding, out):
    """Shift all patches to receiver ``x`` with normal ``n``, and tell which are below its horizon.

    The first of two steps: `see_outlines` is not needed where none of them is in the way.
    """
    for b in range(surfaces.nets.shape[0]):
        shift_net(surfaces.nets[b], x, out.nets[b])
        _, _, high = heights(out.nets[b], n)
        out.low[b] = high <= rounding


@nb.njit(cache=True, error_model="numpy")
def _see_sides(surfaces, cones, quadrics, x, rounding, out, f, g):
    """Tell from which side each patch is seen."""
    for b in range(surfaces.nets.shape[0]):
        polar = out.polar[b]
        if polar_plane(quadrics[b], x, polar):
            low, high, zero = side_values(out.nets[b], polar, f)
        elif surfaces.flags[b] & PLANAR:
            low = 0.0
            for k in range(3):
                low -= cones[b, k] * out.nets[b, 0, 0, k]
            high = low
            zero = rounding * out.nets[b, 0, 0, 3]
            polar[0] = polar[1] = polar[2] = 0.0
            polar[3] = 1.0 if low > 0.0 else -1.0
        else:
            zero = see_tangents(surfaces.tangents[b], surfaces.centers[b], x, g)
            low, high = g.min(), g.max()
            polar[0] = polar[1] = polar[2] = 0.0
            polar[3] = 1.0 if low > -zero else -1.0
        if high <= zero and low >= -zero:
            out.state[b] = NONE
            polar[0] = polar[1] = polar[2] = polar[3] = 0.0
        elif low >= -zero:
            out.state[b] = FRONT
        elif high <= zero:
            out.state[b] = BACK
        else:
            out.state[b] = MIXED if quadrics[b, 4, 3] != 0.0 else ODD


@nb.njit(cache=True, error_model="numpy")
def _side_along(c, w, polar, g):
    """Side seen along a cubic edge ``c`` (4, 3) with weights ``w``: coefficients (4,)."""
    for i in range(4):
        a = polar[0] * c[i, 0] + polar[1] * c[i, 1] + polar[2] * c[i, 2]
        b = polar[3] * w[i]
        value = a + b
        # An edge along the outline itself: what is left of it is rounding.
        g[i] = 0.0 if abs(value) <= 1e-13 * (abs(a) + abs(b)) else value


@nb.njit(cache=True, error_model="numpy")
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


@nb.njit(cache=True, error_model="numpy")
def reverse_cubic(c):
    """Turn the direction of a cubic, in place."""
    for k in range(3):
        c[0, k], c[3, k] = c[3, k], c[0, k]
        c[1, k], c[2, k] = c[2, k], c[1, k]


@nb.njit(cache=True, error_model="numpy")
def _edges_of(b, surfaces, out, count, cuts, more, work):
    """Add the boundary edges of patch ``b`` at which its sheet ends; −1 where that is not known."""
    own, other, weight = work[0], work[1], work[2]
    for side in range(4):
        beyond = surfaces.neighbors[b, side]
        o = beyond[0]
        if (
            o == COLLAPSED
            or beyond[2] == SMOOTH
            or (o != FREE and (o < b or (o == b and beyond[1] < side)))
        ):
            continue  # no length, or done from the other side
        if out.state[b] == ODD or (o >= 0 and out.state[o] == ODD):
            return -1
        if count + 8 > out.curve.shape[0]:
            return -1
        c = out.curve[count]
        load_edge(out.nets[b], side, c)
        _edge_weights(out.nets[b], side, weight)
        _side_along(c, weight, out.polar[b], own)
        parts = sign_breaks(own[0], own[1], own[2], own[3], cuts)
        if o >= 0:
            _side_along(c, weight, out.polar[o], other)
            turn = 1.0 if beyond[3] > 0 else -1.0
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
            if o >= 0 and (cubic(other[0], other[1], other[2], other[3], t) > 0.0) == front:
                continue
            c = out.curve[count]
            load_edge(out.nets[b], side, c)
            restrict_cubic(c, a, z)
            if not front:
                reverse_cubic(c)
            out.sides[count, 0], out.sides[count, 1] = b, max(o, -1)
            count += 1
    return count


@nb.njit(cache=True, error_model="numpy")
def _silhouette_of(b, quadric, x, out, count, f, pieces, breaks, ends, work):
    """Add the arcs of the silhouette of a quadric patch; −1 where they are not found."""
    stack = np.empty((3 * _LEVELS + 4, 4, 4, 4))
    level = np.empty(3 * _LEVELS + 4, dtype=np.int64)
    low_u, high_u = np.empty((4, 4, 4)), np.empty((4, 4, 4))
    stack[0], level[0] = out.nets[b], 0
    top = 1
    while top > 0:
        top -= 1
        low, high, zero = side_values(stack[top], out.polar[b], f)
        if low >= -zero or high <= zero:
            continue
        made = front_outline(stack[top], x, quadric, f, zero, False, pieces, breaks, ends, work)
        if made > 0:
            if count >= out.curve.shape[0]:
                return -1
            out.curve[count] = pieces[0]
            out.sides[count, 0], out.sides[count, 1] = b, -1
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


@nb.njit(cache=True, error_model="numpy")
def see_outlines(surfaces, cones, quadrics, x, rounding, out):
    """Find the sides seen from receiver ``x`` and the outlines of all (shifted) surfaces."""
    f, g = np.empty((4, 4)), np.empty((9, 9))
    pieces, breaks, more = np.empty((17, 4, 3)), np.empty(8), np.empty(8)
    ends, work = np.empty((3, 3)), np.empty((9, 4))
    _see_sides(surfaces, cones, quadrics, x, rounding, out, f, g)
    count = 0
    out.whole[:] = True
    for b in range(surfaces.nets.shape[0]):
        found = edges = _edges_of(b, surfaces, out, count, breaks, more, work)
        if found >= 0 and out.state[b] == MIXED:
            found = _silhouette_of(b, quadrics[b], x, out, found, f, pieces, breaks, ends, work)
            if found == edges:
                # Control points on both sides, but no silhouette: one side only after all.
                side_values(out.nets[b], out.polar[b], f)
                out.state[b] = FRONT if f[0, 0] + f[0, 3] + f[3, 0] + f[3, 3] > 0.0 else BACK
        if found < 0:
            # Nor those of its neighbours, which are found with it.
            out.whole[b] = False
            for side in range(4):
                if surfaces.neighbors[b, side, 0] >= 0:
                    out.whole[surfaces.neighbors[b, side, 0]] = False
        else:
            count = found
    out.count[0] = count
