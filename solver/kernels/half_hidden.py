"""Light of partly hidden elements by where they are hidden.

How much of an element a receiver sees is told exactly, but `spread` divides it among the nodes as
if all of it were seen: where its bright end is hidden, too much light arrives. Here rays to its
Gauss points tell which of them are seen, and the light is divided anew.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .bvh import STACK, trace_ray
from .compiled import lean, parallel
from .ray_patch import MISS, WORK
from .spread import point_exchange

#: Distance over radius from which the Gauss points tell the form factor of an element: to 1e-4.
FAR = 1.0
#: How far the share that is seen may be from what the points say of it: half a row of them.
HALF_A_ROW = 0.17
#: Parts in which the hidden share is told, and bits for the points and for whether rays were
#: asked for them.
PARTS, POINTS, ASKED = 1_000_000, 16, 1 << 16


class Sights(NamedTuple):
    """What is known of pairs of m receivers and n elements; k pairs, in order of both.

    Attributes
    ----------
    start : (m + 1,) int array
        First pair of each receiver.
    element : (k,) array
        Element of each pair.
    seen : (k,) array
        Share of it that is hidden, in `PARTS`, as by the form factor; then a bit whether rays were
        asked for; then a bit for each of its Gauss points, set where it is seen.
    """

    start: np.ndarray
    element: np.ndarray
    seen: np.ndarray


@parallel
def count_pairs(factors, which, off, least, known, out):
    """Pairs (m,) of each receiver that are known, or may matter: see `add_half_hidden`."""
    for i in nb.prange(factors.shape[0]):
        k, end, count = known.start[i], known.start[i + 1], 0
        for c in range(which.shape[0]):
            if factors[i, which[c]] * off[c] <= least[i]:
                continue
            while k < end and known.element[k] < which[c]:
                k, count = k + 1, count + 1
            k += 1 if k < end and known.element[k] == which[c] else 0
            count += 1
        out[i] = count + end - k


@lean
def _note(p, j, seen, found):
    """Write down a pair. Apart: within a parallel loop Numba drops what is written to a tuple."""
    found.element[p], found.seen[p] = j, seen


@lean
def _find_kernel(x, n, j, sources, kernel):
    """Form factors of the Gauss points of element ``j`` into ``kernel``; returns their sum."""
    total = 0.0
    for k in range(kernel.shape[0]):
        kernel[k] = point_exchange(x, n, j, k, sources) / math.pi
        total += kernel[k]
    return total


@lean
def _seen(x, n, j, sources, kernel, tree, lift, reached, stack, work):
    """Which Gauss points of element ``j`` rays reach, a bit each; those that face away count."""
    origin, mask = sources.edge_origin, j * 0  # not literals: they would compile callees once more
    ox, oy, oz = x[0] + lift * n[0], x[1] + lift * n[1], x[2] + lift * n[2]
    for k in range(kernel.shape[0]):
        met = MISS
        if kernel[k] > 0.0:
            met, _, _, _, _, _ = trace_ray(
                tree.bounds, tree.links, tree.piece_patch, tree.piece_box, tree.nets, tree.kinds,
                ox, oy, oz,
                sources.area_point[0, j, k] + origin[0] - ox,
                sources.area_point[1, j, k] + origin[1] - oy,
                sources.area_point[2, j, k] + origin[2] - oz,
                0.0, reached, j * 0, j >= 0, stack, work,
            )  # fmt: skip
        if met == MISS:
            mask |= 1 << k
    return mask


@lean
def _add_seen(j, mask, factor, seen, kernel, total, basis, light, out):
    """Add what element ``j`` sends more, or less, when only some of its points are seen.

    The mean of what is seen, u + (u − h) (1 − V) / V by that of all, u, and of what is hidden, h,
    is off by less than h where most is seen, V > 1/2: where the edge lies between two points is
    known from V = ``seen`` alone. Light that is nowhere below 0 at the nodes is not sent as less.
    """
    part = 0.0
    for k in range(kernel.shape[0]):
        part += kernel[k] if (mask >> k) & 1 else 0.0
    if part == 0.0 or part == total:
        return
    share = part / total
    share = min(max(seen, share - HALF_A_ROW, 1e-3), share + HALF_A_ROW) if seen > 0.0 else share
    bit, away = 1, 1.0
    if share > 0.5:
        bit, part, away = 0, total - part, min(0.0, 1.0 - 1.0 / share)
    at, first = basis.at[basis.pieces[j] - 1], basis.start[j]
    for b in range(out.shape[0]):
        least, mean, some = math.inf, 0.0, 0.0
        for u in range(basis.start[j + 1] - first):
            value, of_all, of_some = light[first + u, b], 0.0, 0.0
            for k in range(kernel.shape[0]):
                weight = kernel[k] * at[k, u]
                of_all += weight
                of_some += weight if (mask >> k) & 1 == bit else 0.0
            least = min(least, value)
            mean += value * of_all / total
            some += value * of_some / part
        more = away * (some - mean)
        if least >= 0.0:
            more = max(more, -mean)
        out[b] += factor * more


@parallel
def add_half_hidden(
    points, normals, walls, factors, sources, basis, which, off, least, little, clear, tree, lift,
    reached, light, known, found, out, counters,
):  # fmt: skip
    """Add to ``out`` what partly hidden elements send more, or less, than if hidden evenly.

    Parameters
    ----------
    points, normals : (m, 3) array
        Receivers [m] and unit normals.
    walls : (m,) int array
        As in `spread.spread_rows`.
    factors : (m, n) array
        Form factors of the elements.
    sources : Sources
        The elements.
    basis : Basis
        Their unknowns.
    which, off : (c,) arrays
        Elements whose light varies, in order, and by how much from its mean, all columns together.
    least : (m,) array
        Light of an element that may be wrong. What cannot be by more is not looked at.
    little : float
        Share that is hidden of an element below which it may be an error of the points.
    clear : bool
        Whether form factors lack what is hidden, and nothing else: no glass dims them.
    tree : Tree
        What hides, for rays.
    lift : float
        Distance above the receivers from which rays start. [m]
    reached : float
        Share of their way after which they have arrived.
    light : (N, b) array
        Light at the unknowns.
    known, found : Sights
        What is known; receives that and what is found, as many pairs as `count_pairs` says.
    out : (m, b) array
        Light that the receivers get.
    counters : (m, 2) int array
        Receives the pairs that are partly hidden, and those that were asked with rays.
    """
    g = sources.area_point.shape[2]
    for i in nb.prange(factors.shape[0]):
        x, n, kernel = points[i], normals[i], np.empty(g)
        stack, work = np.empty(STACK, dtype=np.int64), np.empty(WORK)
        k, end, p = known.start[i], known.start[i + 1], found.start[i]
        for c in range(which.shape[0] + 1):
            j = which[c] if c < which.shape[0] else basis.pieces.shape[0]
            matters = c < which.shape[0] and factors[i, j] * off[c] > least[i]
            if not matters and c < which.shape[0]:
                continue
            while k < end and known.element[k] < j:
                _note(p, known.element[k], known.seen[k], found)
                k, p = k + 1, p + 1
            if not matters:
                continue
            factor, total, seen = float(factors[i, j]), 0.0, j * 0
            if k < end and known.element[k] == j:
                seen += known.seen[k]
                k += 1
            else:
                total = _find_kernel(x, n, j, sources, kernel)
                share = min(max(1.0 - factor / max(total, 1e-300), 0.0), 0.999)
                seen += int(PARTS * share) << (POINTS + 1)
            # What is hidden of it, or seen, is all that can be bright or dark.
            hidden = (seen >> (POINTS + 1)) / PARTS
            if (
                hidden > little
                and factor * hidden / (1.0 - hidden) * off[c] > least[i]
                and basis.pieces[j] > 0
                and (walls[i] < 0 or sources.wall[j] != walls[i])
            ):
                if total == 0.0:
                    total = _find_kernel(x, n, j, sources, kernel)
                if not seen & ASKED:
                    seen |= ASKED
                    seen |= _seen(x, n, j, sources, kernel, tree, lift, reached, stack, work)
                    counters[i, 1] += 1
                counters[i, 0] += 1
                away = (sources.spheres[j, 0] - x[0]) ** 2 + (sources.spheres[j, 1] - x[1]) ** 2
                away += (sources.spheres[j, 2] - x[2]) ** 2
                told = clear and away > (FAR * sources.spheres[j, 3]) ** 2
                share = factor / max(total, 1e-300) if told else -1.0
                _add_seen(j, seen, factor, share, kernel, total, basis, light, out[i])
            _note(p, j, seen, found)
            p += 1
