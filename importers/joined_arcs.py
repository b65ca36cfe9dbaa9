"""Pieces of edges in a row as one arc."""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray

from .arcs import REVERSED, Arc, EdgeArc
from .chains import Part, Piece

#: Arcs that turn by less where they meet have no corner there. [rad]
NO_CORNER = math.radians(10.0)


class BentArc(EdgeArc):
    """Two pieces of edges in a row as one arc, joined at ``share``; its ``edge`` is the first."""

    def __init__(self, first: EdgeArc, second: EdgeArc, share: float = 0.5) -> None:
        self.first, self.second, self.share = first, second, share
        self.net, self.edge, self.scale, self.straight = None, first.edge, first.scale, False
        self.weights = np.ones(4)
        self.parts = []
        for low, size, arc in ((0.0, share, first), (share, 1.0 - share, second)):
            own = arc.parts if arc.net is None else [(0.0, 1.0, arc.net)]
            self.parts += [(low + a * size, low + b * size, net) for a, b, net in own]

    def at(self, s: FloatArray) -> FloatArray:
        s = np.asarray(s)
        out = np.empty((*s.shape, 2))
        early = s < self.share
        out[early] = self.first.at(s[early] / self.share)
        out[~early] = self.second.at((s[~early] - self.share) / (1.0 - self.share))
        return out

    def course(self) -> tuple[float, ...] | None:
        return None

    def line(self) -> tuple[float, ...] | None:
        return None

    def reversed(self) -> BentArc:
        return BentArc(self.second.reversed(), self.first.reversed(), 1.0 - self.share)

    def halves(self) -> tuple[Arc, Arc]:
        return self.first, self.second


def bends(a: Arc, b: Arc) -> bool:
    """Whether two arcs in a row are a `BentArc`: curved, polynomials, and without a corner."""
    if not (isinstance(a, EdgeArc) and isinstance(b, EdgeArc)) or a.straight or b.straight:
        return False
    e, s = a.directions[1], b.directions[0]
    turn = math.atan2(e[0] * s[1] - e[1] * s[0], float(e @ s))
    return abs(turn) <= NO_CORNER and a.polynomial and b.polynomial


def bent(a: Arc, b: Arc) -> BentArc:
    """Two arcs that are smooth in a row as one, which runs as fast along both."""
    assert isinstance(a, EdgeArc) and isinstance(b, EdgeArc)
    first, second = (float(np.hypot(*np.diff(x.samples, axis=0).T).sum()) for x in (a, b))
    return BentArc(a, b, first / (first + second))


def joined(arcs: list[Arc]) -> list[Arc]:
    """Arcs in which neighbours on one and the same approximated edge are one arc of many parts."""
    out: list[Arc] = []
    for arc in arcs:
        before = out[-1] if out else None
        both = before is not None and _continued(before, arc)
        out[-1:] = [both] if both else [*out[-1:], arc]
    return out


def _continued(a: Arc, b: Arc) -> EdgeArc | None:
    """Two arcs as one, where the second goes on on the same edge and both are polynomials."""
    if not (isinstance(a, EdgeArc) and isinstance(b, EdgeArc)):
        return None
    if a.side is not b.side or a.piece.exact or b.piece.exact or not (a.straight and b.straight):
        return None
    backwards = bool(a.run[0, 0] < 0.0)
    whole = REVERSED if backwards else np.eye(2)
    if not (np.array_equal(a.run, whole) and np.array_equal(b.run, whole)):
        return None
    first, second = (b.piece, a.piece) if backwards else (a.piece, b.piece)
    if first.end != second.start:
        return None
    length = second.end - first.start
    parts: list[Part] = []
    for piece in (first, second):
        low, size = (piece.start - first.start) / length, (piece.end - piece.start) / length
        own = piece.parts or [(0.0, 1.0, piece.net)]
        parts += [(low + p * size, low + q * size, net) for p, q, net in own]
    piece = Piece(first.start, second.end, first.net, False, parts=parts)
    arc = EdgeArc.of(a.side, piece, a.scale)
    return arc.reversed() if backwards else arc
