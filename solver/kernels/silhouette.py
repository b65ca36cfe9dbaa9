"""The silhouette of a net, where a receiver sees it edge-on: a smooth part of its contour.

Where the receiver lies in the tangent plane, G(u, v) = −det(H, H_u, H_v) = 0. In a cell whose
boundary changes side twice the front part is bounded by pieces of the boundary and by one arc of
that curve. It is integrated like any edge: by Gauss' rule on points that Newton's iteration puts
onto G = 0, square to the chord in (u, v) between its ends. Rules of two orders must agree, or the
cell is to be quartered.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .contour import GAUSS_NODES, GAUSS_START, GAUSS_WEIGHTS, edge_term, load_edge, turning
from .nets import facing_at, surface

#: How far inside its edges the facing of a net is asked, in parameters.
_INWARDS = 1e-5
_TWO_PI = 2.0 * math.pi
#: Orders of the two rules on an arc.
_LOW_ORDER, _HIGH_ORDER = 5, 8
#: Results of `arc_leaf` besides a form factor.
ALL_FRONT, ALL_BACK = -2.0, -1.0


@lean
def edge_facing(s, k, t, inwards, h, hu, hv):
    """`facing_at` boundary edge ``k`` of `contour.load_edge`, at parameter distance ``inwards``.

    On a collapsed edge (a pole) itself the derivatives vanish and tell nothing.
    """
    if k == 0:
        u, v = t, 0.0
    elif k == 1:
        u, v = 1.0, t
    elif k == 2:
        u, v = 1.0 - t, 1.0
    else:
        u, v = 0.0, 1.0 - t
    u = min(max(u, inwards), 1.0 - inwards)
    v = min(max(v, inwards), 1.0 - inwards)
    return facing_at(s, u, v, h, hu, hv)


@lean
def front_count(s, at, g, h, hu, hv):
    """How many of four edge points, at ``at`` of each edge, show the + side; facings into ``g``."""
    count = 0
    for k in range(4):
        g[k] = edge_facing(s, k, at, _INWARDS, h, hu, hv)
        if g[k] > 0.0:
            count += 1
    return count


@lean
def chord_leaf(s, n, eps, g, c, h, hu, hv):
    """Contour factor of the front part of a small net; ``g`` (5,) are the facings of its corners.

    Two or four of its edges change side; ``c``, ``h``, ``hu`` and ``hv`` are scratch.
    """
    cu = (0.0, 1.0, 1.0, 0.0)
    cv = (0.0, 0.0, 1.0, 1.0)
    g[4] = g[0]
    # One walk round the boundary; cuts join the point where the front is left to the next entry.
    total = 0.0
    eu = ev = fu = fv = 0.0
    have_exit = False
    have_first = False
    for k in range(4):
        load_edge(s, k, c)
        a, b = 0.0, 1.0
        crossing = (g[k] > 0.0) != (g[k + 1] > 0.0)
        if crossing:
            lo, hi, glo, ghi = 0.0, 1.0, g[k], g[k + 1]
            for step in range(60):
                t = lo - glo * (hi - lo) / (ghi - glo)
                if step % 3 == 2 or not lo < t < hi:
                    t = 0.5 * (lo + hi)
                gt = edge_facing(s, k, t, _INWARDS, h, hu, hv)
                if (gt > 0.0) == (glo > 0.0):
                    lo, glo = t, gt
                else:
                    hi, ghi = t, gt
                if hi - lo < 1e-12:
                    break
            t = 0.5 * (lo + hi)
            pu = cu[k] + t * (cu[(k + 1) % 4] - cu[k])
            pv = cv[k] + t * (cv[(k + 1) % 4] - cv[k])
            if g[k] > 0.0:
                b = t
                eu, ev = pu, pv
                have_exit = True
            else:
                a = t
                if have_exit:
                    total += _chord_on_surface(s, eu, ev, pu, pv, n, h, hu, hv)
                    have_exit = False
                else:
                    fu, fv = pu, pv
                    have_first = True
        elif g[k] <= 0.0:
            continue
        total += edge_term(c, a, b, n, eps)
    if have_exit and have_first:
        total += _chord_on_surface(s, eu, ev, fu, fv, n, h, hu, hv)
    return -total / _TWO_PI


@lean
def _chord_on_surface(s, u0, v0, u1, v1, n, h, hu, hv):
    """Contour term along the image of the (u, v) segment from (u0, v0) to (u1, v1)."""
    du, dv = u1 - u0, v1 - v0
    total = 0.0
    for m in range(GAUSS_START[6], GAUSS_START[7]):
        t = GAUSS_NODES[m]
        surface(s, u0 + t * du, v0 + t * dv, h, hu, hv)
        gx, gy, gz = hu[0] * du + hv[0] * dv, hu[1] * du + hv[1] * dv, hu[2] * du + hv[2] * dv
        total += GAUSS_WEIGHTS[m] * turning(h, gx, gy, gz, n)
    return total


@lean
def _second(s, u, v, huu, huv, hvv):
    """Second derivatives (3,) of the shifted net at (u, v)."""
    ru, rv = 1.0 - u, 1.0 - v
    bu = (ru * ru * ru, 3.0 * u * ru * ru, 3.0 * u * u * ru, u * u * u)
    bv = (rv * rv * rv, 3.0 * v * rv * rv, 3.0 * v * v * rv, v * v * v)
    du = (-3.0 * ru * ru, 3.0 * ru * (ru - 2.0 * u), 3.0 * u * (2.0 * ru - u), 3.0 * u * u)
    dv = (-3.0 * rv * rv, 3.0 * rv * (rv - 2.0 * v), 3.0 * v * (2.0 * rv - v), 3.0 * v * v)
    eu = (6.0 * ru, 6.0 * (u - 2.0 * ru), 6.0 * (ru - 2.0 * u), 6.0 * u)
    ev = (6.0 * rv, 6.0 * (v - 2.0 * rv), 6.0 * (rv - 2.0 * v), 6.0 * v)
    for k in range(3):
        a = b = c = 0.0
        for i in range(4):
            row = bv[0] * s[i, 0, k] + bv[1] * s[i, 1, k] + bv[2] * s[i, 2, k] + bv[3] * s[i, 3, k]
            slope = (
                dv[0] * s[i, 0, k] + dv[1] * s[i, 1, k] + dv[2] * s[i, 2, k] + dv[3] * s[i, 3, k]
            )
            bend = ev[0] * s[i, 0, k] + ev[1] * s[i, 1, k] + ev[2] * s[i, 2, k] + ev[3] * s[i, 3, k]
            a += eu[i] * row
            b += du[i] * slope
            c += bu[i] * bend
        huu[k], huv[k], hvv[k] = a, b, c


@lean
def _det(a, b, c):
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


@lean
def _arc(s, u0, v0, u1, v1, n, order, work):
    """Contour term along the silhouette from (u0, v0) to (u1, v1); NaN where it is no such arc.

    ``work`` (6, 3) is scratch.
    """
    h, hu, hv, huu, huv, hvv = work[0], work[1], work[2], work[3], work[4], work[5]
    du, dv = u1 - u0, v1 - v0
    total = 0.0
    offset = 0.0
    for m in range(GAUSS_START[order], GAUSS_START[order + 1]):
        t = GAUSS_NODES[m]
        converged = False
        slope = 0.0
        for _ in range(12):
            u = u0 + t * du - offset * dv
            v = v0 + t * dv + offset * du
            surface(s, u, v, h, hu, hv)
            _second(s, u, v, huu, huv, hvv)
            g = -_det(h, hu, hv)
            gu = -_det(h, huu, hv) - _det(h, hu, huv)
            gv = -_det(h, huv, hv) - _det(h, hu, hvv)
            across = -gu * dv + gv * du
            if across == 0.0:
                return math.nan
            slope = -(gu * du + gv * dv) / across
            step = g / across
            offset -= step
            if abs(offset) > 0.5:
                return math.nan
            if abs(step) < 1e-9:
                converged = True
                break
        if not converged or abs(slope) > 2.0:
            return math.nan
        u = u0 + t * du - offset * dv
        v = v0 + t * dv + offset * du
        if u < -1e-9 or u > 1.0 + 1e-9 or v < -1e-9 or v > 1.0 + 1e-9:
            return math.nan
        surface(s, u, v, h, hu, hv)
        pu, pv = du - slope * dv, dv + slope * du
        gx, gy, gz = hu[0] * pu + hv[0] * pv, hu[1] * pu + hv[1] * pv, hu[2] * pu + hv[2] * pv
        total += GAUSS_WEIGHTS[m] * turning(h, gx, gy, gz, n)
    return total


@lean
def _crossing(s, k, c, h, hu, hv):
    """Parameter of the change of side on boundary edge ``k``, by bisection with secants."""
    load_edge(s, k, c)
    size = far = 0.0
    for i in range(3):
        size = max(size, max(abs(c[1, i] - c[0, i]), abs(c[3, i] - c[0, i])))
        far = max(far, abs(c[0, i]))
    # On the edge itself, or the arc would not begin where the edge ends; not so at a pole.
    inwards = 0.0 if size > 1e-12 * far else _INWARDS
    lo, hi = _INWARDS, 1.0 - _INWARDS  # an end may be a pole
    glo = ghi = 0.0
    for step in range(62):
        if step == 0:
            t = lo
        elif step == 1:
            t = hi
        else:
            t = lo - glo * (hi - lo) / (ghi - glo)
            if step % 3 == 2 or not lo < t < hi:
                t = 0.5 * (lo + hi)
        gt = edge_facing(s, k, t, inwards, h, hu, hv)
        if step == 0:
            glo = gt
        elif step == 1:
            ghi = gt
            if (glo > 0.0) == (ghi > 0.0):
                return math.nan
        elif (gt > 0.0) == (glo > 0.0):
            lo, glo = t, gt
        else:
            hi, ghi = t, gt
        if hi - lo < 1e-15:
            break
    return 0.5 * (lo + hi)


@kernel
def arc_leaf(s, n, eps, small, g, c, h, hu, hv, work):
    """Form factor of the front part of a net wholly above the horizon; NaN where it must be split.

    `ALL_FRONT` or `ALL_BACK` where there is one side only. For nets that are not near: next to a
    receiver the part that faces it may be an island.

    Parameters
    ----------
    s : (4, 4, 4) array
        Shifted net, wholly above the horizon.
    eps, small : float
        Relative accuracy, and what counts as nothing.
    g, c, h, hu, hv, work
        Scratch: (5,), (4, 3), three times (3,), and (6, 3).
    """
    path = np.empty(5)
    changes = 0
    edges = (-1, -1)  # where the front is left, and where it is entered again
    for k in range(4):
        # No second change on the way: neither at three points between the corners, nor at the
        # turning points of parabolas through them.
        turns = 0
        for m in range(5):
            path[m] = edge_facing(s, k, 0.25 * m, _INWARDS, h, hu, hv)
            if m > 0 and (path[m] > 0.0) != (path[m - 1] > 0.0):
                turns += 1
        g[k] = path[0]
        if turns > 1:
            return math.nan
        if turns == 1:
            changes += 1
            edges = (k, edges[1]) if path[0] > 0.0 else (edges[0], k)
        for m in range(1, 4):
            before, here, after = path[m - 1], path[m], path[m + 1]
            if (before > 0.0) != (here > 0.0) or (here > 0.0) != (after > 0.0):
                continue
            slope, bend = 0.5 * (after - before), after - 2.0 * here + before
            if abs(slope) < abs(bend) and (here - 0.5 * slope * slope / bend > 0.0) != (here > 0.0):
                return math.nan
    if changes == 0:
        # One side all round: then all over, unless it has an island that nine points miss.
        front = g[0] > 0.0
        for i in range(3):
            for j in range(3):
                if (facing_at(s, 0.2 + 0.3 * i, 0.2 + 0.3 * j, h, hu, hv) > 0.0) != front:
                    return math.nan
        return ALL_FRONT if front else ALL_BACK
    out_k, in_k = edges
    if changes != 2 or out_k < 0 or in_k < 0:
        return math.nan
    u0 = v0 = u1 = v1 = t_out = t_in = 0.0
    for end in range(2):
        k = edges[end]
        t = _crossing(s, k, c, h, hu, hv)
        if not t >= 0.0:
            return math.nan
        u = t if k == 0 else (1.0 if k == 1 else (1.0 - t if k == 2 else 0.0))
        v = 0.0 if k == 0 else (t if k == 1 else (1.0 if k == 2 else 1.0 - t))
        if end == 0:
            u0, v0, t_out = u, v, t
        else:
            u1, v1, t_in = u, v, t
    low = high = 0.0
    for order in (_LOW_ORDER, _HIGH_ORDER):
        low = high
        high = _arc(s, u0, v0, u1, v1, n, order, work)
        if not math.isfinite(high):
            return math.nan
    total, start = high, t_in
    for m in range(5):
        k = (in_k + m) % 4
        load_edge(s, k, c)
        last = k == out_k and start <= t_out
        total += edge_term(c, start, t_out if last else 1.0, n, eps)
        if last:
            break
        start = 0.0
    factor = -total / _TWO_PI
    if not abs(high - low) <= _TWO_PI * max(eps * abs(factor), small):
        return math.nan
    return max(0.0, factor)
