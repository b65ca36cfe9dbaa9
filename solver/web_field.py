"""All lamps with photometric webs in a solve: their direct light, by light group."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .kept_webs import kept_by_rows
from .kernels.pyramid import Blockers
from .light_colors import lamp_color
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.result import Balance
from .model.scene import SceneData
from .pane_field import PaneField
from .reuse import Kept, tolerances
from .row_finder import Ask
from .stages import Stages
from .surfaces import Receivers, Surfaces
from .topology import bounding_spheres
from .web_ledger import with_webs
from .web_light import WebLight, WebViews
from .webs import LEVELS, Known, WebLamp

#: Standard deviation by partly hidden elements that may stay at sensors, against the accuracy, and
#: how often these are cut in four for it. Surface elements, over which it is averaged, state it.
PARTLY, CUTS = 0.25, 3
#: Lamps of equal flux beyond which their number no longer counts for the digits of one.
MANY = 20.0
#: How often elements of lamps are quartered for their mean luminance at elements, and at those with
#: many nodes.
LEVELS_COARSE, LEVELS_DENSE = 3, 1
#: Most nodes a direction on an element under a narrow beam.
MOST_NODES = 32


class WebField:
    """Lamps with webs of one scene.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches as obstacles.
    panes : PaneField
        What is seen through.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives times and counters.
    kept : Kept
        What runs before this one have found.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        panes: PaneField,
        *,
        trace: bool,
        stages: Stages,
        kept: Kept,
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self.panes, self.kept = panes, kept
        lamps = enumerate(scene.luminaires)
        self._rows = [row for row, lamp in lamps if lamp.web is not None and lamp.flux_lm > 0.0]
        self._lamps: dict[float, list[WebLamp]] = {}
        self._tables: Known = {}

    def lamps(self, accuracy: float) -> list[WebLamp]:
        """The lamps, ready for an accuracy."""
        if accuracy not in self._lamps:
            self._lamps[accuracy] = [
                WebLamp(self.scene, row, accuracy, self._tables) for row in self._rows
            ]
        return self._lamps[accuracy]

    def in_ledger(
        self, balance: Balance, surfaces: Surfaces, accuracy: float, sees_out: bool
    ) -> Balance:
        """The flux ledger with the light of these lamps; what escapes is looked for by rays."""
        if not self._rows:
            return balance
        with self.stages.run("flux ledger") as tell:
            lamps = self.lamps(accuracy)
            return with_webs(balance, self.scene, surfaces, lamps, sees_out=sees_out, tell=tell)

    def add(
        self,
        direct: dict[str, FloatArray],
        rows: Rows,
        surfaces: Surfaces,
        asked: Ask,
        *,
        areas: FloatArray | None = None,
    ) -> FloatArray:
        """Add to the direct light (m, b) of their groups; returns the variances (m,). [lx²]

        Parameters
        ----------
        direct : dict of (m, b) arrays
            Changed in place; every group of lamps is there. [lx]
        rows : Rows
            Form factors from m receivers to the elements of ``surfaces``.
        asked : Ask
            What the rows were asked for.
        areas : (m,) array, optional
            What receivers on elements stand for, in order of their elements; sensors, which nothing
            averages, have none. [m²]
        """
        variance, budget = np.zeros(len(rows.factors)), asked.budget
        if not self._rows:
            return variance
        bands = surfaces.emitted.shape[1]
        with self.stages.run("photometric webs") as tell:
            lamps = self.lamps(budget.accuracy)
            for done, lamp in enumerate(lamps):
                found = self._light(lamp, rows, surfaces, asked, areas)
                color = lamp_color(lamp.luminaire, bands)
                group = lamp.luminaire.group
                direct[group] = direct[group] + found.illuminance[:, None] * color
                variance += found.variance
                tell(done + 1, len(lamps))
        return variance

    def _coarser(self, lamp: WebLamp) -> float:
        """How much larger its sampled cells may be than those of a lamp that is alone.

        Sampling errors of lamps add as squares, and that of one goes with the root of its cells.
        """
        flux = sum(self.scene.luminaires[row].flux_lm for row in self._rows)
        return min(MANY, flux / lamp.luminaire.flux_lm)

    def _light(
        self, lamp: WebLamp, rows: Rows, surfaces: Surfaces, asked: Ask, areas: FloatArray | None
    ) -> WebLight:
        """Direct light of one lamp: traced anew at sensors, elsewhere by the rows there are."""
        own = np.flatnonzero(surfaces.lamp == lamp.row)
        elements = surfaces.elements.take(own)
        seen = np.asarray(rows.factors[:, own]), np.asarray(rows.variances[:, own])
        if self.trace and areas is None and not self.panes.any:
            # Panes dim the rows there are; what is traced anew knows nothing of them.
            return self._traced(lamp, asked, elements, *seen)
        return self._by_rows(lamp, asked, surfaces, elements, *seen, areas)

    def _of(self, lamp: WebLamp, asked: Ask, elements: Elements) -> tuple[Any, ...]:
        """What light of a lamp depends on for all receivers; one grid of sensors is not another."""
        at = asked.receivers
        grid = at.nodes if (at.own < 0).all() else None
        return lamp.row, lamp.web, elements.nets, tolerances(asked.budget), asked.fine, grid

    def _eps(self, asked: Ask) -> float:
        return asked.budget.fine_eps if asked.fine or not self.trace else asked.budget.eps

    def _traced(
        self,
        lamp: WebLamp,
        asked: Ask,
        elements: Elements,
        factors: NDArray[np.floating],
        variances: NDArray[np.floating],
    ) -> WebLight:
        """Light of one lamp at sensors, by rows that are found for it.

        Sensors that see all of its ``elements`` as before, by ``factors`` (m, k), see it as before.
        """
        budget, flux = asked.budget, lamp.luminaire.flux_lm
        cell_eps = budget.lamp_cell_eps * self._coarser(lamp)
        how: dict[str, Any] = {
            "eps": self._eps(asked),
            "cell_eps": cell_eps,
            "count": self.stages.count,
        }

        def find(some: IntArray) -> WebLight:
            receivers = asked.receivers.take(some)
            light = lamp.traced(receivers, self.blockers, budget.divisions, **how)
            found = lamp.refined(
                receivers,
                light,
                self.blockers,
                budget.divisions,
                accuracy=PARTLY * budget.accuracy,
                cuts=CUTS,
                **how,
            )
            return found.times(1.0 / flux)

        of, told = self._of(lamp, asked, elements), (*_places(asked.receivers), factors, variances)
        return kept_by_rows(self.kept, of, told, find, cell_eps).times(flux)

    def _by_rows(
        self,
        lamp: WebLamp,
        asked: Ask,
        surfaces: Surfaces,
        elements: Elements,
        factors: NDArray[np.floating],
        variances: NDArray[np.floating],
        areas: FloatArray | None,
    ) -> WebLight:
        """Light of one lamp by what is seen of its ``elements``, ``factors`` (m, k)."""
        receivers, flux = asked.receivers, lamp.luminaire.flux_lm
        of = self._of(lamp, asked, elements)
        coarse, levels = areas is not None, LEVELS if areas is None else LEVELS_COARSE
        wanted = factors > 0.0

        def find(some: IntArray) -> WebViews:
            here = receivers.take(some)
            plain = lamp.plain_factors(here, elements, self.blockers, eps=self._eps(asked))
            return lamp.views(here, elements, wanted[some], plain, coarse=coarse, levels=levels)

        told = *_places(receivers), wanted
        views = kept_by_rows(self.kept, (*of, receivers.own, coarse, levels), told, find)
        plain = np.asarray(self.panes.left_of(views.plain, asked, elements))
        light = views.light(flux, factors, variances, plain)
        if areas is None:
            return light
        for some, dense in _denser(lamp, surfaces.elements, elements):
            share = _Shares.of(receivers.own, areas, some)
            if not len(share.rows):
                continue
            at = dense.take(share.groups)
            means = [share.means(a[share.rows]) for a in (factors, variances, plain)]
            lit = means[0] > 0.0

            def look(few: IntArray, at: Receivers = at, lit: NDArray[np.bool_] = lit) -> WebViews:
                nothing = np.empty((len(few), 0))
                return lamp.views(
                    at.take(few), elements, lit[few], nothing, coarse=True, levels=LEVELS_DENSE
                )

            told = *_places(at), lit
            better = kept_by_rows(self.kept, (*of, at.own), told, look).light(flux, *means)
            light = light.put(share.rows, share.with_means(light.take(share.rows), better))
        return light


def _places(receivers: Receivers) -> tuple[NDArray[Any], ...]:
    """What tells where receivers (m,) are."""
    return receivers.nodes, receivers.normals, receivers.weights, receivers.patches


@dataclass(frozen=True, slots=True, eq=False)
class _Shares:
    """Receivers on some elements: ``rows`` (k,), of which element, and its share in that.

    ``groups`` (c,) are those of the elements that have any, by their place among them.
    """

    rows: IntArray
    groups: IntArray
    group: IntArray
    share: FloatArray

    @classmethod
    def of(cls, own: IntArray, areas: FloatArray, some: IntArray) -> _Shares:
        rows = np.flatnonzero(np.isin(own, some))
        groups, group = np.unique(np.searchsorted(some, own[rows]), return_inverse=True)
        total = np.bincount(group, weights=areas[rows])
        return cls(rows, groups, group, areas[rows] / total[group])

    def means(self, values: NDArray[np.floating]) -> FloatArray:
        """Means (c, …) over the elements of ``values`` (k, …)."""
        out = np.zeros((len(self.groups), *values.shape[1:]))
        weights = self.share.reshape(-1, *(1,) * (values.ndim - 1))
        np.add.at(out, self.group, weights * values)
        return out

    def with_means(self, light: WebLight, better: WebLight) -> WebLight:
        """The light scaled to the means ``better`` (c,); even where the receivers saw none."""
        mean = self.means(light.illuminance)[self.group]
        wanted = better.illuminance[self.group]
        scale = np.where(mean > 0.0, wanted / np.where(mean > 0.0, mean, 1.0), 0.0)
        return WebLight(
            np.where(mean > 0.0, light.illuminance * scale, wanted),
            better.variance[self.group],
            better.partly[self.group],
        )


def _denser(
    lamp: WebLamp, receivers: Elements, lamp_elements: Elements
) -> Iterator[tuple[IntArray, Receivers]]:
    """Elements on which few nodes may miss a narrow beam, and them with more nodes.

    The nodes are as many as steps of the web, seen from the lamp, lie on the element; a web without
    steep changes has no need of them. Only the mean luminance is found with these.
    """
    if not lamp.sharp:
        return
    spheres = bounding_spheres(receivers.nets)
    points = (lamp_elements.nets[..., :3] / lamp_elements.nets[..., 3:]).reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    away = np.linalg.norm(spheres[:, :3] - 0.5 * (low + high), axis=1)
    away = np.maximum(away - 0.5 * float(np.linalg.norm(high - low)), spheres[:, 3])
    # What is finer than half the lamp is blurred by it.
    blur = 0.5 * math.sqrt(lamp.shape.area)
    count = np.ceil(2.0 * spheres[:, 3] / np.maximum(lamp.step * away, blur))
    whole = ~receivers.buried.any(axis=1)
    for least, most, nodes in (
        (2.0, 4.0, 4),
        (4.0, 8.0, 8),
        (8.0, 16.0, 16),
        (16.0, np.inf, MOST_NODES),
    ):
        some = np.flatnonzero(whole & (count > least) & (count <= most))
        if len(some):
            yield some, Receivers.with_nodes(receivers, some, nodes)
