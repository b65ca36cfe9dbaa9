"""Shapes that every tool can be given in its own words: exactly where it knows them, else cut."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model import PatchSet
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.shapes import arc
from radiance_scene import area, polygons

Vector = tuple[float, float, float]


class Shape:
    """A surface with an outside.

    Methods return: exact patches; the primitive of Radiance (type and numbers) or None; and the
    dictionary of Mitsuba or None.
    """

    def patches(self) -> PatchSet:
        """Exact patches, +normal outward."""
        raise NotImplementedError

    def radiance(self) -> tuple[str, tuple[float, ...]] | None:
        """Radiance's own primitive, if it has one."""
        return None

    def mitsuba(self) -> dict | None:
        """Mitsuba's own shape, if it has one."""
        return None

    def cut(self, first: int, second: int) -> tuple[list[FloatArray], float]:
        """Polygons (k, 3) with that many pieces along a patch's sides; exact area over theirs.

        ``second`` is for flat patches with curved sides, 0 leaves them whole.
        """
        patches = self.patches()
        rings = [ring for patch in polygons(patches, first, second or None) for ring in patch]
        return rings, float(patches.areas().sum()) / sum(area(ring) for ring in rings)


@dataclass(frozen=True)
class Rectangle(Shape):
    """Corner and two sides at right angles; the outside is where first x second points. [m]"""

    corner: Vector
    first: Vector
    second: Vector

    def corners(self) -> FloatArray:
        """(4, 3), counter-clockwise seen from outside. [m]"""
        c, a, b = (np.array(x, dtype=float) for x in (self.corner, self.first, self.second))
        return np.array([c, c + a, c + a + b, c + b])

    def patches(self) -> PatchSet:
        return PatchSet.from_bilinear(self.corners()[None])

    def radiance(self) -> tuple[str, tuple[float, ...]]:
        return "polygon", tuple(self.corners().ravel())

    def mitsuba(self) -> dict:
        c, a, b = (np.array(x, dtype=float) for x in (self.corner, self.first, self.second))
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 3] = 0.5 * a, 0.5 * b, c + 0.5 * (a + b)
        normal = np.cross(a, b)
        matrix[:3, 2] = normal / np.linalg.norm(normal)
        return {"type": "rectangle", "to_world": matrix}

    def cut(self, first: int, second: int) -> tuple[list[FloatArray], float]:
        s, t = (np.linspace(0.0, 1.0, n + 1) for n in (first, second))
        grid = self.patches().evaluate(s[:, None], t[None, :])[0]
        quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
        return list(quads.reshape(-1, 4, 3)), 1.0


@dataclass(frozen=True)
class Sphere(Shape):
    """Sphere, seen from within when ``inward``. [m]"""

    center: Vector
    radius: float
    inward: bool = False

    def patches(self) -> PatchSet:
        return PatchSet.sphere(self.center, self.radius, inward=self.inward)

    def radiance(self) -> tuple[str, tuple[float, ...]]:
        return "bubble" if self.inward else "sphere", (*self.center, self.radius)

    def mitsuba(self) -> dict:
        return {
            "type": "sphere",
            "center": list(self.center),
            "radius": self.radius,
            "flip_normals": self.inward,
        }


@dataclass(frozen=True)
class OpenCavity(Shape):
    """A sphere seen from within, cut off at the height ``top`` above its centre. [m]

    The peers, which know whole spheres only, get one: what closes the cut hides the rest.
    """

    center: Vector
    radius: float
    top: float

    def patches(self) -> PatchSet:
        nets = []
        end = math.asin(self.top / self.radius)
        for low, high in ((-0.5 * math.pi, 0.0), (0.0, end)):
            profile = arc(low, high)
            if low < 0.0:
                profile[0, 0] = 0.0  # cos 90° is not zero in floating point
            for k in range(4):
                turn = arc(0.5 * math.pi * k, 0.5 * math.pi * (k + 1))
                net = np.empty((4, 4, 4))
                net[..., 3] = turn[:, None, 2] * profile[None, :, 2]
                for axis in (0, 1):
                    net[..., axis] = self.radius * turn[:, None, axis] * profile[None, :, 0]
                net[..., 2] = self.radius * turn[:, None, 2] * profile[None, :, 1]
                net[..., :3] += net[..., 3:] * np.array(self.center)
                nets.append(net)
        return PatchSet(np.array(nets)).flipped()

    def radiance(self) -> tuple[str, tuple[float, ...]]:
        return Sphere(self.center, self.radius, inward=True).radiance()

    def mitsuba(self) -> dict:
        return Sphere(self.center, self.radius, inward=True).mitsuba()


@dataclass(frozen=True)
class Cylinder(Shape):
    """Lateral surface of a circular cylinder. [m]"""

    start: Vector
    end: Vector
    radius: float

    def patches(self) -> PatchSet:
        return PatchSet.cylinder(self.start, self.end, self.radius)

    def radiance(self) -> tuple[str, tuple[float, ...]]:
        return "cylinder", (*self.start, *self.end, self.radius)

    def mitsuba(self) -> dict:
        return {
            "type": "cylinder",
            "p0": list(self.start),
            "p1": list(self.end),
            "radius": self.radius,
        }


@dataclass(frozen=True)
class Disk(Shape):
    """Flat disk. [m]"""

    center: Vector
    radius: float
    normal: Vector

    def patches(self) -> PatchSet:
        return PatchSet.disk(self.center, self.radius, self.normal)

    def radiance(self) -> tuple[str, tuple[float, ...]]:
        return "ring", (*self.center, *self.normal, 0.0, self.radius)

    def mitsuba(self) -> dict:
        z = np.array(self.normal, dtype=float) / np.linalg.norm(self.normal)
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
        x /= np.linalg.norm(x)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1] = self.radius * x, self.radius * np.cross(z, x)
        matrix[:3, 2], matrix[:3, 3] = z, self.center
        return {"type": "disk", "to_world": matrix}


@dataclass(frozen=True, eq=False)
class Patches(Shape):
    """Any exact patches; the peers get polygons."""

    of: PatchSet

    def patches(self) -> PatchSet:
        return self.of
