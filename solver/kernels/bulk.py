"""Rows of form factors, every pair at the price it is worth.

From each node all elements are done in three steps: the exact unoccluded factors (`edges` for
distant elements, `patch_factor` for the others), the visible share of each along meridian planes
(`meridian`), and pyramid tracing (`rows`) for the pairs whose unoccluded factor is large. Which
pairs are traced depends on the unoccluded factor alone: to choose by what the meridians found
would lose what they missed.

One thread owns one row, so the result has the same bits for any number of threads.
"""

import math

import numba as nb
import numpy as np

from .contour import horizon_tolerance, shift_net
from .edges import NEAR, edge_integrals, far_factors
from .meridian import cut_facets, is_hidden, make_spans, sweep, tangent_frame
from .nets import CONCAVE, CONVEX, PLANAR
from .patch_factor import patch_factor
from .pyramid import make_scratch
from .rows import DARK_PAIRS, SCANNED, UNOCCLUDED, how_to_see, trace_row

#: Spans a meridian is given room for at first.
_SPANS = 64
_GOLDEN = 0.6180339887498949
#: Standard deviation of the share of an element that one meridian meets, 0 < share < 1, relative
#: to its unoccluded factor: falls with the number of meridians.
_SHARE_DEVIATION = 0.25
#: The same for an element between the meridians, told by one point.
_POINT_DEVIATION = 0.3


@nb.njit(cache=True, error_model="numpy")
def _unoccluded(
    x, n, own_patch, own, sources, blockers, near_ratio, eps, rounding, integral, s, factors, found,
    counters,
):  # fmt: skip
    """Unoccluded form factors from one node to all elements into ``factors`` (n,)."""
    edge_integrals(x, n, sources, integral)
    far_factors(
        x, n, sources, integral, sources.cones, sources.spheres, near_ratio, eps, factors, found
    )
    for g in range(sources.group.shape[0]):
        first, end, patch = sources.group[g, 0], sources.group[g, 1], sources.group[g, 2]
        solid = blockers.solid[patch]
        same = own_patch >= 0 and blockers.solid[own_patch] == solid
        dark = same and blockers.bulging[solid]
        if own_patch == patch:
            # The side the receiver is on; the other side of a sheet is turned away from it.
            mine = sources.flags[own] if own >= 0 else sources.flags[first]
            other = own >= 0 and not first <= own < end
            dark = dark or mine & (PLANAR | CONVEX) != 0 or (other and mine & CONCAVE != 0)
        if dark:
            counters[DARK_PAIRS] += end - first
            for j in range(first, end):
                factors[j] = 0.0
            continue
        inside = same and blockers.hollow[solid]
        for j in range(first, end):
            if found[j] == NEAR:
                front, digits = how_to_see(x, own_patch, sources, j, inside, eps)
                shift_net(sources.nets[j], x, s)
                factors[j] = patch_factor(
                    s, x, n, sources.cones[j], front, sources.quadrics[j], digits, rounding
                )
            if factors[j] == 0.0:
                counters[DARK_PAIRS] += 1


@nb.njit(cache=True, error_model="numpy", parallel=True)
def form_factor_rows(
    nodes, normals, weights, patches, own, lifts, first_row, sources, blockers, near_ratio, eps,
    trace, levels, tone, factors, variances, outside, counters,
):  # fmt: skip
    """Form factors from receivers with q nodes each to all sources.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Weight of each node; those of a receiver sum to 1, or are all 0 (no light).
    patches, own : (m,) int array
        Patch and element each receiver lies on, −1 in the open.
    lifts : (m,) array
        How far the facets may lie before the surface the receiver is on: shares are taken from
        a point that much above it. [m]
    first_row : int
        Number of the first receiver: turns the meridians, differently for every row.
    near_ratio : float
        Distance over radius below which elements are not done by their shared edges.
    eps : float
        Relative accuracy of unoccluded factors.
    trace : bool
        Whether anything can hide anything.
    levels : int
        How often a source element may be quartered.
    tone : (10,) array
        Sky: 7 parameters of `sky_luminance` and the sun's direction.
    factors, variances : (m, n) array
        Receive the mean form factor and the variance of its sampled part.
    outside : (m, 5) array
        Receives what the meridians see of sky and ground, as `meridian.sweep`.
    counters : (m, 5) int array
        `rows.DARK_PAIRS` … `rows.CELLS`.
    """
    p = blockers.nets.shape[0]
    count_elements = sources.nets.shape[0]
    lines = sources.azimuths.shape[0]
    for i in nb.prange(nodes.shape[0]):
        integral = np.empty(sources.edge_point.shape[2])
        single, found = np.empty(count_elements), np.empty(count_elements, dtype=np.int64)
        s = np.empty((4, 4, 4))
        x, n, lifted, point = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
        frame, seen = np.empty((2, 3)), np.empty(5)
        scratch = make_scratch(p if trace else 0, levels)
        wanted = np.empty(count_elements, dtype=np.bool_)
        points = sources.facet_vertices.shape[0] if lines else 0
        local, line_of = np.empty((points, 4)), np.empty(points, dtype=np.int64)
        crossed = np.empty((lines, 3))
        capacity = _SPANS * lines
        spans = make_spans(lines, capacity)
        order, active = np.empty(capacity, dtype=np.int64), np.empty(capacity, dtype=np.int64)
        covered, visible = np.empty(count_elements), np.empty(count_elements)
        hits = np.empty(count_elements, dtype=np.int64)
        for q in range(nodes.shape[1]):
            weight = weights[i, q]
            if weight == 0.0:
                continue
            for k in range(3):
                x[k], n[k] = nodes[i, q, k], normals[i, q, k]
                lifted[k] = x[k] + lifts[i] * n[k]
            # A curved element may hide itself and what is behind it.
            flat = own[i] if lifts[i] == 0.0 else -1
            rounding = horizon_tolerance(x)
            _unoccluded(
                x, n, patches[i], own[i], sources, blockers, near_ratio, eps, rounding, integral,
                s, single, found, counters[i],
            )  # fmt: skip
            if not trace:
                for j in range(count_elements):
                    if single[j] > 0.0:
                        factors[i, j] += weight * single[j]
                        counters[i, UNOCCLUDED] += 1
                continue
            if lines == 0:
                for j in range(count_elements):
                    wanted[j] = single[j] > 0.0
                trace_row(
                    x, n, patches[i], sources, blockers, eps, scratch, wanted, single, s, weight,
                    factors[i], variances[i], counters[i],
                )  # fmt: skip
                continue
            turn = ((first_row + i) * nodes.shape[1] + q + 0.5) * _GOLDEN
            tangent_frame(n, 2.0 * math.pi * (turn - math.floor(turn)), frame)
            covered[:] = 0.0
            visible[:] = 0.0
            hits[:] = 0
            count = cut_facets(
                lifted, n, sources, flat, frame, sources.azimuths, rounding, local, line_of,
                crossed, spans, covered, hits,
            )  # fmt: skip
            if count > capacity:
                capacity = 2 * count
                spans = make_spans(lines, capacity)
                order = np.empty(capacity, dtype=np.int64)
                active = np.empty(capacity, dtype=np.int64)
                covered[:] = 0.0
                hits[:] = 0
                cut_facets(
                    lifted, n, sources, flat, frame, sources.azimuths, rounding, local, line_of,
                    crossed, spans, covered, hits,
                )  # fmt: skip
            sweep(
                spans, sources.facet_element, sources.azimuths, frame, n, tone, order, active,
                visible, seen,
            )  # fmt: skip
            for k in range(5):
                outside[i, k] += seen[k] * (weight if k < 3 else weight * weight)
            any_wanted = False
            for j in range(count_elements):
                wanted[j] = False
                value = single[j]
                if value <= 0.0:
                    continue
                if value > sources.exact_above[j]:
                    wanted[j] = True
                    any_wanted = True
                    continue
                counters[i, SCANNED] += 1
                if hits[j] > 0:
                    share = min(1.0, visible[j] / covered[j]) if covered[j] > 0.0 else 0.0
                    deviation = 0.0
                    if 0.0 < share < 1.0:
                        deviation = _SHARE_DEVIATION / hits[j]
                elif j == own[i]:
                    share, deviation = 1.0, 0.0
                else:
                    for k in range(3):
                        point[k] = sources.spheres[j, k]
                    dx, dy, dz = point[0] - lifted[0], point[1] - lifted[1], point[2] - lifted[2]
                    lx = frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz
                    ly = frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz
                    lz = n[0] * dx + n[1] * dy + n[2] * dz
                    rho = math.sqrt(lx * lx + ly * ly)
                    line = int(lines * (math.atan2(ly, lx) / (2.0 * math.pi) + 1.0) + 0.5) % lines
                    tangent = lz / rho if rho > 0.0 else 1e15
                    solid = blockers.solid[sources.patch[j]]
                    skip = solid if blockers.bulging[solid] else -1
                    hidden = is_hidden(
                        spans, sources, line, tangent, point, skip,
                        1e-6 * sources.spheres[j, 3],
                    )  # fmt: skip
                    share, deviation = (0.0 if hidden else 1.0), _POINT_DEVIATION
                factors[i, j] += weight * value * share
                variances[i, j] += (weight * value * deviation) ** 2
            if any_wanted:
                trace_row(
                    x, n, patches[i], sources, blockers, eps, scratch, wanted, single, s, weight,
                    factors[i], variances[i], counters[i],
                )  # fmt: skip
