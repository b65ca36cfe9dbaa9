"""False-colour 3-D still of the curved surfaces, by VTK in a child process or by NumPy."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import Result

from . import figures
from .levels import Scale, level_text, palette, scale_for
from .raster import rasterize
from .status import rendering_status, window_classes
from .surface_mesh import DisplayMesh, display_mesh
from .view import View, choose_view, outer_elements, visible_cells

SIZE = (1500, 1000)
TIMEOUT_S = 90.0
LAMP_COLOR = (255, 250, 226)


@dataclass(frozen=True, slots=True)
class Still:
    """PNG of the scene, what it shows, and why it was drawn the way it was."""

    png: bytes
    caption: str
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Everything a renderer needs; only what faces the viewer.

    Attributes
    ----------
    points : (m, 3) array, t : (m,) array
        Vertices [m] and their position on the colour scale.
    triangles, lamps : (a, 3), (b, 3) int array
        Surfaces in false colour, and emitting ones.
    lines : (s, 2, 3) array
        Borders of faces, drawn a little in front of them. [m]
    """

    points: NDArray[np.float64]
    t: NDArray[np.float64]
    triangles: NDArray[np.int64]
    lamps: NDArray[np.int64]
    lines: NDArray[np.float64]
    view: View


def scene_still(result: Result, *, size: tuple[int, int] = SIZE) -> Still | None:
    """Still of ``result``; None without elements."""
    mesh = display_mesh(result)
    if len(mesh.points) == 0:
        return None
    outside, interior = outer_elements(result, mesh)
    view = choose_view(mesh.thinned(), outside, interior, size)
    cells = visible_cells(mesh, view.eye, outside, interior)
    lit = cells & ~mesh.emitting[:, None, None]
    shown, weights = mesh.values[:, :-1, :-1][lit], mesh.cell_areas[lit]
    scale = scale_for(shown, weights)
    drawing = _drawing(mesh, cells, scale, view)
    pixels, note = _render(drawing)
    caption = (
        "Illuminance of the lit sides, evaluated on the exact curved surfaces and interpolated "
        "between elements."
    )
    if interior:
        caption += " Walls and ceilings between the viewer and the room are left out."
    if len(drawing.lamps):
        caption += " Luminaires in cream."
    return Still(_with_bar(pixels, scale, shown), caption, note)


def _drawing(mesh: DisplayMesh, cells: NDArray[np.bool_], scale: Scale, view: View) -> Drawing:
    quads = mesh.quads()
    lamp_cells = cells & mesh.emitting[:, None, None]
    points = mesh.points.reshape(-1, 3)
    return Drawing(
        points=points,
        t=scale.position(mesh.values.ravel()),
        triangles=_split(quads[cells & ~lamp_cells]),
        lamps=_split(quads[lamp_cells]),
        lines=_border_lines(mesh, cells, view),
        view=view,
    )


def _split(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def _border_lines(mesh: DisplayMesh, cells: NDArray[np.bool_], view: View) -> NDArray[np.float64]:
    """Segments (s, 2, 3) of face borders next to drawn cells, shifted towards the viewer."""
    p = mesh.points
    sides = (
        (0, p[:, 0], cells[:, 0]),
        (1, p[:, -1], cells[:, -1]),
        (2, p[:, :, 0], cells[:, :, 0]),
        (3, p[:, :, -1], cells[:, :, -1]),
    )
    found = []
    for k, line, drawn in sides:
        keep = drawn & mesh.borders[:, k, None]
        found.append(np.stack([line[:, :-1][keep], line[:, 1:][keep]], axis=1))
    lines = np.concatenate(found)
    return np.asarray(lines + 2e-3 * (view.eye - lines))


def _render(drawing: Drawing) -> tuple[NDArray[np.uint8], str]:
    """Pixels (h, w, 3) and a note when the simple renderer had to do it."""
    able, reason = rendering_status()
    if able:
        for window in window_classes():
            pixels, reason = _render_vtk(drawing, window)
            if pixels is not None:
                return pixels, ""
    return _render_numpy(drawing), f"Drawn without VTK: {reason}"


def _render_vtk(drawing: Drawing, window: str) -> tuple[NDArray[np.uint8] | None, str]:
    """Pixels from the child process, or None and what went wrong."""
    view = drawing.view
    with tempfile.TemporaryDirectory(prefix="patchlight-") as folder:
        source, target = Path(folder) / "scene.npz", Path(folder) / "pixels.npy"
        np.savez(
            source, points=drawing.points, t=drawing.t, triangles=drawing.triangles,
            lamps=drawing.lamps, lines=drawing.lines, eye=view.eye, target=view.target,
            fov_deg=view.fov_deg, size=np.array(view.size), lamp_color=np.array(LAMP_COLOR),
            colors=_color_table(),
        )  # fmt: skip
        environment = dict(os.environ, VTK_DEFAULT_OPENGL_WINDOW=window, PYVISTA_OFF_SCREEN="true")
        environment.pop("DISPLAY", None)  # a forwarded display may hang
        command = [
            sys.executable,
            "-m",
            "patchlight.reports.render_child",
            str(source),
            str(target),
        ]
        try:
            done = subprocess.run(
                command, capture_output=True, timeout=TIMEOUT_S, env=environment, check=False
            )
        except subprocess.TimeoutExpired:
            return None, f"rendering took more than {TIMEOUT_S:g} s"
        except OSError as error:
            return None, f"the rendering process did not start: {error}"
        if done.returncode != 0 or not target.exists():
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            return None, f"rendering failed ({lines[-1] if lines else done.returncode})"
        pixels = np.load(target)
    if pixels.shape[:2] != view.size[::-1] or int(pixels.min()) == int(pixels.max()):
        return None, "the rendered picture was empty"
    return pixels, ""


def _color_table() -> NDArray[np.uint8]:
    return np.round(255.0 * palette(np.linspace(0.0, 1.0, 256))).astype(np.uint8)


def _render_numpy(drawing: Drawing) -> NDArray[np.uint8]:
    """The same picture by the rasteriser, at twice the resolution and averaged."""
    view = drawing.view
    large = View(view.eye, view.target, view.fov_deg, (2 * view.size[0], 2 * view.size[1]))
    corners = np.concatenate([drawing.triangles, drawing.lamps])
    screen = large.project(drawing.points)
    owner, t, front = rasterize(screen[corners], drawing.t[corners], large.size)
    table = _color_table()
    index = np.round(255.0 * np.clip(np.nan_to_num(t), 0.0, 1.0)).astype(np.int64)
    pixels = np.where(owner[..., None] >= 0, table[index], 255).astype(np.float64)
    pixels[owner >= len(drawing.triangles)] = LAMP_COLOR
    if len(drawing.lines):
        _draw_lines(pixels, front, large.project(drawing.lines))
    h, w = view.size[1], view.size[0]
    mean = pixels.reshape(h, 2, w, 2, 3).mean(axis=(1, 3))
    return np.asarray(np.round(mean), dtype=np.uint8)


def _draw_lines(
    pixels: NDArray[np.float64], front: NDArray[np.float64], lines: NDArray[np.float64]
) -> None:
    """Dark lines (s, 2, 3) where nothing nearer was drawn."""
    height, width = front.shape
    length = np.abs(lines[:, 1, :2] - lines[:, 0, :2]).max(axis=1)
    for row, n in enumerate(np.ceil(length).astype(int) + 1):
        t = np.linspace(0.0, 1.0, min(int(n), 4 * width))[:, None]
        x, y, q = (lines[row, 0] + t * (lines[row, 1] - lines[row, 0])).T
        for dx in (0, 1):
            for dy in (0, 1):
                ix, iy = np.floor(x).astype(int) + dx, np.floor(y).astype(int) + dy
                ok = (ix >= 0) & (ix < width) & (iy >= 0) & (iy < height)
                ix, iy, qq = ix[ok], iy[ok], q[ok]
                near = qq >= front[iy, ix] * 0.999
                pixels[iy[near], ix[near]] = (29.0, 37.0, 48.0)


def _with_bar(pixels: NDArray[np.uint8], scale: Scale, shown: NDArray[np.float64]) -> bytes:
    """The picture with its colour bar at the right."""
    height, width = pixels.shape[:2]
    bar = 215
    dpi = 100.0
    total = width + bar
    with figures.look():
        figure = figures.new_figure(total / dpi, height / dpi)
        axes = figure.add_axes((0.0, 0.0, width / total, 1.0))
        axes.set_axis_off()
        axes.imshow(pixels, interpolation="nearest", aspect="auto")
        ramp = figure.add_axes(((width + 25) / total, 0.12, 42 / total, 0.72))
        t = np.linspace(0.0, 1.0, 256)
        n = len(scale.levels) - 1
        ramp.imshow(palette(t)[:, None, :], origin="lower", aspect="auto", extent=(0, 1, 0, n))
        labels = [level_text(x) for x in scale.levels]
        if shown.size and float(shown.min()) < scale.levels[0] * (1 - 1e-9):
            labels[0] = f"≤ {labels[0]}"
        if shown.size and float(shown.max()) > scale.levels[-1] * (1 + 1e-9):
            labels[-1] = f"≥ {labels[-1]}"
        ramp.set_yticks(np.arange(n + 1), labels=labels)
        ramp.yaxis.tick_right()
        ramp.set_xticks([])
        ramp.tick_params(labelsize=17, length=5, width=1)
        figure.text((width + 25) / total, 0.865, "E [lx]", size=18, weight="bold")
        return figures.png(figure, dpi=dpi)
