"""Pieces of a lamp with a photometric web, ready for the kernels, and the light found of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .topology import bounding_spheres


@dataclass(frozen=True, slots=True, eq=False)
class WebPieces:
    """Pieces of one lamp's emitting faces; row j of every array is the same piece.

    Attributes
    ----------
    nets : (k, 4, 4, 4) array
        +normal towards the emitting side.
    spheres : (k, 4) array
        Bounding spheres.
    points, areas : (k, SAMPLES, 3) array
        Points on them [m] and area vectors [m²], as `kernels.webs` wants them.
    """

    nets: FloatArray
    spheres: FloatArray
    points: FloatArray
    areas: FloatArray

    @classmethod
    def of(cls, nets: FloatArray) -> WebPieces:
        low, high = 0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)
        squares = [(0.0, 0.0, 1.0)] + [(0.5 * (k // 2), 0.5 * (k % 2), 0.5) for k in range(4)]
        at = np.array(
            [(u + s * a, v + s * b, 0.25 * s * s) for u, v, s in squares for a in (low, high)
             for b in (low, high)]
        )  # fmt: skip
        points, su, sv = surface_points(nets, at[:, 0], at[:, 1])
        return cls(nets, bounding_spheres(nets), points, np.cross(su, sv) * at[:, 2, None])


@dataclass(frozen=True, slots=True, eq=False)
class WebLight:
    """Direct light of one lamp on some receivers.

    Attributes
    ----------
    illuminance : (m,) array
        [lx]
    variance : (m,) array
        Of what was sampled, and of partly hidden elements. [lx²]
    partly : (m,) array
        Standard deviation by partly hidden elements alone. [lx]
    """

    illuminance: FloatArray
    variance: FloatArray
    partly: FloatArray

    def take(self, rows: IntArray) -> WebLight:
        """That on some of the receivers."""
        return WebLight(*(getattr(self, f.name)[rows] for f in fields(self)))

    def put(self, rows: IntArray, other: WebLight) -> WebLight:
        """This light with that of ``other`` at ``rows``."""
        values = {f.name: getattr(self, f.name).copy() for f in fields(self)}
        for name, array in values.items():
            array[rows] = getattr(other, name)
        return WebLight(**values)
