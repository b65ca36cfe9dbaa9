"""Form factors of distant elements: the contour integral over edges that elements share.

The rule of `contour` with a fixed number of Gauss nodes on every edge. For a node p on the
boundary with r = p − x and weighted tangent d = p' w_g,

    n · (r × d) / |r|² = (n · (p × d) − (n × x) · d) / |p − x|²

so that the nodes hold nothing of the receiver, an edge is integrated once for all elements that
meet in it, and the sum over the edges of a scene is one loop without branches. It is used where it
holds to the accuracy asked: elements wholly above the horizon, seen from the front, and further
away than `near_ratio` times their radius. Small ones that show both sides or set below the horizon
are summed over points of their surface; the others are left to `patch_factor`.

Where shares are sampled, most elements are so far away that their mean point and vector area tell
enough: see `mean_factors`.
"""

import math
from typing import NamedTuple

import numpy as np

from .closure import sum_row
from .compiled import kernel, lean

TWO_PI = 2.0 * math.pi
#: Stands for the factor of an element that is not known yet.
OPEN = -1.0
#: Error of a sum over points where the integrand has a kink, relative to radius² / distance²:
#: measured on quarters of cylinders and spheres.
AREA_ERROR = 0.02


class Edges(NamedTuple):
    """Gauss nodes on the edges of all elements, and the edges of each element.

    Attributes
    ----------
    edge_origin : (3,) array
        Where the points are counted from: near them, so that no digits are lost. [m]
    edge_point, edge_tangent, edge_moment : (3, g, e) arrays
        Points [m], tangents times Gauss weight, and their cross products; sorted by patch.
    edge_of : (n, 4) int array
        Edges of each element: v = v0, u = u1, v = v1, u = u0.
    edge_range : (n, 2) int array
        First and end of the edges of each element's patch.
    edge_error : (n,) array
        What the nodes miss of ∮ p dp about each element, against its area: the error from afar,
        where nothing is foreshortened.
    edge_sign : (n,) array
        1 on the patch's + side, −1 on its − side.
    area_point, area_normal : (3, n, k) arrays
        Points of each element, from ``edge_origin``, and normals times area. [m, m²]
    mean_point, mean_area : (3, n) arrays
        Mean point of each element, from ``edge_origin`` [m], and vector area [m²].
    mean_reach : (5, n) array
        Largest distance from the mean point [m], magnitude of the vector area [m²], sine of the
        largest angle between normals and it, 0 where flat, the same distance but 0 where flat, and
        the first moment of the normals against the vector area. [m]
    mean_parts : (n, g, 3) array
        Vector areas of strips across which the normals turn. [m²]
    """

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


@lean
def mean_factors(x, n, edges, square_from, factors):
    """Unoccluded form factors of distant elements by one point, A · r (n · r) / (π |r|⁴).

    Parameters
    ----------
    square_from : (n,) array
        Square of the distance from which it is good enough for each element, see
        `edges.point_distance`. [m²]
    factors : (n,) array
        Receives those of elements seen from the front and wholly above the horizon, 0 for what is
        wholly dark, `OPEN` for all others.
    """
    origin = edges.edge_origin
    x0, x1, x2 = x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]
    n0, n1, n2 = n[0], n[1], n[2]
    c0, c1, c2 = edges.mean_point[0], edges.mean_point[1], edges.mean_point[2]
    a0, a1, a2 = edges.mean_area[0], edges.mean_area[1], edges.mean_area[2]
    reach, size = edges.mean_reach[0], edges.mean_reach[1]
    spread, bulge = edges.mean_reach[2], edges.mean_reach[3]
    for j in range(factors.shape[0]):
        r0, r1, r2 = c0[j] - x0, c1[j] - x1, c2[j] - x2
        # What is flat reaches towards the horizon only as far as it is tilted against it.
        upright = (n0 * a0[j] + n1 * a1[j] + n2 * a2[j]) / max(size[j], 1e-300)
        tilt = math.sqrt(max(1.0 - upright * upright, 0.0))
        rise = max(bulge[j], reach[j] * tilt)
        up = n0 * r0 + n1 * r1 + n2 * r2
        facing = -(a0[j] * r0 + a1[j] * r1 + a2[j] * r2)
        square = r0 * r0 + r1 * r1 + r2 * r2
        slack = (spread[j] * (math.sqrt(square) + reach[j]) + bulge[j]) * size[j]
        value = up * facing / (math.pi * square * square)
        good = (up > rise) & (facing > slack) & (square >= square_from[j])
        dark = (up <= -rise) | (facing <= -slack)
        factors[j] = value if good else (0.0 if dark else OPEN)


@lean
def wall_factors(wall, sources, factors):
    """Form factors of the wall of a hollow sphere, for receivers on it, into ``factors`` (n,).

    ``wall`` is the sphere's row, −1 for other receivers. See `walls`.
    """
    if wall < 0:
        return
    for j in range(factors.shape[0]):
        if sources.wall[j] == wall:
            factors[j] = sources.wall_share[j]


@lean
def edge_integrals(x, n, edges, first, end, integral):
    """Contour integrals of edges ``first`` … ``end``, seen from ``x`` with normal ``n``.

    They are put into the same places of ``integral`` (e,).
    """
    origin = edges.edge_origin
    x0, x1, x2 = x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]
    n0, n1, n2 = n[0], n[1], n[2]
    a0, a1, a2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
    point, tangent, moment = edges.edge_point, edges.edge_tangent, edges.edge_moment
    out = integral[first:end]
    out[:] = 0.0
    for g in range(point.shape[1]):
        p0, p1, p2 = point[0, g, first:end], point[1, g, first:end], point[2, g, first:end]
        d0, d1, d2 = tangent[0, g, first:end], tangent[1, g, first:end], tangent[2, g, first:end]
        m0, m1, m2 = moment[0, g, first:end], moment[1, g, first:end], moment[2, g, first:end]
        for e in range(out.shape[0]):
            r0, r1, r2 = p0[e] - x0, p1[e] - x1, p2[e] - x2
            top = n0 * m0[e] + n1 * m1[e] + n2 * m2[e] - a0 * d0[e] - a1 * d1[e] - a2 * d2[e]
            out[e] += top / (r0 * r0 + r1 * r1 + r2 * r2)


@lean
def find_dark(x, n, points, cones, spheres, dark):
    """Mark the groups (g,) that lie below the horizon, or show their backs throughout.

    ``points`` (g, 3) are one of each. [m]
    """
    for g in range(dark.shape[0]):
        dx, dy, dz = spheres[g, 0] - x[0], spheres[g, 1] - x[1], spheres[g, 2] - x[2]
        radius, spread = spheres[g, 3], cones[g, 3]
        slack = spread * (math.sqrt(dx * dx + dy * dy + dz * dz) + radius) + radius
        dark[g] = n[0] * dx + n[1] * dy + n[2] * dz <= -radius
        if spread == 0.0:
            # All normals alike: a plane, and any of its points tells the side.
            slack = 0.0
            dx, dy, dz = points[g, 0] - x[0], points[g, 1] - x[1], points[g, 2] - x[2]
        away = -(cones[g, 0] * dx + cones[g, 1] * dy + cones[g, 2] * dz)
        dark[g] = dark[g] or (spread < 1.0 and away <= -slack)


@kernel
def far_factors(
    x, n, edges, group, dark, cones, spheres, dim, square_from, near_ratio, eps, shared, integral,
    factors, near,
):  # fmt: skip
    """Unoccluded form factors of all elements that are `OPEN` still and not too near.

    Parameters
    ----------
    group : (g, 3) int array
        First and end of the elements of each group: those of one side of one patch.
    dark : (g,) bool array
        Groups of which nothing is seen.
    cones, spheres : (n, 4) array
        Normal cones and bounding spheres of the elements.
    dim : (n,) array
        Share of ``eps`` that each element may have.
    square_from : (n,) array
        As in `mean_factors`: from there on one point tells the place of an element all above the
        horizon, and only how much of it shows its front is summed. [m²]
    near_ratio : float
        Elements nearer than this many of their radii are not done here.
    eps : float
        Error allowed, as a share of the hemisphere, of what is summed over points.
    shared : bool
        Whether most elements are to be done: their edges are then integrated for all of a patch at
        once. Else those that are near enough for it are summed over points, whose rule has as many
        nodes a direction and the same order.
    integral : (e,) array
        Scratch: contour integrals of the edges.
    factors : (n,) array
        Form factors; receives those that are done, 0 for dark ones.
    near : (n,) int array
        Receives the elements that are left to `patch_factor`.

    Returns
    -------
    int
        How many are left.
    """
    edge_of, edge_sign = edges.edge_of, edges.edge_sign
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    points, areas, origin = edges.area_point, edges.area_normal, edges.edge_origin
    y0, y1, y2 = x0 - origin[0], x1 - origin[1], x2 - origin[2]
    left, parts = 0, np.empty(points.shape[2])
    middle, strips = edges.mean_point, edges.mean_parts
    for g in range(group.shape[0]):
        if dark[g]:
            factors[group[g, 0] : group[g, 1]] = 0.0
            continue
        ready = False
        for j in range(group[g, 0], group[g, 1]):
            if factors[j] >= 0.0:
                continue
            factors[j] = 0.0
            dx, dy, dz = spheres[j, 0] - x0, spheres[j, 1] - x1, spheres[j, 2] - x2
            radius = spheres[j, 3]
            height = n0 * dx + n1 * dy + n2 * dz
            if height <= -radius:
                continue
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            away = -(cones[j, 0] * dx + cones[j, 1] * dy + cones[j, 2] * dz)
            spread = cones[j, 3]
            front = False
            if spread < 1.0:
                slack = spread * (distance + radius) + radius
                if away <= -slack:
                    continue
                front = away > slack
                if spread == 0.0 and distance > near_ratio * radius:
                    # All normals alike: a plane. The sphere's centre is near it, not in it.
                    front = away > radius
            good = front and height > radius and distance > near_ratio * radius
            if good and shared:
                # What the nodes miss of bent edges does not get less by foreshortening, on either
                # side, as the factor does.
                good = edges.edge_error[j] * distance * distance <= eps * away * height
            if good and shared:
                if not ready:
                    first, end = edges.edge_range[j, 0], edges.edge_range[j, 1]
                    edge_integrals(x, n, edges, first, end, integral)
                    ready = True
                total = integral[edge_of[j, 0]] + integral[edge_of[j, 1]]
                total -= integral[edge_of[j, 2]] + integral[edge_of[j, 3]]
                factors[j] = max(0.0, -edge_sign[j] * total / TWO_PI)
            elif not good and AREA_ERROR * radius * radius >= eps * dim[j] * distance * distance:
                near[left] = j
                left += 1
            elif height > radius and distance - radius >= math.sqrt(square_from[j]):
                r0, r1, r2 = middle[0, j] - y0, middle[1, j] - y1, middle[2, j] - y2
                total = 0.0
                for k in range(strips.shape[1]):
                    facing = strips[j, k, 0] * r0 + strips[j, k, 1] * r1 + strips[j, k, 2] * r2
                    total += max(-facing, 0.0)
                square = r0 * r0 + r1 * r1 + r2 * r2
                up = n0 * r0 + n1 * r1 + n2 * r2
                factors[j] = max(up, 0.0) * total / (math.pi * square * square)
            else:
                p0, p1, p2 = points[0, j], points[1, j], points[2, j]
                a0, a1, a2 = areas[0, j], areas[1, j], areas[2, j]
                for k in range(parts.shape[0]):
                    r0, r1, r2 = p0[k] - y0, p1[k] - y1, p2[k] - y2
                    up = n0 * r0 + n1 * r1 + n2 * r2
                    facing = -(a0[k] * r0 + a1[k] * r1 + a2[k] * r2)
                    square = r0 * r0 + r1 * r1 + r2 * r2
                    # Kept apart: the sum would hold up what is summed.
                    parts[k] = max(up, 0.0) * max(facing, 0.0) / (square * square)
                factors[j] = sum_row(parts) / math.pi
    return left
