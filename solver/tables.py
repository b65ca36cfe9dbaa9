"""Edges and facets of elements, as the bulk kernels want them."""

from __future__ import annotations

import math

import numpy as np

from .kernels.edges import Edges
from .kernels.meridian import Facets
from .model.arrays import FloatArray, IntArray
from .model.bezier import gauss_rule, surface_points
from .model.elements import Elements
from .topology import writable

#: Gauss nodes on an edge, and along u and v inside an element.
EDGE_NODES = 4
#: Largest turn of tangent or normal over a facet. [rad]
FACET_TURN = math.radians(12.0)
#: Most facets of an element along u or v.
MAX_FACETS = 8


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
    nets: FloatArray, patch_nets: FloatArray, patch: IntArray, boxes: FloatArray, side: IntArray
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
    """
    n = len(nets)
    u0, u1, v0, v1 = boxes.T
    patch = patch.astype(np.float64)
    along_u, along_v = np.zeros(n), np.ones(n)
    # Direction, patch, fixed parameter, first and last of the running one.
    keys = np.stack(
        [
            np.stack([along_u, patch, v0, u0, u1], axis=1),
            np.stack([along_v, patch, u1, v0, v1], axis=1),
            np.stack([along_u, patch, v1, u0, u1], axis=1),
            np.stack([along_v, patch, u0, v0, v1], axis=1),
        ],
        axis=1,
    ).reshape(-1, 5)
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    origin = (nets[..., :3] / nets[..., 3:]).reshape(-1, 3).mean(axis=0)
    rule, weight = gauss_rule(EDGE_NODES)
    length = (unique[:, 4] - unique[:, 3])[:, None]
    running = unique[:, 3:4] + length * rule
    fixed = np.repeat(unique[:, 2:3], EDGE_NODES, axis=1)
    is_v = unique[:, :1] == 1.0
    point, su, sv = surface_points(
        patch_nets[unique[:, 1].astype(np.int64)],
        np.where(is_v, fixed, running),
        np.where(is_v, running, fixed),
    )
    tangent = np.where(is_v[:, :, None], sv, su) * (length * weight)[:, :, None]
    point = point - origin
    moment = np.cross(point, tangent)
    u, v = (
        np.broadcast_to(g.ravel(), (n, EDGE_NODES**2))
        for g in np.meshgrid(rule, rule, indexing="ij")
    )
    inside, su, sv = surface_points(nets, u, v)
    area = np.cross(su, sv) * np.outer(weight, weight).ravel()[:, None]
    return Edges(
        edge_origin=writable(origin),
        edge_point=writable(point.transpose(2, 1, 0)),
        edge_tangent=writable(tangent.transpose(2, 1, 0)),
        edge_moment=writable(moment.transpose(2, 1, 0)),
        edge_of=writable(inverse.reshape(n, 4), np.int64),
        edge_sign=writable(1.0 - 2.0 * side),
        area_point=writable(inside - origin),
        area_normal=writable(area),
    )


def _turns(vectors: FloatArray, axis: int) -> FloatArray:
    """Largest total angle [rad] between successive vectors (n, a, b, 3) along one direction."""
    size = np.linalg.norm(vectors, axis=3, keepdims=True)
    scale = size.max(axis=(1, 2), keepdims=True)
    unit = np.where(size > 1e-9 * scale, vectors / np.maximum(size, 1e-300), 0.0)
    step = np.linalg.norm(np.diff(unit, axis=axis), axis=3)
    known = np.take(size[..., 0], range(1, size.shape[axis]), axis=axis) > 0.0
    angle = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * step)) * known
    return np.asarray(angle.sum(axis=axis).max(axis=1))


def facet_counts(nets: FloatArray) -> IntArray:
    """How many facets (n, 2) each element gets along u and v."""
    t = np.linspace(0.0, 1.0, 5)
    u, v = (np.broadcast_to(g.ravel(), (len(nets), 25)) for g in np.meshgrid(t, t, indexing="ij"))
    _, su, sv = (a.reshape(len(nets), 5, 5, 3) for a in surface_points(nets, u, v))
    normal = np.cross(su, sv)[:, 1:4, 1:4]  # collapsed edges have none
    turn_u = np.maximum(_turns(su, 1), 2.0 * _turns(normal, 1))
    turn_v = np.maximum(_turns(sv, 2), 2.0 * _turns(normal, 2))
    counts = np.ceil(np.stack([turn_u, turn_v], axis=1) / FACET_TURN - 1e-6)
    return np.asarray(np.clip(counts, 1, MAX_FACETS).astype(np.int64))


def make_facets(
    elements: Elements, patch_nets: FloatArray, closed: IntArray, solid: IntArray
) -> tuple[Facets, FloatArray]:
    """Facets of all elements, and how far (n,) they leave their element. [m]

    Patches that are neither closed nor lit from both sides hide with their backs too: these facets
    belong to no element.
    """
    n = len(elements)
    counts = facet_counts(elements.nets)
    corners_u, corners_v, owner, turned = [], [], [], []
    lit_behind = np.zeros(len(patch_nets), dtype=bool)
    lit_behind[elements.patch_index[elements.side == 1]] = True
    back_hides = ~(closed | lit_behind)[elements.patch_index]
    for nu, nv in np.unique(counts, axis=0):
        rows = np.flatnonzero((counts == (nu, nv)).all(axis=1))
        a, b = (g.ravel() for g in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
        ends = []
        for low, high, k, m in ((0, 1, a, nu), (2, 3, b, nv)):
            first, last = elements.boxes[rows, low, None], elements.boxes[rows, high, None]
            # The last cut is the edge itself, so that neighbours share it to the bit.
            ends.append(
                [np.where(k + s == m, last, first + (last - first) * (k + s) / m) for s in (0, 1)]
            )
        (ua, ub), (va, vb) = ends
        corners_u.append(np.stack([ua, ub, ub, ua], axis=2).reshape(-1, 4))
        corners_v.append(np.stack([va, va, vb, vb], axis=2).reshape(-1, 4))
        owner.append(np.repeat(rows, len(a)))
        turned.append(np.repeat(elements.side[rows] == 1, len(a)))
    u, v = np.concatenate(corners_u), np.concatenate(corners_v)
    element, flip = np.concatenate(owner), np.concatenate(turned)
    patch = elements.patch_index[element]
    keys = np.stack([np.repeat(patch, 4).astype(np.float64), u.ravel(), v.ravel()], axis=1)
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    vertices = surface_points(
        patch_nets[unique[:, 0].astype(np.int64)], unique[:, 1:2], unique[:, 2:3]
    )[0][:, 0]
    corners = inverse.reshape(-1, 4)
    middle = surface_points(
        patch_nets[patch], u.mean(axis=1, keepdims=True), v.mean(axis=1, keepdims=True)
    )[0][:, 0]
    corners[flip] = corners[flip][:, ::-1]
    points = vertices[corners]
    normal, size = _facet_normals(points)
    # Across the facet only: along it the parameters may run unevenly.
    sagitta = np.abs(np.einsum("fk,fk->f", normal, points.mean(axis=1) - middle))
    lift = np.zeros(n)
    np.maximum.at(lift, element, np.where(sagitta > 1e-9 * np.sqrt(size), sagitta, 0.0))
    back = np.flatnonzero(back_hides[element])
    corners = np.concatenate([corners, corners[back][:, ::-1]])
    owners = np.concatenate([element, np.full(len(back), -1)])
    solids = solid[np.concatenate([patch, patch[back]])]
    points = vertices[corners]
    normal, size = _facet_normals(points)
    good = size > 0.0
    normal = normal[good]
    offset = np.einsum("fk,fk->f", normal, points[good].mean(axis=1))
    facets = Facets(
        facet_vertices=writable(vertices),
        facet_corners=writable(corners[good], np.int64),
        facet_planes=writable(np.concatenate([normal, offset[:, None]], axis=1)),
        facet_element=writable(owners[good], np.int64),
        facet_solid=writable(solids[good], np.int64),
    )
    return facets, lift


def _facet_normals(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (f, 3) of facets with corners (f, 4, 3), and twice their areas. [m²]"""
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    size = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(size, 1e-300)[:, None], size


def no_facets() -> Facets:
    """Facets of nothing, for sources whose pairs are all traced."""
    return Facets(
        facet_vertices=np.empty((0, 3)),
        facet_corners=np.empty((0, 4), dtype=np.int64),
        facet_planes=np.empty((0, 4)),
        facet_element=np.empty(0, dtype=np.int64),
        facet_solid=np.empty(0, dtype=np.int64),
    )


def meridians(lines: int) -> FloatArray:
    """Cosine and sine (lines, 2) of equal azimuths."""
    angle = 2.0 * np.pi * np.arange(lines) / max(lines, 1)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
