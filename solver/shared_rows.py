"""Receivers so near each other that one row of form factors serves for all of them.

What is round or trimmed comes as several small patches in one plane, as the five of a disk. What
they see is the same but for what lies nearer to them than they are large.
"""

from __future__ import annotations

import numpy as np

from .model.arrays import IntArray
from .surfaces import Receivers

#: Normals that differ by less, and planes that do against their distance, count as the same.
FLAT = 1e-6


def shared_rows(receivers: Receivers, solids: IntArray, size: float) -> IntArray:
    """For each of m receivers the one whose row it takes: itself or a neighbour.

    Neighbours are receivers of one node on the same solid and in the same plane, in a square of
    ``size``; all take the row of that nearest to their middle.

    Parameters
    ----------
    receivers : Receivers
        Points on surfaces.
    solids : (m,) int array
        Solid that each lies on.
    size : float
        How far they may be apart. [m]
    """
    row = np.arange(len(solids))
    single = np.flatnonzero((receivers.weights > 0.0).sum(axis=1) == 1)
    if not len(single) or size <= 0.0:
        return row
    at = np.argmax(receivers.weights[single] > 0.0, axis=1)
    x, n = receivers.nodes[single, at], receivers.normals[single, at]
    low = x.min(axis=0)
    span = max(float(np.ptp(x, axis=0).max()), size)
    height = np.einsum("mk,mk->m", n, x - low) / span
    keys = np.concatenate(
        [
            solids[single, None],
            np.round(np.column_stack([n, height]) / FLAT).astype(np.int64),
        ],
        axis=1,
    )
    _, plane = np.unique(keys, axis=0, return_inverse=True)
    plane = plane.ravel()
    corner = np.full((int(plane.max()) + 1, 3), np.inf)
    np.minimum.at(corner, plane, x)
    cell = np.floor((x - corner[plane]) / size).astype(np.int64)
    _, group = np.unique(np.column_stack([plane, cell]), axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group)
    middle = np.stack([np.bincount(group, x[:, k]) / count for k in range(3)], axis=1)
    away = np.linalg.norm(x - middle[group], axis=1)
    order = np.lexsort((single, away, group))
    first = order[np.searchsorted(group[order], np.arange(len(count)))]
    row[single] = single[first[group]]
    return row
