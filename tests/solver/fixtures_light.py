"""Small scenes of exact patches, and form factors through the solver's public functions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from patchlight.solver.dome import DomeLight, gather
from patchlight.solver.exchange import LEVELS, Rows, form_factor_matrix, make_sources
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import (
    Luminaire,
    Material,
    PatchSet,
    SceneData,
    SceneFace,
    ScenePart,
    Sensors,
)
from patchlight.solver.model.bezier import gauss_rule, tangents
from patchlight.solver.topology import make_blockers

UP = (0.0, 0.0, 1.0)


class Body(NamedTuple):
    """Patches of one solid; an open body blocks with both sides, a closed one with its front."""

    patches: PatchSet
    closed: bool = True


class Setup(NamedTuple):
    """Bodies put together: row p of every array is the same patch."""

    patches: PatchSet
    closed: np.ndarray
    solid: np.ndarray

    @property
    def blockers(self):
        return make_blockers(self.patches, self.closed, self.solid)


def setup(*bodies) -> Setup:
    """Bodies, or bare patch sets as open bodies, one solid each."""
    bodies = [b if isinstance(b, Body) else Body(b, False) for b in bodies]
    return Setup(
        PatchSet.concatenated(*(b.patches for b in bodies)),
        np.concatenate([np.full(len(b.patches), b.closed) for b in bodies]),
        np.concatenate([np.full(len(b.patches), k) for k, b in enumerate(bodies)]),
    )


def rectangle(*corners) -> PatchSet:
    """One planar patch; corners counter-clockwise about its +normal."""
    return PatchSet.from_bilinear(np.array([corners], dtype=float))


def ceiling(x0, x1, y0, y1, z) -> PatchSet:
    """Horizontal rectangle at height z that shines down."""
    return rectangle((x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z))


def closed_cylinder(start, end, radius) -> Body:
    """Solid cylinder: lateral surface and both ends."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    axis = end - start
    return Body(
        PatchSet.concatenated(
            PatchSet.cylinder(start, end, radius),
            PatchSet.disk(start, radius, -axis),
            PatchSet.disk(end, radius, axis),
        )
    )


def rows(
    parts: Setup,
    points,
    normals,
    *,
    on_patch=-1,
    eps: float = 1e-10,
    cell_eps: float = 1e-4,
    levels: int = LEVELS,
    trace: bool = True,
    single: bool = False,
) -> Rows:
    """Form factors from points (m, 3) to every patch as one element."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    normals = np.broadcast_to(np.asarray(normals, dtype=float), points.shape)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    m, p = len(points), len(parts.patches)
    elements = make_elements(parts.patches, np.zeros(p, bool), np.ones((p, 2), np.int64))
    sources = make_sources(elements, parts.patches.control_points, np.full(p, cell_eps))
    return form_factor_matrix(
        points[:, None],
        np.ascontiguousarray(normals[:, None]),
        np.ones((m, 1)),
        np.broadcast_to(np.asarray(on_patch, dtype=np.int64), (m,)),
        sources,
        parts.blockers,
        eps=eps,
        trace=trace,
        levels=levels,
        single=single,
    )


def factor(source, point, normal, **options) -> float:
    """Form factor from one point to a whole body in the open."""
    return float(rows(setup(source), point, normal, **options).factors.sum())


def dome(cells, points, normals, luminance=1.0, parts: Setup | None = None, **options) -> DomeLight:
    """Light of cells at infinity on points (m, 3), past ``parts`` if there are any."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    normals = np.broadcast_to(np.asarray(normals, dtype=float), points.shape)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    trace = parts is not None
    if parts is None:  # far below every horizon used here; not traced
        parts = setup(PatchSet.box((1, 1, 1), center=(0, 0, -1e3)))
    return gather(
        points[:, None],
        np.ascontiguousarray(normals[:, None]),
        np.ones((len(points), 1)),
        cells,
        luminance,
        parts.blockers,
        **{"eps": 1e-9, "cell_eps": 1e-4, "trace": trace, **options},
    )


def area_rule(patches: PatchSet, order: int):
    """Gauss points (m, 3), unit normals (m, 3) and area weights (m,) of a whole patch set."""
    x, w = gauss_rule(order)
    u, v = (g.ravel() for g in np.meshgrid(x, x, indexing="ij"))
    points, normals, weights = [], [], []
    for net in patches.control_points:
        at, su, sv = tangents(net, u, v)
        n = np.cross(su, sv)
        length = np.linalg.norm(n, axis=1)
        points.append(at)
        normals.append(n / length[:, None])
        weights.append(length * np.outer(w, w).ravel())
    return np.concatenate(points), np.concatenate(normals), np.concatenate(weights)


def turned(angle: float, axis=(1.0, 2.0, -0.7), offset=(3.0, -2.0, 5.0)) -> np.ndarray:
    """Rigid motion (4, 4): a turn about ``axis`` by Rodrigues' formula, then an offset."""
    k = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    m = np.eye(4)
    m[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    m[:3, 3] = offset
    return m


def scene(parts: Setup, *, rho=0.5, lamps=(), sensors=(), materials=None, **more) -> SceneData:
    """Frozen scene, one part a body; ``lamps`` are (body, group, exitance [lm/m²]).

    ``materials`` gives one reflectance a body instead of one ``rho`` for all.
    """
    n, count = len(parts.patches), int(parts.solid.max()) + 1
    patches = PatchSet(parts.patches.control_points, np.arange(n), parts.solid)
    areas = patches.areas()
    lamp = np.full((n, 2), -1)
    luminaires = []
    for k, (body, group, exitance) in enumerate(lamps):
        own = parts.solid == body
        lamp[own, 0] = k
        area = float(areas[own].sum())
        luminaires.append(
            Luminaire(f"part{body}", group, exitance * area, area, np.ones(3), 4000.0)
        )
    reflectances = [rho] if materials is None else list(materials)
    material = np.zeros(n, np.int64) if materials is None else parts.solid
    return SceneData(
        patches=patches,
        two_sided=np.zeros(n, bool),
        closed=parts.closed,
        material_index=np.stack([material, material], axis=1),
        luminaire_index=lamp,
        parts=tuple(
            ScenePart(
                f"part{k}", "model", "solid" if parts.closed[parts.solid == k].all() else "patches"
            )
            for k in range(count)
        ),
        faces=tuple(SceneFace(int(parts.solid[p]), p + 1, "surface") for p in range(n)),
        materials=tuple(Material(r, name=f"material {k}") for k, r in enumerate(reflectances)),
        luminaires=tuple(luminaires),
        sensors=tuple(sensors),
        **more,
    )


def grid(name, points, normal=UP) -> Sensors:
    return Sensors(name, np.atleast_2d(np.asarray(points, float)), np.asarray(normal, float))
