"""Boundary loops of a face on a curved surface: its curves in (u, v), unwrapped over periods."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray

from .arcs import Arc, Chord, EdgeArc, EdgeSide
from .chains import chain, split_by_turning
from .domain import Domain, Loop, outline, regions_of
from .extract import EdgeUse, RawFace
from .joined_arcs import BentArc, bends
from .surfaces import Surface
from .triangulate import signed_area

#: Share of an edge at a pole that is not worth a vertex of its own.
NEAR_POLE = 0.02


def angle_half(
    surface: Surface, p: FloatArray, q: FloatArray, *, limit: float = 0.3 * math.pi
) -> float:
    """Half of the largest angle a straight line in (u, v) turns around a circle [rad].

    0, which stands for a polynomial, from ``limit`` on.
    """
    angles = [abs(float(q[k] - p[k])) for k in (0, 1) if surface.angular[k]]
    half = 0.5 * max(angles, default=0.0)
    return half if 1e-9 < half < limit else 0.0


def metric(surface: Surface, low: FloatArray, high: FloatArray) -> FloatArray:
    """Mean |P_u| and |P_v| over a box: scale factors that make (u, v) look like the surface."""
    g = (np.arange(6) + 0.5) / 6
    u, v = np.meshgrid(low[0] + g * (high[0] - low[0]), low[1] + g * (high[1] - low[1]))
    out = np.array([speed.mean() for speed in surface.speeds(u.ravel(), v.ravel())])
    if not (np.isfinite(out).all() and (out > 0.0).all()):
        raise GeometryError("the surface is degenerate over the whole face")
    return out


def unwrapped(face: RawFace, surface: Surface) -> list[list[tuple[EdgeUse, FloatArray]]]:
    """Edge uses with the period shift (2,) that joins each one to the one before it."""
    out = []
    for uses in face.loops:
        shifted: list[tuple[EdgeUse, FloatArray]] = []
        at: FloatArray | None = None
        for use in uses:
            assert use.places is not None
            ends = use.places[[0, -1]]
            if use.reversed:
                ends = ends[::-1]
            shift = np.zeros(2)
            if at is not None:
                for k in (0, 1):
                    period = surface.periods[k]
                    if period:
                        shift[k] = period * round(float(at[k] - ends[0, k]) / period)
            at = ends[1] + shift
            shifted.append((use, shift))
        out.append(shifted)
    return out


def curved_domain(face: RawFace, surface: Surface) -> Domain:
    """Loops of a face on a curved surface from its curves in (u, v), at `EdgeUse.places`."""
    chains = unwrapped(face, surface)
    points = [(use.places, shift) for loop in chains for use, shift in loop]
    if not points:
        raise GeometryError("the face has no boundary")
    every = np.concatenate([p + shift for p, shift in points if p is not None])
    low, high = every.min(axis=0), every.max(axis=0)
    if not (high > low).all():
        raise GeometryError("the boundary encloses no area")
    scale = metric(surface, low, high)
    size = float(((high - low) * scale).max())

    def chord(p: FloatArray, q: FloatArray) -> Arc:
        return Chord(p, q, angle_half(surface, p, q), scale)

    loops = []
    for loop in chains:
        arcs: Loop = []
        for use, shift in loop:
            arcs.extend(_edge_arcs(use, shift, surface, scale))
        arcs = _closed_curved(arcs, size, chord, surface)
        if arcs:
            loops.append(arcs)
    loops = _joined_wraps(loops, surface, scale, chord)
    loops = _cut_poles(_in_period(loops, surface, scale))
    return Domain(regions_of(loops), chord, scale, size, False, 0.0)


def _edge_arcs(use: EdgeUse, shift: FloatArray, surface: Surface, scale: FloatArray) -> Loop:
    """Arcs of an edge use in the sense of its loop: one a piece of the edge's chain."""
    curve, edge = use.curve, use.edge
    assert curve is not None
    if use.degenerate:
        out = _pole(use, shift, surface, scale)
    else:
        side = EdgeSide(curve, shift, edge.index)
        length = edge.end - edge.start
        if abs(use.start - edge.start) + abs(use.end - edge.end) > 1e-9 * abs(length):
            side.rate = (use.end - use.start) / length
            side.offset = use.start - side.rate * edge.start
        out = []
        for piece in chain(edge):
            arc = EdgeArc.of(side, piece, scale)
            out.extend([arc] if curve.straight else _turning_parts(arc))
    return [a.reversed() for a in out[::-1]] if use.reversed else out


def _pole(use: EdgeUse, shift: FloatArray, surface: Surface, scale: FloatArray) -> Loop:
    """Chords along an edge that is one point in space, at most a quarter turn each."""
    assert use.curve is not None
    ends = use.curve.evaluate(np.array([use.start, use.end])) + shift
    angle = 2.0 * angle_half(surface, ends[0], ends[1], limit=math.inf)
    n = max(1, math.ceil(angle / (0.5 * math.pi) - 1e-3))
    points = ends[0] + np.linspace(0.0, 1.0, n + 1)[:, None] * (ends[1] - ends[0])
    pole = use.edge.vertices[0]
    out: Loop = []
    for p, q in zip(points[:-1], points[1:], strict=True):
        chord = Chord(p, q, angle_half(surface, p, q), scale, use.edge.index)
        if pole is not None:
            w = chord.weights[:, None]
            chord.net = np.concatenate([pole * w, w], axis=1)
        out.append(chord)
    return out


def _cut_poles(loops: list[Loop]) -> list[Loop]:
    """Loops whose edges at poles are cut beneath the other vertices.

    A cell between the pole and a vertex has a cusp unless it may end at the pole where the
    parameter line of that vertex does.
    """
    poles = [a for loop in loops for a in loop if isinstance(a, Chord) and a.net is not None]
    if not poles:
        return loops
    points = np.array([a.start / a.scale for loop in loops for a in loop])
    out = []
    for loop in loops:
        new: Loop = []
        for arc in loop:
            if isinstance(arc, Chord) and arc.net is not None:
                k = int(np.argmax(np.abs(arc.q - arc.p)))
                share = (points[:, k] - arc.p[k]) / (arc.q[k] - arc.p[k])
                inner = np.unique(share[(share > NEAR_POLE) & (share < 1.0 - NEAR_POLE)])
                inner = inner[np.diff(inner, prepend=0.0) > NEAR_POLE]
                new.extend(arc.cut(inner))
            else:
                new.append(arc)
        out.append(new)
    return out


def _turning_parts(arc: EdgeArc) -> Loop:
    """The arc, halved where its curve in (u, v) turns much more than the edge in space."""
    a, b = arc.parameter(np.array([0.0, 1.0])).tolist()
    n = len(split_by_turning(arc.side.curve, min(a, b), max(a, b))) - 1
    out: Loop = [arc]
    while len(out) < n:
        out = [half for part in out for half in part.halves()]
    return out


def _closed_curved(
    arcs: Loop,
    size: float,
    chord: Callable[[FloatArray, FloatArray], Arc],
    surface: Surface,
) -> Loop:
    """Loop without zero arcs; openings (a missing pole or seam) bridged by chords."""
    arcs = [a for a in arcs if a.extent > 1e-8 * size]
    if not arcs:
        return []
    scale = arcs[0].scale
    out: Loop = []
    for k, arc in enumerate(arcs):
        before = arcs[k - 1]
        if k > 0:
            if math.dist(arc.start, before.end) > 1e-4 * size:
                out.append(chord(before.end / scale, arc.start / scale))
        out.append(arc)
    opening = (arcs[0].start - arcs[-1].end) / scale
    wraps = any(p and abs(abs(opening[k]) - p) < 1e-3 * p for k, p in enumerate(surface.periods))
    if not wraps and np.linalg.norm(opening * scale) > 1e-4 * size:
        out.append(chord(arcs[-1].end / scale, arcs[0].start / scale))
    return out


def _joined_wraps(
    loops: list[Loop],
    surface: Surface,
    scale: FloatArray,
    chord: Callable[[FloatArray, FloatArray], Arc],
) -> list[Loop]:
    """Two loops that each run once around the surface, joined by a seam into one."""
    wrapping: list[Loop] = []
    closed: list[Loop] = []
    for loop in loops:
        step = (loop[-1].end - loop[0].start) / scale
        around = [
            k for k, p in enumerate(surface.periods) if p and abs(abs(step[k]) - p) < 1e-3 * p
        ]
        (wrapping if around else closed).append(loop)
    if not wrapping:
        return loops
    if len(wrapping) != 2:
        raise GeometryError(f"{len(wrapping)} boundary loops run around the surface")
    a, b = wrapping
    k = int(np.argmax(np.abs((a[-1].end - a[0].start) / scale)))
    period = surface.periods[k] or 0.0
    target, source = a[-1].end / scale, b[0].start / scale
    turns = np.zeros(2)
    turns[k] = period * round(float(target[k] - source[k]) / period)
    b = [_shifted(arc, turns) for arc in b]
    joined = [*a, chord(a[-1].end / scale, b[0].start / scale), *b]
    joined.append(chord(b[-1].end / scale, a[0].start / scale))
    return [joined, *closed]


def _shifted(arc: Arc, by: FloatArray) -> Arc:
    assert isinstance(arc, EdgeArc | Chord)
    return arc.moved(by)


def _in_period(loops: list[Loop], surface: Surface, scale: FloatArray) -> list[Loop]:
    """Inner loops moved by whole periods into the box of the outer one."""
    if len(loops) < 2 or not any(surface.periods):
        return loops
    areas = [abs(signed_area(outline(loop))) for loop in loops]
    outer = outline(loops[int(np.argmax(areas))]) / scale
    middle = 0.5 * (outer.min(axis=0) + outer.max(axis=0))
    out = []
    for loop in loops:
        points = outline(loop) / scale
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        by = np.zeros(2)
        for k in (0, 1):
            period = surface.periods[k]
            if period:
                by[k] = period * round(float(middle[k] - center[k]) / period)
        out.append([_shifted(arc, by) for arc in loop] if by.any() else loop)
    return out


def turned_hole(loop: Loop) -> Loop:
    """A smooth hole of four arcs with its corners between those that lie along u and v.

    Neighbouring holes stand in rows along u and v more often than not. Lines between corners in the
    directions of these rows touch the holes, which gives cells with cusps; from corners halfway
    they leave at 45 degrees.
    """
    if len(loop) != 4 or not all(bends(loop[k - 1], loop[k]) for k in range(4)):
        return loop
    corners = np.array([a.start for a in loop])
    spokes = corners - outline(loop).mean(axis=0)
    angle = np.arctan2(spokes[:, 1], spokes[:, 0])
    # Mean of the angles to the nearest axis, as one of angles that repeat every quarter of a turn.
    if np.cos(4.0 * angle).sum() <= 0.0:
        return loop
    halves = [a.halves() for a in loop]
    out: Loop = []
    for k in range(4):
        first, second = halves[k - 1][1], halves[k][0]
        assert isinstance(first, EdgeArc) and isinstance(second, EdgeArc)
        out.append(BentArc(first, second))
    return out
