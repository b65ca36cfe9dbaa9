"""Lamps, cameras and sensors in places where they make no sense."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from .containment import Containment, Volumes
from .model.arrays import FloatArray
from .model.scene import Luminaire, SceneData

#: Distance of test points from surfaces, relative to the size of the scene.
_RELATIVE_DISTANCE = 1e-6
#: Samples a direction in the patches of lamps.
_SAMPLES = 8
#: Share of a lamp's faces that may touch something without a word.
_LEAST_SHARE = 0.01


def check_placement(scene: SceneData, tester: Containment | None = None) -> tuple[str, ...]:
    """One line for each lamp, camera and sensor grid in a place where it makes no sense.

    Inside a solid; outside the model; outside the air of a scene that declares which parts are air.
    ``tester`` is made here where there is none yet.
    """
    if not len(scene.patches):
        return ()
    tester = Containment(scene) if tester is None else tester
    low, high = scene.patches.bounds()
    distance = _RELATIVE_DISTANCE * float(np.linalg.norm(high - low))
    air = Volumes.of_air(scene)
    # Where the air is known, what does not shine into it is told below.
    lines = _dark_lamps(scene, tester, distance, least=_LEAST_SHARE if air is None else 1.0)
    for camera in scene.cameras:
        part = int(tester.parts_at([camera.eye])[0])
        if part >= 0:
            lines.append(
                f"camera {camera.name!r}: the eye {_place(camera.eye)} lies inside the solid "
                f"{scene.parts[part].path!r}; the image will be dark"
            )
    for grid in scene.sensors:
        parts = tester.parts_at(grid.points)
        inside = np.flatnonzero(parts >= 0)
        if inside.size:
            first = int(inside[0])
            counts = bool(grid.area_m2[inside].any())
            lines.append(
                f"sensors {grid.name!r}: {inside.size} of {len(grid)} points lie inside solids, "
                f"the first {_place(grid.points[first])} in {scene.parts[parts[first]].path!r}"
                + ("" if counts else "; they count in no metric")
            )
    lines += _outside_model(scene, 1e-9 * float(np.linalg.norm(high - low)))
    if air is not None:
        lines += _grids_outside(scene, air, distance) + _lamps_outside(scene, air, distance)
    return tuple(lines)


def _outside_model(scene: SceneData, slack: float) -> list[str]:
    """Grids that lie wholly on one side of the model, as one whose height is in millimetres."""
    low, high = scene.patches.bounds()
    closed = bool(scene.closed.any())
    lines = []
    for grid in scene.sensors:
        for axis, name in ((2, "z"), (0, "x"), (1, "y")):
            at = grid.points[:, axis]
            # What stands free over open ground is wrong only where it is far away.
            away = slack if axis < 2 or closed else float((high - low).max())
            over = bool((at > high[axis] + away).all())
            if over or bool((at < low[axis] - away).all()):
                side = {(2, True): "above", (2, False): "below"}.get((axis, over), "beside")
                nearest, end = (at.min(), high) if over else (at.max(), low)
                lines.append(
                    f"sensors {grid.name!r}: all {len(grid)} points lie {side} the whole model: "
                    f"{name} = {nearest:.4g} m, but the model ends at {end[axis]:.4g} m"
                )
                break
    return lines


def _grids_outside(scene: SceneData, air: Volumes, distance: float) -> list[str]:
    lines = []
    for grid in scene.sensors:
        # A point on a wall belongs to what it looks into.
        outside = np.flatnonzero(air.parts_at(grid.points + distance * grid.normals) < 0)
        if outside.size:
            lines.append(
                f"sensors {grid.name!r}: {outside.size} of {len(grid)} points lie outside the air "
                f"{_air_names(scene)}, the first {_place(grid.points[outside[0]])}"
            )
    return lines


def _lamp_points(
    scene: SceneData,
) -> Iterator[tuple[Luminaire, FloatArray, FloatArray, FloatArray]]:
    """Each lamp with points of its emitting sides: (m, 3), their normals, and their areas (m,)."""
    patches, areas = scene.patches, scene.patches.areas()
    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    u, v = (grid.ravel() for grid in np.meshgrid(t, t))
    for lamp, luminaire in enumerate(scene.luminaires):
        rows, sides = np.nonzero(scene.luminaire_index == lamp)
        own = patches.take(rows)
        n = own.normals(u, v) * np.where(sides == 0, 1.0, -1.0)[:, None, None]
        x, n = own.evaluate(u, v).reshape(-1, 3), n.reshape(-1, 3)
        usable = np.isfinite(n).all(axis=1)
        if usable.any():
            area = np.repeat(areas[rows] / _SAMPLES**2, _SAMPLES**2)
            yield luminaire, x[usable], n[usable], area[usable]


def _share(found: ArrayLike, areas: FloatArray) -> float:
    """Share of the area of some points; 1 to the digit for all of them."""
    mask = np.asarray(found, dtype=bool)
    return 1.0 if mask.all() else float(areas[mask].sum() / max(float(areas.sum()), 1e-300))


def _lamps_outside(scene: SceneData, air: Volumes, distance: float) -> list[str]:
    """Lamps of which a part does not shine into any air volume."""
    lines = []
    for luminaire, x, n, areas in _lamp_points(scene):
        share = _share(air.parts_at(x + distance * n) < 0, areas)
        if share > 0.0:
            amount = "all" if share == 1.0 else f"about {100.0 * share:.0f} %"
            lines.append(
                f"lamp {luminaire.part!r}: {amount} of its emitting faces lies outside the air "
                f"{_air_names(scene)} or against its walls; that share of its "
                f"{luminaire.flux_lm:g} lm does not get into the room"
            )
    return lines


def _air_names(scene: SceneData) -> str:
    names = [repr(part.path) for part in scene.parts if part.kind == "air"]
    return ", ".join(names[:3]) + (" …" if len(names) > 3 else "")


def _dark_lamps(
    scene: SceneData, tester: Containment, distance: float, *, least: float
) -> list[str]:
    """Lamps of whose emitting sides a share of ``least`` lies inside or against something."""
    lines: list[str] = []
    if tester.is_cavity:
        return lines
    for luminaire, x, n, areas in _lamp_points(scene):
        buried = tester.buried(x, n, distance)
        share = _share(buried, areas)
        if share < least:
            continue
        parts = tester.parts_at(x[buried] + distance * n[buried])
        inside = parts[parts >= 0]
        where = f" the solid {scene.parts[inside[0]].path!r}" if inside.size else " other faces"
        percent = f"{100.0 * share:.0f} %"
        amount, dark = ("all", "its") if share == 1.0 else (f"about {percent}", f"{percent} of its")
        lines.append(
            f"lamp {luminaire.part!r}: {amount} of its emitting faces lie inside or against{where};"
            f" {dark} {luminaire.flux_lm:g} lm stay dark"
        )
    return lines


def _place(point: ArrayLike) -> str:
    x, y, z = (float(c) for c in np.asarray(point))
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"
