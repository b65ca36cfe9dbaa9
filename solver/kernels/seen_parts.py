"""What is seen of a patch past the surfaces that hide it: the parts of curves that bound it.

All curves are in the receiver's picture of the patch (`picture`): its own contour, the outlines of
what hides it, and the horizon. They are cut where they cross; of each part one ray tells whether it
bounds what is seen. The form factor is the contour integral over these parts.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import inlined, kernel, lean
from .contour import chord_term, cubic_point, curve_term, load_edge
from .crossings import MOST, OVERLAP, crossings, foot_on, is_straight, picture_box
from .nets import heights
from .picture import HALVINGS, add_horizon, add_outline, beside, frame_at, is_point, turn_into
from .quadric import front_outline, polar_plane, side_values
from .ray_patch import HIT, MISS, WORK, ray_patch_any

#: Curves that one pair may have, breaks of each, and pairs of them that run along each other.
_CURVES, _BREAKS, _ALONG = 256, 24, 64
#: How far beside a curve it is asked what is seen, against the size of the picture of the patch, at
#: most and at least: narrower openings are not seen.
_BESIDE, _BESIDE_LEAST = 1e-6, 1e-8
#: Largest sum of the steps along all parts kept, of directions against the size of the picture and
#: of their products against its square, and what is rounding of both.
_OPEN, _ROUNDING = 1e-8, 1e-14
#: Accuracy of each part against what is asked of the whole: they nearly cancel.
_SHARE = 0.03


class Curves(NamedTuple):
    """Curves in the picture of one patch, and scratch."""

    curve: np.ndarray  # (k, 4, 3) in the frame
    sheet: np.ndarray  # (k,) sheet of each curve, −1 for the patch and the horizon
    both: np.ndarray  # (k,) bool: whether it is to be asked what hides on the other side too
    straight: np.ndarray  # (k,) bool
    box: np.ndarray  # (k, 4) that holds the curve in the picture
    size: np.ndarray  # (k,) of the box
    along: np.ndarray  # (pairs, 2) curves that run along each other
    cuts: np.ndarray  # (k, breaks)
    count: np.ndarray  # (k,) cuts of each curve
    stack: np.ndarray  # (halvings, 4, 3)
    level: np.ndarray  # (halvings,)
    pieces: np.ndarray  # (17, 4, 3)
    space: np.ndarray  # (4, 4, 4)
    spans: np.ndarray  # (64, 4)
    work: np.ndarray  # (9, 4)
    small: np.ndarray  # (24, 3)
    eight: np.ndarray  # (3, 8)
    four: np.ndarray  # (6, 4)
    at: np.ndarray  # (MOST, 2)
    ray: np.ndarray


@kernel
def make_curves():
    """Scratch arrays."""
    return Curves(
        np.empty((_CURVES, 4, 3)),
        np.empty(_CURVES, dtype=np.int64),
        np.zeros(_CURVES, dtype=np.bool_),
        np.zeros(_CURVES, dtype=np.bool_),
        np.empty((_CURVES, 4)),
        np.empty(_CURVES),
        np.empty((_ALONG, 2), dtype=np.int64),
        np.empty((_CURVES, _BREAKS)),
        np.zeros(_CURVES, dtype=np.int64),
        np.empty((HALVINGS + 2, 4, 3)),
        np.zeros(HALVINGS + 2, dtype=np.int64),
        np.empty((17, 4, 3)),
        np.empty((4, 4, 4)),
        np.empty((64, 4)),
        np.empty((9, 4)),
        np.empty((24, 3)),
        np.empty((3, 8)),
        np.empty((6, 4)),
        np.empty((MOST, 2)),
        np.empty(WORK),
    )


@inlined
def meets_quadric(quadric, polar, d):
    """Whether a ray from the receiver along ``d`` meets the whole quadric; −1 in doubt.

    1 is sure of ellipsoids only.
    """
    a = 0.0
    for i in range(3):
        a += d[i] * (quadric[i, 0] * d[0] + quadric[i, 1] * d[1] + quadric[i, 2] * d[2])
    if a == 0.0:
        return -1  # parallel to a line of it, or there is no quadric
    a *= quadric[4, 3] ** 2
    b = polar[0] * d[0] + polar[1] * d[1] + polar[2] * d[2]
    square, product = b * b, a * polar[3]
    left = square - product
    if abs(left) <= 1e-12 * (square + abs(product)):
        return -1
    if left < 0.0:
        return 0
    # From outside, both points lie ahead or behind.
    return 1 if product < 0.0 or a * b < 0.0 else 0


@inlined
def _meets(nets, kinds, quadrics, of, polar, rays, whole, count, x, d, work):
    """Whether a surface of ``rays`` lies in the direction ``d``; −1 where that is not sure."""
    for m in range(count):
        b = rays[m]
        met = meets_quadric(quadrics[of[b]], polar[b], d)
        if met == 0:
            continue
        if whole[m]:
            return met
        status = ray_patch_any(
            nets[b], kinds[b], x[0], x[1], x[2], d[0], d[1], d[2], 1e-9, 1e300, 0, work
        )
        if status == HIT:
            return 1
        if status != MISS:
            return -1
    return 0


@lean
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
        turn_into(frame, pieces[m], curves[count])
        count += 0 if is_point(curves[count]) else 1
    return count


@lean
def _sort(values, count):
    for k in range(1, count):
        v = values[k]
        m = k
        while m > 0 and values[m - 1] > v:
            values[m] = values[m - 1]
            m -= 1
        values[m] = v


@inlined
def _gather_curves(
    x, n, net, quadric, mixed, hiders, seen, sheets, frame, turned, box, rounding, curves
):  # fmt: skip
    """Curves of the patch, of what hides it, and of the horizon.

    Returns how many belong to the patch, and how many there are; −1 where they are not known.
    """
    curve, four, sheet, both = curves.curve, curves.four, curves.sheet, curves.both
    polar = four[0]
    polar_plane(quadric, x, polar)
    own = _contour_of(
        net, x, quadric, polar, mixed, frame, curves.pieces, curves.eight[0], curves.small[0:3],
        curves.work, four[1:5], curve,
    )  # fmt: skip
    if own < 2:
        return own, -1
    box[0], box[1], box[2], box[3] = 1e300, -1e300, 1e300, -1e300
    for m in range(own):
        sheet[m] = -1
        for a in range(4):
            w = curve[m, a, 2]
            if w <= 0.0:
                return own, -1
            px, py = curve[m, a, 0] / w, curve[m, a, 1] / w
            box[0], box[1] = min(box[0], px), max(box[1], px)
            box[2], box[3] = min(box[2], py), max(box[3], py)
    made = own
    hides, casts, odd = hiders.hides, hiders.casts, hiders.odd
    outline, sides, level, stack = seen.curve, seen.sides, curves.level, curves.stack
    for k in range(seen.count[0]):
        # One edge is the outline of both patches that meet in it, of which one may not hide.
        b, other, r = sides[k, 0], sides[k, 1], sides[k, 2]
        if r >= 0:
            if not casts[r]:
                continue
        elif not (hides[b] or (other >= 0 and hides[other])):
            continue
        before = made
        made = add_outline(outline[k], frame, box, curve, made, level, stack)
        if made < 0:
            return own, -1
        for c in range(before, made):
            sheet[c], both[c] = sheets[b], r >= 0 and odd[r]
    low, inner, _ = heights(net, n)
    if min(low, inner) < -rounding:
        made = add_horizon(turned, box, curve, made)
        if made > 0:
            sheet[made - 1], both[made - 1] = -1, False
    return own, made


@inlined
def _cut_curves(own, made, convex, curves):
    """Find where the curves cross, and which run along each other.

    Returns the number of pairs of the latter in ``curves.along``; −1 where it is not known.
    """
    curve, sheet, straight = curves.curve, curves.sheet, curves.straight
    box, size = curves.box, curves.size
    cuts, count, at, pair_of = curves.cuts, curves.count, curves.at, curves.along
    breaks, more, space, spans = curves.eight[0], curves.eight[1], curves.space, curves.spans
    pairs = own * 0  # not a literal: it would compile the callees once more
    for m in range(made):
        straight[m] = is_straight(curve[m])
        picture_box(curve[m], box[m])
        size[m] = (box[m, 1] - box[m, 0]) + (box[m, 3] - box[m, 2])
        count[m] = 0
    for a in range(made):
        for b in range(max(a + 1, own), made):
            if sheet[a] == sheet[b] and sheet[a] >= 0 and convex[sheet[a]]:
                continue
            # Those that run along each other do so to rounding.
            margin = 10.0 * OVERLAP * (size[a] + size[b])
            if (
                max(box[a, 0] - box[b, 1], box[b, 0] - box[a, 1]) > margin
                or max(box[a, 2] - box[b, 3], box[b, 2] - box[a, 3]) > margin
            ):
                continue
            found, along = crossings(
                curve[a], straight[a], curve[b], straight[b], breaks, more, space, spans, at
            )
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
                pair_of[pairs, 0], pair_of[pairs, 1] = a, b
                pairs += 1
    for m in range(made):
        cuts[m, count[m]], cuts[m, count[m] + 1] = 0.0, 1.0
        count[m] += 2
        _sort(cuts[m], count[m])
    return pairs


@lean
def _is_double(m, t, pairs, along, curve, h, work):
    """Whether the part about ``t`` of curve ``m`` runs along an earlier curve."""
    for k in range(pairs):
        if along[k, 1] != m:
            continue
        cubic_point(curve[m], t, h)
        other = curve[along[k, 0]]
        _, away = foot_on(other, h[0] / h[2], h[1] / h[2], work)
        size = 0.0
        for q in range(2):
            size += abs(other[3, q] / other[3, 2] - other[0, q] / other[0, 2])
        if away <= 10.0 * OVERLAP * size:
            return True
    return False


@inlined
def visible_part(
    row, net, mixed, quadric, plain, x, n, rounding, eps, hiders, seen, surfaces, regions, curves,
):  # fmt: skip
    """Form factor of what is seen of a patch; NaN in doubt.

    Parameters
    ----------
    row : int
        Surface the patch is.
    net : (4, 4, 4) array
        It, relative to the receiver.
    mixed : bool
        Whether both sides of it are seen.
    quadric : (5, 4) array
        Its own.
    plain : float
        Its form factor with nothing in the way.
    x, n, rounding
        Receiver, its normal, and `contour.horizon_tolerance`.
    eps : float
        Relative accuracy.
    hiders : Hiders
        What hides some of it.
    seen : Outlines
        All surfaces, as far as they were looked at.
    surfaces, regions
        All surfaces.
    curves : Curves
        Scratch.
    """
    small, four, frame = curves.small, curves.four, curves.small[5:8]
    turned, steps, h, bends, d = small[8], small[9], small[10], small[11], small[12]
    box, foot = four[5], four[0]
    if not frame_at(net, frame):
        return math.nan
    for k in range(3):
        turned[k] = frame[k, 0] * n[0] + frame[k, 1] * n[1] + frame[k, 2] * n[2]
        steps[k] = bends[k] = 0.0
    own, made = _gather_curves(
        x, n, net, quadric, mixed, hiders, seen, surfaces.sheet, frame, turned, box, rounding,
        curves,
    )  # fmt: skip
    if made < 0:
        return math.nan
    pairs = _cut_curves(own, made, regions.convex, curves)
    if pairs < 0:
        return math.nan
    nets, kinds, quadrics, of = surfaces.nets, surfaces.kinds, regions.quadric, regions.of
    polar, rays, whole, ray = seen.polar, hiders.listed, hiders.whole, curves.ray
    curve, cuts, count, both, along = (
        curves.curve, curves.cuts, curves.count, curves.both, curves.along,
    )  # fmt: skip
    straight, number = curves.straight, hiders.count[0]
    # Without a line across it, all of the patch is hidden or nothing.
    crossed, first = made > own, count[0] * 0 - 1
    wide = (box[1] - box[0]) + (box[3] - box[2])
    step = min(_BESIDE, max(eps, _BESIDE_LEAST)) * wide
    # No part is larger than its curve is long in the picture; what they leave is the factor.
    length = 0.0
    for m in range(made):
        length += curves.size[m]
    digits = max(eps * min(_SHARE, 0.3 * 2.0 * math.pi * plain / length), 1e-14)
    total = 0.0
    for m in range(made):
        outline = m >= own
        sign = -1.0 if outline else 1.0
        for k in range(count[m] - 1):
            ta, tb = cuts[m, k], cuts[m, k + 1]
            if tb - ta <= 1e-13:
                continue
            t = 0.5 * (ta + tb)
            # On the side where the patch would be seen.
            if not beside(curve[m], t, sign * step, frame, foot, d):
                return math.nan
            if n[0] * d[0] + n[1] * d[1] + n[2] * d[2] <= 0.0:
                continue
            if outline:
                status = MISS
                if meets_quadric(quadrics[of[row]], polar[row], d) != 0:
                    status = ray_patch_any(
                        nets[row], kinds[row], x[0], x[1], x[2], d[0], d[1], d[2], 1e-9, 1e300, 0,
                        ray,
                    )  # fmt: skip
                if status == MISS:
                    continue
                if status != HIT:
                    return math.nan
            hidden = _meets(nets, kinds, quadrics, of, polar, rays, whole, number, x, d, ray)
            if hidden == 0 and outline and both[m]:
                if not beside(curve[m], t, step, frame, foot, d):
                    return math.nan
                beyond = _meets(nets, kinds, quadrics, of, polar, rays, whole, number, x, d, ray)
                hidden = 1 - beyond if beyond >= 0 else -1
            if hidden < 0:
                return math.nan
            if not crossed:
                if first >= 0 and hidden != first:
                    return math.nan
                first = hidden
                continue
            if hidden > 0 or _is_double(m, t, pairs, along, curve, h, foot):
                continue
            cubic_point(curve[m], ta, h)
            cubic_point(curve[m], tb, d)
            if straight[m]:
                part = chord_term(h[0], h[1], h[2], d[0], d[1], d[2], turned)
            else:
                part = curve_term(curve[m], ta, tb, turned, digits)
            total += sign * part
            for end in range(2):
                point, way = (h, -sign) if end == 0 else (d, sign)
                size = math.sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
                px, py, pz = point[0] / size, point[1] / size, point[2] / size
                steps[0] += way * px
                steps[1] += way * py
                steps[2] += way * pz
                # Opposite sides of a rectangle alone would cancel in these.
                bends[0] += way * px * px
                bends[1] += way * px * py
                bends[2] += way * py * py
    if not crossed:
        return math.nan if first < 0 else (0.0 if first > 0 else plain)
    for k in range(3):
        if abs(steps[k]) > max(_OPEN * wide, _ROUNDING):
            return math.nan
        if abs(bends[k]) > max(_OPEN * wide * wide, _ROUNDING):
            return math.nan
    return -total / (2.0 * math.pi)
