"""Rows of form factors, every pair at the price it is worth.

From each node all elements are done in three steps: the unoccluded factors (`edges` for distant
elements and the walls of spheres, `patch_factor` for the others), the visible share of each along
meridian planes (`meridian`, `shares`) or by lines of sight (`sights`, for bright elements), and
pyramid tracing (`rows`) for the pairs whose unoccluded factor is large. Which pairs are traced
depends on the unoccluded factor alone: to choose by what the meridians found would lose what they
missed.

One thread owns one row, so the result has the same bits for any number of threads.
"""

import math

import numba as nb
import numpy as np

from .closure import sum_row
from .compiled import lean, parallel
from .contour import horizon_tolerance, shift_net
from .edges import far_factors, find_dark, mean_factors, wall_factors
from .meridian import make_lines
from .nets import CONCAVE, CONVEX, PLANAR
from .patch_factor import patch_factor
from .pyramid import make_scratch
from .rows import DARK_PAIRS, SCANNED, UNOCCLUDED, how_to_see, trace_row, view_everywhere
from .shares import ROOM, find_shares, make_shares

_GOLDEN = 0.6180339887498949


@lean
def turn_of(number):
    """Angle by which the meridians of node ``number`` are turned: even for any run of numbers."""
    turn = (number + 0.5) * _GOLDEN
    return 2.0 * math.pi * (turn - math.floor(turn))


@lean
def find_dark_groups(x, n, own_patch, own, sources, blockers, dark):
    """Mark the groups (g,) of which a receiver sees nothing."""
    find_dark(x, n, sources.group_points, sources.group_cones, sources.group_spheres, dark)
    if own_patch < 0:
        return
    group, solid_of, flags = sources.group, blockers.solid, sources.flags
    solid = solid_of[own_patch]
    bulging = blockers.bulging[solid]
    for g in range(group.shape[0]):
        if bulging and solid_of[group[g, 2]] == solid:
            dark[g] = True
        if own_patch == group[g, 2]:
            # The side the receiver is on; the other side of a sheet is turned away from it.
            mine = flags[own] if own >= 0 else flags[group[g, 0]]
            other = own >= 0 and not group[g, 0] <= own < group[g, 1]
            if mine & (PLANAR | CONVEX) != 0 or (other and mine & CONCAVE != 0):
                dark[g] = True


@lean
def near_factors(x, n, own_patch, sources, blockers, eps, rounding, near, count, s, factors):
    """Unoccluded form factors of the ``count`` elements ``near``, one by one."""
    for m in range(count):
        j = near[m]
        patch = sources.patch[j]
        solid = blockers.solid[patch]
        same = own_patch >= 0 and blockers.solid[own_patch] == solid
        inside = same and blockers.hollow[solid]
        front, digits = how_to_see(x, n, own_patch, sources, j, inside, eps)
        shift_net(sources.nets[j], x, s)
        factors[j] = patch_factor(
            s, x, n, sources.cones[j], front, sources.quadrics[j], digits, rounding
        )


@lean
def _unoccluded(
    x, n, own_patch, own, wall, sources, blockers, near_ratio, eps, rounding, integral, s, dark,
    factors, near, counters,
):  # fmt: skip
    """Unoccluded form factors from one node to all elements into ``factors`` (n,)."""
    find_dark_groups(x, n, own_patch, own, sources, blockers, dark)
    mean_factors(x, n, sources, sources.point_from, factors)
    wall_factors(wall, sources, factors)
    left = far_factors(
        x, n, sources, sources.group, dark, sources.cones, sources.spheres, sources.dim,
        sources.point_from, near_ratio, eps, sources.azimuths.shape[0] == 0, integral, factors,
        near,
    )  # fmt: skip
    near_factors(x, n, own_patch, sources, blockers, eps, rounding, near, left, s, factors)
    none = 0
    for j in range(factors.shape[0]):
        none += 1 if factors[j] == 0.0 else 0
    counters[DARK_PAIRS] += none


@lean
def _find_wanted(plain, exact_above, wanted):
    """Mark the elements that are to be traced; returns whether there are any."""
    some = False
    for j in range(plain.shape[0]):
        wanted[j] = plain[j] > exact_above[j]
        some |= wanted[j]
    return some


@lean
def _add_plain(weight, plain, factors):
    """Add what one node would see with nothing in the way; returns of how many elements."""
    count = 0
    for j in range(plain.shape[0]):
        factors[j] += weight * plain[j]
        count += plain[j] > 0.0
    return count


@lean
def _add(weight, plain, wanted, share, deviation, factors, variances):
    """Add what one node sees of all elements that are not ``wanted``; returns how many they are."""
    count = 0
    for j in range(plain.shape[0]):
        value = 0.0 if wanted[j] else weight * plain[j]
        factors[j] += value * share[j]
        variances[j] += (value * deviation[j]) ** 2
        count += 1 if value > 0.0 else 0
    return count


@parallel
def form_factor_rows(
    nodes, normals, weights, patches, own, walls, lifts, first_row, sources, blockers, near_ratio,
    eps, trace, levels, tone, chunks, double, single, variances, outside, sums, counters,
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
    walls : (m,) int array
        Row of ``sources.wall_spheres`` on whose inner side each lies, −1 elsewhere.
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
    chunks : int
        How many threads to spread the receivers over.
    double, single : (m, n) array
        One of them, of double or single precision, receives the mean form factors; the other has no
        rows.
    variances : (m, n) array
        Receives the variance of the sampled part of each.
    outside : (m, 5) array
        Receives what the meridians see of sky and ground, as `sweep.sweep`.
    sums : (m, 2) array
        Receives the sums of factors and variances.
    counters : (m, 5) int array
        `rows.DARK_PAIRS` … `rows.CELLS`.
    """
    count, p = nodes.shape[0], blockers.nets.shape[0]
    count_elements = sources.nets.shape[0]
    # Fresh memory is dear: each thread takes it once.
    size = (count + chunks - 1) // chunks
    for chunk in nb.prange(chunks):
        integral = np.empty(sources.edge_point.shape[2])
        plain, near = np.empty(count_elements), np.empty(count_elements, dtype=np.int64)
        s, dark = np.empty((4, 4, 4)), np.empty(sources.group.shape[0], dtype=np.bool_)
        x, n, lifted, view = np.empty(3), np.empty(3), np.empty(3), np.empty(7)
        view_everywhere(view)
        scratch = make_scratch(p if trace else 0, levels)
        factors, spread = np.empty(count_elements), np.empty(count_elements)
        wanted = np.empty(count_elements, dtype=np.bool_)
        lines = make_lines(sources.azimuths, ROOM * sources.azimuths.shape[0])
        shares = make_shares(sources)
        for i in range(chunk * size, min(count, (chunk + 1) * size)):
            for j in range(count_elements):
                factors[j] = spread[j] = 0.0
            for q in range(nodes.shape[1]):
                weight = weights[i, q]
                if weight == 0.0:
                    continue
                for k in range(3):
                    x[k], n[k] = nodes[i, q, k], normals[i, q, k]
                    lifted[k] = x[k] + lifts[i] * n[k]
                rounding = horizon_tolerance(x)
                _unoccluded(
                    x, n, patches[i], own[i], walls[i], sources, blockers, near_ratio, eps,
                    rounding, integral, s, dark, plain, near, counters[i],
                )  # fmt: skip
                if not trace:
                    counters[i, UNOCCLUDED] += _add_plain(weight, plain, factors)
                    continue
                any_wanted = _find_wanted(plain, sources.exact_above, wanted)
                if sources.azimuths.shape[0]:
                    # A curved element may hide itself and what is behind it.
                    flat = own[i] if lifts[i] == 0.0 else -1
                    turn = turn_of((first_row + i) * nodes.shape[1] + q)
                    lines = find_shares(
                        lifted, n, own[i], flat, turn, view, dark, plain, sources, blockers,
                        rounding, tone, lines, shares,
                    )  # fmt: skip
                    for k in range(5):
                        outside[i, k] += shares.outside[k] * (weight if k < 3 else weight * weight)
                    counters[i, SCANNED] += _add(
                        weight, plain, wanted, shares.share, shares.deviation, factors, spread,
                    )  # fmt: skip
                if any_wanted:
                    trace_row(
                        x, n, patches[i], walls[i], sources, blockers, eps, scratch, wanted, plain,
                        s, weight, factors, spread, counters[i],
                    )  # fmt: skip
            sums[i, 0], sums[i, 1] = sum_row(factors), sum_row(spread)
            for j in range(count_elements):
                variances[i, j] = spread[j]
            if single.shape[0]:
                for j in range(count_elements):
                    single[i, j] = factors[j]
            else:
                for j in range(count_elements):
                    double[i, j] = factors[j]
