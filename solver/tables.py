"""Facets of elements, as the bulk kernels want them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .kernels.facets import Facets
from .model.arrays import FloatArray, IntArray, unique_rows
from .model.bezier import surface_points
from .model.elements import Elements
from .panels import make_panels, split_concave
from .topology import writable

#: Largest turn of tangent or normal over a facet, and over one of a small element. [rad]
FACET_TURN, SMALL_TURN = math.radians(12.0), math.radians(30.0)
#: Most facets of an element along u or v.
MAX_FACETS = 16
#: Accuracy from which on facets turn by no more than they usually do: what they hide is off by some
#: 1e-3, with the second power of the turn, which no sample tells.
COARSE = 0.03


def _turns(vectors: FloatArray, axis: int) -> FloatArray:
    """Largest total angle [rad] between successive vectors (n, a, b, 3) along one direction."""
    size = np.linalg.norm(vectors, axis=3, keepdims=True)
    scale = size.max(axis=(1, 2), keepdims=True)
    unit = np.where(size > 1e-9 * scale, vectors / np.maximum(size, 1e-300), 0.0)
    step = np.linalg.norm(np.diff(unit, axis=axis), axis=3)
    known = np.take(size[..., 0], range(1, size.shape[axis]), axis=axis) > 0.0
    angle = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * step)) * known
    return np.asarray(angle.sum(axis=axis).max(axis=1))


def facet_turn(accuracy: float) -> float:
    """Largest turn over a facet for an accuracy, as far as `MAX_FACETS` lets it. [rad]"""
    return FACET_TURN * math.sqrt(min(1.0, accuracy / COARSE))


def facet_counts(nets: FloatArray, size: float = 0.0, turn: float = FACET_TURN) -> IntArray:
    """How many facets (n, 2) each element gets along u and v, which turn by ``turn``
    at most where `MAX_FACETS` are enough for it.

    Elements shorter than ``size`` get fewer: facets leave them by no more than they leave one that
    is so long, but where they turn by `SMALL_TURN`. [m]
    """
    counts = np.ones((len(nets), 2), dtype=np.int64)
    rows = np.flatnonzero(~_flat_and_straight(nets))
    counts[rows] = _counts_by_turns(nets[rows], size, turn)
    return counts


def _flat_and_straight(nets: FloatArray) -> NDArray[np.bool_]:
    """Which nets (n,) are evenly spaced along u and v, with equal weights, in a plane."""
    points = nets[..., :3] / nets[..., 3:]
    size = np.abs(points - points[:, :1, :1]).max(axis=(1, 2, 3))
    weights = nets[..., 3]
    straight = np.ptp(weights, axis=(1, 2)) <= 1e-12 * weights.max(axis=(1, 2))
    for axis in (1, 2):
        bend = np.abs(np.diff(points, n=2, axis=axis)).max(axis=(1, 2, 3))
        straight &= bend <= 1e-10 * size
    a, b, c = (points[:, i, j] - points[:, 0, 0] for i, j in ((3, 0), (0, 3), (3, 3)))
    volume = np.abs(np.einsum("nk,nk->n", np.cross(a, b), c))
    return np.asarray(straight & (volume <= 1e-10 * size**3))


def _counts_by_turns(nets: FloatArray, size: float, turn: float) -> IntArray:
    t = np.linspace(0.0, 1.0, 5)
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    _, su, sv = (a.reshape(len(nets), 5, 5, 3) for a in surface_points(nets, u, v))
    normal = np.cross(su, sv)[:, 1:4, 1:4]  # collapsed edges have none
    turn_u = np.maximum(_turns(su, 1), 2.0 * _turns(normal, 1))
    turn_v = np.maximum(_turns(sv, 2), 2.0 * _turns(normal, 2))
    long = [np.linalg.norm(d, axis=3).mean(axis=a).max(axis=1) for d, a in ((su, 1), (sv, 2))]
    # A facet of length s and turn t leaves its element by s t / 8.
    allowed = turn * size / np.maximum(np.stack(long, axis=1), 1e-300)
    allowed = np.clip(allowed, turn, SMALL_TURN)
    counts = np.ceil(np.stack([turn_u, turn_v], axis=1) / allowed - 1e-6)
    return np.asarray(np.clip(counts, 1, MAX_FACETS).astype(np.int64))


def make_facets(
    elements: Elements,
    patch_nets: FloatArray,
    closed: IntArray,
    solid: IntArray,
    size: float = 0.0,
    turn: float = FACET_TURN,
) -> tuple[Facets, FloatArray]:
    """Facets of all elements, and how far (n,) they leave their element. [m]

    Patches that are neither closed nor lit from both sides hide with their backs too: these panels
    belong to no element. Of ``size`` and ``turn`` see `facet_counts`.
    """
    element, boxes = _in_grids(elements, patch_nets, *_facet_boxes(elements, size, turn))
    patch = elements.patch_index[element]
    u, v = boxes[:, [0, 1, 1, 0]], boxes[:, [2, 2, 3, 3]]
    keys = np.stack([np.repeat(patch, 4).astype(np.float64), u.ravel(), v.ravel()], axis=1)
    unique, inverse = unique_rows(keys)
    vertices = surface_points(
        patch_nets[unique[:, 0].astype(np.int64)], unique[:, 1:2], unique[:, 2:3]
    )[0][:, 0]
    corners = inverse.reshape(-1, 4)
    middle = surface_points(
        patch_nets[patch], u.mean(axis=1, keepdims=True), v.mean(axis=1, keepdims=True)
    )[0][:, 0]
    normal, doubled = _facet_normals(vertices[corners])
    # Across the facet only: along it the parameters may run unevenly.
    off = vertices[corners].mean(axis=1) - middle
    sagitta = np.abs(np.einsum("fk,fk->f", normal, off))
    lift = np.zeros(len(elements))
    np.maximum.at(lift, element, np.where(sagitta > 1e-9 * np.sqrt(doubled), sagitta, 0.0))
    halves, pivot = split_concave(vertices[corners])
    if len(halves):
        rows = halves[:, None]
        second = corners[rows, (pivot[:, None] + [0, 2, 3, 3]) % 4]
        corners[halves] = corners[rows, (pivot[:, None] + [0, 1, 2, 2]) % 4]
        corners = np.concatenate([corners, second])
        element, boxes = (np.concatenate([a, a[halves]]) for a in (element, boxes))
        order = np.argsort(element, kind="stable")
        corners, element, boxes = corners[order], element[order], boxes[order]
    return _pack(elements, vertices, corners, element, boxes, closed, solid), lift


def _facet_boxes(elements: Elements, size: float, turn: float) -> tuple[IntArray, FloatArray]:
    """Element (f,) and parameters (f, 4) u0, u1, v0, v1 of every facet, sorted by element."""
    counts = _alike(elements, facet_counts(elements.nets, size, turn))
    boxes, owner = [], []
    for nu, nv in np.unique(counts, axis=0):
        rows = np.flatnonzero((counts == (nu, nv)).all(axis=1))
        a, b = (g.ravel() for g in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
        ends = []
        for low, high, k, m in ((0, 1, a, nu), (2, 3, b, nv)):
            first, last = elements.boxes[rows, low, None], elements.boxes[rows, high, None]
            # The last cut is the edge itself, so that neighbours share it to the bit.
            ends += [
                np.where(k + s == m, last, first + (last - first) * (k + s) / m) for s in (0, 1)
            ]
        boxes.append(np.stack(ends, axis=2).reshape(-1, 4))
        owner.append(np.repeat(rows, len(a)))
    element = np.concatenate(owner)
    order = np.argsort(element, kind="stable")
    return element[order], np.concatenate(boxes)[order]


def _alike(elements: Elements, counts: IntArray) -> IntArray:
    """Counts (n, 2) that agree along u in each column of elements, and along v in each row.

    Facets on both sides of a curved line would overlap in slivers, and hide each other, if they
    parted it at different places.
    """
    out = counts.copy()
    side = np.stack([elements.patch_index, elements.side], axis=1)
    for axis in (0, 1):
        own = np.column_stack([side, elements.boxes[:, 2 * axis : 2 * axis + 2]])
        of = unique_rows(own)[1]
        most = np.zeros(int(of.max(initial=-1)) + 1, dtype=np.int64)
        np.maximum.at(most, of, counts[:, axis])
        out[:, axis] = most[of]
    return out


def _in_grids(
    elements: Elements, patch_nets: FloatArray, element: IntArray, boxes: FloatArray
) -> tuple[IntArray, FloatArray]:
    """The same facets, cut along all lines of their side where it is flat and straight.

    There they then make up one panel with a grid, several cells of which may belong to an element,
    however unlike the elements are.
    """
    key = elements.patch_index[element] * 2 + elements.side[element]
    sides, first, count = np.unique(key, return_index=True, return_counts=True)
    straight = _flat_and_straight(patch_nets[sides // 2])
    owner, cut = [element], [boxes]
    kept = np.ones(len(element), dtype=bool)
    for k in np.flatnonzero(straight & (count > 1)):
        rows = slice(first[k], first[k] + count[k])
        u, v = (np.unique(boxes[rows, at : at + 2]) for at in (0, 2))
        if count[k] == (len(u) - 1) * (len(v) - 1):
            continue
        kept[rows] = False
        ends = [
            np.searchsorted(line, boxes[rows, at]) for line, at in ((u, 0), (u, 1), (v, 2), (v, 3))
        ]
        own = np.empty((len(u) - 1, len(v) - 1), dtype=np.int64)
        for e, i0, i1, j0, j1 in zip(element[rows], *ends, strict=True):
            own[i0:i1, j0:j1] = e
        i, j = (g.ravel() for g in np.indices(own.shape))
        owner.append(own.ravel())
        cut.append(np.stack([u[i], u[i + 1], v[j], v[j + 1]], axis=1))
    owner[0], cut[0] = element[kept], boxes[kept]
    element, boxes = np.concatenate(owner), np.concatenate(cut)
    order = np.argsort(element, kind="stable")
    return element[order], boxes[order]


def _pack(
    elements: Elements,
    vertices: FloatArray,
    corners: IntArray,
    element: IntArray,
    boxes: FloatArray,
    closed: IntArray,
    solid: IntArray,
) -> Facets:
    """Panels over the facets, their backs where those hide, and the grids of joined panels."""
    key = elements.patch_index * 2 + elements.side
    units = np.unique(key)
    unit = np.searchsorted(units, key[element])
    found = make_panels(vertices, corners, boxes, unit)
    of = unit[found.facet]
    patch, turned = units[of] // 2, units[of] % 2 == 1
    back = np.flatnonzero(~(closed[patch] | np.isin(2 * patch + 1, units)))
    outline = np.where(turned[:, None], found.corners[:, ::-1], found.corners)
    outline = np.concatenate([outline, outline[back][:, ::-1]])
    owner = np.where(found.grid < 0, element[found.facet], -1)
    points = vertices[outline]
    normal, size = _facet_normals(points)
    offset = np.einsum("fk,fk->f", normal, points.mean(axis=1))
    # What has no area is met by nothing: its plane is turned away from everywhere.
    normal[size == 0.0], offset[size == 0.0] = 0.0, np.inf
    used, outline = np.unique(outline, return_inverse=True)
    outline = outline.reshape(-1, 4)
    start = np.searchsorted(
        np.append(of, np.full(len(back), len(units))), np.arange(len(units) + 2)
    )
    joined = np.flatnonzero(found.grid >= 0)
    ends = [found.lines[g] for g in found.grid[joined]]
    sizes = np.zeros((len(joined), 4), dtype=np.int64)
    sizes[:, :2] = np.reshape([found.cells[g].shape for g in found.grid[joined]], (-1, 2))
    sizes[1:, 2] = np.cumsum((sizes[:, 0] - 1) + (sizes[:, 1] - 1))[:-1]
    sizes[1:, 3] = np.cumsum(sizes[:, 0] * sizes[:, 1])[:-1]
    no_backs = np.full(len(back), -1)
    return Facets(
        panel_points=writable(vertices[used].T),
        panel_corners=writable(outline, np.int64),
        panel_planes=writable(np.concatenate([normal, offset[:, None]], axis=1).T),
        panel_element=writable(np.append(owner, no_backs), np.int64),
        panel_solid=writable(solid[np.append(patch, patch[back])], np.int64),
        panel_grid=writable(np.append(_numbered(found.grid), no_backs), np.int64),
        unit_ranges=writable(np.stack([start[:-1], start[1:]], axis=1), np.int64),
        unit_points=_ends(outline, start[:-1]),
        unit_joined=np.bincount(of, found.grid >= 0, len(units)) > 0,
        grid_size=sizes,
        grid_lines=writable(_directed(vertices, ends, turned[joined])),
        grid_element=writable(
            np.concatenate(
                [np.empty(0, np.int64)]
                + [element[found.cells[g]].ravel() for g in found.grid[joined]]
            ),
            np.int64,
        ),
        **_no_sights(len(elements)),
    )


def _ends(outline: IntArray, start: IntArray) -> IntArray:
    """First and end (g, 2) of the points of runs of panels (p, 4), parted at ``start`` (g + 1,)."""
    own = outline[: start[-1]]
    low = np.minimum.reduceat(own.min(axis=1), start[:-1])
    high = np.maximum.reduceat(own.max(axis=1), start[:-1])
    return np.stack([low, high + 1], axis=1)


def _numbered(grid: IntArray) -> IntArray:
    """Rows in the order they come, −1 where there is none."""
    return np.where(grid >= 0, np.cumsum(grid >= 0) - 1, -1)


def _directed(
    vertices: FloatArray, grids: list[tuple[IntArray, IntArray]], turned: NDArray[np.bool_]
) -> FloatArray:
    """A point and a direction (l, 2, 3) of the lines along v, then along u, of all grids.

    Seen from the front, what follows in the grid is where (point − x) × direction points to.
    """
    none = np.empty((0, 2), dtype=np.int64)
    ends = np.concatenate([none] + [own for grid in grids for own in grid])
    # Columns follow each other to the right of v, rows to the left of u, about u × v.
    sign = np.array([[1.0, -1.0]]) * np.where(turned, -1.0, 1.0)[:, None]
    counts = np.reshape([[len(own) for own in grid] for grid in grids], (-1, 2)).astype(np.int64)
    first, last = vertices[ends[:, 0]], vertices[ends[:, 1]]
    towards = np.repeat(sign.ravel(), counts.ravel())[:, None]
    return np.stack([first, (last - first) * towards], axis=1)


def _facet_normals(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (f, 3) of facets with corners (f, 4, 3), and twice their areas. [m²]"""
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    size = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(size, 1e-300)[:, None], size


def no_facets() -> Facets:
    """Facets of nothing, for sources whose pairs are all traced."""
    none = np.empty(0, dtype=np.int64)
    return Facets(
        panel_points=np.empty((3, 0)),
        panel_corners=none.reshape(0, 4),
        panel_planes=np.empty((4, 0)),
        panel_element=none,
        panel_solid=none,
        panel_grid=none,
        unit_ranges=none.reshape(0, 2),
        unit_points=none.reshape(0, 2),
        unit_joined=none.astype(bool),
        grid_size=none.reshape(0, 4),
        grid_lines=np.empty((0, 2, 3)),
        grid_element=none,
        **_no_sights(0),
    )


def _no_sights(elements: int) -> dict[str, np.ndarray]:
    return {
        "sight_units": np.empty(0, dtype=np.int64),
        "sight_clusters": np.empty((0, 2), dtype=np.int64),
        "sight_spheres": np.empty((0, 4)),
        "sight_start": np.zeros(elements + 1, dtype=np.int64),
        "sight_points": np.empty((3, 0)),
        "sight_areas": np.empty((3, 0)),
    }


def meridians(lines: int) -> FloatArray:
    """Cosine and sine (lines, 2) of equal azimuths."""
    angle = 2.0 * np.pi * np.arange(lines) / max(lines, 1)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
