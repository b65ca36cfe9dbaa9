"""Borders of elements at the heights where the light from outside has kinks.

A point of a wall above the sill of an opening sees less of the sky than one below it: what shows
below its horizon is the ground, or dark. At the heights of sills and heads, of all horizontal
straight edges past which light comes in, illuminance of vertical surfaces has a kink. Borders of
elements that lie near such a height are moved to it; where none does, boxes are cut there.
"""

from __future__ import annotations

import numpy as np

from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray

#: Heights in one scene: those with the longest edges.
MOST = 8
#: Share of a box that a cut leaves at least on both sides.
LEAST = 0.1
#: Differences of height that are none, relative to the scene's coordinates.
_LEVEL = 1e-9


def kink_heights(blockers: Blockers) -> FloatArray:
    """Heights (k,) of horizontal straight free edges of flat patches, in order. [m]

    Beside a free edge nothing goes on, so that light may pass it.
    """
    nets = blockers.nets
    sides = np.stack([nets[:, :, 0], nets[:, 3, :], nets[:, :, 3], nets[:, 0, :]], axis=1)
    points = sides[..., :3] / sides[..., 3:]
    level = _LEVEL * float(np.abs(points).max())
    z = points[..., 2]
    is_level = np.ptp(z, axis=2) <= level
    free = (blockers.adjacent < 0) & is_level & (blockers.flags & PLANAR != 0)[:, None]
    length = np.linalg.norm(points[:, :, 3] - points[:, :, 0], axis=-1)[free]
    rows = np.round(z[..., 0][free] / max(level, 1e-300)).astype(np.int64)
    heights, at = np.unique(rows, return_inverse=True)
    total = np.bincount(at, weights=length, minlength=len(heights))
    longest = np.argsort(-total, kind="stable")[:MOST]
    return np.asarray(np.sort(heights[longest] * level))


def upright_axes(nets: FloatArray) -> tuple[IntArray, FloatArray]:
    """Parameter (p,) along which flat upright patches rise, and heights (p, 2) of both ends. [m]

    −1 for others: the height must be a linear function of one parameter alone.
    """
    z, w = nets[..., 2] / nets[..., 3], nets[..., 3]
    level = _LEVEL * float(np.abs(nets[..., :3] / w[..., None]).max())
    plain = (np.abs(w - w[:, :1, :1]) <= 1e-12 * w).all(axis=(1, 2))
    third = np.arange(4) / 3.0
    axis, ends = np.full(len(nets), -1), np.zeros((len(nets), 2))
    for k in (0, 1):
        along = np.moveaxis(z, 1 + k, 2)  # (p, other, along)
        low, high = along[:, :1, :1], along[:, :1, 3:]
        linear = np.abs(along - (low + (high - low) * third)).max(axis=(1, 2)) <= level
        fits = plain & linear & (np.abs(high - low)[:, 0, 0] > 10.0 * level)
        axis[fits] = k
        ends[fits] = np.stack([low[fits, 0, 0], high[fits, 0, 0]], axis=1)
    return axis, ends


def with_lines(boxes: Boxes, blockers: Blockers, most: int) -> Boxes:
    """Regular ``boxes`` with borders at the heights of kinks; no more than ``most`` boxes."""
    heights = kink_heights(blockers)
    if not len(heights):
        return boxes
    # Nothing but flat patches has upright straight parameters.
    axis, reach = upright_axes(blockers.nets)
    axis[blockers.flags & PLANAR == 0] = -1
    ends = boxes.ends.copy()
    cuts: list[tuple[int, float]] = []
    for p in np.flatnonzero(axis >= 0).tolist():
        places = (heights - reach[p, 0]) / (reach[p, 1] - reach[p, 0])
        places = np.sort(places[(places > 1e-6) & (places < 1.0 - 1e-6)])
        if not len(places):
            continue
        rows, columns = np.flatnonzero(boxes.patch == p), 2 * axis[p] + np.arange(2)
        own = ends[np.ix_(rows, columns)]
        lines = np.unique(own)
        free = np.ones(len(lines), dtype=bool)
        free[[0, -1]] = False
        for place in places:
            half = 0.5 * float(np.diff(lines).max())
            away = np.where(free, np.abs(lines - place), np.inf)
            near = int(np.argmin(away))
            if away[near] <= half and lines[near - 1] < place < lines[near + 1]:
                own[own == lines[near]] = place
                lines[near], free[near] = place, False
            else:
                cuts.append((p, float(place)))
        ends[np.ix_(rows, columns)] = own
    moved = Boxes(boxes.patch, boxes.side, ends)
    for p, place in cuts:
        column = int(2 * axis[p])
        low, high = moved.ends[:, column], moved.ends[:, column + 1]
        share = (place - low) / (high - low)
        rows = np.flatnonzero((moved.patch == p) & (share > LEAST) & (share < 1.0 - LEAST))
        if not len(rows) or len(moved) + len(rows) > most:
            continue
        parts = moved.take(rows).cut(np.full(len(rows), axis[p]), share[rows])
        moved = moved.take(np.setdiff1d(np.arange(len(moved)), rows)).joined(parts)[0]
    return moved
