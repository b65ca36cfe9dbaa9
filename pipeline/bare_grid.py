"""Where sensors stand in a model without a scene file: on the floor of its room, if it has one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from patchlight.solver.model import PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray

from .floors import PlanView

#: Cells along the longer side of the default grid.
CELLS = 12
#: Share of a floor that has a ceiling, and places a direction of each patch at which one is looked
#: for. Half: of a terrace with a table or a canopy less is covered.
COVERED, SAMPLES = 0.5, 8
#: Least height of a room against the root of its floor area: a hall of 100 m has 5 m, while plates
#: that lie on each other have none.
LOWEST_ROOM = 0.05


def default_grid(data: SceneData, void: PatchSet | None) -> tuple[dict[str, Any], str]:
    """Sensors on the largest floor under a ceiling, else on the largest flat upward face.

    Without such a face they are at the mid height of the model. Returns the table of a scene file
    and what to say of it.

    Parameters
    ----------
    data : SceneData
        The model.
    void : PatchSet or None
        Closed inside of a solid, which floors are looked for in.
    """
    view = PlanView.of(data, np.eye(4))
    low, high = data.patches.bounds()
    spacing = _round_spacing(float(max(high[0] - low[0], high[1] - low[1])) / CELLS)
    upward = view.upward.copy()
    grid: dict[str, Any]
    if void is not None:
        bottom, top = void.bounds()
        z = view.height
        upward &= (z >= bottom[2] - 1e-6 * view.size) & (z < top[2] - 1e-6 * view.size)
    if upward.any():
        face_of = data.patches.face_index
        area = np.bincount(face_of, np.where(upward, data.patches.areas(), 0.0))
        covered = covered_areas(view, np.flatnonzero(upward))
        indoors = bool((covered > COVERED * area).any())
        row = int(np.argmax(np.where(covered > COVERED * area, covered, 0.0) if indoors else area))
        face = data.faces[row]
        path = data.parts[face.part].path
        spacing = _round_spacing(math.sqrt(float(area[row])) / CELLS)
        grid = {
            "name": "floor" if indoors else "largest-face",
            "parts": path,
            "faces": f"#{face.number}",
            "spacing_m": spacing,
        }
        which = (
            "the largest flat upward face with a ceiling above it"
            if indoors
            else "the largest flat upward face, as none has a ceiling above it"
        )
        remark = (
            f"sensors every {spacing:g} m on {which}, {path} #{face.number} ({area[row]:.3g} m²)"
        )
        return grid, remark
    middle = 0.5 * float(low[2] + high[2])
    grid = {
        "name": "mid-height",
        "z_m": middle,
        "spacing_m": spacing,
        "bounds_m": [float(x) for x in (low[0], low[1], high[0], high[1])],
    }
    remark = f"no flat upward face: sensors every {spacing:g} m at mid height, z = {middle:.3g} m"
    return grid, remark


def covered_areas(view: PlanView, rows: np.ndarray) -> FloatArray:
    """Area of each face that has a ceiling, of its flat upward patches ``rows``. [m²]

    A ceiling is what stands straight above, high enough for a room: see `LOWEST_ROOM`. What lies
    inside another solid has none.
    """
    from patchlight.solver.containment import inside_solids
    from patchlight.solver.raycast import RayCaster

    t = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = (g.ravel() for g in np.meshgrid(t, t))
    some = view.patches.take(rows)
    points = some.evaluate(u, v).reshape(-1, 3)
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    above = RayCaster(view.patches).first_hit(points, up, t_min=1e-6 * view.size).t
    inside = np.asarray(inside_solids(view.data, points + 1e-6 * view.size * up), dtype=bool)
    above = np.where(inside, np.inf, above).reshape(len(rows), -1)
    area, face_of = some.areas(), view.patches.face_index
    whole = np.bincount(face_of[rows], weights=area, minlength=int(face_of.max()) + 1)
    least = LOWEST_ROOM * np.sqrt(whole[face_of[rows]])[:, None]
    share = (np.isfinite(above) & (above >= least)).mean(axis=1)
    return np.asarray(np.bincount(face_of[rows], weights=share * area, minlength=len(whole)))


def _round_spacing(spacing: float) -> float:
    """Next smaller 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(spacing))
    return next(float(f"{k * power:.3g}") for k in (5, 2, 1) if k * power <= spacing * 1.0001)
