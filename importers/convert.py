"""One face to patches: the cascade from exact to approximate, and its line of the certificate."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model import bezier
from patchlight.solver.model.arrays import FloatArray, IntArray

from .area import curved_area, planar_area
from .cells import Cell
from .curves import Projected
from .domain import Domain, curved_domain, planar_domain
from .extract import RawFace
from .lift import Lifted, lifted, planar_net
from .moments import vector_areas
from .quadrangulate import cells_of
from .rectangle import MANY_PATCHES, Rectangle, exact_spline, grid_cells, rectangle
from .surfaces import Plane, SplineSurface, Surface

#: Relative error below which a measured quantity counts as rounding.
ROUNDING = 1e-9
#: Largest relative error of a face's own area.
AREA_LIMIT = 1e-4


@dataclass(slots=True)
class FacePatches:
    """Patches of one face in file units, and the measurements of the certificate."""

    kind: str
    nets: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 4, 4)))
    edges: IntArray = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    exact: bool = False
    deviation: float = 0.0
    angle_deg: float = 0.0
    gap: float = 0.0
    area: float = 0.0
    area_error: float = float("nan")
    reason: str = ""


def convert_face(raw: RawFace, tolerance: float, angle_deg: float, size: float) -> FacePatches:
    """Patches of a face; ``tolerance`` and ``size`` of the part in file units. Never raises for
    geometry: a face that cannot be converted has no patch and a reason."""
    if raw.surface is None:
        return FacePatches("other", reason=raw.reason)
    kind = raw.surface.kind
    try:
        if isinstance(raw.surface, Plane):
            out = _planar(raw, raw.surface, tolerance)
        else:
            out = _curved(raw, raw.surface, tolerance, angle_deg, size)
    except (GeometryError, FloatingPointError, np.linalg.LinAlgError) as error:
        return FacePatches(kind, reason=str(error))
    except (ArithmeticError, IndexError, ValueError) as error:
        return FacePatches(kind, reason=f"unexpected geometry ({error})")
    if raw.reversed and len(out.nets):
        out.nets = out.nets[:, ::-1]
        out.edges = out.edges[:, [0, 3, 2, 1]]
    out.nets = np.ascontiguousarray(out.nets)
    return out


def _drop_empty(nets: FloatArray, edges: IntArray) -> tuple[FloatArray, IntArray, FloatArray]:
    """Without patches of no area (collapsed to a line or point), which carry no light."""
    areas = bezier.areas(nets)
    if not np.isfinite(areas).all() or not (nets[..., 3] > 0.0).all():
        raise GeometryError("a patch is not finite or has a weight that is not positive")
    keep = areas > 1e-13 * areas.sum()
    return nets[keep], edges[keep], areas[keep]


def _relative(found: float, wanted: float) -> float:
    return abs(found - wanted) / wanted if wanted > 0.0 else float("nan")


def _planar(raw: RawFace, surface: Plane, tolerance: float) -> FacePatches:
    domain = planar_domain(raw, surface, 0.1 * tolerance)
    wanted = planar_area(raw, surface)
    if wanted <= 1e-12 * domain.size**2:
        raise GeometryError("the boundary encloses no area")
    best: FacePatches | None = None
    reason = ""
    for attempt in range(3):
        try:
            cells = _cells(domain, attempt, planar=True)
        except GeometryError as error:
            reason = reason or str(error)
            continue
        nets = np.array([planar_net(c) for c in cells])
        edges = np.array([c.edges for c in cells])
        nets, edges, areas = _drop_empty(nets, edges)
        area = float(areas.sum())
        out = FacePatches(
            "plane", nets, edges, domain.exact, 0.0, 0.0, domain.gap, area, _relative(area, wanted)
        )
        if best is None or out.area_error < best.area_error:
            best = out
        if out.area_error < (1e-7 if domain.exact else 0.3 * AREA_LIMIT):
            break
        reason = "cells overlap"
    if best is None or best.area_error > 1e-2:
        raise GeometryError(reason)
    if not domain.exact:
        best.deviation = 0.1 * tolerance
        best.reason = "an edge is not a line, a conic or a spline of degree <= 3"
    elif best.area_error > 1e-6:
        best.exact = False
        best.deviation = max(domain.gap, 0.0)
        best.reason = "the edges of the boundary do not meet exactly"
    return best


def _folded(cells: list[Cell]) -> list[Cell]:
    """Planar cells whose area is larger than their vector area: somewhere they turn over."""
    nets = np.array([planar_net(c) for c in cells])
    areas = bezier.areas(nets)
    vectors = vector_areas(nets)
    excess = areas - np.linalg.norm(vectors, axis=1)
    return [c for c, e in zip(cells, excess, strict=True) if e > 1e-8 * areas.sum()]


def _cells(domain: Domain, attempt: int, *, planar: bool) -> list:
    """Cells of all regions; later attempts start from arcs cut in two."""
    cells = []
    for region in domain.regions:
        loops = region
        for _ in range(attempt):
            loops = [
                [part for a in loop for part in (a.halves() if not a.straight else (a,))]
                for loop in loops
            ]
        folded = _folded if planar else None
        cells.extend(cells_of(loops, domain.chord, planar=planar, folded=folded))
    return cells


def follow_edges(raw: RawFace, surface: Surface, limit: float) -> None:
    """Replace curves in (u, v) that leave their edge by more than ``limit`` by projections of it.

    Files hold such curves (polygons, other parameters), and patches of both faces must end at the
    edge.
    """
    f = np.array([0.0, 0.13, 0.25, 0.38, 0.5, 0.62, 0.75, 0.87, 1.0])
    for uses in raw.loops:
        for use in uses:
            edge = use.edge
            if edge.curve is None or use.curve is None:
                continue
            uv = use.curve.evaluate(use.start + (use.end - use.start) * f)
            x = edge.curve.evaluate(edge.start + (edge.end - edge.start) * f)
            off = np.linalg.norm(surface.points(uv[:, 0], uv[:, 1]) - x, axis=1).max()
            if off <= limit or use.end == use.start:
                continue
            rate = (edge.end - edge.start) / (use.end - use.start)
            better = Projected(use.curve, surface, edge.curve, use.start, rate, edge.start)
            uv = better.evaluate(use.start + (use.end - use.start) * f)
            now = np.linalg.norm(surface.points(uv[:, 0], uv[:, 1]) - x, axis=1).max()
            if now < 0.5 * off:
                use.curve = better


def _edge_gap(raw: RawFace) -> float:
    """Largest distance between the surface along the boundary and the edges in space."""
    uv, space = [], []
    for uses in raw.loops:
        for use in uses:
            if use.edge.curve is None or use.curve is None:
                continue
            f = np.linspace(0.0, 1.0, 7)
            uv.append(use.curve.evaluate(use.start + (use.end - use.start) * f))
            edge = use.edge
            space.append(edge.curve.evaluate(edge.start + (edge.end - edge.start) * f))  # type: ignore[union-attr]
    if not uv or raw.surface is None:
        return 0.0
    p = np.concatenate(uv)
    x = raw.surface.points(p[:, 0], p[:, 1])
    return float(np.linalg.norm(x - np.concatenate(space), axis=1).max())


def _curved(
    raw: RawFace, surface: Surface, tolerance: float, angle_deg: float, size: float
) -> FacePatches:
    domain = curved_domain(raw, surface)
    gap = _edge_gap(raw)
    box = rectangle(domain, min(1e-6 * domain.size, 0.1 * tolerance))
    if gap > 0.02 * tolerance and (box is None or gap > tolerance):
        follow_edges(raw, surface, 0.02 * tolerance)
        domain = curved_domain(raw, surface)
        gap = _edge_gap(raw)
        box = rectangle(domain, min(1e-6 * domain.size, 0.1 * tolerance))
    wanted = curved_area(surface, domain)
    if wanted <= 1e-13 * domain.size**2:
        raise GeometryError("the boundary encloses no area")
    if box is None:
        # Nearly a rectangle: taken as one when its area says that nothing is lost.
        box = rectangle(domain, min(1e-4 * domain.size, 0.1 * tolerance))
        if box is not None and not _relative(_box_area(surface, box), wanted) < 2e-5:
            box = None
    # The tolerance follows the part, but a small face must keep its own area and shape as well.
    fine = min(tolerance, 1e-3 * max(domain.size, 1e-300))
    if box is not None and isinstance(surface, SplineSurface):
        found = exact_spline(surface, box)
        if found is not None:
            nets, edges, areas = _drop_empty(*found)
            area = float(areas.sum())
            out = FacePatches(
                surface.kind, nets, edges, True, 0.0, 0.0, gap, area, _relative(area, wanted)
            )
            if len(nets) <= MANY_PATCHES:
                return out
            other = _adaptive(surface, domain, box, wanted, fine, angle_deg, gap, size)
            return other if 2 * len(other.nets) < len(nets) and not other.reason else out
    out = _adaptive(surface, domain, box, wanted, fine, angle_deg, gap, size)
    if box is not None and "tolerance" in out.reason and not _singular(surface, box):
        # Knots of low continuity may spoil a cell that crosses them: cut there and compare.
        cut = _adaptive(surface, domain, box, wanted, fine, angle_deg, gap, size, at_knots=True)
        if not cut.reason.startswith(("area", "the tol")) or len(cut.nets) < len(out.nets):
            return cut
    return out


def _singular(surface: Surface, box: Rectangle) -> bool:
    """Whether the surface has no normal somewhere on its border: then no cut helps."""
    u0, u1, v0, v1 = box.box
    f = np.linspace(0.0, 1.0, 9)
    u, v = np.meshgrid(u0 + (u1 - u0) * f, v0 + (v1 - v0) * f, indexing="ij")
    _, a, b = surface.evaluate(u, v)
    j = np.linalg.norm(np.cross(a, b), axis=-1)
    return bool(j.min() < 1e-5 * j.max())


def _box_area(surface: Surface, box: Rectangle) -> float:
    """Area of the surface over a rectangle, by Gauss quadrature. [file units²]"""
    u0, u1, v0, v1 = box.box
    x, w = bezier.gauss_rule(16)
    u, v = np.meshgrid(u0 + (u1 - u0) * x, v0 + (v1 - v0) * x, indexing="ij")
    _, a, b = surface.evaluate(u, v)
    j = np.linalg.norm(np.cross(a, b), axis=-1)
    return float(w @ j @ w) * (u1 - u0) * (v1 - v0)


def _adaptive(
    surface: Surface,
    domain: Domain,
    box: Rectangle | None,
    wanted: float,
    tolerance: float,
    angle_deg: float,
    gap: float,
    size: float,
    at_knots: bool = False,
) -> FacePatches:
    best: FacePatches | None = None
    reason = ""
    snap = max(10.0 * tolerance, 2.0 * gap)
    for attempt in range(4):
        try:
            if box is not None:
                cells = grid_cells(surface, box, domain.scale, at_knots=at_knots)
            else:
                cells = _cells(domain, attempt // 2, planar=False)
        except GeometryError as error:
            reason = reason or str(error)
            continue
        result: Lifted = lifted(surface, cells, tolerance, angle_deg, snap)
        nets, edges, areas = _drop_empty(result.nets, result.edges)
        area = float(areas.sum())
        off = _relative(area, wanted)
        exact = result.deviation <= ROUNDING * size and result.angle_deg < 1e-4
        exact = exact and result.gap <= 1e-7 * size and not off > 1e-6
        out = FacePatches(
            surface.kind, nets, edges, exact, result.deviation, result.angle_deg,
            max(gap, result.gap), area, off,
        )  # fmt: skip
        if not exact:
            out.reason = "trimmed curved surface" if box is None else "surface of higher degree"
            if not result.converged:
                out.reason = "the tolerance was not reached"
        if best is None or not best.area_error < out.area_error:
            best = out
        if math.isnan(off) or off <= AREA_LIMIT:
            break
        tolerance *= 0.2
    if best is None:
        raise GeometryError(reason or "no valid decomposition into four-sided cells")
    if best.area_error > 0.02:
        raise GeometryError(f"cells overlap: area off by {best.area_error:.1%}")
    if best.area_error > AREA_LIMIT:
        best.reason = f"area off by {best.area_error:.1e}"
    return best
