"""Light of a small disc at infinity, the sun's, past surfaces of any shape.

On the plane perpendicular to its direction the disc is a circle, and what a receiver sees of it is
bounded by its rim and by shadow edges. The square about the circle is quartered where a shadow edge
may meet it, told by its pyramid as in `pyramid`. In a square that one edge parts, the edge itself
is looked for: where it crosses two sides, and half way between them, by halving intervals until
rays pass on one side of it and not on the other. A parabola through the three points is taken for
it, so that what is missed falls with the fourth power of the size of the square. What is lit of a
square is then a polygon, of which the part within the circle, and above the horizons, is integrated
in closed form. Squares with more in them are quartered further, and the smallest are sampled.
"""

import math

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .contour import horizon_tolerance
from .disc_hiding import list_hiding
from .disc_polygons import make_disc, polygon_light
from .pyramid import NO_BLOCKER, blocked, make_pyramid, see_blockers
from .sun_disc import cone_of, frame, meets_cone

#: Quarterings of a square before an edge is looked for in it.
_LEAST = 2
#: Halvings of an interval that an edge crosses: to 6e-5 of the side of a square.
_HALVINGS = 14
#: How far from its chord an edge is looked for, and may be to be taken for a parabola, over it.
_REACH, _BENT = 0.25, 0.1
#: Error of a parabola over the area between it and its chord: what is left is of its next term.
_LEFT_OF_BEND = 0.05
#: Variance of the share of a square where four places do not tell of an edge in it.
_ALIKE = 0.0039
#: Steps of a sequence of evenly spread points: powers of the root of x³ = x + 1, inverted.
_FIRST, _SECOND = 0.7548776662466927, 0.5698402909980532


@lean
def _is_lit(disc, x, y, origin, blockers, listed, count):
    """Whether nothing listed hides the place (x, y) of the plane."""
    axes, first = disc.axes, count * 0  # not a literal: it would compile the callee once more
    dx = axes[2, 0] + x * axes[0, 0] + y * axes[1, 0]
    dy = axes[2, 1] + x * axes[0, 1] + y * axes[1, 1]
    dz = axes[2, 2] + x * axes[0, 2] + y * axes[1, 2]
    return not blocked(blockers, listed, first, count, origin, dx, dy, dz, 1e300, disc.work)


@lean
def _crossing(disc, ax, ay, bx, by, lit, origin, blockers, listed, count):
    """Share of the way from a, which is ``lit`` or not, to b, at which that changes."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        t = 0.5 * (low + high)
        here = _is_lit(
            disc, ax + t * (bx - ax), ay + t * (by - ay), origin, blockers, listed, count
        )
        if here == lit:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@lean
def _part(disc, x0, y0, side, origin, blockers, listed, count, force):
    """Put what is lit of a square into ``disc.shape``, where one edge parts it.

    Returns how many corners it has, and the area between the edge and its chord; −1 where no one
    edge does, or it bends too much. With ``force`` bends are taken as they are.
    """
    shape = disc.shape[0]
    lit = 0
    for k in range(4):
        cx = x0 + (side if k == 1 or k == 2 else 0.0)
        cy = y0 + (side if k >= 2 else 0.0)
        if _is_lit(disc, cx, cy, origin, blockers, listed, count):
            lit |= 1 << k
    changes = 0
    for k in range(4):
        changes += ((lit >> k) & 1) != ((lit >> ((k + 1) % 4)) & 1)
    if changes != 2:
        return -1, 0.0
    made, last = 0, -1
    ax = ay = bx = by = 0.0
    for k in range(4):
        m = (k + 1) % 4
        here, there = (lit >> k) & 1, (lit >> m) & 1
        cx = x0 + (side if k == 1 or k == 2 else 0.0)
        cy = y0 + (side if k >= 2 else 0.0)
        if here:
            shape[made, 0], shape[made, 1] = cx, cy
            made += 1
        if here != there:
            ex = x0 + (side if m == 1 or m == 2 else 0.0)
            ey = y0 + (side if m >= 2 else 0.0)
            t = _crossing(disc, cx, cy, ex, ey, here == 1, origin, blockers, listed, count)
            px, py = cx + t * (ex - cx), cy + t * (ey - cy)
            shape[made, 0], shape[made, 1] = px, py
            if here:
                ax, ay, last = px, py, made
            else:
                bx, by = px, py
            made += 1
    # From a, where light ends, to b, where it begins again: what is lit lies on the left.
    chord = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if chord <= 1e-9 * side:
        return made, 0.0
    nx, ny = (by - ay) / chord, (ax - bx) / chord
    mx, my, reach = 0.5 * (ax + bx), 0.5 * (ay + by), _REACH * chord
    inner = _is_lit(disc, mx - reach * nx, my - reach * ny, origin, blockers, listed, count)
    outer = _is_lit(disc, mx + reach * nx, my + reach * ny, origin, blockers, listed, count)
    if not inner or outer:
        return (made, chord * reach) if force else (-1, 0.0)
    t = _crossing(
        disc, mx - reach * nx, my - reach * ny, mx + reach * nx, my + reach * ny, True, origin,
        blockers, listed, count,
    )  # fmt: skip
    rise = (2.0 * t - 1.0) * reach
    if abs(rise) > _BENT * chord and not force:
        return -1, 0.0
    # A triangle of the area of the parabola: 2/3 of chord and rise.
    for k in range(made, last + 1, -1):
        shape[k, 0], shape[k, 1] = shape[k - 1, 0], shape[k - 1, 1]
    shape[last + 1, 0] = mx + 4.0 / 3.0 * rise * nx
    shape[last + 1, 1] = my + 4.0 / 3.0 * rise * ny
    return made + 1, abs(rise) * chord


@lean
def _fill_cell(disc, x0, y0, side):
    """Net of the directions of a square into ``disc.cell``, and the middle into ``cell[4, 0]``."""
    for k in range(3):
        disc.cell[4, 0, k] = (
            disc.axes[2, k]
            + (x0 + 0.5 * side) * disc.axes[0, k]
            + (y0 + 0.5 * side) * disc.axes[1, k]
        )
    for i in range(4):
        for j in range(4):
            x, y = x0 + side * i / 3.0, y0 + side * j / 3.0
            for k in range(3):
                disc.cell[i, j, k] = disc.axes[2, k] + x * disc.axes[0, k] + y * disc.axes[1, k]


@lean
def _square(disc, x0, y0, side):
    """A whole square as a polygon."""
    shape = disc.shape[0]
    for k in range(4):
        shape[k, 0] = x0 + (side if k == 1 or k == 2 else 0.0)
        shape[k, 1] = y0 + (side if k >= 2 else 0.0)
    return 4


@lean
def _place(x0, y0, side, number, k):
    """Place in quarter k of a square, the ``number``-th that is looked at.

    Anywhere in it: at fixed places all squares along a wire would err alike.
    """
    n = 4.0 * number + k
    px = x0 + 0.5 * side * ((k % 2) + (_FIRST * n) % 1.0)
    py = y0 + 0.5 * side * ((k // 2) + (_SECOND * n) % 1.0)
    return px, py


@lean
def _within(shape, corners, x, y):
    """Whether a polygon has a place (x, y) in it: a ray from it crosses an odd number of sides."""
    within = False
    for k in range(corners):
        m = (k + 1) % corners
        ax, ay, bx, by = shape[k, 0], shape[k, 1], shape[m, 0], shape[m, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            within = not within
    return within


@lean
def _is_other(shape, corners, x, y, slack, lit):
    """Whether a place is lit, or not, other than a polygon says, and farther than ``slack`` in it.

    A polygon that has the area of a bent edge is not that edge.
    """
    return (
        lit != _within(shape, corners, x, y)
        and lit != _within(shape, corners, x - slack, y)
        and lit != _within(shape, corners, x + slack, y)
        and lit != _within(shape, corners, x, y - slack)
        and lit != _within(shape, corners, x, y + slack)
    )


@lean
def _beside(x0, y0, side, radius):
    """Whether a square lies outside a circle about the origin."""
    x = max(max(x0, -(x0 + side)), 0.0)
    y = max(max(y0, -(y0 + side)), 0.0)
    return x * x + y * y >= radius * radius


@kernel
def _disc_light(
    disc, n, rounding, blockers, smooth, shifted, state, listed, count, origin, moments, out
):
    """Light of a disc of 1 lx facing it, and the square of what may be wrong, into ``out``."""
    radius, deepest = disc.radius, disc.lists.shape[0] - 1
    whole = math.pi * radius * radius
    cells, top = disc.cells, 1
    cells[0, 0], cells[0, 1], cells[0, 2], cells[0, 3] = -radius, -radius, 2.0 * radius, 0.0
    light, wrong = 0.0, 0.0
    visited = 0
    while top > 0:
        top -= 1
        x0, y0, side, level = cells[top, 0], cells[top, 1], cells[top, 2], int(cells[top, 3])
        if _beside(x0, y0, side, radius):
            continue
        visited += 1
        _fill_cell(disc, x0, y0, side)
        make_pyramid(disc.cell[:4], disc.planes)
        mine = disc.lists[level]
        if level == 0:
            some, loose = list_hiding(
                disc, listed, count, mine, n, rounding, blockers, smooth, shifted, state, origin
            )
        else:
            before = disc.lists[level - 1]
            some, loose = list_hiding(
                disc, before, before[before.shape[0] - 1], mine, n, rounding, blockers, smooth,
                shifted, state, origin,
            )  # fmt: skip
        if loose < 0:
            continue
        mine[mine.shape[0] - 1] = some
        if some == 0:
            light += polygon_light(disc, _square(disc, x0, y0, side), n, moments)
            continue
        last = level >= deepest
        if level >= _LEAST and (loose <= 1 or last):
            corners, bend = _part(disc, x0, y0, side, origin, blockers, mine, some, last)
            if corners >= 0 and loose > 1:
                # There may be other edges between the corners.
                for k in range(4):
                    px, py = _place(x0, y0, side, visited, k)
                    lit = _is_lit(disc, px, py, origin, blockers, mine, some)
                    if corners >= 0 and _is_other(disc.shape[0], corners, px, py, bend / side, lit):
                        corners = -1
                if corners >= 0:
                    wrong += _ALIKE * side**4
            if corners >= 0:
                light += polygon_light(disc, corners, n, moments)
                wrong += (_LEFT_OF_BEND * bend) ** 2
                continue
        if last:
            open_ = 0
            for k in range(4):
                px, py = _place(x0, y0, side, visited, k)
                open_ += _is_lit(disc, px, py, origin, blockers, mine, some)
            if open_:
                all_of_it = polygon_light(disc, _square(disc, x0, y0, side), n, moments)
                light += 0.25 * open_ * all_of_it
            # As in `pyramid`: four that differ tell an edge, four alike make one unlikely.
            wrong += (0.03125 if 0 < open_ < 4 else _ALIKE) * side**4
            continue
        half = 0.5 * side
        for k in range(4):
            cells[top, 0] = x0 + (half if k % 2 else 0.0)
            cells[top, 1] = y0 + (half if k >= 2 else 0.0)
            cells[top, 2], cells[top, 3] = half, level + 1.0
            top += 1
    out[0] = max(light, 0.0) / whole
    out[1] = wrong / (whole * whole)
    return visited


@kernel
def _one(disc, x, n, sun, blockers, smooth, out):
    """Light of the disc on one receiver; see `disc_cell_rows`."""
    axes, horizons, p = disc.axes, disc.horizons, blockers.nets.shape[0]
    shifted, state = np.empty((p, 4, 4, 4)), np.zeros(p, dtype=np.int64)
    listed, moments = np.empty(p, dtype=np.int64), np.empty(3)
    for k in range(3):
        axes[2, k] = sun[k]
    frame(axes[2], axes[0], axes[1])
    for k in range(3):
        row = 2 if k == 0 else k - 1
        horizons[0, k] = n[0] * axes[row, 0] + n[1] * axes[row, 1] + n[2] * axes[row, 2]
        horizons[1, k] = axes[row, 2]
    sine = disc.radius / math.sqrt(1.0 + disc.radius * disc.radius)
    cosine = math.sqrt(1.0 - sine * sine)
    if horizons[0, 0] <= -sine or sun[2] <= -sine:
        out[0] = out[1] = 0.0
        return 0
    rounding = horizon_tolerance(x)
    see_blockers(blockers, x, n, rounding, shifted, state)
    count, cone = 0, np.empty(4)
    for b in range(p):
        if state[b] == NO_BLOCKER:
            continue
        cone_of(blockers.spheres[b], x, sine, cosine, cone)
        if meets_cone(cone, sun):
            listed[count] = b
            count += 1
    return _disc_light(
        disc, n, rounding, blockers, smooth, shifted, state, listed, count, x, moments, out
    )


@parallel
def disc_cell_rows(nodes, normals, sun, radius, blockers, smooth, levels, out, counters):
    """Light of the sun's disc on m receivers, by 1 lx on a plane facing it.

    Parameters
    ----------
    nodes, normals : (m, 3) array
        Receivers [m] and unit normals.
    sun : (3,) array
        Unit vector to the sun.
    radius : float
        Tangent of its angular radius.
    blockers : Blockers
        What hides.
    smooth : (p, 4) bool array
        Across which sides its patches go on without a bend.
    levels : int
        How often the square about the disc is quartered at most.
    out : (m, 2) array
        Receives the light, and the variance of what was sampled and fitted of it.
    counters : (m,) int array
        Receives the number of squares looked at.
    """
    for i in nb.prange(nodes.shape[0]):
        disc = make_disc(blockers.nets.shape[0], levels, radius)
        counters[i] = _one(disc, nodes[i], normals[i], sun, blockers, smooth, out[i])
