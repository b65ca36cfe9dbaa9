"""What was found at the sensors of a grid."""

from __future__ import annotations

import numpy as np

from .incident import Gathered
from .model.arrays import FloatArray
from .model.result import SensorResult, luminous
from .model.scene import SceneData
from .skies import horizontal_illuminance


def sensor_result(
    scene: SceneData, index: int, gathered: Gathered, more: FloatArray
) -> SensorResult:
    """Light at the sensors of a grid; ``more`` (m,) is all error but that of samples. [lx]"""
    grid = scene.sensors[index]
    components = {name: luminous(v) for name, v in gathered.components.items()}
    return SensorResult(
        name=grid.name,
        points=grid.points,
        normals=grid.normals,
        area_m2=grid.area_m2,
        illuminance_lx=gathered.luminous(),
        error_lx=more + 2.0 * gathered.deviation,
        components=components,
        daylight_factor=_daylight_factor(scene, components),
        outline=grid.outline,
    )


def _daylight_factor(scene: SceneData, components: dict[str, FloatArray]) -> FloatArray | None:
    """Share (m,) of the unobstructed sky's horizontal illuminance, under type 1 or 16 only.

    None under a sky without light.
    """
    sky = scene.sky
    if sky is None or not sky.of_daylight_factors or scene.sun is not None:
        return None
    unobstructed = horizontal_illuminance(sky)
    if unobstructed <= 0.0:
        return None
    daylight = [
        values for name, values in components.items() if name.rsplit(".", 1)[0] in ("sky", "ground")
    ]
    return np.asarray(sum(daylight) / unobstructed)
