"""Sides of cells in the (u, v) domain: pieces of edges, and the chords drawn between vertices.

A side runs over s in [0, 1]. Along circular arcs s is the parameter of the rational Bézier arc
and not the angle, so that interpolation with the arc's weights reproduces it exactly.
"""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, split_matrix

from . import nurbs
from .chains import normalised
from .curves import Curve

SAMPLES = np.linspace(0.0, 1.0, 17)
_SAMPLE_BASIS = bernstein(SAMPLES)
_END_STEP = 2e-3


def fraction(s: FloatArray, half: float) -> FloatArray:
    """Share of a circular arc of half angle ``half`` [rad] passed at Bézier parameter ``s``."""
    if half < 1e-9:
        return s
    t = 1.0 - s
    along = math.sin(half) * (s * s - t * t)
    across = math.cos(half) * (s * s + t * t) + 2.0 * s * t
    return np.asarray(0.5 * (np.arctan2(along, across) / half + 1.0))


def arc_weights(half: float) -> FloatArray:
    """Weights (4,) of a circular arc of half angle ``half`` [rad] raised to degree 3."""
    c = (1.0 + 2.0 * math.cos(half)) / 3.0 if half > 1e-9 else 1.0
    return np.array([1.0, c, c, 1.0])


class Arc:
    """Base: ``at(s)`` in (u, v), ``weights`` (4,), scaled ``samples`` (17, 2)."""

    edge = -1
    straight = False
    weights: FloatArray
    samples: FloatArray
    scale: FloatArray
    use: int = -1

    def at(self, s: FloatArray) -> FloatArray:
        raise NotImplementedError

    def reversed(self) -> Arc:
        raise NotImplementedError

    def halves(self) -> tuple[Arc, Arc]:
        raise NotImplementedError

    def space(self, s: FloatArray) -> FloatArray | None:
        """Points of the 3-D edge at ``s``; None when the arc lies on no edge."""
        return None

    def prepare(self) -> None:
        """Sample the arc in scaled coordinates."""
        self.samples = self.at(SAMPLES) * self.scale

    @property
    def start(self) -> FloatArray:
        return self.samples[0]

    @property
    def end(self) -> FloatArray:
        return self.samples[-1]

    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Unit tangents at the start and the end, scaled coordinates."""
        p = self.at(np.array([0.0, _END_STEP, 1.0 - _END_STEP, 1.0])) * self.scale
        a, b = p[1] - p[0], p[3] - p[2]
        a, b = a / max(np.linalg.norm(a), 1e-300), b / max(np.linalg.norm(b), 1e-300)
        return a, b


class NetArc(Arc):
    """An arc of a planar face: a rational cubic in space (4, 4) and in the plane (4, 3)."""

    def __init__(
        self, net: FloatArray, flat: FloatArray, edge: int, straight: bool, exact: bool = True
    ) -> None:
        self.net, self.flat, self.edge, self.straight, self.exact = net, flat, edge, straight, exact
        self.weights = net[:, 3]
        self.scale = np.ones(2)
        h = _SAMPLE_BASIS @ flat
        self.samples = h[:, :2] / h[:, 2:]

    def at(self, s: FloatArray) -> FloatArray:
        h = bernstein(s) @ self.flat
        return np.asarray(h[..., :2] / h[..., 2:])

    def reversed(self) -> NetArc:
        return NetArc(self.net[::-1], self.flat[::-1], self.edge, self.straight, self.exact)

    def halves(self) -> tuple[Arc, Arc]:
        out = []
        for a, b in ((0.0, 0.5), (0.5, 1.0)):
            m = split_matrix(a, b)
            both = normalised(np.concatenate([m @ self.flat[:, :2], m @ self.net], axis=1))
            flat = np.concatenate([both[:, :2], both[:, -1:]], axis=1)
            out.append(NetArc(both[:, 2:], flat, self.edge, self.straight, self.exact))
        return out[0], out[1]


class EdgeArc(Arc):
    """A piece of an edge's curve in (u, v) from parameter ``a`` to ``b``, either may be larger."""

    def __init__(
        self,
        curve: Curve,
        a: float,
        b: float,
        shift: FloatArray,
        half: float,
        space_curve: Curve | None,
        edge: int,
        scale: FloatArray,
    ) -> None:
        self.curve, self.a, self.b, self.shift, self.half = curve, a, b, shift, half
        self.space_curve, self.edge, self.scale = space_curve, edge, scale
        self.straight = curve.straight
        self.weights = arc_weights(half)
        self.prepare()

    def _t(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.a + (self.b - self.a) * fraction(s, self.half))

    def at(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.curve.evaluate(self._t(s)) + self.shift)

    def space(self, s: FloatArray) -> FloatArray | None:
        return None if self.space_curve is None else self.space_curve.evaluate(self._t(s))

    def _piece(self, a: float, b: float, half: float) -> EdgeArc:
        return EdgeArc(self.curve, a, b, self.shift, half, self.space_curve, self.edge, self.scale)

    def reversed(self) -> EdgeArc:
        return self._piece(self.b, self.a, self.half)

    def halves(self) -> tuple[Arc, Arc]:
        m = 0.5 * (self.a + self.b)
        return self._piece(self.a, m, 0.5 * self.half), self._piece(m, self.b, 0.5 * self.half)


class Chord(Arc):
    """A straight line in (u, v); ``half`` is half its angle on surfaces of revolution."""

    straight = True

    def __init__(
        self, p: FloatArray, q: FloatArray, half: float, scale: FloatArray, edge: int = -1
    ) -> None:
        self.p, self.q, self.half, self.scale, self.edge = p, q, half, scale, edge
        self.weights = arc_weights(half)
        self.samples = (p + SAMPLES[:, None] * (q - p)) * scale

    def at(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.p + fraction(s, self.half)[..., None] * (self.q - self.p))

    def prepare(self) -> None:
        self.samples = self.at(SAMPLES) * self.scale

    def reversed(self) -> Chord:
        return Chord(self.q, self.p, self.half, self.scale, self.edge)

    def halves(self) -> tuple[Arc, Arc]:
        m = 0.5 * (self.p + self.q)
        h = 0.5 * self.half
        return (
            Chord(self.p, m, h, self.scale, self.edge),
            Chord(m, self.q, h, self.scale, self.edge),
        )


def flat_chord(p: FloatArray, q: FloatArray, lift: FloatArray) -> NetArc:
    """Chord of a planar face; ``lift`` (3, 4) takes (w u, w v, w) to homogeneous space."""
    flat = nurbs.elevation(1) @ np.array([[*p, 1.0], [*q, 1.0]])
    return NetArc(flat @ lift, flat, -1, True)
