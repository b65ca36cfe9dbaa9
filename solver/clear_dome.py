"""Light of sky and ground that passes no pane: panes are taken for walls.

It is looked for by itself, not told as the rest of what is seen through openings less what is seen
through panes. Where panes fill their openings that rest would be the noise of both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .budget import Budget
from .dome import DomeLight
from .exchange import Scan, form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .mesh import make_elements
from .model.arrays import FloatArray
from .model.scene import SceneData
from .outside_light import Horizon, OutsideLight
from .surfaces import Receivers
from .tables import facet_turn, make_facets

#: Form factor of what is seen outside that is rounding.
ROUNDING = 1e-12
#: Form factor above which pairs are traced, and that of cells: meridians see all there is to see.
_NONE = 9.0


class ClearDome:
    """Sky and ground past all patches of one scene.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    walls : Blockers
        All of them, as walls.
    """

    def __init__(self, scene: SceneData, walls: Blockers) -> None:
        self.scene, self.walls = scene, walls
        self.horizon = Horizon(walls, trace=True)
        self._sources: tuple[tuple[int, float], Sources, FloatArray] | None = None

    def light(self, receivers: Receivers, budget: Budget, *, on_elements: bool) -> OutsideLight:
        """Light of the sky, and of a ground of luminance 1; see `PaneDome.light`."""
        if on_elements and not self.horizon.is_plain:
            return self._by_meridians(receivers, budget)
        cell_eps = None if on_elements else budget.sensor_dome_cell_eps
        found = self.horizon.light(receivers, self.scene.sky, eps=budget.eps, cell_eps=cell_eps)
        left = np.flatnonzero(found.left)
        if len(left):
            other = self._by_meridians(receivers.take(left), budget)
            for light, more in ((found.sky, other.sky), (found.ground, other.ground)):
                for name in ("illuminance", "deviation", "factor", "factor_variance"):
                    getattr(light, name)[left] = getattr(more, name)
        return OutsideLight(_seen(found.sky), _seen(found.ground), found.left)

    def _by_meridians(self, receivers: Receivers, budget: Budget) -> OutsideLight:
        """What meridians see past the whole patches, each of which is one source."""
        key = budget.lines, budget.accuracy
        if self._sources is None or self._sources[0] != key:
            scene, nets = self.scene, self.scene.patches.control_points
            count = np.ones((len(nets), 2), dtype=np.int64)
            elements = make_elements(scene.patches, scene.two_sided, count, nodes=1)
            of = nets, self.walls.closed, self.walls.solid
            facets, lifts = make_facets(elements, *of, turn=facet_turn(budget.accuracy))
            every = np.full(len(elements), _NONE)
            sources = make_sources(elements, nets, every, Scan(facets, budget.lines, every))
            by_patch = np.zeros(len(nets) + 1)  # patch −1 is the last row
            np.maximum.at(by_patch, elements.patch_index, lifts)
            self._sources = key, sources, by_patch
        _, sources, lifts = self._sources
        rows = form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            sources,
            self.walls,
            eps=budget.eps,
            lifts=lifts[receivers.patches],
            sky=self.scene.sky,
            single=True,
        )
        level, sky, ground, sky_variance, ground_variance = rows.outside.T
        return OutsideLight(
            DomeLight(np.pi * level, np.pi * np.sqrt(sky_variance), sky, sky_variance, {}),
            DomeLight(
                np.pi * ground, np.pi * np.sqrt(ground_variance), ground, ground_variance, {}
            ),
            np.zeros(len(rows.outside), dtype=bool),
        )


def _seen(light: DomeLight) -> DomeLight:
    """The light, of which nothing is not known to better than nothing.

    Panes fill their openings: cells along the edges are sampled, but no point of them is ever seen.
    """
    some = light.factor > ROUNDING

    def only(values: FloatArray) -> FloatArray:
        return np.where(some, values, 0.0)

    return replace(
        light,
        illuminance=only(light.illuminance),
        deviation=only(light.deviation),
        factor=only(light.factor),
        factor_variance=only(light.factor_variance),
    )
