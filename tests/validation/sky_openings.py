"""Light of skies through openings of a black room by quadrature: CIE 171:2006, cases 5.9 to 5.14.

Nothing of the solver is used. Room of 4 x 4 x 3 m, walls of no thickness, the sun 60° high in the
south and no part of the light. Points A … F are on the north wall from top to bottom, G … N on the
floor from that wall on, those of the ceiling above them, all in the middle plane x = 2 m. What is
told is illuminance in percent of that of the unobstructed sky on a level plane,

    100 / E_h ∫ L cos θ_receiver cos θ_opening / r² dA

The ground is of one luminance to the horizon, 0.3 E_h / π (5.11, 5.12); masks are endless, and
their luminance is what a reflectance of 0.5 makes of a ground of 0.2: 0.05 E_h / π of the overhang
(5.13), 0.5 (E_v + 0.1 E_h) / π of the wall across (5.14), E_v being the light of the sky on its
north side. The document does not print these; they follow from its tables.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: a … e of types 1 to 15 in ISO 15469:2004, table 1.
GRADATIONS = ((4.0, -0.7), (1.1, -0.8), (0.0, -1.0), (-1.0, -0.55), (-1.0, -0.32), (-1.0, -0.15))
INDICATRICES = (
    (0.0, -1.0, 0.0), (2.0, -1.5, 0.15), (5.0, -2.5, 0.3), (10.0, -3.0, 0.45), (16.0, -3.0, 0.3),
    (24.0, -2.8, 0.15),
)  # fmt: skip
#: Group of each type among these.
TYPES = (
    (0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (3, 3), (4, 3),
    (4, 4), (5, 4), (5, 5),
)  # fmt: skip
SUN = np.array([0.0, -0.5, math.sqrt(0.75)])
WALL_HEIGHTS = (2.75, 2.25, 1.75, 1.25, 0.75, 0.25)
DISTANCES = tuple(0.25 + 0.5 * k for k in range(8))
A_TO_F = np.array([(2.0, 4.0, z) for z in WALL_HEIGHTS])
G_TO_N = np.array([(2.0, 4.0 - d, 0.0) for d in DISTANCES])
CEILING = G_TO_N + np.array([0.0, 0.0, 3.0])
SOUTH, UP, DOWN = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
#: Gauss points of a panel, and panels a direction.
ORDER, PANELS = 8, 32
#: Refractive index and absorption over the thickness of the clear glass of 6 mm, of which the
#: tables tell the latter.
INDEX, ABSORPTION = 1.52, 0.0407


def relative_luminance(kind: int, d: Array) -> Array:
    """Luminance of a type over that of the zenith but for a factor, in unit directions (..., 3)."""
    z = np.maximum(d[..., 2], 1e-12)
    if kind == 16:
        return 1.0 + 2.0 * z
    (a, b), (c, fall, e) = GRADATIONS[TYPES[kind - 1][0]], INDICATRICES[TYPES[kind - 1][1]]
    cosine = np.clip(d @ SUN, -1.0, 1.0)
    glow = np.exp(fall * np.arccos(cosine)) - math.exp(0.5 * math.pi * fall)
    return (1.0 + a * np.exp(b / z)) * (1.0 + c * glow + e * cosine**2)


def panels(low: float, high: float, count: int = PANELS) -> tuple[Array, Array]:
    """Abscissae and weights of Gauss' rule on equal panels."""
    x, w = np.polynomial.legendre.leggauss(ORDER)
    ends = np.linspace(low, high, count + 1)
    half = 0.5 * np.diff(ends)[:, None]
    return (ends[:-1, None] + half * (x + 1.0)).ravel(), (half * w).ravel()


def unobstructed(kind: int, normal: Array) -> float:
    """Illuminance of the whole sky on a plane, by zenith angle and azimuth."""
    polar, of_polar = panels(0.0, 0.5 * math.pi)
    turn, of_turn = panels(0.0, 2.0 * math.pi)
    p, t = np.meshgrid(polar, turn, indexing="ij")
    d = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=-1)
    weight = np.outer(of_polar * np.sin(polar), of_turn)
    return float((weight * relative_luminance(kind, d) * np.maximum(d @ normal, 0.0)).sum())


def transmittance(cosine: Array) -> Array:
    """Share that a clear slab lets through: Fresnel for both polarisations, all reflections."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
    left = np.exp(-ABSORPTION / inside)
    across = ((cosine - INDEX * inside) / (cosine + INDEX * inside)) ** 2
    along = ((INDEX * cosine - inside) / (INDEX * cosine + inside)) ** 2
    return sum(0.5 * (1 - r) ** 2 * left / (1 - (r * left) ** 2) for r in (across, along))


@dataclass(frozen=True)
class Opening:
    """A rectangle in the ceiling z = 3 m, or in the facade y = 0: its sides along x and v."""

    x: tuple[float, float]
    v: tuple[float, float]
    is_roof: bool
    glazed: bool = False

    def light(
        self, point: Array, normal: Array, low: float = -9.0, high: float = 9.0
    ) -> tuple[Array, Array]:
        """Directions (n, 3) and weights (n,) of what lies between two values of v."""
        start, end = max(self.v[0], low), min(self.v[1], high)
        if not start < end:
            return np.zeros((0, 3)), np.zeros(0)
        x, of_x = panels(*self.x)
        v, of_v = panels(start, end)
        gx, gv = (g.ravel() for g in np.meshgrid(x, v, indexing="ij"))
        fixed = np.full_like(gx, 3.0 if self.is_roof else 0.0)
        to = np.column_stack([gx, gv, fixed] if self.is_roof else [gx, fixed, gv]) - point
        r2 = (to**2).sum(axis=1)
        d = to / np.sqrt(r2)[:, None]
        out = np.abs(d[:, 2 if self.is_roof else 1])
        weight = np.outer(of_x, of_v).ravel() * np.maximum(d @ normal, 0.0) * out / r2
        return d, weight * transmittance(out) if self.glazed else weight


#: Light of sky types 1 to 16, in percent.
SKIES = range(1, 17)


@cache
def level(kind: int) -> float:
    """E_h of a type over the factor that its luminance leaves out."""
    return unobstructed(kind, UP)


@cache
def north_side(kind: int) -> float:
    """E_v / E_h of the sky on a wall that faces north."""
    return unobstructed(kind, -SOUTH) / level(kind)


def of_sky(opening: Opening, point: Array, normal: Array, low: float = -9.0, high: float = 9.0):
    """Sky components (16,) of what lies between two heights of the opening."""
    d, weight = opening.light(point, normal, low, high)
    return np.array([
        100.0 * float(weight @ relative_luminance(kind, d)) / level(kind) for kind in SKIES
    ])  # fmt: skip


def of_luminance(opening: Opening, point: Array, normal: Array, low: float, high: float) -> float:
    """The same of a luminance E_h / π."""
    return 100.0 / math.pi * float(opening.light(point, normal, low, high)[1].sum())


def roof(opening: Opening) -> dict[str, Array]:
    """Cases 5.9 and 5.10: tables (16, points) of the wall and the floor."""
    return {
        "wall": np.transpose([of_sky(opening, p, SOUTH) for p in A_TO_F]),
        "floor": np.transpose([of_sky(opening, p, UP) for p in G_TO_N]),
    }


def facade(opening: Opening, ground: float = 0.3) -> dict[str, Array]:
    """Cases 5.11 and 5.12: besides those of the ceiling, which sees the ground alone."""

    def both(point: Array) -> Array:
        height = float(point[2])
        below = ground * of_luminance(opening, point, SOUTH, -9.0, height)
        return of_sky(opening, point, SOUTH, height) + below

    ceiling = [ground * of_luminance(opening, p, DOWN, -9.0, 9.0) for p in CEILING]
    return {
        "wall": np.transpose([both(p) for p in A_TO_F]),
        "floor": np.transpose([of_sky(opening, p, UP) for p in G_TO_N]),
        "ceiling": np.tile(ceiling, (16, 1)),
    }


def overhang(opening: Opening, depth: float) -> dict[str, Array]:
    """Case 5.13: a mask above the facade, at 3 m."""

    def row(point: Array) -> Array:
        turn = 3.0 * point[1] / (point[1] + depth)
        return of_sky(opening, point, UP, -9.0, turn) + 0.05 * of_luminance(
            opening, point, UP, turn, 9.0
        )

    return {"floor": np.transpose([row(p) for p in G_TO_N])}


def wall_across(opening: Opening, height: float) -> dict[str, Array]:
    """Case 5.14: a mask 6 m before the facade."""
    bright = np.array([0.5 * (north_side(kind) + 0.1) for kind in SKIES])

    def row(point: Array) -> Array:
        turn = height * point[1] / (point[1] + 6.0)
        mask = of_luminance(opening, point, UP, -9.0, turn)
        return of_sky(opening, point, UP, turn) + bright * mask

    return {"floor": np.transpose([row(p) for p in G_TO_N])}
