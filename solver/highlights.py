"""The second pass in a simulation: for sensors and pictures, where anything is glossy."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .budget import Budget
from .exchange import Rows
from .glossy_sensors import SensorLobes
from .mirrors import Mirrors
from .model.arrays import FloatArray
from .model.scene import SceneData
from .model.views import Sensors
from .second_pass import GlossySides, SecondPass
from .stages import Stages
from .surfaces import Surfaces
from .web_field import WebField

if TYPE_CHECKING:
    from .incident import Gathered
    from .iterated import Finer
    from .solved_field import Field


class Highlights:
    """Glossy surfaces of one scene.

    Parameters
    ----------
    scene : SceneData
        The scene.
    mirrors : Mirrors
        Its mirrors.
    webs : WebField
        Its lamps with webs.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives times, counters and reasons.
    """

    def __init__(
        self, scene: SceneData, mirrors: Mirrors, webs: WebField, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.mirrors, self.webs = scene, mirrors, webs
        self.trace, self.stages = trace, stages
        #: Whether the lobe keeps the balance of energy, or is that of 1993.
        self.conserving = True
        self.any = GlossySides(scene, 3).any
        if not self.any:
            stages.skipped["second pass"] = "nothing is glossy"

    def second_pass(self, surfaces: Surfaces, finer: Finer, budget: Budget) -> SecondPass:
        """Light in lobes, with the solution as it is."""
        return SecondPass(
            self.scene,
            surfaces,
            {group: finer.unknowns.mean(sent) for group, sent in finer.sent.items()},
            mirrors=self.mirrors.shares,
            webs=self.webs.lamps(budget.accuracy),
            trace=self.trace,
            conserving=self.conserving,
        )

    def for_pictures(self, surfaces: Surfaces, finer: Finer, budget: Budget) -> SecondPass | None:
        """The same, or nothing where nothing is glossy."""
        lit = self.any and bool(finer.sent)
        return self.second_pass(surfaces, finer, budget) if lit else None

    def _seen(self, rows: Rows, surfaces: Surfaces) -> FloatArray:
        """Form factors (m, k) of glossy elements."""
        where = (surfaces.elements.patch_index, surfaces.elements.side)
        sides = GlossySides(self.scene, surfaces.reflectance.shape[1])
        return np.asarray(rows.factors[:, sides.specular[where].any(axis=1)], dtype=np.float64)

    def added(
        self,
        gathered: Gathered,
        grid: Sensors,
        rows: Rows,
        field: Field,
        finer: Finer,
        budget: Budget,
    ) -> Gathered:
        """Light at sensors, with glossy surfaces that they see sending it by the lobe."""
        if not self.any or not finer.sent:
            return gathered
        with self.stages.run("second pass"):
            lobes = SensorLobes(self.second_pass(field.surfaces, finer, budget), finer, budget)
            change, variance, count = lobes.change(grid, self._seen(rows, field.surfaces), gathered)
        self.stages.count({"glossy_points": count})
        parts = dict(gathered.components)
        for k, group in enumerate(lobes.second.groups):
            parts[f"{group}.indirect"] = parts[f"{group}.indirect"] + change[:, k]
        return replace(
            gathered, components=parts, deviation=np.sqrt(gathered.deviation**2 + variance)
        )
