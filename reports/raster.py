"""A depth-buffered rasteriser in NumPy, for machines without off-screen OpenGL."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Distance of samples in pixels, and samples held at once.
_SPACING, _CHUNK = 0.65, 1_500_000


def rasterize(
    screen: NDArray[np.float64], values: NDArray[np.float64], size: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Front triangle and its value at every pixel.

    Each triangle is covered with a lattice of samples closer than a pixel; the nearest sample of a
    pixel wins. Reciprocal depth is linear on the screen, and values are interpolated perspectively.

    Parameters
    ----------
    screen : (t, 3, 3) array
        Corners as pixel x, y and reciprocal depth.
    values : (t, 3) array
        Scalar at the corners.
    size : (width, height)

    Returns
    -------
    owner : (height, width) int array
        Row of the triangle, −1 for none.
    value : (height, width) array
        Interpolated scalar, NaN for none.
    nearest : (height, width) array
        Reciprocal depth of what is in front, 0 for nothing.
    """
    width, height = size
    nearest = np.zeros(width * height)
    for _, pixel, depth, _ in _samples(screen, values, size):
        np.maximum.at(nearest, pixel, depth)
    owner = np.full(width * height, -1, dtype=np.int64)
    value = np.full(width * height, np.nan)
    for rows, pixel, depth, v in _samples(screen, values, size):
        front = depth >= nearest[pixel]
        owner[pixel[front]] = rows[front]
        value[pixel[front]] = v[front]
    shape = (height, width)
    return owner.reshape(shape), value.reshape(shape), nearest.reshape(shape)


def _samples(
    screen: NDArray[np.float64], values: NDArray[np.float64], size: tuple[int, int]
) -> Iterator[tuple[NDArray[np.int64], Any, Any, Any]]:
    """Triangle row, pixel, reciprocal depth and value of the samples, in chunks."""
    width, height = size
    edges = np.roll(screen[..., :2], -1, axis=1) - screen[..., :2]
    longest = np.sqrt((edges**2).sum(axis=-1)).max(axis=1, initial=0.0)
    # Steps a side, rounded up to few distinct numbers so that triangles are handled in batches.
    wanted = np.maximum(longest / _SPACING, 1.0)
    steps = np.ceil(2.0 ** (np.ceil(2.0 * np.log2(wanted)) / 2.0)).astype(np.int64)
    steps = np.minimum(steps, 4 * max(size))
    for m in np.unique(steps):
        i, j = np.meshgrid(np.arange(m + 1), np.arange(m + 1), indexing="ij")
        keep = i + j <= m
        b1, b2 = i[keep] / m, j[keep] / m
        weights = np.stack([1.0 - b1 - b2, b1, b2])
        members = np.flatnonzero(steps == m)
        per_chunk = max(1, _CHUNK // weights.shape[1])
        for start in range(0, len(members), per_chunk):
            rows = members[start : start + per_chunk]
            x = screen[rows, :, 0] @ weights
            y = screen[rows, :, 1] @ weights
            q = screen[rows, :, 2] @ weights
            v = ((values[rows] * screen[rows, :, 2]) @ weights) / q
            px, py = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
            inside = (px >= 0) & (px < width) & (py >= 0) & (py < height)
            owner = np.broadcast_to(rows[:, None], x.shape)
            yield owner[inside], (py * width + px)[inside], q[inside], v[inside]
