"""The sky in cells: Tregenza's 145 [1], and Reinhart's finer ones of the same kind.

Bands of equal height from the horizon up, each cut evenly by azimuth, and a cap at the zenith. With
each band of Tregenza's cut into k, and each of its cells into k x k, there are 144 k² + 1 cells.

References
----------
.. [1] P. R. Tregenza, "Subdivision of the sky hemisphere for luminance measurements", Lighting
   Research & Technology 19(1), 1987, pp. 13-14.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .errors import InputError
from .model.arrays import FloatArray, IntArray, frozen

#: Cells of Tregenza's bands, from the horizon up; above them is the cap.
_BANDS = (30, 30, 24, 24, 18, 12, 6)
#: Directions a cell, each way, by which a level receiver's share of each cell is told.
_FINE = 4


@dataclass(frozen=True, slots=True, eq=False)
class DomeGrid:
    """Cells of the upper hemisphere; row b of every array is the same of B cells.

    Attributes
    ----------
    parts : int
        Into how many each band of Tregenza's is cut.
    directions : (B, 3) array
        Unit vectors to the middles.
    solid_angle : (B,) array
        [sr]
    altitude_deg, azimuth_deg : (B,) array
        Of the middles; azimuths clockwise from north. [deg]
    start, count : (k,) int array
        First cell and number of cells of each band, the cap being the last one.
    """

    parts: int
    directions: FloatArray
    solid_angle: FloatArray
    altitude_deg: FloatArray
    azimuth_deg: FloatArray
    start: IntArray
    count: IntArray

    def __len__(self) -> int:
        return len(self.solid_angle)

    @property
    def height(self) -> float:
        """Height of a band, and twice the radius of the cap. [rad]"""
        return 0.5 * math.pi / (len(_BANDS) * self.parts + 0.5)

    def between(self, directions: FloatArray) -> tuple[IntArray, FloatArray]:
        """Cells (m, 4) about ``directions`` (m, 3), and the weight (m, 4) of each.

        A function told at the middles is linear between them, in azimuth along two bands and in
        altitude from one to the other; below the middle of the lowest band it is as there.
        """
        d = np.asarray(directions, dtype=np.float64)
        level = np.hypot(d[:, 0], d[:, 1])
        place = np.arctan2(d[:, 2], level) / self.height - 0.5
        turn = np.mod(np.arctan2(d[:, 0], d[:, 1]) / (2.0 * math.pi), 1.0)
        last = len(self.count) - 1
        low = np.clip(np.floor(place).astype(np.int64), 0, last - 1)
        up = np.clip(place - low, 0.0, 1.0)
        # The middle of the cap is the zenith, half a band above that of others.
        cells, weights = np.empty((len(d), 4), dtype=np.int64), np.empty((len(d), 4))
        for k, (band, share) in enumerate(((low, 1.0 - up), (low + 1, up))):
            count = self.count[band]
            along = turn * count
            first = np.floor(along).astype(np.int64)
            part = along - first
            cells[:, 2 * k] = self.start[band] + first % count
            cells[:, 2 * k + 1] = self.start[band] + (first + 1) % count
            weights[:, 2 * k], weights[:, 2 * k + 1] = share * (1.0 - part), share * part
        return cells, weights

    def gathered(self, directions: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (B,) of the cells that stand for ``weights`` (m,) in ``directions`` (m, 3)."""
        cells, shares = self.between(directions)
        found = np.bincount(
            cells.ravel(), weights=(shares * weights[:, None]).ravel(), minlength=len(self)
        )
        return np.asarray(found, dtype=np.float64)

    def interpolated(self, values: FloatArray, directions: FloatArray) -> FloatArray:
        """Values (..., m) in ``directions`` (m, 3) of a function ``values`` (..., B)."""
        cells, shares = self.between(directions)
        out = np.zeros((*values.shape[:-1], len(cells)))
        for k in range(4):
            out += shares[:, k] * values[..., cells[:, k]]
        return out

    @property
    def level(self) -> FloatArray:
        """Weights (B,) with which an unobstructed level receiver sees the cells; sum π. [sr]"""
        return _level(self.parts)


@lru_cache(maxsize=8)
def dome_grid(parts: int) -> DomeGrid:
    """Tregenza's cells with each band cut into ``parts``: 145, 577, 1297, 2305, … cells.

    Raises
    ------
    InputError
        If ``parts`` is no whole number from 1 to 16.
    """
    if parts not in range(1, 17):
        raise InputError(f"parts = {parts!r}: must be a whole number from 1 to 16")
    count = np.array([n * parts for n in _BANDS for _ in range(parts)] + [1])
    height = 0.5 * math.pi / (len(count) - 0.5)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    band = np.repeat(np.arange(len(count)), count)
    low = band * height
    high = np.minimum(low + height, 0.5 * math.pi)
    middle = np.where(band == len(count) - 1, 0.5 * math.pi, low + 0.5 * height)
    azimuth = 2.0 * math.pi * (np.arange(len(band)) - start[band]) / count[band]
    directions = np.stack(
        [np.cos(middle) * np.sin(azimuth), np.cos(middle) * np.cos(azimuth), np.sin(middle)], axis=1
    )
    directions[-1] = 0.0, 0.0, 1.0
    return DomeGrid(
        parts=int(parts),
        directions=frozen(directions),
        solid_angle=frozen(2.0 * math.pi / count[band] * (np.sin(high) - np.sin(low))),
        altitude_deg=frozen(np.degrees(middle)),
        azimuth_deg=frozen(np.degrees(azimuth)),
        start=frozen(start, np.int64),
        count=frozen(count, np.int64),
    )


@lru_cache(maxsize=8)
def _level(parts: int) -> FloatArray:
    grid = dome_grid(parts)
    bands = _FINE * len(grid.count)
    edge = np.linspace(0.0, 0.5 * math.pi, bands + 1)
    share = 0.5 * (np.sin(edge[1:]) ** 2 - np.sin(edge[:-1]) ** 2)
    middle = 0.5 * (edge[1:] + edge[:-1])
    total = np.zeros(len(grid))
    turns = _FINE * int(grid.count.max())
    azimuth = 2.0 * math.pi * (np.arange(turns) + 0.5) / turns
    for altitude, weight in zip(middle, share, strict=True):
        c = math.cos(altitude)
        d = np.stack([c * np.sin(azimuth), c * np.cos(azimuth), np.full(turns, math.sin(altitude))])
        total += grid.gathered(d.T, np.full(turns, weight * 2.0 * math.pi / turns))
    return frozen(total)
