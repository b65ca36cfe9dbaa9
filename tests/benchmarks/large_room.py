"""An open-plan hall of any size: desks with round legs, screens and drawers, and ceiling lamps."""

from __future__ import annotations

import numpy as np
from patchlight.solver.model import (
    Luminaire,
    Material,
    PatchSet,
    SceneData,
    SceneFace,
    ScenePart,
    Sensors,
)

#: Side of the square that each desk stands in, height of the hall [m], and the exitance of a lamp
#: that shines about 500 lx onto the desks. [lm/m²]
CELL, HEIGHT, EXITANCE = 2.0, 3.2, 6000.0
#: Reflectances of the hall, of the furniture and of the lamps.
HALL, FURNITURE, LAMP = 0, 1, 2


def _box(size: tuple[float, float, float], low: tuple[float, float, float]) -> PatchSet:
    center = tuple(a + 0.5 * s for a, s in zip(low, size, strict=True))
    return PatchSet.box(size, center=center)


def _desk(x: float, y: float, turn: int) -> list[PatchSet]:
    """Top, four round legs, a screen and drawers, none of which touch: 74 patches."""
    size = (1.4, 0.7, 0.03) if turn % 2 == 0 else (0.7, 1.4, 0.03)
    parts = [_box(size, (x - size[0] / 2, y - size[1] / 2, 0.72))]
    for i in (-1, 1):
        for j in (-1, 1):
            at = (x + i * (size[0] / 2 - 0.06), y + j * (size[1] / 2 - 0.06))
            low, high = (*at, 0.004), (*at, 0.716)
            leg = [
                PatchSet.cylinder(low, high, 0.025),
                PatchSet.disk(low, 0.025, (0, 0, -1)),
                PatchSet.disk(high, 0.025, (0, 0, 1)),
            ]
            parts.append(PatchSet.concatenated(*leg))
    parts.append(_box((0.5, 0.04, 0.35), (x - 0.25, y, 0.76)))
    parts.append(_box((0.34, 0.4, 0.5), (x - 0.17, y - 0.2, 0.1)))
    return parts


def large_room(side: int) -> SceneData:
    """Hall with ``side`` x ``side`` desks, a lamp over every fourth, and a grid of 96 sensors."""
    length = CELL * side
    bodies = [PatchSet.box((length, length, HEIGHT), (0, 0, HEIGHT / 2), inward=True)]
    material, lamps = [HALL], []
    for i in range(side):
        for j in range(side):
            x, y = ((k + 0.5) * CELL - length / 2 for k in (i, j))
            for body in _desk(x, y, i + j):
                bodies.append(body)
                material.append(FURNITURE)
            if i % 2 == 0 and j % 2 == 0:
                lamps.append(len(bodies))
                bodies.append(_box((1.2, 1.2, 0.06), (x - 0.6, y - 0.6, HEIGHT - 0.36)))
                material.append(LAMP)
    solid = np.repeat(np.arange(len(bodies)), [len(b) for b in bodies])
    patches = PatchSet.concatenated(*bodies)
    n = len(patches)
    patches = PatchSet(patches.control_points, np.arange(n), solid)
    areas, normals = patches.areas(), patches.normals(0.5, 0.5)
    shines = np.isin(solid, lamps) & (normals[:, 2] < -0.9)
    area = float(areas[shines].sum())
    lamp = np.full((n, 2), -1)
    lamp[shines, 0] = 0
    side_material = np.asarray(material)[solid]
    rng = np.random.default_rng(7)
    points = np.column_stack([rng.uniform(-0.48, 0.48, (96, 2)) * length, np.full(96, 1.25)])
    return SceneData(
        patches=patches,
        two_sided=np.zeros(n, bool),
        closed=np.ones(n, bool),
        material_index=np.stack([side_material, side_material], axis=1),
        luminaire_index=lamp,
        parts=tuple(ScenePart(f"part{k}", "hall", "solid") for k in range(len(bodies))),
        faces=tuple(SceneFace(int(solid[p]), p + 1, "surface") for p in range(n)),
        materials=(
            Material(0.6, name="hall"),
            Material(0.4, name="desks"),
            Material(0.2, name="lamps"),
        ),
        luminaires=(Luminaire("lamps", "ceiling", EXITANCE * area, area, np.ones(3), 4000.0),),
        sensors=(Sensors("plane", points, np.array([0.0, 0.0, 1.0])),),
    )
