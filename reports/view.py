"""Viewpoint of the 3-D still: from outside, into rooms through the walls that face the viewer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import Result

from .raster import rasterize
from .surface_mesh import DisplayMesh

#: Vertical field of view: narrow enough that far and near walls keep their proportions. [deg]
FOV_DEG = 28.0
#: Share of the lit area that must look at other surfaces for the scene to be a room.
_INTERIOR_SHARE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Perspective from ``eye`` to ``target``, z up; ``fov_deg`` is vertical. [m]"""

    eye: NDArray[np.float64]
    target: NDArray[np.float64]
    fov_deg: float
    size: tuple[int, int]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixel x, y (downwards) and reciprocal distance along the view (..., 3)."""
        forward, right, up = axes_of(self.target - self.eye)
        width, height = self.size
        relative = points - self.eye
        depth = np.maximum(relative @ forward, 1e-9)
        focal = 0.5 * height / math.tan(math.radians(0.5 * self.fov_deg))
        return np.stack(
            [
                0.5 * width + focal * (relative @ right) / depth,
                0.5 * height - focal * (relative @ up) / depth,
                1.0 / depth,
            ],
            axis=-1,
        )


def axes_of(
    direction: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors forward, right, up of a view along ``direction`` with z up."""
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return forward, right, np.cross(right, forward)


def outer_elements(result: Result, mesh: DisplayMesh) -> tuple[NDArray[np.bool_], bool]:
    """Elements on the outside of a building (n,), and whether the scene has an inside at all.

    An element that sees little of the scene (its row sum of form factors is below one half) looks
    outwards. Without row sums, those near the scene's bounding box that look out of it count.
    """
    areas = mesh.cell_areas.sum(axis=(1, 2))
    sums = np.asarray(result.row_sums, dtype=np.float64)
    sums = sums[mesh.element] if len(sums) == len(result.elements) else np.zeros(0)
    if len(sums) and np.isfinite(sums).all() and float(sums.max()) > 0.0:
        outside = sums < 0.5
    else:
        outside = _skin(mesh)
    total = float(areas.sum())
    interior = total > 0.0 and float(areas[~outside].sum()) > _INTERIOR_SHARE * total
    return np.asarray(outside), interior


def _skin(mesh: DisplayMesh) -> NDArray[np.bool_]:
    """Elements that look outwards within an eighth of the scene's size from its bounding box."""
    low, high = mesh.points.min(axis=(0, 1, 2)), mesh.points.max(axis=(0, 1, 2))
    normal = mesh.normals.mean(axis=(1, 2))
    center = mesh.points.mean(axis=(1, 2))
    axis = np.abs(normal).argmax(axis=1)
    rows = np.arange(len(normal))
    ahead = np.where(
        normal[rows, axis] > 0.0, (high - center)[rows, axis], (center - low)[rows, axis]
    )
    return np.asarray(ahead < 0.125 * (high - low)[axis])


def visible_cells(
    mesh: DisplayMesh, eye: NDArray[np.float64], outside: NDArray[np.bool_], interior: bool
) -> NDArray[np.bool_]:
    """Cells (n, k, k) to draw: lit side towards the viewer, without a room's outer skin."""
    if len(mesh.points) == 0:
        return np.zeros(mesh.normals.shape[:3], dtype=bool)
    center = 0.25 * (
        mesh.points[:, :-1, :-1] + mesh.points[:, 1:, :-1]
        + mesh.points[:, 1:, 1:] + mesh.points[:, :-1, 1:]
    )  # fmt: skip
    facing = ((eye - center) * mesh.normals).sum(axis=-1) > 0.0
    if interior:
        facing &= ~outside[:, None, None]
    return np.asarray(facing)


def fit(points: NDArray[np.float64], direction: NDArray[np.float64], size: tuple[int, int]) -> View:
    """View along ``direction`` with all ``points`` (m, 3) inside the picture, 3 % free around."""
    forward, right, up = axes_of(direction)
    width, height = size
    tan_v = math.tan(math.radians(0.5 * FOV_DEG)) * 0.97
    tan_h = tan_v * width / height
    x, y, z = points @ right, points @ up, points @ forward
    radius = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    # On each axis the two bounding planes through the eye fix its position; the farther eye wins
    # and the other axis is centred. A few rounds settle the centring, which moves with distance.
    cx, cy, eye_z = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min()), float(z.min())
    for _ in range(8):
        eye_z = min(
            float((z - np.abs(x - cx) / tan_h).min()), float((z - np.abs(y - cy) / tan_v).min())
        )
        eye_z = min(eye_z, float(z.min()) - 0.05 * radius)
        depth = z - eye_z
        for axis, values in (("x", x), ("y", y)):
            center = cx if axis == "x" else cy
            slope = (values - center) / depth
            shift = 0.5 * (slope.max() + slope.min()) * float(np.median(depth))
            cx, cy = (cx + shift, cy) if axis == "x" else (cx, cy + shift)
    eye_z = min(
        float((z - np.abs(x - cx) / tan_h).min()), float((z - np.abs(y - cy) / tan_v).min())
    )
    eye_z = min(eye_z, float(z.min()) - 0.05 * radius)
    eye = cx * right + cy * up + eye_z * forward
    return View(eye, eye + forward * radius, FOV_DEG, size)


def choose_view(
    mesh: DisplayMesh, outside: NDArray[np.bool_], interior: bool, size: tuple[int, int]
) -> View:
    """The one of eight directions from above that shows the most surface, luminaires included."""
    altitude = math.radians(38.0 if interior else 24.0)
    points = mesh.points.reshape(-1, 3)
    small = (max(size[0] // 8, 80), max(size[1] // 8, 60))
    areas = mesh.cell_areas
    drawn_part = ~outside if interior else np.ones(len(mesh.points), dtype=bool)
    fitted = mesh.points[drawn_part].reshape(-1, 3) if drawn_part.any() else points
    best: tuple[float, Any] = (-1.0, None)
    # Very large scenes are judged from every second direction.
    for k in range(0, 8, 1 if len(mesh.points) < 20_000 else 2):
        azimuth = math.radians(215.0 + 45.0 * k)  # from the south-west first, off the axes
        toward = np.array([math.sin(azimuth), math.cos(azimuth), 0.0]) * math.cos(altitude)
        direction = -(toward + np.array([0.0, 0.0, math.sin(altitude)]))
        view = fit(fitted, direction, small)
        cells = visible_cells(mesh, view.eye, outside, interior)
        if not cells.any():
            continue
        seen = _seen(mesh, cells, view)
        # Every cell in sight counts with its area; a slanted look at it counts less.
        score = float(np.sqrt(areas[cells][seen]).sum())
        if score > best[0] * 1.02:
            best = (score, direction)
    direction = best[1] if best[1] is not None else np.array([0.5, 0.7, -0.5])
    return fit(fitted, direction, size)


def _seen(mesh: DisplayMesh, cells: NDArray[np.bool_], view: View) -> NDArray[np.int64]:
    """Numbers, among ``cells``, of those in front at some pixel."""
    quads = mesh.quads()[cells]
    screen = view.project(mesh.points.reshape(-1, 3))
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    owner = rasterize(screen[triangles], np.zeros((len(triangles), 3)), view.size)[0]
    found = np.unique(owner[owner >= 0])
    return np.unique(found % max(len(quads), 1))
