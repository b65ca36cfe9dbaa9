"""Four-sided cells of the (u, v) domain and their shape quality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from .arcs import Arc

#: Quality of a cell that is thin.
THIN = 0.02
#: Quality of a cell with a corner of 180 degrees: above what is refused, below what is preferred.
SMOOTH_JOINT = 0.03


@dataclass(slots=True)
class Cell:
    """A cell with its sides counter-clockwise: v=0, u=1, v=1 and u=0 of the patch.

    A side that is None is collapsed to a point.
    """

    sides: tuple[Arc | None, Arc | None, Arc | None, Arc | None]

    @property
    def edges(self) -> list[int]:
        """B-rep edge of each side, −1 for none."""
        return [-1 if a is None else a.edge for a in self.sides]


def grid_samples(sides: FloatArray) -> FloatArray:
    """Coons grids (m, 9, 9, 2) of cells given by the samples of their sides (m, 4, 9, 2).

    S. A. Coons' Boolean sum: both ruled surfaces minus the bilinear one.
    """
    c, right, d, left = sides[:, 0], sides[:, 1], sides[:, 2, ::-1], sides[:, 3, ::-1]
    t = np.linspace(0.0, 1.0, c.shape[1])
    s_, t_ = t[None, :, None, None], t[None, None, :, None]
    ruled = (1 - t_) * c[:, :, None] + t_ * d[:, :, None]
    ruled = ruled + (1 - s_) * left[:, None] + s_ * right[:, None]
    corners = (1 - s_) * ((1 - t_) * c[:, :1, None] + t_ * d[:, :1, None])
    corners = corners + s_ * ((1 - t_) * c[:, -1:, None] + t_ * d[:, -1:, None])
    return np.asarray(ruled - corners)


def quality(sides: FloatArray) -> FloatArray:
    """Smallest sine (m,) of the angle between the parameter lines; negative when folded.

    ``sides`` (m, 4, 9, 2) are the samples of the sides of each cell.

    A side of zero length is a collapsed one; the sine is then not taken in the row next to it.
    """
    if not len(sides):
        return np.empty(0)
    g = grid_samples(sides)
    ds = 0.5 * (g[:, 1:, :-1] - g[:, :-1, :-1] + g[:, 1:, 1:] - g[:, :-1, 1:])
    dt = 0.5 * (g[:, :-1, 1:] - g[:, :-1, :-1] + g[:, 1:, 1:] - g[:, 1:, :-1])
    cross = ds[..., 0] * dt[..., 1] - ds[..., 1] * dt[..., 0]
    length = np.linalg.norm(ds, axis=-1) * np.linalg.norm(dt, axis=-1)
    sine = cross / np.maximum(length, 1e-300)
    return np.minimum(sine.min(axis=(1, 2)), _corner_sines(sides))


def overlap(sides: FloatArray) -> float:
    """Share of the total area that cells cover with the wrong sense, on their 8 x 8 grids."""
    g = grid_samples(sides)
    p, q = g[:, 1:, 1:] - g[:, :-1, :-1], g[:, :-1, 1:] - g[:, 1:, :-1]
    area = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    return float(np.maximum(-area, 0.0).sum() / max(area.sum(), 1e-300))


def _corner_sines(p: FloatArray) -> FloatArray:
    """Smallest sine (m,) of the corners between sides of some length.

    Tangents are one-sided differences of second order. A cusp between two sides that leave a
    corner in one direction counts in full; a smooth joint (180 degrees) is ugly but valid.
    """
    out_of = -3.0 * p[:, :, 0] + 4.0 * p[:, :, 1] - p[:, :, 2]
    into = np.roll(-3.0 * p[:, :, -1] + 4.0 * p[:, :, -2] - p[:, :, -3], 1, axis=1)
    cross = out_of[..., 0] * into[..., 1] - out_of[..., 1] * into[..., 0]
    dot = (out_of * into).sum(axis=-1)
    first, second = np.linalg.norm(out_of, axis=-1), np.linalg.norm(into, axis=-1)
    sine = cross / np.maximum(first * second, 1e-300)
    joint = (dot < 0.0) & (sine > -1e-3)
    sine = np.where(joint, np.maximum(sine, SMOOTH_JOINT), sine)
    # Of a cell between two sides each corner lies at a collapsed one.
    collapsed = np.minimum(first, second) <= 1e-12 * first.max(axis=1, keepdims=True)
    return np.asarray(np.where(collapsed, 1.0, sine).min(axis=1))


def corner_sines(corners: FloatArray) -> FloatArray:
    """Sines (m, n) of the angles of ccw polygons (m, n, 2), negative where reflex."""
    a = np.roll(corners, -1, axis=1) - corners
    b = np.roll(corners, 1, axis=1) - corners
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    length = np.sqrt((a * a).sum(axis=-1) * (b * b).sum(axis=-1))
    return np.asarray(cross / np.maximum(length, 1e-300))


def straight_quality(corners: FloatArray) -> FloatArray:
    """`quality` (m,) of cells with straight sides from their corners (m, 4, 2).

    Directions inside are between those of opposite sides, so that no angle is worse than those of
    the corners.
    """
    sine = corner_sines(corners)
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    joint = ((a * b).sum(axis=-1) < 0.0) & (sine > -1e-3)
    return np.asarray(np.where(joint, np.maximum(sine, SMOOTH_JOINT), sine).min(axis=1))


def side_samples(arc: Arc | None, point: FloatArray | None = None) -> FloatArray:
    """Nine samples of a side; a collapsed side is nine times ``point``."""
    if arc is None:
        return np.broadcast_to(point, (9, 2))  # type: ignore[arg-type]
    return arc.samples[::2]


def samples_of(cells: list[Cell]) -> FloatArray:
    """Samples (m, 4, 9, 2) of the sides of cells, collapsed ones at the end of the side before."""
    out = []
    for cell in cells:
        for k, arc in enumerate(cell.sides):
            if arc is None:
                before, after = cell.sides[k - 1], cell.sides[(k + 1) % 4]
                point = before.end if before is not None else after.start  # type: ignore[union-attr]
                out.append(side_samples(None, point))
            else:
                out.append(side_samples(arc))
    return np.array(out).reshape(-1, 4, 9, 2)
