"""Parameter boxes on lamps whose exitance varies over them."""

from __future__ import annotations

import numpy as np

from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData

#: Pieces a direction of each patch of an uneven lamp where its light is told roughly.
ROUGHLY = 3
#: Distance from a side of a box up to which a line lies on it, in parameters.
_ON = 1e-9


def uneven_rows(scene: SceneData, boxes: Boxes) -> IntArray:
    """Rows of the boxes on lamps that are not even."""
    rows = [k for k, lamp in enumerate(scene.luminaires) if lamp.profile is not None]
    if not rows:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(np.isin(scene.luminaire_index[boxes.patch, boxes.side], rows))


def cut_evenly(scene: SceneData, boxes: Boxes) -> Boxes:
    """``boxes`` with those on uneven lamps cut at thirds of their patch, sorted."""
    rows = uneven_rows(scene, boxes)
    if not len(rows):
        return boxes
    parts = boxes.take(rows)
    lines = np.broadcast_to(np.arange(1, ROUGHLY) / ROUGHLY, (len(scene.luminaires), ROUGHLY - 1))
    for axis in (0, 1):
        parts = cut_at(parts, axis, lines[scene.luminaire_index[parts.patch, parts.side]])
    return boxes.take(np.setdiff1d(np.arange(len(boxes)), rows)).joined(parts)[0]


def cut_at_tables(scene: SceneData, boxes: Boxes, most: int) -> Boxes:
    """``boxes`` of uneven lamps cut at the lines of their tables, to no more than ``most``.

    Tables with too many lines are left to be cut where it matters.
    """
    out = boxes
    for row, lamp in enumerate(scene.luminaires):
        if lamp.profile is None or lamp.profile.cells == (1, 1):
            continue
        own = scene.luminaire_index[out.patch, out.side] == row
        parts = out.take(np.flatnonzero(own))
        sides = len({*zip(parts.patch.tolist(), parts.side.tolist(), strict=True)})
        cells = lamp.profile.cells
        if len(out) + sides * cells[0] * cells[1] > most:
            continue
        for axis, count in enumerate(cells):
            lines = np.arange(1, count) / count
            parts = cut_at(parts, axis, np.broadcast_to(lines, (len(parts), count - 1)))
        out = out.take(np.flatnonzero(~own)).joined(parts)[0]
    return out


def cut_at(boxes: Boxes, axis: int, lines: FloatArray) -> Boxes:
    """Boxes cut across ``axis`` at those of ``lines`` (n, k) in parameters that lie within them."""
    for k in range(lines.shape[1]):
        line = lines[:, k]
        low, high = boxes.ends[:, 2 * axis], boxes.ends[:, 2 * axis + 1]
        inside = (line > low + _ON) & (line < high - _ON)
        some, rest = np.flatnonzero(inside), np.flatnonzero(~inside)
        if not len(some):
            continue
        place = (line[some] - low[some]) / (high[some] - low[some])
        parts = boxes.take(some).cut(np.full(len(some), axis), place)
        parts.ends[::2, 2 * axis + 1] = parts.ends[1::2, 2 * axis] = line[some]
        boxes, order = boxes.take(rest).joined(parts)
        lines = np.concatenate([lines[rest], np.repeat(lines[some], 2, axis=0)])[order]
    return boxes
