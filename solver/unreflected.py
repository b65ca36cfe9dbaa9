"""The simulation of a frozen scene whose surfaces neither reflect nor emit light.

All light comes straight from sky, sun and ground. Sensors get what they see of these, and so do
elements, at their nodes; nothing is exchanged between surfaces, so that no form factors, no solve
and no iterated gather are needed. What the nodes of an element make of its mean is judged by how
far they differ; where that matters for what all elements get, halves of them are looked at.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .field import FieldSolver
from .incident import Gathered, Light
from .iterated import LEAST
from .ledger import make_balance
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.result import Balance, Result, luminous
from .moved_elements import kept_elements
from .sensor_results import sensor_result
from .simulation import NOTHING, Simulation
from .skipped import FOR_REFLECTED, NOTHING_REFLECTS
from .surfaces import Receivers, Surfaces
from .topology import normal_cones
from .unknowns import Unknowns

#: Error of the mean over an element by its nodes against how the light at them differs, root mean
#: square: in rooms with a window or an opening in the roof 0.08 at most where elements are as large
#: as they get, and less on smaller ones.
OF_NODES = 0.1
#: The same of the sun's light: on curved elements that turn away from it it ends with a kink; 0.31
#: at most on a ball.
OF_SUN = 0.35
#: What this may be off by of all that elements get, against the accuracy, without a look at halves.
LEFT = 0.01


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
        unknowns, arriving, of_nodes = self._on_elements(solver, elements)
        sensors = {}
        least = NOTHING * float(arriving.luminous().max())
        for k, grid in enumerate(self.scene.sensors):
            light = self._gathered(solver.outside(Receivers.of_sensors(grid), self.budget))
            rules = solver.rules_from_outside(light, np.zeros(len(grid)), self.budget)
            sensors[grid.name] = sensor_result(self.scene, k, light, rules, least=least)
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
        return self._result(
            solver,
            converged=converged,
            elements=elements,
            components=light.components,
            exitance=nothing,
            element_error_lx=self._element_error(light, np.zeros(len(elements)), of_nodes),
            sensors=sensors,
            images={},
            balance=balance,
            row_sums=np.full(len(elements), np.nan),
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

    def _on_elements(
        self, solver: FieldSolver, elements: Elements
    ) -> tuple[Unknowns, Gathered, FloatArray]:
        """Light at the nodes of the elements or of their halves, and its error (n,) for them. [lx]

        Of halves it is what they change, but a quarter of what would be said without them at least.
        """
        coarse = Unknowns.at_nodes(elements)
        light, by_means = solver.outside_on(elements, coarse, self.budget)
        arriving = self._gathered(light)
        error = _of_nodes(coarse, arriving, by_means & _flat(elements)[coarse.element])
        mean, areas = coarse.mean(arriving.luminous()), coarse.sums(coarse.areas)
        chosen = _worth_halving(error * areas, float(mean @ areas) * LEFT * self.budget.accuracy)
        chosen = chosen[coarse.can_halve(elements)[chosen]]
        if not len(chosen):
            return coarse, arriving, error
        fine = coarse.halved(elements, np.sort(chosen))
        new, kept = np.isin(fine.element, chosen), ~np.isin(coarse.element, chosen)
        light, _ = solver.outside_on(elements, fine.take(np.flatnonzero(new)), self.budget)
        found = self._gathered(light)
        both = Gathered(
            {
                name: _merged(new, values[kept], found.components[name])
                for name, values in arriving.components.items()
            },
            _merged(new, arriving.deviation[kept], found.deviation),
        )
        change = np.abs(fine.mean(both.luminous()) - mean)
        error[chosen] = np.maximum(0.25 * error, change)[chosen]
        return fine, both, error


def _merged(new: NDArray[np.bool_], kept: FloatArray, found: FloatArray) -> FloatArray:
    """Values (N, ...) of which those at ``new`` (N,) are ``found``, the others ``kept``."""
    out = np.empty((len(new), *kept.shape[1:]))
    out[new], out[~new] = found, kept
    return out


def _worth_halving(errors: FloatArray, allowed: float) -> IntArray:
    """Elements of the largest ``errors`` (n,), without which all others add up to ``allowed``."""
    order = np.argsort(errors, kind="stable")
    return order[np.cumsum(errors[order]) > allowed]


def _flat(elements: Elements) -> NDArray[np.bool_]:
    """Which elements (n,) have one normal."""
    return normal_cones(elements.nets)[:, 3] == 0.0


def _of_nodes(unknowns: Unknowns, arriving: Gathered, by_means: NDArray[np.bool_]) -> FloatArray:
    """Error (n,) of means over elements told by their nodes. [lx]

    Where the edge of a sun patch crosses a flat element, its unknowns have means of the sun's light
    (``by_means``), with errors of their own. Of a single node it is not known how light varies: as
    little as is taken elsewhere.
    """
    parts, of = dict(arriving.components), unknowns.element
    sun = luminous(parts.pop("sun.direct", np.zeros((len(of), 1))))
    smooth = Gathered(parts, arriving.deviation).luminous()
    crossed = np.bincount(of, by_means, unknowns.elements) > 0
    single = np.bincount(of, minlength=unknowns.elements) == 1
    out = np.zeros(unknowns.elements)
    for lux, share in ((smooth, OF_NODES), (np.where(crossed[of], 0.0, sun), OF_SUN)):
        out += share * np.where(single, LEAST * unknowns.mean(lux), unknowns.spread(lux))
    return out
