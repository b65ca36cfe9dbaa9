"""The simulation of a frozen scene whose surfaces neither reflect nor emit light.

All light comes straight from sky, sun and ground. Sensors get what they see of these, and so do
elements, at their nodes; nothing is exchanged between surfaces, so that no form factors, no solve
and no iterated gather are needed. What the nodes of an element make of its mean is not known by a
gather on its halves then: it is judged by how far the nodes differ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .incident import Gathered, Light
from .iterated import LEAST
from .ledger import make_balance
from .model.arrays import FloatArray
from .model.result import Balance, Result, luminous
from .moved_elements import kept_elements
from .sensor_results import sensor_result
from .simulation import Simulation
from .skipped import FOR_REFLECTED, NOTHING_REFLECTS
from .surfaces import Receivers, Surfaces
from .unknowns import Unknowns

#: Error of the mean over an element by its nodes against how the light at them differs, root mean
#: square: in rooms with a window or an opening in the roof 0.08 at most where elements are as large
#: as they get, and less on smaller ones.
OF_NODES = 0.1
#: The same of the sun's light: on curved elements that turn away from it it ends with a kink.
OF_SUN = 0.2


class UnreflectedSimulation(Simulation):
    """One run in which all light comes straight from outside; see `skipped.reflects_nothing`."""

    def run(self) -> Result:
        stages = self.stages
        solver, kept = self.start()
        stages.skipped.update(dict.fromkeys(FOR_REFLECTED, NOTHING_REFLECTS))
        with stages.run("elements"):
            boxes = solver.mesher.unrefined(self.budget)
            elements = kept_elements(kept, solver.mesher, self.budget, boxes)
            surfaces = Surfaces.of(self.scene, elements, solver.bands)
            unknowns = Unknowns.at_nodes(elements)
        found, by_means = solver.outside_on(elements, unknowns, self.budget)
        arriving = self._gathered(found)
        sensors = {}
        for k, grid in enumerate(self.scene.sensors):
            light = self._gathered(solver.outside(Receivers.of_sensors(grid), self.budget))
            rules = solver.rules_from_outside(light, np.zeros(len(grid)), self.budget)
            sensors[grid.name] = sensor_result(self.scene, k, light, rules)
        kept.tell()
        self._count(elements, len(unknowns))
        balance = self._balance(surfaces, unknowns, arriving)
        converged = self._judged(sensors, arriving.luminous(), balance)
        mean = unknowns.mean
        nothing = np.zeros((len(elements), solver.bands))
        light = Gathered(
            {name: mean(values) for name, values in arriving.components.items()},
            np.sqrt(unknowns.mean_variance(arriving.deviation**2)),
        )
        return Result(
            scene=self.scene,
            elements=elements,
            components=light.components,
            exitance=nothing,
            element_error_lx=self._element_error(
                light, np.zeros(len(elements)), self._of_nodes(unknowns, arriving, by_means)
            ),
            sensors=sensors,
            images={},
            balance=balance,
            row_sums=np.full(len(elements), np.nan),
            stages=stages.seconds,
            skipped=stages.skipped,
            counters=stages.counters,
            settings=self._settings(solver),
            warnings=tuple(stages.warnings),
            converged=converged,
        )

    def _gathered(self, light: Light) -> Gathered:
        """``light`` by component; nothing of it is indirect."""
        none = {group: np.zeros_like(direct) for group, direct in light.direct.items()}
        return Gathered.of(light, none, np.zeros(len(light.variance)))

    def _balance(self, surfaces: Surfaces, unknowns: Unknowns, arriving: Gathered) -> Balance:
        """All that enters is absorbed where it falls."""
        of, count = unknowns.element, len(unknowns)
        nothing = np.zeros((count, surfaces.reflectance.shape[1]))
        found = np.asarray(sum(arriving.components.values(), nothing))
        return make_balance(
            self.scene,
            unknowns.areas,
            np.zeros(count),
            nothing,
            nothing,
            nothing,
            found,
            found,
            surfaces.material[of],
            surfaces.lamp[of],
            np.zeros(count),
        )

    def _of_nodes(
        self, unknowns: Unknowns, arriving: Gathered, by_means: NDArray[np.bool_]
    ) -> FloatArray:
        """Error (n,) of means over elements told by their nodes. [lx]

        Where the edge of a sun patch crosses an element, its unknowns have means of the sun's light
        (``by_means``), with errors of their own. Of a single node it is not known how light varies:
        as little as is taken elsewhere.
        """
        parts, of = dict(arriving.components), unknowns.element
        sun = luminous(parts.pop("sun.direct", np.zeros((len(of), 1))))
        smooth = Gathered(parts, arriving.deviation).luminous()
        crossed = np.bincount(of, by_means, unknowns.elements) > 0
        single = np.bincount(of, minlength=unknowns.elements) == 1
        out = np.zeros(unknowns.elements)
        for lux, share in ((smooth, OF_NODES), (np.where(crossed[of], 0.0, sun), OF_SUN)):
            mean = unknowns.mean(lux)
            spread = np.sqrt(np.maximum(unknowns.mean(lux**2) - mean**2, 0.0))
            out += share * np.where(single, LEAST * mean, spread)
        return out
