"""Sky, ground and sun as area sources at infinity.

A direction is a point with weight 0; the contour integral and the pyramids take such nets as they
are. Cells between two azimuths and two altitudes are exact, their edges being circles.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .errors import NumericsError
from .kernels.dome import dome_rows
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .model.patch_sky import ROW_COUNTS, ROW_ENDS_DEG, PatchSky
from .model.shapes import arc, frame
from .model.sky import Sky, Sun, direction
from .patch_sky import patch_numbers
from .skies import patch_luminances, sky_tone
from .topology import writable

#: Receivers per kernel call.
ROWS_PER_BLOCK = 64
#: How often a cell of the dome is quartered at most: 45° / 2^9 is 5 arcmin.
LEVELS = 9
#: Azimuths closer than this are one. [rad]
_CLOSE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class DomeLight:
    """Illuminance from one source at infinity; row i of every array is the same receiver.

    Attributes
    ----------
    illuminance : (m,) array
        Mean over the receiver's nodes. [lx]
    deviation : (m,) array
        Standard deviation of its sampled part. [lx]
    factor, factor_variance : (m,) array
        Form factor of the part of the source that is seen, and its variance.
    counters : dict
        Cells traced and pyramid cells visited.
    """

    illuminance: FloatArray
    deviation: FloatArray
    factor: FloatArray
    factor_variance: FloatArray
    counters: dict[str, int]

    def times(self, luminance: float) -> DomeLight:
        """The same of a source that is so many times as bright."""
        return replace(
            self,
            illuminance=luminance * self.illuminance,
            deviation=luminance * self.deviation,
        )


def carried_variance(variance: FloatArray, of: FloatArray, to: FloatArray) -> FloatArray:
    """Variance of ``to`` that varies as ``of`` does, of which it is known; 0 where ``of`` is 0.

    What is sampled is the light of the sky; its form factor is taken to vary with it.
    """
    return np.asarray(variance * (to / np.where(of > 0.0, of, np.inf)) ** 2)


def dome_cells(low_deg: float, high_deg: float, *, azimuths: int = 8, bands: int = 2) -> FloatArray:
    """Cells (azimuths x bands, 4, 4, 4) between two altitudes, seen from inside. [deg]"""
    cuts = np.radians(np.linspace(low_deg, high_deg, bands + 1))
    turns = 2.0 * math.pi * np.arange(azimuths + 1) / azimuths
    return np.ascontiguousarray([
        dome_cell(start, end, lower, upper)
        for start, end in pairwise(turns.tolist())
        for lower, upper in pairwise(cuts.tolist())
    ])  # fmt: skip


def dome_cell(start: float, end: float, lower: float, upper: float) -> FloatArray:
    """One cell (4, 4, 4) between two azimuths, from x towards y, and two altitudes. [rad]"""
    a, g = arc(start, end), arc(lower, upper)
    c, s = g[:, 0].copy(), g[:, 1].copy()
    if lower == 0.0:
        s[0] = 0.0
    if abs(upper - 0.5 * math.pi) < 1e-12:
        c[-1] = 0.0  # the zenith exactly
    if upper == 0.0:
        s[-1] = 0.0
    if abs(lower + 0.5 * math.pi) < 1e-12:
        c[0] = 0.0
    net = np.zeros((4, 4, 4))
    net[..., 0] = a[:, None, 0] * c[None, :]
    net[..., 1] = a[:, None, 1] * c[None, :]
    net[..., 2] = a[:, None, 2] * s[None, :]
    # u runs with the azimuth, v upwards: seen from inside that is clockwise.
    return net[::-1]


def patch_cells(
    sky: PatchSky, start: float = 0.0, end: float = 2.0 * math.pi
) -> tuple[FloatArray, FloatArray]:
    """Cells (c, 4, 4, 4) of even luminance between two azimuths, and that of each (c,). [cd/m²]

    Azimuths are counted from x towards y. [rad]
    """
    level = patch_luminances(sky)
    nets, shine = [], []
    for row, count in enumerate(ROW_COUNTS):
        step = 2.0 * math.pi / count
        low, high = np.radians(ROW_ENDS_DEG[row : row + 2])
        cuts = [start, end]
        if count > 1:
            # Edges lie half way between middles, which are whole steps from y.
            every = 0.5 * math.pi + (np.arange(2 * count + 1) - count + 0.5) * step
            cuts += [c for c in every if start + _CLOSE < c < end - _CLOSE]
        # Cells are wedges of less than half a turn.
        cuts += [c for c in np.arange(8) * math.pi / 4 if start + _CLOSE < c < end - _CLOSE]
        ends = np.unique(np.round(cuts, 12))
        for a, b in zip(ends[:-1], ends[1:], strict=True):
            middle, up = 0.5 * (a + b), 0.5 * (low + high)
            flat = math.cos(up)
            at = np.array([flat * math.cos(middle), flat * math.sin(middle), math.sin(up)])
            nets.append(dome_cell(a, b, low, high))
            shine.append(level[int(patch_numbers(at))])
    return np.ascontiguousarray(nets), np.array(shine)


def sun_cells(sun: Sun) -> FloatArray:
    """The sun's disc as four exact quarter discs of directions (4, 4, 4, 4)."""
    e1, e2, e3 = frame(direction(sun.altitude_deg, sun.azimuth_deg))
    t = math.tan(math.radians(sun.angular_radius_arcmin / 60.0))
    nets = []
    for k in range(4):
        rim = arc(0.5 * math.pi * k, 0.5 * math.pi * (k + 1))
        net = np.zeros((4, 4, 4))
        for i in range(4):  # ruled from the centre to the rim, in homogeneous coordinates
            share = i / 3.0
            x, y = share * rim[:, 0], share * rim[:, 1]
            w = (1.0 - share) + share * rim[:, 2]
            net[i, :, :3] = w[:, None] * e3 + t * (x[:, None] * e1 + y[:, None] * e2)
        nets.append(net[::-1])
    return np.ascontiguousarray(nets)


def gather(
    nodes: FloatArray,
    normals: FloatArray,
    weights: FloatArray,
    cells: FloatArray,
    luminance: Sky | FloatArray | float,
    blockers: Blockers,
    *,
    eps: float,
    cell_eps: float,
    trace: bool = True,
    levels: int = LEVELS,
    progress: Callable[[int, int], None] | None = None,
) -> DomeLight:
    """Illuminance from cells at infinity on receivers (m, q, 3).

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node, rows summing to 1; 0 where no light falls.
    cells : (c, 4, 4, 4) array
        From `dome_cells` or `sun_cells`.
    luminance : Sky, (c,) array or float
        Distribution over the cells, or the luminance of each or of all. [cd/m²]
    blockers : Blockers
        What hides the source.
    eps, cell_eps : float
        Relative accuracy of a cell; form factor below which a partly hidden cell is sampled.

    Raises
    ------
    NumericsError
        If a value is not finite.
    """
    if isinstance(luminance, Sky):
        tone, shine = sky_tone(luminance), np.ones(len(cells))
    else:
        tone, shine = np.empty(0), np.broadcast_to(np.asarray(luminance, float), len(cells))
    m = len(nodes)
    out, counters = np.zeros((m, 3)), np.zeros((m, 2), dtype=np.int64)
    for start in range(0, m, ROWS_PER_BLOCK):
        rows = slice(start, min(start + ROWS_PER_BLOCK, m))
        dome_rows(
            writable(nodes[rows]),
            writable(normals[rows]),
            writable(weights[rows]),
            cells,
            writable(shine),
            tone,
            blockers,
            eps,
            cell_eps,
            trace,
            levels,
            out[rows],
            counters[rows],
        )
        if progress is not None:
            progress(rows.stop, m)
    if not np.isfinite(out).all():
        bad = int(np.argwhere(~np.isfinite(out))[0][0])
        raise NumericsError(f"light from infinity at receiver {bad}: not finite")
    total = counters.sum(axis=0)
    return DomeLight(
        illuminance=math.pi * out[:, 0],
        deviation=math.pi * np.sqrt(out[:, 1]),
        factor=out[:, 2],
        factor_variance=carried_variance(out[:, 1], out[:, 0], out[:, 2]),
        counters={"dome_cells_traced": int(total[0]), "pyramid_cells": int(total[1])},
    )
