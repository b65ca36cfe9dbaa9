"""Light on one mesh: form factors, direct light, interreflection, and the gather at sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .budget import EXACT_AT_SENSORS, Budget
from .containment import Containment
from .exchange import OUTSIDE, ROUNDING, Rows, Scan, make_sources
from .exchange import products as multiplied
from .fineness import Fineness
from .highlights import Highlights
from .incident import Gathered, Incidence, Light
from .iterated import Finer, finer_light, weights_at
from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .large_rows import LEAST_ROWS, find_packed
from .mean_light import MeanLight, by_rays
from .memory import BLOCK_BYTES, PAIR_BYTES, is_packed
from .mesh import Boxes
from .mesh_error import doubt_at
from .mesher import Mesher
from .mirror_light import MirrorLight
from .mirrors import Reflections
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.elements import Elements
from .model.result import luminous
from .model.scene import SceneData
from .model.views import Sensors
from .moved import Changed
from .moved_elements import kept_elements
from .pane_field import PaneField
from .radiosity import RadiositySystem
from .renewed import renewed_rows
from .reuse import Kept, Mesh
from .row_finder import FINE_SHARE, Ask, RowFinder
from .rule_error import OF_RULES, rule_error
from .shut_in import Hidden, hide, same_hidden, shut_in
from .sights import unsighted, with_sights
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .tables import make_facets, meridians
from .topology import is_single
from .unknowns import Unknowns

#: Size of sampled cells at sensors against those between surfaces.
SENSOR_SHARE = 0.1
#: Exitance of elements told by lines of sight, against the mean of all surfaces.
BRIGHT = 4.0
#: Error of factors told by one point against that of other unoccluded factors: it has either sign,
#: and few elements come near to it.
POINT_SHARE = 2.5
#: The same of large meshes, whose elements pave what is far off: errors of neighbours cancel.
POINT_SHARE_OF_MANY = 25.0
#: Share of rows above which the others are closed once more with them: these do so already, and to
#: part them takes longer.
NEARLY_ALL = 0.75
#: Elements of large meshes get the light of lamps at many points down to this share of the aimed
#: size.
AVERAGED = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A scene solved on one mesh.

    Attributes
    ----------
    surfaces : Surfaces
        The elements and their optical state.
    sources : Sources
        The elements as the kernels see them, those of panes apart.
    every : Sources
        All of them, to divide their form factors among the unknowns.
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
    sees_out, lamps_see_out : bool
        Whether light can leave the scene, and whether that of lamps can on its first way.
    hidden : (n,) bool array or None
        Elements that no light reaches, if there are any.
    arriving : Gathered
        Light on the unknowns.
    sent : dict of (N, b) arrays
        Reflected exitance of the unknowns by light group. [lm/m²]
    fineness : Fineness
        Of the sources.
    """

    surfaces: Surfaces
    sources: Sources
    every: Sources
    lifts: FloatArray
    unknowns: Unknowns
    system: RadiositySystem
    row_sums: FloatArray
    kept: FloatArray
    sees_out: bool
    lamps_see_out: bool
    hidden: Hidden
    arriving: Gathered
    sent: dict[str, FloatArray]
    fineness: Fineness

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

    @property
    def factors(self) -> list[MatrixArray]:
        """Form factors (m, n) of the elements, and those by way of mirrors, if there are any."""
        return [self.rows.factors, *([] if self.mirrored is None else [self.mirrored.rows])]


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
        self._all_flat = bool((blockers.flags & PLANAR != 0).all())
        exact = horizon.is_plain and self._all_flat
        self._under_sky = None if exact else self._factors.rows
        self.bands, self.webs = self._incidence.bands, self._incidence.webs
        self.lamp_groups = self._incidence.lamp_groups
        # A cavity hides nothing, but ends light.
        ends = trace or self.in_cavity
        self.mirrors = MirrorLight(
            scene, blockers, self.webs, self.bands, trace=ends, kept=self.kept
        )
        self.highlights = Highlights(scene, self.mirrors, self.webs, trace=trace, stages=stages)

    def solve(self, budget: Budget, boxes: Boxes) -> Field:
        """Solve on elements over ``boxes``."""
        with self.stages.run("elements"):
            elements = kept_elements(self.kept, self.mesher, budget, boxes)
            surfaces = Surfaces.of(self.scene, elements, self.bands)
            fineness = self._fineness(budget, surfaces)
            if self.mesh_before is not None:
                fineness = self.mesh_before.fine_enough(boxes, fineness)
            sources, lifts = self.kept.find(
                "sources",
                (budget, boxes, fineness),
                lambda: self._sources(budget, elements, fineness),
            )
            unknowns = self.panes.in_the_open(Unknowns.of(elements, budget.basis), elements)
        of = unknowns.element
        with self.stages.run("form factors") as tell:
            told = budget.is_large and self.trace and by_rays(self.scene)
            asked = Ask(
                budget, unknowns.receivers, unsighted(sources) if told else sources, lifts[of]
            )
            every = self.panes.with_panes(sources, elements)
            rows: Rows
            hidden, lamps = None, surfaces.lamp >= 0
            straight = not (self.panes.any or self.mirrors.any)
            if straight and is_packed(len(unknowns), len(elements)):
                known = asked, surfaces, unknowns, self._sees_out, tell
                rows, sees_out, raw = find_packed(self._factors, *known)
                factors = rows.factors
            else:

                def find() -> tuple[Rows, bool, FloatArray, Hidden]:
                    rows = self._factors.rows(asked, tell)
                    sees_out = self._sees_out(rows, unknowns.areas > 0.0)
                    hidden = self._shut_in(rows, unknowns, lamps)
                    if hidden is not None:
                        hide(rows, hidden)
                    of = replace(asked, hidden=hidden)
                    raw = self._factors.close(rows, 1.0, of, outside=sees_out)
                    return rows, sees_out, raw, hidden

                def renew(
                    old: tuple[Rows, bool, FloatArray, Hidden], changed: Changed
                ) -> tuple[Rows, bool, FloatArray, Hidden] | None:
                    now, out = self._renewed(old[0], asked, changed, tell), old[1]
                    if now is None or self._sees_out(now, unknowns.areas > 0.0) != out:
                        return None
                    hidden = self._shut_in(now, unknowns, lamps)
                    if not same_hidden(hidden, old[3]):
                        return None  # what is moved shuts in more, or less
                    if hidden is not None:
                        hide(now, hidden)
                    raw, at = old[2].copy(), np.flatnonzero(changed.again)
                    of = replace(asked, hidden=hidden)
                    raw[at] = self._close_again(now, at, of, 1.0, outside=out)
                    return now, out, raw, hidden

                rows, sees_out, raw, hidden = self.kept.rows(
                    "form factors",
                    asked,
                    (lamps,),
                    find,
                    self._under_sky,
                    renew,
                    sees_out=lambda old: old[1],
                )
                if self.trace and not self.panes.any:
                    shut = 0 if hidden is None else int(hidden.sum())
                    self.stages.counters["elements_shut_in"] = shut
                rows = self._through_panes(rows, asked, surfaces, mesh=unknowns.basis is None)
                factors = self.kept.factors(unknowns, rows, replace(asked, sources=every))
        lamps_see_out = sees_out and self._sees_out(rows, lamps[of] & (unknowns.areas > 0.0))
        light = self._incidence.on(asked, rows, surfaces, unknowns, sees_out=sees_out)
        if told and self.lamp_groups:
            with self.stages.run("direct light"):
                means = MeanLight(self.scene, self.blockers)
                means.put(light.direct, surfaces, unknowns, (AVERAGED * budget.size) ** 2)
        mirrored = self.mirrors.add(light, rows, surfaces, asked, sees_out)
        if mirrored is not None:
            shared = factors is rows.factors or self.kept.store is not None
            factors = factors.copy() if shared else factors
            unknowns.add_evenly(factors, mirrored.rows)
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
            every=every,
            lifts=lifts,
            unknowns=unknowns,
            system=system,
            row_sums=unknowns.mean(raw),
            kept=self.mirrors.kept(rows, mirrored, surfaces),
            sees_out=sees_out,
            lamps_see_out=lamps_see_out,
            hidden=hidden,
            arriving=Gathered.of(light, indirect, variance_of(rows, mirrored, luminous(exitance))),
            sent=sent,
            fineness=fineness,
        )

    def finer(self, field: Field, budget: Budget, seen: list[SensorRows]) -> Finer:
        """Its light known more finely, where it matters for the sensors; see `iterated`."""
        weights = weights_at([f for s in seen for f in s.factors], field.surfaces.areas)
        with self.stages.run("iterated gather"):
            before = None if self.mesh_before is None else self.mesh_before.halved
            gather = partial(self.light_at, budget=budget, field=field)
            lamps = self._flux_of_lamps(field), budget.eps
            count = budget.gathered(len(field.unknowns)), budget.left_out
            finer = finer_light(field, weights, gather, lamps, count, before)
        self.stages.figures["lamp_flux_put_right"] = finer.put_right
        self.stages.count({"unknowns_checked": len(finer.unknowns) - len(field.unknowns)})
        return finer

    def _flux_of_lamps(self, field: Field) -> dict[str, FloatArray]:
        """What lamps (b,) send to the scene, by light group, where form factors alone tell. [lm]"""
        if self.panes.any or self.mirrors.any or field.lamps_see_out:
            return {}  # what share of it meets the scene is not known so well
        surfaces, scene = field.surfaces, self.scene
        kept = surfaces.areas * field.unknowns.mean(field.kept)
        other = {lamp.group for lamp in scene.luminaires if lamp.web or lamp.profile}
        return {
            group: kept @ surfaces.emitted_by(scene, group)
            for group in self.lamp_groups
            if group not in other
        }

    def light_at(self, some: Unknowns, budget: Budget, field: Field) -> tuple[Gathered, FloatArray]:
        """Light at other points of the surfaces, found as that of the unknowns is.

        Also the sums (k,) of their rows. No more rows are held at a time than a block takes.
        """
        step = max(LEAST_ROWS, BLOCK_BYTES // (PAIR_BYTES * len(field.sources.nets)))
        if not budget.is_large or len(some) <= step:
            return self._light_at(some, budget, field)
        blocks = [np.arange(k, min(k + step, len(some))) for k in range(0, len(some), step)]
        parts = [self._light_at(some.take(rows), budget, field) for rows in blocks]
        lights, sums = zip(*parts, strict=True)
        return Gathered.joined(lights), np.concatenate(sums)

    def _light_at(
        self, some: Unknowns, budget: Budget, field: Field
    ) -> tuple[Gathered, FloatArray]:
        lifts = field.lifts[some.element]
        asked = Ask(budget, some.receivers, field.sources, lifts, hidden=field.hidden)

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
            "iterated gather",
            asked,
            (field.sees_out, field.hidden),
            find,
            self._under_sky,
            renew,
            sees_out=lambda old: field.sees_out,
        )
        rows = self._through_panes(rows, asked, field.surfaces)
        light = self._incidence.on(asked, rows, field.surfaces, some, sees_out=field.sees_out)
        mirrored = self.mirrors.add(light, rows, field.surfaces, asked, field.sees_out)
        columns = [*field.sent.values()]
        indirect = self._gathered(rows, mirrored, asked, field.every, field.unknowns, columns)
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
            exact_above=np.where(
                field.fineness.bright,
                sources.cell_eps * (EXACT_AT_SENSORS * budget.accuracy / budget.cell_eps),
                sources.cell_eps * (budget.sensor_exact_above / budget.cell_eps),
            ),
            azimuths=meridians(budget.sensor_lines if len(sources.azimuths) else 0),
            point_from=np.full_like(sources.point_from, np.inf),
        )
        if field.surfaces.emission is not None:
            # Which part of a lamp is hidden counts where its parts differ.
            fine.exact_above[field.surfaces.emission.element] = 0.0
        light = self._incidence.from_outside(receivers, budget, field.sees_out)
        closed = not field.sees_out or {"sky", "ground"} <= set(light.direct)
        with self.stages.run("sensors") as tell:
            asked = Ask(budget, receivers, fine, share=FINE_SHARE, hidden=field.hidden)

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
                "sensors",
                asked,
                (closed, field.hidden),
                find,
                renew=renew,
                sees_out=lambda old: field.sees_out,
                which=grid.name,
            )
        rows = self._through_panes(rows, asked, field.surfaces)
        self._incidence.add_lamps(light, asked, rows, field.surfaces)
        mirrored = self.mirrors.add(light, rows, field.surfaces, asked, field.sees_out, fine=True)
        return SensorRows(asked, rows, light, mirrored)

    def gather(
        self, grid: Sensors, seen: SensorRows, field: Field, finer: Finer
    ) -> tuple[Gathered, FloatArray, FloatArray]:
        """Light at sensors, how far (m,) its indirect part may be wrong by the mesh, and by rules.

        All in lx.
        """
        asked, columns = seen.asked, [*finer.sent.values(), finer.change]
        with self.stages.run("sensors"):
            every, unknowns = field.every, finer.unknowns
            found = self._gathered(seen.rows, seen.mirrored, asked, every, unknowns, columns)
        *parts, change = found
        indirect = dict(zip(finer.sent, parts, strict=True))
        variance = variance_of(seen.rows, seen.mirrored, luminous(field.exitance_told))
        light = Gathered.of(seen.light, indirect, variance)
        light = self.highlights.added(light, grid, seen.rows, field, finer, asked.budget)
        elements, far = field.surfaces.elements, asked.budget.far
        doubt = doubt_at(grid.points, seen.rows.factors, elements, finer, luminous(change), far)
        return light, doubt, self._rules(seen, field, light)

    def _rules(self, seen: SensorRows, field: Field, light: Gathered) -> FloatArray:
        """Error (m,) that the rules for unoccluded factors leave in the light of sensors. [lx]"""
        asked, sent = seen.asked, luminous(field.exitance_told)
        eps = self._factors.eps(asked)
        error, told = rule_error(seen.rows, asked, self.blockers, eps, sent, self.kept)
        rest = light.luminous() - told
        if self._all_flat and not self.panes.any:
            # Past flat surfaces sky and ground are integrated to the error counted as sampled.
            for name in ("sky.direct", "ground.direct"):
                rest -= luminous(light.components.get(name, np.zeros((len(told), self.bands))))
        rules = OF_RULES * FINE_SHARE * asked.budget.eps + ROUNDING
        return np.asarray(error + rules * np.maximum(rest, 0.0))

    def outside(self, receivers: Receivers, budget: Budget) -> Light:
        """Direct light of sky, sun and ground on any receivers, as at sensors."""
        return self._incidence.from_outside(receivers, budget, not self.in_cavity)

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
            leaves &= rows.outside[lit, 1] + rows.outside[lit, 2] > OUTSIDE
        return bool(leaves.any())

    def _shut_in(self, rows: Rows, unknowns: Unknowns, lamps: NDArray[np.bool_]) -> Hidden:
        """Elements that no light reaches; None where it reaches all."""
        if not self.trace or self.panes.any:
            return None
        hidden = shut_in(rows, unknowns, lamps)
        return hidden if hidden.any() else None

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
        if asked.hidden is not None:
            hide(found, asked.hidden)
        return found

    def _close_again(
        self, rows: Rows, at: IntArray, asked: Ask, totals: FloatArray | float, **how: Any
    ) -> FloatArray:
        """Close some of the ``rows``, in place; see `RowFinder.close`."""
        count = len(rows.factors)
        if len(at) == count or (np.ndim(totals) == 0 and len(at) > NEARLY_ALL * count):
            return self._factors.close(rows, totals, asked, **how)[at]
        part = rows.take(at)
        sums = self._factors.close(part, totals, asked.taken(at), **how)
        rows.put(at, part)
        return sums

    def _gathered(
        self,
        rows: Rows,
        mirrored: Reflections | None,
        asked: Ask,
        every: Sources,
        unknowns: Unknowns,
        sent: list[FloatArray],
    ) -> list[FloatArray]:
        """Light (m, b), straight and by mirrors, of each of ``sent`` (N, b) by the unknowns."""
        columns = np.concatenate(sent, axis=1)
        found = self.kept.gather(unknowns, rows, replace(asked, sources=every), columns)
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

    def _fineness(self, budget: Budget, surfaces: Surfaces) -> Fineness:
        """How finely each source is told: the brighter one is, the finer."""
        count = len(self.panes.opaque(surfaces.elements))
        emitted, areas = (a[:count] for a in (luminous(surfaces.emitted), surfaces.areas))
        # What all there is would get of the lamps' light, or a box about it where most escapes.
        mean = float(emitted @ areas) / max(float(areas.sum()), self._box_area)
        dim = np.minimum(mean / np.maximum(emitted, max(mean, 1e-300)), 1.0)
        cell_eps = budget.cell_eps * mean / np.maximum(emitted, max(mean, 1e-300))
        cell_eps = np.where(emitted > 0.0, cell_eps, budget.cell_eps)
        cell_eps = np.clip(cell_eps, budget.lamp_cell_eps, budget.cell_eps)
        return Fineness(cell_eps, emitted > BRIGHT * mean, dim)

    @property
    def _box_area(self) -> float:
        """Surface of the box about all patches and sensors. [m²]"""
        ends = [self.scene.patches.bounds(), *((g.points, g.points) for g in self.scene.sensors)]
        low = np.min([np.min(np.atleast_2d(a), axis=0) for a, _ in ends], axis=0)
        high = np.max([np.max(np.atleast_2d(b), axis=0) for _, b in ends], axis=0)
        x, y, z = high - low
        return float(2.0 * (x * y + y * z + z * x))

    def _sources(
        self, budget: Budget, elements: Elements, fineness: Fineness
    ) -> tuple[Sources, FloatArray]:
        """Elements as sources, and how far their facets leave them.

        The finer cells of one are cut, the weaker are the pairs that are traced.
        """
        nets, opaque = self.scene.patches.control_points, self.panes.opaque(elements)
        if not self.trace:
            sources = make_sources(opaque, nets, fineness.cell_eps, dim=fineness.dim)
            return sources, np.zeros(len(elements))
        of = nets, self.blockers.closed, self.blockers.solid
        facets, lifts = make_facets(opaque, *of, budget.size if budget.is_large else 0.0)
        facets = with_sights(facets, opaque, self.blockers.solid, fineness.bright, budget.sights)
        cell_eps = fineness.cell_eps
        exact_above = np.full(len(cell_eps), budget.exact_above)
        # As much light as an element of mean brightness sends at the threshold.
        told = np.diff(facets.sight_start) > 0
        exact_above[~told] *= cell_eps[~told] / budget.cell_eps
        share = POINT_SHARE_OF_MANY if budget.is_large else POINT_SHARE
        scan = Scan(facets, budget.lines, exact_above, share * budget.eps)
        sources = make_sources(opaque, nets, cell_eps, scan, fineness.dim)
        return sources, self.panes.lifts(lifts, elements)


def variance_of(rows: Rows, mirrored: Reflections | None, sent: FloatArray) -> FloatArray:
    """Variance (m,) of what rows, and mirrors, gather when the elements send ``sent`` (n,)."""
    found = rows.variance_of(sent)
    return found if mirrored is None else found + multiplied(mirrored.variances, sent**2)
