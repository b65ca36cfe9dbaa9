"""Sides of cells in the (u, v) domain: pieces of edges, and the chords drawn between vertices.

A side runs over s in [0, 1]. Along circular arcs s is the parameter of the rational Bézier arc
and not the angle, so that interpolation with the arc's weights reproduces it exactly.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, split_matrix

from . import nurbs
from .chains import SAME_CURVE, Part, Piece, normalised
from .curves import Curve, Line

SAMPLES = np.linspace(0.0, 1.0, 17)
_START_AND_END = np.array([0.0, 1.0])
_UNSCALED = np.ones(2)
#: How near to an end its direction is taken.
_END_STEP = 2e-3
#: Where curved arcs are looked at: at the samples, and next to the ends.
_LOOK = np.append(SAMPLES, [_END_STEP, 1.0 - _END_STEP])
_LOOK_BASIS = bernstein(_LOOK)
#: Share of an arc that counts as nothing.
NEAR = 1e-4
#: What takes a cubic to its halves.
HALVES = (split_matrix(0.0, 0.5), split_matrix(0.5, 1.0))
#: The linear fraction that runs backwards.
REVERSED = np.array([[-1.0, 1.0], [0.0, 1.0]])


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
    """Base: ``at(s)`` in (u, v), ``weights`` (4,), ``scale`` (2,) that makes u and v lengths.

    ``net`` (4, 4) is its rational cubic in space with end weights 1, where it lies on an edge.
    """

    edge = -1
    straight = False
    net: FloatArray | None = None
    weights: FloatArray
    scale: FloatArray
    _ends: FloatArray | None = None
    _samples: FloatArray | None = None
    _near: FloatArray | None = None
    _directions: tuple[FloatArray, FloatArray] | None = None

    def at(self, s: FloatArray) -> FloatArray:
        raise NotImplementedError

    def reversed(self) -> Arc:
        raise NotImplementedError

    def halves(self) -> tuple[Arc, Arc]:
        raise NotImplementedError

    def line(self) -> tuple[float, ...] | None:
        """Start (2), step (2), half angle and linear fraction (4) of a straight arc, else None.

        With the fraction a, b, c, d and x = (a s + b) / (c s + d), the arc is at start +
        `fraction` (x, half) · step.
        """
        return None

    @property
    def samples(self) -> FloatArray:
        """Points (17, 2) in scaled coordinates."""
        if self._samples is None:
            self._look()
        assert self._samples is not None
        return self._samples

    @property
    def ends(self) -> FloatArray:
        """Start and end (2, 2) in scaled coordinates."""
        if self._ends is None:
            if self.straight:
                self._ends = self.at(_START_AND_END) * self.scale
            else:
                self._ends = self.samples[[0, -1]]
        return self._ends

    def _look(self) -> None:
        """Note the samples and the points next to the ends."""
        points = self.at(_LOOK) * self.scale
        self._samples, self._near = points[: len(SAMPLES)], points[len(SAMPLES) :]

    @property
    def outline(self) -> FloatArray:
        """What bounds the arc: the ends of a straight one, the samples of others."""
        return self.ends if self.straight else self.samples

    @property
    def extent(self) -> float:
        """The longer side of the box around it, scaled coordinates."""
        x, y = self.outline.T.tolist()
        return max(max(x) - min(x), max(y) - min(y))

    @property
    def start(self) -> FloatArray:
        return self.ends[0]

    @property
    def end(self) -> FloatArray:
        return self.ends[1]

    def _twin(self) -> Self:
        """The same arc once more; `copy.copy` takes six times as long."""
        out = object.__new__(type(self))
        out.__dict__.update(self.__dict__)
        return out

    def _run_backwards(self) -> None:
        """Turn what is kept of the arc around."""
        self.weights = self.weights[::-1]
        if self._ends is not None:
            self._ends = self._ends[::-1]
        if self._samples is not None:
            self._samples = self._samples[::-1]
        if self._near is not None:
            self._near = self._near[::-1]
        if self._directions is not None:
            first, last = self._directions
            self._directions = -last, -first

    @property
    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Unit tangents at the start and the end, scaled coordinates."""
        if self._directions is None:
            start, end = self.ends
            if self.straight:
                a = b = end - start
            else:
                if self._near is None:
                    self._look()
                assert self._near is not None
                a, b = self._near[0] - start, end - self._near[1]
            a, b = a / max(math.hypot(*a), 1e-300), b / max(math.hypot(*b), 1e-300)
            self._directions = a, b
        return self._directions


class NetArc(Arc):
    """An arc of a planar face: a rational cubic in space (4, 4) and in the plane (4, 3)."""

    net: FloatArray

    def __init__(
        self, net: FloatArray, flat: FloatArray, edge: int, straight: bool, exact: bool = True
    ) -> None:
        self.net, self.flat, self.edge, self.straight, self.exact = net, flat, edge, straight, exact
        self.weights = net[:, 3]
        self.scale = _UNSCALED
        self._ends = flat[::3, :2] / flat[::3, 2:]

    def at(self, s: FloatArray) -> FloatArray:
        h = (_LOOK_BASIS if s is _LOOK else bernstein(s)) @ self.flat
        return np.asarray(h[..., :2] / h[..., 2:])

    def reversed(self) -> NetArc:
        out = self._twin()
        out.net, out.flat = self.net[::-1], self.flat[::-1]
        out._run_backwards()
        return out

    def halves(self) -> tuple[Arc, Arc]:
        out = []
        for m in HALVES:
            both = normalised(np.concatenate([m @ self.flat[:, :2], m @ self.net], axis=1))
            flat = np.concatenate([both[:, :2], both[:, -1:]], axis=1)
            out.append(NetArc(both[:, 2:], flat, self.edge, self.straight, self.exact))
        return out[0], out[1]

    def cut(self, shares: list[float]) -> list[NetArc]:
        """A straight arc cut at ``shares`` of its length."""
        out = []
        for a, b in itertools.pairwise([0.0, *shares, 1.0]):
            m = split_matrix(a, b)
            out.append(NetArc(m @ self.net, m @ self.flat, self.edge, True, self.exact))
        return out


@dataclass(slots=True)
class EdgeSide:
    """The curve in (u, v) of an edge on one face: ``edge`` parameter t is at offset + rate t."""

    curve: Curve
    shift: FloatArray
    edge: int
    rate: float = 1.0
    offset: float = 0.0


class EdgeArc(Arc):
    """A piece of an edge on a curved face: its curve in (u, v) run as its chain runs in space.

    ``net`` (4, 4) is the boundary curve of the patch, None where the edge needs several ``parts``.
    ``run`` is the 2 x 2 matrix of the linear fraction from s in [0, 1] to the parameter of the
    chain's piece.
    """

    def __init__(
        self,
        side: EdgeSide,
        piece: Piece,
        net: FloatArray | None,
        parts: list[Part],
        run: FloatArray,
        scale: FloatArray,
    ) -> None:
        self.side, self.piece, self.net, self.parts = side, piece, net, parts
        self.run, self.scale = run, scale
        self.edge = side.edge
        self.straight = side.curve.straight
        self.weights = np.ones(4) if net is None else net[:, 3]

    @classmethod
    def of(cls, side: EdgeSide, piece: Piece, scale: FloatArray) -> EdgeArc:
        """The arc of a whole piece."""
        net = None if piece.parts else piece.net
        return cls(side, piece, net, piece.parts, np.eye(2), scale)

    @property
    def polynomial(self) -> bool:
        """Whether its cubics in space have weights of 1 alone."""
        nets = [net for _, _, net in self.parts] if self.net is None else [self.net]
        return all(np.abs(net[:, 3] - 1.0).max() <= SAME_CURVE for net in nets)

    def parameter(self, s: FloatArray) -> FloatArray:
        """Parameter of the curve in (u, v)."""
        m = self.run
        local = (m[0, 0] * s + m[0, 1]) / (m[1, 0] * s + m[1, 1])
        return self.side.offset + self.side.rate * self.piece.parameter(local)

    def at(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.side.curve.evaluate(self.parameter(s)) + self.side.shift)

    def course(self) -> tuple[float, ...] | None:
        """Start and step of the parameter of the curve, half angle and linear fraction.

        As in `line`; None along hyperbolas.
        """
        piece = self.piece
        if piece.kind == "hyperbola":
            return None
        m, half = self.run, 0.0
        if piece.kind == "ellipse":
            half = 0.5 * (piece.end - piece.start)
        elif piece.kind == "rational":
            m = np.array([[piece.ratio, 0.0], [piece.ratio - 1.0, 1.0]]) @ m
        start = self.side.offset + self.side.rate * piece.start
        return start, self.side.rate * (piece.end - piece.start), half, *m.ravel().tolist()

    def line(self) -> tuple[float, ...] | None:
        curve, course = self.side.curve, self.course()
        if not isinstance(curve, Line) or course is None:
            return None
        start = curve.origin + course[0] * curve.direction + self.side.shift
        return (*start.tolist(), *(course[1] * curve.direction).tolist(), *course[2:])

    def reversed(self) -> EdgeArc:
        out = self._twin()
        out.net = None if self.net is None else self.net[::-1]
        out.parts = [(1.0 - b, 1.0 - a, n[::-1]) for a, b, n in self.parts[::-1]]
        out.run = self.run @ REVERSED
        out._run_backwards()
        return out

    def moved(self, by: FloatArray) -> EdgeArc:
        """The same arc a whole period away."""
        out = self._twin()
        out.side = replace(self.side, shift=self.side.shift + by)
        out._ends = out._samples = out._near = None
        return out

    def halves(self) -> tuple[Arc, Arc]:
        if self.net is None:
            # Parts stay whole: cut at the joint next to the middle.
            joints = [p[0] for p in self.parts[1:]]
            at = min(joints, key=lambda s: abs(s - 0.5))
            return self.part(0.0, at), self.part(at, 1.0)
        return self._half(0), self._half(1)

    def part(self, a: float, b: float) -> EdgeArc:
        """The arc over [a, b] of s where it is several parts, which are polynomials."""
        parts: list[Part] = []
        for p, q, net in self.parts:
            low, high = max(p, a), min(q, b)
            if high - low <= NEAR * (b - a):
                continue
            if low > p or high < q:
                net = split_matrix((low - p) / (q - p), (high - p) / (q - p)) @ net
            parts.append(((low - a) / (b - a), (high - a) / (b - a), net))
        run = self.run @ np.array([[b - a, a], [0.0, 1.0]])
        if len(parts) > 1:
            return EdgeArc(self.side, self.piece, None, parts, run, self.scale)
        return EdgeArc(self.side, self.piece, parts[0][2], [], run, self.scale)

    def _half(self, k: int) -> EdgeArc:
        return self._restricted(0.5 * k, 0.5 * k + 0.5, HALVES[k])

    def _restricted(self, a: float, b: float, matrix: FloatArray) -> EdgeArc:
        assert self.net is not None
        raw = matrix @ self.net
        ratio = (raw[0, 3] / raw[3, 3]) ** (1.0 / 3.0)
        inner = np.array([[(b - a) * ratio + a * (ratio - 1.0), a], [ratio - 1.0, 1.0]])
        run = self.run @ inner
        return EdgeArc(self.side, self.piece, normalised(raw), [], run, self.scale)

    def between(self, a: float, b: float) -> EdgeArc:
        """The arc over the shares [a, b] of its parameter."""
        if a < NEAR and b > 1.0 - NEAR:
            return self
        if self.net is None:
            return self.part(a, b)
        ends = (self.parameter(np.array([0.0, 1.0])) - self.side.offset) / self.side.rate
        m, s = self.run, []
        for share in (a, b):
            local = self.piece.local(float(ends[0] + share * (ends[1] - ends[0])))
            s.append(float((m[0, 1] - m[1, 1] * local) / (m[1, 0] * local - m[0, 0])))
        return self._restricted(s[0], s[1], split_matrix(s[0], s[1]))

    def cut(self, shares: list[float]) -> list[EdgeArc]:
        """The arc cut at ``shares`` of its parameter, which a straight one has of its length."""
        return [self.between(a, b) for a, b in itertools.pairwise([0.0, *shares, 1.0])]


class Chord(Arc):
    """A straight line in (u, v); ``half`` is half its angle on surfaces of revolution.

    ``net`` is its curve in space where it lies on an edge, or the one ``pole`` it collapses to.
    """

    straight = True

    def __init__(
        self,
        p: FloatArray,
        q: FloatArray,
        half: float,
        scale: FloatArray,
        edge: int = -1,
        net: FloatArray | None = None,
    ) -> None:
        self.p, self.q, self.half, self.scale, self.edge, self.net = p, q, half, scale, edge, net
        self.weights = arc_weights(half) if net is None else net[:, 3]
        self._ends = np.array([p, q]) * scale

    @property
    def samples(self) -> FloatArray:
        if self._samples is None:
            self._samples = (self.p + SAMPLES[:, None] * (self.q - self.p)) * self.scale
        return self._samples

    def at(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.p + fraction(s, self.half)[..., None] * (self.q - self.p))

    def line(self) -> tuple[float, ...] | None:
        return (*self.p.tolist(), *(self.q - self.p).tolist(), self.half, 1.0, 0.0, 0.0, 1.0)

    def reversed(self) -> Chord:
        out = self._twin()
        out.p, out.q = self.q, self.p
        out.net = None if self.net is None else self.net[::-1]
        out._run_backwards()
        return out

    def moved(self, by: FloatArray) -> Chord:
        """The same chord a whole period away."""
        return Chord(self.p + by, self.q + by, self.half, self.scale, self.edge, self.net)

    def halves(self) -> tuple[Arc, Arc]:
        m = 0.5 * (self.p + self.q)
        h = 0.5 * self.half
        nets: list[FloatArray | None] = [None, None]
        if self.net is not None:
            nets = [normalised(m @ self.net) for m in HALVES]
        return (
            Chord(self.p, m, h, self.scale, self.edge, nets[0]),
            Chord(m, self.q, h, self.scale, self.edge, nets[1]),
        )

    def cut(self, shares: FloatArray) -> list[Chord]:
        """The chord cut at ``shares`` of its length; it lies on no edge or at one pole."""
        if not len(shares):
            return [self]
        at = np.concatenate([[0.0], shares, [1.0]])
        out = []
        for a, b in itertools.pairwise(at.tolist()):
            p, q = self.p + a * (self.q - self.p), self.p + b * (self.q - self.p)
            part = Chord(p, q, self.half * (b - a), self.scale, self.edge)
            if self.net is not None:
                w = part.weights[:, None]
                pole = self.net[0, :3] / self.net[0, 3]
                part.net = np.concatenate([pole * w, w], axis=1)
            out.append(part)
        return out


def flat_chord(p: FloatArray, q: FloatArray, lift: FloatArray) -> NetArc:
    """Chord of a planar face; ``lift`` (3, 4) takes (w u, w v, w) to homogeneous space."""
    flat = nurbs.elevation(1) @ np.array([[*p, 1.0], [*q, 1.0]])
    return NetArc(flat @ lift, flat, -1, True)


def corner_turns(loop: list[Arc]) -> FloatArray:
    """Exterior angle at the start of each arc [rad], positive at convex corners."""
    d = [a.directions for a in loop]
    out = []
    for k in range(len(loop)):
        e, s = d[k - 1][1], d[k][0]
        out.append(math.atan2(e[0] * s[1] - e[1] * s[0], float(e @ s)))
    return np.array(out)
