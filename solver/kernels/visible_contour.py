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

from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import inlined, kernel, lean, parallel
from .contour import horizon_tolerance, shift_net
from .nets import CONVEX, PLANAR
from .outlines import (
    OUTLINED,
    UNKNOWN,
    find_outlines,
    forget_outlines,
    is_low,
    make_outlines,
    see_ellipsoid,
    see_sides,
    side_of,
)
from .picture import heights_along, mean_normal, order, order_by_plane, order_of_sphere
from .pieces import BACK, FRONT, MIXED, NONE
from .pyramid import make_pyramid, outside_pyramid
from .rows import apart, view_cone
from .seen_parts import make_curves, visible_part

#: What became of a pair: nothing hides it, done, or left to other methods.
CLEAR, SOLVED, LEFT = 1, 2, 3
#: Rows that share scratch arrays.
_CHUNK = 16


class Hiders(NamedTuple):
    """Surfaces that hide something of one patch."""

    listed: np.ndarray  # (p,)
    whole: np.ndarray  # (p,) bool: whether each stands for all patches of an ellipsoid
    count: np.ndarray  # (1,) number of them
    hides: np.ndarray  # (p,) bool: whether a patch is listed
    casts: np.ndarray  # (r,) bool: regions of which a patch is listed
    odd: np.ndarray  # (r,) bool: regions of which a patch is not, though it may be in the way


@kernel
def _make_hiders(patches, regions):
    return Hiders(
        np.empty(patches, dtype=np.int64),
        np.zeros(patches, dtype=np.bool_),
        np.zeros(1, dtype=np.int64),
        np.zeros(patches, dtype=np.bool_),
        np.zeros(regions, dtype=np.bool_),
        np.zeros(regions, dtype=np.bool_),
    )


@lean
def _beyond_pyramid(planes, sphere, x):
    """Whether a sphere lies wholly outside one side plane of `make_pyramid` from receiver ``x``."""
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    for k in range(4):
        if planes[k, 0] * dx + planes[k, 1] * dy + planes[k, 2] * dz < -sphere[3]:
            return True
    return False


@inlined
def _in_way(
    row, net, own_patch, flags, cone, normal, ordered, sheets, nets, spheres, regions, x, n,
    rounding, seen, views, sheet_views, planes, reach, near,
):  # fmt: skip
    """List the surfaces that may meet the pyramid of the patch; returns how many there are.

    Parameters
    ----------
    views : (p, 7) array
        Receives the view cones of the patches of sheets that may be in the way.
    sheet_views : (s, 7) array
        View cones of all sheets.
    planes, reach
        Receive `make_pyramid` and `heights_along` of the patch, if anything may be in the way.
    near : (p,) int array
        Receives patches, and −1 − s for a sheet s that is an ellipsoid surely before the patch.
    """
    shifted, low, shifted_nets, viewed = seen.shifted, seen.low, seen.nets, seen.viewed
    balls, start, first, patch = regions.spheres, regions.start, regions.first, regions.patch
    bounded = regions.bounded
    count = own_patch * 0  # not a literal: it would compile the callees once more
    narrow = known = False
    for s in range(sheet_views.shape[0]):
        if apart(cone, sheet_views[s]):
            continue
        if not known:
            narrow, known = make_pyramid(net, planes), True
            heights_along(net, normal, reach)
        own = s == sheets[row]
        if not own:
            if narrow and _beyond_pyramid(planes, balls[s], x):
                continue
            before = sheet_views[s, 6] <= cone[5]
            if ordered and not before:
                place = order_of_sphere(balls[s], x, normal, reach)
                before = place < 0
                if place > 0:
                    continue
            mine = own_patch >= 0 and sheets[own_patch] == s
            if before and not (mine or bounded[start[s]]):
                near[count] = -1 - s
                count += 1
                continue
        begin, end = first[start[s]], first[start[s + 1]]
        if not viewed[s]:
            viewed[s] = True
            for m in range(begin, end):
                view_cone(x, spheres[patch[m]], views[patch[m]])
        for m in range(begin, end):
            b = patch[m]
            if b == own_patch or apart(cone, views[b]):
                continue
            if is_low(b, nets, x, n, rounding, shifted, low, shifted_nets):
                continue
            if b == row:
                if flags & (PLANAR | CONVEX):
                    continue
            elif narrow and outside_pyramid(planes, shifted_nets[b]):
                continue
            near[count] = b
            count += 1
    return count


@lean
def _is_inside(sheet, regions, state):
    """Whether a convex cavity is seen from within: from the front of all of its patches."""
    first, end = regions.first[regions.start[sheet]], regions.first[regions.start[sheet + 1]]
    for m in range(first, end):
        b = regions.patch[m]
        if state[b] != FRONT and state[b] != NONE:
            return False
    return True


@inlined
def _find_hiders(
    row, net, cone, views, normal, reach, ordered, near, in_way, blockers, surfaces, regions, x, n,
    rounding, seen, hiders,
):  # fmt: skip
    """List the surfaces that hide something of the patch; −1 where that is not sure.

    Looks at their sheets, and at the patch's own.
    """
    looked, state, nets, whole = seen.looked, seen.state, seen.nets, seen.whole
    sheets, flags, of, cones = surfaces.sheet, surfaces.flags, regions.of, blockers.cones
    bulging, listed, hides = blockers.bulging, hiders.listed, hiders.hides
    casts, odd, ellipsoid, spheres = hiders.casts, hiders.odd, hiders.whole, blockers.spheres
    sheet = sheets[row]
    if looked[sheet] == UNKNOWN:
        see_sides(sheet, surfaces, cones, regions, x, n, rounding, seen)
    inside = blockers.hollow[sheet] and _is_inside(sheet, regions, state)
    for b in range(hides.shape[0]):
        hides[b] = False
    for r in range(casts.shape[0]):
        casts[r] = odd[r] = False
    # The patch itself is no hider, though others of its region may be.
    odd[of[row]] = True
    count = row * 0  # not a literal: it would compile the callees once more
    for k in range(in_way):
        b = near[k]
        if b < 0:
            r = regions.start[-1 - b]
            b = regions.patch[regions.first[r]]
            if not see_ellipsoid(r, b, regions.quadric[r], regions.center[r], x, seen):
                return -1
            casts[r] = ellipsoid[count] = True
            listed[count] = b
            count += 1
            continue
        own = sheets[b]
        if looked[own] == UNKNOWN:
            see_sides(own, surfaces, cones, regions, x, n, rounding, seen)
        if state[b] == NONE:
            continue
        # Seen from one side throughout, a patch does not hide itself.
        if b == row and (state[b] == FRONT or state[b] == BACK):
            continue
        if own == sheet and (bulging[sheet] or inside):
            continue
        if b == row or not ordered:
            return -1
        if views[b, 6] > cone[5]:
            place = order_of_sphere(spheres[b], x, normal, reach)
            if place == 0 and flags[b] & PLANAR:
                place += order_by_plane(net, nets[b], cones[b])
            if place == 0:
                place += order(nets[b], normal, reach)
            if place > 0:
                odd[of[b]] = True
                continue
            if place == 0:
                return -1
        if looked[own] != OUTLINED:
            find_outlines(own, surfaces, regions, x, seen)
        if not whole[b]:
            return -1
        hides[b] = casts[of[b]] = True
        listed[count], ellipsoid[count] = b, False
        count += 1
    hiders.count[0] = count
    return count


@parallel
def contour_rows(
    nodes, normals, on, askew, place, nets, flags, spheres, plain, eps, blockers, surfaces, regions,
    source_quadrics, values, status,
):  # fmt: skip
    """Form factors from m points to n sources past all surfaces, where this method serves.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals; one with normal 0 gets no light.
    on : (m,) int array
        Surface each lies on, −1 for none.
    askew : (m,) bool array
        Whether one on a curved surface looks along another direction than its normal.
    place : (n,) int array
        Surface each source is.
    nets, flags, spheres, source_quadrics
        Of the sources.
    plain : (m, n) array
        Form factors without hiding.
    eps : float
        Accuracy relative to these.
    blockers, surfaces, regions
        All surfaces, as `pyramid.Blockers`, `pieces.Surfaces` and `regions.Regions`.
    values : (m, n) array
        Receives the form factors of pairs `SOLVED`.
    status : (m, n) int array
        Receives `CLEAR`, `SOLVED` or `LEFT`.
    """
    p, m, sheets = surfaces.nets.shape[0], nodes.shape[0], regions.start.shape[0] - 1
    for chunk in nb.prange((m + _CHUNK - 1) // _CHUNK):
        seen, curves = make_outlines(p, sheets, regions.kind.shape[0]), make_curves()
        hiders = _make_hiders(p, regions.kind.shape[0])
        views, sheet_views = np.empty((p, 7)), np.empty((sheets, 7))
        near, net = np.empty(p, dtype=np.int64), np.empty((4, 4, 4))
        cone, planes, normal = np.empty(7), np.empty((6, 3)), np.empty(3)
        reach = np.empty(2)
        for i in range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, m)):
            x, n = nodes[i], normals[i]
            any_lit = False
            for j in range(nets.shape[0]):
                status[i, j] = CLEAR
                any_lit = any_lit or plain[i, j] > 0.0
            if not any_lit:
                continue
            rounding = horizon_tolerance(x)
            forget_outlines(seen)
            for b in range(sheets):
                view_cone(x, regions.spheres[b], sheet_views[b])
            # A receiver on a curved surface may have it in its own sight.
            sees_own = on[i] >= 0 and not (
                surfaces.flags[on[i]] & PLANAR
                or is_low(on[i], surfaces.nets, x, n, rounding, seen.shifted, seen.low, seen.nets)
            )
            # Of a convex body only if it does not look straight away from it; of a convex cavity it
            # sees all.
            mine = on[i] * 0 - 1
            if sees_own and blockers.hollow[surfaces.sheet[on[i]]]:
                mine = surfaces.sheet[on[i]]
            elif sees_own and blockers.bulging[surfaces.sheet[on[i]]]:
                sees_own = askew[i]
            for j in range(nets.shape[0]):
                if plain[i, j] <= 0.0:
                    continue
                row = place[j]
                if sees_own and surfaces.sheet[row] != mine:
                    status[i, j] = LEFT
                    continue
                view_cone(x, spheres[j], cone)
                shift_net(nets[j], x, net)
                ordered = mean_normal(net, normal)
                in_way = _in_way(
                    row, net, on[i], flags[j], cone, normal, ordered, surfaces.sheet,
                    surfaces.nets, blockers.spheres, regions, x, n, rounding, seen, views,
                    sheet_views, planes, reach, near,
                )  # fmt: skip
                if in_way == 0:
                    continue
                count = _find_hiders(
                    row, net, cone, views, normal, reach, ordered, near, in_way, blockers, surfaces,
                    regions, x, n, rounding, seen, hiders,
                )  # fmt: skip
                if count == 0:
                    continue
                status[i, j] = LEFT
                state = side_of(row, regions.quadric[regions.of[row]], x, seen)
                if count < 0 or (state != FRONT and state != MIXED and state != BACK):
                    continue
                factor = visible_part(
                    row, net, state == MIXED, source_quadrics[j], plain[i, j], x, n, rounding,
                    eps, hiders, seen, surfaces, regions, curves,
                )  # fmt: skip
                slack = eps * plain[i, j] + 1e-12
                # That no part bounds what is seen does not prove that all is hidden.
                if factor != 0.0 and -slack <= factor <= plain[i, j] + slack:
                    values[i, j] = max(0.0, min(factor, plain[i, j]))
                    status[i, j] = SOLVED
