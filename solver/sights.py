"""Points of bright elements, to which lines of sight tell their visible shares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernels.facets import Facets
from .kernels.nets import CONVEX, PLANAR
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .topology import shape_flags, writable

#: Steps of the points in u and v: 1/φ and 1/φ², φ³ = φ + 1, so that a straight edge of a shadow
#: finds them evenly spread, however it runs.
STEPS = (0.7548776662466927, 0.5698402909980532)
#: Fewest points of an element.
LEAST = 4


def with_sights(
    facets: Facets, elements: Elements, solid: IntArray, bright: NDArray[np.bool_], count: int
) -> Facets:
    """The same facets with ``count`` points on the ``bright`` elements of each solid.

    Parameters
    ----------
    facets : Facets
        Of the elements.
    elements : Elements
        n elements.
    solid : (p,) int array
        Solid of each patch.
    bright : (n,) bool array
        Which of them. Sides that are neither flat nor convex are left out: they may hide parts of
        themselves.
    count : int
        Points, spread over the elements.
    """
    key = elements.patch_index * 2 + elements.side
    units, unit = np.unique(key, return_inverse=True)
    size = np.bincount(unit)
    rows = np.flatnonzero(bright)
    fits = np.zeros(len(elements), dtype=bool)
    fits[rows] = (shape_flags(elements.nets[rows]) & (PLANAR | CONVEX)) != 0
    found = np.flatnonzero(np.bincount(unit, fits) == size)
    each = np.zeros(len(elements), dtype=np.int64)
    rows = np.flatnonzero(np.isin(unit, found))
    body = solid[elements.patch_index[rows]]
    each[rows] = np.maximum(-(-count // np.bincount(body)[body]), LEAST)
    start = np.concatenate([[0], np.cumsum(each)])
    points, areas = np.empty((2, 3, start[-1]))
    for number in np.unique(each[rows]):
        own = rows[each[rows] == number]
        place = start[own][:, None] + np.arange(number)
        # Every element goes on with the sequence where the one before it stopped.
        u, v = ((place + 0.5) * step % 1.0 for step in STEPS)
        at, su, sv = surface_points(elements.nets[own], u, v)
        points[:, place] = at.transpose(2, 0, 1)
        areas[:, place] = np.cross(su, sv).transpose(2, 0, 1) / number
    body = solid[units[found] // 2]
    first = np.flatnonzero(np.diff(body, prepend=-1))
    clusters = np.stack([first, np.append(first[1:], len(found))[: len(first)]], axis=1)
    ends = np.stack(
        [
            np.searchsorted(unit, found[clusters[:, 0]]),
            np.searchsorted(unit, found[clusters[:, 1] - 1], side="right"),
        ],
        axis=1,
    )
    return facets._replace(
        sight_units=writable(found, np.int64),
        sight_clusters=writable(clusters, np.int64),
        sight_spheres=_spheres(elements.nets, ends),
        sight_start=writable(start, np.int64),
        sight_points=writable(points),
        sight_areas=writable(areas),
    )


def _spheres(nets: FloatArray, ends: IntArray) -> FloatArray:
    """Spheres (c, 4) about the control points of the elements of some ranges (c, 2)."""
    out = np.empty((len(ends), 4))
    for sphere, (first, end) in zip(out, ends, strict=True):
        points = (nets[first:end, ..., :3] / nets[first:end, ..., 3:]).reshape(-1, 3)
        sphere[:3] = 0.5 * (points.min(axis=0) + points.max(axis=0))
        sphere[3] = np.linalg.norm(points - sphere[:3], axis=1).max()
    return out


def unsighted(sources: Sources) -> Sources:
    """The same without lines of sight: bright elements are seen along meridians as all others."""
    return sources._replace(
        sight_units=sources.sight_units[:0], sight_clusters=sources.sight_clusters[:0]
    )
