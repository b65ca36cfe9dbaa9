"""The simulation of a frozen scene, stage by stage; stages a scene does not need are skipped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .budget import Budget
from .containment import Containment, check_placement
from .dome import dome_cells, gather, sun_cells
from .errors import GeometryError, InputError
from .exchange import Rows, close_rows, form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .ledger import make_balance
from .mesh import make_elements
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.result import CameraImage, Result, SensorResult, luminous
from .model.scene import BLACK, SceneData
from .model.sky import CIESky
from .model.views import Sensors
from .radiosity import coarse_exitance, solve_radiosity
from .skies import ground_luminance, horizontal_illuminance, sun_luminance
from .spectra import cct_to_rgb
from .stages import Progress, Stages
from .topology import make_blockers

#: Distance above a surface at which it is asked whether something lies on it, relative to the
#: scene's size.
CONTACT = 1e-5

#: Elements smaller than this share of the aimed size get a single node.
SMALL = 0.35


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
        ``"auto"`` traces pyramids; ``"none"`` lets light through everything, for comparison.
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


@dataclass(frozen=True, slots=True, eq=False)
class _Receivers:
    """Nodes (m, q, 3) and normals, their shares (m, q), and the patch (m,) each lies on."""

    nodes: FloatArray
    normals: FloatArray
    weights: FloatArray
    patches: IntArray

    @classmethod
    def of_elements(cls, elements: Elements) -> _Receivers:
        share = np.where(elements.buried, 0.0, elements.weights)
        total = share.sum(axis=1)
        share = share / np.where(total > 0.0, total, 1.0)[:, None]
        return cls(elements.nodes, elements.normals, share, elements.patch_index)

    @classmethod
    def of_sensors(cls, grid: Sensors) -> _Receivers:
        ones = np.ones((len(grid), 1))
        nowhere = np.full(len(grid), -1)
        return cls(grid.points[:, None], grid.normals[:, None], ones, nowhere)


@dataclass(frozen=True, slots=True, eq=False)
class _Surfaces:
    """Optical state of the elements; row i of every array is the same element."""

    elements: Elements
    areas: FloatArray  # (n,) without the buried share [m²]
    reflectance: FloatArray  # (n, b)
    emitted: FloatArray  # (n, b) [lm/m²]
    material: IntArray  # (n,) row of the scene's materials
    lamp: IntArray  # (n,) row of the scene's luminaires

    @classmethod
    def of(cls, scene: SceneData, elements: Elements, bands: int) -> _Surfaces:
        where = (elements.patch_index, elements.side)
        material, lamp = scene.material_index[where], scene.luminaire_index[where]
        rho = np.zeros((len(elements), bands))
        for row, m in enumerate(scene.materials):
            rho[material == row] = m.bands[:bands]
        emitted = np.zeros_like(rho)
        for row, luminaire in enumerate(scene.luminaires):
            color = np.ones(1) if bands == 1 else np.asarray(luminaire.color)
            emitted[lamp == row] = luminaire.exitance_lm_m2 * color
        rho[material == BLACK] = 0.0
        areas = np.where(elements.buried, 0.0, elements.weights).sum(axis=1)
        return cls(elements, areas, rho, emitted, material, lamp)

    def emitted_by(self, scene: SceneData, group: str) -> FloatArray:
        """Emitted exitance (n, b) of one light group. [lm/m²]"""
        rows = [k for k, lamp in enumerate(scene.luminaires) if lamp.group == group]
        return np.where(np.isin(self.lamp, rows)[:, None], self.emitted, 0.0)


@dataclass(eq=False)
class _Light:
    """Direct irradiance by group (m, b) and the variance (m,) of what was sampled."""

    direct: dict[str, FloatArray]
    variance: FloatArray
    outside: FloatArray  # (m,) form factor of sky and ground together


class _Simulation:
    """One run; each method is a stage."""

    def __init__(
        self, scene: SceneData, accuracy: float, visibility: str, stages: Stages
    ) -> None:
        self.scene, self.stages, self.visibility = scene, stages, visibility
        self.budget = Budget.of(scene, accuracy)
        self.bands = 1 if scene.is_grey else 3
        self.lamp_groups = list(dict.fromkeys(lamp.group for lamp in scene.luminaires))

    def run(self) -> Result:
        scene, stages = self.scene, self.stages
        with stages.run("geometry"):
            blockers = make_blockers(scene.patches, scene.closed, scene.patches.part_index)
            elements = self._elements()
            surfaces = _Surfaces.of(scene, elements, self.bands)
            sources = self._sources(surfaces)
            stages.warnings.extend(check_placement(scene))
        self._say_skipped(blockers)
        trace = "visibility" not in stages.skipped
        receivers = _Receivers.of_elements(elements)
        with stages.run("form factors") as tell:
            rows = self._rows(receivers, sources, blockers, trace, tell)
        row_sums = rows.factors.sum(axis=1)
        lit = surfaces.areas > 0.0
        sees_out = self._sees_out(row_sums[lit], rows.variances[lit])
        light = _Light({}, np.zeros(len(elements)), np.zeros(len(elements)))
        self._add_dome(light, receivers, blockers, trace, sees_out, on_sensors=False)
        rows = self._closed(rows, light, sees_out)
        self._add_lamps(light, rows, surfaces)
        with stages.run("radiosity"):
            reflected, products = solve_radiosity(
                rows.factors, surfaces.reflectance, light.direct
            )
            stages.counters["matrix_products"] = products
            components = {}
            for group, direct in light.direct.items():
                components[f"{group}.direct"] = direct
                components[f"{group}.indirect"] = rows.factors @ reflected[group]
            all_reflected = sum(reflected.values(), np.zeros_like(surfaces.emitted))
            exitance = surfaces.emitted + all_reflected
            shift = self._coarse_shift(rows, surfaces, light, exitance)
        irradiance = sum(components.values(), np.zeros_like(exitance))
        entered = sum(
            (v for g, v in light.direct.items() if g not in self.lamp_groups),
            np.zeros_like(exitance),
        )
        balance = make_balance(
            scene, surfaces.areas, rows.factors, surfaces.reflectance, surfaces.emitted,
            all_reflected, irradiance, entered, surfaces.material, surfaces.lamp,
        )  # fmt: skip
        error = _error(rows, shift, exitance, light, luminous(irradiance))
        sensors = {}
        for grid in scene.sensors:
            sensors[grid.name] = self._sensor_grid(
                grid, sources, blockers, trace, sees_out, surfaces, reflected, exitance, shift
            )
        images = self._images(surfaces, all_reflected, luminous(irradiance))
        self._warn_dark(sensors, irradiance)
        return Result(
            scene=scene,
            elements=elements,
            components=components,
            exitance=exitance,
            element_error_lx=error,
            sensors=sensors,
            images=images,
            balance=balance,
            row_sums=row_sums,
            stages=stages.seconds,
            skipped=stages.skipped,
            counters=stages.counters,
            settings={**self.budget.settings, "visibility": self.visibility, "bands": self.bands},
            warnings=tuple(stages.warnings),
            converged=self._converged(sensors),
        )

    def _elements(self) -> Elements:
        scene, budget = self.scene, self.budget
        elements = make_elements(
            scene.patches,
            scene.two_sided,
            budget.divisions,
            nodes=budget.nodes,
            small=(SMALL * budget.size) ** 2,
        )
        low, high = scene.patches.bounds()
        distance = CONTACT * float(np.linalg.norm(high - low))
        buried = Containment(scene).buried(
            elements.nodes.reshape(-1, 3), elements.normals.reshape(-1, 3), distance
        )
        counters = self.stages.counters
        counters["patches"], counters["elements"] = len(scene.patches), len(elements)
        counters["nodes"] = int((elements.weights > 0.0).sum())
        counters["buried_nodes"] = int(buried.sum())
        return replace(elements, buried=buried.reshape(elements.weights.shape))

    def _sources(self, surfaces: _Surfaces) -> Sources:
        """Elements as sources; the brighter one is, the finer its partly hidden cells are cut."""
        budget, emitted = self.budget, luminous(surfaces.emitted)
        mean = float(emitted @ surfaces.areas) / float(surfaces.areas.sum())
        cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
        cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
        cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
        return make_sources(surfaces.elements, self.scene.patches.control_points, cell_eps)

    def _say_skipped(self, blockers: Blockers) -> None:
        scene, skipped = self.scene, self.stages.skipped
        if self.visibility == "none":
            skipped["visibility"] = "switched off"
        elif blockers.closed.all() and len(np.unique(blockers.solid)) == 1:
            if blockers.hollow[blockers.solid[0]]:
                skipped["visibility"] = "one convex cavity: nothing can hide anything"
            elif blockers.bulging[blockers.solid[0]] and not scene.sensors:
                skipped["visibility"] = "one convex body: nothing can hide anything"
        if self.bands == 1:
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

    def _rows(
        self,
        receivers: _Receivers,
        sources: Sources,
        blockers: Blockers,
        trace: bool,
        tell: Callable[[int, int], None],
    ) -> Rows:
        rows = form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            sources,
            blockers,
            eps=self.budget.eps,
            trace=trace,
            progress=tell,
        )
        self.stages.count(rows.counters)
        return rows

    def _sees_out(self, row_sums: FloatArray, variances: np.ndarray) -> bool:
        """Whether light may leave the scene anywhere, beyond what sampling explains."""
        missing = 1.0 - row_sums
        noise = 3.0 * np.sqrt(variances.sum(axis=1, dtype=np.float64)) + 1e-4
        return bool((missing > noise).any())

    def _add_lamps(self, light: _Light, rows: Rows, surfaces: _Surfaces) -> None:
        """Put the direct light of the luminaires before that of sky, sun and ground."""
        lamps = {
            group: rows.factors @ surfaces.emitted_by(self.scene, group)
            for group in self.lamp_groups
        }
        light.direct = {**lamps, **light.direct}

    def _closed(self, rows: Rows, light: _Light, sees_out: bool) -> Rows:
        """Rows whose sampling error is corrected by what all directions together must give.

        Needs the total: 1 when nothing sees out, else 1 less what is seen of sky and ground. Backs
        of one-sided patches count nowhere, so that scenes with such patches are left alone.
        """
        scene = self.scene
        whole = bool((scene.closed | scene.two_sided).all())
        both = {"sky", "ground"} <= set(light.direct)
        if not whole or (sees_out and not both) or "visibility" in self.stages.skipped:
            return rows
        closed, count = close_rows(rows, 1.0 - light.outside if sees_out else 1.0)
        self.stages.count({"rows_closed": count})
        return closed

    def _add_dome(
        self,
        light: _Light,
        receivers: _Receivers,
        blockers: Blockers,
        trace: bool,
        sees_out: bool,
        *,
        on_sensors: bool,
    ) -> None:
        """Add the direct light of sky, sun and ground."""
        scene, budget, stages = self.scene, self.budget, self.stages
        eps = budget.sensor_dome_cell_eps if on_sensors else budget.dome_cell_eps
        jobs: list[tuple[str, FloatArray, CIESky | float, float, float]] = []
        if scene.sky is not None:
            jobs.append(("sky", dome_cells(0.0, 90.0), scene.sky, eps, scene.sky.cct_k))
        if scene.sun is not None:
            level, cells = sun_luminance(scene.sun), sun_cells(scene.sun)
            disc = np.sin(np.radians(scene.sun.angular_radius_arcmin / 60.0)) ** 2
            jobs.append(("sun", cells, level, budget.sun_cell_eps * disc, scene.sun.cct_k))
        level = ground_luminance(scene.ground, scene.sky, scene.sun)
        if level > 0.0:
            cct = scene.sky.cct_k if scene.sky is not None else 5500.0
            jobs.append(("ground", dome_cells(-90.0, 0.0), level, eps, cct))
        for name, cells, luminance, cell_eps, cct in jobs:
            if not sees_out and trace:
                stages.skipped[name] = "nothing sees out of the scene"
                light.direct[name] = np.zeros((len(receivers.nodes), self.bands))
                continue
            with stages.run(name) as tell:
                found = gather(
                    receivers.nodes,
                    receivers.normals,
                    receivers.weights,
                    cells,
                    luminance,
                    blockers,
                    eps=budget.eps,
                    cell_eps=cell_eps,
                    trace=trace,
                    progress=tell,
                )
            stages.count(found.counters)
            color = np.ones(1) if self.bands == 1 else cct_to_rgb(cct)
            light.direct[name] = found.illuminance[:, None] * color
            light.variance += found.deviation**2
            if name != "sun":
                light.outside += found.factor

    def _coarse_shift(
        self, rows: Rows, surfaces: _Surfaces, light: _Light, exitance: FloatArray
    ) -> FloatArray:
        """Change of the luminous exitance (n,) when elements are merged two by two."""
        direct = sum(light.direct.values(), np.zeros_like(exitance))
        coarse = coarse_exitance(
            rows.factors,
            _merged(surfaces.elements, self.budget.divisions),
            surfaces.areas,
            surfaces.reflectance,
            surfaces.emitted,
            direct,
        )
        return luminous(coarse - exitance)

    def _sensor_grid(
        self,
        grid: Sensors,
        sources: Sources,
        blockers: Blockers,
        trace: bool,
        sees_out: bool,
        surfaces: _Surfaces,
        reflected: dict[str, FloatArray],
        exitance: FloatArray,
        shift: FloatArray,
    ) -> SensorResult:
        """Final gather: direct light at the points themselves, indirect from the elements."""
        receivers = _Receivers.of_sensors(grid)
        with self.stages.run("sensors") as tell:
            rows = self._rows(receivers, sources, blockers, trace, tell)
        light = _Light({}, np.zeros(len(grid)), np.zeros(len(grid)))
        self._add_dome(light, receivers, blockers, trace, sees_out, on_sensors=True)
        rows = self._closed(rows, light, sees_out)
        self._add_lamps(light, rows, surfaces)
        components = {}
        for group, direct in light.direct.items():
            components[f"{group}.direct"] = luminous(direct)
            components[f"{group}.indirect"] = luminous(rows.factors @ reflected[group])
        total = sum(components.values(), np.zeros(len(grid)))
        return SensorResult(
            name=grid.name,
            points=grid.points,
            normals=grid.normals,
            area_m2=grid.area_m2,
            illuminance_lx=total,
            error_lx=_error(rows, shift, exitance, light, total),
            components=components,
            daylight_factor=self._daylight_factor(components),
            outline=grid.outline,
        )

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

    def _images(
        self, surfaces: _Surfaces, reflected: FloatArray, illuminance: FloatArray
    ) -> dict[str, CameraImage]:
        if not self.scene.cameras:
            return {}
        from .camera import Renderer

        images = {}
        with self.stages.run("images") as tell:
            renderer = Renderer(
                self.scene,
                surfaces.elements,
                reflected=reflected,
                emitted=surfaces.emitted,
                irradiance=illuminance,
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


def _error(
    rows: Rows, shift: FloatArray, exitance: FloatArray, light: _Light, total: FloatArray
) -> FloatArray:
    """Half-width (m,) of the numerical error. [lx]

    Mesh: a third of the change that doubling the elements makes, as for a second-order method.
    Sampling of partly hidden cells: two standard deviations. Quadrature and
    solver: 1e-4 of the value.
    """
    mesh = np.abs(rows.factors @ shift) / 3.0
    sampled = rows.variances @ luminous(exitance) ** 2 + light.variance
    return np.asarray(mesh + 2.0 * np.sqrt(sampled) + 1e-4 * total)


def _merged(elements: Elements, divisions: IntArray) -> IntArray:
    """Groups (n,) of up to 2 x 2 neighbouring elements of one patch side."""
    nu, nv = divisions[elements.patch_index].T
    i = np.round(elements.boxes[:, 0] * nu).astype(np.int64) // 2
    j = np.round(elements.boxes[:, 2] * nv).astype(np.int64) // 2
    key = np.stack([elements.patch_index, elements.side, i, j], axis=1)
    return np.asarray(np.unique(key, axis=0, return_inverse=True)[1].ravel())
