"""Light on one mesh: form factors, direct light, interreflection, and the gather at sensors."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .arrangement import Changed
from .budget import Budget
from .containment import Containment
from .exchange import ROUNDING, Rows
from .exchange import products as multiplied
from .field_rows import FieldRows
from .field_sources import fineness_of, sources_at_sensors, sources_of
from .half_hidden import HalfHidden
from .highlights import Highlights
from .incident import Gathered, Incidence, Light
from .iterated import Finer, finer_light, weights_at
from .kept_mesh import Mesh
from .kept_quadrics import kept_quadrics
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
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.result import luminous
from .model.scene import SceneData
from .model.views import Sensors
from .moved_elements import kept_elements
from .open_sky import OpenSky
from .pane_field import PaneField
from .radiosity import RadiositySystem
from .reuse import Kept
from .row_finder import Ask, RowFinder
from .rule_error import OF_RULES, rule_error
from .shut_in import Hidden, hide, same_hidden
from .sights import unsighted
from .solved_field import Field, SensorRows
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .topology import is_single
from .unknowns import Unknowns

#: What the pyramids' 2 x 2 points in cells of 8° miss of a sky that is brightest at the sun.
PEAKED = 5e-4
#: Elements of large meshes get the light of lamps at many points down to this share of the aimed
#: size.
AVERAGED = 0.25


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
        self.rows = FieldRows(self._factors, self.panes, self.kept, in_cavity=self.in_cavity)
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
        self._half_hidden = HalfHidden(scene, self.kept)
        self.highlights = Highlights(scene, self.mirrors, self.webs, trace=trace, stages=stages)

    def solve(self, budget: Budget, boxes: Boxes) -> Field:
        """Solve on elements over ``boxes``."""
        with self.stages.run("elements"):
            elements = kept_elements(self.kept, self.mesher, budget, boxes)
            surfaces = Surfaces.of(self.scene, elements, self.bands)
            fineness = fineness_of(self.scene, self.panes, budget, surfaces)
            if self.mesh_before is not None:
                fineness = self.mesh_before.fine_enough(boxes, fineness)
            sources, lifts = self.kept.find(
                "sources",
                (budget, boxes, fineness),
                lambda: sources_of(
                    self.scene,
                    self.blockers,
                    self.panes,
                    budget,
                    elements,
                    fineness,
                    kept_quadrics(self.kept, self.blockers),
                    trace=self.trace,
                ),
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
                known = asked, surfaces, unknowns, self.rows.sees_out, tell
                rows, sees_out, raw = find_packed(self._factors, *known)
                factors = rows.factors
            else:

                def find() -> tuple[Rows, bool, FloatArray, Hidden]:
                    rows = self._factors.rows(asked, tell)
                    sees_out = self.rows.sees_out(rows, unknowns.areas > 0.0)
                    hidden = self.rows.shut_in(rows, unknowns, lamps)
                    if hidden is not None:
                        hide(rows, hidden)
                    of = replace(asked, hidden=hidden)
                    raw = self._factors.close(rows, 1.0, of, outside=sees_out)
                    return rows, sees_out, raw, hidden

                def renew(
                    old: tuple[Rows, bool, FloatArray, Hidden], changed: Changed
                ) -> tuple[Rows, bool, FloatArray, Hidden] | None:
                    now, out = self.rows.renewed(old[0], asked, changed, tell), old[1]
                    if now is None or self.rows.sees_out(now, unknowns.areas > 0.0) != out:
                        return None
                    hidden = self.rows.shut_in(now, unknowns, lamps)
                    if not same_hidden(hidden, old[3]):
                        return None  # what is moved shuts in more, or less
                    if hidden is not None:
                        hide(now, hidden, np.flatnonzero(changed.again))
                    raw, at = old[2].copy(), np.flatnonzero(changed.again)
                    of = replace(asked, hidden=hidden)
                    raw[at] = self.rows.close_again(now, at, of, 1.0, outside=out)
                    return now, out, raw, hidden

                rows, sees_out, raw, hidden = self.kept.rows(
                    "form factors",
                    asked,
                    (lamps,),
                    find,
                    self._under_sky,
                    renew,
                    sees_out=lambda old: old[1],
                    choose=lambda worth, bounds: worth.on_elements(of, bounds),
                )
                if self.rows.may_shut_in:
                    shut = 0 if hidden is None else int(hidden.sum())
                    self.stages.counters["elements_shut_in"] = shut
                rows = self.rows.through_panes(rows, asked, surfaces, mesh=unknowns.basis is None)
                factors = self.kept.factors(unknowns, rows, replace(asked, sources=every))
        lamps_see_out = sees_out and self.rows.sees_out(rows, lamps[of] & (unknowns.areas > 0.0))
        light = self._incidence.on(asked, rows, surfaces, unknowns, sees_out=sees_out)
        averaged: tuple[str, ...] = ()
        deviation = None
        if told and self.lamp_groups:
            with self.stages.run("direct light"):
                means, least = MeanLight(self.scene, self.blockers), (AVERAGED * budget.size) ** 2
                deviation = means.put(light.direct, surfaces, unknowns, least)
                averaged = tuple(self.lamp_groups)
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
            if budget.is_large and self.trace and sent:
                of_rows = unknowns, rows, replace(asked, sources=every)
                sent, indirect = self._half_hidden_put_right(system, sent, indirect, *of_rows)
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
            averaged=averaged,
            deviation=deviation,
        )

    def _half_hidden_put_right(
        self,
        system: RadiositySystem,
        sent: dict[str, FloatArray],
        indirect: dict[str, FloatArray],
        unknowns: Unknowns,
        rows: Rows,
        asked: Ask,
    ) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
        """Reflected exitance and indirect light (N, b) of a mesh where hidden parts do not shine.

        What that changes, by the light as it was, is one more source of it.
        """
        how = unknowns, rows, asked.receivers, asked.sources, asked.budget.moments
        columns = np.concatenate([*indirect.values()], axis=1)
        found = columns.copy()
        self._half_hidden.add(found, *how, np.concatenate([*sent.values()], axis=1))
        parts = np.split(found - columns, len(sent), axis=1)
        more = dict(zip(sent, parts, strict=True))
        for group, values in system.solve(more).items():
            sent[group] = sent[group] + values
            indirect[group] += more[group] + multiplied(system.factors, values)
        return sent, indirect

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

        They are all those of halved elements. Also the sums (k,) of their rows. No more rows are
        held at a time than a block takes, of whole elements: what is the mean over a part of one
        is told by how many unknowns there are on it.
        """
        step = max(LEAST_ROWS, BLOCK_BYTES // (PAIR_BYTES * len(field.sources.nets)))
        step = max(step - step % field.unknowns.halves_of, field.unknowns.halves_of)
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
            now = self.rows.renewed(old[0], asked, changed)
            if now is None:
                return None
            at = np.flatnonzero(changed.again)
            self.rows.close_again(now, at, asked, 1.0, outside=field.sees_out)
            return (now,)

        (rows,) = self.kept.rows(
            "iterated gather",
            asked,
            (field.sees_out, field.hidden),
            find,
            self._under_sky,
            renew,
            sees_out=lambda old: field.sees_out,
            choose=lambda worth, bounds: worth.on_elements(some.element, bounds),
        )
        rows = self.rows.through_panes(rows, asked, field.surfaces)
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
        fine = sources_at_sensors(field, budget)
        light = self._incidence.from_outside(receivers, budget, field.sees_out)
        closed = not field.sees_out or {"sky", "ground"} <= set(light.direct)
        with self.stages.run("sensors") as tell:
            asked = Ask(budget, receivers, fine, fine=True, hidden=field.hidden)

            def find() -> tuple[Rows]:
                rows = self._factors.rows(asked, tell)
                if closed:
                    totals = 1.0 - light.outside
                    self._factors.close(rows, totals, asked, spread=light.outside_variance)
                return (rows,)

            def renew(old: tuple[Rows], changed: Changed) -> tuple[Rows] | None:
                now = self.rows.renewed(old[0], asked, changed, tell)
                if now is None:
                    return None
                at = np.flatnonzero(changed.again)
                if closed:
                    totals, spread = 1.0 - light.outside[at], light.outside_variance[at]
                    self.rows.close_again(now, at, asked, totals, spread=spread)
                return (now,)

            (rows,) = self.kept.rows(
                "sensors",
                asked,
                (closed, field.hidden),
                find,
                renew=renew,
                sees_out=lambda old: field.sees_out,
                which=grid.name,
                choose=lambda worth, bounds: worth.at_sensors(grid.name, bounds),
            )
        rows = self.rows.through_panes(rows, asked, field.surfaces)
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

    def from_outdoors(self, seen: SensorRows, field: Field, finer: Finer) -> FloatArray:
        """Light of sky and ground (m,) that sensors get straight from surfaces outdoors. [lx]"""
        unknowns = finer.unknowns
        there = self.scene.outdoors[field.surfaces.elements.patch_index][unknowns.element]
        daylight = [sent for group, sent in finer.sent.items() if group in ("sky", "ground")]
        if not daylight or not there.any():
            return np.zeros(len(seen.rows.factors))
        column = np.where(there[:, None], sum(daylight), 0.0)
        with self.stages.run("sensors"):
            at = seen.rows, seen.mirrored, seen.asked, field.every, unknowns
            (found,) = self._gathered(*at, [column])
        return luminous(found)

    def _rules(self, seen: SensorRows, field: Field, light: Gathered) -> FloatArray:
        """Error (m,) that the rules for unoccluded factors leave in the light of sensors. [lx]"""
        asked, sent = seen.asked, luminous(field.exitance_told)
        eps = self._factors.eps(asked)
        error, told = rule_error(
            seen.rows, asked, self.blockers, eps, sent, self.kept, trace=self.trace
        )
        return np.asarray(error + self.rules_from_outside(light, told, asked.budget))

    def rules_from_outside(self, light: Gathered, told: FloatArray, budget: Budget) -> FloatArray:
        """The same of all ``light`` but that by straight form factors, ``told`` (m,). [lx]"""
        rest = light.luminous() - told
        error = ROUNDING * np.maximum(rest, 0.0)
        if self._all_flat and not self.panes.any:
            # Past flat surfaces sky and ground are integrated to the error counted as sampled, and
            # past straight sides the sun, unless it comes by way of mirrors.
            straight = self._incidence.disc.straight.all() and not self.mirrors.any
            for name in ("sky.direct", "ground.direct", *(("sun.direct",) if straight else ())):
                rest -= luminous(light.components.get(name, np.zeros((len(told), self.bands))))
        elif self.scene.sky is not None and self.scene.sky.needs_sun:
            error = error + PEAKED * luminous(light.components["sky.direct"])
        return np.asarray(error + OF_RULES * budget.fine_eps * np.maximum(rest, 0.0))

    @property
    def open_sky(self) -> OpenSky:
        """What is open of the sky from anywhere, by rays."""
        return self._incidence.open_sky

    def outside(self, receivers: Receivers, budget: Budget) -> Light:
        """Direct light of sky, sun and ground on any receivers, as at sensors."""
        return self._incidence.from_outside(receivers, budget, not self.in_cavity)

    def outside_on(
        self, elements: Elements, unknowns: Unknowns, budget: Budget
    ) -> tuple[Light, NDArray[np.bool_]]:
        """The same on unknowns of elements, and at which it is the mean of the sun's."""
        return self._incidence.alone_on(elements, unknowns, budget, not self.in_cavity)

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
        of = replace(asked, sources=every)
        found = self.kept.gather(unknowns, rows, of, columns)
        if self.trace:
            how = asked.receivers, every, asked.budget.moments
            self._half_hidden.add(found, unknowns, rows, *how, columns)
        if mirrored is not None:
            found = found + multiplied(mirrored.rows, unknowns.mean(columns))
        return np.split(found, len(sent), axis=1)


def variance_of(rows: Rows, mirrored: Reflections | None, sent: FloatArray) -> FloatArray:
    """Variance (m,) of what rows, and mirrors, gather when the elements send ``sent`` (n,)."""
    found = rows.variance_of(sent)
    return found if mirrored is None else found + multiplied(mirrored.variances, sent**2)
