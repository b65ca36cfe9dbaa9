"""Light of photometric webs in the flux ledger: what is emitted, and what meets nothing.

What leaves the scene is found apart from what falls on the elements: rays from the emitting faces,
each of the same flux, spread by the web and by the area that each face shows to their direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .kernels.panes import Panes
from .model.arrays import FloatArray
from .model.bezier import area_points
from .model.elements import Elements
from .model.result import Balance
from .model.scene import SceneData
from .panes import make_panes, shares_through
from .raycast import RayCaster
from .surfaces import Surfaces
from .webs import WebLamp

#: Rays from a lamp alone, and from each of many; rays at a time; nodes a direction on each patch.
RAYS, _LEAST_RAYS, _BLOCK, _NODES = 1 << 14, 1 << 11, 1 << 16, 8
#: Share of an area that its quadrature may lack though none of it is buried.
ROUNDING = 1e-9
#: Distance of a ray's start from the face it leaves, relative to the scene.
_START = 1e-7
#: Steps of a sequence that fills a square evenly: powers of 1/g, g³ = g + 1.
_EVEN = np.array([0.7548776662466927, 0.5698402909980532])


def with_webs(
    balance: Balance,
    scene: SceneData,
    surfaces: Surfaces,
    lamps: list[WebLamp],
    *,
    sees_out: bool,
    tell: Callable[[int, int], None],
) -> Balance:
    """The ledger with the light that webs emit, and the part of it that meets nothing."""
    if not lamps:
        return balance
    caster = RayCaster(scene.without_panes.patches) if sees_out else None
    panes = make_panes(scene) if scene.see_through.any() else None
    emitted = escaped = 0.0
    by_group = dict(balance.emitted_by_group)
    rays = max(_LEAST_RAYS, RAYS // len(lamps))
    for done, lamp in enumerate(lamps):
        own = np.flatnonzero(surfaces.lamp == lamp.row)
        faces = Faces.of(surfaces.elements.take(own))
        sent = lamp.sent * faces.open_share(lamp.towards)
        flux = lamp.luminaire.flux_lm * float(sent.sum())
        group = lamp.luminaire.group
        by_group[group] = by_group.get(group, 0.0) + flux
        emitted += flux
        if caster is not None:
            escaped += flux * escaping_share(faces, lamp.towards, sent, scene, caster, rays, panes)
        tell(done + 1, len(lamps))
    return replace(
        balance,
        emitted_lm=balance.emitted_lm + emitted,
        escaped_lm=balance.escaped_lm + escaped,
        emitted_by_group=by_group,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Points (n, 3) on emitting faces, and the area vectors (n, 3) they stand for. [m²]

    ``open`` is the share (n,) of each that is not buried: what is buried emits nothing, though the
    lamp has the luminance of all of it.
    """

    points: FloatArray
    vectors: FloatArray
    open: FloatArray

    @classmethod
    def of(cls, elements: Elements) -> Faces:
        points, vectors = area_points(elements.nets, _NODES)
        kept = np.where(elements.buried, 0.0, elements.weights).sum(axis=1) / elements.areas
        kept[kept > 1.0 - ROUNDING] = 1.0
        return cls(points.reshape(-1, 3), vectors.reshape(-1, 3), np.repeat(kept, points.shape[1]))

    def shown(self, directions: FloatArray) -> FloatArray:
        """Projected area (m, n) of each point towards unit directions (m, 3). [m²]"""
        return np.maximum(directions @ self.vectors.T, 0.0)

    def open_share(self, directions: FloatArray) -> FloatArray:
        """Share (m,) of the area projected on directions (m, 3) that is not buried."""
        if (self.open == 1.0).all():
            return np.ones(len(directions))
        out = np.empty(len(directions))
        for first in range(0, len(out), 1024):
            rows = slice(first, first + 1024)
            shown = self.shown(directions[rows])
            whole = shown.sum(axis=1)
            out[rows] = shown @ self.open / np.where(whole > 0.0, whole, 1.0)
        return out


def escaping_share(
    faces: Faces,
    towards: FloatArray,
    sent: FloatArray,
    scene: SceneData,
    caster: RayCaster,
    rays: int = RAYS,
    panes: Panes | None = None,
) -> float:
    """Share of the light that ``faces`` send ``towards`` directions (k, 3) that meets nothing."""
    if not sent.sum() > 0.0:
        return 0.0
    origins, directions = emitted_rays(faces, towards, sent, rays)
    low, high = scene.patches.bounds()
    start = _START * float(np.linalg.norm(high - low))
    missed = 0.0
    for first in range(0, rays, _BLOCK):
        rows = slice(first, first + _BLOCK)
        hits = caster.first_hit(origins[rows], directions[rows], t_min=start)
        left = np.flatnonzero(hits.patch < 0)
        if panes is None:
            missed += len(left)
        else:
            o, d = origins[rows][left], directions[rows][left]
            missed += float(shares_through(panes, o, d, t_min=start)[0].sum())
    return missed / rays


def emitted_rays(
    faces: Faces, towards: FloatArray, sent: FloatArray, rays: int
) -> tuple[FloatArray, FloatArray]:
    """Origins and unit directions (rays, 3) of equal shares of the light."""
    u = np.mod(0.5 + np.arange(1, rays + 1)[:, None] * _EVEN, 1.0)
    # One number for the direction at equal steps, the next for the place: together even.
    t = (np.arange(rays) + 0.5) / rays
    directions = towards[_picked(sent, t)]
    origins = np.empty((rays, 3))
    for first in range(0, rays, 1024):
        rows = slice(first, min(first + 1024, rays))
        sums = np.cumsum(faces.shown(directions[rows]) * faces.open, axis=1)
        aim = u[rows, :1] * sums[:, -1:]
        origins[rows] = faces.points[np.minimum((sums <= aim).sum(axis=1), len(faces.points) - 1)]
    return origins, directions


def _picked(weights: FloatArray, t: FloatArray) -> np.ndarray:
    """Rows in proportion to ``weights``, for numbers t in 0 … 1."""
    sums = np.cumsum(weights)
    return np.minimum(np.searchsorted(sums, t * sums[-1], side="right"), len(weights) - 1)
