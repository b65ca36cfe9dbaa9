"""What is placed where it makes no sense, as far as a run before this one has not asked already."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .containment import Containment
from .model.arrays import FloatArray
from .model.scene import SceneData
from .moved import moved_patches, places_of
from .placement import check_placement
from .reuse import Kept
from .topology import bounding_spheres

#: Distance from what has moved in which nothing is taken to be as it was, against the scene's size.
NEAR = 1e-4


def placement_remarks(scene: SceneData, tester: Containment, kept: Kept) -> tuple[str, ...]:
    """As `check_placement`: nothing is asked twice of the same scene, whatever its lamps' flux.

    Where nothing was wrong, and parts have moved that come near no lamp, only cameras and sensors
    are asked about that these may hold.
    """
    lamps = [(lamp.part, lamp.area_m2) for lamp in scene.luminaires]
    flux = [lamp.flux_lm for lamp in scene.luminaires]
    at = (scene.luminaire_index, lamps, scene.cameras, scene.sensors)

    def find() -> tuple[str, ...]:
        before = kept.of_parts("placement", at)
        same = before is not None and not _may_differ(scene, tester, before)
        return () if same else check_placement(scene, tester)

    lines, told = kept.find("placement", at, lambda: (find(), flux))
    if not lines:
        kept.keep_of_parts("placement", at, scene.patches.control_points)
    return lines if not lines or told == flux else check_placement(scene, tester)


def _may_differ(scene: SceneData, tester: Containment, before: FloatArray) -> bool:
    """Whether parts that have moved may come to lamps, or hold a camera or sensor.

    Control nets were ``before`` (p, 4, 4, 4).
    """
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
    places = places_of(before, nets, dirty, part)
    # What lies in a part may be far from all of its patches.
    lamps = bounding_spheres(np.ascontiguousarray(nets[lit]))
    if _near(lamps[:, :3], lamps[:, 3], places.parts, near).any():
        return True
    points = np.concatenate(
        [np.empty((0, 3)), *(grid.points for grid in scene.sensors)]
        + [np.array([camera.eye]) for camera in scene.cameras]
    )
    held = _near(points, np.zeros(len(points)), places.parts, near)
    # What has not moved holds no more of them than before.
    moved = np.isin(part, part[dirty])
    return bool(held.any()) and tester.any_in(points[held], moved)


def _near(
    points: FloatArray, radii: FloatArray, balls: FloatArray, near: float
) -> NDArray[np.bool_]:
    """Which spheres about points (n, 3) come closer to any ball of (b, 4) than ``near``. [m]"""
    away = np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2)
    return np.asarray((away < radii[:, None] + balls[None, :, 3] + near).any(axis=1))
