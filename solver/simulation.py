"""The simulation of a frozen scene, stage by stage; stages a scene does not need are skipped."""

from __future__ import annotations

import numpy as np

from .budget import Budget
from .errors import GeometryError, InputError
from .exchange import ROUNDING
from .field import FINE_SHARE, Field, FieldSolver, Gathered
from .kernels.pyramid import Blockers
from .ledger import ledger_warning, make_balance
from .memory import check_memory, fits
from .mesh_check import MeshError, element_shift, left_of_change
from .model.arrays import FloatArray
from .model.result import Balance, CameraImage, Result, SensorResult, luminous
from .model.scene import SceneData
from .placement import check_placement
from .skies import horizontal_illuminance
from .stages import Progress, Stages
from .topology import is_single, make_blockers

#: How often the mesh is made finer where the accuracy asked for is not reached, and the elements
#: beyond which it is not.
REFINEMENTS = 2
REFINED_ELEMENTS = 2500


def estimate_seconds(scene: SceneData, accuracy: float = 0.01) -> float:
    """Rough wall-clock time of `solve` on two cores, without compiling. [s]"""
    return Budget.of(scene, accuracy).seconds(scene)


def solve(
    scene: SceneData,
    *,
    accuracy: float = 0.01,
    visibility: str = "auto",
    progress: Progress | None = None,
    threads: int | None = None,
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
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    threads : int, optional
        Threads of the kernels; all cores when not given. The numbers do not depend on it.

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
    if not (np.isfinite(accuracy) and 1e-6 <= accuracy <= 0.5):
        raise InputError(f"accuracy = {accuracy}: must lie between 1e-6 and 0.5")
    if visibility not in ("auto", "none"):
        raise InputError(f"visibility = {visibility!r}: auto or none")
    if len(scene.patches) == 0:
        raise GeometryError("the scene has no surfaces")
    previous = None if threads is None else _set_threads(threads)
    try:
        return _Simulation(scene, accuracy, visibility, Stages(progress)).run()
    finally:
        if previous is not None:
            _set_threads(previous)


def _set_threads(threads: int) -> int:
    from .kernels.threads import set_threads

    return set_threads(threads)


class _Simulation:
    """One run; each method is a stage."""

    def __init__(self, scene: SceneData, accuracy: float, visibility: str, stages: Stages) -> None:
        self.scene, self.stages, self.visibility = scene, stages, visibility
        self.budget = Budget.of(scene, accuracy)
        self.largest_grid = max((len(grid) for grid in scene.sensors), default=0)
        sides = len(scene.patches) + int(np.sum(scene.two_sided))
        check_memory(
            self.budget.elements, self.largest_grid, least_elements=sides, accuracy=accuracy
        )

    def run(self) -> Result:
        scene, stages = self.scene, self.stages
        with stages.run("geometry"):
            blockers = make_blockers(scene.patches, scene.closed, scene.patches.part_index)
            stages.warnings.extend(check_placement(scene))
        self._say_skipped(blockers)
        trace = "visibility" not in stages.skipped
        solver = FieldSolver(scene, blockers, trace=trace, stages=stages)
        field, grids, shifts, surface_shift = self._solved(solver, None)
        sensors = self._sensors(grids, shifts)
        for _ in range(REFINEMENTS):
            finer = self.budget.finer(scene)
            if (
                self._converged(sensors)
                or finer.elements > REFINED_ELEMENTS
                or finer.size >= 0.9 * self.budget.size
                or not self._converged(self._sensors(grids, {}))
            ):
                break  # it is good enough, too large, or not for the mesh that it is not
            if not fits(finer.elements, self.largest_grid):
                stages.warnings.append(
                    f"the mesh was not made finer than {self.budget.elements} elements: the memory "
                    f"that is free does not hold {finer.elements}"
                )
                break
            self.budget = finer
            field, grids, shifts, surface_shift = self._solved(solver, field)
            sensors = self._sensors(grids, shifts)
        budget = self.budget
        self._count(field)
        light = field.light
        images = self._images(field, solver)
        self._warn_dark(sensors, light.luminous())
        balance = self._balance(field, solver)
        stages.warnings.extend(ledger_warning(balance))
        return Result(
            scene=scene,
            elements=field.surfaces.elements,
            components=light.components,
            exitance=field.exitance,
            element_error_lx=_error(light, surface_shift, budget.eps),
            sensors=sensors,
            images=images,
            balance=balance,
            row_sums=field.row_sums,
            stages=stages.seconds,
            skipped=stages.skipped,
            counters=stages.counters,
            settings={**budget.settings, "visibility": self.visibility, "bands": solver.bands},
            warnings=tuple(stages.warnings),
            converged=self._converged(sensors),
        )

    def _count(self, field: Field) -> None:
        elements, counters = field.surfaces.elements, self.stages.counters
        counters["patches"], counters["elements"] = len(self.scene.patches), len(elements)
        counters["nodes"] = int((elements.weights > 0.0).sum())
        counters["buried_nodes"] = int((elements.buried & (elements.weights > 0.0)).sum())

    def _solved(
        self, solver: FieldSolver, coarse: Field | None
    ) -> tuple[Field, dict[str, Gathered], dict[str, FloatArray], FloatArray]:
        """Light on the mesh of the budget and at the sensors, and what a coarser mesh changes."""
        budget = self.budget
        field = solver.solve(budget, name=None if coarse is None else "finer mesh")
        grids = {grid.name: solver.gather(grid, budget, field) for grid in self.scene.sensors}
        return field, grids, *self._mesh_check(solver, field, grids, coarse)

    def _sensors(
        self, grids: dict[str, Gathered], shifts: dict[str, FloatArray]
    ) -> dict[str, SensorResult]:
        """Results of all grids; without ``shifts`` their errors hold no share of the mesh."""
        return {
            grid.name: self._sensor_result(
                k, grids[grid.name], shifts.get(grid.name, np.zeros(len(grid)))
            )
            for k, grid in enumerate(self.scene.sensors)
        }

    def _mesh_check(
        self,
        solver: FieldSolver,
        field: Field,
        grids: dict[str, Gathered],
        coarse: Field | None,
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """Error of indirect light at sensors and elements, from a coarser mesh. [lx]

        What both meshes have wrong alike changes nothing: it is no less than the light that the
        finer one misplaces. What the ledger lacks counts besides.
        """
        error = MeshError(field.misplaced, abs(self._balance(field, solver).residual_fraction))
        lamps = solver.lamp_groups
        light = {name: _indirect(g, lamps) for name, g in grids.items()}
        on_elements = _indirect(field.light, lamps)
        budget = self.budget.coarser(self.scene)
        reason = ""
        if not field.all_reflected.any():
            reason = "no light is reflected"
        elif (
            len(field.surfaces.elements) == self.budget.elements
            and (budget.divisions == self.budget.divisions).all()
        ):
            reason = "every patch is one element: there is no coarser mesh to compare with"
            self.stages.warnings.append(
                f"{reason}, and the errors hold of the mesh only what it misplaces of lamps' light"
            )
        if reason:
            self.stages.skipped["mesh check"] = reason
            return {name: error.of(*own) for name, own in light.items()}, error.of(*on_elements)
        if coarse is None:
            coarse = solver.solve(budget, name="mesh check")
        rest, errors = left_of_change(field, coarse), {}
        for grid in self.scene.sensors:
            own = light[grid.name]
            change = own[0] - solver.gather_indirect(grid, budget, coarse)
            # One sensor's change may pass through zero: none is below the root mean square.
            change = np.maximum(np.abs(change), np.sqrt(np.mean(change**2)))
            errors[grid.name] = error.of(*own, rest * change)
        return errors, error.of(*on_elements, rest * element_shift(field, coarse))

    def _sensor_result(self, index: int, gathered: Gathered, shift: FloatArray) -> SensorResult:
        grid = self.scene.sensors[index]
        components = {name: luminous(v) for name, v in gathered.components.items()}
        return SensorResult(
            name=grid.name,
            points=grid.points,
            normals=grid.normals,
            area_m2=grid.area_m2,
            illuminance_lx=gathered.luminous(),
            error_lx=_error(gathered, shift, FINE_SHARE * self.budget.eps),
            components=components,
            daylight_factor=self._daylight_factor(components),
            outline=grid.outline,
        )

    def _balance(self, field: Field, solver: FieldSolver) -> Balance:
        surfaces, light = field.surfaces, field.light
        nothing = np.zeros_like(surfaces.emitted)
        entered = [
            values
            for name, values in light.components.items()
            if name.endswith(".direct") and name.rsplit(".", 1)[0] not in solver.lamp_groups
        ]
        balance = make_balance(
            self.scene,
            surfaces.areas,
            field.factors,
            surfaces.reflectance,
            surfaces.diffuse,
            field.all_reflected,
            np.asarray(sum(light.components.values(), nothing)),
            np.asarray(sum(entered, nothing)),
            surfaces.material,
            np.where(surfaces.web, -1, surfaces.lamp),
            solver.mirrors.share_of(surfaces),
        )
        return solver.webs.in_ledger(balance, surfaces, self.budget.accuracy, field.sees_out)

    def _say_skipped(self, blockers: Blockers) -> None:
        scene, skipped = self.scene, self.stages.skipped
        if self.visibility == "none":
            skipped["visibility"] = "switched off"
        elif is_single(blockers, blockers.hollow):
            skipped["visibility"] = "one convex cavity: nothing can hide anything"
        elif is_single(blockers, blockers.bulging) and not scene.sensors:
            skipped["visibility"] = "one convex body: nothing can hide anything"
        if scene.is_grey:
            skipped["colour"] = "every material is grey: one band"
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
        """Share (m,) of the unobstructed sky's horizontal illuminance, under type 1 or 16 only."""
        sky = self.scene.sky
        if sky is None or sky.type not in (1, 16) or self.scene.sun is not None:
            return None
        daylight = [
            values
            for name, values in components.items()
            if name.rsplit(".", 1)[0] in ("sky", "ground")
        ]
        return np.asarray(sum(daylight) / horizontal_illuminance(sky))

    def _images(self, field: Field, solver: FieldSolver) -> dict[str, CameraImage]:
        if not self.scene.cameras:
            return {}
        from .camera import Renderer

        images = {}
        with self.stages.run("images") as tell:
            renderer = Renderer(
                self.scene,
                field.surfaces.elements,
                reflected=field.all_reflected,
                emitted=field.surfaces.diffuse,
                irradiance=field.light.luminous(),
                webs=solver.webs.lamps(self.budget.accuracy),
                second=solver.highlights.for_pictures(field, self.budget),
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
        for grid in sensors.values():
            mean = grid.mean(grid.illuminance_lx)
            floor = np.maximum(grid.illuminance_lx, 0.01 * mean)
            if mean > 0.0:
                relative = np.sort(grid.error_lx / floor)
                if relative[int(0.95 * (len(relative) - 1))] > self.budget.accuracy:
                    return False
        return True


def _indirect(light: Gathered, lamp_groups: list[str]) -> tuple[FloatArray, FloatArray]:
    """Indirect illuminance (m,), and the part of it that comes from lamps. [lx]"""
    own = [luminous(light.components[f"{group}.indirect"]) for group in lamp_groups]
    return light.luminous("indirect"), np.asarray(sum(own, np.zeros(len(light.deviation))))


def _error(light: Gathered, shift: FloatArray, eps: float) -> FloatArray:
    """Half-width (m,) of the numerical error. [lx]

    Mesh: ``shift``. Sampling of partly hidden cells: two standard deviations.
    Quadrature and rounding: the accuracy ``eps`` of unoccluded factors, and theirs, of the value.
    """
    return np.asarray(shift + 2.0 * light.deviation + (eps + ROUNDING) * light.luminous())
