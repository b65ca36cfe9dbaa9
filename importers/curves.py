"""Curves as arrays, in two or three dimensions, evaluated without the CAD kernel.

Conics use the kernel's parameter: the angle of circles and ellipses, the hyperbolic angle of
hyperbolas, the focal parameter of parabolas.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from . import nurbs

#: Pieces of a spline that meet at a smaller angle have no kink there. [rad]
SMOOTH = math.radians(3.0)


class Curve:
    """Base: ``evaluate`` (n,) -> (n, d) points and ``slope`` (n,) -> (n, d) derivatives."""

    straight = False

    def evaluate(self, t: FloatArray) -> FloatArray:
        raise NotImplementedError

    def slope(self, t: FloatArray) -> FloatArray:
        raise NotImplementedError

    def both(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points and derivatives."""
        return self.evaluate(t), self.slope(t)

    def breaks(self, a: float, b: float) -> FloatArray:
        """Parameters in [a, b] between which the curve is smooth, ends included."""
        return np.array([a, b])


@dataclass(slots=True)
class Line(Curve):
    """origin + t direction."""

    origin: FloatArray
    direction: FloatArray
    straight = True

    def evaluate(self, t: FloatArray) -> FloatArray:
        return np.asarray(self.origin + np.asarray(t)[..., None] * self.direction)

    def slope(self, t: FloatArray) -> FloatArray:
        return np.broadcast_to(self.direction, (*np.shape(t), len(self.direction)))


def conic_functions(kind: str, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """f(t) and g(t) of a `Conic`."""
    if kind == "ellipse":
        return np.cos(t), np.sin(t)
    if kind == "hyperbola":
        return np.cosh(t), np.sinh(t)
    return t * t, t


@dataclass(slots=True)
class Conic(Curve):
    """centre + f(t) x + g(t) y with (f, g) = (cos, sin), (cosh, sinh) or (t²/4F, t)."""

    kind: str
    center: FloatArray
    x: FloatArray
    y: FloatArray

    def evaluate(self, t: FloatArray) -> FloatArray:
        f, g = conic_functions(self.kind, np.asarray(t)[..., None])
        return np.asarray(self.center + f * self.x + g * self.y)

    def slope(self, t: FloatArray) -> FloatArray:
        t = np.asarray(t)[..., None]
        if self.kind == "ellipse":
            return np.asarray(-np.sin(t) * self.x + np.cos(t) * self.y)
        if self.kind == "hyperbola":
            return np.asarray(np.sinh(t) * self.x + np.cosh(t) * self.y)
        return np.asarray(2.0 * t * self.x + self.y)

    def quadratics(self, cuts: FloatArray) -> FloatArray:
        """Homogeneous quadratics (n, 3, d + 1) of the arcs between ``cuts`` (n + 1,); end
        weights 1."""
        a, b = cuts[:-1], cuts[1:]
        d = len(self.center)
        out = np.ones((len(a), 3, d + 1))
        ends = self.evaluate(cuts)
        out[:, 0, :d], out[:, 2, :d] = ends[:-1], ends[1:]
        f, g = conic_functions(self.kind, 0.5 * (a + b))
        if self.kind == "parabola":
            f = a * b
        else:
            out[:, 1, d] = conic_functions(self.kind, 0.5 * (b - a))[0]
        middle = out[:, 1, d:] * self.center + f[:, None] * self.x + g[:, None] * self.y
        out[:, 1, :d] = middle
        return out


def _blended(basis: FloatArray, nets: FloatArray) -> FloatArray:
    """Coefficients (..., k, d) weighted with polynomials (..., k)."""
    return np.asarray(np.einsum("...k,...kd->...d", basis, nets))


@dataclass(slots=True)
class BSpline(Curve):
    """Rational B-spline as Bézier pieces; ``knots`` of C0 continuity may be kinks."""

    knots: FloatArray
    pieces: FloatArray
    degree: int
    period: float | None = None
    _turn: float | None = None

    def _located(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients of the pieces that hold ``t``, the local parameters, and their lengths."""
        t = nurbs.wrap(t, float(self.knots[0]), self.period)
        piece, local, length = nurbs.locate(self.knots, t)
        return self.pieces[piece], local, length

    def evaluate(self, t: FloatArray) -> FloatArray:
        nets, local, _ = self._located(t)
        h = _blended(nurbs.bernstein_basis(self.degree, local), nets)
        return np.asarray(h[..., :-1] / h[..., -1:])

    def slope(self, t: FloatArray) -> FloatArray:
        return self.both(t)[1]

    def both(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        nets, local, length = self._located(t)
        h = _blended(nurbs.bernstein_basis(self.degree, local), nets)
        d = _blended(nurbs.bernstein_slope(self.degree, local), nets)
        point = np.asarray(h[..., :-1] / h[..., -1:])
        return point, (d[..., :-1] - d[..., -1:] * point) / h[..., -1:] / length[..., None]

    def breaks(self, a: float, b: float) -> FloatArray:
        return nurbs.knots_between(self.knots, self.period, a, b)

    @property
    def turn(self) -> float:
        """An angle [rad] that the direction of the curve turns by at most; inf if none is known.

        Raising the degree of a polynomial cuts corners off its polygon, which cannot make that turn
        more, and the polygons tend to the curve.
        """
        if self._turn is None:
            self._turn = math.inf
            w = self.pieces[..., -1]
            legs = np.diff(self.pieces[..., :-1], axis=1)
            size = np.sqrt((legs * legs).sum(axis=2))
            if (w == w[:, :1]).all() and (size > 0.0).all():
                legs = (legs / size[..., None]).reshape(-1, legs.shape[2])
                cosines = (legs[1:] * legs[:-1]).sum(axis=1)
                turns = np.arccos(np.clip(cosines, -1.0, 1.0))
                # A kink between pieces is none of the curve's turning.
                if not (turns[self.degree - 1 :: self.degree] > SMOOTH).any():
                    self._turn = float(turns.sum())
        return self._turn


@dataclass(slots=True)
class Sampled(Curve):
    """A curve of a kind without arrays (offset curves …), evaluated point by point."""

    point: Callable[[float], tuple[tuple[float, ...], tuple[float, ...]]]
    cache: dict[float, tuple] = field(default_factory=dict)

    def _all(self, t: FloatArray, which: int) -> FloatArray:
        t = np.asarray(t, dtype=np.float64)
        rows = []
        for value in t.ravel().tolist():
            if value not in self.cache:
                self.cache[value] = self.point(value)
            rows.append(self.cache[value][which])
        return np.array(rows).reshape(*t.shape, -1)

    def evaluate(self, t: FloatArray) -> FloatArray:
        return self._all(t, 0)

    def slope(self, t: FloatArray) -> FloatArray:
        return self._all(t, 1)
