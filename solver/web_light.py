"""Pieces of a lamp with a photometric web, ready for the kernels, and the light found of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .topology import bounding_spheres

#: Share of an element that may be hidden without mention: below it is quadrature.
_WHOLE = 2e-3

Values = TypeVar("Values", "WebViews", "WebLight")


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
class WebViews:
    """How m receivers see the k elements of one lamp, as if nothing hid them, for each lumen of it.

    Attributes
    ----------
    level : (m, k) array
        Exitance that an even element would give as much light with; 0 where it was not asked for.
        [lm/m² a lm]
    span : (m, k) array
        How far luminances of one element differ. [cd/m² a lm]
    plain : (m, k) array
        Form factors, or nothing (m, 0) where they are not asked for.
    """

    level: FloatArray
    span: FloatArray
    plain: NDArray[np.floating]

    def put(self, rows: IntArray, other: WebViews) -> WebViews:
        """These views with those of ``other`` at ``rows``."""
        return _put(self, rows, other)

    def light(
        self,
        flux: float,
        factors: NDArray[np.floating],
        variances: NDArray[np.floating],
        plain: NDArray[np.floating],
    ) -> WebLight:
        """Light of a lamp of ``flux`` [lm] by form factors (m, k).

        ``variances`` are theirs, and ``plain`` what they were if nothing were in the way.
        """
        factors, variances, plain = (
            np.asarray(a, dtype=np.float64) for a in (factors, variances, plain)
        )
        level = flux * self.level
        share = np.clip(factors / np.where(plain > 0.0, plain, np.inf), 0.0, 1.0)
        share[share > 1.0 - _WHOLE] = 1.0
        # The means of seen and hidden parts differ by no more than the span; half of it is taken
        # for a standard deviation.
        partly = 0.5 * math.pi * plain * share * (1.0 - share) * flux * self.span
        return WebLight(
            (factors * level).sum(axis=1),
            (variances * level**2).sum(axis=1) + (partly**2).sum(axis=1),
            np.sqrt((partly**2).sum(axis=1)),
        )


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

    def times(self, factor: float) -> WebLight:
        """That of a lamp so much brighter."""
        return WebLight(
            factor * self.illuminance, factor**2 * self.variance, abs(factor) * self.partly
        )

    def put(self, rows: IntArray, other: WebLight) -> WebLight:
        """This light with that of ``other`` at ``rows``."""
        return _put(self, rows, other)


def _put(values: Values, rows: IntArray, other: Values) -> Values:
    """Arrays of ``values`` with those of ``other`` at ``rows``."""
    arrays = {f.name: getattr(values, f.name).copy() for f in fields(values)}
    for name, array in arrays.items():
        array[rows] = getattr(other, name)
    return type(values)(**arrays)
