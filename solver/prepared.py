"""Sources and blockers of form factors without a scene, made ready for the kernels and kept.

What depends on the surfaces alone, neighbours, quadrics and regions, is found once for every set of
surfaces: asked again from other points, or after another part of a script has moved, it is there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .feet import normals_under
from .model.arrays import FloatArray, IntArray
from .model.patches import PatchSet

if TYPE_CHECKING:
    from .kernels.pieces import Surfaces
    from .kernels.pyramid import Blockers
    from .kernels.regions import Regions
    from .kernels.rows import Sources

#: Edges closer than this, against the size of all, are one: wider slits let light through.
_ONE_EDGE = 1e-9
#: Bend of an edge that does not matter, against the size of the patch.
_STRAIGHT = 1e-14
#: Sets of surfaces kept, and patches in each at most: some 6 kB a patch.
_KEPT, _KEPT_PATCHES = 4, 10_000


@dataclass(frozen=True, eq=False)
class Prepared:
    """Surfaces made ready.

    Attributes
    ----------
    sources : Sources
        n sources; ``sources.patch`` is the surface of each.
    surfaces : Blockers
        All p distinct surfaces, from both sides, each connected sheet for itself.
    quadrics : (p, 5, 4) array
        Of the surfaces, from `fit_quadrics`.
    """

    sources: Sources
    surfaces: Blockers
    quadrics: FloatArray

    @cached_property
    def outlines(self) -> tuple[Surfaces, Regions]:
        """What the contour of what is seen is made of."""
        from .regions import make_regions
        from .strict import see_through
        from .topology import PLANAR

        flat = self.surfaces.flags & PLANAR != 0
        # Tangent planes of those neither flat nor quadrics only.
        surfaces = see_through(self.surfaces, ~flat & (self.quadrics[:, 4, 3] == 0.0))
        return surfaces, make_regions(self.quadrics, surfaces.neighbors, self.surfaces)

    @cached_property
    def bent(self) -> NDArray[np.bool_]:
        """Sources (n,) with edges that are not straight: those of others are integrated exactly."""
        from .topology import edge_points

        edges = edge_points(self.sources.nets)
        along = edges[:, :, -1:] - edges[:, :, :1]
        off = np.linalg.norm(np.cross(edges - edges[:, :, :1], along), axis=3).max(axis=(1, 2))
        return np.asarray(off > _STRAIGHT * self.sources.spheres[:, 3] ** 2)

    @cached_property
    def nothing_hides(self) -> bool:
        """Whether there is one convex body alone."""
        from .topology import is_single

        return is_single(self.surfaces, self.surfaces.bulging)

    def under(self, points: FloatArray) -> IntArray:
        """Curved patch (m,) that each point lies on within 1e-9 of its size, −1 for none.

        Points in a plane need no telling: they see it edge-on.
        """
        from .quadrics import may_lie_on
        from .topology import PLANAR

        surfaces, out = self.surfaces, np.full(len(points), -1, dtype=np.int64)
        centers, radii = surfaces.spheres[:, :3], surfaces.spheres[:, 3]
        low, high = points.min(axis=0), points.max(axis=0)
        gaps = np.linalg.norm(np.maximum(np.maximum(low - centers, centers - high), 0.0), axis=1)
        for p in np.flatnonzero((surfaces.flags & PLANAR == 0) & (gaps <= radii)):
            at = may_lie_on(points, surfaces.spheres[p], self.quadrics[p]) & (out < 0)
            rows = np.flatnonzero(at)
            if not len(rows):
                continue
            nets = np.broadcast_to(surfaces.nets[p], (len(rows), 4, 4, 4))
            _, gap = normals_under(points[rows], nets)
            out[rows[gap <= 1e-9 * radii[p]]] = p
        return out


def prepare(sources: FloatArray, blockers: PatchSet | None) -> Prepared:
    """Sources (n, 4, 4, 4) that hide one another, and what hides them besides."""
    others = np.empty((0, 4, 4, 4)) if blockers is None else blockers.control_points
    many = len(sources) + len(others) > _KEPT_PATCHES
    find = _prepared.__wrapped__ if many else _prepared
    return find(sources.tobytes(), others.tobytes())


@lru_cache(maxsize=_KEPT)
def _prepared(source_bytes: bytes, blocker_bytes: bytes) -> Prepared:
    """The same, of the same bytes."""
    from .quadrics import fit_quadrics

    own, others = (np.frombuffer(b).reshape(-1, 4, 4, 4) for b in (source_bytes, blocker_bytes))
    nets, place = distinct_nets(own, others)
    surfaces = _surfaces(nets, place)
    quadrics = fit_quadrics(nets)
    return Prepared(_sources(own, place, surfaces, quadrics), surfaces, quadrics)


def forget() -> None:
    """Free what is kept."""
    _prepared.cache_clear()


def _net_key(net: FloatArray) -> bytes:
    """The same bytes for one surface whatever the direction of its parameters."""
    scaled = net / net[..., 3].max() + 0.0  # no −0: its bytes differ
    turned = [
        t[::a, ::b] for t in (scaled, scaled.swapaxes(0, 1)) for a in (1, -1) for b in (1, -1)
    ]
    return min(np.ascontiguousarray(t).tobytes() for t in turned)


def distinct_nets(sources: FloatArray, blockers: FloatArray) -> tuple[FloatArray, IntArray]:
    """Every surface once, however often and in whatever direction of parameters it is given.

    Returns
    -------
    nets : (p, 4, 4, 4) array
        The surfaces that hide light.
    place : (n,) int array
        Row of each source among them.
    """
    rows: dict[bytes, int] = {}
    nets: list[FloatArray] = []
    place = np.empty(len(sources), dtype=np.int64)
    for k, net in enumerate(sources):
        key = _net_key(net)
        if key not in rows:
            rows[key] = len(nets)
            nets.append(net)
        place[k] = rows[key]
    for net in blockers:
        key = _net_key(net)
        if key not in rows:
            rows[key] = len(nets)
            nets.append(net)
    return np.array(nets).reshape(-1, 4, 4, 4), place


def connected(adjacent: IntArray) -> IntArray:
    """Number of the connected sheet each patch belongs to, from its neighbours (p, 4)."""
    label = np.full(len(adjacent), -1, dtype=np.int64)
    count = 0
    for seed in range(len(adjacent)):
        if label[seed] >= 0:
            continue
        label[seed] = count
        stack = [seed]
        while stack:
            for other in adjacent[stack.pop()]:
                if other >= 0 and label[other] < 0:
                    label[other] = count
                    stack.append(int(other))
        count += 1
    return label


def _surfaces(nets: FloatArray, place: IntArray) -> Blockers:
    """Surfaces that hide from both sides, each connected sheet for itself; ``place``: of sources.

    A point is seen from before its tangent plane only, since only the + side of a source gives
    light: where all of a sheet lies behind all its tangent planes, closed or not, it hides nothing
    of itself. A hollow one hides nothing of itself from receivers on it if it has no hole.
    """
    from .topology import adjacency, convexity, make_blockers, watertight

    adjacent = adjacency(nets, np.zeros(len(nets), np.int64), relative=_ONE_EDGE)
    sheet = connected(adjacent)
    surfaces = make_blockers(PatchSet(nets), np.zeros(len(nets), bool), sheet, adjacent)
    count = len(surfaces.bulging)
    bulging, hollow = convexity(nets, surfaces.flags, sheet, np.ones(len(nets), bool), count)
    whole = np.ones(count, bool)
    np.logical_and.at(whole, sheet, watertight(nets, adjacent))
    # A surface that gives light from both sides bulges on one only.
    twice = np.zeros(count, bool)
    np.logical_or.at(twice, sheet, np.bincount(place, minlength=len(nets)) > 1)
    return surfaces._replace(bulging=bulging & ~twice, hollow=hollow & whole & ~twice)


def _sources(
    nets: FloatArray,
    place: IntArray,
    surfaces: Blockers,
    quadrics: FloatArray,
) -> Sources:
    """Every net as a source element of its own; ``place`` names its surface."""
    from .edges import make_edges
    from .kernels.rows import Sources
    from .quadrics import fit_quadrics
    from .tables import meridians, no_facets
    from .topology import bounding_spheres, normal_cones, shape_flags, writable
    from .walls import no_walls

    # Turned about or over, a surface differs from its source.
    other = (nets != surfaces.nets[place]).any(axis=(1, 2, 3))

    def of_sources(known: np.ndarray, find: Callable[[FloatArray], np.ndarray]) -> np.ndarray:
        out = known[place]
        if other.any():
            out[other] = find(nets[other])
        return out

    rows = np.arange(len(nets))
    whole = np.tile([0.0, 1.0, 0.0, 1.0], (len(nets), 1))
    cones = of_sources(surfaces.cones, normal_cones)
    spheres = of_sources(surfaces.spheres, bounding_spheres)
    return Sources(
        nets=writable(nets),
        cones=cones,
        spheres=spheres,
        flags=of_sources(surfaces.flags, shape_flags),
        quadrics=of_sources(quadrics, fit_quadrics),
        cell_eps=np.ones(len(nets)),
        patch=writable(place, np.int64),
        group=np.stack([rows, rows + 1, place], axis=1),
        group_points=writable(nets[:, 0, 0, :3] / nets[:, 0, 0, 3:]),
        group_cones=cones.copy(),
        group_spheres=spheres.copy(),
        azimuths=meridians(0),
        exact_above=np.zeros(len(nets)),
        point_from=np.full(len(nets), np.inf),
        dim=np.ones(len(nets)),
        **make_edges(nets, nets, rows, whole, np.zeros(len(nets), np.int64), cones)._asdict(),
        **no_facets()._asdict(),
        **no_walls(len(nets))._asdict(),
    )
