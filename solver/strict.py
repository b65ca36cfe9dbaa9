"""Strict form factors: proved brackets from `kernels.brackets`."""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .feet import normals_under
from .model.arrays import FloatArray, IntArray
from .model.form_factors import FormFactors
from .surfaces import Receivers

if TYPE_CHECKING:
    from .exchange import Rows
    from .kernels.pieces import Surfaces
    from .kernels.pyramid import Blockers
    from .kernels.rows import Sources

#: Cells that one pair of point and patch may take.
MOST_CELLS = 150_000

#: Whether a side of a patch runs counter-clockwise (1) as its parameter grows, or not (−1).
_TURN = (1, 1, -1, -1)


def strict_form_factors(
    receivers: Receivers,
    sources: Sources,
    blockers: Blockers,
    plain: Rows,
    accuracy: float,
    *,
    wanted: NDArray[np.bool_] | None = None,
    hide: bool = True,
    most_cells: int = MOST_CELLS,
) -> FormFactors:
    """Brackets no wider than ``accuracy`` times the factor without hiding, or 1e-12.

    Parameters
    ----------
    receivers : Receivers
        m points of one node each, of share 0 where they get no light, and the surface each lies
        on, −1 for none.
    sources, blockers
        Sources and all distinct surfaces; ``sources.group[:, 2]`` names the surface of each.
    plain : Rows
        Factors without hiding.
    accuracy : float
        Relative width of a bracket.
    wanted : (m, n) bool array, optional
        Pairs whose brackets are asked for; those of others are as the first look leaves them.
    hide : bool
        False ignores all hiding: what is left to bracket are silhouettes of the sources, and the
        value is that of ``plain`` if it lies in the bracket.
    most_cells : int
        Cells one pair may take; its bracket is wider when they do not suffice.
    """
    from .kernels.brackets import LEFT, SKIPPED, TRACED, VISITED, WHOLE, bracket_rows
    from .topology import writable

    x, n = receivers.nodes[:, 0], receivers.normals[:, 0]
    surfaces = see_through(blockers)
    tangents, centers = tangent_planes(sources.nets)
    goals = np.maximum(accuracy * plain.factors, 1e-12)
    if wanted is not None:
        goals = np.where(wanted, goals, np.inf)
    under, views = touched(x, n, receivers.patches, surfaces)
    shape = plain.factors.shape
    low, high = np.zeros(shape), np.zeros(shape)
    counters = np.zeros((len(x), 5), dtype=np.int64)
    bracket_rows(
        writable(x),
        writable(n * receivers.weights),
        writable(under, np.int64),
        views,
        sources.nets,
        sources.flags,
        writable(sources.group[:, 2], np.int64),
        tangents,
        centers,
        goals,
        surfaces,
        int(surfaces.sheet.max()) + 1,
        hide,
        most_cells,
        low,
        high,
        counters,
    )
    total = counters.sum(axis=0)
    names = {
        "pairs_not_seen": SKIPPED,
        "pairs_without_blocker": WHOLE,
        "pairs_traced": TRACED,
        "pyramid_cells": VISITED,
        "cells_left": LEFT,
    }
    value = 0.5 * (low + high) if hide else np.clip(plain.factors, low, high)
    return FormFactors(value, low, high, True, {name: int(total[c]) for name, c in names.items()})


def touched(
    x: FloatArray, n: FloatArray, on: IntArray, surfaces: Surfaces
) -> tuple[IntArray, IntArray]:
    """Hollow and bulging surfaces that receivers (m,) lie on, and how the receivers look from each.

    ``on`` names one of them; on a seam and in a corner there are more.

    Returns
    -------
    rows : (m, 5) int array
        ``on``, then those of its neighbours that a receiver lies on too; −1 for none.
    views : (m, 5) int array
        `kernels.brackets.AWAY`, `ALONG` or `ASKEW`; 1e-7 of a turn askew shows or hides 1e-14 of a
        surface.
    """
    from .kernels.brackets import ALONG, ASKEW, AWAY
    from .kernels.nets import CONCAVE, CONVEX
    from .topology import bounding_spheres

    beside = np.where(on[:, None] >= 0, surfaces.neighbors[on, :, 0], -1)
    # A collapsed side has no neighbour either, and says so by another number.
    rows = np.concatenate([on[:, None], np.maximum(beside, -1)], axis=1)
    for k in range(1, 5):  # a closed surface of one or two patches is beside itself
        rows[(rows[:, :k] == rows[:, k, None]).any(axis=1), k] = -1
    bent = (rows >= 0) & ((surfaces.flags[rows] & (CONVEX | CONCAVE)) != 0)
    views = np.full(rows.shape, ASKEW, dtype=np.int64)
    i, column = np.nonzero(bent)
    own = rows[i, column]
    normal, gap = normals_under(x[i], surfaces.nets[own])
    away = (column > 0) & (gap > 1e-9 * bounding_spheres(surfaces.nets)[own, 3])
    hollow = np.where(surfaces.flags[own] & CONCAVE, 1.0, -1.0)
    askew = np.linalg.norm(np.cross(normal, n[i]), axis=1)
    along = hollow * np.einsum("mk,mk->m", normal, n[i])
    square = (askew <= 1e-7) & (along != 0.0)
    views[i[square], column[square]] = np.where(along[square] > 0.0, ALONG, AWAY)
    rows[i[away], column[away]] = -1
    rows[:, 1:][~bent[:, 1:]] = -1
    return rows, views


def see_through(blockers: Blockers, bent: NDArray[np.bool_] | None = None) -> Surfaces:
    """What kernels need to know of the surfaces; tangent planes of the ``bent`` (p,) only."""
    from .kernels.pieces import Surfaces
    from .topology import writable

    count = len(blockers.nets)
    tangents, centers = np.zeros((count, 9, 9, 4)), np.zeros((count, 3))
    bent = np.ones(count, dtype=bool) if bent is None else bent
    if bent.any():
        tangents[bent], centers[bent] = tangent_planes(blockers.nets[bent])
    return Surfaces(
        nets=blockers.nets,
        kinds=blockers.kinds,
        tangents=tangents,
        centers=centers,
        neighbors=neighbors(blockers.nets, blockers.adjacent),
        sheet=writable(blockers.solid, np.int64),
        flags=blockers.flags,
    )


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Product of polynomials (p, i, j) in scaled Bernstein form."""
    out = np.zeros((len(a), a.shape[1] + b.shape[1] - 1, a.shape[2] + b.shape[2] - 1))
    for i in range(a.shape[1]):
        for j in range(a.shape[2]):
            out[:, i : i + b.shape[1], j : j + b.shape[2]] += a[:, i, j, None, None] * b
    return out


def _binomials(degree: int) -> FloatArray:
    return np.array([comb(degree, k) for k in range(degree + 1)], dtype=np.float64)


def tangent_planes(nets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bernstein coefficients (n, 9, 9, 4) of the tangent planes of nets, about ``centers`` (n, 3).

    The plane at (u, v) is the set of points (x, 1) with −det(P, P_u, P_v, (x, 1)) = 0, P being
    homogeneous; its value is positive on the + side [1, sec. 14.6 and 15.2]. Coefficients are
    scaled to a largest one of 1, x in metres.

    References
    ----------
    .. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002.
    """
    points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
    centers = 0.5 * (points.min(axis=1) + points.max(axis=1))
    h = nets / nets[..., 3:].max(axis=(1, 2))[:, None, None]
    h[..., :3] -= centers[:, None, None] * h[..., 3:]
    b2, b3, b8 = _binomials(2), _binomials(3), _binomials(8)
    p = h * (b3[:, None] * b3)[..., None]
    pu = np.diff(h, axis=1) * (b2[:, None] * b3)[..., None]
    pv = np.diff(h, axis=2) * (b3[:, None] * b2)[..., None]

    def minor(a: int, b: int) -> FloatArray:
        return _product(pu[..., a], pv[..., b]) - _product(pu[..., b], pv[..., a])

    planes = np.empty((len(nets), 9, 9, 4))
    for k in range(4):
        a, b, c = (i for i in range(4) if i != k)
        det = (
            _product(p[..., a], minor(b, c))
            - _product(p[..., b], minor(a, c))
            + _product(p[..., c], minor(a, b))
        )
        # Cofactor of the last row, (−1)^(3+k), and the sign of the definition.
        planes[..., k] = det * (1.0 if k % 2 == 0 else -1.0) / (b8[:, None] * b8)
    size = np.abs(planes).max(axis=(1, 2, 3), keepdims=True)
    return planes / np.where(size > 0.0, size, 1.0), centers


def neighbors(nets: FloatArray, adjacent: IntArray) -> IntArray:
    """What lies beyond each side of each patch: (n, 4, 4) as in `kernels.pieces.Surfaces`."""
    from .kernels.pieces import COLLAPSED, FREE
    from .topology import NARROW, edge_points

    n = len(nets)
    out = np.full((n, 4, 4), FREE, dtype=np.int64)
    edges = edge_points(nets)
    extent = np.ptp(edges.reshape(n, -1, 3), axis=1).max(axis=1)
    point = np.abs(edges - edges[:, :, :1]).max(axis=(2, 3)) <= 1e-12 * extent[:, None]
    out[point, 0] = COLLAPSED
    a, side = np.nonzero(~point & (adjacent >= 0))
    b, own = adjacent[a, side], edges[a, side, None]
    same = np.abs(edges[b] - own).max(axis=(2, 3))
    turned = np.abs(edges[b] - own[:, :, ::-1]).max(axis=(2, 3))
    itself = b == a  # a patch that closes on itself: not with this side
    same[itself, side[itself]] = np.inf
    rows = np.arange(len(a))
    k = np.argmin(np.minimum(same, turned), axis=1)
    same, turned = same[rows, k], turned[rows, k]
    # Edges count as one within a share of the whole set: wider than a patch can be.
    across, own = edges[a, (side + 2) % 4], own[:, 0]
    width = np.minimum(
        np.abs(across - own).max(axis=(1, 2)), np.abs(across[:, ::-1] - own).max(axis=(1, 2))
    )
    reverse = turned < same
    # Neighbours of one orientation run through their edge in opposite directions.
    ways = np.array(_TURN)
    consistent = ways[side] * ways[k] * np.where(reverse, -1, 1) < 0
    met = np.minimum(same, turned) <= NARROW * width
    found = np.stack([b, k, reverse, np.where(consistent, 1, -1)], axis=1)
    out[a[met], side[met]] = found[met]
    return out
