"""What is nearest along each meridian: chords of panels, swept upwards from the horizon.

Depth is compared where chords begin; a chord that is passed over waits for the nearer one to end.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .cuts import ZENITH
from .gaps import add_gap
from .meridian import BINS, carried

#: What the meridians saw of a panel: all of some of its chords, or not all of one.
SHOWN, HIDDEN = 1, 2
#: Chords that are sorted by insertion.
RUN = 16
#: Overlap of chords, relative to 1 + τ, that is rounding.
_TIE = 1e-9


@lean
def _nearest(span, active, waiting, low, high):
    """Place in ``active`` of the chord that is nearest over [low, …], −1 where there is none."""
    found = 0 if waiting else -1
    for m in range(1, waiting):
        s, t = active[m], active[found]
        top = min(min(high, 1e7), min(span[s, 1], span[t, 1]))
        middle = max(low, 0.5 * (low + top))
        near = span[s, 2] + span[s, 3] * middle
        if near > span[t, 2] + span[t, 3] * middle:
            found = m
    return found


@lean
def _sort_chords(first, span, chain, order, other):
    """List the chords of a chain by where they begin, those that came first before their equals.

    Stretches of `RUN` are sorted by insertion, as panels of one surface come nearly sorted, and
    then merged. Returns how many there are.
    """
    s, count = first, 0
    while s >= 0:
        low, m, start = span[s, 0], count, count - count % RUN
        while m > start and span[order[m - 1], 0] > low:
            order[m] = order[m - 1]
            m -= 1
        order[m] = s
        count += 1
        s = chain[s]
    width = RUN
    while width < count:
        for start in range(0, count, 2 * width):
            middle, end = min(start + width, count), min(start + 2 * width, count)
            a, b = start, middle
            for m in range(start, middle):
                other[m] = order[m]
            for m in range(start, end):
                if a >= middle:
                    break
                if b < end and span[order[b], 0] < span[other[a], 0]:
                    order[m] = order[b]
                    b += 1
                else:
                    order[m] = other[a]
                    a += 1
        width *= 2
    return count


@lean
def _sweep_line(
    first, span, chain, piece, piece_panel, pieces, order, active, axis, n, ends, tone, line_out
):  # fmt: skip
    """Find what is nearest along the meridian whose chords start with ``first``.

    Sky and ground are looked for between the tangents ``ends`` (2,).

    Stores the pieces from number ``pieces`` on, with their chords for their panels, and returns the
    number of the next one.
    """
    count = _sort_chords(first, span, chain, order, active)
    waiting, winner = 0, -1
    at = 0.0
    for m in range(count + 1):
        nxt = order[m] if m < count else -1
        until = span[nxt, 0] if nxt >= 0 else ZENITH
        # What ends before the next chord begins.
        while at < until:
            if winner < 0:
                # Forget what has ended, and take the nearest of the others.
                kept = 0
                for a in range(waiting):
                    if span[active[a], 1] > at:
                        active[kept] = active[a]
                        kept += 1
                waiting = kept
                found = _nearest(span, active, waiting, at, until)
                if found < 0:
                    add_gap(max(at, ends[0]), min(until, ends[1]), axis, n, tone, line_out)
                    at = until
                    break
                winner = active[found]
                waiting -= 1
                active[found] = active[waiting]
            end = span[winner, 1]
            if end > until:
                break
            if end > at:
                piece[pieces, 0], piece[pieces, 1] = at, end
                piece_panel[pieces] = winner
                pieces += 1
                at = end
            winner = -1
        if nxt < 0:
            break
        if winner < 0:
            winner = nxt
            continue
        top = min(span[winner, 1], span[nxt, 1])
        middle = max(until, 0.5 * (until + min(top, 1e7)))
        mine = span[winner, 2] + span[winner, 3] * middle
        if span[nxt, 2] + span[nxt, 3] * middle > mine:
            if until > at:
                piece[pieces, 0], piece[pieces, 1] = at, until
                piece_panel[pieces] = winner
                pieces += 1
                at = until
            if span[winner, 1] > span[nxt, 1]:
                active[waiting] = winner
                waiting += 1
            winner = nxt
        elif span[nxt, 1] > span[winner, 1]:
            active[waiting] = nxt
            waiting += 1
    return pieces


@lean
def _view_ends(axis, n, view, ends):
    """Tangents of elevation between which a meridian along ``axis`` passes through a view cone."""
    ends[0], ends[1] = 0.0, ZENITH
    if view[3] > 1.0:
        return
    a = axis[0] * view[0] + axis[1] * view[1] + axis[2] * view[2]
    b = n[0] * view[0] + n[1] * view[1] + n[2] * view[2]
    size = math.sqrt(a * a + b * b)
    if size <= view[4]:
        ends[1] = 0.0
        return
    middle, half = math.atan2(b, a), math.acos(view[4] / size)
    low, high = max(middle - half, 0.0), min(middle + half, 0.5 * math.pi)
    if high <= low:
        ends[1] = 0.0
        return
    ends[0] = math.tan(low) if low < 0.5 * math.pi else ZENITH
    ends[1] = min(math.tan(high), ZENITH) if high < 0.5 * math.pi else ZENITH


@kernel
def sweep(lines, element, frame, n, view, tone, state, visible, outside):
    """Find what is nearest along every meridian, and what is seen of sky and ground.

    Parameters
    ----------
    lines : Lines
        Chords from `cut_panels`; receives the pieces.
    element : (p,) int array
        Element of each panel, −1 if it is not of one alone.
    view : (7,) array
        View cone, as `rows.view_cone`, in which sky and ground are looked for.
    state : (p,) int array
        Receives `SHOWN` and `HIDDEN` of the panels that are met.
    visible : (elements,) array
        Receives the visible form factor of each element, times the number of meridians.
    outside : (5,) array
        Receives luminance times form factor of the sky [cd/m²], the form factors of sky and
        ground, and variances of the first and the last.
    """
    head, chain, span, panel = lines.head, lines.chain, lines.span, lines.panel
    start, piece, piece_panel = lines.start, lines.piece, lines.piece_panel
    order, active, shown, axes = lines.order, lines.active, lines.shown, lines.axes
    number = head.shape[0]
    outside[:] = 0.0
    axis, now, ends = np.empty(3), np.empty(3), np.empty(2)
    before, first = np.empty(3), np.empty(3)
    start[0] = 0
    for k in range(number):
        for c in range(3):
            axis[c] = axes[k, 0] * frame[0, c] + axes[k, 1] * frame[1, c]
            now[c] = 0.0
        _view_ends(axis, n, view, ends)
        s = head[k]
        while s >= 0:
            shown[s] = HIDDEN
            s = chain[s]
        start[k + 1] = _sweep_line(
            head[k], span, chain, piece, piece_panel, start[k], order, active, axis, n, ends,
            tone, now,
        )  # fmt: skip
        for m in range(start[k], start[k + 1]):
            s = piece_panel[m]
            f = panel[s]
            low, high, bottom, top = piece[m, 0], piece[m, 1], span[s, 0], span[s, 1]
            whole = low <= bottom + _TIE * (1.0 + bottom) and high >= top - _TIE * (1.0 + top)
            shown[s] = SHOWN if whole else SHOWN | HIDDEN
            piece_panel[m] = f
            if element[f] >= 0:
                visible[element[f]] += carried(low, high)
        s = head[k]
        while s >= 0:
            state[panel[s]] |= shown[s]
            s = chain[s]
        for c in range(3):
            outside[c] += now[c] / number
            if k > 0 and c != 1:
                outside[3 + c // 2] += (now[c] - before[c]) ** 2
            before[c] = now[c]
            if k == 0:
                first[c] = now[c]
    # A step between two meridians lies anywhere between them: a twelfth of its square.
    outside[3] = (outside[3] + (first[0] - before[0]) ** 2) / (12.0 * number * number)
    outside[4] = (outside[4] + (first[2] - before[2]) ** 2) / (12.0 * number * number)


@lean
def height_bin(tangent):
    """Number of the interval of elevations, 0 … `BINS` − 1, that a tangent lies in."""
    return min(int(BINS * (tangent / (1.0 + tangent))), BINS - 1) if tangent > 0.0 else 0


@lean
def index_pieces(lines):
    """Index the pieces of all meridians by elevation: to look there costs less than to search."""
    start, piece, above = lines.start, lines.piece, lines.above
    for k in range(above.shape[0]):
        row = 0
        for m in range(start[k], start[k + 1]):
            top = height_bin(piece[m, 1])
            while row <= top:
                above[k, row] = m
                row += 1
        while row < BINS:
            above[k, row] = start[k + 1]
            row += 1
