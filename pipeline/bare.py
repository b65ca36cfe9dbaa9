"""What a bare STEP file is run with, so that a first run always shows something.

Every choice made here is a line of `BareScene.remarks` and stands in the resolved scene file.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.errors import GeometryError, InputError
from patchlight.solver.model import Air, Emitter, Model, PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray

from .assigning import full_path
from .bare_grid import default_grid
from .frames import up_matrix
from .scene import Entry, Scene
from .shells import enclosed_volume, part_shells

ACCURACY = 0.05
SKY_LX = 10_000.0
LAMP_LM = 1000.0
LAMP_NAME = "default-lamp"


@dataclass(slots=True)
class BareScene:
    """A scene of defaults, the values of the scene file that describes it, and what to say."""

    scene: Scene
    values: dict[str, Any]
    remarks: list[str]


@dataclass(slots=True)
class Interior:
    """A closed volume of air: its patches, and whether it is an air solid or a void."""

    patches: PatchSet
    part: int
    air: bool


def bare_scene(model: Model, path: Path, *, up: str = "z", scale: float = 1.0) -> BareScene:
    """Defaults for ``model``, read from ``path``."""
    if not len(model.patches):
        raise GeometryError(f"{path}: has no faces that could carry light")
    scene = Scene()
    scene.add_entry(Entry(model.name, model, up_matrix(up), given_name=False, scale=scale))
    scene.accuracy, scene.title = ACCURACY, path.stem
    entry = scene.entries[model.name]
    remarks = [f"all faces grey 0.5; overcast sky (CIE type 16) of {SKY_LX:g} lx; ground 0.2"]
    values: dict[str, Any] = {
        "schema_version": 1,
        "title": path.stem,
        "accuracy": ACCURACY,
        "model": [{"file": path.name, "name": model.name, "up": up, "scale": scale}],
        "assign": [],
        "sky": {"model": "cie", "type": 16, "diffuse_illuminance_lx": SKY_LX},
        "ground": {"reflectance": 0.2},
    }
    from patchlight.solver.model import CIESky, Ground

    scene.sky, scene.ground = CIESky(16, diffuse_illuminance_lx=SKY_LX), Ground(0.2)
    interior = find_interior(scene, entry)
    if interior is not None and interior.air:
        pattern = full_path(entry, model.parts[interior.part])
        scene.assign(pattern, Air())
        values["assign"].append({"parts": pattern, "air": True})
        remarks.append(
            f"all other parts lie inside {model.parts[interior.part].path}: it is taken as the "
            "volume of air they stand in"
        )
    data = scene.freeze()
    if interior is not None:
        remarks.append(_add_lamp(scene, interior, data))
    grid, remark = default_grid(
        data, None if interior is None or interior.air else interior.patches
    )
    values["sensors"] = [grid]
    remarks.append(remark)
    camera = _default_camera(data, interior)
    values["cameras"] = [camera]
    from .scene_schema import CameraTable, SensorsTable

    scene.add(SensorsTable(**grid).build())
    scene.add(CameraTable(**camera).build())
    scene.notes += [f"default: {remark}" for remark in remarks]
    return BareScene(scene, values, remarks)


def find_interior(scene: Scene, entry: Entry) -> Interior | None:
    """The closed volume of air of a model: a solid around all others, or a void in a solid."""
    model = entry.placed
    air = _air_part(scene, entry)
    if air is not None:
        return Interior(model.patches.take(model.patches.part_index == air), air, True)
    low, high = model.patches.bounds()
    best, size = None, 0.5 * (high[2] - low[2])
    for k, part in enumerate(model.parts):
        if part.kind != "solid":
            continue
        shells = part_shells(model, k)
        if len(shells) < 2:
            continue
        for rows in shells:
            patches = model.patches.take(rows)
            bottom, top = patches.bounds()
            # Bubbles in a casting are not rooms: the void fills half of the model's height.
            if top[2] - bottom[2] >= size and enclosed_volume(patches) < 0.0:
                best, size = Interior(patches, k, False), float(top[2] - bottom[2])
    return best


def _air_part(scene: Scene, entry: Entry) -> int | None:
    """The one solid in whose volume all other parts lie."""
    from patchlight.solver.containment import inside_solids

    model = entry.placed
    if sum(p.kind == "solid" for p in model.parts) < 2:
        return None
    part_of = model.patches.part_index
    sets = {k: model.patches.take(part_of == k) for k in np.unique(part_of)}
    boxes = {int(k): p.bounds() for k, p in sets.items()}
    low, high = model.patches.bounds()
    slack = 1e-6 * float(np.linalg.norm(high - low))
    found = []
    data: SceneData | None = None
    for k, (bottom, top) in boxes.items():
        if model.parts[k].kind != "solid":
            continue
        if (bottom > low + slack).any() or (top < high - slack).any():
            continue
        data = data or scene.freeze()
        others = model.patches.take(part_of != k)
        # Just below the surface of the others, so that standing on the floor is no doubt.
        points = others.evaluate(0.5, 0.5) - 10.0 * slack * np.nan_to_num(others.normals(0.5, 0.5))
        only = part_only(data, k)
        if bool(np.all(inside_solids(only, points))):
            found.append(k)
    return found[0] if len(found) == 1 else None


def part_only(data: SceneData, part: int) -> SceneData:
    """The scene without the patches of all other parts."""
    rows = np.flatnonzero(data.patches.part_index == part)
    return dataclasses.replace(
        data,
        patches=data.patches.take(rows),
        two_sided=data.two_sided[rows],
        closed=data.closed[rows],
        material_index=data.material_index[rows],
        luminaire_index=data.luminaire_index[rows],
        glass_index=data.glass_index[rows],
    )


def _free(interior: Interior, data: SceneData, points: FloatArray) -> np.ndarray:
    """Which points (n, 3) stand in the air of ``interior``, outside everything in it."""
    from patchlight.solver.containment import inside_solids

    free = ~np.asarray(inside_solids(data, points), dtype=bool)
    low, high = interior.patches.bounds()
    within = ((points > low) & (points < high)).all(axis=1)
    if not interior.air:
        return np.asarray(free & within)
    # Nothing says where an air solid ends but its faces: look at it as an ordinary solid.
    solid = part_only(data, interior.part)
    solid = dataclasses.replace(solid, patches=solid.patches.flipped(), parts=_as_solids(data))
    return np.asarray(free & within & np.asarray(inside_solids(solid, points), dtype=bool))


def _as_solids(data: SceneData) -> tuple:
    return tuple(dataclasses.replace(p, kind="solid") if p.kind == "air" else p for p in data.parts)


def _add_lamp(scene: Scene, interior: Interior, data: SceneData) -> str:
    """A disc that shines down from under the highest point of a closed room."""
    low, high = interior.patches.bounds()
    t = np.linspace(0.05, 0.95, 7)
    u, v = (g.ravel() for g in np.meshgrid(t, t))
    points = interior.patches.evaluate(u, v).reshape(-1, 3)
    extent = float(min(high[0] - low[0], high[1] - low[1]))
    radius, drop = 0.05 * extent, 0.02 * float(high[2] - low[2])
    # Among the highest points the one nearest to the middle: a flat ceiling has many.
    top = points[points[:, 2] >= points[:, 2].max() - 0.5 * drop]
    middle = 0.5 * (low + high)[:2]
    order = np.argsort(np.linalg.norm(top[:, :2] - middle, axis=1), kind="stable")
    for place in top[order]:
        center = place - np.array([0.0, 0.0, drop])
        angles = np.arange(8) * math.pi / 4
        ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=-1) * radius
        if _free(interior, data, np.concatenate([center[None], center + ring])).all():
            break
    else:
        raise GeometryError("no room for a lamp under the highest point of the closed interior")
    scene.add(PatchSet.disk(center, radius, (0.0, 0.0, -1.0)), LAMP_NAME)
    scene.assign(LAMP_NAME, Emitter(flux_lm=LAMP_LM, group=LAMP_NAME))
    at = ", ".join(f"{round(float(x), 4) + 0.0:g}" for x in center)
    return (
        f"THE INTERIOR IS CLOSED, no daylight enters: a disc of {LAMP_LM:g} lm and radius "
        f"{radius:.3g} m was added at ({at}) m, under its highest point, shining down"
    )


def _default_camera(data: SceneData, interior: Interior | None) -> dict[str, Any]:
    """A view of the model from above its south-west corner, or of a closed room from a corner."""
    low, high = data.patches.bounds()
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    if interior is None:
        corners = half * np.array(list(itertools.product((-1, 1), repeat=3)))
        direction = np.array([-0.55, -0.75, 0.5])
        direction /= np.linalg.norm(direction)
        eye = center + _whole_view(corners, direction, 60.0) * direction
        return _camera("outside", eye, center, 60.0)
    low, high = interior.patches.bounds()
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    # The corner that looks deepest into the room, a little inside so that no wall is in the way.
    for inset in (0.9, 0.8, 0.65, 0.5, 0.3):
        corners = np.array(
            [center + half * [x * inset, y * inset, 0.2] for x in (-1, 1) for y in (-1, 1)]
        )
        free = _free(interior, data, corners)
        if free.any():
            eye = corners[int(np.argmax(free))]
            target = center - 0.4 * (eye - center) * [1.0, 1.0, 0.0] - [0.0, 0.0, 0.15 * half[2]]
            return _camera("inside", eye, target, 80.0)
    raise InputError("no free place for a camera in the closed interior; write a scene file")


def _whole_view(corners: FloatArray, direction: FloatArray, fov: float) -> float:
    """How far along ``direction`` a camera looking back at 0 has all ``corners`` (n, 3). [m]

    In a picture of 4 by 3, with a tenth of it left free.
    """
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    up = np.cross(direction, right)
    wide = 0.9 * math.tan(math.radians(0.5 * fov))
    across = np.maximum(np.abs(corners @ right) / wide, np.abs(corners @ up) / (0.75 * wide))
    return float((across + corners @ direction).max())


def _camera(name: str, eye: FloatArray, target: FloatArray, fov: float) -> dict[str, Any]:
    return {
        "name": name,
        "eye_m": [float(f"{x:.6g}") for x in eye],
        "target_m": [float(f"{x:.6g}") for x in target],
        "fov_deg": fov,
    }
