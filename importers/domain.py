"""Boundary loops of a face in (u, v): pieces of edges, unwrapped over the periods, in regions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, gauss_rule

from . import nurbs
from .arcs import Arc, Chord, EdgeArc, EdgeSide, NetArc, flat_chord
from .chains import chain, split_by_turning
from .curves import Conic
from .extract import EdgeUse, RawFace
from .surfaces import Plane, Surface
from .triangulate import inside, signed_area

Loop = list[Arc]
#: Share of an edge at a pole that is not worth a vertex of its own.
NEAR_POLE = 0.02


@dataclass(slots=True)
class Domain:
    """Regions of a face (outer loop first in each) with the maker of their chords."""

    regions: list[list[Loop]]
    chord: Callable[[FloatArray, FloatArray], Arc]
    scale: FloatArray
    size: float
    exact: bool
    gap: float

    @property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (2,) in (u, v)."""
        every = np.concatenate([a.samples for r in self.regions for loop in r for a in loop])
        return every.min(axis=0) / self.scale, every.max(axis=0) / self.scale


def enclosed_area(domain: Domain) -> float:
    """Area inside the loops of a planar face, ½ ∮ (x dy − y dx) over their rational cubics."""
    arcs = [a for r in domain.regions for loop in r for a in loop]
    flat = np.array([a.flat for a in arcs if isinstance(a, NetArc)])
    flat[..., :2] -= flat[:1, :1, :2] / flat[:1, :1, 2:] * flat[..., 2:]
    x, w = gauss_rule(10)
    x, w = np.concatenate([0.5 * x, 0.5 + 0.5 * x]), np.concatenate([0.5 * w, 0.5 * w])
    h, slope = bernstein(x) @ flat, bernstein_derivative(x) @ flat
    p = h[..., :2] / h[..., 2:]
    d = (slope[..., :2] - slope[..., 2:] * p) / h[..., 2:]
    return 0.5 * float((p[..., 0] * d[..., 1] - p[..., 1] * d[..., 0]).sum(axis=0) @ w)


def planar_domain(face: RawFace, surface: Plane) -> Domain:
    """Loops of a planar face from the chains of its edges."""
    o, x, y, _ = surface.frame
    to_flat = np.zeros((4, 3))
    to_flat[:3, 0], to_flat[:3, 1], to_flat[3, 2] = x, y, 1.0
    to_flat[3, 0], to_flat[3, 1] = -o @ x, -o @ y
    lift = np.zeros((3, 4))
    lift[0, :3], lift[1, :3], lift[2, :3], lift[2, 3] = x, y, o, 1.0
    loops: list[Loop] = []
    exact, gap = True, 0.0
    along = _main_direction(face, to_flat)
    for uses in face.loops:
        loop: Loop = _whole_circle(uses, to_flat, along) if len(face.loops) > 1 else []
        if loop:
            loops.append(loop)
            continue
        for use in uses:
            straight = use.edge.curve is not None and use.edge.curve.straight
            cubics = [(n, p.exact) for p in chain(use.edge) for n in p.cubics]
            for forward, is_exact in cubics[::-1] if use.reversed else cubics:
                net = forward[::-1] if use.reversed else forward
                loop.append(NetArc(net, net @ to_flat, use.edge.index, straight, is_exact))
                if not straight and _is_line(loop[-1].samples):
                    ends = loop[-1].samples
                    loop[-1] = flat_chord(ends[0], ends[-1], lift)
                    loop[-1].edge = use.edge.index
                else:
                    exact &= is_exact
        if loop:
            loops.append(loop)
    box = np.concatenate([a.samples for loop in loops for a in loop]) if loops else np.zeros((1, 2))
    size = float(np.ptp(box, axis=0).max())
    cleaned = []
    for loop in loops:
        done, opening = _closed_planar(loop, size, lift)
        gap = max(gap, opening)
        if done:
            cleaned.append(done)

    def chord(p: FloatArray, q: FloatArray) -> Arc:
        return flat_chord(p, q, lift)

    return Domain(_regions(cleaned), chord, np.ones(2), size, exact, gap)


def _main_direction(face: RawFace, to_flat: FloatArray) -> float:
    """Angle in the plane of the longest straight edge of a face [rad]; 0 without one."""
    longest, angle = 0.0, 0.0
    for uses in face.loops:
        for use in uses:
            if use.edge.curve is None or not use.edge.curve.straight:
                continue
            ends = use.edge.curve.evaluate(np.array([use.edge.start, use.edge.end]))
            d = (ends[1] - ends[0]) @ to_flat[:3, :2]
            length = float(np.linalg.norm(d))
            if length > longest * (1.0 + 1e-9):
                longest, angle = length, math.atan2(d[1], d[0])
    return angle


def _whole_circle(uses: list[EdgeUse], to_flat: FloatArray, along: float) -> Loop:
    """Four arcs of a loop that is one full circle, else nothing.

    The arcs end at 45 degrees to the main direction of the face, where the diagonals between
    neighbouring holes and towards the corners leave: tangent diagonals would give cusps. The
    circle is the same on the other face of the edge, wherever that one has its corners.
    """
    first = uses[0].edge.curve
    if not (isinstance(first, Conic) and first.kind == "ellipse"):
        return []
    radius = float(np.linalg.norm(first.x))
    total = 0.0
    for use in uses:
        c = use.edge.curve
        if not (isinstance(c, Conic) and c.kind == "ellipse"):
            return []
        off = max(
            np.abs(c.center - first.center).max(),
            *(abs(float(np.linalg.norm(a)) - radius) for a in (c.x, c.y)),
        )
        if off > 1e-9 * radius:
            return []
        total += use.edge.end - use.edge.start
    if abs(total - 2.0 * math.pi) > 1e-7:
        return []
    start = (first.x @ to_flat[:3, 0], first.x @ to_flat[:3, 1])
    turn = float(np.cross(first.x, first.y) @ np.cross(to_flat[:3, 0], to_flat[:3, 1]))
    sense = 1.0 if turn > 0.0 else -1.0
    phase = sense * (along + 0.25 * math.pi - math.atan2(start[1], start[0]))
    arcs: Loop = []
    backwards = uses[0].reversed
    for k in range(4):
        a = phase + 0.5 * math.pi * k
        net = nurbs.elevation(2) @ first.quadratic(a, a + 0.5 * math.pi)
        if backwards:
            net = net[::-1]
        edge = _edge_on_circle(uses, first.evaluate(np.array([a + 0.25 * math.pi]))[0])
        arcs.append(NetArc(net, net @ to_flat, edge, False))
    return arcs[::-1] if backwards else arcs


def _edge_on_circle(uses: list[EdgeUse], point: FloatArray) -> int:
    """Edge of a circle that holds ``point``."""
    for use in uses:
        c = use.edge.curve
        assert isinstance(c, Conic)
        d = point - c.center
        t = math.atan2(float(d @ c.y), float(d @ c.x))
        if (t - use.edge.start) % (2.0 * math.pi) <= use.edge.end - use.edge.start + 1e-12:
            return use.edge.index
    return -1


def _is_line(points: FloatArray) -> bool:
    """Whether points (n, 2) run straight from the first to the last one, to rounding."""
    d = points[-1] - points[0]
    length = float(np.linalg.norm(d))
    if length == 0.0:
        return False
    e = points - points[0]
    along = e @ d / length
    off = np.abs(e[:, 0] * d[1] - e[:, 1] * d[0]).max() / length
    return bool(off <= 1e-9 * length and (np.diff(along) > 0.0).all())


def _closed_planar(loop: Loop, size: float, lift: FloatArray) -> tuple[Loop, float]:
    """Loop without zero arcs, its joints closed and straight joints merged."""
    weld = 1e-7 * size
    loop = [a for a in loop if np.ptp(a.samples, axis=0).max() > weld]
    if not loop:
        return [], 0.0
    gap = 0.0
    for k, arc in enumerate(loop):
        before = loop[k - 1]
        assert isinstance(before, NetArc) and isinstance(arc, NetArc)
        opening = float(np.linalg.norm(before.end - arc.start))
        gap = max(gap, opening)
        if opening > 0.0 and opening <= 1e-2 * size:
            net, flat = before.net.copy(), before.flat.copy()
            net[3], flat[3] = arc.net[0], arc.flat[0]
            loop[k - 1] = NetArc(net, flat, before.edge, before.straight, before.exact)
        elif opening > 1e-2 * size:
            raise GeometryError(f"the boundary is open by {opening:.3g} file units")
    if len(loop) > 3:
        loop = _merged_straight(loop, lift, weld)
    return loop, gap


def _merged_straight(loop: Loop, lift: FloatArray, weld: float) -> Loop:
    """Straight arcs that continue one another joined into one."""
    out: Loop = []
    n = len(loop)
    # Start behind a true corner, so that no straight run wraps around.
    first = next((k for k in range(n) if not _continues(loop[k - 1], loop[k], weld)), 0)
    for k in range(n):
        arc = loop[(first + k) % n]
        if out and _continues(out[-1], arc, weld):
            longer = max(out[-1], arc, key=lambda a: float(np.linalg.norm(a.end - a.start)))
            joined = flat_chord(out[-1].start, arc.end, lift)
            joined.edge = longer.edge
            out[-1] = joined
        else:
            out.append(arc)
    return out if len(out) > 2 else loop


def _continues(a: Arc, b: Arc, weld: float) -> bool:
    if not (a.straight and b.straight):
        return False
    d, e = a.end - a.start, b.end - b.start
    length = float(np.linalg.norm(d) + np.linalg.norm(e))
    return abs(d[0] * e[1] - d[1] * e[0]) <= weld * length * 1e-2 and float(d @ e) > 0.0


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
    _, pu, pv = surface.evaluate(u.ravel(), v.ravel())
    out = np.array([np.linalg.norm(pu, axis=-1).mean(), np.linalg.norm(pv, axis=-1).mean()])
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
            assert use.curve is not None
            ends = use.curve.evaluate(np.array([use.start, use.end]))
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
    """Loops of a face on a curved surface from its curves in (u, v)."""
    chains = unwrapped(face, surface)
    points = []
    for loop in chains:
        for use, shift in loop:
            t = np.linspace(use.start, use.end, 9)
            points.append(use.curve.evaluate(t) + shift)  # type: ignore[union-attr]
    if not points:
        raise GeometryError("the face has no boundary")
    every = np.concatenate(points)
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
    return Domain(_regions(loops), chord, scale, size, False, 0.0)


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
    n = len(split_by_turning(arc.side.curve, min(a, b), max(a, b), limit=0.6 * math.pi)) - 1
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
    arcs = [a for a in arcs if np.ptp(a.samples, axis=0).max() > 1e-8 * size]
    if not arcs:
        return []
    scale = arcs[0].scale
    out: Loop = []
    for k, arc in enumerate(arcs):
        before = arcs[k - 1]
        if k > 0:
            opening = arc.start - before.end
            if np.linalg.norm(opening) > 1e-4 * size:
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


def outline(loop: Loop) -> FloatArray:
    """Closed polygon (n, 2) of a loop in scaled coordinates."""
    return np.concatenate([a.samples[:-1] for a in loop])


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


def _regions(loops: list[Loop]) -> list[list[Loop]]:
    """Loops grouped: each counter-clockwise loop with the clockwise ones inside it."""
    if not loops:
        raise GeometryError("the face has no boundary of any length")
    areas = np.array([signed_area(outline(loop)) for loop in loops])
    biggest = int(np.argmax(np.abs(areas)))
    if areas[biggest] == 0.0 or abs(areas[biggest]) < 1e-14 * _extent(loops[biggest]) ** 2:
        raise GeometryError("the boundary encloses no area")
    if areas[biggest] < 0.0:
        loops = [[a.reversed() for a in loop[::-1]] for loop in loops]
        areas = -areas
    keep = np.abs(areas) > 1e-12 * areas[biggest]
    outer = [k for k in np.argsort(-areas) if areas[k] > 0.0 and keep[k]]
    if len(outer) > 1:
        # A second loop of the same sense inside the outer one is a hole drawn the wrong way round.
        border = outline(loops[biggest])
        for k in list(outer[1:]):
            if inside(border, outline(loops[k])[:1])[0]:
                loops[k] = [a.reversed() for a in loops[k][::-1]]
                areas[k] = -areas[k]
                outer.remove(k)
    regions = {int(k): [loops[k]] for k in outer}
    for k in range(len(loops)):
        if areas[k] >= 0.0 or not keep[k]:
            continue
        point = outline(loops[k])[:1]
        home = biggest
        if len(outer) > 1:
            home = next(
                (int(m) for m in outer[::-1] if inside(outline(loops[m]), point)[0]), biggest
            )
        regions[home].append(loops[k])
    return list(regions.values())


def _extent(loop: Loop) -> float:
    return float(np.ptp(outline(loop), axis=0).max())
