"""Light from infinity: sky, ground and sun as cells of directions, past curved blockers."""

import numba as nb
import numpy as np

from .compiled import parallel
from .contour import horizon_tolerance, shift_net
from .nets import ALWAYS_FRONT, heights
from .pyramid import NO_BLOCKER, make_scratch, see_blockers, visible_factor


@parallel
def dome_rows(
    nodes, normals, weights, cells, shine, tone, blockers, eps, cell_eps, trace, levels, out,
    counters,
):  # fmt: skip
    """Weighted form factors from receivers with q nodes each to cells at infinity.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node; 0 for nodes that get no light.
    cells : (c, 4, 4, 4) array
        Nets of directions, all weights 0, counter-clockwise seen from the receiver.
    shine : (c,) array
        Luminance of each cell, or what that of ``tone`` is multiplied with.
    tone : (10,) array, or (0,)
        See `pyramid.visible_factor`.
    eps, cell_eps, levels
        Relative accuracy of a cell, the factor below which a cell is sampled, and how often a
        cell is quartered at most.
    out : (m, 3) array
        Receives the sum of luminance x form factor, the variance of its sampled part, and the
        plain form factor of what is seen.
    counters : (m, 2) int array
        Cells at infinity traced, and pyramid cells visited.
    """
    p = blockers.nets.shape[0]
    # Not literals: those would compile the callee once more.
    front, nowhere = tone.size * 0 + ALWAYS_FRONT, tone.size * 0 - 1
    for i in nb.prange(nodes.shape[0]):
        scratch = make_scratch(p, levels)
        listed = np.empty(p + 1, dtype=np.int64)
        s, found, cone, plain = np.empty((4, 4, 4)), np.empty(4), np.zeros(4), np.zeros((5, 4))
        x, n = np.empty(3), np.empty(3)
        for q in range(nodes.shape[1]):
            w = weights[i, q]
            if w == 0.0:
                continue
            for k in range(3):
                x[k], n[k] = nodes[i, q, k], normals[i, q, k]
            rounding = horizon_tolerance(x)
            count = 0
            if trace:
                see_blockers(blockers, x, n, rounding, scratch.shifted, scratch.state)
                for b in range(p):
                    if scratch.state[b] != NO_BLOCKER:
                        listed[count] = b
                        count += 1
            for c in range(cells.shape[0]):
                shift_net(cells[c], x, s)
                _, _, high = heights(s, n)
                if high <= 0.0:
                    continue
                visible_factor(
                    s, c, x, n, cone, front, plain, nowhere, eps, cell_eps, rounding, tone,
                    blockers, listed, count, scratch, found,
                )  # fmt: skip
                out[i, 0] += w * shine[c] * found[0]
                out[i, 1] += (w * shine[c]) ** 2 * found[1]
                out[i, 2] += w * found[3]
                counters[i, 0] += 1
                counters[i, 1] += int(found[2])
