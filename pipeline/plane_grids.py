"""Sensors on a horizontal plane over a floor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Sensors
from patchlight.solver.model.arrays import FloatArray

from .assigning import find_faces, row_offsets
from .floors import PlanView, floor_outline

if TYPE_CHECKING:
    from .grids import PlaneRule
    from .scene import Scene

#: More sensors than this are a mistyped spacing.
MOST_POINTS = 200_000
#: More than this on a floor that nobody named are told: it may be the terrain about the building.
MANY_POINTS = 5000


def sensors_on_plane(
    name: str, rule: PlaneRule, scene: Scene, view: PlanView
) -> tuple[Sensors, list[str]]:
    """Sensors of ``rule`` in scene axes, and what to say about them."""
    what = f"sensors {name!r}"
    plan = _area(what, rule, scene, view)
    if rule.margin > 0.0:
        plan = plan.buffer(-rule.margin, join_style="mitre")
    if plan.is_empty:
        raise InputError(
            f"{what}: nothing is left of the floor inside the margin of {rule.margin:g} m"
        )
    points, areas = plane_cells(what, plan, rule.spacing)
    xyz = np.column_stack([points, np.full(len(points), rule.z)])
    free, notes = outside_solids(what, xyz, view)
    if rule.over is None and rule.bounds is None and len(points) > MANY_POINTS:
        x0, y0, x1, y1 = plan.bounds
        notes.append(
            f"{what}: {len(points)} points on the largest floor below z = {rule.z:g} m, "
            f"{x1 - x0:.4g} x {y1 - y0:.4g} m; name another one with over, or give bounds"
        )
    loops = [np.column_stack([ring, np.full(len(ring), rule.z)]) for ring in rings(plan)]
    sensors = Sensors(
        name,
        xyz[free],
        np.broadcast_to(rule.normal, (int(free.sum()), 3)),
        areas[free],
        outline=tuple(loops),
    )
    return sensors, notes


def outside_solids(what: str, points: FloatArray, view: PlanView) -> tuple[np.ndarray, list[str]]:
    """Which points (n, 3) [m] are not inside a solid, and what to say about the others."""
    from patchlight.solver.containment import inside_solids

    inside = np.asarray(inside_solids(view.data, points), dtype=bool)
    if inside.all():
        raise InputError(
            f"{what}: all {len(points)} points lie inside solids; a room that is modelled as its "
            "own volume needs Air (air = true)"
        )
    count = int(inside.sum())
    dropped = [f"{what}: {count} of {len(points)} points lie inside solids: dropped"]
    return ~inside, dropped if count else []


def _area(what: str, rule: PlaneRule, scene: Scene, view: PlanView) -> Any:
    """Plan of the measured area before the margin."""
    import shapely

    if rule.bounds is not None:
        return shapely.box(*rule.bounds)
    if rule.over is None:
        plan, _ = floor_outline(view, rule.z)
        if plan is None:
            raise InputError(
                f"{what}: no flat floor below z = {rule.z:g} m; name it with over, or give bounds "
                "(x0, y0, x1, y1)"
            )
        return plan
    _, face_start = row_offsets(scene.entries)
    rows = [
        face_start[match.entry] + row
        for match in find_faces(scene.entries, rule.over, label=f"{what}: over = {rule.over!r}")
        for row in match.rows
    ]
    chosen = np.flatnonzero(np.isin(view.patches.face_index, rows) & view.upward)
    if not len(chosen):
        raise InputError(f"{what}: over = {rule.over!r}: has no flat horizontal face looking up")
    return view.outline(chosen)


def plane_cells(what: str, plan: Any, spacing: float | str) -> tuple[FloatArray, FloatArray]:
    """Centres (n, 2) [m] of equal cells whose centre is in ``plan``, and their areas in it [m²]."""
    import shapely

    x0, y0, x1, y1 = plan.bounds
    step = en12464_spacing(x1 - x0, y1 - y0) if isinstance(spacing, str) else float(spacing)
    nx, ny = cell_count(x1 - x0, step), cell_count(y1 - y0, step)
    if nx * ny > MOST_POINTS:
        raise InputError(
            f"{what}: a spacing of {step:g} m makes {nx} x {ny} cells; at most {MOST_POINTS}"
        )
    x, y = np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1)
    left, bottom = (a.ravel() for a in np.meshgrid(x[:-1], y[:-1]))
    dx, dy = (x1 - x0) / nx, (y1 - y0) / ny
    centres = np.column_stack([left + 0.5 * dx, bottom + 0.5 * dy])
    shapely.prepare(plan)
    within = shapely.contains_xy(plan, centres[:, 0], centres[:, 1])
    if not within.any():
        raise InputError(f"{what}: no cell centre lies in the area; use a spacing below {step:g} m")
    left, bottom = left[within], bottom[within]
    cells = shapely.box(left, bottom, left + dx, bottom + dy)
    return centres[within], np.asarray(shapely.area(shapely.intersection(cells, plan)))


def cell_count(extent: float, spacing: float) -> int:
    """Number of cells: ceil(extent / spacing), forgiving rounding of the extent."""
    return max(1, math.ceil(extent / spacing * (1.0 - 1e-6)))


def en12464_spacing(dx: float, dy: float) -> float:
    """Cell size p = 0.2 · 5^(log10 d) of EN 12464-1:2021, 4.4, at most 10 m. [m]"""
    longer, shorter = max(dx, dy), min(dx, dy)
    d = shorter if longer >= 2.0 * shorter else longer
    return float(min(10.0, 0.2 * 5.0 ** math.log10(d)))


def rings(plan: Any) -> list[FloatArray]:
    """Closed outlines (k, 2) of all polygons, holes included."""
    import shapely

    polygons = [p for p in shapely.get_parts(plan) if p.geom_type == "Polygon"]
    return [np.array(r.coords)[:, :2] for p in polygons for r in (p.exterior, *p.interiors)]
