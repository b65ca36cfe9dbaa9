"""An empty room with four black ceiling lamps: the work plane, and points on its surfaces."""

import numpy as np
import truth_room
from case import Body, Case, RadianceSetting, accuracies, samples
from patchlight.solver.model.arrays import FloatArray
from shapes import Rectangle

SIZE = (4.0, 3.0, 2.7)
FLOOR, WALLS, CEILING = 0.2, 0.5, 0.7
PANELS = np.array([(x, x + 0.6, y, y + 0.6) for x in (0.7, 2.7) for y in (0.4, 2.0)])
ROOM = truth_room.Room(
    SIZE,
    FLOOR,
    WALLS,
    CEILING,
    PANELS,
    (
        (0.0, 0.05, 0.2, 0.45, 0.7, 1.0, 1.3, 1.65, 2.0),
        (0.0, 0.05, 0.2, 0.4, 0.7, 1.0, 1.25, 1.5),
        (0.0, 0.05, 0.2, 0.5, 0.9, 1.35, 1.8, 2.2, 2.5, 2.65, 2.7),
    ),
)


def _bodies() -> tuple[Body, ...]:
    """Ceiling in strips about the lamps, so that nothing lies in the same place twice."""
    x, y, z = SIZE
    down = [
        Body(Rectangle((0.0, 0.0, 0.0), (x, 0.0, 0.0), (0.0, y, 0.0)), 0.0, FLOOR, 0),
        Body(Rectangle((0.0, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)), 0.0, WALLS, 0),
        Body(Rectangle((x, 0.0, 0.0), (0.0, 0.0, z), (0.0, y, 0.0)), 0.0, WALLS, 0),
        Body(Rectangle((0.0, 0.0, 0.0), (0.0, 0.0, z), (x, 0.0, 0.0)), 0.0, WALLS, 0),
        Body(Rectangle((0.0, y, 0.0), (x, 0.0, 0.0), (0.0, 0.0, z)), 0.0, WALLS, 0),
    ]
    xs, ys = (0.0, 0.7, 1.3, 2.7, 3.3, 4.0), (0.0, 0.4, 1.0, 2.0, 2.6, 3.0)
    for i in range(5):
        for j in range(5):
            side, across = (xs[i + 1] - xs[i], 0.0, 0.0), (0.0, ys[j + 1] - ys[j], 0.0)
            lamp = i in (1, 3) and j in (1, 3)
            tile = Rectangle((xs[i], ys[j], z), across, side)
            down.append(Body(tile, float(lamp), 0.0 if lamp else CEILING, 0))
    return tuple(down)


def _grid(*axes) -> FloatArray:
    return np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)


def _surfaces() -> tuple[FloatArray, FloatArray]:
    """Floor, wall at x = 0, wall at y = 0 and ceiling, half a millimetre in front of them."""
    e = [0.0005]
    near = [0.02, 0.1, 0.3, 0.7, 1.1, 1.5]
    up = [0.02, 0.3, 0.9, 1.5, 2.1, 2.5, 2.68]
    parts = (
        (_grid([*near, 1.9], near, e), (0.0, 0.0, 1.0)),
        (_grid(e, near, up), (1.0, 0.0, 0.0)),
        (_grid(near, e, up), (0.0, 1.0, 0.0)),
        (_grid([0.05, 0.35, 1.7, 2.0], [0.05, 0.2, 1.2, 1.5], [2.6995]), (0.0, 0.0, -1.0)),
    )
    points = np.concatenate([p for p, _ in parts])
    return points, np.concatenate([np.tile(n, (len(p), 1)) for p, n in parts])


def _case(name: str, title: str, points: FloatArray, normals: FloatArray, how: str, **more) -> Case:
    return Case(
        name=name,
        title=title,
        bodies=_bodies(),
        points=points,
        normals=normals,
        truth=lambda: truth_room.irradiance(ROOM, points, normals),
        how=how,
        patchlight=accuracies(0.5, 0.2, 0.1, 0.05, 0.02, 0.01),
        **more,
    )


PLANE = _grid(np.arange(0.25, 4.0, 0.5), np.arange(0.25, 3.0, 0.5), [0.8])
WORKPLANE = _case(
    "C3",
    "room 4 x 3 x 2.7 m with four ceiling lamps, work plane",
    PLANE,
    np.tile([0.0, 0.0, 1.0], (len(PLANE), 1)),
    "collocation on three meshes, extrapolated (5e-6)",
    radiance=tuple(
        RadianceSetting((1, 1), f"-ds 0.1 -ab 8 -ad {ad} -lw {0.16 / ad:.1e}")
        for ad in (64, 256, 1024, 4096, 16384)
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, 65536, depth=24, direct="mis"),
)
SURFACES = _case(
    "C3_surf",
    "the same room, points on floor, walls and ceiling down to 2 cm from its corners",
    *_surfaces(),
    "collocation on three meshes, extrapolated (1e-4)",
    radiance=tuple(
        RadianceSetting((1, 1), f"-ds 0.1 -ab 8 -ad {ad} -lw {0.16 / ad:.1e}")
        for ad in (64, 256, 1024, 4096)
    ),
    mitsuba=samples(64, 256, 1024, 4096, 16384, depth=24, direct="mis"),
)
