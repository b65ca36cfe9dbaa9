"""Rows of form factors of which some pairs are found anew, all others left as they are.

What is asked for lies where something has moved, or behind it: mostly in a narrow cone about the
receiver. Only what meets that cone is scanned, as in `bulk`; unoccluded factors, shares and
pyramids are found for the pairs that are asked for alone. Where sky and ground are seen, they are
found as wholes.
"""

import numba as nb
import numpy as np

from .bulk import find_dark_groups, near_factors, turn_of
from .closure import sum_row
from .compiled import lean, parallel
from .contour import horizon_tolerance
from .edges import far_factors, mean_factors, wall_factors
from .meridian import make_lines
from .pyramid import make_scratch
from .rows import SCANNED, apart, trace_row, view_cone, view_everywhere, view_of_wanted
from .shares import ROOM, find_shares, make_shares


@lean
def _unoccluded(
    x, n, own_patch, own, wall, sources, blockers, near_ratio, eps, rounding, asked, integral, s,
    dark, factors, near,
):  # fmt: skip
    """Unoccluded form factors from one node to the elements ``asked`` for, 0 for all others."""
    find_dark_groups(x, n, own_patch, own, sources, blockers, dark)
    mean_factors(x, n, sources, sources.point_from, factors)
    wall_factors(wall, sources, factors)
    for j in range(factors.shape[0]):
        factors[j] = factors[j] if asked[j] else 0.0
    left = far_factors(
        x, n, sources, sources.group, dark, sources.cones, sources.spheres, sources.dim,
        sources.point_from, near_ratio, eps, False, integral, factors, near,
    )  # fmt: skip
    near_factors(x, n, own_patch, sources, blockers, eps, rounding, near, left, s, factors)


@lean
def _hide_apart(x, sources, view, cone, dark):
    """Take groups (g,) that do not meet a view cone for dark: they hide nothing in it."""
    if view[3] > 1.0:
        return
    for g in range(dark.shape[0]):
        if not dark[g]:
            view_cone(x, sources.group_spheres[g], cone)
            dark[g] = apart(view, cone)


@lean
def _add(weight, plain, asked, exact_above, wanted, share, deviation, factors, variances):
    """Add what one node sees of elements asked for, but for those that are to be traced.

    These are marked in ``wanted``. Returns how many were added, −1 − that where any is marked.
    """
    count, some = 0, False
    for j in range(plain.shape[0]):
        wanted[j] = asked[j] and plain[j] > exact_above[j]
        if not asked[j]:
            continue
        some |= wanted[j]
        value = 0.0 if wanted[j] else weight * plain[j]
        factors[j] += value * share[j]
        variances[j] += (value * deviation[j]) ** 2
        count += 1 if value > 0.0 else 0
    return -1 - count if some else count


@parallel
def renew_rows(
    nodes, normals, weights, patches, own, walls, lifts, first_row, sources, blockers, near_ratio,
    eps, levels, tone, chunks, again, asked, places, whole, factors, variances, outside, sums,
    counters,
):  # fmt: skip
    """Find some form factors anew, along the same meridians as `bulk.form_factor_rows`.

    Parameters
    ----------
    nodes … chunks
        As there; the sources have meridians.
    again : (m,) bool array
        Rows with something to find; those of receivers that have moved as wholes.
    asked : (m, n) bool array
        The pairs.
    places : (b, 4) array
        Balls about what has moved: where it was, and where it is. [m]
    whole : (m,) bool array
        Rows in which all that is seen of sky and ground is to be found, too.
    factors, variances : (m, n) float32 array
        Changed where asked.
    outside : (m, 5) array
        Changed in the ``whole`` rows; in others raised to what is seen where something has moved.
    sums, counters
        Changed in those rows.
    """
    count, p = nodes.shape[0], blockers.nets.shape[0]
    count_elements = sources.nets.shape[0]
    size = (count + chunks - 1) // chunks
    for chunk in nb.prange(chunks):
        integral = np.empty(sources.edge_point.shape[2])
        plain, near = np.empty(count_elements), np.empty(count_elements, dtype=np.int64)
        s, dark = np.empty((4, 4, 4)), np.empty(sources.group.shape[0], dtype=np.bool_)
        x, n, lifted, view, cone = np.empty(3), np.empty(3), np.empty(3), np.empty(7), np.empty(7)
        scratch = make_scratch(p, levels)
        row, spread = np.empty(count_elements), np.empty(count_elements)
        wanted = np.empty(count_elements, dtype=np.bool_)
        seen = np.empty(5)
        lines = make_lines(sources.azimuths, ROOM * sources.azimuths.shape[0])
        shares = make_shares(sources)
        for i in range(chunk * size, min(count, (chunk + 1) * size)):
            if not again[i]:
                continue
            for j in range(count_elements):
                row[j] = 0.0 if asked[i, j] else factors[i, j]
                spread[j] = 0.0 if asked[i, j] else variances[i, j]
            for k in range(5):
                seen[k] = 0.0
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
                    rounding, asked[i], integral, s, dark, plain, near,
                )  # fmt: skip
                view_everywhere(view)
                if not whole[i]:
                    for j in range(count_elements):
                        wanted[j] = plain[j] > 0.0
                    view_of_wanted(lifted, sources.spheres, wanted, places, view)
                flat = own[i] if lifts[i] == 0.0 else -1
                turn = turn_of((first_row + i) * nodes.shape[1] + q)
                _hide_apart(lifted, sources, view, cone, dark)
                lines = find_shares(
                    lifted, n, own[i], flat, turn, view, dark, plain, sources, blockers, rounding,
                    tone, lines, shares,
                )  # fmt: skip
                for k in range(5):
                    seen[k] += shares.outside[k] * (weight if k < 3 else weight * weight)
                added = _add(
                    weight, plain, asked[i], sources.exact_above, wanted, shares.share,
                    shares.deviation, row, spread,
                )  # fmt: skip
                counters[i, SCANNED] += added if added >= 0 else -1 - added
                if added < 0:
                    trace_row(
                        x, n, patches[i], walls[i], sources, blockers, eps, scratch, wanted, plain,
                        s, weight, row, spread, counters[i],
                    )  # fmt: skip
            for k in range(5):
                outside[i, k] = seen[k] if whole[i] else max(outside[i, k], seen[k])
            sums[i, 0], sums[i, 1] = sum_row(row), sum_row(spread)
            for j in range(count_elements):
                factors[i, j], variances[i, j] = row[j], spread[j]


@parallel
def renew_unoccluded(
    nodes, normals, weights, patches, own, walls, sources, blockers, near_ratio, eps, asked, factors
):
    """Find unoccluded form factors of some elements anew.

    Parameters
    ----------
    nodes … walls, sources, blockers, near_ratio, eps
        As in `bulk.form_factor_rows`.
    asked : (n,) bool array
        The elements.
    factors : (m, n) array
        Changed where asked.
    """
    for i in nb.prange(nodes.shape[0]):
        integral = np.empty(sources.edge_point.shape[2])
        plain, near = np.empty(asked.shape[0]), np.empty(asked.shape[0], dtype=np.int64)
        s, dark = np.empty((4, 4, 4)), np.empty(sources.group.shape[0], dtype=np.bool_)
        for j in range(asked.shape[0]):
            factors[i, j] = 0.0 if asked[j] else factors[i, j]
        for q in range(nodes.shape[1]):
            if weights[i, q] == 0.0:
                continue
            x, n = nodes[i, q], normals[i, q]
            _unoccluded(
                x, n, patches[i], own[i], walls[i], sources, blockers, near_ratio, eps,
                horizon_tolerance(x), asked, integral, s, dark, plain, near,
            )  # fmt: skip
            for j in range(asked.shape[0]):
                factors[i, j] += weights[i, q] * plain[j]
