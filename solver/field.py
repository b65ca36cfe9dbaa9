"""Light on one mesh: form factors, direct light, interreflection, and the gather at sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .budget import Budget
from .dome import dome_cells, gather, sun_cells
from .exchange import Rows, Scan, make_sources
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .mesher import Mesher
from .model.arrays import FloatArray, MatrixArray
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import CIESky
from .model.views import Sensors
from .pane_field import PaneField
from .radiosity import solve_radiosity
from .row_finder import FINE_SHARE, Ask, RowFinder
from .sights import with_sights
from .skies import ground_luminance, sun_luminance
from .spectra import cct_to_rgb
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .tables import make_facets, meridians
from .topology import is_single
from .web_field import WebField

#: Size of sampled cells at sensors against those between surfaces.
SENSOR_SHARE = 0.1
#: The same for the form factors above which pairs are traced.
SENSOR_EXACT = 0.025
#: Exitance of elements told by lines of sight, against the mean of all surfaces.
BRIGHT = 4.0
#: Error of factors told by one point against that of other unoccluded factors: it has either sign,
#: and few elements come near to it.
POINT_SHARE = 2.5


@dataclass(eq=False)
class Light:
    """Direct irradiance by group (m, b) and the variance (m,) of what was sampled."""

    direct: dict[str, FloatArray]
    variance: FloatArray
    outside: FloatArray  # (m,) form factor of sky and ground together, and its variance
    outside_variance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """Light on some receivers; row i of every array is the same receiver.

    Attributes
    ----------
    components : dict of (m, b) arrays
        ``"<group>.direct"`` and ``"<group>.indirect"``. [lx]
    deviation : (m,) array
        Standard deviation of what was sampled. [lx]
    """

    components: dict[str, FloatArray]
    deviation: FloatArray

    def luminous(self, kind: str = "") -> FloatArray:
        """Illuminance (m,), of one kind (``"direct"``, ``"indirect"``) or in all. [lx]"""
        parts = [luminous(v) for name, v in self.components.items() if name.endswith(kind)]
        return np.asarray(sum(parts, np.zeros(len(self.deviation))))


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A scene solved on one mesh.

    Attributes
    ----------
    surfaces : Surfaces
        The elements and their optical state.
    sources : Sources
        The elements as the kernels see them.
    factors : (n, n) float32 array
        Form factors.
    row_sums : (n,) array
        Their raw sums, before any correction.
    sees_out : bool
        Whether light can leave the scene.
    light : Gathered
        Light on the elements.
    reflected : dict of (n, b) arrays
        Reflected exitance by light group. [lm/m²]
    misplaced : float
        Share of the reflected light that the elements have in the wrong place.
    """

    surfaces: Surfaces
    sources: Sources
    factors: MatrixArray
    row_sums: FloatArray
    sees_out: bool
    light: Gathered
    reflected: dict[str, FloatArray]
    misplaced: float = 0.0

    @property
    def all_reflected(self) -> FloatArray:
        """Reflected exitance (n, b) of all groups. [lm/m²]"""
        return np.asarray(sum(self.reflected.values(), np.zeros_like(self.surfaces.emitted)))

    @property
    def exitance(self) -> FloatArray:
        """Emitted and reflected exitance (n, b). [lm/m²]"""
        return np.asarray(self.surfaces.emitted + self.all_reflected)


class FieldSolver:
    """Solves a scene on meshes of different size.

    Parameters
    ----------
    scene : SceneData
        What to solve.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives times, counters and reasons.
    """

    def __init__(
        self, scene: SceneData, blockers: Blockers, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        #: All there is is one convex cavity.
        self.panes = PaneField(scene, blockers, trace=trace, stages=stages)
        self.in_cavity = is_single(blockers, blockers.hollow) and not self.panes.any
        self._factors = RowFinder(scene, blockers, trace=trace, stages=stages)
        self._mesher = Mesher(scene, blockers, trace=trace, stages=stages)
        self.bands = 1 if scene.is_grey else 3
        self.lamp_groups = list(dict.fromkeys(lamp.group for lamp in scene.luminaires))
        self.webs = WebField(scene, blockers, trace=trace, stages=stages)

    def solve(self, budget: Budget, *, name: str | None = None) -> Field:
        """Solve on the mesh of ``budget``; one stage of that ``name``, or several of their own."""
        with self.stages.run(name or "elements"):
            elements, misplaced = self._mesher.elements(budget)
            surfaces = Surfaces.of(self.scene, elements, self.bands)
            sources, lifts = self._sources(budget, surfaces)
        receivers = self.panes.receivers(elements)
        with self.stages.run(name or "form factors") as tell:
            asked = Ask(budget, receivers, sources, lifts)
            rows = self._factors.rows(asked, tell)
            sees_out = self._sees_out(rows, surfaces.areas > 0.0)
            row_sums = self._factors.close(rows, 1.0, asked, outside=sees_out)
            rows = self.panes.complete(rows, asked, elements, surfaces.areas, mesh=True)
        light = Light({}, *np.zeros((3, len(elements))))
        scanned = rows.outside if self.trace else None
        self._add_dome(light, receivers, budget, sees_out, name, scanned)
        self._add_lamps(light, rows, surfaces)
        light.variance += self.webs.add(light.direct, rows, surfaces, asked, stage=name)
        with self.stages.run(name or "radiosity"):
            reflected, products = solve_radiosity(
                rows.factors,
                surfaces.reflectance,
                light.direct,
                accuracy=budget.accuracy,
                scattering=self.panes.scattering(surfaces),
            )
        self.stages.count({"matrix_products": products})
        gathered = self._gathered(light, rows, surfaces, reflected)
        return Field(
            surfaces, sources, rows.factors, row_sums, sees_out, gathered, reflected, misplaced
        )

    def gather(self, grid: Sensors, budget: Budget, field: Field) -> Gathered:
        """Direct light at the sensors themselves, indirect light from the elements."""
        receivers = Receivers.of_sensors(grid)
        # No average over nodes and bounces hides the sampling of a single sensor.
        sources = field.sources
        fine = sources._replace(
            cell_eps=sources.cell_eps * SENSOR_SHARE,
            exact_above=sources.cell_eps * (SENSOR_EXACT * budget.exact_above / budget.cell_eps),
            azimuths=meridians(budget.sensor_lines if len(sources.azimuths) else 0),
            point_from=np.full_like(sources.point_from, np.inf),
        )
        with self.stages.run("sensors") as tell:
            asked = Ask(budget, receivers, fine, share=FINE_SHARE)
            rows = self._factors.rows(asked, tell)
        light = Light({}, *np.zeros((3, len(grid))))
        self._add_dome(light, receivers, budget, field.sees_out, None)
        if not field.sees_out or {"sky", "ground"} <= set(light.direct):
            totals = 1.0 - light.outside
            self._factors.close(rows, totals, asked, spread=light.outside_variance)
        rows = self.panes.complete(rows, asked, field.surfaces.elements, field.surfaces.areas)
        self._add_lamps(light, rows, field.surfaces)
        light.variance += self.webs.add(light.direct, rows, field.surfaces, asked, fine=True)
        return self._gathered(light, rows, field.surfaces, field.reflected)

    def gather_indirect(self, grid: Sensors, budget: Budget, field: Field) -> FloatArray:
        """Indirect illuminance (m,) alone, for comparing meshes. [lx]"""
        with self.stages.run("mesh check") as tell:
            asked = Ask(budget, Receivers.of_sensors(grid), field.sources)
            rows = self._factors.rows(asked, tell)
            rows = self.panes.complete(rows, asked, field.surfaces.elements, field.surfaces.areas)
        return luminous(rows.gather(field.all_reflected))

    def _gathered(
        self, light: Light, rows: Rows, surfaces: Surfaces, reflected: dict[str, FloatArray]
    ) -> Gathered:
        components = {}
        exitance = surfaces.diffuse
        for group, direct in light.direct.items():
            components[f"{group}.direct"] = direct
            components[f"{group}.indirect"] = rows.gather(reflected[group])
            exitance += reflected[group]
        sampled = rows.variance_of(luminous(exitance)) + light.variance
        return Gathered(components, np.sqrt(sampled))

    def _sources(self, budget: Budget, surfaces: Surfaces) -> tuple[Sources, FloatArray]:
        """Elements as sources, and how far their facets leave them.

        The brighter one is, the finer its partly hidden cells are cut, and the weaker are the
        pairs that are traced.
        """
        elements = self.panes.opaque(surfaces.elements)
        emitted, areas = (a[: len(elements)] for a in (luminous(surfaces.emitted), surfaces.areas))
        mean = float(emitted @ areas) / float(areas.sum())
        cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
        cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
        cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
        nets = self.scene.patches.control_points
        if not self.trace:
            sources = make_sources(elements, nets, cell_eps)
            return sources, np.zeros(len(surfaces.elements))
        facets, lifts = make_facets(elements, nets, self.blockers.closed, self.blockers.solid)
        bright = emitted > BRIGHT * mean
        facets = with_sights(facets, elements, self.blockers.solid, bright, budget.sights)
        exact_above = np.full(len(emitted), budget.exact_above)
        # As much light as an element of mean brightness sends at the threshold.
        told = np.diff(facets.sight_start) > 0
        exact_above[~told] *= cell_eps[~told] / budget.cell_eps
        scan = Scan(facets, budget.lines, exact_above, POINT_SHARE * budget.eps)
        sources = make_sources(elements, nets, cell_eps, scan)
        return sources, self.panes.lifts(lifts, surfaces.elements)

    def _sees_out(self, rows: Rows, lit: np.ndarray) -> bool:
        """Whether light may leave the scene anywhere, beyond what sampling explains."""
        if self.in_cavity:
            return False
        missing = 1.0 - rows.sums[lit, 0]
        noise = 3.0 * np.sqrt(rows.sums[lit, 1]) + 1e-4
        leaves = missing > noise
        if self.trace:
            # What the meridians met is known besides: a row that meets something on all of them
            # is closed, however its factors add up.
            leaves &= rows.outside[lit, 1] + rows.outside[lit, 2] > 1e-6
        return bool(leaves.any())

    def _add_lamps(self, light: Light, rows: Rows, surfaces: Surfaces) -> None:
        """Put the direct light of the luminaires before that of sky, sun and ground."""
        lamps = {
            group: rows.gather(surfaces.emitted_by(self.scene, group)) for group in self.lamp_groups
        }
        light.direct = {**lamps, **light.direct}

    def _add_dome(
        self,
        light: Light,
        receivers: Receivers,
        budget: Budget,
        sees_out: bool,
        stage: str | None,
        scanned: FloatArray | None = None,
    ) -> None:
        """Add the direct light of sky, sun and ground.

        Sky and ground are traced by pyramids unless ``scanned`` (m, 5) tells what the meridians of
        `form_factor_matrix` saw of them.
        """
        scene, stages, trace = self.scene, self.stages, self.trace
        eps = budget.sensor_dome_cell_eps
        if self.panes.any and sees_out:
            self._add_glazed_dome(light, receivers, budget, stage, scanned)
            return
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
            if not sees_out and self.stages.skipped.get("visibility") != "switched off":
                stages.skipped[name] = "nothing sees out of the scene"
                light.direct[name] = np.zeros((len(receivers.nodes), self.bands))
                continue
            color = np.ones(1) if self.bands == 1 else cct_to_rgb(cct)
            if scanned is not None and name != "sun":
                column, spread = (0, 3) if name == "sky" else (2, 4)
                brightness = np.pi * (1.0 if isinstance(luminance, CIESky) else luminance)
                light.direct[name] = brightness * scanned[:, column, None] * color
                light.variance += brightness**2 * scanned[:, spread]
                continue
            with stages.run(stage or name) as tell:
                found = gather(
                    receivers.nodes,
                    receivers.normals,
                    receivers.weights,
                    cells,
                    luminance,
                    self.blockers,
                    eps=budget.eps,
                    cell_eps=cell_eps,
                    trace=trace,
                    progress=tell,
                )
            stages.count(found.counters)
            light.direct[name] = found.illuminance[:, None] * color
            light.variance += found.deviation**2
            if name != "sun":
                light.outside += found.factor
                light.outside_variance += found.factor_variance

    def _add_glazed_dome(
        self,
        light: Light,
        receivers: Receivers,
        budget: Budget,
        stage: str | None,
        scanned: FloatArray | None,
    ) -> None:
        """The same in a scene with panes."""
        with self.stages.run(stage or "light through panes") as tell:
            found = self.panes.daylight(receivers, budget, scanned, tell)
        sky, sun = self.scene.sky, self.scene.sun
        ccts = {"sky": sky and sky.cct_k, "sun": sun and sun.cct_k}
        for name, lux in found.illuminance.items():
            cct = ccts.get(name) or ccts["sky"] or 5500.0
            color = np.ones(1) if self.bands == 1 else cct_to_rgb(cct)
            light.direct[name] = lux[:, None] * color
        light.variance += found.variance
        light.outside += found.outside
        light.outside_variance += found.outside_variance
