"""Light on one mesh: form factors, direct light, interreflection, and the gather at sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .budget import Budget
from .containment import Containment
from .exchange import Rows, Scan, make_sources
from .exchange import products as multiplied
from .highlights import Highlights
from .incident import Gathered, Incidence, Light
from .iterated import Finer, finer_light, weights_at
from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .large_rows import find_packed
from .memory import is_packed
from .mesh import Boxes
from .mesher import Mesher
from .mirror_light import MirrorLight
from .mirrors import Reflections
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.result import luminous
from .model.scene import SceneData
from .model.views import Sensors
from .moved import Changed
from .pane_field import PaneField
from .radiosity import RadiositySystem
from .renewed import renewed_rows
from .reuse import Kept, Mesh
from .row_finder import FINE_SHARE, Ask, RowFinder
from .sights import with_sights
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .tables import make_facets, meridians
from .topology import is_single
from .unknowns import Unknowns

#: Size of sampled cells at sensors against those between surfaces.
SENSOR_SHARE = 0.1
#: The same for the form factors above which pairs are traced.
SENSOR_EXACT = 0.025
#: Exitance of elements told by lines of sight, against the mean of all surfaces.
BRIGHT = 4.0
#: Error of factors told by one point against that of other unoccluded factors: it has either sign,
#: and few elements come near to it.
POINT_SHARE = 2.5


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A scene solved on one mesh.

    Attributes
    ----------
    surfaces : Surfaces
        The elements and their optical state.
    sources : Sources
        The elements as the kernels see them.
    lifts : (n,) array
        How far facets may lie before them. [m]
    unknowns : Unknowns
        What their reflected light is made of.
    system : RadiositySystem
        Reflection between the unknowns.
    row_sums : (n,) array
        Raw sums of those of the elements, before any correction.
    kept : (N,) array
        Sums of those of the unknowns.
    sees_out : bool
        Whether light can leave the scene.
    arriving : Gathered
        Light on the unknowns.
    sent : dict of (N, b) arrays
        Reflected exitance of the unknowns by light group. [lm/m²]
    cell_eps : (k,) array
        Form factor below which a partly hidden cell of each source is sampled.
    bright : (k,) bool array
        Sources that are told by lines of sight.
    misplaced : float
        Share of the reflected light that the elements have in the wrong place.
    """

    surfaces: Surfaces
    sources: Sources
    lifts: FloatArray
    unknowns: Unknowns
    system: RadiositySystem
    row_sums: FloatArray
    kept: FloatArray
    sees_out: bool
    arriving: Gathered
    sent: dict[str, FloatArray]
    cell_eps: FloatArray
    bright: NDArray[np.bool_]
    misplaced: float = 0.0

    @property
    def all_sent(self) -> FloatArray:
        """Reflected exitance (N, b) of the unknowns, of all groups. [lm/m²]"""
        nothing = np.zeros((len(self.unknowns), self.surfaces.emitted.shape[1]))
        return np.asarray(sum(self.sent.values(), nothing))

    @property
    def exitance_told(self) -> FloatArray:
        """Exitance (n, b) of the elements that form factors carry: webs are none of it. [lm/m²]"""
        return np.asarray(self.surfaces.diffuse + self.unknowns.mean(self.all_sent))


@dataclass(frozen=True, slots=True, eq=False)
class SensorRows:
    """What the sensors of one grid see: rows to the elements, direct light, and mirrors."""

    asked: Ask
    rows: Rows
    light: Light
    mirrored: Reflections | None


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
    tester : Containment, optional
        Of the scene; made here where there is none yet.
    kept : Kept, optional
        What runs before this one have found; nothing when not given.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        *,
        trace: bool,
        stages: Stages,
        tester: Containment | None = None,
        kept: Kept | None = None,
    ) -> None:
        self.kept = Kept(scene, stages=stages) if kept is None else kept
        #: Of a run before this one, where it is taken again.
        self.mesh_before: Mesh | None = None
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self.panes = PaneField(scene, blockers, trace=trace, stages=stages)
        #: All there is is one convex cavity.
        self.in_cavity = is_single(blockers, blockers.hollow) and not self.panes.any
        self._factors = RowFinder(scene, blockers, trace=trace, stages=stages)
        self._incidence = Incidence(
            scene, blockers, self.panes, trace=trace, stages=stages, kept=self.kept
        )
        self.mesher = Mesher(
            scene, blockers, trace=trace, stages=stages, tester=tester, kept=self.kept
        )
        # Where the sky is told exactly, what the meridians see of it does not count.
        horizon = self._incidence.horizon
        exact = horizon.is_plain and bool((blockers.flags & PLANAR != 0).all())
        self._under_sky = None if exact else self._factors.rows
        self.bands, self.webs = self._incidence.bands, self._incidence.webs
        self.lamp_groups = self._incidence.lamp_groups
        self.mirrors = MirrorLight(scene, blockers, self.webs, self.bands, self.kept)
        self.highlights = Highlights(scene, self.mirrors, self.webs, trace=trace, stages=stages)

    def solve(self, budget: Budget, boxes: Boxes, misplaced: float = 0.0) -> Field:
        """Solve on elements over ``boxes``, which have that share of reflected light misplaced."""
        with self.stages.run("elements"):
            elements = self.kept.find(
                "elements", (budget, boxes), lambda: self.mesher.elements(budget, boxes)
            )
            surfaces = Surfaces.of(self.scene, elements, self.bands)
            cell_eps, bright = self._tolerances(budget, surfaces)
            if self.mesh_before is not None:
                cell_eps, bright = self.mesh_before.tolerances(boxes, cell_eps, bright)
            sources, lifts = self.kept.find(
                "sources",
                (budget, boxes, cell_eps, bright),
                lambda: self._sources(budget, elements, cell_eps, bright),
            )
            unknowns = self.panes.in_the_open(Unknowns.of(elements, budget.basis), elements)
        of = unknowns.element
        with self.stages.run("form factors") as tell:
            asked = Ask(budget, unknowns.receivers, sources, lifts[of])
            rows: Rows
            by_elements = unknowns.basis is None and not (self.panes.any or self.mirrors.any)
            if by_elements and is_packed(len(unknowns), len(elements)):
                found = find_packed(self._factors, asked, surfaces, self._sees_out, tell)
                rows, sees_out, raw = found
            else:

                def find() -> tuple[Rows, bool, FloatArray]:
                    rows = self._factors.rows(asked, tell)
                    sees_out = self._sees_out(rows, unknowns.areas > 0.0)
                    return rows, sees_out, self._factors.close(rows, 1.0, asked, outside=sees_out)

                def renew(
                    old: tuple[Rows, bool, FloatArray], changed: Changed
                ) -> tuple[Rows, bool, FloatArray] | None:
                    now, out = self._renewed(old[0], asked, changed, tell), old[1]
                    if now is None or self._sees_out(now, unknowns.areas > 0.0) != out:
                        return None
                    raw, at = old[2].copy(), np.flatnonzero(changed.again)
                    raw[at] = self._close_again(now, at, asked, 1.0, outside=out)
                    return now, out, raw

                rows, sees_out, raw = self.kept.rows(
                    "form factors", asked, (), find, self._under_sky, renew
                )
                rows = self._through_panes(rows, asked, surfaces, mesh=True)
            factors = self.kept.factors(unknowns, rows, asked)
        light = self._incidence.on(asked, rows, surfaces, unknowns, sees_out=sees_out)
        mirrored = self.mirrors.add(light, rows, surfaces, asked, sees_out)
        if mirrored is not None:
            factors = factors + unknowns.evenly(mirrored.rows)
        with self.stages.run("radiosity"):
            rho = surfaces.reflectance[of]
            system = RadiositySystem(
                factors,
                rho,
                accuracy=budget.accuracy,
                scattering=self.panes.scattering(surfaces),
            )
            sent = system.solve(light.direct)
            indirect = {group: multiplied(factors, values) for group, values in sent.items()}
        self.stages.figures["spectral_radius"] = system.radius
        self.stages.count({"matrix_products": system.products})
        exitance = surfaces.diffuse + sum(unknowns.mean(values) for values in sent.values())
        return Field(
            surfaces=surfaces,
            sources=sources,
            lifts=lifts,
            unknowns=unknowns,
            system=system,
            row_sums=unknowns.mean(raw),
            kept=self.mirrors.kept(rows, mirrored, surfaces),
            sees_out=sees_out,
            arriving=Gathered.of(light, indirect, variance_of(rows, mirrored, luminous(exitance))),
            sent=sent,
            cell_eps=cell_eps,
            bright=bright,
            misplaced=misplaced,
        )

    def finer(self, field: Field, budget: Budget, seen: list[SensorRows]) -> Finer:
        """Its light known more finely, where it matters for the sensors; see `iterated`."""
        weights = weights_at([s.rows.factors for s in seen], field.surfaces.areas)
        with self.stages.run("iterated gather"):
            before = None if self.mesh_before is None else self.mesh_before.halved
            finer = finer_light(
                field, weights, lambda some: self.light_at(some, budget, field), before
            )
        self.stages.count({"unknowns_checked": len(finer.unknowns) - len(field.unknowns)})
        return finer

    def light_at(self, some: Unknowns, budget: Budget, field: Field) -> tuple[Gathered, FloatArray]:
        """Light at other points of the surfaces, found as that of the unknowns is.

        Also the sums (k,) of their rows.
        """
        asked = Ask(budget, some.receivers, field.sources, field.lifts[some.element])

        def find() -> tuple[Rows]:
            rows = self._factors.rows(asked)
            self._factors.close(rows, 1.0, asked, outside=field.sees_out)
            return (rows,)

        def renew(old: tuple[Rows], changed: Changed) -> tuple[Rows] | None:
            now = self._renewed(old[0], asked, changed)
            if now is None:
                return None
            at = np.flatnonzero(changed.again)
            self._close_again(now, at, asked, 1.0, outside=field.sees_out)
            return (now,)

        (rows,) = self.kept.rows(
            "iterated gather", asked, (field.sees_out,), find, self._under_sky, renew
        )
        rows = self._through_panes(rows, asked, field.surfaces)
        light = self._incidence.on(asked, rows, field.surfaces, some, sees_out=field.sees_out)
        mirrored = self.mirrors.add(light, rows, field.surfaces, asked, field.sees_out)
        indirect = self._gathered(rows, mirrored, asked, field.unknowns, [*field.sent.values()])
        variance = variance_of(rows, mirrored, luminous(field.exitance_told))
        found = Gathered.of(light, dict(zip(field.sent, indirect, strict=True)), variance)
        return found, self.mirrors.kept(rows, mirrored, field.surfaces)

    def seen(self, grid: Sensors, budget: Budget, field: Field) -> SensorRows:
        """What sensors see, and direct light at the sensors themselves."""
        receivers = Receivers.of_sensors(grid)
        # No average over nodes and bounces hides the sampling of a single sensor.
        sources = field.sources
        fine = sources._replace(
            cell_eps=sources.cell_eps * SENSOR_SHARE,
            exact_above=sources.cell_eps * (SENSOR_EXACT * budget.exact_above / budget.cell_eps),
            azimuths=meridians(budget.sensor_lines if len(sources.azimuths) else 0),
            point_from=np.full_like(sources.point_from, np.inf),
        )
        if field.surfaces.emission is not None:
            # Which part of a lamp is hidden counts where its parts differ.
            fine.exact_above[field.surfaces.emission.element] = 0.0
        light = self._incidence.from_outside(receivers, budget, field.sees_out)
        closed = not field.sees_out or {"sky", "ground"} <= set(light.direct)
        with self.stages.run("sensors") as tell:
            asked = Ask(budget, receivers, fine, share=FINE_SHARE)

            def find() -> tuple[Rows]:
                rows = self._factors.rows(asked, tell)
                if closed:
                    totals = 1.0 - light.outside
                    self._factors.close(rows, totals, asked, spread=light.outside_variance)
                return (rows,)

            def renew(old: tuple[Rows], changed: Changed) -> tuple[Rows] | None:
                now, at = self._renewed(old[0], asked, changed, tell), np.flatnonzero(changed.again)
                if now is None:
                    return None
                if closed:
                    totals, spread = 1.0 - light.outside[at], light.outside_variance[at]
                    self._close_again(now, at, asked, totals, spread=spread)
                return (now,)

            (rows,) = self.kept.rows(
                "sensors", asked, (closed,), find, renew=renew, which=grid.name
            )
        rows = self._through_panes(rows, asked, field.surfaces)
        self._incidence.add_lamps(light, asked, rows, field.surfaces)
        mirrored = self.mirrors.add(light, rows, field.surfaces, asked, field.sees_out, fine=True)
        return SensorRows(asked, rows, light, mirrored)

    def gather(
        self, grid: Sensors, seen: SensorRows, field: Field, finer: Finer
    ) -> tuple[Gathered, FloatArray]:
        """Light at sensors, and by how much (m,) the finer light changed the indirect part. [lx]"""
        asked, columns = seen.asked, [*finer.sent.values(), finer.change]
        with self.stages.run("sensors"):
            found = self._gathered(seen.rows, seen.mirrored, asked, finer.unknowns, columns)
        *parts, change = found
        indirect = dict(zip(finer.sent, parts, strict=True))
        variance = variance_of(seen.rows, seen.mirrored, luminous(field.exitance_told))
        light = Gathered.of(seen.light, indirect, variance)
        light = self.highlights.added(light, grid, seen.rows, field, finer, asked.budget)
        return light, np.abs(luminous(change))

    def _sees_out(self, rows: Rows, lit: NDArray[np.bool_]) -> bool:
        """Whether light may leave the scene from ``lit`` rows, beyond what sampling explains."""
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

    def _renewed(
        self,
        rows: Rows,
        asked: Ask,
        changed: Changed,
        tell: Callable[[int, int], None] | None = None,
    ) -> Rows | None:
        """Rows among surfaces that have moved; None where all are to be found anew."""
        if not (self.trace and len(asked.sources.azimuths)):
            return None
        eps = self._factors.eps(asked)
        found = renewed_rows(rows, asked, changed, self.scene, self.blockers, eps=eps, tell=tell)
        self.stages.count(found.counters)
        return found

    def _close_again(
        self, rows: Rows, at: IntArray, asked: Ask, totals: FloatArray | float, **how: Any
    ) -> FloatArray:
        """Close some of the ``rows``, in place; see `RowFinder.close`."""
        if len(at) == len(rows.factors):
            return self._factors.close(rows, totals, asked, **how)
        part = rows.take(at)
        sums = self._factors.close(part, totals, asked.taken(at), **how)
        rows.put(at, part)
        return sums

    def _gathered(
        self,
        rows: Rows,
        mirrored: Reflections | None,
        asked: Ask,
        unknowns: Unknowns,
        sent: list[FloatArray],
    ) -> list[FloatArray]:
        """Light (m, b), straight and by mirrors, of each of ``sent`` (N, b) by the unknowns."""
        columns = np.concatenate(sent, axis=1)
        found = self.kept.gather(unknowns, rows, asked, columns)
        if mirrored is not None:
            found = found + multiplied(mirrored.rows, unknowns.mean(columns))
        return np.split(found, len(sent), axis=1)

    def _through_panes(
        self, rows: Rows, asked: Ask, surfaces: Surfaces, *, mesh: bool = False
    ) -> Rows:
        """Closed rows with what panes keep back and what they send; ``rows`` stay as they are."""
        if not self.panes.any:
            return rows
        of = (surfaces.elements, surfaces.areas)
        glass = self.scene.glazings, self.scene.glass_index, surfaces.elements.boxes

        def complete() -> Rows:
            own = replace(rows, factors=rows.factors.copy(), variances=rows.variances.copy())
            return self.panes.complete(own, asked, *of, mesh=mesh)

        through = self.kept.of_rows("panes", rows, (glass, surfaces.areas, mesh), complete)
        return replace(through, outside=rows.outside)  # of the sky as it is now

    def _tolerances(
        self, budget: Budget, surfaces: Surfaces
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Cells (k,) of the sources, finer the brighter one is, and which are told by sights."""
        count = len(self.panes.opaque(surfaces.elements))
        emitted, areas = (a[:count] for a in (luminous(surfaces.emitted), surfaces.areas))
        mean = float(emitted @ areas) / float(areas.sum())
        cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
        cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
        cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
        return cell_eps, emitted > BRIGHT * mean

    def _sources(
        self, budget: Budget, elements: Elements, cell_eps: FloatArray, bright: NDArray[np.bool_]
    ) -> tuple[Sources, FloatArray]:
        """Elements as sources, and how far their facets leave them.

        The finer cells of one are cut, the weaker are the pairs that are traced.
        """
        nets, opaque = self.scene.patches.control_points, self.panes.opaque(elements)
        if not self.trace:
            sources = make_sources(opaque, nets, cell_eps)
            return sources, np.zeros(len(elements))
        facets, lifts = make_facets(opaque, nets, self.blockers.closed, self.blockers.solid)
        facets = with_sights(facets, opaque, self.blockers.solid, bright, budget.sights)
        exact_above = np.full(len(cell_eps), budget.exact_above)
        # As much light as an element of mean brightness sends at the threshold.
        told = np.diff(facets.sight_start) > 0
        exact_above[~told] *= cell_eps[~told] / budget.cell_eps
        scan = Scan(facets, budget.lines, exact_above, POINT_SHARE * budget.eps)
        sources = make_sources(opaque, nets, cell_eps, scan)
        return sources, self.panes.lifts(lifts, elements)


def variance_of(rows: Rows, mirrored: Reflections | None, sent: FloatArray) -> FloatArray:
    """Variance (m,) of what rows, and mirrors, gather when the elements send ``sent`` (n,)."""
    found = rows.variance_of(sent)
    return found if mirrored is None else found + multiplied(mirrored.variances, sent**2)
