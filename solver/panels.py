"""Panels: the largest flat pieces that facets side by side on one patch make up.

What hides need not be cut where elements end. A rectangle hides as one panel, however fine its
mesh; a cylinder as strips along its axis. Straight lines across a panel part the facets it is
made of.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray, unique_rows

BoolArray = NDArray[np.bool_]

#: Distance from a straight edge or from a plane that counts as none, relative to the panel's size.
STRAIGHT = 1e-9


@dataclass(slots=True, eq=False)
class Panels:
    """Panels over facets; row i of every array is the same panel.

    Attributes
    ----------
    corners : (w, 4) int array
        Vertices, in the order of the facets' corners.
    facet : (w,) int array
        One of its facets.
    grid : (w,) int array
        Number of its grid in the following lists, −1 if it is a facet by itself.
    lines : list of (2, l, 2) int arrays, two a grid
        Vertices at both ends of the lines that part its columns, along v, and its rows, along u.
    cells : list of (nu, nv) int arrays
        Facets in a grid.
    """

    corners: IntArray
    facet: IntArray
    grid: IntArray
    lines: list[tuple[IntArray, IntArray]] = field(default_factory=list)
    cells: list[IntArray] = field(default_factory=list)


def make_panels(
    vertices: FloatArray, corners: IntArray, boxes: FloatArray, unit: IntArray
) -> Panels:
    """Join facets: whole patches where they are flat and straight, else strips along v or u.

    Parameters
    ----------
    vertices : (v, 3) array
        Points. [m]
    corners : (f, 4) int array
        Vertices of each facet: (u0, v0), (u1, v0), (u1, v1), (u0, v1).
    boxes : (f, 4) array
        u0, u1, v0, v1 of each facet in its patch.
    unit : (f,) int array
        What facets must share to be joined: side and patch.
    """
    f = len(corners)
    out, grid = corners.copy(), np.full(f, -1)
    panels = Panels(out, np.arange(f), grid)
    kept, free = np.ones(f, dtype=bool), np.ones(f, dtype=bool)
    units = unit.astype(np.float64)[:, None]
    for keys in (units, np.hstack([units, boxes[:, :2]]), np.hstack([units, boxes[:, 2:]])):
        rows = np.flatnonzero(free)
        if not len(rows):
            break
        group = unique_rows(keys[rows])[1]
        outline, fits = _outlines(vertices, corners[rows], boxes[rows], group)
        for some, across, along, cells in _grids(vertices, corners[rows], boxes[rows], group, fits):
            own = rows[cells]
            first = own.min(axis=(1, 2))
            kept[own], free[own], kept[first] = False, False, True
            out[first] = outline[some]
            grid[first] = len(panels.cells) + np.arange(len(some))
            panels.lines += list(zip(across, along, strict=True))
            panels.cells += list(own)
    panels.corners, panels.facet, panels.grid = out[kept], np.flatnonzero(kept), grid[kept]
    return panels


def _grids(
    vertices: FloatArray, corners: IntArray, boxes: FloatArray, group: IntArray, fits: BoolArray
) -> Iterator[tuple[IntArray, IntArray, IntArray, IntArray]]:
    """Those groups that are grids with straight lines, all of one shape at a time.

    Yields the groups (k,), ends (k, nu − 1, 2) and (k, nv − 1, 2) of their lines along v and along
    u, and their facets (k, nu, nv).
    """
    size = np.bincount(group)
    order = np.lexsort((boxes[:, 2], boxes[:, 0], group))
    start = np.cumsum(size) - size
    u, of = boxes[order, 0], group[order]
    columns = np.bincount(of, np.diff(u, prepend=np.nan) != 0.0, len(size)).astype(np.int64)
    # The first of a group begins a column, though the group before may end with the same u.
    same = (np.diff(u, prepend=np.nan) == 0.0) & (np.diff(of, prepend=-1) != 0)
    columns += np.bincount(of, same, len(size)).astype(np.int64)
    whole = fits & (columns > 0) & (size % np.maximum(columns, 1) == 0)
    shapes = np.stack([columns, size // np.maximum(columns, 1)], axis=1)
    for nu, nv in np.unique(shapes[whole], axis=0):
        some = np.flatnonzero(whole & (shapes == (nu, nv)).all(axis=1))
        cells = order[start[some, None] + np.arange(nu * nv)].reshape(-1, nu, nv)
        u, v, grid = boxes[cells, 0], boxes[cells, 2], corners[cells]
        good = (u == u[:, :, :1]).all(axis=(1, 2)) & (v == v[:, :1]).all(axis=(1, 2))
        # Facets side by side share the corners between them.
        good &= (grid[:, 1:, :, [0, 3]] == grid[:, :-1, :, [1, 2]]).all(axis=(1, 2, 3))
        good &= (grid[:, :, 1:, [0, 1]] == grid[:, :, :-1, [3, 2]]).all(axis=(1, 2, 3))
        points = np.empty((len(some), nu + 1, nv + 1), dtype=np.int64)
        points[:, :-1, :-1], points[:, 1:, :-1] = grid[..., 0], grid[..., 1]
        points[:, -1, -1], points[:, :-1, -1] = grid[:, -1, -1, 2], grid[:, :, -1, 3]
        points[:, 1:, -1] = grid[:, :, -1, 2]
        across, along = points[:, 1:-1], points[:, :, 1:-1].transpose(0, 2, 1)
        good &= _straight(vertices, across) & _straight(vertices, along)
        if good.any():
            yield some[good], across[good][..., [0, -1]], along[good][..., [0, -1]], cells[good]


def _straight(vertices: FloatArray, lines: IntArray) -> BoolArray:
    """Whether all lines (k, l, m) of each of k grids are straight."""
    points = vertices[lines]
    first, along = points[:, :, :1], points[:, :, -1:] - points[:, :, :1]
    off = np.linalg.norm(np.cross(points - first, along), axis=3)
    return np.asarray((off <= STRAIGHT * (along**2).sum(axis=3)).all(axis=(1, 2)))


def _outlines(
    vertices: FloatArray, corners: IntArray, boxes: FloatArray, group: IntArray
) -> tuple[IntArray, BoolArray]:
    """Corners (g, 4) of groups of facets, and which (g,) of them are flat, straight and convex."""
    count = int(group.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, group, boxes[:, ::2])
    np.maximum.at(high, group, boxes[:, 1::2])
    whole = np.bincount(group, minlength=count) > 1
    at_low, at_high = boxes[:, ::2] == low[group], boxes[:, 1::2] == high[group]
    outline = np.full((count, 4), -1)
    # Which ends of u and v each corner is at.
    ends = ((at_low, at_low), (at_high, at_low), (at_high, at_high), (at_low, at_high))
    for k, (u, v) in enumerate(ends):
        here = u[:, 0] & v[:, 1]
        outline[group[here], k] = corners[here, k]
    whole &= (outline >= 0).all(axis=1)
    points = vertices[outline]
    diagonals = points[:, 2] - points[:, 0], points[:, 3] - points[:, 1]
    normal = np.cross(*diagonals)
    size = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(size, 1e-300)[:, None]
    allowed = STRAIGHT * np.maximum(*(np.linalg.norm(d, axis=1) for d in diagonals))
    side = np.roll(points, -1, axis=1) - points
    length = np.linalg.norm(side, axis=2)
    turn = np.einsum("gk,gck->gc", normal, np.cross(np.roll(side, 1, axis=1), side))
    whole &= (size > 0.0) & (turn >= -(allowed[:, None] * length)).all(axis=1)
    inner = vertices[corners]
    off = np.einsum("fk,fck->fc", normal[group], inner - points[group].mean(axis=1)[:, None])
    whole &= _all(group, (np.abs(off) <= allowed[group, None]).all(axis=1), count)
    # Corners of facets at v0, u1, v1 and u0 of the panel lie on its straight edges.
    for k, there in enumerate((at_low[:, 1], at_high[:, 0], at_high[:, 1], at_low[:, 0])):
        start, along = points[group, k], side[group, k]
        square = np.maximum(length[group, k] ** 2, 1e-300)
        for c in (k, (k + 1) % 4):
            to = inner[:, c] - start
            t = np.clip(np.einsum("fk,fk->f", to, along) / square, 0.0, 1.0)
            away = np.linalg.norm(to - t[:, None] * along, axis=1)
            whole &= _all(group, ~there | (away <= allowed[group]), count)
    return outline, whole


def _all(group: IntArray, holds: BoolArray, count: int) -> BoolArray:
    """Of which groups (count,) all members hold."""
    return np.asarray(np.bincount(group, ~holds, count) == 0)


def split_concave(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Facets (k,) with an inward corner, and that corner's number.

    Parameters
    ----------
    points : (f, 4, 3) array
        Corners.
    """
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])
    side = np.roll(points, -1, axis=1) - points
    turn = np.einsum("fk,fck->fc", normal, np.cross(np.roll(side, 1, axis=1), side))
    scale = np.linalg.norm(normal, axis=1)[:, None] * (side**2).sum(axis=2).max(axis=1)[:, None]
    found = np.flatnonzero((turn < -1e-6 * scale).sum(axis=1) == 1)
    return found, np.argmin(turn[found], axis=1)
