"""Sensors on the active side of faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import PatchSet, Sensors
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bezier import tangents

from .assigning import find_faces, row_offsets
from .floors import PlanView
from .outlines import FLAT, flat_normals, joined, plane_polygons
from .plane_grids import MOST_POINTS, cell_count, outside_solids, plane_cells, rings

if TYPE_CHECKING:
    from .grids import FaceRule
    from .scene import Scene

#: Sensors stand this far in front of their face, relative to the size of the scene: clear of it for
#: every visibility test, and far too near to change an illuminance.
LIFT = 1e-6


def sensors_on_faces(
    name: str, rule: FaceRule, scene: Scene, view: PlanView
) -> tuple[Sensors, list[str]]:
    """Sensors of ``rule`` in scene axes, and what to say about them."""
    what = f"sensors {name!r}"
    found = find_faces(scene.entries, rule.pattern, label=what, faces=rule.faces)
    _, face_start = row_offsets(scene.entries)
    points, normals, areas, loops = [], [], [], []
    for match in found:
        for row in match.rows:
            patches = view.patches.take(view.patches.face_index == face_start[match.entry] + row)
            if not len(patches):
                continue  # a face that could not be converted; the certificate names it
            flat = flat_normals(patches, view.size)
            if np.isfinite(flat).all() and _one_plane(patches, flat, view.size):
                p, n, a, loop = _flat(what, patches, flat[0], rule.spacing, view.size)
                loops += loop
            else:
                p, n, a = _curved(patches, rule.spacing)
            points.append(p + LIFT * view.size * n)
            normals.append(n)
            areas.append(a)
    if not points:
        raise InputError(f"{what}: {rule.pattern!r} has no face with patches")
    if sum(len(p) for p in points) > MOST_POINTS:
        raise InputError(f"{what}: spacing {rule.spacing:g} m makes more than {MOST_POINTS} points")
    xyz = np.concatenate(points)
    free, notes = outside_solids(what, xyz, view)
    sensors = Sensors(
        name,
        xyz[free],
        np.concatenate(normals)[free],
        np.concatenate(areas)[free],
        outline=tuple(loops),
    )
    return sensors, notes


def _one_plane(patches: PatchSet, normals: FloatArray, size: float) -> bool:
    nets = patches.control_points
    points = nets[..., :3] / nets[..., 3:]
    offset = (points - points[0, 0, 0]) @ normals[0]
    return bool((normals @ normals[0]).min() > 1.0 - 1e-9 and np.abs(offset).max() <= FLAT * size)


def _flat(
    what: str, patches: PatchSet, normal: FloatArray, spacing: float, size: float
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray]]:
    """Cells in the plane of a face: along the world's x, y on floors, upright on walls."""
    if abs(normal[2]) > 1.0 - 1e-9:
        e1 = np.array([1.0, 0.0, 0.0])
    else:
        e1 = np.cross([0.0, 0.0, 1.0], normal)
        e1 /= np.linalg.norm(e1)
    e2 = np.cross(normal, e1)
    origin = patches.control_points[0, 0, 0, :3] / patches.control_points[0, 0, 0, 3]
    plan = joined(plane_polygons(patches, origin, e1, e2, size), size)
    x0, y0, x1, y1 = plan.bounds
    # A face narrower than a cell still gets its one row, so no spacing is too large.
    centres, areas = plane_cells(what, plan, min(spacing, max(x1 - x0, y1 - y0)))
    points = origin + centres[:, :1] * e1 + centres[:, 1:] * e2
    loops = [origin + r[:, :1] * e1 + r[:, 1:] * e2 for r in rings(plan)]
    return points, np.broadcast_to(normal, points.shape), areas, loops


def _curved(patches: PatchSet, spacing: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cell centres in the parameters of every patch, weighed by the area about them."""
    points, normals, areas = [], [], []
    for net, area in zip(patches.control_points, patches.areas(), strict=True):
        p = net[..., :3] / net[..., 3:]
        along_u = np.linalg.norm(np.diff(p, axis=0), axis=-1).sum(axis=0).max()
        along_v = np.linalg.norm(np.diff(p, axis=1), axis=-1).sum(axis=1).max()
        nu, nv = cell_count(float(along_u), spacing), cell_count(float(along_v), spacing)
        u, v = np.meshgrid((np.arange(nu) + 0.5) / nu, (np.arange(nv) + 0.5) / nv)
        point, su, sv = tangents(net, u.ravel(), v.ravel())
        n = np.cross(su, sv)
        weight = np.linalg.norm(n, axis=-1)
        good = weight > 0.0
        points.append(point[good])
        normals.append(n[good] / weight[good, None])
        areas.append(area * weight[good] / weight[good].sum())
    return np.concatenate(points), np.concatenate(normals), np.concatenate(areas)
