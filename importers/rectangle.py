"""Faces bounded by parameter lines: one grid of patches, exact wherever the surface allows it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from . import nurbs
from .arcs import Arc, Chord, EdgeArc, arc_weights
from .cells import Cell
from .chains import QUARTER, Conic, split_by_turning
from .curves import BSpline, Curve
from .domain import Domain, outline
from .exact_nets import spline_nets
from .joined_arcs import joined
from .surfaces import Extrusion, Offset, Revolution, SplineSurface, Surface
from .triangulate import signed_area

#: An exact grid with more patches than this competes with an approximate one.
MANY_PATCHES = 100
MANY_SPANS = 24
#: Share of a rectangle or of an edge that is no span of its own.
CLOSE = 1e-4


@dataclass(slots=True)
class Rectangle:
    """Box (u0, u1, v0, v1) of a face and the arcs on its sides v0, u1, v1, u0."""

    box: tuple[float, float, float, float]
    sides: tuple[list[Arc], list[Arc], list[Arc], list[Arc]]

    def edge_at(self, side: int, at: float) -> int:
        """B-rep edge that covers the coordinate ``at`` (u on sides 0 and 2, v on 1 and 3)."""
        axis = 0 if side in (0, 2) else 1
        for arc in self.sides[side]:
            a, b = arc.start[axis] / arc.scale[axis], arc.end[axis] / arc.scale[axis]
            if min(a, b) <= at <= max(a, b):
                return arc.edge
        return -1

    def arc_between(self, side: int, a: float, b: float) -> Arc | None:
        """The edge from coordinate ``a`` to ``b`` along a side, where one covers it."""
        axis = side % 2
        for arc in self.sides[side]:
            if arc.net is None and not isinstance(arc, EdgeArc):
                continue
            ends = (arc.start[axis] / arc.scale[axis], arc.end[axis] / arc.scale[axis])
            length = ends[1] - ends[0]
            low, high = float((a - ends[0]) / length), float((b - ends[0]) / length)
            if low < -CLOSE or high > 1.0 + CLOSE:
                continue
            if isinstance(arc, EdgeArc) and arc.straight:
                return arc.between(max(low, 0.0), min(high, 1.0))
            return arc if low < CLOSE and high > 1.0 - CLOSE else None
        return None


def rectangle(domain: Domain, margin: float, *, lost: float = 1.0) -> Rectangle | None:
    """The rectangle a face fills in (u, v), or None; ``margin`` in file units.

    The face may differ from it by the share ``lost`` of its area.
    """
    if len(domain.regions) != 1 or len(domain.regions[0]) != 1:
        return None
    arcs = domain.regions[0][0]
    every = np.concatenate([a.outline for a in arcs])
    low, high = every.min(axis=0), every.max(axis=0)
    sides: tuple[list[Arc], ...] = ([], [], [], [])
    length = np.zeros(4)
    for arc in arcs:
        p = arc.outline
        distance = (p[:, 1] - low[1], high[0] - p[:, 0], high[1] - p[:, 1], p[:, 0] - low[0])
        k = int(np.argmin([d.max() for d in distance]))
        if distance[k].max() > margin:
            return None
        sides[k].append(arc)
        step = arc.end - arc.start
        length[k] += (step[0], step[1], -step[0], -step[1])[k]
    extent = high - low
    if np.abs(length - extent[[0, 1, 0, 1]]).max() > 4.0 * margin + 1e-9 * extent.max():
        return None
    if lost < 1.0:
        inside = abs(signed_area(outline(arcs)))
        if abs(inside - extent[0] * extent[1]) > lost * inside:
            return None
    u0, v0 = low / domain.scale
    u1, v1 = high / domain.scale
    for k in range(4):
        # The loop may start in the middle of a side.
        sign = 1.0 if k < 2 else -1.0
        sides[k].sort(key=lambda arc: sign * float(arc.start[k % 2]))
    joints = tuple(joined(side) for side in sides)
    return Rectangle((float(u0), float(u1), float(v0), float(v1)), joints)  # type: ignore[arg-type]


Span = tuple[float, float, float, FloatArray | None]


def spans(surface: Surface, k: int, a: float, b: float) -> list[Span]:
    """Intervals (start, end, half angle, weights) of direction k that one patch may cover."""
    if surface.angular[k]:
        return _angles(a, b)
    if isinstance(surface, Offset):
        return spans(surface.base, k, a, b)
    profile = getattr(surface, "profile", None)
    if (isinstance(surface, Revolution) and k == 1) or (isinstance(surface, Extrusion) and k == 0):
        return _profile(profile, a, b)  # type: ignore[arg-type]
    if isinstance(surface, SplineSurface):
        return _spline(surface, k, a, b)
    return [(a, b, 0.0, None)]


def _angles(a: float, b: float) -> list[Span]:
    n = max(1, math.ceil((b - a) / QUARTER - 1e-9))
    cuts = np.linspace(a, b, n + 1).tolist()
    half = 0.5 * (b - a) / n
    return [(p, q, half, None) for p, q in zip(cuts[:-1], cuts[1:], strict=True)]


def _profile(curve: Curve, a: float, b: float) -> list[Span]:
    if isinstance(curve, Conic) and curve.kind == "ellipse":
        return _angles(a, b)
    if isinstance(curve, BSpline) and curve.degree <= 3:
        cuts = curve.breaks(a, b)
        if len(cuts) <= MANY_SPANS:
            out: list[Span] = []
            for p, q in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
                piece, c, d = _local(curve.knots, curve.period, p, q)
                w = nurbs.restricted(curve.pieces[piece][:, -1:], c, d)
                out.append((p, q, 0.0, (nurbs.elevation(curve.degree) @ w)[:, 0]))
            return out
    cuts = split_by_turning(curve, a, b)
    return [(p, q, 0.0, None) for p, q in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)]


def _local(knots: FloatArray, period: float | None, a: float, b: float) -> tuple[int, float, float]:
    """Piece that holds the middle of [a, b], and a and b as its local parameters."""
    middle = float(nurbs.wrap(0.5 * (a + b), float(knots[0]), period))
    piece, local, length = nurbs.locate(knots, np.array([middle]))
    half = 0.5 * (b - a) / float(length[0])
    return int(piece[0]), float(local[0]) - half, float(local[0]) + half


def _spline(s: SplineSurface, k: int, a: float, b: float) -> list[Span]:
    knots = (s.u_knots, s.v_knots)[k]
    degree, period = s.degrees[k], s.periods[k]
    cuts = nurbs.knots_between(knots, period, a, b)
    w = s.pieces[..., 3]
    rational = float(np.ptp(w)) > 1e-12 * float(w.max())
    if degree <= 3 and rational and len(cuts) <= MANY_SPANS:
        out: list[Span] = []
        for p, q in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            piece, c, d = _local(knots, period, p, q)
            row = w[piece, 0, :, 0] if k == 0 else w[0, piece, 0, :]
            r = nurbs.restricted((row / row[0])[:, None], c, d)
            out.append((p, q, 0.0, (nurbs.elevation(degree) @ r)[:, 0]))
        return out
    sharp = (s.sharp_u, s.sharp_v)[k]
    if sharp is None or not len(sharp):
        return [(a, b, 0.0, None)]
    inner = nurbs.knots_between(np.concatenate([knots[:1], sharp, knots[-1:]]), period, a, b)
    return [(p, q, 0.0, None) for p, q in zip(inner[:-1].tolist(), inner[1:].tolist(), strict=True)]


def _joints(r: Rectangle, k: int) -> list[float]:
    """Where the edges on the sides along direction k begin and end, strictly inside."""
    low, high = r.box[2 * k], r.box[2 * k + 1]
    found = sorted(
        float(arc.start[k] / arc.scale[k]) for side in (k, k + 2) for arc in r.sides[side]
    )
    out: list[float] = []
    for at in found:
        if min(at - (out[-1] if out else low), high - at) > CLOSE * (high - low):
            out.append(at)
    return out if len(out) < MANY_SPANS else []


def _divided(surface: Surface, r: Rectangle, k: int) -> list[Span]:
    """Spans of direction k, cut where edges of the border meet: their other faces do so too."""
    cuts = [r.box[2 * k], *_joints(r, k), r.box[2 * k + 1]]
    return [span for a, b in itertools.pairwise(cuts) for span in spans(surface, k, a, b)]


def grid_cells(surface: Surface, r: Rectangle, scale: FloatArray) -> list[Cell]:
    """Cells of the rectangle along parameter lines, with the weights of circular arcs."""
    us, vs = _divided(surface, r, 0), _divided(surface, r, 1)
    cells = []
    for i, (a, b, hu, wu) in enumerate(us):
        for j, (c, d, hv, wv) in enumerate(vs):
            border = (j == 0, i == len(us) - 1, j == len(vs) - 1, i == 0)
            corners = np.array([[a, c], [b, c], [b, d], [a, d]])
            x = arc_weights(hu) if wu is None else wu
            y = arc_weights(hv) if wv is None else wv
            weights = (x * y[0], x[3] * y, x[::-1] * y[3], x[0] * y[::-1])
            free = wu is None and wv is None and not any(surface.angular)
            sides: list[Arc] = []
            for k in range(4):
                p, q = corners[k], corners[(k + 1) % 4]
                arc = r.arc_between(k, p[k % 2], q[k % 2]) if border[k] else None
                fits = arc is not None and np.abs(arc.weights - weights[k]).max() < 1e-9
                if arc is not None and (fits or free):
                    sides.append(arc)
                    continue
                edge = r.edge_at(k, 0.5 * float(p[k % 2] + q[k % 2])) if border[k] else -1
                side = Chord(p, q, (hu, hv, hu, hv)[k], scale, edge)
                side.weights = weights[k]
                sides.append(side)
            cells.append(Cell((sides[0], sides[1], sides[2], sides[3])))
    return cells


def exact_spline(s: SplineSurface, r: Rectangle) -> tuple[FloatArray, IntArray] | None:
    """Exact nets and edges of a B-spline rectangle of degree <= 3, else None."""
    if max(s.degrees) > 3:
        return None
    u0, u1, v0, v1 = r.box
    cu, cv = (
        nurbs.knots_between(s.u_knots, s.periods[0], u0, u1),
        nurbs.knots_between(s.v_knots, s.periods[1], v0, v1),
    )
    us = [_local(s.u_knots, s.periods[0], a, b) for a, b in zip(cu[:-1], cu[1:], strict=True)]
    vs = [_local(s.v_knots, s.periods[1], a, b) for a, b in zip(cv[:-1], cv[1:], strict=True)]
    nets = spline_nets(s.pieces, us, vs)
    if not (nets[..., 3] > 0.0).all():
        return None
    edges = np.full((len(us), len(vs), 4), -1, dtype=np.int64)
    mu, mv = 0.5 * (cu[1:] + cu[:-1]), 0.5 * (cv[1:] + cv[:-1])
    edges[:, 0, 0] = [r.edge_at(0, x) for x in mu]
    edges[-1, :, 1] = [r.edge_at(1, x) for x in mv]
    edges[:, -1, 2] = [r.edge_at(2, x) for x in mu]
    edges[0, :, 3] = [r.edge_at(3, x) for x in mv]
    return nets, edges.reshape(-1, 4)
