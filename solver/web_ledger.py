"""Light of photometric webs in the flux ledger: what is emitted, and what meets nothing.

What leaves the scene is found apart from what falls on the elements: rays from the emitting faces,
each of the same flux, spread by the web and by the area that each face shows to their direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .model.arrays import FloatArray
from .model.bezier import gauss_rule, surface_points
from .model.result import Balance
from .model.scene import SceneData
from .raycast import RayCaster
from .surfaces import Surfaces
from .webs import WebLamp

#: Rays from a lamp alone, and from each of many; rays at a time; nodes a direction on each patch.
RAYS, _LEAST_RAYS, _BLOCK, _NODES = 1 << 14, 1 << 11, 1 << 16, 8
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
    caster = RayCaster(scene.patches) if sees_out else None
    emitted = escaped = 0.0
    by_group = dict(balance.emitted_by_group)
    rays = max(_LEAST_RAYS, RAYS // len(lamps))
    for done, lamp in enumerate(lamps):
        own = surfaces.lamp == lamp.row
        # Buried parts of elements emit nothing, as those of other lamps.
        flux = lamp.luminaire.exitance_lm_m2 * float(surfaces.areas[own].sum())
        group = lamp.luminaire.group
        by_group[group] = by_group.get(group, 0.0) + flux
        emitted += flux
        if caster is not None:
            escaped += flux * escaping_share(lamp, scene, caster, rays)
        tell(done + 1, len(lamps))
    return replace(
        balance,
        emitted_lm=balance.emitted_lm + emitted,
        escaped_lm=balance.escaped_lm + escaped,
        emitted_by_group=by_group,
    )


def escaping_share(lamp: WebLamp, scene: SceneData, caster: RayCaster, rays: int = RAYS) -> float:
    """Share of a lamp's light that meets nothing."""
    origins, directions = emitted_rays(lamp, scene, rays)
    low, high = scene.patches.bounds()
    start = _START * float(np.linalg.norm(high - low))
    missed = 0
    for first in range(0, rays, _BLOCK):
        rows = slice(first, first + _BLOCK)
        hits = caster.first_hit(origins[rows], directions[rows], t_min=start)
        missed += int((hits.patch < 0).sum())
    return missed / rays


def emitted_rays(lamp: WebLamp, scene: SceneData, rays: int) -> tuple[FloatArray, FloatArray]:
    """Origins and unit directions (rays, 3) of equal shares of a lamp's light."""
    u = np.mod(0.5 + np.arange(1, rays + 1)[:, None] * _EVEN, 1.0)
    # One number for the direction at equal steps, the next for the place: together even.
    t = (np.arange(rays) + 0.5) / rays
    directions = lamp.towards[_picked(lamp.sent, t)]
    points, vectors = _places(lamp, scene)
    origins = np.empty((rays, 3))
    for first in range(0, rays, 1024):
        rows = slice(first, min(first + 1024, rays))
        shown = np.maximum(directions[rows] @ vectors.T, 0.0)
        sums = np.cumsum(shown, axis=1)
        aim = u[rows, :1] * sums[:, -1:]
        origins[rows] = points[np.minimum((sums <= aim).sum(axis=1), len(points) - 1)]
    return origins, directions


def _picked(weights: FloatArray, t: FloatArray) -> np.ndarray:
    """Rows in proportion to ``weights``, for numbers t in 0 … 1."""
    sums = np.cumsum(weights)
    return np.minimum(np.searchsorted(sums, t * sums[-1], side="right"), len(weights) - 1)


def _places(lamp: WebLamp, scene: SceneData) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) on the emitting faces and the area vectors they stand for."""
    nets = scene.patches.control_points[lamp.patches].copy()
    turned = lamp.sides == 1
    nets[turned] = nets[turned][:, ::-1]
    t, w = gauss_rule(_NODES)
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    shape = (len(nets), len(u))
    points, su, sv = surface_points(nets, np.broadcast_to(u, shape), np.broadcast_to(v, shape))
    vectors = np.cross(su, sv) * np.outer(w, w).ravel()[:, None]
    return points.reshape(-1, 3), vectors.reshape(-1, 3)
