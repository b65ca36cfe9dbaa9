"""The form factor of Nishita and Nakamae 1993 [1]: polygons, a band bound and pyramid tracing.

Kept small, to be compared with; `pyramid` and `brackets` go past it. An element is quartered until
the bound of eq. 5 says that it is small; its contour is a polygon (eq. 4, divided by π: the paper
gives an irradiance for unit radiance); its visible share is found by clipping each blocker to the
pyramid of the sub-element (eq. 7 to 14, in homogeneous form) and scanning the pieces on the
projection plane. The plane is put square to the sub-element's middle instead of to the normal, so
that nothing of it lies behind. Differences of E are taken positive: E grows with its argument.

.. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993.
"""

import math

import numba as nb
import numpy as np

from .compiled import kernel, lean, parallel
from .contour import chord_term, cubic_point, horizon_tolerance, load_edge, shift_net
from .nets import halve_u, halve_v

_TWO_PI = 2.0 * math.pi
#: Scanlines across a sub-element.
_LINES = 8
_STACK = 128


@lean
def _band(alpha):
    """E(α) of eq. 5."""
    return (alpha - math.cos(alpha) * math.sin(alpha)) / _TWO_PI


@lean
def band_bound(s, n, ex, ey):
    """Upper bound of the form factor of a net [1, eq. 5 and 6].

    Of a net that crosses the horizon the hull is cut there: its corners are then the control points
    above, and where lines between those above and below cross. 1 for a net that holds the receiver.

    ``ex``, ``ey``: unit vectors square to the receiver normal ``n`` and to each other.
    """
    a0, a1, y0, y1 = math.pi, 0.0, 1.0, -1.0
    dips = False
    for i in range(16):
        p = s[i // 4, i % 4]
        x = p[0] * ex[0] + p[1] * ex[1] + p[2] * ex[2]
        y = p[0] * ey[0] + p[1] * ey[1] + p[2] * ey[2]
        z = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
        across = math.sqrt(y * y + z * z)
        if across == 0.0:
            return 1.0
        if z < -1e-14 * math.sqrt(x * x + y * y + z * z):
            dips = True
            continue
        alpha = math.atan2(across, x)
        a0, a1 = min(a0, alpha), max(a1, alpha)
        y0, y1 = min(y0, y / across), max(y1, y / across)
    if dips:
        for i in range(16):
            p = s[i // 4, i % 4]
            zp = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
            if zp <= 0.0:
                continue
            for j in range(16):
                q = s[j // 4, j % 4]
                zq = q[0] * n[0] + q[1] * n[1] + q[2] * n[2]
                if zq >= 0.0:
                    continue
                t = zp / (zp - zq)
                x = y = 0.0
                for d in range(3):
                    at = p[d] + t * (q[d] - p[d])
                    x += at * ex[d]
                    y += at * ey[d]
                if y == 0.0:
                    return 1.0
                alpha = math.atan2(abs(y), x)
                a0, a1 = min(a0, alpha), max(a1, alpha)
                # On the horizon all is to one side or the other.
                y0, y1 = min(y0, math.copysign(1.0, y)), max(y1, math.copysign(1.0, y))
    if y1 < y0:
        return 0.0
    return (y1 - y0) * (_band(a1) - _band(a0))


@kernel
def polygon_factor(s, n, chords):
    """Eq. 4 over π of the boundary in ``chords`` chords an edge, clipped by the horizon."""
    c = np.empty((4, 3))
    loop = np.empty((4 * chords, 3))
    count = 0
    for k in range(4):
        load_edge(s, k, c)
        for m in range(chords):
            cubic_point(c, m / chords, loop[count])
            count += 1
    kept = np.empty((8 * chords + 8, 3))
    k = 0
    for i in range(count):
        p, q = loop[i], loop[(i + 1) % count]
        dp = n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
        dq = n[0] * q[0] + n[1] * q[1] + n[2] * q[2]
        if dp >= 0.0:
            kept[k] = p
            k += 1
        if (dp >= 0.0) != (dq >= 0.0):
            t = dp / (dp - dq)
            for d in range(3):
                kept[k, d] = p[d] + t * (q[d] - p[d])
            k += 1
    total = 0.0
    for i in range(k):
        p, q = kept[i], kept[(i + 1) % k]
        total += chord_term(p[0], p[1], p[2], q[0], q[1], q[2], n)
    return -total / _TWO_PI


@lean
def _sagitta(s):
    """Largest departure of the boundary from chords, as an angle: the flatness test."""
    worst = 0.0
    for k in range(4):
        for m in (1, 2):
            t = m / 3.0
            if k < 2:
                p, q = s[0, 3 * k], s[3, 3 * k]
                x = s[m, 3 * k]
            else:
                p, q = s[3 * (k - 2), 0], s[3 * (k - 2), 3]
                x = s[3 * (k - 2), m]
            off = size = 0.0
            for d in range(3):
                chord = (1.0 - t) * p[d] / p[3] + t * q[d] / q[3]
                off += (x[d] / x[3] - chord) ** 2
                size += chord * chord
            worst = max(worst, math.sqrt(off / max(size, 1e-300)))
    return worst


@lean
def _hull_interval(high, out):
    """Cut ``out`` (2,) to where the hull of (i/3, high_i) reaches values >= 0; False if nowhere.

    Bézier clipping: ``high`` (4,) are the largest coefficients of each row of a net.
    """
    t0, t1 = 2.0, -1.0
    for i in range(4):
        if high[i] >= 0.0:
            t0, t1 = min(t0, i / 3.0), max(t1, i / 3.0)
    if t1 < 0.0:
        return False
    for i in range(4):
        for j in range(4):
            if high[i] < 0.0 <= high[j]:
                t = (i + (j - i) * high[i] / (high[i] - high[j])) / 3.0
                t0, t1 = min(t0, t), max(t1, t)
    out[0], out[1] = max(out[0], t0), min(out[1], t1)
    return out[0] <= out[1]


@kernel
def _cut(s, along_u, a, b):
    """Restrict a net to [a, b] of one parameter, in place."""
    w = np.empty(4)
    for m in range(4):
        for k in range(4):
            for i in range(4):
                w[i] = s[i, m, k] if along_u else s[m, i, k]
            for step in range(1, 4):
                for i in range(3, step - 1, -1):
                    w[i] = (1.0 - b) * w[i - 1] + b * w[i]
            t = a / b if b > 0.0 else 0.0
            for step in range(1, 4):
                for i in range(4 - step):
                    w[i] = (1.0 - t) * w[i] + t * w[i + 1]
            for i in range(4):
                if along_u:
                    s[i, m, k] = w[i]
                else:
                    s[m, i, k] = w[i]


@kernel
def _clip_blocker(s, quad, along_u, out):
    """Interval of one parameter in which blocker ``s`` may meet the quad (4, 2), eq. 9 to 14.

    ``s`` and ``quad`` are in the frame of the projection plane Z = 1.
    """
    # L is parallel to the mean of the two edges across the parameter that is cut.
    ax = ay = 0.0
    for m in (0, 3):
        p, q = (s[m, 0], s[m, 3]) if along_u else (s[0, m], s[3, m])
        zp, zq = max(abs(p[2]), 1e-300), max(abs(q[2]), 1e-300)
        ax += q[0] / zq - p[0] / zp
        ay += q[1] / zq - p[1] / zp
    size = math.hypot(ax, ay)
    a, b = (-ay / size, ax / size) if size > 0.0 else (1.0, 0.0)
    low, high = 1e300, -1e300
    for i in range(4):
        d = a * quad[i, 0] + b * quad[i, 1]
        low, high = min(low, d), max(high, d)
    rows = np.empty(4)
    out[0], out[1] = 0.0, 1.0
    for side in range(2):
        for i in range(4):
            rows[i] = -1e300
            for j in range(4):
                p = s[i, j] if along_u else s[j, i]
                d = a * p[0] + b * p[1]
                # Eq. 14: the weight is in the homogeneous coordinates already.
                rows[i] = max(rows[i], d - low * p[2] if side == 0 else high * p[2] - d)
        if not _hull_interval(rows, out):
            return False
    return True


@kernel
def _add_spans(s, quad, spans, counts):
    """Write where a flat blocker piece crosses each scanline of the quad, as shares of the line."""
    px, py = np.empty(4), np.empty(4)
    for k in range(4):
        p = s[3 if 0 < k < 3 else 0, 3 if k > 1 else 0]
        if p[2] <= 0.0:
            return
        px[k], py[k] = p[0] / p[2], p[1] / p[2]
    for line in range(_LINES):
        t = (line + 0.5) / _LINES
        x0 = quad[0, 0] + t * (quad[3, 0] - quad[0, 0])
        y0 = quad[0, 1] + t * (quad[3, 1] - quad[0, 1])
        x1 = quad[1, 0] + t * (quad[2, 0] - quad[1, 0])
        y1 = quad[1, 1] + t * (quad[2, 1] - quad[1, 1])
        dx, dy = x1 - x0, y1 - y0
        length2 = dx * dx + dy * dy
        a, b = 2.0, -1.0
        for k in range(4):
            m = (k + 1) % 4
            hk = (px[k] - x0) * dy - (py[k] - y0) * dx
            hm = (px[m] - x0) * dy - (py[m] - y0) * dx
            if (hk >= 0.0) != (hm >= 0.0):
                r = hk / (hk - hm)
                x, y = px[k] + r * (px[m] - px[k]), py[k] + r * (py[m] - py[k])
                where = ((x - x0) * dx + (y - y0) * dy) / length2
                a, b = min(a, where), max(b, where)
        a, b = max(a, 0.0), min(b, 1.0)
        if b > a and counts[line] < spans.shape[1]:
            spans[line, counts[line], 0], spans[line, counts[line], 1] = a, b
            counts[line] += 1


@lean
def _cap(s, cap):
    """Cap (5,) of directions that holds a net: axis, half-angle, and the least distance."""
    for d in range(3):
        cap[d] = 0.0
        for i in range(4):
            for j in range(4):
                cap[d] += s[i, j, d] / (16.0 * s[i, j, 3])
    radius = 0.0
    for i in range(4):
        for j in range(4):
            off = 0.0
            for d in range(3):
                off += (s[i, j, d] / s[i, j, 3] - cap[d]) ** 2
            radius = max(radius, math.sqrt(off))
    distance = math.sqrt(cap[0] ** 2 + cap[1] ** 2 + cap[2] ** 2)
    cap[4] = distance - radius
    cap[3] = math.pi if distance <= radius else math.asin(radius / distance)
    for d in range(3):
        cap[d] /= max(distance, 1e-300)
    return distance + radius


@kernel
def visible_share(cell, blockers, near, fine, stack, spans):
    """Share of a sub-element that no blocker (p, 4, 4, 4) hides; both relative to the receiver.

    Pieces wholly within ``near`` [m] hide nothing.
    """
    z = np.zeros(3)
    for i in (0, 3):
        for j in (0, 3):
            for k in range(3):
                z[k] += cell[i, j, k] / cell[i, j, 3]
    size = math.sqrt(z[0] ** 2 + z[1] ** 2 + z[2] ** 2)
    z /= size
    helper = np.zeros(3)
    helper[np.argmin(np.abs(z))] = 1.0
    x = np.cross(helper, z)
    x /= math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    y = np.cross(z, x)
    quad = np.empty((4, 2))
    normal = np.cross(
        cell[3, 3, :3] / cell[3, 3, 3] - cell[0, 0, :3] / cell[0, 0, 3],
        cell[0, 3, :3] / cell[0, 3, 3] - cell[3, 0, :3] / cell[3, 0, 3],
    )
    for k in range(4):
        p = cell[3 if 0 < k < 3 else 0, 3 if k > 1 else 0]
        depth = z[0] * p[0] + z[1] * p[1] + z[2] * p[2]
        if depth <= 0.0:
            return 1.0
        quad[k, 0] = (x[0] * p[0] + x[1] * p[1] + x[2] * p[2]) / depth
        quad[k, 1] = (y[0] * p[0] + y[1] * p[1] + y[2] * p[2]) / depth
    level = normal[0] * z[0] + normal[1] * z[1] + normal[2] * z[2]
    reach = 0.25 * size * level  # the plane of the sub-element
    widest = 0.0
    for k in range(4):
        widest = max(widest, math.hypot(quad[k, 0] - quad[k - 1, 0], quad[k, 1] - quad[k - 1, 1]))
    counts = np.zeros(_LINES, dtype=np.int64)
    cut = np.empty(2)
    low, high = np.empty((4, 4, 4)), np.empty((4, 4, 4))
    for b in range(blockers.shape[0]):
        top = 1
        for i in range(4):
            for j in range(4):
                p = blockers[b, i, j]
                stack[0, i, j, 0] = x[0] * p[0] + x[1] * p[1] + x[2] * p[2]
                stack[0, i, j, 1] = y[0] * p[0] + y[1] * p[1] + y[2] * p[2]
                stack[0, i, j, 2] = z[0] * p[0] + z[1] * p[1] + z[2] * p[2]
                stack[0, i, j, 3] = p[3]
        for _ in range(20000):
            if top == 0:
                break
            top -= 1
            piece = stack[top]
            front = away = False
            for i in range(4):
                for j in range(4):
                    q = piece[i, j]
                    front = front or q[2] > 0.0
                    reached = q[0] ** 2 + q[1] ** 2 + q[2] ** 2
                    away = away or reached > (near * q[3]) ** 2
            if not (front and away):
                continue
            shrink = 1.0
            gone = False
            for along in range(2):
                if not _clip_blocker(piece, quad, along == 0, cut):
                    gone = True
                    break
                shrink *= cut[1] - cut[0]
                if cut[1] > cut[0]:
                    _cut(piece, along == 0, cut[0], cut[1])
            if gone:
                continue
            # Small pieces are polygons: flat within a share of the sub-element.
            ahead = True
            across = 0.0
            for i in range(4):
                for j in range(4):
                    ahead = ahead and piece[i, j, 2] > 0.0
            if ahead:
                across = _sagitta(piece) / widest
            if ahead and (across < fine or shrink < 1e-9):
                behind = 0.0
                for k in range(3):
                    middle = 0.0
                    for i in (0, 3):
                        for j in (0, 3):
                            middle += 0.25 * piece[i, j, k] / piece[i, j, 3]
                    axis = x if k == 0 else (y if k == 1 else z)
                    behind += middle * (
                        normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2]
                    )
                if behind * reach < reach * reach * (1.0 - 1e-7):
                    _add_spans(piece, quad, spans, counts)
                continue
            if top + 4 > stack.shape[0]:
                continue
            halve_u(piece, low, high)
            halve_v(low, stack[top], stack[top + 1])
            halve_v(high, stack[top + 2], stack[top + 3])
            top += 4
    hidden = 0.0
    for line in range(_LINES):
        # Union of the spans, by insertion sort.
        m = counts[line]
        for i in range(1, m):
            a, b = spans[line, i, 0], spans[line, i, 1]
            k = i - 1
            while k >= 0 and spans[line, k, 0] > a:
                spans[line, k + 1, 0], spans[line, k + 1, 1] = spans[line, k, 0], spans[line, k, 1]
                k -= 1
            spans[line, k + 1, 0], spans[line, k + 1, 1] = a, b
        end = 0.0
        for i in range(m):
            a, b = max(spans[line, i, 0], end), spans[line, i, 1]
            if b > a:
                hidden += b - a
                end = b
    return 1.0 - hidden / _LINES


@parallel
def nn93_rows(
    points, normals, on, blind, near, sources, place, nets, hiding, tolerance, least, out, bounds
):
    """Form factors by the method of the paper, divided among the corners of the sources.

    A sub-element's share goes to the corners of its element as they weigh in its middle, where a
    function that is bilinear between them has the mean of its values at the sub-element's own.

    Parameters
    ----------
    points, normals : (m, 3) array
        Receivers [m] and unit normals.
    on : (m,) int array
        Row among ``nets`` of the patch each lies on, −1 for none.
    blind : (m,) bool array
        Whether nothing of that patch is above a receiver's horizon.
    near : (m,) array
        Distance within which nothing is seen of that patch, and nothing hides. [m]
    sources, nets : (n, 4, 4, 4), (p, 4, 4, 4) array
        Sources, and all surfaces.
    place : (n,) int array
        Row of each source among ``nets``.
    hiding : (p,) bool array
        Which surfaces may hide anything.
    tolerance, least : float
        Factor of a sub-element below which it is not quartered: relative to the whole, and at all.
    out : (m, n, 4) array
        Added to: shares of the corners (0, 0), (1, 0), (1, 1), (0, 1) of the nets' parameters.
    bounds : (m, n) array
        Eq. 5 of every source.
    """
    for i in nb.prange(points.shape[0]):
        x, n = points[i], normals[i]
        rounding = horizon_tolerance(x)
        stack, work = np.empty((_STACK, 4, 4, 4)), np.empty((_STACK, 4, 4, 4))
        level, middle = np.empty(_STACK, dtype=np.int64), np.empty((_STACK, 2))
        spans = np.empty((_LINES, 4096, 2))
        low, high = np.empty((4, 4, 4)), np.empty((4, 4, 4))
        shifted, some = np.empty_like(nets), np.empty_like(nets)
        caps, cap = np.empty((nets.shape[0], 5)), np.empty(5)
        hides = np.zeros(nets.shape[0], dtype=np.bool_)
        for b in range(nets.shape[0]):
            if not hiding[b]:
                continue
            shift_net(nets[b], x, shifted[b])
            _cap(shifted[b], caps[b])
            for k in range(16):
                p = shifted[b, k // 4, k % 4]
                hides[b] = hides[b] or n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > rounding
        helper = np.zeros(3)
        helper[np.argmin(np.abs(n))] = 1.0
        ex = np.cross(helper, n)
        ex /= math.sqrt(ex[0] ** 2 + ex[1] ** 2 + ex[2] ** 2)
        ey = np.cross(n, ex)
        unseen = on[i] if blind[i] else -1
        for j in range(sources.shape[0]):
            if unseen >= 0 and place[j] == unseen:
                continue
            shift_net(sources[j], x, stack[0])
            level[0] = 0
            middle[0] = 0.5
            whole = band_bound(stack[0], n, ex, ey)
            bounds[i, j] = whole
            # What may lie before the element: for all of its sub-elements.
            count = 0
            reach = _cap(stack[0], cap)
            for b in range(nets.shape[0]):
                if not hides[b] or b == place[j] or b == unseen or caps[b, 4] > reach:
                    continue
                between = cap[0] * caps[b, 0] + cap[1] * caps[b, 1] + cap[2] * caps[b, 2]
                apart = math.acos(min(1.0, max(-1.0, between)))
                if apart <= cap[3] + caps[b, 3] + 1e-9:
                    some[count] = shifted[b]
                    count += 1
            top = 1
            while top > 0:
                top -= 1
                cell, deep = stack[top], level[top]
                up = -1e300
                close = place[j] == on[i]
                for a in range(4):
                    for b in range(4):
                        q = cell[a, b]
                        up = max(up, n[0] * q[0] + n[1] * q[1] + n[2] * q[2])
                        reached = q[0] ** 2 + q[1] ** 2 + q[2] ** 2
                        close = close and reached <= (near[i] * q[3]) ** 2
                if up <= rounding or close:
                    continue
                bent = _sagitta(cell)
                small = band_bound(cell, n, ex, ey) <= max(tolerance * whole, least)
                if (bent < 1e-12 and count == 0) or small or deep >= 9:
                    # The flatness test: so many chords that what they cut off is small.
                    chords = min(64, 1 + int(math.sqrt(bent / (0.1 * tolerance + 1e-12))))
                    value = max(0.0, polygon_factor(cell, n, chords))
                    if value > 0.0 and count > 0:
                        value *= visible_share(cell, some[:count], near[i], 0.02, work, spans)
                    s, t = middle[top, 0], middle[top, 1]
                    out[i, j, 0] += value * (1.0 - s) * (1.0 - t)
                    out[i, j, 1] += value * s * (1.0 - t)
                    out[i, j, 2] += value * s * t
                    out[i, j, 3] += value * (1.0 - s) * t
                    continue
                halve_u(cell, low, high)
                halve_v(low, stack[top], stack[top + 1])
                halve_v(high, stack[top + 2], stack[top + 3])
                s, t = middle[top, 0], middle[top, 1]
                quarter = 0.25 / (1 << deep)
                for k in range(4):
                    level[top + k] = deep + 1
                    middle[top + k, 0] = s + (quarter if k >= 2 else -quarter)
                    middle[top + k, 1] = t + (quarter if k % 2 else -quarter)
                top += 4
