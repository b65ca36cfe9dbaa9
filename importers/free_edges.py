"""Edges of a part at which nothing goes on: one face ends there and no other begins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, gauss_rule

from .chains import chain
from .extract import Edge, RawFace

#: Where two edges are compared between their ends.
INNER = np.linspace(0.0, 1.0, 33)
#: A direction that no model is aligned with, along which edges are sorted.
ASKEW = np.array([0.5773, 0.6081, 0.5450])


def free_lengths(raws: Sequence[RawFace], tolerance: float) -> list[float]:
    """Length of the free edges of each face of a part. [file units]

    An edge is free when one face alone uses it, once, and no other such edge lies on it within
    ``tolerance``: faces that were never sewn together close up all the same.
    """
    uses = [(i, use.edge) for i, r in enumerate(raws) for loop in r.loops for use in loop]
    count = Counter(edge.index for _, edge in uses)
    lone = [(i, e) for i, e in uses if count[e.index] == 1 and e.curve is not None]
    out = [0.0] * len(raws)
    if not lone:
        return out
    points = np.array([_points(edge) for _, edge in lone])
    for (i, edge), met in zip(lone, _met(points, tolerance), strict=True):
        if not met:
            out[i] += _length(edge)
    return out


def _points(edge: Edge) -> FloatArray:
    assert edge.curve is not None
    return edge.curve.evaluate(edge.start + (edge.end - edge.start) * INNER)


def _met(points: FloatArray, tolerance: float) -> list[bool]:
    """Which of some edges (n, k, 3) another one of them lies on."""
    middle = 0.5 * (points[:, 0] + points[:, -1])
    place = middle @ ASKEW
    order = np.argsort(place, kind="stable")
    first = np.searchsorted(place[order], place - 2.0 * tolerance)
    last = np.searchsorted(place[order], place + 2.0 * tolerance, side="right")
    out = []
    for i, own in enumerate(points):
        others = order[first[i] : last[i]]
        others = others[others != i]
        others = others[np.abs(middle[others] - middle[i]).max(axis=1) <= tolerance]
        out.append(any(_same(own, points[j], tolerance) for j in others.tolist()))
    return out


def _same(a: FloatArray, b: FloatArray, tolerance: float) -> bool:
    """Whether edges (k, 3) have the same ends, and the middle of one lies on the other."""
    if np.abs(b[0] - a[0]).max() > tolerance:
        b = b[::-1]
    if max(np.abs(b[0] - a[0]).max(), np.abs(b[-1] - a[-1]).max()) > tolerance:
        return False
    d = np.diff(b, axis=0)
    away = a[len(a) // 2] - b[:-1]
    share = np.clip((away * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300), 0.0, 1.0)
    off = np.linalg.norm(away - share[:, None] * d, axis=1)
    # Chords of the polygon leave a curve by an eighth of their length times the angle it turns,
    # there where the middle is.
    nearest = int(off.argmin())
    bend = np.linalg.norm(np.diff(d[max(nearest - 1, 0) : nearest + 2], axis=0), axis=1)
    return bool(off[nearest] <= tolerance + bend.max(initial=0.0) / 8.0)


def _length(edge: Edge) -> float:
    x, w = gauss_rule(8)
    try:
        nets = np.array([net for piece in chain(edge) for net in piece.cubics])
    except (GeometryError, np.linalg.LinAlgError, ArithmeticError, IndexError, ValueError):
        # Faces with such an edge are not converted, which is said of them; its length is near this.
        return float(np.linalg.norm(np.diff(_points(edge), axis=0), axis=1).sum())
    h, slope = bernstein(x) @ nets, bernstein_derivative(x) @ nets
    d = (slope[..., :3] - slope[..., 3:] * h[..., :3] / h[..., 3:]) / h[..., 3:]
    return float((np.linalg.norm(d, axis=2) @ w).sum())
