"""Form factors of distant elements: the contour integral over edges that elements share.

The rule of `contour` with a fixed number of Gauss nodes on every edge. For a node p on the
boundary with r = p − x and weighted tangent d = p' w_g,

    n · (r × d) / |r|² = (n · (p × d) − (n × x) · d) / |p − x|²

so that the nodes hold nothing of the receiver, an edge is integrated once for all elements that
meet in it, and the sum over the edges of a scene is one loop without branches. It is used where it
holds to the accuracy asked: elements wholly above the horizon, seen from the front, and further
away than `near_ratio` times their radius. Small ones that show both sides or set below the horizon
are summed over points of their surface; the others are left to `patch_factor`.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

TWO_PI = 2.0 * math.pi
#: What `far_factors` found of an element: dark, done, or to be done by `patch_factor`.
DARK, DONE, NEAR = 0, 1, 2
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
        Points [m], tangents times Gauss weight, and their cross products.
    edge_of : (n, 4) int array
        Edges of each element: v = v0, u = u1, v = v1, u = u0.
    edge_sign : (n,) array
        1 on the patch's + side, −1 on its − side.
    area_point, area_normal : (n, k, 3) arrays
        Points of each element, from ``edge_origin``, and normals times area. [m, m²]
    """

    edge_origin: np.ndarray
    edge_point: np.ndarray
    edge_tangent: np.ndarray
    edge_moment: np.ndarray
    edge_of: np.ndarray
    edge_sign: np.ndarray
    area_point: np.ndarray
    area_normal: np.ndarray


@nb.njit(cache=True, error_model="numpy")
def edge_integrals(x, n, edges, integral):
    """Contour integral of every edge, seen from ``x`` with normal ``n``, into ``integral`` (e,)."""
    origin = edges.edge_origin
    x0, x1, x2 = x[0] - origin[0], x[1] - origin[1], x[2] - origin[2]
    n0, n1, n2 = n[0], n[1], n[2]
    a0, a1, a2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
    count = integral.shape[0]
    integral[:] = 0.0
    for g in range(edges.edge_point.shape[1]):
        p0, p1, p2 = edges.edge_point[0, g], edges.edge_point[1, g], edges.edge_point[2, g]
        d0, d1, d2 = edges.edge_tangent[0, g], edges.edge_tangent[1, g], edges.edge_tangent[2, g]
        m0, m1, m2 = edges.edge_moment[0, g], edges.edge_moment[1, g], edges.edge_moment[2, g]
        for e in range(count):
            r0, r1, r2 = p0[e] - x0, p1[e] - x1, p2[e] - x2
            top = n0 * m0[e] + n1 * m1[e] + n2 * m2[e] - a0 * d0[e] - a1 * d1[e] - a2 * d2[e]
            integral[e] += top / (r0 * r0 + r1 * r1 + r2 * r2)


@nb.njit(cache=True, error_model="numpy")
def find_dark(x, n, nets, cones, spheres, dark):
    """Mark the groups (g,) that lie below the horizon, or show their backs throughout."""
    for g in range(dark.shape[0]):
        dx, dy, dz = spheres[g, 0] - x[0], spheres[g, 1] - x[1], spheres[g, 2] - x[2]
        radius, spread = spheres[g, 3], cones[g, 3]
        slack = spread * (math.sqrt(dx * dx + dy * dy + dz * dz) + radius) + radius
        dark[g] = n[0] * dx + n[1] * dy + n[2] * dz <= -radius
        if spread == 0.0:
            # All normals alike: a plane, and any of its points tells the side.
            w, slack = nets[g, 0, 0, 3], 0.0
            dx, dy, dz = (
                nets[g, 0, 0, 0] / w - x[0],
                nets[g, 0, 0, 1] / w - x[1],
                nets[g, 0, 0, 2] / w - x[2],
            )
        away = -(cones[g, 0] * dx + cones[g, 1] * dy + cones[g, 2] * dz)
        dark[g] = dark[g] or (spread < 1.0 and away <= -slack)


@nb.njit(cache=True, error_model="numpy")
def far_factors(
    x, n, edges, group, dark, integral, cones, spheres, near_ratio, eps, factors, found
):  # fmt: skip
    """Unoccluded form factors of all elements for which the shared edges are good enough.

    Parameters
    ----------
    group : (g, 3) int array
        First and end of the elements of each group.
    dark : (g,) bool array
        Groups of which nothing is seen.
    integral : (e,) array
        From `edge_integrals`.
    cones, spheres : (n, 4) array
        Normal cones and bounding spheres of the elements.
    near_ratio : float
        Elements nearer than this many of their radii are not done here.
    eps : float
        Error allowed, as a share of the hemisphere, of what is summed over points.
    factors : (n,) array
        Receives the form factors of those that are done, 0 for dark ones.
    found : (n,) int array
        Receives `DARK`, `DONE` or `NEAR`.
    """
    edge_of, edge_sign = edges.edge_of, edges.edge_sign
    point, normal, origin = edges.area_point, edges.area_normal, edges.edge_origin
    x0, x1, x2, n0, n1, n2 = x[0], x[1], x[2], n[0], n[1], n[2]
    y0, y1, y2 = x0 - origin[0], x1 - origin[1], x2 - origin[2]
    for g in range(group.shape[0]):
        if dark[g]:
            for j in range(group[g, 0], group[g, 1]):
                factors[j] = 0.0
                found[j] = DARK
            continue
        for j in range(group[g, 0], group[g, 1]):
            factors[j] = 0.0
            dx, dy, dz = spheres[j, 0] - x0, spheres[j, 1] - x1, spheres[j, 2] - x2
            radius = spheres[j, 3]
            height = n0 * dx + n1 * dy + n2 * dz
            if height <= -radius:
                found[j] = DARK
                continue
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            away = -(cones[j, 0] * dx + cones[j, 1] * dy + cones[j, 2] * dz)
            spread = cones[j, 3]
            front = False
            if spread < 1.0:
                slack = spread * (distance + radius) + radius
                if away <= -slack:
                    found[j] = DARK
                    continue
                front = away > slack
                if spread == 0.0 and distance > near_ratio * radius:
                    # All normals alike: a plane. The sphere's centre is near it, not in it.
                    front = away > radius
            if front and height > radius and distance > near_ratio * radius:
                found[j] = DONE
                total = integral[edge_of[j, 0]] + integral[edge_of[j, 1]]
                total -= integral[edge_of[j, 2]] + integral[edge_of[j, 3]]
                factors[j] = max(0.0, -edge_sign[j] * total / TWO_PI)
                continue
            if AREA_ERROR * radius * radius >= eps * distance * distance:
                found[j] = NEAR
                continue
            found[j] = DONE
            total = 0.0
            for k in range(point.shape[1]):
                r0, r1, r2 = point[j, k, 0] - y0, point[j, k, 1] - y1, point[j, k, 2] - y2
                up = n0 * r0 + n1 * r1 + n2 * r2
                facing = -(normal[j, k, 0] * r0 + normal[j, k, 1] * r1 + normal[j, k, 2] * r2)
                if up > 0.0 and facing > 0.0:
                    square = r0 * r0 + r1 * r1 + r2 * r2
                    total += up * facing / (square * square)
            factors[j] = total / math.pi
