"""Scenes with mirrors and glossy surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from patchlight.solver.model import Material, PatchSet, SceneData

from .fixtures_light import Setup, ceiling, grid, scene, setup

BLACK = Material(0.0, name="black")


def with_materials(parts: Setup, materials, **more) -> SceneData:
    """Scene with one material a body."""
    made = scene(parts, materials=[0.0] * (int(parts.solid.max()) + 1), **more)
    return replace(made, materials=tuple(materials))


def room_parts(x0: float, x1: float, lamps, *bodies) -> tuple[Setup, int]:
    """A room 3 x 2.5 m, each wall one body, with lamps under the ceiling and other bodies.

    Also the number of the wall at ``x0``.
    """
    box = PatchSet.box((x1 - x0, 3, 2.5), center=(0.5 * (x0 + x1), 0, 0), inward=True)
    parts = setup(box, *(ceiling(a, b, -0.2, 0.3, 1.2) for a, b in lamps), *bodies)
    solid = np.concatenate([np.arange(6), 5 + parts.solid[6:]])
    middle = box.control_points[..., 0].mean(axis=(1, 2))
    return Setup(parts.patches, parts.closed, solid), int(np.argmin(middle))


def doubled_rooms(mirror, diffuse, points, normal, *bodies, images=()):
    """A room with a mirror wall at x = 0, and the room twice as long that it looks like."""
    one, wall = room_parts(0.0, 4.0, [(1.0, 1.5)], *bodies)
    two, _ = room_parts(-4.0, 4.0, [(1.0, 1.5), (-1.5, -1.0)], *bodies, *images)
    materials = [diffuse] * 6 + [BLACK] + [diffuse] * len(bodies)
    materials[wall] = mirror
    sensors = [grid("g", points, normal)]
    first = with_materials(one, materials, lamps=[(6, "lamp", 1000.0)], sensors=sensors)
    second = with_materials(
        two,
        [diffuse] * 6 + [BLACK] * 2 + [diffuse] * (2 * len(bodies)),
        lamps=[(6, "lamp", 1000.0), (7, "lamp", 1000.0)],
        sensors=sensors,
    )
    return first, second
