"""Flat patches, and a room with an opening, for tests."""

from __future__ import annotations

import numpy as np
from patchlight.pipeline import Material, PatchSet, Scene


def quad(*corners) -> PatchSet:
    return PatchSet.from_bilinear(np.array([corners], dtype=float))


def level(half, z, up=True) -> PatchSet:
    """A square of half side ``half`` about the z axis, facing up or down."""
    corners = [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]
    return quad(*(corners if up else corners[::-1]))


def opening(y=0.0) -> PatchSet:
    """What fills the opening of `window_room`, or one like it at y."""
    return quad((-1, y, 1), (1, y, 1), (1, y, 2), (-1, y, 2))


def window_room(width, height, rho) -> Scene:
    """A room from y = 0 to 4 m; in its wall y = 0 an opening 2 x 1 m from z = 1 m."""
    scene = Scene()
    w, d, h, x, low, high = 0.5 * width, 4.0, height, 1.0, 1.0, 2.0
    walls = {
        "floor": ((-w, 0, 0), (w, 0, 0), (w, d, 0), (-w, d, 0)),
        "ceiling": ((-w, 0, h), (-w, d, h), (w, d, h), (w, 0, h)),
        "north": ((-w, d, 0), (w, d, 0), (w, d, h), (-w, d, h)),
        "west": ((-w, 0, 0), (-w, d, 0), (-w, d, h), (-w, 0, h)),
        "east": ((w, 0, 0), (w, 0, h), (w, d, h), (w, d, 0)),
        "left": ((-w, 0, 0), (-x, 0, 0), (-x, 0, h), (-w, 0, h)),
        "right": ((x, 0, 0), (w, 0, 0), (w, 0, h), (x, 0, h)),
        "sill": ((-x, 0, 0), (x, 0, 0), (x, 0, low), (-x, 0, low)),
        "lintel": ((-x, 0, high), (x, 0, high), (x, 0, h), (-x, 0, h)),
    }
    for name, corners in walls.items():
        scene.add(quad(*corners), name, two_sided=True)
        scene.assign(name, Material(rho))
    return scene
