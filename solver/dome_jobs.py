"""What shines from infinity on one scene: sky, sun and ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .budget import Budget
from .dome import dome_cells, sun_cells
from .light_colors import LightColors
from .model.arrays import FloatArray
from .model.scene import SceneData
from .model.sky import Sky
from .skies import ground_luminance, sun_luminance


class DomeJob(NamedTuple):
    """One light group from infinity.

    Attributes
    ----------
    name : str
        ``"sky"``, ``"sun"`` or ``"ground"``.
    cells : (c, 4, 4, 4) array
        Where it is.
    luminance : Sky or float
        Its luminance. [cd/m²]
    cell_eps : float
        Form factor below which partly hidden cells are sampled.
    color : (b,) array
        Of luminance 1.
    """

    name: str
    cells: FloatArray
    luminance: Sky | float
    cell_eps: float
    color: FloatArray


def dome_jobs(scene: SceneData, budget: Budget, bands: int) -> list[DomeJob]:
    """What there is of sky, sun and ground, in this order."""
    color = LightColors(scene, bands)
    eps, sky, sun, jobs = budget.sensor_dome_cell_eps, scene.sky, scene.sun, []
    if sky is not None:
        jobs.append(DomeJob("sky", dome_cells(0.0, 90.0), sky, eps, color.sky))
    if sun is not None:
        disc = np.sin(np.radians(sun.angular_radius_arcmin / 60.0)) ** 2
        small = budget.sun_cell_eps * disc
        jobs.append(DomeJob("sun", sun_cells(sun), sun_luminance(sun), small, color.sun))
    level = ground_luminance(scene.ground, sky, sun)
    if level > 0.0:
        jobs.append(DomeJob("ground", dome_cells(-90.0, 0.0), level, eps, color.ground))
    return jobs
