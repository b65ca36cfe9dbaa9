"""Form factors of partly hidden patches by the contour of what is seen of them.

What a receiver sees of a patch is bounded by parts of the patch's own contour and by parts of the
outlines of what hides it (`outlines`). All curves are cut where they cross in the receiver's
picture; of each part one ray tells whether it bounds what is seen: a part of the patch's contour
does if nothing hides the patch beside it, a part of an outline if the patch is seen beside it, on
the side away from the surface it belongs to. The form factor is the contour integral over these
parts: exact up to quadrature, whatever the number of surfaces that hide, and wherever they touch.

The horizon is one more straight outline. The parts kept must join to closed loops: the sum of the
steps from the first to the last direction of each must vanish. Where it does not, or anything else
is in doubt, the pair is left to other methods.

Only surfaces wholly before or wholly beyond the patch are dealt with.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .contour import cubic_point, edge_term, horizon_tolerance, load_edge, shift_net
from .crossings import MOST, OVERLAP, crossings, foot_on, is_straight
from .nets import CONVEX, PLANAR, heights
from .outlines import Outlines, make_outlines, see_outlines, shift_surfaces
from .picture import (
    HALVINGS,
    add_horizon,
    add_outline,
    beside,
    frame_at,
    mean_normal,
    order,
    order_by_plane,
    turn_into,
)
from .pieces import BACK, FRONT, MIXED, NONE
from .pyramid import make_pyramid, outside_pyramid
from .quadric import front_outline, polar_plane, side_values
from .ray_patch import HIT, MISS, WORK, ray_patch_any
from .rows import apart, view_cone

#: What became of a pair: nothing hides it, done, or left to other methods.
CLEAR, SOLVED, LEFT = 1, 2, 3
#: Curves that one pair may have, breaks of each, and pairs of them that run along each other.
_CURVES, _BREAKS, _ALONG = 256, 24, 64
#: Rows that share scratch arrays.
_CHUNK = 16
#: How far beside a curve it is asked what is seen, against the size of the picture of the patch, at
#: most and at least: narrower openings are not seen.
_BESIDE, _BESIDE_LEAST = 1e-6, 1e-8
#: Largest sum of the steps along all parts kept, of directions and of their products.
_OPEN = 1e-8
#: Accuracy of each part against what is asked of the whole: they nearly cancel.
_SHARE = 0.03


class Scratch(NamedTuple):
    """Arrays one thread works in."""

    seen: Outlines
    views: np.ndarray  # (p, 7) view cones of all surfaces
    near: np.ndarray  # (p,) surfaces that meet the pyramid of the patch
    listed: np.ndarray  # (p,) those that hide
    hides: np.ndarray  # (p,) bool: the same
    curves: np.ndarray  # (k, 4, 3) in the frame
    sheet: np.ndarray  # (k,) sheet of each curve, −1 for the patch and the horizon
    straight: np.ndarray  # (k,) bool
    along: np.ndarray  # (pairs, 2) curves that run along each other
    cuts: np.ndarray  # (k, breaks)
    count: np.ndarray  # (k,) cuts of each curve
    stack: np.ndarray  # (halvings, 4, 3)
    level: np.ndarray  # (halvings,)
    pieces: np.ndarray  # (17, 4, 3)
    net: np.ndarray  # (4, 4, 4) the patch relative to the receiver
    space: np.ndarray  # (4, 4, 4)
    spans: np.ndarray  # (64, 4)
    work: np.ndarray  # (9, 4)
    small: np.ndarray  # (24, 3)
    eight: np.ndarray  # (3, 8)
    four: np.ndarray  # (6, 4)
    at: np.ndarray  # (MOST, 2)
    ray: np.ndarray


@nb.njit(cache=True, error_model="numpy")
def make_contour_scratch(patches):
    """Scratch arrays for so many surfaces."""
    return Scratch(
        make_outlines(patches),
        np.empty((patches, 7)),
        np.empty(patches, dtype=np.int64),
        np.empty(patches, dtype=np.int64),
        np.zeros(patches, dtype=np.bool_),
        np.empty((_CURVES, 4, 3)),
        np.empty(_CURVES, dtype=np.int64),
        np.zeros(_CURVES, dtype=np.bool_),
        np.empty((_ALONG, 2), dtype=np.int64),
        np.empty((_CURVES, _BREAKS)),
        np.zeros(_CURVES, dtype=np.int64),
        np.empty((HALVINGS + 2, 4, 3)),
        np.zeros(HALVINGS + 2, dtype=np.int64),
        np.empty((17, 4, 3)),
        np.empty((4, 4, 4)),
        np.empty((4, 4, 4)),
        np.empty((64, 4)),
        np.empty((9, 4)),
        np.empty((24, 3)),
        np.empty((3, 8)),
        np.empty((6, 4)),
        np.empty((MOST, 2)),
        np.empty(WORK),
    )


@nb.njit(cache=True, error_model="numpy")
def _misses_quadric(quadric, polar, d):
    """Whether a line through the receiver along ``d`` surely misses the whole quadric."""
    scale = quadric[4, 3]
    if scale == 0.0:
        return False
    a = b = 0.0
    for i in range(3):
        b += polar[i] * d[i]
        for j in range(3):
            a += quadric[i, j] * d[i] * d[j]
    a *= scale * scale
    square, product = b * b, a * polar[3]
    return square - product < -1e-12 * (square + abs(product))


@nb.njit(cache=True, error_model="numpy")
def _meets(surfaces, quadrics, seen, listed, count, x, d, work):
    """Whether a listed surface lies in the direction ``d``; −1 where that is not sure."""
    for m in range(count):
        b = listed[m]
        if _misses_quadric(quadrics[b], seen.polar[b], d):
            continue
        status = ray_patch_any(
            surfaces.nets[b], surfaces.kinds[b], x[0], x[1], x[2], d[0], d[1], d[2], 1e-9, 1e300,
            0, work,
        )  # fmt: skip
        if status == HIT:
            return 1
        if status != MISS:
            return -1
    return 0


@nb.njit(cache=True, error_model="numpy")
def _inside(s_net, kind, quadric, polar, x, d, work):
    """Whether the patch itself lies in the direction ``d``."""
    if _misses_quadric(quadric, polar, d):
        return 0
    status = ray_patch_any(s_net, kind, x[0], x[1], x[2], d[0], d[1], d[2], 1e-9, 1e300, 0, work)
    return 1 if status == HIT else (0 if status == MISS else -1)


@nb.njit(cache=True, error_model="numpy")
def _contour_of(net, x, quadric, polar, mixed, frame, pieces, breaks, ends, work, f, curves):
    """Curves of the lit contour of a patch; −1 where it is not known."""
    count = 0
    if mixed:
        _, _, zero = side_values(net, polar, f)
        made = front_outline(net, x, quadric, f, zero, True, pieces, breaks, ends, work)
        if made < 0:
            return -1
    else:
        made = 4
        for k in range(4):
            load_edge(net, k, pieces[k])
    for m in range(made):
        size = 0.0
        for i in range(1, 4):
            for k in range(3):
                size = max(size, abs(pieces[m, i, k] - pieces[m, 0, k]))
        far = abs(pieces[m, 0, 0]) + abs(pieces[m, 0, 1]) + abs(pieces[m, 0, 2])
        if size > 1e-14 * far:
            turn_into(frame, pieces[m], curves[count])
            count += 1
    return count


@nb.njit(cache=True, error_model="numpy")
def _sort(values, count):
    for k in range(1, count):
        v = values[k]
        m = k
        while m > 0 and values[m - 1] > v:
            values[m] = values[m - 1]
            m -= 1
        values[m] = v


@nb.njit(cache=True, error_model="numpy")
def _in_way(row, own_patch, flags, cone, planes, narrow, scratch):
    """List the surfaces that may meet the pyramid of the patch; returns how many there are."""
    seen, views, near = scratch.seen, scratch.views, scratch.near
    count = own_patch * 0  # not a literal: it would compile the callees once more
    for b in range(views.shape[0]):
        if seen.low[b] or b == own_patch or apart(cone, views[b]):
            continue
        if b == row:
            if flags & (PLANAR | CONVEX):
                continue
        elif narrow and outside_pyramid(planes, seen.nets[b]):
            continue
        near[count] = b
        count += 1
    return count


@nb.njit(cache=True, error_model="numpy")
def _is_inside(sheet, surfaces, seen):
    """Whether a convex cavity is seen from within: from the front of all of its patches."""
    for b in range(seen.state.shape[0]):
        if surfaces.sheet[b] == sheet and seen.state[b] != FRONT and seen.state[b] != NONE:
            return False
    return True


@nb.njit(cache=True, error_model="numpy")
def _hiders(row, cone, normal, ordered, in_way, blockers, surfaces, scratch):
    """List the surfaces that hide something of the patch; −1 where that is not sure."""
    seen = scratch.seen
    sheet = surfaces.sheet[row]
    inside = blockers.hollow[sheet] and _is_inside(sheet, surfaces, seen)
    count = row * 0  # not a literal: it would compile the callees once more
    for k in range(in_way):
        b = scratch.near[k]
        if seen.state[b] == NONE:
            continue
        # Seen from one side throughout, a patch does not hide itself.
        if b == row and (seen.state[b] == FRONT or seen.state[b] == BACK):
            continue
        if surfaces.sheet[b] == sheet and (blockers.bulging[sheet] or inside):
            continue
        if b == row or not ordered:
            return -1
        if scratch.views[b, 6] > cone[5]:
            place = count * 0
            if surfaces.flags[b] & PLANAR:
                place += order_by_plane(scratch.net, seen.nets[b], blockers.cones[b])
            if place == 0:
                place += order(scratch.net, seen.nets[b], normal)
            if place > 0:
                continue
            if place == 0:
                return -1
        if not seen.whole[b]:
            return -1
        scratch.listed[count] = b
        count += 1
    return count


@nb.njit(cache=True, error_model="numpy")
def _gather_curves(x, n, quadric, mixed, count, surfaces, frame, turned, box, rounding, scratch):
    """Curves of the patch, of what hides it, and of the horizon.

    Returns how many belong to the patch, and how many there are; −1 where they are not known.
    """
    seen, curves = scratch.seen, scratch.curves
    polar = scratch.four[0]
    polar_plane(quadric, x, polar)
    own = _contour_of(
        scratch.net, x, quadric, polar, mixed, frame, scratch.pieces, scratch.eight[0],
        scratch.small[0:3], scratch.work, scratch.four[1:5], curves,
    )  # fmt: skip
    if own < 2:
        return own, -1
    box[0], box[1], box[2], box[3] = 1e300, -1e300, 1e300, -1e300
    for m in range(own):
        scratch.sheet[m] = -1
        for a in range(4):
            w = curves[m, a, 2]
            if w <= 0.0:
                return own, -1
            px, py = curves[m, a, 0] / w, curves[m, a, 1] / w
            box[0], box[1] = min(box[0], px), max(box[1], px)
            box[2], box[3] = min(box[2], py), max(box[3], py)
    made = own
    for b in range(scratch.hides.shape[0]):
        scratch.hides[b] = False
    for m in range(count):
        scratch.hides[scratch.listed[m]] = True
    for k in range(seen.count[0]):
        # One edge is the outline of both patches that meet in it, of which one may not hide.
        b, other = seen.sides[k, 0], seen.sides[k, 1]
        if not (scratch.hides[b] or (other >= 0 and scratch.hides[other])):
            continue
        before = made
        made = add_outline(seen.curve[k], frame, box, curves, made, scratch.level, scratch.stack)
        if made < 0:
            return own, -1
        for c in range(before, made):
            scratch.sheet[c] = surfaces.sheet[b]
    low, _, _ = heights(scratch.net, n)
    if low < -rounding:
        made = add_horizon(turned, box, curves, made)
        if made > 0:
            scratch.sheet[made - 1] = -1
    return own, made


@nb.njit(cache=True, error_model="numpy")
def _cut_curves(own, made, blockers, scratch):
    """Find where the curves cross, and which run along each other.

    Returns the number of pairs of the latter in ``scratch.along``; −1 where it is not known.
    """
    curves, sheet, straight = scratch.curves, scratch.sheet, scratch.straight
    cuts, count, at = scratch.cuts, scratch.count, scratch.at
    pairs = own * 0  # not a literal: it would compile the callees once more
    for m in range(made):
        straight[m] = is_straight(curves[m])
        count[m] = 0
    for a in range(made):
        for b in range(max(a + 1, own), made):
            if sheet[a] == sheet[b] and sheet[a] >= 0 and blockers.bulging[sheet[a]]:
                continue  # the outline of a convex body does not cross itself
            found, along = crossings(
                curves[a], straight[a], curves[b], straight[b], scratch.eight[0], scratch.eight[1],
                scratch.space, scratch.spans, at,
            )  # fmt: skip
            if found < 0 or max(count[a], count[b]) + found > _BREAKS - 2:
                return -1
            for k in range(found):
                if at[k, 0] >= 0.0:
                    cuts[a, count[a]] = at[k, 0]
                    count[a] += 1
                if at[k, 1] >= 0.0:
                    cuts[b, count[b]] = at[k, 1]
                    count[b] += 1
            if along:
                if pairs == _ALONG:
                    return -1
                scratch.along[pairs, 0], scratch.along[pairs, 1] = a, b
                pairs += 1
    for m in range(made):
        cuts[m, count[m]], cuts[m, count[m] + 1] = 0.0, 1.0
        count[m] += 2
        _sort(cuts[m], count[m])
    return pairs


@nb.njit(cache=True, error_model="numpy")
def _is_double(m, t, pairs, scratch):
    """Whether the part about ``t`` of curve ``m`` runs along an earlier curve."""
    h = scratch.small[3]
    for k in range(pairs):
        if scratch.along[k, 1] != m:
            continue
        cubic_point(scratch.curves[m], t, h)
        other = scratch.curves[scratch.along[k, 0]]
        _, away = foot_on(other, h[0] / h[2], h[1] / h[2], scratch.four[0])
        size = 0.0
        for q in range(2):
            size += abs(other[3, q] / other[3, 2] - other[0, q] / other[0, 2])
        if away <= 10.0 * OVERLAP * size:
            return True
    return False


@nb.njit(cache=True, error_model="numpy")
def _bounds_what_is_seen(m, t, outline, row, x, n, count, frame, step, surfaces, quadrics, scratch):
    """Whether the part about ``t`` of curve ``m`` bounds what is seen of the patch; −1 in doubt."""
    h, d = scratch.small[3], scratch.small[4]
    # The side on which the patch would be seen.
    if not beside(scratch.curves[m], t, -step if outline else step, frame, h, d):
        return -1
    if n[0] * d[0] + n[1] * d[1] + n[2] * d[2] <= 0.0:
        return 0
    if outline:
        there = _inside(
            surfaces.nets[row], surfaces.kinds[row], quadrics[row], scratch.seen.polar[row], x, d,
            scratch.ray,
        )  # fmt: skip
        if there <= 0:
            return there
    hidden = _meets(surfaces, quadrics, scratch.seen, scratch.listed, count, x, d, scratch.ray)
    return 1 - hidden if hidden >= 0 else -1


@nb.njit(cache=True, error_model="numpy")
def _visible(
    row, mixed, quadric, x, n, rounding, eps, count, blockers, surfaces, quadrics, scratch
):
    """Form factor of what is seen of the patch in ``scratch.net``; NaN in doubt."""
    frame, turned, steps = scratch.small[5:8], scratch.small[8], scratch.small[9]
    h, bends, box = scratch.small[10], scratch.small[11], scratch.four[5]
    if not frame_at(scratch.net, frame):
        return math.nan
    for k in range(3):
        turned[k] = frame[k, 0] * n[0] + frame[k, 1] * n[1] + frame[k, 2] * n[2]
        steps[k] = bends[k] = 0.0
    own, made = _gather_curves(
        x, n, quadric, mixed, count, surfaces, frame, turned, box, rounding, scratch
    )
    if made < 0:
        return math.nan
    pairs = _cut_curves(own, made, blockers, scratch)
    if pairs < 0:
        return math.nan
    step = min(_BESIDE, max(eps, _BESIDE_LEAST)) * ((box[1] - box[0]) + (box[3] - box[2]))
    total = 0.0
    for m in range(made):
        outline = m >= own
        for k in range(scratch.count[m] - 1):
            ta, tb = scratch.cuts[m, k], scratch.cuts[m, k + 1]
            if tb - ta <= 1e-13:
                continue
            bounds = _bounds_what_is_seen(
                m, 0.5 * (ta + tb), outline, row, x, n, count, frame, step, surfaces, quadrics,
                scratch,
            )  # fmt: skip
            if bounds < 0:
                return math.nan
            if bounds == 0 or _is_double(m, 0.5 * (ta + tb), pairs, scratch):
                continue
            sign = -1.0 if outline else 1.0
            total += sign * edge_term(scratch.curves[m], ta, tb, turned, _SHARE * eps)
            for end in range(2):
                cubic_point(scratch.curves[m], ta if end == 0 else tb, h)
                size = math.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
                way = sign * (-1.0 if end == 0 else 1.0)
                px, py, pz = h[0] / size, h[1] / size, h[2] / size
                steps[0] += way * px
                steps[1] += way * py
                steps[2] += way * pz
                # Opposite sides of a rectangle alone would cancel in these.
                bends[0] += way * px * px
                bends[1] += way * px * py
                bends[2] += way * py * py
    for k in range(3):
        if abs(steps[k]) > _OPEN or abs(bends[k]) > _OPEN * (box[1] - box[0] + box[3] - box[2]):
            return math.nan
    return -total / (2.0 * math.pi)


@nb.njit(cache=True, error_model="numpy", parallel=True)
def contour_rows(
    nodes, normals, on, place, nets, flags, spheres, plain, eps, blockers, surfaces, quadrics,
    source_quadrics, values, status,
):  # fmt: skip
    """Form factors from m points to n sources past all surfaces, where this method serves.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals; one with normal 0 gets no light.
    on : (m,) int array
        Surface each lies on, −1 for none.
    place : (n,) int array
        Surface each source is.
    nets, flags, spheres, source_quadrics
        Of the sources.
    plain : (m, n) array
        Form factors without hiding.
    eps : float
        Accuracy relative to these.
    blockers, surfaces, quadrics
        `pyramid.Blockers`, `pieces.Surfaces` and quadrics of all surfaces.
    values : (m, n) array
        Receives the form factors of pairs `SOLVED`.
    status : (m, n) int array
        Receives `CLEAR`, `SOLVED` or `LEFT`.
    """
    p, m = surfaces.nets.shape[0], nodes.shape[0]
    for chunk in nb.prange((m + _CHUNK - 1) // _CHUNK):
        scratch = make_contour_scratch(p)
        seen = scratch.seen
        cone, planes, normal = np.empty(7), np.empty((6, 3)), np.empty(3)
        for i in range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, m)):
            x, n = nodes[i], normals[i]
            any_lit = False
            for j in range(nets.shape[0]):
                status[i, j] = CLEAR
                any_lit = any_lit or plain[i, j] > 0.0
            if not any_lit:
                continue
            rounding = horizon_tolerance(x)
            shift_surfaces(surfaces, x, n, rounding, seen)
            for b in range(p):
                view_cone(x, blockers.spheres[b], scratch.views[b])
            looked = False
            # A receiver on a curved surface may have it in its own sight.
            sees_own = on[i] >= 0 and not (seen.low[on[i]] or surfaces.flags[on[i]] & PLANAR)
            if sees_own:
                sheet = surfaces.sheet[on[i]]
                sees_own = not (blockers.bulging[sheet] or blockers.hollow[sheet])
            for j in range(nets.shape[0]):
                if plain[i, j] <= 0.0:
                    continue
                if sees_own:
                    status[i, j] = LEFT
                    continue
                row = place[j]
                view_cone(x, spheres[j], cone)
                shift_net(nets[j], x, scratch.net)
                narrow = make_pyramid(scratch.net, planes)
                in_way = _in_way(row, on[i], flags[j], cone, planes, narrow, scratch)
                if in_way == 0:
                    continue
                if not looked:
                    see_outlines(surfaces, blockers.cones, quadrics, x, rounding, seen)
                    looked = True
                ordered = mean_normal(scratch.net, normal)
                count = _hiders(row, cone, normal, ordered, in_way, blockers, surfaces, scratch)
                if count == 0:
                    continue
                status[i, j] = LEFT
                state = seen.state[row]
                if count < 0 or (state != FRONT and state != MIXED and state != BACK):
                    continue
                factor = _visible(
                    row, state == MIXED, source_quadrics[j], x, n, rounding, eps, count, blockers,
                    surfaces, quadrics, scratch,
                )  # fmt: skip
                slack = eps * plain[i, j] + 1e-12
                # That no part bounds what is seen does not prove that all is hidden.
                if factor != 0.0 and -slack <= factor <= plain[i, j] + slack:
                    values[i, j] = max(0.0, min(factor, plain[i, j]))
                    status[i, j] = SOLVED
