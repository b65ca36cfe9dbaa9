"""False-colour plan of a sensor grid with isolux lines, values, walls, scale bar and north."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model import SensorResult

from . import figures
from .formats import NEGLIGIBLE, number
from .lattice import Lattice, PlaneFrame, find_lattice, plane_frame, smooth_field
from .legend import PANEL, draw_bar, draw_length, draw_north
from .levels import Scale, level_text, pale, scale_for
from .section import cut, joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path

_WIDTH = 7.0  # inches
#: Closed isolux lines shorter than this many cells tell of one point only, and are left out.
SHORTEST = 3.5
_MARGINS = (0.5, 0.12, 0.40, 0.12)  # left, right, bottom, top


def plan_figure(
    grid: SensorResult,
    triangles: NDArray[np.float64],
    *,
    north_deg: float = 0.0,
    quantity: str = "E [lx]",
    scale: Scale | None = None,
) -> tuple[Figure, str]:
    """Plan of ``grid`` with the walls cut from scene triangles (t, 3, 3) [m], and a caption.

    Drawn inside `figures.look`. Of another ``quantity`` than illuminance its values stand in the
    place of that, and its ``scale`` is given.
    """
    frame = plane_frame(grid, north_deg)
    uv = frame.project(grid.points)
    values = np.asarray(grid.illuminance_lx, dtype=np.float64)
    lines = "isolux lines" if scale is None else "lines"
    scale = scale_for(values) if scale is None else scale
    lattice = find_lattice(uv, grid.area_m2) if frame.flat else None
    rings = [frame.project(np.asarray(ring)) for ring in grid.outline if len(ring) >= 3]
    area = _extent(uv, lattice, rings)
    walls = _walls(grid, frame, triangles, area) if frame.flat else []
    box = _padded(np.concatenate([np.reshape(area, (2, 2)).T, *walls]), len(uv))
    labels: list[tuple[float, float]] = []
    figure, axes = _page(box, 6.4 if len(values) > 4 else 3.0)
    if lattice is not None and min(lattice.row.shape) >= 2:
        labels = _draw_field(axes, lattice, values, scale, rings)
        text = f"Smooth colours and {lines} between the points"
    elif lattice is not None:
        _draw_cells(axes, lattice, values, scale)
        text = "One cell a point"
    else:
        _draw_points(axes, uv, values, scale)
        text = (
            "Points" if frame.flat else "Points on a curved surface, seen along their mean normal"
        )
    _draw_lines(axes, walls, rings)
    _draw_values(figure, axes, uv, lattice, values, box, labels)
    _finish_axes(axes, frame, box)
    draw_bar(figure, scale, values, quantity)
    draw_length(figure, axes, box)
    if frame.horizontal:
        draw_north(figure, north_deg)
    return figure, text


def _walls(
    grid: SensorResult, frame: PlaneFrame, triangles: NDArray[np.float64], area: Any
) -> list[NDArray[np.float64]]:
    """Lines (m, 2) of the scene a little in front of the grid's plane. [m]"""
    if len(triangles) == 0:
        return []
    # Exactly in the plane a table top or floor would give stray lines.
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    up = frame.normal * (1.0 if not frame.horizontal else np.sign(frame.normal[2]))
    segments = cut(triangles, frame.origin + 2e-3 * size * up, up)
    flat = frame.project(segments.reshape(-1, 3)).reshape(-1, 2, 2)
    low, high = np.array(area[::2]), np.array(area[1::2])
    # Only what is near the measured area: a site plan would shrink the room to a dot.
    reach = max(1.0, 0.2 * float((high - low).max()))
    near = ((flat.max(axis=1) >= low - reach) & (flat.min(axis=1) <= high + reach)).all(axis=1)
    return joined(np.clip(flat[near], low - reach, high + reach))


def _extent(
    uv: NDArray[np.float64], lattice: Lattice | None, rings: list[Any]
) -> tuple[float, float, float, float]:
    """Measured area u0, u1, v0, v1. [m]"""
    points = [uv, *rings]
    if lattice is not None:
        points.append(np.reshape(lattice.edges, (2, 2)).T)
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _padded(points: NDArray[np.float64], count: int) -> tuple[float, float, float, float]:
    """Box u0, u1, v0, v1 of the drawing around ``points`` (m, 2). [m]"""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    if size <= 1e-6:
        size = 1.0
    pad = 0.03 * size if count > 1 else 0.5 * size
    # A single row or point still gets a strip to be drawn in.
    thin = np.maximum(0.12 * size - (high - low), 0.0) / 2.0
    low, high = low - pad - thin, high + pad + thin
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _page(box: tuple[float, float, float, float], highest: float) -> tuple[Figure, Axes]:
    left, right, bottom, top = _MARGINS
    room = _WIDTH - PANEL - left - right
    aspect = (box[3] - box[2]) / (box[1] - box[0])
    width, height = room, room * aspect
    if height > highest:  # tall areas: as high as a page allows
        width, height = highest / aspect, highest
    total = max(height, 2.0) + bottom + top
    figure = figures.new_figure(_WIDTH, total)
    x = left + 0.5 * (room - width)
    y = bottom + 0.5 * (total - bottom - top - height)
    axes = figure.add_axes((x / _WIDTH, y / total, width / _WIDTH, height / total))
    axes.set_xlim(box[0], box[1])
    axes.set_ylim(box[2], box[3])
    return figure, axes


def _draw_field(
    axes: Axes, lattice: Lattice, values: NDArray[np.float64], scale: Scale, rings: list[Any]
) -> list[tuple[float, float]]:
    """Classes and isolux lines; the positions of the lines' labels."""
    u, v, field = smooth_field(lattice, values)
    masked = np.ma.array(field, mask=_unmeasured(lattice, u, v, rings))
    colors, levels = pale(scale.colors()), scale.levels
    # The end classes are open: nothing may stay white because it is outside the scale.
    inner = np.clip(masked, levels[0], levels[-1] * (1 - 1e-12))
    filled = axes.contourf(u, v, inner, levels=levels, colors=colors, antialiased=True, zorder=1)
    clip = _clip_path(rings)
    if clip is not None:
        filled.set_clip_path(clip, transform=axes.transData)
    if float(np.ptp(values)) <= 1e-9 * float(np.max(np.abs(values), initial=1e-300)):
        return []
    lines = _isolux_lines(axes, (u, v, masked), levels, SHORTEST * _cell_size(lattice))
    if lines is None:
        return []
    if clip is not None:
        lines.set_clip_path(clip, transform=axes.transData)
    labels = axes.clabel(lines, fmt={x: level_text(x) for x in levels}, fontsize=7, inline=False)
    places = []
    for label in labels:
        x, y = label.get_position()
        if clip is not None and not clip.contains_point((x, y)):
            label.remove()  # the clip does not reach labels
            continue
        label.set(fontweight="bold", rotation=0, color=figures.INK)
        label.set_bbox({"boxstyle": "round,pad=0.15", "fc": "white", "ec": figures.INK, "lw": 0.4})
        label.set_zorder(6)
        places.append((float(x), float(y)))
    return places


def _isolux_lines(
    axes: Axes, field: tuple[Any, Any, Any], levels: NDArray[np.float64], shortest: float
) -> Any:
    """Isolux lines, closed ones only when they are at least ``shortest``; None when none is left.

    The half shadow of a single point would otherwise put a ring about it for every level, and rows
    of rings where an edge of shadow runs at a slant through the cells.
    """
    from matplotlib.contour import ContourSet

    found = axes.contour(*field, levels=levels)
    kept = [[line for line in lines if _counts(line, shortest)] for lines in found.allsegs]
    found.remove()
    if not any(kept):
        return None
    return ContourSet(axes, levels, kept, colors=figures.INK, linewidths=0.7, zorder=2)


def _counts(line: NDArray[np.float64], shortest: float) -> bool:
    """Whether an isolux line (k, 2) is open or long."""
    if len(line) < 2 or not np.array_equal(line[0], line[-1]):
        return len(line) >= 2
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) >= shortest


def _cell_size(lattice: Lattice) -> float:
    return math.sqrt(lattice.step_u * lattice.step_v)


def _unmeasured(
    lattice: Lattice, u: NDArray[np.float64], v: NDArray[np.float64], rings: list[Any]
) -> NDArray[np.bool_]:
    """Fine points in cells that were dropped because they lie in a solid.

    Cells dropped because their centre is outside the outline are filled: the outline clips them.
    """
    dropped = lattice.row < 0
    clip = _clip_path(rings)
    if clip is not None:
        uu, vv = np.meshgrid(lattice.u, lattice.v)
        inside = clip.contains_points(np.column_stack([uu.ravel(), vv.ravel()]))
        dropped &= inside.reshape(dropped.shape)
    iu = np.clip(np.floor((u - lattice.edges[0]) / lattice.step_u - 1e-9), 0, len(lattice.u) - 1)
    iv = np.clip(np.floor((v - lattice.edges[2]) / lattice.step_v - 1e-9), 0, len(lattice.v) - 1)
    return np.asarray(dropped[np.ix_(iv.astype(int), iu.astype(int))])


def _clip_path(rings: list[Any]) -> Path | None:
    """Compound path of the outlines: every second nesting level is a hole."""
    if not rings:
        return None
    from matplotlib.path import Path

    paths = []
    for k, ring in enumerate(rings):
        around = sum(Path(other).contains_point(ring[0]) for j, other in enumerate(rings) if j != k)
        x, y = ring[:, 0], ring[:, 1]
        counter_clockwise = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) > 0.0
        ordered = ring if counter_clockwise == (around % 2 == 0) else ring[::-1]
        paths.append(Path(np.vstack([ordered, ordered[:1]]), closed=True))
    return Path.make_compound_path(*paths)


def _draw_cells(axes: Axes, lattice: Lattice, values: NDArray[np.float64], scale: Scale) -> None:
    from matplotlib.colors import ListedColormap

    classes = scale.index(values[lattice.row])
    few = lattice.row.size <= 200
    u0, u1, v0, v1 = lattice.edges
    axes.pcolormesh(
        np.linspace(u0, u1, len(lattice.u) + 1), np.linspace(v0, v1, len(lattice.v) + 1),
        np.ma.array(classes, mask=lattice.row < 0), vmin=-0.5, vmax=scale.classes - 0.5,
        cmap=ListedColormap(pale(scale.colors())), edgecolors="white" if few else "none",
        linewidth=0.4 if few else 0.0, rasterized=not few, zorder=1,
    )  # fmt: skip


def _draw_points(
    axes: Axes, uv: NDArray[np.float64], values: NDArray[np.float64], scale: Scale
) -> None:
    size = float(np.clip(9000.0 / max(len(uv), 1), 6.0, 120.0))
    axes.scatter(
        uv[:, 0], uv[:, 1], s=size, c=pale(scale.colors())[scale.index(values)],
        edgecolors=figures.INK, linewidths=0.3 if len(uv) <= 500 else 0.0, zorder=2,
        rasterized=len(uv) > 2000,  # as a picture within the drawing: small page, fluent to scroll
    )  # fmt: skip


def _draw_lines(axes: Axes, walls: list[NDArray[np.float64]], rings: list[Any]) -> None:
    from matplotlib.collections import LineCollection

    if walls:
        lines = LineCollection(walls, colors=figures.INK, linewidths=1.6, zorder=4)
        lines.set(capstyle="round", joinstyle="round")
        axes.add_collection(lines, autolim=False)
    for ring in rings:
        closed = np.vstack([ring, ring[:1]])
        axes.plot(closed[:, 0], closed[:, 1], color=figures.INK, lw=0.9, ls=(0, (4, 2)), zorder=3)


def _draw_values(
    figure: Figure, axes: Axes, uv: NDArray[np.float64], lattice: Lattice | None,
    values: NDArray[np.float64], box: Any, taken: list[tuple[float, float]],
) -> None:  # fmt: skip
    """Numbers at every s-th point, so that they keep apart, and none under the lines' labels."""
    width, height = (
        s * p for s, p in zip(figure.get_size_inches(), axes.get_position().size, strict=True)
    )
    per_metre = width / (box[1] - box[0])
    texts = [_value_text(v) for v in values]
    need = 0.075 * max(map(len, texts), default=1) + 0.14
    if lattice is not None:
        stride_u = max(1, math.ceil(need / (lattice.step_u * per_metre)))
        stride_v = max(1, math.ceil(0.26 / (lattice.step_v * per_metre)))
        shown = lattice.row[stride_v // 2 :: stride_v, stride_u // 2 :: stride_u].ravel()
        shown = shown[shown >= 0]
        offset = 0.0
    else:
        # Greedy: a number is written where no earlier one is too close; a dense cloud hides them.
        need, between = (need, 0.2) if len(uv) <= 300 else (2.0 * need, 0.5)
        shown_list: list[int] = []
        for i, p in enumerate(uv[:2000]):
            gap = np.abs(uv[shown_list] - p) * per_metre if shown_list else np.ones((1, 2)) * 9.0
            if ((gap[:, 0] > need) | (gap[:, 1] > between)).all():
                shown_list.append(i)
        shown = np.array(shown_list, dtype=np.int64)
        offset = 0.11 / per_metre
    busy = np.array(taken).reshape(-1, 2)
    for i in shown.tolist():
        gap = np.abs(busy - uv[i]) * per_metre
        if ((gap[:, 0] < 0.34) & (gap[:, 1] < 0.17)).any():
            continue
        # Between fine cells the last number would run into the wall.
        edge = min(uv[i, 0] - box[0], box[1] - uv[i, 0]) * per_metre
        if edge < 0.5 * need:
            continue
        axes.text(
            uv[i, 0], uv[i, 1] + offset, texts[i], size=6.3, ha="center", va="center",
            color=figures.INK, zorder=5, clip_on=True,
        )  # fmt: skip


def _value_text(value: float) -> str:
    if value >= 9999.5:
        return number(value, 3)
    if value >= 10.0 or value < NEGLIGIBLE:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 1.0 else f"{value:.2g}"


def _finish_axes(axes: Axes, frame: PlaneFrame, box: tuple[float, float, float, float]) -> None:
    axes.tick_params(labelsize=7, length=2.5, width=0.5)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_facecolor("#f4f6f8")
    axes.set_xlabel("x [m]" if frame.horizontal else "horizontal [m]", size=7.5, labelpad=2)
    axes.set_ylabel("y [m]" if frame.horizontal else "vertical [m]", size=7.5, labelpad=2)
    axes.locator_params(axis="x", nbins=10, steps=[1, 2, 5, 10])
    axes.locator_params(axis="y", nbins=8, steps=[1, 2, 5, 10])
    axes.set_xlim(box[0], box[1])
    axes.set_ylim(box[2], box[3])
