"""Direct light of the sun's disc at sensors, at many of its places.

As in `simulation.solve`, see `sun_disc`.
"""

from __future__ import annotations

import math

import numpy as np

from .budget import Budget
from .model.arrays import FloatArray, IntArray
from .model.shapes import frames, places_on_disk
from .model.sky import Sun, direction
from .open_sky import OpenSky
from .sun_disc import DiscLight
from .topology import writable

#: Radius of the disc, as `Sun` has it. [arcmin]
RADIUS_ARCMIN = 16.0
#: Places on the disc, of equal area each, at which it is asked what panes leave; the latter where
#: all of it is seen.
PLACES, PLACES_OF_WHOLE = 16, 4
#: Pairs of sensor and sun at a time: some 50 MB.
PAIRS = 50_000
#: Share of the disc that may be hidden where all of it is seen.
_WHOLE = 1e-9


class SunLight:
    """Sensors of one scene, and what may hide the sun from them.

    Parameters
    ----------
    sky : OpenSky
        The scene, its opaque patches as obstacles, and its panes.
    budget : Budget
        Tolerances.
    points, normals : (m, 3) array
        Sensors [m], and unit normals.
    """

    def __init__(
        self, sky: OpenSky, budget: Budget, points: FloatArray, normals: FloatArray
    ) -> None:
        self.sky, self.blockers, self.budget = sky, sky.blockers, budget
        self.points, self.normals = writable(points), writable(normals)
        self._disc = DiscLight(self.blockers, trace=sky.trace)
        #: Pairs of sensor and place of the sun that were traced.
        self.traced = 0

    def light(self, altitude_deg: FloatArray, azimuth_deg: FloatArray) -> FloatArray:
        """Illuminance (m, k) by suns (k,) of 1 lx on a plane facing them."""
        from .kernels.sun_disc import LEFT, disc_rows

        suns = np.array(
            [direction(a, b) for a, b in zip(altitude_deg, azimuth_deg, strict=True)]
        ).reshape(-1, 3)
        out = np.empty((len(self.points), len(suns)))
        radius = math.tan(math.radians(RADIUS_ARCMIN / 60.0))
        disc_rows(
            self.points,
            self.normals,
            suns,
            radius,
            self.blockers,
            self._disc.straight,
            self.sky.trace,
            out,
        )
        left = out == LEFT
        for k in np.flatnonzero(left.any(axis=0)):
            rows = np.flatnonzero(left[:, k])
            out[rows, k] = self._traced(rows, float(altitude_deg[k]), float(azimuth_deg[k]))
            self.traced += len(rows)
        if self.sky.has_panes:
            self._keep_back(out, suns, radius)
        return out

    def _traced(self, rows: IntArray, altitude_deg: float, azimuth_deg: float) -> FloatArray:
        sun = Sun(altitude_deg, azimuth_deg, 1.0, angular_radius_arcmin=RADIUS_ARCMIN)
        share = self.budget.sun_cell_eps
        return self._disc.at(self.points[rows], self.normals[rows], sun, share).illuminance

    def _keep_back(self, out: FloatArray, suns: FloatArray, radius: float) -> None:
        """Take what panes keep back of ``out`` (m, k), in place.

        It is the mean over places on the disc that nothing opaque hides, or over all of those that
        panes cover, where that is none. Of a disc that is seen as a whole fewer places tell.
        """
        cosine = self.normals @ suns.T
        whole = out >= cosine * (1.0 - _WHOLE)
        for some, places in ((whole & (out > 0.0), PLACES_OF_WHOLE), (~whole, PLACES)):
            rows, at = np.nonzero(some & (out > 0.0))
            for start in range(0, len(rows), PAIRS):
                block = slice(start, start + PAIRS)
                share = self._share(rows[block], suns[at[block]], radius, places)
                out[rows[block], at[block]] *= share

    def _share(self, rows: IntArray, suns: FloatArray, radius: float, places: int) -> FloatArray:
        """Mean share (k,) that panes leave of the disc about ``suns`` (k, 3) at sensors (k,)."""
        spread, turn = places_on_disk(places)
        far, (e1, e2) = radius * spread, frames(suns)
        d = suns[:, None] + (far * np.cos(turn))[:, None] * e1[:, None]
        d += (far * np.sin(turn))[:, None] * e2[:, None]
        d /= np.linalg.norm(d, axis=2, keepdims=True)
        at, to = np.repeat(self.points[rows], places, axis=0), d.reshape(-1, 3)
        share, met = (a.reshape(-1, places) for a in self.sky.share_and_met(at, to))
        some = np.ones_like(met)
        if places == PLACES:
            lit = self.sky.is_open(at, to).reshape(-1, places)
            some = np.asarray(np.where(lit.any(axis=1, keepdims=True), lit, met))
        count = some.sum(axis=1)
        mean = (share * some).sum(axis=1) / np.maximum(count, 1)
        return np.asarray(np.where(count > 0, mean, 1.0))
