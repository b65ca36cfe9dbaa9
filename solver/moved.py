"""Where parts have moved: which patches, where these were and are, and what sees these places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .topology import bounding_spheres, writable

if TYPE_CHECKING:
    from .kernels.shafts import Places


def moved_patches(old: FloatArray, new: FloatArray) -> NDArray[np.bool_]:
    """Which of patches (p, 4, 4, 4) are elsewhere, or have another shape."""
    return np.asarray((old != new).any(axis=(1, 2, 3)))


def places_of(old: FloatArray, new: FloatArray, dirty: NDArray[np.bool_], part: IntArray) -> Places:
    """Balls about ``dirty`` (p,) patches of control nets ``old`` and ``new`` (p, 4, 4, 4)."""
    from .kernels.shafts import Places

    parts: list[FloatArray] = []
    whole_ends, part_ends = [0], [0]
    patches, wholes = [np.zeros((0, 4))], []
    for nets in (old, new):
        for one in np.unique(part[dirty]):
            patches.append(bounding_spheres(np.ascontiguousarray(nets[dirty & (part == one)])))
            parts.append(ball_about(patches[-1]))
            part_ends.append(part_ends[-1] + len(patches[-1]))
        if len(parts) > whole_ends[-1]:
            wholes.append(ball_about(np.array(parts[whole_ends[-1] :])))
            whole_ends.append(len(parts))
    return Places(
        np.array(wholes).reshape(-1, 4),
        _ranges(whole_ends),
        np.array(parts).reshape(-1, 4),
        _ranges(part_ends),
        np.concatenate(patches),
    )


def ball_about(balls: FloatArray) -> FloatArray:
    """A ball (4,) about some (b, 4)."""
    low = (balls[:, :3] - balls[:, 3:]).min(axis=0)
    high = (balls[:, :3] + balls[:, 3:]).max(axis=0)
    middle = 0.5 * (low + high)
    reach = (np.linalg.norm(balls[:, :3] - middle, axis=1) + balls[:, 3]).max()
    return np.array([*middle, reach * (1.0 + 1e-12)])


def _ranges(ends: list[int]) -> IntArray:
    """First and end (k, 2) of what follows one another with these ``ends``, the first being 0."""
    return np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int64)


def points_in_new_light(
    scene: SceneData, before: FloatArray, patch: IntArray, points: FloatArray, normals: FloatArray
) -> NDArray[np.bool_]:
    """At which points (n, k, 3) on patches (n,) direct light of lamps may have changed: (n, k).

    Parts stood elsewhere: ``before`` (p, 4, 4, 4) are the control nets as they were.
    """
    from .kernels.shafts import Seen, find_touched_points

    nets = scene.patches.control_points
    dirty = moved_patches(before, nets)
    lit = (scene.luminaire_index >= 0).any(axis=1)
    touched = np.repeat(dirty[patch], points.shape[1])
    if (dirty & lit).any() or (dirty.any() and scene.sun is not None):
        return np.ones(points.shape[:2], dtype=bool)
    lamps = int(lit.sum())
    planes = np.zeros((lamps, 4))
    planes[:, 3] = -np.inf
    spheres = bounding_spheres(np.ascontiguousarray(nets[lit]))
    find_touched_points(
        writable(points.reshape(-1, 3)),
        writable(normals.reshape(-1, 3)),
        Seen(writable(spheres.T), planes, np.zeros((lamps, 4, 3))),
        places_of(before, nets, dirty, scene.patches.part_index),
        touched,
    )
    return touched.reshape(points.shape[:2])
