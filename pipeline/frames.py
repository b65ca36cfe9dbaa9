"""Axes: from a file to the scene (z up, as the user writes it) to the world (y north)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

if TYPE_CHECKING:
    from .scene import Scene

#: Rotations that bring the named axis of a file to z.
_UP = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}


def up_matrix(up: str) -> FloatArray:
    """(4, 4) rotation that brings the axis ``up`` ("x", "y" or "z") of a file to z."""
    if up not in _UP:
        raise InputError(f"up = {up!r}: must be 'z', 'y' or 'x'")
    m = np.eye(4)
    m[:3, :3] = _UP[up]
    return m


def north_matrix(north_deg: float) -> FloatArray:
    """(4, 4) rotation about z from the scene to the world, where +y is north.

    ``north_deg`` is the direction of true north in the scene, clockwise from +y [deg]; turning
    everything counter-clockwise by it brings north to +y.
    """
    if not (math.isfinite(north_deg) and -360.0 <= north_deg <= 360.0):
        raise InputError(f"north_deg = {north_deg}: must lie between -360 and 360")
    m = np.eye(4)
    # Quarter turns stay exact, so that axis-parallel walls stay axis-parallel.
    quarter, rest = divmod(north_deg, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = math.cos(math.radians(north_deg)), math.sin(math.radians(north_deg))
    m[:2, :2] = [[c, -s], [s, c]]
    return m


def transformed_points(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Points (..., 3) [m] under an affine matrix (4, 4)."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def transformed_normals(matrix: FloatArray, normals: FloatArray) -> FloatArray:
    """Unit normals (..., 3) under the linear part of ``matrix`` (inverse transpose)."""
    out = normals @ np.linalg.inv(matrix[:3, :3])
    return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))


def part_placements(scene: Scene) -> list[FloatArray]:
    """(4, 4) matrices from the own coordinates of every part, in order, to those of the scene."""
    return [
        np.asarray(entry.placement @ part.placement)
        for entry in scene.entries.values()
        for part in entry.model.parts
    ]
