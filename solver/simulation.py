"""The simulation of a frozen scene, stage by stage; stages a scene does not need are skipped."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from .budget import BASES, Budget, most_varying, scene_bytes
from .containment import Containment
from .effort import check_effort
from .errors import GeometryError, InputError
from .exchange import ROUNDING
from .field import FieldSolver
from .incident import Gathered
from .iterated import Finer
from .kept_placement import placement_remarks
from .kernels.pyramid import Blockers
from .ledger import ledger_warning, make_balance
from .memory import check_memory, fits, has_room, varying_bytes
from .mesh import Boxes
from .mesh_error import MeshError, doubt_on
from .model.arrays import FloatArray
from .model.reached import accuracies_reached, accuracy_message
from .model.result import Balance, CameraImage, Result, SensorResult, luminous
from .model.scene import SceneData
from .moved_blockers import kept_blockers
from .reuse import STORE, Kept, Mesh, forget
from .rule_error import OF_RULES
from .skies import horizontal_illuminance
from .solved_field import Field, SensorRows
from .stages import Progress, Stages
from .surfaces import reflectances
from .topology import is_single

#: How often the mesh is cut further where the accuracy asked for is not reached.
REFINEMENTS = 3
#: Ways to solve a scene.
METHODS = ("default", "nn93")


def estimate_seconds(scene: SceneData, accuracy: float = 0.01, basis: str | None = None) -> float:
    """Rough wall-clock time of `solve` on two cores, without compiling. [s]"""
    return Budget.of(scene, accuracy, basis or Simulation.basis).seconds(scene)


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
        kind = Simulation
        if method == "nn93":
            from .nn93_simulation import Nn93Simulation

            kind = Nn93Simulation
        options = Options(basis=basis, balanced=balanced_mesh, cache=cache)
        return kind(scene, accuracy, visibility, Stages(progress), options).run()


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
    sensors: dict[str, SensorResult]
    without_mesh: dict[str, SensorResult]
    seen: tuple[SensorRows, ...] = ()


@dataclass(frozen=True, slots=True)
class Options:
    """What may be chosen besides accuracy and visibility; see `solve`."""

    basis: str | None = None
    balanced: bool = False
    cache: bool = False


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
        self._own_mesh: tuple[Boxes, float] | None = None
        self.scene, self.stages, self.visibility = scene, stages, visibility
        self.basis = options.basis or self.basis
        self.budget = Budget.of(scene, accuracy, self.basis)
        self.largest_grid = max((len(grid) for grid in scene.sensors), default=0)
        sides = len(scene.patches) + int(np.sum(scene.two_sided))
        #: What mirrors and panes take besides, a pair. [B]
        self.more = scene_bytes(scene)
        if len(STORE) and not self._is_roomy():
            forget()  # what is kept may be found again
            self.budget = Budget.of(scene, accuracy, self.basis)
        large = self.budget.is_large
        # What decided on a mesh is known for its boxes before balancing only; rows of large meshes
        # take more than they are worth.
        kept = options.cache and not options.balanced and not large
        self.store = STORE if kept else None
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
            kept = Kept(scene, stages=stages, store=self.store)
            opaque = scene.without_panes
            solids = opaque.patches, opaque.closed, opaque.patches.part_index
            blockers = kept_blockers(kept, *solids)
            tester = Containment(scene, blockers)
            stages.warnings.extend(placement_remarks(scene, tester, kept))
        self._say_skipped(blockers)
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
        scene, stages = self.scene, self.stages
        solver, kept = self.start()
        solved = self.solved(solver, kept)
        kept.tell()
        field, finer, sensors = solved.field, solved.finer, solved.sensors
        self._count(field)
        light = finer.light
        images = self._images(field, finer, solver)
        self._warn_dark(sensors, light.luminous())
        stages.warnings.extend(ledger_warning(solved.balance))
        converged = self._converged(sensors)
        if not converged:
            stages.warnings.append(accuracy_message(sensors, self.budget.accuracy))
        self._keep_mesh(solver, kept, solved, converged=converged)
        on_elements = solved.error.of(light, doubt_on(field, finer))
        return Result(
            scene=scene,
            elements=field.surfaces.elements,
            components=light.components,
            exitance=field.surfaces.emitted + finer.reflected,
            element_error_lx=self._element_error(light, on_elements),
            sensors=sensors,
            images=images,
            balance=solved.balance,
            row_sums=field.row_sums,
            stages=stages.seconds,
            skipped=stages.skipped,
            counters=stages.counters,
            settings={
                **self.budget.settings,
                **stages.figures,
                "visibility": self.visibility,
                "method": self.method,
                "balanced_mesh": self.balance,
                "bands": solver.bands,
            },
            warnings=tuple(stages.warnings),
            converged=converged,
        )

    def _count(self, field: Field) -> None:
        elements, counters = field.surfaces.elements, self.stages.counters
        counters["unknowns"] = len(field.unknowns)
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
        if not enough and len(STORE):
            forget()
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
        budget = self.budget
        field = solver.solve(budget, boxes)
        seen = [solver.seen(grid, budget, field) for grid in self.scene.sensors]
        finer = solver.finer(field, budget, seen)
        balance = self._balance(field, finer, solver)
        unseen = budget.unseen(finer.unseen)
        error = MeshError.of_finer(finer, abs(balance.residual_fraction), unseen)
        sensors, without_mesh = {}, {}
        for k, grid in enumerate(self.scene.sensors):
            gathered, doubt, rules = solver.gather(grid, seen[k], field, finer)
            mesh = error.of(gathered, doubt)
            sensors[grid.name] = self._sensor_result(k, gathered, mesh + rules)
            without_mesh[grid.name] = self._sensor_result(k, gathered, rules)
        return Solved(field, finer, balance, error, sensors, without_mesh, tuple(seen))

    def _sensor_result(self, index: int, gathered: Gathered, more: FloatArray) -> SensorResult:
        """Light at the sensors of a grid; ``more`` (m,) is all error but that of samples. [lx]"""
        grid = self.scene.sensors[index]
        components = {name: luminous(v) for name, v in gathered.components.items()}
        return SensorResult(
            name=grid.name,
            points=grid.points,
            normals=grid.normals,
            area_m2=grid.area_m2,
            illuminance_lx=gathered.luminous(),
            error_lx=more + 2.0 * gathered.deviation,
            components=components,
            daylight_factor=self._daylight_factor(components),
            outline=grid.outline,
        )

    def _balance(self, field: Field, finer: Finer, solver: FieldSolver) -> Balance:
        surfaces, of = field.surfaces, finer.unknowns.element
        lamps = {f"{group}.direct" for group in solver.lamp_groups}
        nothing = np.zeros((len(of), solver.bands))
        entered = [
            values
            for name, values in finer.arriving.components.items()
            if name.endswith(".direct") and name not in lamps
        ]
        balance = make_balance(
            self.scene,
            finer.unknowns.areas,
            finer.kept,
            surfaces.reflectance[of],
            surfaces.diffuse_at(finer.unknowns),
            np.asarray(sum(finer.sent.values(), nothing)),
            np.asarray(sum(finer.arriving.components.values(), nothing)),
            np.asarray(sum(entered, nothing)),
            surfaces.material[of],
            np.where(surfaces.web, -1, surfaces.lamp)[of],
            solver.mirrors.share_of(surfaces)[of],
        )
        balance = solver.panes.in_ledger(
            balance,
            surfaces,
            lambda rows: field.unknowns.of_whole(field.system.factors, rows),
            surfaces.diffuse + finer.reflected,
            finer.light.components,
        )
        return solver.webs.in_ledger(balance, surfaces, self.budget.accuracy, field.sees_out)

    def _say_skipped(self, blockers: Blockers) -> None:
        scene, skipped = self.scene, self.stages.skipped
        clear = scene.opaque_count < len(scene.patches)
        if self.visibility == "none":
            skipped["visibility"] = "switched off"
        elif clear:
            pass  # light from outside comes past the edges of panes
        elif is_single(blockers, blockers.hollow):
            skipped["visibility"] = "one convex cavity: nothing can hide anything"
        elif is_single(blockers, blockers.bulging) and not scene.sensors:
            skipped["visibility"] = "one convex body: nothing can hide anything"
        if scene.is_grey:
            skipped["colour"] = "every material is grey: one band"
        if not clear:
            off = self.visibility == "none"
            skipped["glass"] = "switched off" if off else "nothing is seen through"
        if not scene.luminaires:
            skipped["electric light"] = "no luminaires"
        if scene.sky is None:
            skipped["sky"] = "no sky"
        if scene.sun is None:
            skipped["sun"] = "no sun"
        if not scene.cameras:
            skipped["images"] = "no cameras"
        if not scene.sensors:
            skipped["sensors"] = "no sensor grids"

    def _daylight_factor(self, components: dict[str, FloatArray]) -> FloatArray | None:
        """Share (m,) of the unobstructed sky's horizontal illuminance, under type 1 or 16 only.

        None under a sky without light.
        """
        sky = self.scene.sky
        if sky is None or not sky.of_daylight_factors or self.scene.sun is not None:
            return None
        unobstructed = horizontal_illuminance(sky)
        if unobstructed <= 0.0:
            return None
        daylight = [
            values
            for name, values in components.items()
            if name.rsplit(".", 1)[0] in ("sky", "ground")
        ]
        return np.asarray(sum(daylight) / unobstructed)

    def _images(self, field: Field, finer: Finer, solver: FieldSolver) -> dict[str, CameraImage]:
        if not self.scene.cameras:
            return {}
        from .camera import Renderer

        images = {}
        with self.stages.run("images") as tell:
            renderer = Renderer(
                self.scene,
                field.surfaces.elements,
                reflected=finer.reflected,
                emitted=field.surfaces.diffuse_at_corners,
                irradiance=finer.light.luminous(),
                webs=solver.webs.lamps(self.budget.accuracy),
                second=solver.highlights.for_pictures(field.surfaces, finer, self.budget),
            )
            for k, camera in enumerate(self.scene.cameras):
                images[camera.name] = renderer.render(camera)
                tell(k + 1, len(self.scene.cameras))
        return images

    def _warn_dark(self, sensors: dict[str, SensorResult], irradiance: FloatArray) -> None:
        warnings = self.stages.warnings
        if not irradiance.any():
            warnings.append("dark scene: no surface gets any light")
        for name, grid in sensors.items():
            if not grid.illuminance_lx.any():
                warnings.append(f"dark grid: no sensor of {name!r} gets any light")

    def _converged(self, sensors: dict[str, SensorResult]) -> bool:
        """Whether the estimated error is within the accuracy asked at 95 % of the sensors."""
        return all(e <= self.budget.accuracy for e in accuracies_reached(sensors).values())

    def _element_error(self, light: Gathered, shift: FloatArray) -> FloatArray:
        """Half-width (n,) of the error on elements, ``shift`` being that of the mesh. [lx]

        Sampling of partly hidden cells: two standard deviations. Quadrature and rounding: the
        accuracy of unoccluded factors, and theirs, of the value.
        """
        rules = OF_RULES * self.budget.eps + ROUNDING
        return np.asarray(shift + 2.0 * light.deviation + rules * light.luminous())
