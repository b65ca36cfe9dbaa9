"""What is placed where it makes no sense, as far as a run before this one has not asked already."""

from __future__ import annotations

import numpy as np

from .containment import Containment
from .model.arrays import FloatArray
from .model.scene import SceneData
from .moved import balls_about, moved_patches
from .placement import check_placement
from .reuse import Kept
from .topology import bounding_spheres

#: Distance from what has moved in which nothing is taken to be as it was, against the scene's size.
NEAR = 1e-4


def placement_remarks(scene: SceneData, tester: Containment, kept: Kept) -> tuple[str, ...]:
    """As `check_placement`: nothing is asked twice of the same scene, whatever its lamps' flux.

    Where nothing was wrong, and parts have moved that neither are nor come near lamps, cameras or
    sensors, nothing is.
    """
    lamps = [(lamp.part, lamp.area_m2) for lamp in scene.luminaires]
    flux = [lamp.flux_lm for lamp in scene.luminaires]
    at = (scene.luminaire_index, lamps, scene.cameras, scene.sensors)

    def find() -> tuple[str, ...]:
        before = kept.of_parts("placement", at)
        if before is not None and not _may_differ(scene, before):
            return ()
        return check_placement(scene, tester)

    lines, told = kept.find("placement", at, lambda: (find(), flux))
    if not lines:
        kept.keep_of_parts("placement", at, scene.patches.control_points)
    return lines if not lines or told == flux else check_placement(scene, tester)


def _may_differ(scene: SceneData, before: FloatArray) -> bool:
    """Whether moved parts may matter, control nets having been as ``before`` (p, 4, 4, 4)."""
    nets, part = scene.patches.control_points, scene.patches.part_index
    dirty = moved_patches(before, nets)
    lit = (scene.luminaire_index >= 0).any(axis=1)
    air = np.array([one.kind == "air" for one in scene.parts], dtype=bool)
    ends = [
        np.stack([points.min(axis=0), points.max(axis=0)])
        for points in ((n[..., :3] / n[..., 3:]).reshape(-1, 3) for n in (before, nets))
    ]
    if (dirty & (lit | air[part])).any() or not np.array_equal(ends[0], ends[1]):
        return True
    near = NEAR * float(np.linalg.norm(ends[1][1] - ends[1][0]))
    places = [np.append(camera.eye, 0.0) for camera in scene.cameras]
    places += [np.append(point, 0.0) for grid in scene.sensors for point in grid.points]
    spheres = np.concatenate([np.reshape(places, (-1, 4)), bounding_spheres(nets[lit])])
    balls = balls_about(before, nets, dirty, part)[2]
    away = np.linalg.norm(spheres[:, None, :3] - balls[None, :, :3], axis=2)
    return bool((away < spheres[:, None, 3] + balls[None, :, 3] + near).any())
