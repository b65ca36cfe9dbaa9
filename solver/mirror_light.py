"""Direct light by way of mirrors, by light group."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .dome_jobs import dome_jobs
from .exchange import Rows, products
from .kernels.pyramid import Blockers
from .mirrors import Mirrors
from .model.arrays import FloatArray
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import CIESky
from .row_finder import Ask
from .stages import Stages
from .surfaces import Surfaces


class Direct(Protocol):
    """Direct light that is added to: by group (m, b), and the variance (m,) of what is sampled."""

    direct: dict[str, FloatArray]
    variance: FloatArray


class MirrorLight(Mirrors):
    """The mirrors of one scene, and the light they give.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches as obstacles.
    bands : int
        Bands of light.
    stages : Stages
        Receives times, counters and warnings.
    """

    def __init__(self, scene: SceneData, blockers: Blockers, bands: int, stages: Stages) -> None:
        super().__init__(scene, blockers, stages)
        self.bands = bands

    def add(
        self,
        light: Direct,
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        sees_out: bool,
        *,
        fine: bool = False,
        stage: str | None = None,
    ) -> None:
        """Add what mirrors show: lamps, sky, sun and ground to ``light``, elements to ``rows``.

        Parameters
        ----------
        light : Direct
            Changed in place; every group that may be seen is there. [lx]
        rows : Rows
            Form factors of m receivers, without mirrors; changed in place.
        surfaces : Surfaces
            The elements they go to.
        asked : Ask
            What the rows were asked for.
        sees_out : bool
            Whether light can leave the scene.
        fine : bool
            Whether the receivers are sensors, which nothing averages.
        stage : str, optional
            Stage that the time is counted to; one of its own when not given.
        """
        if not self.any:
            return
        with self.stages.run(stage or "mirrors"):
            jobs = dome_jobs(self.scene, asked.budget, self.bands) if sees_out else []
            for job in jobs:
                # Elements, of which there are many, see sky and ground along rays.
                if fine or job.name == "sun":
                    found, variance = self.dome(
                        rows,
                        asked.receivers,
                        surfaces,
                        job.cells,
                        job.luminance,
                        sun=self.scene.sun if job.name == "sun" else None,
                        # Edges of parts of the sun's disc cancel to little of themselves.
                        eps=1e-9 if job.name == "sun" else asked.budget.eps,
                        cell_eps=job.cell_eps,
                    )
                    light.direct[job.name] = light.direct[job.name] + found[:, None] * job.color
                    light.variance += variance
            seen = self.reflect(rows, surfaces, asked, fine=fine)
            for group in dict.fromkeys(lamp.group for lamp in self.scene.luminaires):
                emitted = surfaces.emitted_by(self.scene, group)[seen.emits]
                light.direct[group] = light.direct[group] + products(seen.lamps, emitted)
            emitted = luminous(surfaces.diffuse)[seen.emits]
            light.variance += products(seen.lamp_variances, emitted**2)
            for job in jobs:
                if job.name != "sun":
                    found, variance = seen.away[job.name]
                    level = np.pi * (1.0 if isinstance(job.luminance, CIESky) else job.luminance)
                    light.direct[job.name] = (
                        light.direct[job.name] + level * found[:, None] * job.color
                    )
                    light.variance += level**2 * variance
