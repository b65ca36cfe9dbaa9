"""Panes in a solve: the few places where clear glass differs from everything else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from .budget import Budget
from .exchange import Rows, make_sources
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.elements import Elements
from .model.result import Balance
from .model.scene import SceneData
from .pane_dome import Daylight, PaneDome
from .pane_ledger import Passing, passing_flux, with_passing
from .pane_rows import PaneRows
from .panes import make_panes, make_tree
from .row_finder import Ask
from .scattering import Scattering
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .unknowns import Unknowns

#: Groups of light from outside.
DAYLIGHT = ("sky", "sun", "ground")


class PaneField:
    """The panes of one scene; without any, nothing is done and nothing is changed.

    Elements of panes come last. They hide nothing: form factors are found between the others, and
    to panes apart from that.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches that are no panes.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives counters.
    """

    def __init__(
        self, scene: SceneData, blockers: Blockers, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.count = scene, scene.opaque_count
        self.any = self.count < len(scene.patches)
        if not self.any:
            return
        self.panes = make_panes(scene)
        tree = make_tree(scene.without_panes.patches)
        self.rows = PaneRows(scene, self.panes, tree, trace=trace, stages=stages)
        self.dome = PaneDome(scene, self.panes, blockers, self.rows.walls, trace=trace)

    def opaque(self, elements: Elements) -> Elements:
        """The elements that are none of panes, the first of all."""
        if not self.any:
            return elements
        return elements.take(np.flatnonzero(elements.patch_index < self.count))

    def in_the_open(self, unknowns: Unknowns, elements: Elements) -> Unknowns:
        """Unknowns of which those of panes lie on nothing."""
        if not self.any:
            return unknowns
        clear = elements.patch_index[unknowns.element] >= self.count
        receivers = unknowns.receivers
        own, patches = (np.where(clear, -1, a) for a in (receivers.own, receivers.patches))
        return replace(unknowns, receivers=replace(receivers, own=own, patches=patches))

    def with_panes(self, sources: Sources, elements: Elements) -> Sources:
        """Sources to which those of panes are added, as far as `unknowns` looks at them."""
        if not self.any:
            return sources
        glass = elements.take(np.flatnonzero(elements.patch_index >= self.count))
        nets = self.scene.patches.control_points
        more = make_sources(glass, nets, np.ones(len(glass)))
        shift = (more.edge_origin - sources.edge_origin)[:, None, None]
        return sources._replace(
            nets=np.concatenate([sources.nets, more.nets]),
            spheres=np.concatenate([sources.spheres, more.spheres]),
            area_point=np.concatenate([sources.area_point, more.area_point + shift], axis=1),
            area_normal=np.concatenate([sources.area_normal, more.area_normal], axis=1),
        )

    def lifts(self, lifts: FloatArray, elements: Elements) -> FloatArray:
        """Lifts (n,) of all elements from those that are none of panes."""
        return np.concatenate([lifts, np.zeros(len(elements) - len(lifts))])

    def complete(
        self, rows: Rows, asked: Ask, elements: Elements, areas: FloatArray, *, mesh: bool = False
    ) -> Rows:
        """Closed rows with what panes keep back and what they send; see `PaneRows.complete`."""
        if not self.any:
            return rows
        return self.rows.complete(rows, asked, elements, areas, mesh=mesh)

    def left_of(self, factors: MatrixArray, asked: Ask, elements: Elements) -> MatrixArray:
        """What panes leave of form factors (m, k) of some elements, all of them without panes."""
        return self.rows.left_of(factors, asked, elements) if self.any else factors

    def daylight(
        self,
        receivers: Receivers,
        budget: Budget,
        tell: Callable[[int, int], None],
        *,
        on_elements: bool,
    ) -> Daylight:
        """Light from outside; see `PaneDome.light`."""
        return self.dome.light(receivers, budget, tell, on_elements=on_elements)

    def scattering(self, surfaces: Surfaces) -> Scattering | None:
        """What diffusing panels send on to their other side; None where there are none."""
        if all(glazing.glass.diffuse == 0.0 for glazing in self.scene.glazings):
            return None
        return Scattering(self.scene, surfaces.elements, surfaces.areas)

    def in_ledger(
        self,
        balance: Balance,
        surfaces: Surfaces,
        factors: Callable[[IntArray], FloatArray],
        exitance: FloatArray,
        components: Mapping[str, FloatArray],
    ) -> Balance:
        """The flux ledger with what passes panes and what panels scatter.

        Parameters
        ----------
        factors : callable
            Form factors (k, n) of elements, from some rows (k,) of them.
        exitance : (n, b) array
            What the elements send alike in all directions. [lm/m²]
        components : dict of (n, b) arrays
            Light on the elements, as `field.Gathered`. [lx]
        """
        scattering = self.scattering(surfaces)
        if not self.any and scattering is None:
            return balance
        flux = np.zeros(len(surfaces.areas))
        if scattering is not None:
            light = sum(components.values(), np.zeros_like(surfaces.emitted))
            flux += scattering.share * passing_flux(surfaces.areas, light)
        entered = escaped = 0.0
        if self.any:
            passing = Passing(self.scene, self.panes, surfaces.elements)
            rows, areas = passing.rows, surfaces.areas[passing.rows]
            direct = {
                name.rsplit(".", 1)[0]: values
                for name, values in components.items()
                if name.endswith(".direct")
            }
            outside = {name: direct[name] for name in DAYLIGHT if name in direct}
            seen = factors(rows)
            kept = passing_flux(areas, passing.of_surfaces(seen, exitance))
            flux[rows] += kept
            for group, values in direct.items():
                if group in outside:
                    continue
                # What form factors do not tell of lamps: webs, or where uneven ones are bright.
                even = np.asarray(seen @ surfaces.emitted_by(self.scene, group))
                more = values[rows] - even
                if any(one.web is not None for one in self.scene.luminaires if one.group == group):
                    more = np.maximum(more, 0.0)
                flux[rows] += passing_flux(areas, passing.of_lamps(more))
            escaped = float(kept.sum())
            if outside:
                come = passing_flux(areas, passing.of_daylight(outside))
                flux[rows] += come
                entered = float(come.sum())
        names = [m.name or f"material {k + 1}" for k, m in enumerate(self.scene.materials)]
        return with_passing(balance, names, surfaces.material, flux, entered, escaped)
