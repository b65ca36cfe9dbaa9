"""Boundary loops of a planar face, from the chains of its edges."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, gauss_rule

from . import nurbs
from .arcs import Arc, NetArc, flat_chord
from .chains import chain
from .curves import Conic
from .domain import Domain, Loop, regions_of
from .extract import EdgeUse, RawFace
from .surfaces import Plane


@cache
def _contour_rule() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weights (20,), values and slopes (20, 4) of cubics at the places of the rule for a side."""
    x, w = gauss_rule(10)
    x, w = np.concatenate([0.5 * x, 0.5 + 0.5 * x]), np.concatenate([0.5 * w, 0.5 * w])
    return w, bernstein(x), bernstein_derivative(x)


def enclosed_area(domain: Domain) -> float:
    """Area inside the loops of a planar face, ½ ∮ (x dy − y dx) over their rational cubics."""
    arcs = [a for r in domain.regions for loop in r for a in loop]
    flat = np.array([a.flat for a in arcs if isinstance(a, NetArc)])
    flat[..., :2] -= flat[:1, :1, :2] / flat[:1, :1, 2:] * flat[..., 2:]
    w, basis, derivative = _contour_rule()
    h, slope = basis @ flat, derivative @ flat
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
    holes = len(face.loops) > 1
    along = _main_direction(face, to_flat) if holes else 0.0
    for uses in face.loops:
        loop: Loop = _whole_circle(uses, to_flat, along) if holes else []
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
                    loop[-1] = flat_chord(loop[-1].start, loop[-1].end, lift)
                    loop[-1].edge = use.edge.index
                else:
                    exact &= is_exact
        if loop:
            loops.append(loop)
    box = np.concatenate([a.outline for loop in loops for a in loop]) if loops else np.zeros((1, 2))
    size = float(np.ptp(box, axis=0).max())
    cleaned = []
    for loop in loops:
        done, opening = _closed_planar(loop, size, lift)
        gap = max(gap, opening)
        if done:
            cleaned.append(done)

    def chord(p: FloatArray, q: FloatArray) -> Arc:
        return flat_chord(p, q, lift)

    return Domain(regions_of(cleaned), chord, np.ones(2), size, exact, gap)


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
    (ax, ay), (bx, by) = first.x @ to_flat[:3, :2], first.y @ to_flat[:3, :2]
    sense = 1.0 if ax * by - ay * bx > 0.0 else -1.0
    phase = sense * (along + 0.25 * math.pi - math.atan2(start[1], start[0]))
    arcs: Loop = []
    backwards = uses[0].reversed
    for k in range(4):
        a = phase + 0.5 * math.pi * k
        (quarter,) = first.quadratics(np.array([a, a + 0.5 * math.pi]))
        net = nurbs.elevation(2) @ quarter
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
    loop = [a for a in loop if a.extent > weld]
    if not loop:
        return [], 0.0
    gap = 0.0
    for k, arc in enumerate(loop):
        before = loop[k - 1]
        assert isinstance(before, NetArc) and isinstance(arc, NetArc)
        opening = math.dist(before.end, arc.start)
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
    (p, q), (r, s) = a.ends.tolist(), b.ends.tolist()
    dx, dy, ex, ey = q[0] - p[0], q[1] - p[1], s[0] - r[0], s[1] - r[1]
    length = math.hypot(dx, dy) + math.hypot(ex, ey)
    return abs(dx * ey - dy * ex) <= weld * length * 1e-2 and dx * ex + dy * ey > 0.0
