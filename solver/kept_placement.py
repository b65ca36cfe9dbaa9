"""What is placed where it makes no sense, as far as a run before this one has not asked already."""

from __future__ import annotations

from dataclasses import replace

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

    Where nothing was wrong, and parts have moved that neither are lamps nor come near any, lamps
    are not asked about at all.
    """
    lamps = [(lamp.part, lamp.area_m2) for lamp in scene.luminaires]
    flux = [lamp.flux_lm for lamp in scene.luminaires]
    at = (scene.luminaire_index, lamps, scene.cameras, scene.sensors)

    def find() -> tuple[str, ...]:
        before = kept.of_parts("placement", at)
        if before is None or _lamps_may_differ(scene, before):
            return check_placement(scene, tester)
        dark = np.full_like(scene.luminaire_index, -1)
        return check_placement(replace(scene, luminaires=(), luminaire_index=dark), tester)

    lines, told = kept.find("placement", at, lambda: (find(), flux))
    if not lines:
        kept.keep_of_parts("placement", at, scene.patches.control_points)
    return lines if not lines or told == flux else check_placement(scene, tester)


def _lamps_may_differ(scene: SceneData, before: FloatArray) -> bool:
    """Whether moved parts may come to lamps, control nets having been ``before`` (p, 4, 4, 4)."""
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
    spheres = bounding_spheres(np.ascontiguousarray(nets[lit]))
    balls = balls_about(before, nets, dirty, part)[2]
    away = np.linalg.norm(spheres[:, None, :3] - balls[None, :, :3], axis=2)
    return bool((away < spheres[:, None, 3] + balls[None, :, 3] + near).any())
