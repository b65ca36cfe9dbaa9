"""Scenes whose light is known, beside the cases that the tools are compared on.

References
----------
.. [1] CIE 171:2006, "Test cases to assess the accuracy of lighting computer programs", cases 5.3
   (area source) and 5.7 (diffuse wall behind an obstruction).
.. [2] G. J. Ward, box of 10 x 6 x 3 m with a panel of 0.5 x 0.5 m in the middle of its ceiling and
   reflectances 0.7, 0.5 and 0.3, 1990; also with a wall that is a mirror of reflectance 0.75.
.. [3] J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", 3rd ed.:
   enclosures of concentric spheres, and of a hemisphere over its base.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import truth_room
import truths
from case import Body, Case
from cases import CASES
from patchlight.solver.model import Material, PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray
from shapes import Disk, Patches, Rectangle, Sphere
from tools.ours import scene_data

#: Relative error of the benchmark's truths that are no closed forms; of F twice its noise, of G
#: twice how far two bases are apart.
_DOUBT = {
    "C3": 5e-6,
    "C3_surf": 1e-4,
    "D1_window": 1e-9,
    "D1_window_clear": 1e-9,
    "D1_roof": 1e-10,
    "D1_roof_clear": 1e-10,
    "D2": 1e-5,
    "D2_clear": 1e-5,
    "F": 8e-3,
    "G": 4e-4,
}


@dataclass(frozen=True, eq=False)
class Reference:
    """A scene with one grid, and the truth there.

    Attributes
    ----------
    name : str
        Short name.
    reflects : bool
        Whether light is reflected.
    scene : callable
        Makes the scene.
    truth : callable
        Illuminance (n,) at the sensors of its grid. [lx]
    doubt : float
        Relative error of the truth.
    """

    name: str
    reflects: bool
    scene: Callable[[], SceneData]
    truth: Callable[[], FloatArray]
    doubt: float = 0.0

    @classmethod
    def of(cls, case: Case, doubt: float = 0.0) -> Reference:
        """A case as it is; radiances [W/(sr m²)] stand for luminances [cd/m²]."""
        return cls(case.name, case.reflects, lambda: scene_data(case), case.truth, doubt)


def _case(name: str, bodies: tuple[Body, ...], points, normals, truth) -> Case:
    points, normals = np.asarray(points, float), np.asarray(normals, float)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Case(name, name, bodies, points, normals, lambda: truth(points, normals), "", ())


def _spread(count: int, seed: int) -> FloatArray:
    """Directions (n, 3), evenly at random."""
    out = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def box(size, *, center, **of) -> tuple[Body, ...]:
    """The six sides of a closed box, seen from within with ``inward``."""
    solid, inward = of.pop("solid"), of.pop("inward", False)
    patches = PatchSet.box(size, center=center, inward=inward)
    return tuple(Body(Patches(patches.take([k])), solid=solid, **of) for k in range(6))


def _dome() -> Case:
    """A luminous disk under a hemisphere: E = ρ E_dome above it, and π L / (2 − ρ) on the dome."""
    rho, radius = 0.5, 2.0
    vault = PatchSet.sphere((0, 0, 0), radius, inward=True).take(range(4, 8))
    wall = math.pi / (2.0 - rho)
    points = 0.9 * radius * _spread(60, 1) * np.linspace(0.1, 1.0, 60)[:, None]
    points[:, 2] = np.abs(points[:, 2]) + 0.02
    normals = np.tile([0.0, 0.0, 1.0], (60, 1))
    normals[::2] *= -1.0

    def truth(points: FloatArray, normals: FloatArray) -> FloatArray:
        down, out = normals[:, 2] < 0.0, np.full(len(points), rho * wall)
        seen = truths.disk(points[down], normals[down], (0, 0, 0), radius, (0, 0, 1), 8192)
        out[down] = seen + rho * wall * (1.0 - seen / math.pi)
        return out

    bodies = (
        Body(Disk((0.0, 0.0, 0.0), radius, (0.0, 0.0, 1.0)), radiance=1.0, solid=0),
        Body(Patches(vault), reflectance=rho, solid=0),
    )
    return _case("dome", bodies, points, normals, truth)


def _spheres() -> Case:
    """A luminous black sphere in a reflecting one, radii 1 and 2: E_wall = π L F / (1 − ρ (1 − F)).

    F = 1/4 is the factor from the outer one to the inner one.
    """
    rho = 0.5
    wall = 0.25 * math.pi / (1.0 - 0.75 * rho)
    points = _spread(80, 2) * np.linspace(1.02, 1.98, 80)[:, None]

    def truth(points: FloatArray, normals: FloatArray) -> FloatArray:
        seen = truths.sphere(points, normals, (0, 0, 0), 1.0)
        return seen + rho * wall * (1.0 - seen / math.pi)

    bodies = (
        Body(Sphere((0.0, 0.0, 0.0), 1.0), radiance=1.0, solid=0),
        Body(Sphere((0.0, 0.0, 0.0), 2.0, inward=True), reflectance=rho, solid=1),
    )
    return _case("spheres", bodies, points, _spread(80, 3), truth)


def _furnace() -> Case:
    """All surfaces of a furnished room shine and reflect alike: E = π L / (1 − ρ) everywhere."""
    rho = 0.6
    of = {"radiance": 1.0, "reflectance": rho}
    bodies = (
        *box((4, 5, 2.7), center=(0, 0, 1.35), inward=True, solid=0, **of),
        *box((1.4, 0.7, 0.05), center=(0.4, -0.6, 0.72), solid=1, **of),
        Body(Sphere((-0.9, 1.0, 0.6), 0.4), solid=2, **of),
    )
    points = np.random.default_rng(4).uniform((-1.9, -2.4, 0.05), (1.9, 2.4, 2.65), (100, 3))
    away = np.linalg.norm(points - [-0.9, 1.0, 0.6], axis=1) > 0.42
    clear = (np.abs(points - [0.4, -0.6, 0.72]) > [0.71, 0.36, 0.04]).any(axis=1)
    points = points[away & clear]
    return _case(
        "furnace",
        bodies,
        points,
        _spread(len(points), 5),
        lambda points, _: np.full(len(points), math.pi / (1.0 - rho)),
    )


#: Wall A … F at x = 2 m from top to bottom, floor G … N from that wall on.
CIE_WALL = np.array([(2.0, 0.0, z) for z in (2.75, 2.25, 1.75, 1.25, 0.75, 0.25)])
CIE_FLOOR = np.array([(2.0, 0.25 + 0.5 * k, 0.0) for k in range(8)])
CIE_POINTS = np.concatenate([CIE_WALL, CIE_FLOOR])
CIE_NORMALS = np.repeat([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], (6, 8), axis=0)


def _cie_area_source() -> Case:
    """A panel of 1 x 1 m in the middle of a ceiling [1]; all surfaces are black."""
    lamp = Rectangle((1.5, 1.5, 3.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    return _case(
        "CIE_5.3",
        (Body(lamp, radiance=1.0),),
        CIE_POINTS,
        CIE_NORMALS,
        lambda points, normals: truths.polygon(points, normals, lamp.corners()),
    )


def seen_past_the_box(points: FloatArray) -> FloatArray:
    """Height (n,) above which points at x = 2 see the far wall of case 5.7 [1]. [m]

    A black box, 4 m wide and 1 m high, stands from y = 2.5 to 2.7 before the wall at y = 4.
    """
    y, z = points[:, 1], points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        # Past the upper edge that stands higher in view: the near one, or the far one from above.
        near = z + (1.0 - z) * (4.0 - y) / (2.5 - y)
        far = z + (1.0 - z) * (4.0 - y) / (2.7 - y)
    height = np.where(z < 1.0, near, np.maximum(far, 0.0))
    return np.asarray(np.where(y >= 2.5, np.nan, height))


def far_wall(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance (n,) by what is seen past the box of a far wall of radiance 1. [W/m²]"""
    out = np.zeros(len(points))
    for k, low in enumerate(seen_past_the_box(points)):
        if low < 3.0:
            corners = np.array([[0, 4, low], [4, 4, low], [4, 4, 3], [0, 4, 3]], float)
            out[k] = truths.polygon(points[k : k + 1], normals[k : k + 1], corners)[0]
    return out


def _cie_obstruction() -> Case:
    lit = Rectangle((0.0, 4.0, 0.0), (4.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    x, z = (g.ravel() for g in np.meshgrid([0.3, 1.1, 2.0, 3.2], 0.05 + 0.1 * np.arange(30)))
    wall = np.column_stack([x, np.zeros(len(x)), z])
    x, y = (g.ravel() for g in np.meshgrid([0.3, 1.1, 2.0, 3.2], 0.05 + 0.1 * np.arange(15)))
    points = np.concatenate([wall, np.column_stack([x, y, np.zeros(len(x))])])
    normals = np.repeat([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], (len(wall), len(x)), axis=0)
    return _case(
        "CIE_5.7",
        (Body(lit, radiance=1.0), *box((4, 0.2, 1), center=(2, 2.6, 0.5), solid=0)),
        points,
        normals,
        far_wall,
    )


_X, _Y, _Z = (
    (0.0, 0.1, 0.4, 1.0, 1.8, 2.8, 3.8, 4.4, 4.75, 5.0),
    (0.0, 0.1, 0.4, 1.0, 1.8, 2.4, 2.75, 3.0),
    (0.0, 0.1, 0.4, 1.0, 1.6, 2.2, 2.7, 2.92, 3.0),
)
_PANEL = (4.75, 5.25, 2.75, 3.25)
WARD = truth_room.Room((10.0, 6.0, 3.0), 0.3, 0.5, 0.7, np.array([_PANEL]), (_X, _Y, _Z))
#: The same before a mirror in its wall at x = 10 m: a room of twice the length, half of it image.
WARD_MIRROR = truth_room.Room(
    (20.0, 6.0, 3.0),
    0.3,
    0.5,
    0.7,
    np.array([_PANEL, (14.75, 15.25, 2.75, 3.25)]),
    ((*_X[:-1], 5.25, 5.6, 6.2, 7.2, 8.2, 9.0, 9.6, 9.9, 10.0), _Y, _Z),
    image=0.75,
)
#: Where the box of [2] is looked at: y of every x, on ceiling, then floor.
WARD_X, WARD_Y = (0.25, 1.25, 2.75, 4.75), (0.25, 0.75, 1.25, 1.75, 2.25, 2.75)


def _ward_sensors(above: float) -> tuple[FloatArray, FloatArray]:
    at = np.array([(x, y) for x in WARD_X for y in WARD_Y])
    ceiling = np.column_stack([at, np.full(len(at), 3.0 - above)])
    # The last one is under the panel's edge: what it sees of it changes with the height.
    ceiling = ceiling[:-1]
    floor = np.column_stack([at, np.full(len(at), above)])
    normals = np.repeat([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], (len(ceiling), len(floor)), axis=0)
    return np.concatenate([ceiling, floor]), normals


def ward_bodies(end: float = 0.5) -> tuple[Body, ...]:
    """The box of [2]; ``end`` is the reflectance of the wall at x = 10 m."""
    x, y, z = 10.0, 6.0, 3.0
    walls = [
        (Rectangle((0.0, 0.0, 0.0), (x, 0.0, 0.0), (0.0, y, 0.0)), 0.3),
        (Rectangle((0.0, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)), 0.5),
        (Rectangle((x, 0.0, 0.0), (0.0, 0.0, z), (0.0, y, 0.0)), end),
        (Rectangle((0.0, 0.0, 0.0), (0.0, 0.0, z), (x, 0.0, 0.0)), 0.5),
        (Rectangle((0.0, y, 0.0), (x, 0.0, 0.0), (0.0, 0.0, z)), 0.5),
    ]
    bodies = [Body(shape, 0.0, rho, 0) for shape, rho in walls]
    xs, ys = (0.0, 4.75, 5.25, x), (0.0, 2.75, 3.25, y)
    for i in range(3):
        for j in range(3):
            across, along = (0.0, ys[j + 1] - ys[j], 0.0), (xs[i + 1] - xs[i], 0.0, 0.0)
            lamp = i == j == 1
            tile = Rectangle((xs[i], ys[j], z), across, along)
            bodies.append(Body(tile, float(lamp), 0.0 if lamp else 0.7, 0))
    return tuple(bodies)


def _ward(name: str, room: truth_room.Room, end: float) -> Case:
    return _case(
        name,
        ward_bodies(end),
        *_ward_sensors(5e-4),
        lambda points, normals: truth_room.irradiance(room, points, normals),
    )


def with_mirror(data: SceneData, patch: int, share: float) -> SceneData:
    """The scene with one patch for a mirror that reflects nothing else."""
    materials = (*data.materials, Material(0.0, mirror=share))
    index = data.material_index.copy()
    index[patch, 0] = len(data.materials)
    return dataclasses.replace(data, materials=materials, material_index=index)


_BESIDE_MIRROR = _ward("Ward_mirror", WARD_MIRROR, 0.0)

REFERENCES = (
    *(Reference.of(case, _DOUBT.get(case.name, 0.0)) for case in CASES),
    Reference.of(_cie_area_source()),
    Reference.of(_cie_obstruction()),
    Reference.of(_dome()),
    Reference.of(_spheres()),
    Reference.of(_furnace()),
    Reference.of(_ward("Ward", WARD, 0.5), 2e-5),
    Reference(
        "Ward_mirror",
        True,
        lambda: with_mirror(scene_data(_BESIDE_MIRROR), 2, WARD_MIRROR.image),
        _BESIDE_MIRROR.truth,
        2e-5,
    ),
)


def reference(name: str) -> Reference:
    """The one of that name."""
    return next(one for one in REFERENCES if one.name == name)
