"""The simulation of a frozen scene, stage by stage; stages a scene does not need are skipped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .budget import BASES, Budget, by_factors_alone, most_varying, scene_bytes
from .change_bounds import Worth
from .containment import Containment
from .daylight import with_daylight_factors
from .duration import duration
from .effort import check_effort
from .errors import GeometryError, InputError
from .exchange import ROUNDING
from .field import FieldSolver
from .field_balance import balance_of
from .incident import Gathered
from .iterated import Finer
from .kept_error import KeptError, kept_error
from .kept_mesh import Mesh
from .kept_placement import placement_remarks
from .ledger import ledger_warning
from .memory import check_memory, fits, has_room, varying_bytes
from .mesh import Boxes
from .mesh_error import MeshError, doubt_on
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.reached import accuracies_reached, accuracy_message
from .model.result import Balance, Result, SensorResult
from .model.scene import SceneData
from .moved_blockers import kept_blockers
from .pictures import render_all
from .reuse import Kept, tolerances
from .rule_error import OF_RULES
from .sensor_results import sensor_result, tells_daylight_factors
from .skipped import not_needed, reflects_nothing
from .solved_field import Field, SensorRows
from .stages import Progress, Stages
from .store import STORE, Store
from .surfaces import reflectances

#: How often the mesh is cut further where the accuracy asked for is not reached.
REFINEMENTS = 3
#: Of the brightest light on surfaces: what sensors have less of is rounding, as in a shut room.
NOTHING = 2.0**-52
#: Ways to solve a scene.
METHODS = ("default", "nn93")


def estimate_seconds(
    scene: SceneData, accuracy: float = 0.01, basis: str | None = None
) -> tuple[float, float]:
    """From how many seconds to how many `solve` may take; see `duration`. [s]"""
    return duration(scene, Budget.of(scene, accuracy, basis or Simulation.basis))


def solve(
    scene: SceneData,
    *,
    accuracy: float = 0.01,
    visibility: str = "auto",
    method: str = "default",
    basis: str | None = None,
    balanced_mesh: bool = False,
    progress: Progress | None = None,
    threads: int | None = None,
    cache: bool = False,
    beside: str = "",
) -> Result:
    """Solve a frozen scene.

    Parameters
    ----------
    scene : SceneData
        Geometry, materials, light, sensors and cameras.
    accuracy : float
        Relative error of sensor illuminance aimed at; mesh size and tolerances follow from it.
    visibility : {"auto", "none"}
        ``"auto"`` traces pyramids, and meridians for weak pairs; ``"none"`` lets light through
        everything, for comparison.
    method : {"default", "nn93"}
        ``"nn93"`` is the method of Nishita and Nakamae 1993 as published, for comparison: see
        `nn93_simulation`.
    basis : {"bilinear", "biquadratic", "constant"}, optional
        How reflected light varies over elements, where there are not too many of them; bilinearly
        when not given. ``"biquadratic"`` is for much accuracy close to edges.
    balanced_mesh : bool
        Whether the mesh is cut further until no edge of an element has more than two neighbours.
        No value gets better by that; see `balance`.
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    threads : int, optional
        Threads of the kernels; all cores when not given. The numbers do not depend on it.
    cache : bool
        Whether to take what earlier runs of this process found, as far as it holds for this scene,
        and to keep what this one finds; see `reuse`. Balanced and large meshes and the method of
        1993 keep nothing.
    beside : str
        What the run is for, where it is made beside those of the scene itself: what is kept of it
        does not take the place of what is kept of theirs.

    Returns
    -------
    Result
        Illuminance of elements and sensors by light group, direct and indirect, with errors.

    Raises
    ------
    InputError
        For options out of range.
    GeometryError
        If there is no surface, or a patch without area.
    NumericsError
        If a closed scene absorbs nothing, so that no balance exists.
    OutOfMemoryError
        If the form factors of the elements would not fit into the memory that is free.
    """
    check_effort(accuracy, threads)
    if visibility not in ("auto", "none"):
        raise InputError(f"visibility = {visibility!r}: auto or none")
    if method not in METHODS:
        raise InputError(f"method = {method!r}: {' or '.join(METHODS)}")
    if basis is not None and basis not in BASES:
        raise InputError(f"basis = {basis!r}: {', '.join(BASES)}")
    if not isinstance(balanced_mesh, bool):
        raise InputError(f"balanced_mesh = {balanced_mesh!r}: True or False")
    if len(scene.patches) == 0:
        raise GeometryError("the scene has no surfaces")
    if scene.opaque_count == 0:
        raise GeometryError("the scene has no surfaces but panes of glass")
    with with_threads(threads):
        options = Options(basis=basis, balanced=balanced_mesh, cache=cache)
        if scene.daylight_factors is not None and not cache:
            # The second run is to find what the first one knows, and both to leave nothing.
            options = replace(options, cache=True, store=Store())

        def run(one: SceneData, beside: str = beside) -> Result:
            how = replace(options, beside=beside)
            return kind_of(one, method)(one, accuracy, visibility, Stages(progress), how).run()

        return with_daylight_factors(run(scene), run)


def kind_of(scene: SceneData, method: str) -> type[Simulation]:
    """How a scene is solved by a method."""
    if method == "nn93":
        from .nn93_simulation import Nn93Simulation

        return Nn93Simulation
    if reflects_nothing(scene):
        from .unreflected import UnreflectedSimulation

        return UnreflectedSimulation
    return Simulation


@contextmanager
def with_threads(threads: int | None) -> Iterator[None]:
    """Threads of the kernels meanwhile; with None they stay as they are."""
    from .kernels.threads import set_threads

    previous = None if threads is None else set_threads(threads)
    try:
        yield
    finally:
        if previous is not None:
            set_threads(previous)


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """A mesh, what was found on it, and the sensors with and without the error of the mesh.

    Of the last ones also what they see, a grid each.
    """

    field: Field
    finer: Finer
    balance: Balance
    error: MeshError
    kept: KeptError
    sensors: dict[str, SensorResult]
    without_mesh: dict[str, SensorResult]
    seen: tuple[SensorRows, ...] = ()


@dataclass(frozen=True, slots=True)
class Options:
    """What may be chosen besides accuracy and visibility; see `solve`."""

    basis: str | None = None
    balanced: bool = False
    cache: bool = False
    #: Where what is found is kept; what all runs of the process share when not given.
    store: Store | None = None
    #: What the run is for, where it is made beside those of the scene itself; see `reuse.Kept`.
    beside: str = ""
    #: Means of grids that are brighter in another state of the scene, by name; see
    #: `accuracies_reached`. [lx]
    brightest: Mapping[str, float] = field(default_factory=dict)


class Simulation:
    """One run; each method is a stage."""

    #: How the scene is solved, and how light varies over elements.
    method, basis = "default", "bilinear"

    def __init__(
        self,
        scene: SceneData,
        accuracy: float,
        visibility: str,
        stages: Stages,
        options: Options,
    ) -> None:
        if visibility == "none":
            scene = scene.without_panes  # like all else, they keep nothing back
        self.balance = options.balanced
        self._beside, self._brightest = options.beside, options.brightest
        self._own_mesh: tuple[Boxes, float] | None = None
        self.scene, self.stages, self.visibility = scene, stages, visibility
        self.basis = options.basis or self.basis
        self.budget = Budget.of(scene, accuracy, self.basis)
        self.largest_grid = max((len(grid) for grid in scene.sensors), default=0)
        sides = len(scene.patches) + int(np.sum(scene.two_sided))
        #: What mirrors and panes take besides, a pair. [B]
        self.more = scene_bytes(scene)
        self._shared = STORE if options.store is None else options.store
        if len(self._shared) and not self._is_roomy():
            self._shared.clear()  # what is kept may be found again
            self.budget = Budget.of(scene, accuracy, self.basis)
        large = self.budget.is_large
        # What decided on a mesh is known for its boxes before balancing only; rows of large meshes
        # take more than they are worth.
        kept = options.cache and not options.balanced and not large
        self.store = self._shared if kept else None
        if options.cache and not kept:
            why = "the mesh is balanced" if options.balanced else "the mesh is large"
            stages.skipped["reuse"] = f"{why}: nothing is kept for later runs"
        check_memory(
            self.budget.unknowns if large else self.budget.elements,
            self.largest_grid,
            least_elements=sides,
            accuracy=accuracy,
            more=self.more,
        )

    def _is_roomy(self) -> bool:
        """Whether memory sets no bound to the mesh that is asked for."""
        budget = self.budget
        varying = (
            self.basis == "constant"
            or budget.basis != "constant"
            or self._scatters
            or budget.elements > most_varying(self.basis)
        )
        return varying and fits(budget.elements, self.largest_grid, self.more)

    @property
    def _scatters(self) -> bool:
        """Whether panes diffuse light: they are known by whole elements."""
        return any(glazing.glass.diffuse > 0.0 for glazing in self.scene.glazings)

    def start(self) -> tuple[FieldSolver, Kept]:
        """What solves the scene, before any of it is solved."""
        scene, stages = self.scene, self.stages
        with stages.run("geometry"):
            kept = Kept(scene, stages=stages, store=self.store, beside=self._beside)
            opaque = scene.without_panes
            solids = opaque.patches, opaque.closed, opaque.patches.part_index
            blockers = kept_blockers(kept, *solids, ~np.asarray(opaque.two_sided))
            tester = Containment(scene, blockers)
            stages.warnings.extend(placement_remarks(scene, tester, kept))
        stages.skipped.update(not_needed(scene, blockers, self.visibility))
        told, elements = self.budget.basis, self.budget.elements
        if told != self.basis and elements <= most_varying(self.basis) and not self._scatters:
            stages.warnings.append(
                f"exitance is taken for {told} on every element: the memory that is free does not "
                f"hold more for {elements} elements"
            )
        trace = "visibility" not in stages.skipped
        kept = kept.with_more(trace)
        solver = FieldSolver(scene, blockers, trace=trace, stages=stages, tester=tester, kept=kept)
        solver.mesher.balance = self.balance
        return solver, kept

    def run(self) -> Result:
        solver, kept = self.start()
        solved = self.solved(solver, kept)
        kept.tell()
        field, finer, sensors = solved.field, solved.finer, solved.sensors
        self._count(field.surfaces.elements, len(field.unknowns))
        light = finer.light
        images = render_all(field, finer, solver, self.budget)
        converged = self.judge(solved)
        self._keep_mesh(solver, kept, solved, converged=converged)
        on_elements = solved.error.of(light, doubt_on(field, finer)) + solved.kept.elements
        return self._result(
            solver,
            converged=converged,
            elements=field.surfaces.elements,
            components=light.components,
            exitance=field.surfaces.emitted + finer.reflected,
            element_error_lx=self._element_error(light, solved.finer.sampled, on_elements),
            sensors=sensors,
            images=images,
            balance=solved.balance,
            row_sums=field.row_sums,
        )

    def _result(self, solver: FieldSolver, **found: Any) -> Result:
        """What was ``found``, with what the run did for it."""
        stages = self.stages
        return Result(
            scene=self.scene,
            stages=stages.seconds,
            skipped=stages.skipped,
            counters=stages.counters,
            settings=self._settings(solver),
            warnings=tuple(stages.warnings),
            **found,
        )

    def _settings(self, solver: FieldSolver) -> dict[str, Any]:
        """What `Result.settings` records."""
        return {
            **self.budget.settings,
            **self.stages.figures,
            "visibility": self.visibility,
            "method": self.method,
            "balanced_mesh": self.balance,
            "bands": solver.bands,
        }

    def _count(self, elements: Elements, unknowns: int) -> None:
        counters = self.stages.counters
        counters["unknowns"] = unknowns
        counters["patches"], counters["elements"] = len(self.scene.patches), len(elements)
        counters["nodes"] = int((elements.weights > 0.0).sum())
        counters["buried_nodes"] = int((elements.buried & (elements.weights > 0.0)).sum())

    def solved(self, solver: FieldSolver, kept: Kept) -> Solved:
        """Light on the mesh of a run before this one, if it does, or on one of the scene's own."""
        before, solved = kept.mesh(self.budget), None
        if before is not None:
            with self.stages.run("elements"):
                misplaced = solver.mesher.misplaced_again(before, self.budget)
            good = before.still_good(misplaced, self.budget.misplaced)
            if good and self._fits(len(before.boxes)):
                solver.mesh_before = before
                solved = self._on(solver, before.boxes)
                if before.converged and not self._converged(solved.sensors):
                    solver.mesh_before = solved = None
        self.stages.figures["mesh_of_earlier_run"] = solved is not None
        return self._on_own_mesh(solver, kept) if solved is None else solved

    def _on_own_mesh(self, solver: FieldSolver, kept: Kept) -> Solved:
        """Light on the mesh of the budget, cut further where its error is too large."""
        boxes, misplaced = solver.mesher.boxes(self.budget)
        solved = self._on(solver, boxes)
        for _ in range(REFINEMENTS):
            if self._converged(solved.sensors) or not self._converged(solved.without_mesh):
                break  # it is good enough, or not for the mesh that it is not
            finer = solver.mesher.cut(boxes, solved.finer.residual, self.budget)
            if len(finer) == len(boxes):
                break
            if not self._fits(len(finer)):
                self.stages.warnings.append(
                    f"the mesh was not made finer than {len(boxes)} elements: the memory that is "
                    f"free does not hold {len(finer)}"
                )
                break
            boxes, misplaced = finer, solver.mesher.misplaced(finer, misplaced)
            solved = self._on(solver, boxes)
        self._own_mesh = boxes, misplaced
        return solved

    def _fits(self, elements: int) -> bool:
        enough = self._has_room(elements)
        if not enough and len(self._shared):
            self._shared.clear()
            enough = self._has_room(elements)
        return enough

    def _has_room(self, elements: int) -> bool:
        varying = self.budget.basis != "constant"
        dense = elements <= most_varying(self.budget.basis) if varying else False
        if dense and not has_room(varying_bytes(self.budget.basis, self.more) * elements**2):
            return False
        return fits(elements, self.largest_grid, self.more)

    def _keep_mesh(
        self, solver: FieldSolver, kept: Kept, solved: Solved, *, converged: bool
    ) -> None:
        """Keep what a later run needs to take the same mesh."""
        if self._own_mesh is None or self.store is None:
            return
        boxes, misplaced = self._own_mesh
        field = solved.field
        mesh = Mesh(
            boxes=boxes,
            misplaced=misplaced,
            looked=solver.mesher.looked,
            nets=self.scene.patches.control_points,
            reflectances=reflectances(self.scene),
            lamps=solver.mesher.lamps(self.budget),
            fineness=field.fineness,
            halved=solved.finer.halved,
            converged=converged,
        )
        kept.keep_mesh(self.budget, mesh)

    def _on(self, solver: FieldSolver, boxes: Boxes) -> Solved:
        """Light on one mesh, and at the sensors."""
        kept, of = solver.kept, (tolerances(self.budget), boxes)
        # Bounds of what old rows have wrong are known where all light passes by form factors.
        lit = self.scene.sky is not None or self.scene.sun is not None
        kept.exact = lit or solver.highlights.any or not by_factors_alone(self.scene)
        kept.worth = kept.worth_before(of)
        solved = self._with_rows(solver, boxes)
        light = [one.illuminance_lx for one in solved.sensors.values()]
        # Rather all rows anew than a finer mesh because of those that stayed.
        doubtful = bool(kept.old_rows) and not self._converged(solved.sensors)
        if doubtful or not solved.kept.is_within(self.budget.accuracy, light):
            kept.exact = True
            solved = self._with_rows(solver, boxes)
        self.stages.counters.pop("rows_left", None)
        self.stages.figures.pop("error_of_rows_left_lx", None)
        if kept.old_rows:
            most = max((float(lux.max()) for lux in solved.kept.sensors if len(lux)), default=0.0)
            self.stages.figures["error_of_rows_left_lx"] = most
            left = sum(int(old.which.sum()) for old in kept.old_rows.values())
            self.stages.count({"rows_left": left})
        if self.store is not None:
            kept.keep_worth(of, self._worth(solved))
        return solved

    def _worth(self, solved: Solved) -> Worth:
        """What of the light matters, for a run after this one."""
        field = solved.field
        return Worth.of(
            field.brightest,
            solved.finer.weights,
            field.surfaces.reflectance.max(axis=1),
            field.surfaces.areas,
            {name: one.illuminance_lx for name, one in solved.sensors.items()},
            self.budget.accuracy,
        )

    def _with_rows(self, solver: FieldSolver, boxes: Boxes) -> Solved:
        """The same, old rows being taken as far as `Kept` allows."""
        budget = self.budget
        solver.kept.old_rows.clear()
        field = solver.solve(budget, boxes)
        seen = [solver.seen(grid, budget, field) for grid in self.scene.sensors]
        finer = solver.finer(field, budget, seen)
        balance = balance_of(field, finer, solver, self.budget.accuracy)
        unseen = budget.unseen(finer.unseen)
        error = MeshError.of_finer(finer, abs(balance.residual_fraction), unseen)
        names = [grid.name for grid in self.scene.sensors]
        kept = kept_error(field, finer, solver.kept, dict(zip(names, seen, strict=True)))
        sensors, without_mesh = {}, {}
        is_overcast = tells_daylight_factors(self.scene)
        least = NOTHING * float(finer.light.luminous().max())
        for k, grid in enumerate(self.scene.sensors):
            gathered, doubt, rules = solver.gather(grid, seen[k], field, finer)
            mesh, rest = error.of(gathered, doubt), rules + kept.sensors[k]
            outdoors = solver.from_outdoors(seen[k], field, finer) if is_overcast else 0.0
            found = self.scene, k, gathered
            sensors[grid.name] = sensor_result(*found, mesh + rest, outdoors, least=least)
            without_mesh[grid.name] = sensor_result(*found, rest, least=least, spectral=False)
        return Solved(field, finer, balance, error, kept, sensors, without_mesh, tuple(seen))

    def judge(self, solved: Solved) -> bool:
        """Whether the accuracy asked for was reached; what is doubtful is among the warnings."""
        return self._judged(solved.sensors, solved.finer.light.luminous(), solved.balance)

    def _judged(
        self, sensors: dict[str, SensorResult], irradiance: FloatArray, balance: Balance
    ) -> bool:
        """The same of light at sensors and on elements, and of the ledger."""
        self._warn(sensors, irradiance, balance)
        if self._converged(sensors):
            return True
        self.stages.warnings.append(accuracy_message(sensors, self.budget.accuracy))
        return False

    def warn(self, solved: Solved) -> None:
        """Put what is doubtful among the warnings, but not that the accuracy was not reached."""
        self._warn(solved.sensors, solved.finer.light.luminous(), solved.balance)

    def _warn(
        self, sensors: dict[str, SensorResult], irradiance: FloatArray, balance: Balance
    ) -> None:
        self._warn_dark(sensors, irradiance)
        self.stages.warnings.extend(ledger_warning(balance, self.budget.accuracy))

    def _warn_dark(self, sensors: dict[str, SensorResult], irradiance: FloatArray) -> None:
        warnings = self.stages.warnings
        if not irradiance.any():
            warnings.append("dark scene: no surface gets any light")
        for name, grid in sensors.items():
            if not grid.illuminance_lx.any():
                warnings.append(f"dark grid: no sensor of {name!r} gets any light")

    def _converged(self, sensors: dict[str, SensorResult]) -> bool:
        """Whether the estimated error is within the accuracy asked at 95 % of the sensors."""
        reached = accuracies_reached(sensors, self._brightest)
        return all(error <= self.budget.accuracy for error in reached.values())

    def _element_error(self, light: Gathered, sampled: FloatArray, shift: FloatArray) -> FloatArray:
        """Half-width (n,) of the error on elements, ``shift`` being that of the mesh. [lx]

        Sampling of partly hidden cells, and of the light of lamps where rays tell it (``sampled``):
        two standard deviations. Quadrature and rounding: the accuracy of unoccluded factors, and
        theirs, of the value.
        """
        rules = OF_RULES * self.budget.eps + ROUNDING
        deviation = np.hypot(light.deviation, sampled)
        return np.asarray(shift + 2.0 * deviation + rules * light.luminous())
