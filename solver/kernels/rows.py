"""Rows of form factors: every source element as seen from the nodes of one receiver.

One thread owns one row, so the result has the same bits for any number of threads.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .contour import horizon_tolerance, shift_net
from .patch_factor import (
    ALWAYS_FRONT,
    CONCAVE,
    CONVEX,
    PLANAR,
    facing_of,
    heights,
    patch_factor,
)
from .pyramid import FRONT, NO_BLOCKER, make_scratch, see_blockers, visible_factor

#: Columns of the counters of a row.
SKIPPED_FACING, SKIPPED_HORIZON, UNOCCLUDED, TRACED, CELLS = range(5)


class Sources(NamedTuple):
    """Source elements; row j of every array is the same element, sorted by group.

    Attributes
    ----------
    nets : (n, 4, 4, 4) array
        Homogeneous control nets, +normal towards the emitting side.
    cones, spheres : (n, 4) array
        Normal cones and bounding spheres.
    flags : (n,) int array
        `patch_factor.PLANAR`, `CONVEX`, `CONCAVE`.
    cell_eps : (n,) array
        Form factor below which a partly hidden cell is sampled.
    group : (g, 3) int array
        First row, end row and patch of each group: the elements of one side of one patch.
    group_nets, group_cones, group_spheres
        The same for the whole patch side.
    """

    nets: np.ndarray
    cones: np.ndarray
    spheres: np.ndarray
    flags: np.ndarray
    cell_eps: np.ndarray
    group: np.ndarray
    group_nets: np.ndarray
    group_cones: np.ndarray
    group_spheres: np.ndarray


@nb.njit(cache=True, error_model="numpy")
def _view_cone(x, sphere, cone):
    """Direction (3), sine and cosine of the half-angle, nearest and farthest distance of a sphere.

    A sphere about the receiver gets sine 2: its cone is everywhere.
    """
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    cone[5], cone[6] = d - sphere[3], d + sphere[3]
    if d <= sphere[3]:
        cone[0], cone[1], cone[2], cone[3], cone[4] = 0.0, 0.0, 0.0, 2.0, 0.0
        return
    cone[0], cone[1], cone[2] = dx / d, dy / d, dz / d
    cone[3] = sphere[3] / d
    cone[4] = math.sqrt(1.0 - cone[3] * cone[3])


@nb.njit(cache=True, error_model="numpy")
def _apart(source, blocker):
    """Whether two view cones do not meet, or the blocker lies beyond the source."""
    if blocker[5] >= source[6]:
        return True
    sa, sb, ca, cb = source[3], blocker[3], source[4], blocker[4]
    if sa > 1.0 or sb > 1.0 or sa * cb + ca * sb <= 0.0:
        return False
    cosine = source[0] * blocker[0] + source[1] * blocker[1] + source[2] * blocker[2]
    return cosine < ca * cb - sa * sb - 1e-12


@nb.njit(cache=True, error_model="numpy")
def _row(
    x, n, own_patch, sources, blockers, eps, trace, scratch, listed, near, s, found, weight,
    factors, variances, counters,
):  # fmt: skip
    """Add ``weight`` times the form factors from one node to ``factors`` (n,)."""
    rounding = horizon_tolerance(x)
    plain = np.empty(0)
    state = scratch.state
    cone = np.empty(7)
    views, active, awake = scratch.views, scratch.active, 0
    if trace:
        see_blockers(blockers, x, n, rounding, scratch.shifted, state)
        for b in range(state.shape[0]):
            if state[b] != NO_BLOCKER:
                _view_cone(x, blockers.spheres[b], views[awake])
                active[awake] = b
                awake += 1
    for g in range(sources.group.shape[0]):
        first, end, patch = sources.group[g, 0], sources.group[g, 1], sources.group[g, 2]
        size = end - first
        solid = blockers.solid[patch]
        flags = sources.flags[first]
        if own_patch >= 0 and flags & (PLANAR | CONVEX) and patch == own_patch:
            counters[SKIPPED_FACING] += size
            continue
        if own_patch >= 0 and blockers.bulging[solid] and blockers.solid[own_patch] == solid:
            counters[SKIPPED_FACING] += size
            continue
        shift_net(sources.group_nets[g], x, s)
        _, _, high = heights(s, n)
        if high <= rounding:
            counters[SKIPPED_HORIZON] += size
            continue
        # Inside a convex cavity every wall faces every other.
        inside = own_patch >= 0 and blockers.hollow[solid] and blockers.solid[own_patch] == solid
        if not inside and facing_of(s, sources.group_cones[g], rounding) < 0:
            counters[SKIPPED_FACING] += size
            continue
        count = 0
        if trace:
            _view_cone(x, sources.group_spheres[g], cone)
            for m in range(awake):
                if _apart(cone, views[m]):
                    continue
                b = active[m]
                if b == patch and (
                    state[b] == FRONT or sources.flags[first] & (PLANAR | CONVEX | CONCAVE)
                ):
                    continue  # seen from one side throughout, a patch does not hide itself
                if blockers.solid[b] == solid and (
                    blockers.bulging[solid] or blockers.hollow[solid]
                ):
                    continue
                listed[count] = m
                count += 1
        for j in range(first, end):
            shift_net(sources.nets[j], x, s)
            k = 0
            if count:
                _view_cone(x, sources.spheres[j], cone)
                for m in range(count):
                    if not _apart(cone, views[listed[m]]):
                        near[k] = active[listed[m]]
                        k += 1
            # What is small needs fewer digits: 0.05 eps of the whole hemisphere is enough.
            dx = sources.spheres[j, 0] - x[0]
            dy = sources.spheres[j, 1] - x[1]
            dz = sources.spheres[j, 2] - x[2]
            distance2 = dx * dx + dy * dy + dz * dz
            bound = sources.spheres[j, 3] ** 2 / (distance2 + 1e-300)
            front = patch * 0  # not a literal: those would compile the callee once more
            if inside and (patch != own_patch or distance2 > sources.spheres[j, 3] ** 2):
                front += ALWAYS_FRONT
            digits = min(max(eps, 0.05 * eps / bound), 1e-2)
            if k == 0:
                value = patch_factor(s, n, sources.cones[j], front, digits, rounding)
                factors[j] += weight * value
                counters[UNOCCLUDED] += 1
                continue
            visible_factor(
                s, x, n, sources.cones[j], front, solid, digits, sources.cell_eps[j], rounding,
                plain, blockers, near, k, scratch, found,
            )  # fmt: skip
            factors[j] += weight * found[0]
            variances[j] += weight * weight * found[1]
            counters[TRACED] += 1
            counters[CELLS] += int(found[2])


@nb.njit(cache=True, error_model="numpy", parallel=True)
def form_factor_rows(
    nodes, normals, weights, patches, sources, blockers, eps, trace, levels,
    factors, variances, counters,
):  # fmt: skip
    """Form factors from receivers with q nodes each to all sources.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Weight of each node; those of a receiver sum to 1, or are all 0 (no light).
    patches : (m,) int array
        Patch each receiver lies on, −1 in the open.
    eps : float
        Relative accuracy of unoccluded factors.
    trace : bool
        Whether anything can hide anything.
    levels : int
        How often a source element may be quartered.
    factors, variances : (m, n) array
        Receive the mean form factor and the variance of its sampled part.
    counters : (m, 5) int array
        `SKIPPED_FACING` … `CELLS`.
    """
    p = blockers.nets.shape[0]
    for i in nb.prange(nodes.shape[0]):
        scratch = make_scratch(p, levels)
        listed, near = np.empty(p + 1, dtype=np.int64), np.empty(p + 1, dtype=np.int64)
        s, found = np.empty((4, 4, 4)), np.empty(4)
        x, n = np.empty(3), np.empty(3)
        for q in range(nodes.shape[1]):
            if weights[i, q] == 0.0:
                continue
            for k in range(3):
                x[k], n[k] = nodes[i, q, k], normals[i, q, k]
            _row(
                x, n, patches[i], sources, blockers, eps, trace, scratch, listed, near,
                s, found, weights[i, q], factors[i], variances[i], counters[i],
            )  # fmt: skip
