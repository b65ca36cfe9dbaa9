"""What meridians see of the cells of joined panels, where these are partly hidden.

A chord of a panel passes from cell to cell where it crosses the straight lines that part them.
"""

from .compiled import lean
from .meridian import carried
from .sweep import HIDDEN, SHOWN, height_bin

#: Added to what is seen of the panels of a unit that is partly hidden.
_PARTLY = 4


@lean
def _place_grid(lines, first, end, x, n, moment):
    """Normals (3) of the planes through ``x`` and a grid's lines, and their products with ``n``.

    A direction d points beyond a line where its product with the normal is positive.
    """
    x0, x1, x2 = x[0], x[1], x[2]
    for q in range(first, end):
        p0, p1, p2 = lines[q, 0, 0] - x0, lines[q, 0, 1] - x1, lines[q, 0, 2] - x2
        e0, e1, e2 = lines[q, 1, 0], lines[q, 1, 1], lines[q, 1, 2]
        m0, m1, m2 = p1 * e2 - p2 * e1, p2 * e0 - p0 * e2, p0 * e1 - p1 * e0
        moment[q, 0], moment[q, 1], moment[q, 2] = m0, m1, m2
        moment[q, 3] = m0 * n[0] + m1 * n[1] + m2 * n[2]


@lean
def _column(moment, first, count, d0, d1, d2, tangent):
    """Between which of ``count`` lines from row ``first`` on a point of a meridian lies: 0 … count.

    The point is at elevation ``tangent`` of the meridian along d.
    """
    if count == 0:
        return 0
    low, left = first, count
    while left > 1:
        half = left // 2
        q = low + half - 1
        value = moment[q, 0] * d0 + moment[q, 1] * d1 + moment[q, 2] * d2 + tangent * moment[q, 3]
        low += half if value > 0.0 else 0
        left -= half
    value = moment[low, 0] * d0 + moment[low, 1] * d1 + moment[low, 2] * d2
    return low - first + (1 if value + tangent * moment[low, 3] > 0.0 else 0)


@lean
def _leaves(moment, q, d0, d1, d2, high):
    """Tangent at which the meridian along d crosses a grid's line, ``high`` at most."""
    t = -(moment[q, 0] * d0 + moment[q, 1] * d1 + moment[q, 2] * d2) / moment[q, 3]
    return t if 0.0 < t < high else high


@lean
def find_partly(x, n, dark, sources, found):
    """Find what is seen of every unit, and make ready the grids of those that are partly hidden.

    Of units that are ``dark`` (g,) nothing is seen.
    """
    state, unit, moment = found.state, found.unit, found.moment
    ranges, grid_of, sizes = sources.unit_ranges, sources.panel_grid, sources.grid_size
    for g in range(unit.shape[0]):
        unit[g] = seen = 0
        if dark[g]:
            continue
        for f in range(ranges[g, 0], ranges[g, 1]):
            seen |= state[f]
        unit[g] = seen
        if seen != SHOWN | HIDDEN:
            continue
        for f in range(ranges[g, 0], ranges[g, 1]):
            state[f] |= _PARTLY
            k = grid_of[f]
            if k >= 0:
                end = sizes[k, 2] + sizes[k, 0] + sizes[k, 1] - 2
                _place_grid(sources.grid_lines, sizes[k, 2], end, x, n, moment)


@lean
def share_grids(sources, lines, found):
    """Add up what is nearest of the cells of panels of units that are partly hidden."""
    head, chain, span, panels = lines.head, lines.chain, lines.span, lines.panel
    start, piece, piece_panel, axes = lines.start, lines.piece, lines.piece_panel, lines.axes
    grid_of, state, moment = sources.panel_grid, found.state, found.moment
    sizes, elements = sources.grid_size, sources.grid_element
    covered, visible, hits, frame = found.covered, found.visible, found.hits, found.frame
    above = lines.above
    for k in range(head.shape[0]):
        d0 = axes[k, 0] * frame[0, 0] + axes[k, 1] * frame[1, 0]
        d1 = axes[k, 0] * frame[0, 1] + axes[k, 1] * frame[1, 1]
        d2 = axes[k, 0] * frame[0, 2] + axes[k, 1] * frame[1, 2]
        s = head[k]
        while s >= 0:
            f, low, high = panels[s], span[s, 0], span[s, 1]
            s = chain[s]
            g = grid_of[f]
            if g < 0 or state[f] < _PARTLY:
                continue
            nu, nv, u_first, cell = sizes[g, 0], sizes[g, 1], sizes[g, 2], sizes[g, 3]
            v_first = u_first + nu - 1
            i = _column(moment, u_first, nu - 1, d0, d1, d2, low)
            j = _column(moment, v_first, nv - 1, d0, d1, d2, low)
            left_u = _column(moment, u_first, nu - 1, d0, d1, d2, high) - i
            left_v = _column(moment, v_first, nv - 1, d0, d1, d2, high) - j
            m, at = above[k, height_bin(low)], low
            tu, tv, last = -1.0, -1.0, -1
            for _ in range(abs(left_u) + abs(left_v) + 1):
                # Where the chord leaves the cell.
                if tu < 0.0:
                    tu = high
                    if left_u != 0:
                        q = u_first + (i if left_u > 0 else i - 1)
                        tu = _leaves(moment, q, d0, d1, d2, high)
                if tv < 0.0:
                    tv = high
                    if left_v != 0:
                        q = v_first + (j if left_v > 0 else j - 1)
                        tv = _leaves(moment, q, d0, d1, d2, high)
                until = min(tu, tv)
                if until > at + 1e-13 * (1.0 + at):
                    e = elements[cell + i * nv + j]
                    covered[e] += carried(at, until)
                    # Of elements that several cells belong to, too, a chord is one hit.
                    hits[e] += 1.0 if e != last else 0.0
                    last = e
                    while m < start[k + 1] and piece[m, 1] <= at:
                        m += 1
                    q = m
                    while q < start[k + 1] and piece[q, 0] < until:
                        if piece_panel[q] == f:
                            visible[e] += carried(max(piece[q, 0], at), min(piece[q, 1], until))
                        q += 1
                    at = until
                if tu <= tv and left_u != 0:
                    step = 1 if left_u > 0 else -1
                    i, left_u, tu = i + step, left_u - step, -1.0
                elif left_v != 0:
                    step = 1 if left_v > 0 else -1
                    j, left_v, tv = j + step, left_v - step, -1.0
