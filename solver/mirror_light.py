"""Direct light by way of mirrors, by light group."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .dome_jobs import DomeJob, dome_jobs
from .exchange import Rows, products
from .kernels.pyramid import Blockers
from .light_colors import lamp_color
from .mirrors import Mirrors, Reflections
from .model.arrays import FloatArray
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import Sky
from .reuse import Kept
from .row_finder import Ask
from .surfaces import Surfaces
from .web_field import WebField


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
    webs : WebField
        Its lamps with webs.
    bands : int
        Bands of light.
    trace : bool
        Whether anything can hide anything.
    kept : Kept
        What runs before this one have found, and the stages: times, counters and warnings.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        webs: WebField,
        bands: int,
        *,
        trace: bool,
        kept: Kept,
    ) -> None:
        super().__init__(scene, blockers, trace=trace, stages=kept.stages)
        self.webs, self.bands, self._kept = webs, bands, kept

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
    ) -> Reflections | None:
        """Add lamps, sky, sun and ground in mirrors to ``light``; returns what else they show.

        Parameters
        ----------
        light : Direct
            Changed in place; every group that may be seen is there. [lx]
        rows : Rows
            Form factors of m receivers, without mirrors.
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
            return None
        with self.stages.run(stage or "mirrors"):
            jobs = dome_jobs(self.scene, asked.budget, self.bands) if sees_out else []
            for job in jobs:
                # Elements, of which there are many, see sky and ground along rays, and so does all
                # that sees them through panes.
                if (fine and not self.panes) or job.name == "sun":
                    found, variance = self._dome(job, rows, surfaces, asked)
                    light.direct[job.name] = light.direct[job.name] + found[:, None] * job.color
                    light.variance += variance
            self._add_webs(light, rows, surfaces, asked, fine)
            self._add_uneven(light, rows, surfaces, asked, fine)
            seen = self._reflect(rows, surfaces, asked, fine)
            emitted, lamp = surfaces.emitted[seen.emits], surfaces.lamp[seen.emits]
            for group in dict.fromkeys(one.group for one in self.scene.luminaires):
                rows_of = [k for k, one in enumerate(self.scene.luminaires) if one.group == group]
                own = np.where(np.isin(lamp, rows_of)[:, None], emitted, 0.0)
                light.direct[group] = light.direct[group] + products(seen.lamps, own)
            emitted = luminous(emitted)
            light.variance += products(seen.lamp_variances, emitted**2)
            for job in jobs:
                if job.name != "sun":
                    found, variance = seen.away[job.name]
                    level = np.pi * (1.0 if isinstance(job.luminance, Sky) else job.luminance)
                    light.direct[job.name] = (
                        light.direct[job.name] + level * found[:, None] * job.color
                    )
                    light.variance += level**2 * variance
        return seen

    def _dome(
        self, job: DomeJob, rows: Rows, surfaces: Surfaces, asked: Ask
    ) -> tuple[FloatArray, FloatArray]:
        """Light of the sun, the sky or the ground in flat mirrors; see `Mirrors.dome`."""
        sun = self.scene.sun if job.name == "sun" else None

        def find() -> tuple[FloatArray, FloatArray]:
            return self.dome(
                rows,
                asked.receivers,
                surfaces,
                job.cells,
                job.luminance,
                sun=sun,
                # Edges of parts of the sun's disc cancel to little of themselves.
                eps=1e-9 if job.name == "sun" else asked.budget.eps,
                cell_eps=job.cell_eps,
            )

        of = (job.name, job.cells, job.luminance, job.cell_eps, sun, self.shares)
        return self._kept.of_rows("mirrored dome", rows, of, find)

    def _reflect(self, rows: Rows, surfaces: Surfaces, asked: Ask, fine: bool) -> Reflections:
        """What is seen in mirrors, which depends on no paint and on which lamps are alike."""
        emits = np.flatnonzero(surfaces.emitted.any(axis=1))
        light = np.concatenate([surfaces.emitted, surfaces.lamp[:, None]], axis=1)[emits]
        _, first, alike = np.unique(light, axis=0, return_index=True, return_inverse=True)
        alike = first[alike.reshape(-1)]
        sky = self.scene.sky
        kinds = surfaces.web[emits], surfaces.uneven[emits]
        of = (self.shares, emits, alike, *kinds, sky, fine)
        return self._kept.of_rows(
            "mirrors", rows, of, lambda: self.reflect(rows, surfaces, asked, fine=fine)
        )

    def _add_webs(
        self, light: Direct, rows: Rows, surfaces: Surfaces, asked: Ask, fine: bool
    ) -> None:
        """Add lamps with webs: seen from the image, their light takes its true direction."""
        for lamp in self.webs.lamps(asked.budget.accuracy):
            own = np.flatnonzero(surfaces.lamp == lamp.row)
            color = lamp_color(lamp.luminaire, self.bands)
            group = lamp.luminaire.group
            for window in self.windows:
                seen = self.through(window, rows, surfaces, asked, own, fine)
                if seen is None:
                    continue
                plain, _ = self.factors(window, seen.images, seen.parts, asked, fine, hiding=False)
                shown = seen.factors > 0.0
                views = lamp.views(seen.images, seen.parts, shown, plain, coarse=not fine)
                found = views.light(lamp.luminaire.flux_lm, seen.factors, seen.variances, plain)
                added = np.zeros_like(light.direct[group])
                added[seen.looking] = window.share * found.illuminance[:, None] * color
                light.direct[group] = light.direct[group] + added
                light.variance[seen.looking] += window.share**2 * found.variance

    def _add_uneven(
        self, light: Direct, rows: Rows, surfaces: Surfaces, asked: Ask, fine: bool
    ) -> None:
        """Add lamps whose exitance varies over them."""
        emission = surfaces.emission
        if emission is None:
            return
        from .uneven_images import light_through

        groups = np.array([self.scene.luminaires[row].group for row in emission.lamp])
        for group in dict.fromkeys(groups.tolist()):
            own = emission.element[groups == group]
            for window in self.windows:
                seen = self.through(window, rows, surfaces, asked, own, fine)
                if seen is None:
                    continue
                plain, _ = self.factors(window, seen.images, seen.parts, asked, fine, hiding=False)
                found, variance = light_through(
                    self.scene, emission, window, seen, plain, asked.budget
                )
                added = np.zeros_like(light.direct[group])
                added[seen.looking] = window.share * found
                light.direct[group] = light.direct[group] + added
                light.variance[seen.looking] += window.share**2 * variance
