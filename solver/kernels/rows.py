"""Source elements, and the pairs of one receiver that are traced by pyramids."""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .contour import horizon_tolerance, shift_net
from .nets import ALWAYS_FRONT, CONCAVE, CONVEX, PLANAR
from .pyramid import FRONT, MIXED, NO_BLOCKER, see_blockers, visible_factor

#: Foreshortening on both sides below which more digits are asked for, and the least that counts:
#: by less an element is seen only as far as it is near.
GRAZING, GRAZING_LEAST = 0.2, 0.01

#: Columns of the counters of a row.
DARK_PAIRS, UNOCCLUDED, SCANNED, TRACED, CELLS = range(5)


class Sources(NamedTuple):
    """Source elements; row j of every array is the same element, sorted by group.

    Without ``azimuths`` every pair that something may hide is traced by pyramids; with them, those
    whose unoccluded form factor is above ``exact_above``.

    Attributes
    ----------
    nets : (n, 4, 4, 4) array
        Homogeneous control nets, +normal towards the emitting side.
    cones, spheres : (n, 4) array
        Normal cones and bounding spheres.
    flags : (n,) int array
        `nets.PLANAR`, `CONVEX`, `CONCAVE`.
    quadrics : (n, 5, 4) array
        Quadric each lies on, as in `quadric.polar_plane`, turned to the emitting side.
    cell_eps : (n,) array
        Form factor below which a partly hidden cell is sampled.
    patch : (n,) int array
        Patch each element lies on.
    group : (g, 3) int array
        First row, end row and patch of each group: the elements of one side of one patch.
    group_points : (g, 3) array
        A point of each. [m]
    group_cones, group_spheres
        As above, for the whole patch side.
    wall, wall_share, wall_spheres
        Which lie on the inner sides of spheres, as in `walls.Walls`.
    edge_origin … mean_parts
        Gauss nodes on the edges and in the elements, as in `edges.Edges`.
    panel_points … sight_areas
        Flat pieces of the elements and of what else hides them, as in `facets.Facets`.
    azimuths : (lines, 2) array
        Cosine and sine of the meridians along which shares are found.
    exact_above : (n,) array
        Unoccluded form factor above which a pair is traced by pyramids.
    point_from : (n,) array
        Square of the distance from which one point tells the unoccluded factor of an element. [m²]
    dim : (n,) array
        Share of the error allowed to unoccluded factors that each may have, at most 1: what is
        brighter counts for more.
    """

    nets: np.ndarray
    cones: np.ndarray
    spheres: np.ndarray
    flags: np.ndarray
    quadrics: np.ndarray
    cell_eps: np.ndarray
    patch: np.ndarray
    group: np.ndarray
    group_points: np.ndarray
    group_cones: np.ndarray
    group_spheres: np.ndarray
    wall: np.ndarray
    wall_share: np.ndarray
    wall_spheres: np.ndarray
    edge_origin: np.ndarray
    edge_point: np.ndarray
    edge_tangent: np.ndarray
    edge_moment: np.ndarray
    edge_of: np.ndarray
    edge_range: np.ndarray
    edge_error: np.ndarray
    edge_sign: np.ndarray
    area_point: np.ndarray
    area_normal: np.ndarray
    mean_point: np.ndarray
    mean_area: np.ndarray
    mean_reach: np.ndarray
    mean_parts: np.ndarray
    panel_points: np.ndarray
    panel_corners: np.ndarray
    panel_planes: np.ndarray
    panel_element: np.ndarray
    panel_solid: np.ndarray
    panel_grid: np.ndarray
    unit_ranges: np.ndarray
    unit_points: np.ndarray
    unit_joined: np.ndarray
    grid_size: np.ndarray
    grid_lines: np.ndarray
    grid_element: np.ndarray
    sight_units: np.ndarray
    sight_clusters: np.ndarray
    sight_spheres: np.ndarray
    sight_start: np.ndarray
    sight_points: np.ndarray
    sight_areas: np.ndarray
    azimuths: np.ndarray
    exact_above: np.ndarray
    point_from: np.ndarray
    dim: np.ndarray


@lean
def view_cone(x, sphere, cone):
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


@lean
def view_everywhere(view):
    """View cone that holds all there is."""
    view[0] = view[1] = view[2] = view[4] = view[5] = 0.0
    view[3], view[6] = 2.0, math.inf


@lean
def add_to_view(x, sphere, view):
    """Add the direction of a sphere to that of a view cone that is being made."""
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    inverse = 1.0 / max(d, 1e-300)
    view[0] += dx * inverse
    view[1] += dy * inverse
    view[2] += dz * inverse


@lean
def widened(x, sphere, view, cosine):
    """Cosine of the half-angle of a cone about the axis of ``view`` that holds a sphere, too.

    At most ``cosine``; 0 where it is no less than a hemisphere.
    """
    dx, dy, dz = sphere[0] - x[0], sphere[1] - x[1], sphere[2] - x[2]
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    if d <= sphere[3]:
        return 0.0
    along, sine = (view[0] * dx + view[1] * dy + view[2] * dz) / d, sphere[3] / d
    if along <= 0.0:
        return 0.0
    off = math.sqrt(max(1.0 - along * along, 0.0))
    return max(min(cosine, along * math.sqrt(1.0 - sine * sine) - off * sine), 0.0)


@lean
def view_of_wanted(x, spheres, wanted, more, view):
    """View cone that holds all ``wanted`` (n,) of ``spheres`` (n, 4), and ``more`` (k, 4) spheres.

    It has no end. Everywhere where it would be no narrower than a hemisphere.
    """
    view_everywhere(view)
    for j in range(spheres.shape[0]):
        if wanted[j]:
            add_to_view(x, spheres[j], view)
    for j in range(more.shape[0]):
        add_to_view(x, more[j], view)
    size = math.sqrt(view[0] * view[0] + view[1] * view[1] + view[2] * view[2])
    cosine = 1.0 if size > 1e-6 else 0.0
    for k in range(3):
        view[k] /= max(size, 1e-6)
    for j in range(spheres.shape[0]):
        if wanted[j]:
            cosine = widened(x, spheres[j], view, cosine)
    for j in range(more.shape[0]):
        cosine = widened(x, more[j], view, cosine)
    view[4] = cosine - 1e-9
    if view[4] <= 0.0:
        view_everywhere(view)
    else:
        view[3] = math.sqrt(1.0 - view[4] * view[4])


@lean
def apart(source, blocker):
    """Whether two view cones do not meet, or the blocker lies beyond the source."""
    if blocker[5] >= source[6]:
        return True
    sa, sb, ca, cb = source[3], blocker[3], source[4], blocker[4]
    if sa > 1.0 or sb > 1.0 or sa * cb + ca * sb <= 0.0:
        return False
    cosine = source[0] * blocker[0] + source[1] * blocker[1] + source[2] * blocker[2]
    return cosine < ca * cb - sa * sb - 1e-12


@kernel
def trace_row(
    x, n, own_patch, wall, sources, blockers, eps, scratch, wanted, single, s, weight,
    factors, variances, counters,
):  # fmt: skip
    """Add ``weight`` times the form factors of the wanted elements from one node to ``factors``.

    Parameters
    ----------
    wall : int
        Row of ``sources.wall_spheres`` on whose inner side the node is, −1 elsewhere.
    wanted : (n,) bool array
        Which elements.
    single : (n,) array
        Their unoccluded form factors.
    s : (4, 4, 4) array
        Scratch.
    """
    rounding = horizon_tolerance(x)
    plain = np.empty(0)
    listed = np.empty(blockers.nets.shape[0] + 1, dtype=np.int64)
    near = np.empty(blockers.nets.shape[0] + 1, dtype=np.int64)
    cone, found = np.empty(7), np.empty(4)
    state, views, active, awake = scratch.state, scratch.views, scratch.active, 0
    see_blockers(blockers, x, n, rounding, scratch.shifted, state)
    for b in range(state.shape[0]):
        if state[b] != NO_BLOCKER:
            view_cone(x, blockers.spheres[b], views[awake])
            active[awake] = b
            awake += 1
    along = np.zeros(blockers.nets.shape[0], dtype=np.bool_)
    for g in range(sources.group.shape[0] if wall >= 0 else 0):
        if sources.wall[sources.group[g, 0]] == wall:
            along[sources.group[g, 2]] = True
    for g in range(sources.group.shape[0]):
        first, end, patch = sources.group[g, 0], sources.group[g, 1], sources.group[g, 2]
        some = False
        for j in range(first, end):
            some = some or wanted[j]
        if not some:
            continue
        solid = blockers.solid[patch]
        flags = sources.flags[first]
        # Inside a convex cavity every wall faces every other.
        inside = own_patch >= 0 and blockers.hollow[solid] and blockers.solid[own_patch] == solid
        view_cone(x, sources.group_spheres[g], cone)
        # Between two places of a sphere's wall there is nothing of it.
        across = wall >= 0 and sources.wall[first] == wall
        count = own_patch * 0  # not a literal: it would compile the callees once more
        for m in range(awake):
            if apart(cone, views[m]):
                continue
            b = active[m]
            if b == patch and (
                state[b] == FRONT
                or flags & (PLANAR | CONVEX)
                or (flags & CONCAVE and state[b] != MIXED)
            ):
                continue  # seen from one side throughout, a patch does not hide itself
            if blockers.solid[b] == solid and (blockers.bulging[solid] or inside):
                continue
            if across and along[b]:
                continue
            listed[count] = m
            count += 1
        for j in range(first, end):
            if not wanted[j]:
                continue
            k = count * 0  # not a literal, as above
            if count:
                view_cone(x, sources.spheres[j], cone)
                for m in range(count):
                    if not apart(cone, views[listed[m]]):
                        near[k] = active[listed[m]]
                        k += 1
            if k == 0:
                factors[j] += weight * single[j]
                counters[UNOCCLUDED] += 1
                continue
            shift_net(sources.nets[j], x, s)
            front, digits = how_to_see(x, n, own_patch, sources, j, inside, eps)
            visible_factor(
                s, j, x, n, sources.cones[j], front, sources.quadrics[j], solid, digits,
                sources.cell_eps[j], rounding, plain, blockers, near, k, scratch, found,
            )  # fmt: skip
            factors[j] += weight * found[0]
            variances[j] += weight * weight * found[1]
            counters[TRACED] += 1
            counters[CELLS] += int(found[2])


@lean
def how_to_see(x, n, own_patch, sources, j, inside, eps):
    """Flags and relative accuracy with which element ``j`` is looked at from ``x``.

    ``n`` is the normal there. ``inside`` tells that the receiver is on a wall of the same convex
    cavity.
    """
    dx, dy, dz = (
        sources.spheres[j, 0] - x[0],
        sources.spheres[j, 1] - x[1],
        sources.spheres[j, 2] - x[2],
    )
    distance2 = dx * dx + dy * dy + dz * dz
    radius2, cone = sources.spheres[j, 3] ** 2, sources.cones[j]
    patch = sources.patch[j]
    front = patch * 0  # not a literal: those would compile the callee once more
    if inside and (patch != own_patch or distance2 > radius2):
        front += ALWAYS_FRONT
    # What is small needs fewer digits, 0.05 eps of the whole hemisphere is enough; but its edges,
    # each as large as the patch appears, cancel to the square of that, and to less where it is
    # foreshortened.
    bound = radius2 / (distance2 + 1e-300)
    distance = math.sqrt(distance2) + 1e-300
    up = abs(n[0] * dx + n[1] * dy + n[2] * dz) / distance
    facing = abs(cone[0] * dx + cone[1] * dy + cone[2] * dz) / distance
    grazing = min(1.0, max(up * max(facing, cone[3]), GRAZING_LEAST) / GRAZING)
    return front, min(max(eps, 0.05 * eps / bound), 1e-2) * min(1.0, math.sqrt(bound)) * grazing
