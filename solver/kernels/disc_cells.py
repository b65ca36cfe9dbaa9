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
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .contour import horizon_tolerance, load_edge
from .nets import copy_net, facing_of, halve_u, halve_v, normal_cone
from .pyramid import (
    FRONT,
    MIXED,
    NO_BLOCKER,
    blocked,
    make_pyramid,
    outside_pyramid,
    see_blockers,
)
from .ray_patch import WORK
from .sun_disc import frame

#: Quarterings of a square before an edge is looked for in it.
_LEAST = 2
#: Halvings of an interval that an edge crosses: to 6e-5 of the side of a square.
_HALVINGS = 14
#: How far from its chord an edge is looked for, and may be to be taken for a parabola, over it.
_REACH, _BENT = 0.25, 0.1
#: Error of a parabola over the area between it and its chord: what is left is of its next term.
_LEFT_OF_BEND = 0.05
#: Points this close to a side plane, relative to their size, count as outside: neighbours touch.
_TOUCH = 1e-11
#: How often a blocker is quartered, or its side halved, to tell where its outline passes.
_QUARTERINGS = 8
#: How steeply what lies on the receiver's own surface may rise, over how high the disc stands.
_RISE = 1e-3
#: From which side a blocker is seen; and that its outline may pass.
OUT, IN, EDGE = 1, 2, 4
#: Steps of a sequence of evenly spread points: powers of the root of x³ = x + 1, inverted.
_FIRST, _SECOND = 0.7548776662466927, 0.5698402909980532
#: Corners of a polygon at most: a square that one edge parts, cut by two horizons.
_CORNERS = 16


class Disc(NamedTuple):
    """What one thread works with; the disc is that of directions s + x e1 + y e2, x² + y² < r²."""

    axes: np.ndarray  # (3, 3) e1, e2 and s
    radius: float  # r
    horizons: np.ndarray  # (2, 3) what is seen has a + b x + c y > 0
    cells: np.ndarray  # (room, 4) lower left corner, side and level of squares
    lists: np.ndarray  # (levels + 1, patches + 1) what may hide squares of a level, and how many
    cell: np.ndarray  # (5, 4, 4) net of a square, and its middle
    sides: np.ndarray  # (patches,) from which each is seen
    planes: np.ndarray  # (8, 3) its pyramid
    edge: np.ndarray  # (4 quarterings + 8, 3) scratch
    parts: np.ndarray  # (3 quarterings + 3, 4, 4, 4) scratch
    shape: np.ndarray  # (2, corners, 2) polygons
    work: np.ndarray  # scratch of rays


@kernel
def make_disc(patches, levels, radius):
    """Scratch for a disc in scenes of so many patches, and so many quarterings."""
    return Disc(
        np.empty((3, 3)),
        radius,
        np.empty((2, 3)),
        np.empty((3 * levels + 4, 4)),
        np.empty((levels + 1, patches + 1), dtype=np.int64),
        np.zeros((5, 4, 4)),
        np.zeros(patches, dtype=np.int64),
        np.empty((8, 3)),
        np.empty((4 * _QUARTERINGS + 8, 3)),
        np.empty((3 * _QUARTERINGS + 3, 4, 4, 4)),
        np.empty((2, _CORNERS, 2)),
        np.empty(WORK),
    )


@lean
def _wedge(px, py, qx, qy, radius, moments):
    """Add area and first moments of the part of a circle between its centre and p to q."""
    cross = px * qy - py * qx
    if cross == 0.0:
        return
    dx, dy = qx - px, qy - py
    square = dx * dx + dy * dy
    # Places on p + t (q − p) at which the circle is crossed.
    along = -(px * dx + py * dy) / square
    left = radius * radius - (cross * cross) / square
    low = high = along
    if left > 0.0:
        half = math.sqrt(left / square)
        low, high = along - half, along + half
    low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
    ax, ay, bx, by = px + low * dx, py + low * dy, px + high * dx, py + high * dy
    # Outside the circle its own arc bounds the wedge.
    for k in range(2):
        x0, y0, x1, y1 = (px, py, ax, ay) if k == 0 else (bx, by, qx, qy)
        turn = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
        if turn != 0.0:
            r0, r1 = math.sqrt(x0 * x0 + y0 * y0), math.sqrt(x1 * x1 + y1 * y1)
            moments[0] += 0.5 * radius * radius * turn
            third = radius * radius * radius / 3.0
            moments[1] += third * (y1 / r1 - y0 / r0)
            moments[2] += third * (x0 / r0 - x1 / r1)
    area = 0.5 * (ax * by - ay * bx)
    moments[0] += area
    moments[1] += area * (ax + bx) / 3.0
    moments[2] += area * (ay + by) / 3.0


@lean
def _cut(shape, count, a, b, c, out):
    """Corners of a polygon that lie in a + b x + c y > 0, in order; returns how many."""
    made = 0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        here = a + b * shape[k, 0] + c * shape[k, 1]
        there = a + b * shape[m, 0] + c * shape[m, 1]
        if here > 0.0:
            out[made, 0], out[made, 1] = shape[k, 0], shape[k, 1]
            made += 1
        if (here > 0.0) != (there > 0.0):
            t = here / (here - there)
            out[made, 0] = shape[k, 0] + t * (shape[m, 0] - shape[k, 0])
            out[made, 1] = shape[k, 1] + t * (shape[m, 1] - shape[k, 1])
            made += 1
    return made


@lean
def _polygon_light(disc, count, n, moments):
    """∫ n·(s + x e1 + y e2) dx dy over the part of a polygon that is seen of the disc."""
    shape, other = disc.shape[0], disc.shape[1]
    for k in range(2):
        a, b, c = disc.horizons[k, 0], disc.horizons[k, 1], disc.horizons[k, 2]
        if a > disc.radius * math.sqrt(b * b + c * c):
            continue
        made = _cut(shape, count, a, b, c, other)
        for m in range(made):
            shape[m, 0], shape[m, 1] = other[m, 0], other[m, 1]
        count = made
    moments[0] = moments[1] = moments[2] = 0.0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        _wedge(shape[k, 0], shape[k, 1], shape[m, 0], shape[m, 1], disc.radius, moments)
    axes, light = disc.axes, 0.0
    for k in range(3):
        light += n[k] * (
            moments[0] * axes[2, k] + moments[1] * axes[0, k] + moments[2] * axes[1, k]
        )
    return light


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
def _edge_outside(planes, s, side, edge):
    """Whether a side of ``s`` lies outside a pyramid; halves of it where it is as a whole not.

    ``edge`` (4 quarterings + 8, 3) is scratch.
    """
    load_edge(s, side, edge)
    top, level = 1, 0
    # Depth first: the part at place k of the stack is of level ``levels >> 4 k & 15``.
    levels = 0
    while top > 0:
        top -= 1
        level = (levels >> (4 * top)) & 15
        c = edge[4 * top : 4 * top + 4]
        beside = False
        for k in range(5):
            # In the last round: behind the receiver.
            mx, my, mz = planes[k, 0], planes[k, 1], planes[k, 2]
            if mx == 0.0 and my == 0.0 and mz == 0.0:
                continue
            beside = True
            for m in range(4):
                x, y, z = c[m, 0], c[m, 1], c[m, 2]
                if mx * x + my * y + mz * z > _TOUCH * (abs(x) + abs(y) + abs(z)):
                    beside = False
                    break
            if beside:
                break
        if beside:
            continue
        if level == _QUARTERINGS:
            return False
        after = edge[4 * top + 4 : 4 * top + 8]
        for k in range(3):
            a, b, d, e = c[0, k], c[1, k], c[2, k], c[3, k]
            ab, bd, de = 0.5 * (a + b), 0.5 * (b + d), 0.5 * (d + e)
            abd, bde = 0.5 * (ab + bd), 0.5 * (bd + de)
            middle = 0.5 * (abd + bde)
            c[1, k], c[2, k], c[3, k] = ab, abd, middle
            after[0, k], after[1, k], after[2, k], after[3, k] = middle, bde, de, e
        for place in (top, top + 1):
            levels &= ~(15 << (4 * place))
            levels |= (level + 1) << (4 * place)
        top += 2
    return True


@kernel
def _sides_within(planes, s, closed, n, rise, rounding, parts):
    """Sides from which what meets a pyramid of a blocker ``s`` is seen: `OUT`, `IN`, and `EDGE`.

    The last is said where its outline may pass. Of closed surfaces the inner side hides nothing.
    About a receiver on the blocker, it is seen from neither side however often it is quartered:
    what rises above the receiver's horizon by less than ``rise`` of its distance is left out.
    """
    cone = np.empty(4)
    room = parts.shape[0] - 2
    low_u, high_u = parts[room], parts[room + 1]
    level = np.zeros(room, dtype=np.int64)
    copy_net(s, parts[0])
    top, seen = 1, 0
    while top > 0:
        top -= 1
        if outside_pyramid(planes, parts[top]):
            continue
        normal_cone(parts[top], cone)
        facing = facing_of(parts[top], cone, rounding)
        if facing != 0:
            if facing > 0:
                seen |= OUT
            elif not closed:
                seen |= IN
            continue
        high = far = 0.0
        for i in range(4):
            for j in range(4):
                x, y, z = parts[top, i, j, 0], parts[top, i, j, 1], parts[top, i, j, 2]
                w = parts[top, i, j, 3]
                high = max(high, (n[0] * x + n[1] * y + n[2] * z) / w)
                far = max(far, (x * x + y * y + z * z) / (w * w))
        if high <= rise * math.sqrt(far):
            continue
        deep = level[top]
        if deep == _QUARTERINGS:
            return seen | EDGE
        halve_u(parts[top], low_u, high_u)
        halve_v(low_u, parts[top], parts[top + 1])
        halve_v(high_u, parts[top + 2], parts[top + 3])
        for k in range(4):
            level[top + k] = deep + 1
        top += 4
    return seen


@kernel
def _list_hiding(
    disc, parent, parent_count, mine, n, rounding, blockers, smooth, shifted, state, x
):
    """List in ``mine`` what may hide a square whose pyramid stands in ``disc``.

    Returns how many there are, and how many shadow edges may meet it; −1 for these where it is
    dark. A solid without one in the pyramid covers it or leaves it free.
    """
    planes, sides = disc.planes, disc.sides
    rise = _RISE * max(disc.horizons[0, 0] - disc.radius, 0.0)
    for m in range(parent_count):
        b = parent[m]
        if state[b] == MIXED:
            closed = blockers.closed[b]
            sides[b] = _sides_within(planes, shifted[b], closed, n, rise, rounding, disc.parts)
        elif outside_pyramid(planes, shifted[b]):
            sides[b] = 0
        else:
            sides[b] = OUT if state[b] == FRONT else IN
    count = loose = start = own = 0
    solid = -1
    for m in range(parent_count + 1):
        b = parent[m] if m < parent_count else -1
        if b < 0 or blockers.solid[b] != solid:
            if own == 0 and count > start:
                cell = disc.cell
                if blocked(
                    blockers, mine, start, count, x, cell[4, 0, 0], cell[4, 0, 1], cell[4, 0, 2],
                    1e300, disc.work,
                ):  # fmt: skip
                    return 0, -1
                count = start
            loose += own
            if b < 0:
                break
            start, own, solid = count, 0, blockers.solid[b]
        if sides[b] == 0:
            continue
        mine[count] = b
        count += 1
        if sides[b] & EDGE:
            own += 1
        for k in range(4):
            other = blockers.adjacent[b, k]
            if other >= 0 and state[other] != NO_BLOCKER:
                # Across it the surface goes on, seen from the same side; or what is seen of the
                # other from outside lies elsewhere, so that this is seen from behind there too.
                if sides[other] == sides[b] and (sides[b] == OUT or sides[b] == IN):
                    continue
                if smooth[b, k] and sides[other] == 0 and blockers.closed[b]:
                    continue
            if not _edge_outside(planes, shifted[b], k, disc.edge):
                own += 1
    return count, loose


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
            some, loose = _list_hiding(
                disc, listed, count, mine, n, rounding, blockers, smooth, shifted, state, origin
            )
        else:
            before = disc.lists[level - 1]
            some, loose = _list_hiding(
                disc, before, before[before.shape[0] - 1], mine, n, rounding, blockers, smooth,
                shifted, state, origin,
            )  # fmt: skip
        if loose < 0:
            continue
        mine[mine.shape[0] - 1] = some
        if some == 0:
            light += _polygon_light(disc, _square(disc, x0, y0, side), n, moments)
            continue
        last = level >= deepest
        if level >= _LEAST and (loose <= 1 or level >= deepest - 1):
            corners, bend = _part(disc, x0, y0, side, origin, blockers, mine, some, last)
            if corners >= 0:
                light += _polygon_light(disc, corners, n, moments)
                wrong += (_LEFT_OF_BEND * bend) ** 2
                continue
        if last:
            open_ = 0
            for k in range(4):
                # Anywhere in its quarter: at fixed places all squares along a wire would err alike.
                number = 4.0 * visited + k
                px = x0 + 0.5 * side * ((k % 2) + (_FIRST * number) % 1.0)
                py = y0 + 0.5 * side * ((k // 2) + (_SECOND * number) % 1.0)
                open_ += _is_lit(disc, px, py, origin, blockers, mine, some)
            if open_:
                all_of_it = _polygon_light(disc, _square(disc, x0, y0, side), n, moments)
                light += 0.25 * open_ * all_of_it
            # As in `pyramid`: four that differ tell an edge, four alike make one unlikely.
            wrong += (0.03125 if 0 < open_ < 4 else 0.0039) * side**4
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
    count = 0
    for b in range(p):
        if state[b] == NO_BLOCKER:
            continue
        dx = blockers.spheres[b, 0] - x[0]
        dy = blockers.spheres[b, 1] - x[1]
        dz = blockers.spheres[b, 2] - x[2]
        away = math.sqrt(dx * dx + dy * dy + dz * dz)
        if away > blockers.spheres[b, 3]:
            reach = blockers.spheres[b, 3] / away
            limit = math.sqrt(1.0 - reach * reach) * cosine - reach * sine
            if (dx * sun[0] + dy * sun[1] + dz * sun[2]) / away < limit:
                continue
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
