"""Edges, points and means of elements, by which unoccluded factors are found in bulk."""

from __future__ import annotations

import math

import numpy as np

from .kernels.edges import Edges
from .model.arrays import FloatArray, IntArray, unique_rows
from .model.bezier import area_points, bernstein, curve_points, gauss_rule
from .topology import writable

#: Gauss nodes on an edge, and along u and v inside an element.
EDGE_NODES = 4
#: The same where what those miss is measured.
_FINE_NODES = 12


def near_ratio(eps: float) -> float:
    """Distance over radius from which `EDGE_NODES` on an edge give relative accuracy ``eps``.

    A straight edge of half-length h <= r at distance a r from its nearest point has the poles of
    1/|H|² on the Bernstein ellipse ϱ = a + sqrt(a² + 1), and g nodes leave about ϱ^(−2 g) [1]; the
    sum over the edges cancels one power of the distance. The ratio is taken 1.5 times, for edges
    that bend.

    References
    ----------
    .. [1] L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM, 2013, thm 19.3.
    """
    rho = eps ** (-0.5 / EDGE_NODES)
    return 1.0 + 1.5 * 0.5 * (rho - 1.0 / rho)


def make_edges(
    nets: FloatArray,
    patch_nets: FloatArray,
    patch: IntArray,
    boxes: FloatArray,
    side: IntArray,
    cones: FloatArray,
    *,
    shared: bool = True,
) -> Edges:
    """Gauss nodes on the edges of all elements; edges of neighbours in a patch are one.

    Parameters
    ----------
    nets : (n, 4, 4, 4) array
        Control nets of the elements.
    patch_nets : (p, 4, 4, 4) array
        Control nets of the patches.
    patch, side : (n,) int arrays
        Patch and side of each element.
    boxes : (n, 4) array
        u0, u1, v0, v1 of each element in its patch.
    cones : (n, 4) array
        Normal cones of the elements.
    shared : bool
        Whether edges are to be integrated for all elements of a patch, see `far_factors`: only then
        it matters what their nodes miss.
    """
    n = len(nets)
    u0, u1, v0, v1 = boxes.T
    of = patch.astype(np.float64)
    along_u, along_v = np.zeros(n), np.ones(n)
    # Patch, direction, fixed parameter, first and last of the running one.
    keys = np.stack(
        [
            np.stack([of, along_u, v0, u0, u1], axis=1),
            np.stack([of, along_v, u1, v0, v1], axis=1),
            np.stack([of, along_u, v1, u0, u1], axis=1),
            np.stack([of, along_v, u0, v0, v1], axis=1),
        ],
        axis=1,
    ).reshape(-1, 5)
    unique, inverse = unique_rows(keys)
    origin = (nets[..., :3] / nets[..., 3:]).reshape(-1, 3).mean(axis=0)
    rule, weight = gauss_rule(EDGE_NODES)
    curves = _curves(unique, patch_nets)
    point, tangent = _on_edges(unique, curves, rule, weight)
    point = point - origin
    moment = np.cross(point, tangent)
    inside, area = area_points(nets, EDGE_NODES)
    missed = np.zeros(n)
    if shared:
        rough = _products(point, tangent)
        fine, along = _on_edges(unique, curves, *gauss_rule(_FINE_NODES))
        off = (_products(fine - origin, along) - rough)[inverse.reshape(n, 4)]
        off[:, 2:] *= -1.0
        missed = np.linalg.norm(off.sum(axis=1), axis=(1, 2))
    return Edges(
        edge_origin=writable(origin),
        edge_point=writable(point.transpose(2, 1, 0)),
        edge_tangent=writable(tangent.transpose(2, 1, 0)),
        edge_moment=writable(moment.transpose(2, 1, 0)),
        edge_of=writable(inverse.reshape(n, 4), np.int64),
        edge_range=np.stack(
            [np.searchsorted(unique[:, 0], of, side) for side in ("left", "right")], axis=1
        ),
        edge_sign=writable(1.0 - 2.0 * side),
        area_point=writable((inside - origin).transpose(2, 0, 1)),
        area_normal=writable(area.transpose(2, 0, 1)),
        edge_error=missed / np.maximum(np.linalg.norm(area.sum(axis=1), axis=1), 1e-300),
        **_means(nets, inside - origin, area, origin, cones),
    )


def _curves(edges: FloatArray, patch_nets: FloatArray) -> FloatArray:
    """Cubics (e, 4, 4), homogeneous, that edges (e, 5) as `make_edges` lists them lie on."""
    across = bernstein(edges[:, 2])[:, None]
    nets = patch_nets[edges[:, 0].astype(np.int64)]
    along_v = edges[:, 1] == 1.0
    nets[along_v] = nets[along_v].swapaxes(1, 2)  # those at a fixed u
    return np.asarray((across[:, None] @ nets)[:, :, 0])


def _on_edges(
    edges: FloatArray, curves: FloatArray, rule: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points and weighted tangents (e, g, 3) on edges (e, 5) of `_curves`.

    From afar all of a contour but its area cancels: the tangents of an edge are made to sum to the
    step between its ends.
    """
    nodes = len(rule)
    length = (edges[:, 4] - edges[:, 3])[:, None]
    # Both ends behind the nodes.
    running = edges[:, 3:4] + length * np.append(rule, (0.0, 1.0))
    point, along = curve_points(curves, running)
    tangent = along[:, :nodes] * (length * weight)[:, :, None]
    missed = point[:, -1] - point[:, -2] - tangent.sum(axis=1)
    return point[:, :nodes], tangent + missed[:, None] * weight[:, None]


def _products(points: FloatArray, tangents: FloatArray) -> FloatArray:
    """∫ p dp (e, 3, 3) along edges, given points and weighted tangents (e, g, 3)."""
    return np.asarray(points.swapaxes(1, 2) @ tangents)


def _means(
    nets: FloatArray, points: FloatArray, areas: FloatArray, origin: FloatArray, cones: FloatArray
) -> dict[str, FloatArray]:
    """Mean points and vector areas of elements, as in `kernels.edges.Edges`."""
    weight = np.linalg.norm(areas, axis=2)
    middle = np.einsum("nk,nkc->nc", weight, points)
    middle /= np.maximum(weight.sum(axis=1), 1e-300)[:, None]
    whole = areas.sum(axis=1)
    size = np.linalg.norm(whole, axis=1)
    # No point of an element is outside the hull of its control points.
    hull = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), -1, 3) - origin
    reach = np.linalg.norm(hull - middle[:, None], axis=2).max(axis=1)
    axis = np.einsum("nc,nc->n", whole, cones[:, :3]) / np.maximum(size, 1e-300)
    half = np.arcsin(np.minimum(cones[:, 3], 1.0)) + np.arccos(np.clip(axis, -1.0, 1.0))
    flat = cones[:, 3] == 0.0
    spread = np.where(flat, 0.0, np.sin(np.minimum(half, 0.5 * math.pi)))
    # A cone of 90 degrees or more decides nothing: no element faces that much.
    size = np.where((half < 0.5 * math.pi) | flat, size, np.inf)
    moment = np.einsum("nka,nkb->nab", points - middle[:, None], areas)
    moment = np.linalg.norm(moment, axis=(1, 2)) / np.maximum(np.linalg.norm(whole, axis=1), 1e-300)
    reaches = np.stack([reach, size, spread, np.where(flat, 0.0, reach), moment])
    return {
        "mean_point": writable(middle.T),
        "mean_area": writable(whole.T),
        "mean_reach": writable(reaches),
        "mean_parts": writable(_strips(areas)),
    }


def _strips(areas: FloatArray) -> FloatArray:
    """Vector areas (n, g, 3) of strips along which those of the points (n, g², 3) vary least."""
    order = math.isqrt(areas.shape[1])
    grid = areas.reshape(len(areas), order, order, 3)
    along_u, along_v = grid.sum(axis=1), grid.sum(axis=2)
    # What points elsewhere adds up to less.
    kept = [np.linalg.norm(strips, axis=2).sum(axis=1) for strips in (along_u, along_v)]
    return np.where((kept[0] > kept[1])[:, None, None], along_u, along_v)


def point_distance(edges: Edges, eps: float) -> FloatArray:
    """Distance (n,) from which one point tells the unoccluded factor of an element. [m]

    With reach r and first moment m of the normals, against the vector area, at distance d, the
    kernel's first derivatives leave 2 m/d and the second ones (r/d)² of a factor
    A/(π d²) <= (r/d)². What is allowed is ``eps`` of the element's own factor, facing and upright,
    and a fortieth of it of the hemisphere as in `kernels.rows.how_to_see`, half for each of both
    terms.
    """
    reach, moment = edges.mean_reach[0], edges.mean_reach[4]
    half = 0.5 * eps
    share = half / 40.0
    by_reach = reach / min(math.sqrt(half), share**0.25, 1.0)
    by_moment = np.maximum(2.0 * moment / half, np.cbrt(2.0 * moment * reach**2 / share))
    return np.asarray(np.maximum(by_reach, by_moment))
