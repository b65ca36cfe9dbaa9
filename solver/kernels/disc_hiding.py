"""What may hide a small square of the sky from a receiver, and shadow edges across it.

As in `pyramid.visible_factor`, but blockers are quartered as far as it takes to tell from which
side what is within the pyramid is seen: squares are small against what hides them.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import load_edge
from .disc_polygons import QUARTERINGS
from .nets import copy_net, facing_of, halve_u, halve_v, normal_cone
from .pyramid import FRONT, MIXED, NO_BLOCKER, all_beyond, blocked, outside_pyramid

#: Points this close to a side plane, relative to their size, count as outside: neighbours touch.
_TOUCH = 1e-11
#: How steeply what lies on the receiver's own surface may rise, over how high the disc stands.
_RISE = 1e-3
#: From which side a blocker is seen; and that its outline may pass.
OUT, IN, EDGE = 1, 2, 4


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
            beside = all_beyond(mx, my, mz, c, _TOUCH)
            if beside:
                break
        if beside:
            continue
        if level == QUARTERINGS:
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
        if deep == QUARTERINGS:
            return seen | EDGE
        halve_u(parts[top], low_u, high_u)
        halve_v(low_u, parts[top], parts[top + 1])
        halve_v(high_u, parts[top + 2], parts[top + 3])
        for k in range(4):
            level[top + k] = deep + 1
        top += 4
    return seen


@kernel
def list_hiding(disc, parent, parent_count, mine, n, rounding, blockers, smooth, shifted, state, x):
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
