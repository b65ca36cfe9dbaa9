"""Light on one mesh: form factors, direct light, interreflection, and the gather at sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .budget import Budget
from .dome import gather
from .dome_jobs import dome_jobs
from .exchange import Rows, Scan, make_sources
from .highlights import Highlights
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .mesher import Mesher
from .mirror_light import MirrorLight
from .model.arrays import FloatArray, MatrixArray
from .model.result import luminous
from .model.scene import SceneData
from .model.sky import CIESky
from .model.views import Sensors
from .radiosity import solve_radiosity
from .row_finder import FINE_SHARE, Ask, RowFinder
from .sights import with_sights
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
        self.in_cavity = is_single(blockers, blockers.hollow)
        self._factors = RowFinder(scene, blockers, trace=trace, stages=stages)
        self._mesher = Mesher(scene, blockers, trace=trace, stages=stages)
        self.bands = 1 if scene.is_grey else 3
        self.lamp_groups = list(dict.fromkeys(lamp.group for lamp in scene.luminaires))
        self.webs = WebField(scene, blockers, trace=trace, stages=stages)
        self.mirrors = MirrorLight(scene, blockers, self.webs, self.bands, stages)
        self.highlights = Highlights(scene, self.mirrors, self.webs, trace=trace, stages=stages)

    def solve(self, budget: Budget, *, name: str | None = None) -> Field:
        """Solve on the mesh of ``budget``; one stage of that ``name``, or several of their own."""
        with self.stages.run(name or "elements"):
            elements, misplaced = self._mesher.elements(budget)
            surfaces = Surfaces.of(self.scene, elements, self.bands)
            sources, lifts = self._sources(budget, surfaces)
        receivers = Receivers.of_elements(elements)
        with self.stages.run(name or "form factors") as tell:
            asked = Ask(budget, receivers, sources, lifts)
            rows = self._factors.rows(asked, tell)
            sees_out = self._sees_out(rows, surfaces.areas > 0.0)
            row_sums = self._factors.close(rows, 1.0, asked, outside=sees_out)
        light = Light({}, *np.zeros((3, len(elements))))
        scanned = rows.outside if self.trace else None
        self._add_dome(light, receivers, budget, sees_out, name, scanned)
        self._add_lamps(light, rows, surfaces)
        light.variance += self.webs.add(light.direct, rows, surfaces, asked, stage=name)
        mirrored = self.mirrors.add(light, rows, surfaces, asked, sees_out, stage=name)
        if mirrored is not None:
            mirrored.into(rows)
        with self.stages.run(name or "radiosity"):
            reflected, products = solve_radiosity(
                rows.factors, surfaces.reflectance, light.direct, accuracy=budget.accuracy
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
        self._add_lamps(light, rows, field.surfaces)
        light.variance += self.webs.add(light.direct, rows, field.surfaces, asked, fine=True)
        seen = self.highlights.seen(rows, field)
        mirrored = self.mirrors.add(light, rows, field.surfaces, asked, field.sees_out, fine=True)
        if mirrored is not None:
            mirrored.into(rows)
        gathered = self._gathered(light, rows, field.surfaces, field.reflected)
        return self.highlights.added(gathered, grid, seen, field, budget)

    def gather_indirect(self, grid: Sensors, budget: Budget, field: Field) -> FloatArray:
        """Indirect illuminance (m,) alone, for comparing meshes. [lx]"""
        with self.stages.run("mesh check") as tell:
            asked = Ask(budget, Receivers.of_sensors(grid), field.sources)
            rows = self._factors.rows(asked, tell)
            if self.mirrors.any:
                how = {"fine": True, "lamps": False}
                self.mirrors.reflect(rows, field.surfaces, asked, **how).into(rows)
        return luminous(rows.gather(field.all_reflected)) + self.highlights.known(grid)

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
        emitted = luminous(surfaces.emitted)
        mean = float(emitted @ surfaces.areas) / float(surfaces.areas.sum())
        cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
        cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
        cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
        nets = self.scene.patches.control_points
        if not self.trace:
            return make_sources(surfaces.elements, nets, cell_eps), np.zeros(len(emitted))
        facets, lifts = make_facets(
            surfaces.elements, nets, self.blockers.closed, self.blockers.solid
        )
        bright = emitted > BRIGHT * mean
        facets = with_sights(facets, surfaces.elements, self.blockers.solid, bright, budget.sights)
        exact_above = np.full(len(emitted), budget.exact_above)
        # As much light as an element of mean brightness sends at the threshold.
        told = np.diff(facets.sight_start) > 0
        exact_above[~told] *= cell_eps[~told] / budget.cell_eps
        scan = Scan(facets, budget.lines, exact_above, POINT_SHARE * budget.eps)
        return make_sources(surfaces.elements, nets, cell_eps, scan), lifts

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
        for name, cells, luminance, cell_eps, color in dome_jobs(scene, budget, self.bands):
            if not sees_out and self.stages.skipped.get("visibility") != "switched off":
                stages.skipped[name] = "nothing sees out of the scene"
                light.direct[name] = np.zeros((len(receivers.nodes), self.bands))
                continue
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
