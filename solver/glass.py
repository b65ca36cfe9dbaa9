"""What a pane of glass does to light: the slab law, by angle and for diffuse light.

A slab with parallel faces, far thicker than a wavelength, so that intensities add [1]. With θ the
angle of incidence, sin θ' = sin θ / n, Fresnel's reflectance r of one face for each polarisation
and the share t = exp(−κ d / cos θ') left by one passage, all internal reflections sum to

    τ = (1 − r)² t / (1 − r² t²),    ρ = r + r t² (1 − r)² / (1 − r² t²),

each the mean over both polarisations.

.. [1] J. A. Duffie and W. A. Beckman, "Solar Engineering of Thermal Processes", 4th ed., Wiley,
   2013, sec. 5.1 to 5.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .model.arrays import FloatArray
from .model.bezier import gauss_rule
from .model.glazing import Glazing

#: Gauss points a piece for the means over the hemisphere.
_ORDER = 48


@dataclass(frozen=True, slots=True, eq=False)
class GlassLaw:
    """Transmittance and reflectance of one kind of pane, the same from both sides.

    Attributes
    ----------
    n, depth : float
        Refractive index, and absorption coefficient times thickness.
    angles, values : (k,) array
        Table of the transmittance [rad], without rows for a slab.
    diffuse : float
        Share of the transmitted light that is scattered.
    """

    n: float
    depth: float
    angles: FloatArray
    values: FloatArray
    diffuse: float

    @classmethod
    def of(cls, glazing: Glazing) -> GlassLaw:
        """The law of some panes."""
        glass, given = glazing.glass, glazing.glass.transmittance
        depth, angles, values = glass.absorption_per_m * glazing.thickness_m, [], []
        if isinstance(given, tuple):
            angles = [math.radians(angle) for angle, _ in given]
            values = [value for _, value in given]
            depth = depth_of(min(given[0][1], 2.0 * glass.n / (glass.n**2 + 1.0)), glass.n)
        elif given is not None:
            depth = depth_of(given, glass.n)
        return cls(glass.n, depth, np.array(angles), np.array(values), glass.diffuse)

    def transmittance(self, cosine: ArrayLike) -> FloatArray:
        """Share of light that is let through, scattered or not, by cosine of incidence (...,)."""
        c = np.abs(np.asarray(cosine, dtype=np.float64))
        if len(self.angles):
            return np.asarray(np.interp(np.arccos(np.minimum(c, 1.0)), self.angles, self.values))
        return slab(c, self.n, self.depth)[0]

    def reflectance(self, cosine: ArrayLike) -> FloatArray:
        """Share of light that is thrown back, by cosine of incidence (...,).

        Of a tabulated pane: that of a slab with its index and its transmittance at normal
        incidence, but no more than is not let through.
        """
        c = np.abs(np.asarray(cosine, dtype=np.float64))
        found = slab(c, self.n, self.depth)[1]
        return np.minimum(found, 1.0 - self.transmittance(c)) if len(self.angles) else found

    @property
    def diffuse_transmittance(self) -> float:
        """Share of perfectly diffuse light that is let through, scattered or not."""
        cosine, weight = self._rule()
        return float(weight @ self.transmittance(cosine))

    @property
    def diffuse_reflectance(self) -> float:
        """Share of perfectly diffuse light that is thrown back."""
        cosine, weight = self._rule()
        return max(0.0, float(weight @ self.reflectance(cosine)))

    def _rule(self) -> tuple[FloatArray, FloatArray]:
        """Cosines and weights of 2 ∫ f(c) c dc; pieces end where a table bends."""
        x, w = gauss_rule(_ORDER)
        # Grazing light of clear glass changes over a cosine of its absorption: finer there.
        bends = np.cos(self.angles) if len(self.angles) else np.array([0.01, 0.1])
        ends = np.unique(np.clip(np.concatenate([[0.0, 1.0], bends]), 0.0, 1.0))
        low, step = ends[:-1, None], np.diff(ends)[:, None]
        cosine = (low + step * x).ravel()
        return cosine, 2.0 * cosine * (step * w).ravel()


def slab(cosine: ArrayLike, n: float, depth: float) -> tuple[FloatArray, FloatArray]:
    """Transmittance and reflectance (...,) of a slab for unpolarised light.

    Parameters
    ----------
    cosine : (...,) array
        Cosine of the angle of incidence, 0 … 1.
    n, depth : float
        Refractive index, and absorption coefficient times thickness.
    """
    c = np.asarray(cosine, dtype=np.float64)
    inside = np.sqrt((n**2 - 1.0) + c**2) / n
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.exp(-depth / inside) if depth > 0.0 else np.ones_like(c)
        through, back = np.zeros_like(c), np.zeros_like(c)
        for a, b in ((c, n * inside), (n * c, inside)):
            # 1 − r² t² = (1 − r t)(1 + r t), and 1 − r = 4 a b / (a + b)² without cancelling.
            lost = np.where(a + b > 0.0, 4.0 * a * b / (a + b) ** 2, 1.0)
            rest = (1.0 - left) + lost * left
            rest *= 1.0 + (1.0 - lost) * left
            tau = np.where(rest > 0.0, lost**2 * left / rest, 0.0)
            through += 0.5 * tau
            back += 0.5 * (1.0 - lost) * (1.0 + left * tau)
    return through, back


def depth_of(transmittance: float, n: float) -> float:
    """Absorption times thickness of a slab of index ``n`` that lets through so much at 0 degrees.

    τ = (1 − r)² t / (1 − r² t²) is a quadratic in t.
    """
    if transmittance <= 0.0:
        return math.inf
    r = ((n - 1.0) / (n + 1.0)) ** 2
    a, b = transmittance * r * r, (1.0 - r) ** 2
    t = 2.0 * transmittance / (b + math.sqrt(b * b + 4.0 * a * transmittance))
    return max(0.0, -math.log(min(t, 1.0)))
