"""Interactive 3-D scene as one self-contained page: WebGL, no library, no network."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from patchlight.solver.model import Result

from .levels import level_text, palette, scale_for
from .surface_mesh import display_mesh
from .view import choose_view, outer_elements

#: Cells of the page: about 3 MB and fluent on small machines.
MAX_CELLS = 40_000


def viewer_page(result: Result) -> str:
    """Whole page with the interactive scene; says so when there is nothing to show."""
    from .report import environment

    template = environment().get_template("viewer_page.html")
    return str(template.render(title=result.scene.title, fragment=_markup(result)))


def viewer_fragment(result: Result) -> str:
    """The interactive scene as a piece of HTML; empty without elements."""
    return str(_markup(result))


def _markup(result: Result) -> Any:
    from markupsafe import Markup

    from .report import environment

    data = scene_payload(result)
    if data is None:
        return Markup("")
    return Markup(environment().get_template("viewer.html").render(data=data))


def scene_payload(result: Result) -> dict[str, Any] | None:
    """Arrays of the page, base64 of little-endian numbers; None without elements.

    Positions are 16-bit fractions of the bounding box, the position on the colour scale 16-bit.
    """
    mesh = display_mesh(result, max_cells=MAX_CELLS)
    if len(mesh.points) == 0:
        return None
    outside, interior = outer_elements(result, mesh)
    points = mesh.points.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1e-9)
    lit = ~mesh.emitting & ~(outside & interior)
    scale = scale_for(mesh.values[lit][:, :-1, :-1], mesh.cell_areas[lit])
    view = choose_view(mesh.thinned(), outside, interior, (900, 600))
    # Turning goes about a point on the line of sight, as deep as the scene's centre.
    forward = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    pivot = view.eye + forward * float((0.5 * (low + high) - view.eye) @ forward)
    quads = mesh.quads()
    hidden = outside & interior
    groups = {
        "inner": quads[~mesh.emitting & ~hidden],
        "outer": quads[~mesh.emitting & hidden],
        "lamps": quads[mesh.emitting],
    }
    lines, normals, outer_lines = _lines(mesh, hidden)
    part = result.scene.patches.part_index[result.elements.patch_index[mesh.element]]

    def quantised(p: np.ndarray) -> str:
        return _base64(np.round((p - low) / span * 65535.0).astype("<u2"))

    return {
        "low": low.tolist(),
        "span": span.tolist(),
        "positions": quantised(points),
        "t": _base64(np.round(65535.0 * scale.position(mesh.values.ravel())).astype("<u2")),
        "groups": {
            name: _base64(np.concatenate([q[..., :3], q[..., [0, 2, 3]]]).reshape(-1).astype("<u4"))
            for name, q in ((n, g.reshape(-1, 4)) for n, g in groups.items())
        },
        "lines": quantised(lines.reshape(-1, 3)),
        "line_normals": _base64(np.round(127.0 * normals.reshape(-1, 3)).astype("i1")),
        "inner_line_vertices": 2 * int((~outer_lines).sum()),
        "colors": _base64(np.round(255.0 * palette(np.linspace(0.0, 1.0, 256))).astype("u1")),
        "levels": scale.levels.tolist(),
        "labels": [level_text(x) for x in scale.levels],
        "per_element": (mesh.steps + 1) ** 2,
        "parts": part.tolist(),
        "names": [p.path for p in result.scene.parts],
        "eye": view.eye.tolist(),
        "target": pivot.tolist(),
        "fov": view.fov_deg,
        "interior": interior,
    }


def _base64(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def _lines(mesh: Any, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Border segments (s, 2, 3), normals of the surface there, and whether it is an outer one.

    Inner segments come first.
    """
    p, n = mesh.points, mesh.normals
    found, normals, outer = [], [], []
    for k, (line, cells) in enumerate((
        (p[:, 0], n[:, 0]), (p[:, -1], n[:, -1]), (p[:, :, 0], n[:, :, 0]),
        (p[:, :, -1], n[:, :, -1]),
    )):  # fmt: skip
        rows = mesh.borders[:, k]
        segment = np.stack([line[rows, :-1], line[rows, 1:]], axis=2)
        found.append(segment.reshape(-1, 2, 3))
        normals.append(np.repeat(cells[rows][:, :, None], 2, axis=2).reshape(-1, 2, 3))
        outer.append(np.repeat(hidden[rows], line.shape[1] - 1))
    flag = np.concatenate(outer)
    order = np.argsort(flag, kind="stable")
    return np.concatenate(found)[order], np.concatenate(normals)[order], flag[order]
