"""A room with one lamp hung 30 cm below the ceiling, which it lights, and hides in part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Body, Case, accuracies, samples
from patchlight.solver.model.arrays import FloatArray
from shapes import Rectangle

SIZE = (4.0, 3.0, 2.8)
FLOOR, WALLS, CEILING = 0.3, 0.7, 0.7
#: Two corners of the lamp, which shines from all of its sides. [m]
LAMP = (1.4, 1.4, 2.4), (2.6, 1.6, 2.5)
#: Illuminance at the sensors for a lamp of radiance 1, from `truth_by_mitsuba.py`.
TRUTH = Path(__file__).with_name("g_pendant.npy")


def _box(low, high, *, inward: bool) -> dict[str, Rectangle]:
    """Sides of a box, by where they are: x, y, z for the lower ones, X, Y, Z for the upper."""
    a, b = np.array(low), np.array(high)
    out = {}
    for axis, name in enumerate("xyz"):
        one, two = np.zeros(3), np.zeros(3)
        one[(axis + 1) % 3], two[(axis + 2) % 3] = (b - a)[[(axis + 1) % 3, (axis + 2) % 3]]
        for upper in (False, True):
            corner = a.copy()
            corner[axis] = b[axis] if upper else a[axis]
            first, second = (one, two) if upper != inward else (two, one)
            sides = (tuple(map(float, v)) for v in (corner, first, second))
            out[name.upper() if upper else name] = Rectangle(*sides)
    return out


def _bodies() -> tuple[Body, ...]:
    rho = {"z": FLOOR, "Z": CEILING}
    room = _box((0.0, 0.0, 0.0), SIZE, inward=True)
    walls = [Body(s, 0.0, rho.get(name, WALLS), solid=0) for name, s in room.items()]
    lamp = _box(*LAMP, inward=False).values()
    return (*walls, *(Body(side, radiance=1.0, solid=1) for side in lamp))


def _sensors() -> tuple[FloatArray, FloatArray]:
    """A work plane, two walls and the floor; half a millimetre in front of these."""
    parts = [
        ((np.arange(0.25, 4.0, 0.5), np.arange(0.25, 3.0, 0.5), [0.8]), (0.0, 0.0, 1.0)),
        (([5e-4], [0.3, 1.1, 1.9, 2.7], [0.4, 1.2, 2.0, 2.5]), (1.0, 0.0, 0.0)),
        (([0.4, 1.4, 2.4, 3.6], [2.9995], [0.4, 1.2, 2.0, 2.5]), (0.0, -1.0, 0.0)),
        (([0.3, 1.3, 2.3, 3.3], [0.3, 1.4, 2.6], [5e-4]), (0.0, 0.0, 1.0)),
    ]
    points, normals = [], []
    for axes, normal in parts:
        grid = np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)
        points.append(grid)
        normals.append(np.tile(normal, (len(grid), 1)))
    return np.concatenate(points), np.concatenate(normals)


POINTS, NORMALS = _sensors()
CASE = Case(
    name="G",
    title="room 4 x 3 x 2.8 m with a lamp 30 cm below its ceiling",
    bodies=_bodies(),
    points=POINTS,
    normals=NORMALS,
    truth=lambda: np.load(TRUTH).astype(np.float64),
    how="Patchlight at 0.0015, beside another basis (2e-4) and Mitsuba",
    patchlight=accuracies(0.5, 0.2, 0.1, 0.05, 0.02, 0.01),
    mitsuba=samples(64, 256, 1024, 4096, 16384, depth=40, direct="mis"),
)
