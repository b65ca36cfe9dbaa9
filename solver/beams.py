"""Indirect light of sky and sun at sensors, by the direction it comes from.

A beam from one direction, of illuminance 1 lx on a plane facing it, makes E_j on the surfaces;
a sensor gets from that, after reflections, Σ_j w_j ρ_j E_j, where the importance w of surfaces for
the sensor solves the transposed system; see `RadiositySystem.importance`. As a function of the
direction that is the sensor's indirect daylight coefficient [1]: the light of a sky is its integral
times luminance, the light of the sun its value.

E_j is averaged over points spread evenly over the part of an element that each unknown stands for,
a ray each, as the edges of sun patches fall anywhere. Surfaces that see no sky, and those that
hardly matter for any sensor, are left out.

References
----------
.. [1] P. R. Tregenza and I. M. Waters, "Daylight coefficients", Lighting Research & Technology
   15(2), 1983, pp. 65-71.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .open_sky import OpenSky

#: Rays at a time: some 100 MB.
RAYS = 1_000_000
#: Share of the light of an even sky, and of the sun, that surfaces left out may send together.
LEFT_OUT = 1e-3
#: Distance by which points lie before the surface, against the size of the scene.
LIFT = 1e-7
#: Steps of the sequence of points: powers of 1/ρ, ρ³ = ρ + 1, the plane's golden ratio.
STEPS = 0.7548776662466927, 0.5698402909980532


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """Points of the surfaces that beams fall on, and what that matters.

    Attributes
    ----------
    points, normals : (k, 3) array
        Where beams are looked for [m], and unit normals.
    shares : (N, k / N) array
        Share of each point in the mean of the unknown it is for, one after the other.
    weights : (c, N) array
        What illuminance of each unknown adds to each of c values: of sensors, or of sensors in the
        colour of the sky and then in that of the sun, and so on for other values than illuminance.
    sky : OpenSky
        Tells what is open.
    """

    points: FloatArray
    normals: FloatArray
    shares: FloatArray
    weights: FloatArray
    sky: OpenSky

    @classmethod
    def of(
        cls,
        elements: Elements,
        element: IntArray,
        node: IntArray,
        side: int,
        weights: FloatArray,
        under_even_sky: FloatArray,
        sky: OpenSky,
        points: int,
    ) -> Beams:
        """Points of the unknowns that matter.

        Parameters
        ----------
        elements : Elements
            Of the mesh.
        element, node : (N,) int array
            Element of each unknown, and which of its nodes it is, those along v next to each other.
        side : int
            Nodes of elements a direction; 1 where each is an unknown as a whole.
        weights : (c, N) array
            What illuminance of each unknown adds to the values.
        under_even_sky : (N,) array
            Illuminance of the unknowns under a sky of luminance 1. [lx]
        points : int
            Points in the part of an element of each unknown.
        """
        # Of each value the share: what is little of all light may be all that a dim sensor gets.
        parts = np.abs(weights) * under_even_sky
        whole = parts.sum(axis=1, keepdims=True)
        worth = (parts / np.where(whole > 0.0, whole, 1.0)).max(axis=0, initial=0.0)
        order = np.argsort(worth, kind="stable")
        dim = np.cumsum(worth[order]) <= LEFT_OUT * worth.sum()
        used = np.sort(order[~dim])
        used = used[worth[used] > 0.0]
        low = np.stack([node[used] // side, node[used] % side]) / side
        # Points in line with the sides of elements would meet the edges of sun patches all at once:
        # they are spread as evenly at places that differ from each unknown to the next. They are
        # the same for all values, whichever are found together.
        turn = used[:, None] * points + np.arange(points)
        u, v = (
            (first[:, None] + np.mod(0.5 + turn * step, 1.0) / side)
            for first, step in zip(low, STEPS, strict=True)
        )
        nets = elements.nets[element[used]]
        where, su, sv = surface_points(nets, u, v)
        vectors = np.cross(su, sv)
        size = np.linalg.norm(vectors, axis=2)
        normals = vectors / np.where(size > 0.0, size, 1.0)[..., None]
        share = size / np.maximum(size.sum(axis=1), 1e-300)[:, None]
        lift = LIFT * float(np.ptp(elements.nodes.reshape(-1, 3), axis=0).max(initial=0.0))
        return cls(
            points=(where + lift * normals).reshape(-1, 3),
            normals=normals.reshape(-1, 3),
            shares=share,
            weights=np.ascontiguousarray(weights[:, used]),
            sky=sky,
        )

    def of_sky(self, sensors: int) -> Beams:
        """Those in the colour of the sky, of so many sensors; see `daylit`."""
        return self._blocks(sensors, slice(0, None, 2))

    def of_sun(self, sensors: int) -> Beams:
        """Those in the colour of the sun."""
        alike = len(self.weights) == sensors
        return self._blocks(sensors, slice(0 if alike else 1, None, 2))

    def first(self, sensors: int) -> Beams:
        """Those of the first columns, one a sensor."""
        return self._blocks(sensors, slice(0, 1))

    def _blocks(self, sensors: int, which: slice) -> Beams:
        values, points = self.weights.shape
        parts = self.weights.reshape(values // sensors, sensors, points)[which]
        return replace(self, weights=parts.reshape(len(parts) * sensors, points))

    def coefficients(
        self, directions: FloatArray, tell: Callable[[int, int], None] | None = None
    ) -> FloatArray:
        """Values (c, B) by beams of 1 lx from ``directions`` (B, 3), on planes facing them.

        ``tell`` is told how many of them are done.
        """
        out = np.zeros((len(self.weights), len(directions)))
        if not len(self.points):
            return out
        step = max(1, RAYS // len(self.points))
        for start in range(0, len(directions), step):
            some = slice(start, min(start + step, len(directions)))
            if tell is not None:
                tell(start, len(directions))
            cosine = self.normals @ directions[some].T
            point, d = np.nonzero(cosine > 0.0)
            at, to = self.points[point], directions[some][d]
            lit = self.sky.is_open(at, to)
            point, d = point[lit], d[lit]
            light = np.zeros_like(cosine)
            light[point, d] = cosine[point, d] * self.sky.share(at[lit], to[lit])
            mean = np.einsum("npb,np->nb", light.reshape(*self.shares.shape, -1), self.shares)
            out[:, some] = self.weights @ mean
        return out
