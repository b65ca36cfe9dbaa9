"""Form factors through panes: what panes keep back, and what they throw back themselves.

Panes hide nothing, so that rows are found and closed without them. Then every factor keeps the
share that the panes between receiver and element let through, and columns are added for the light
that the faces of the panes send.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .exchange import Rows, form_factor_matrix, make_sources
from .kernels.panes import Panes, pane_rows
from .kernels.paths import Tree
from .kernels.pyramid import Blockers
from .kernels.threads import count_threads
from .model.arrays import FloatArray, MatrixArray
from .model.elements import Elements
from .model.scene import SceneData
from .row_finder import Ask
from .stages import Stages
from .surfaces import Receivers
from .topology import PLANAR, make_blockers, normal_cones, shape_flags, writable
from .web_light import WebPieces

#: How often an element that panes cover in part is quartered at most.
LEVELS = 5
#: Change of a form factor that does not matter, against that below which cells are sampled.
TOLERANCE = 0.05


class PaneRows:
    """Rows of form factors of one scene with panes.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    panes, tree : Panes, Tree
        These, and the others as what hides.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives counters.
    """

    def __init__(
        self, scene: SceneData, panes: Panes, tree: Tree, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.panes, self.tree, self.trace, self.stages = (
            scene, panes, tree, trace, stages,
        )  # fmt: skip
        #: All patches as blockers, and the same with panes that hide nothing.
        self.walls = make_blockers(scene.patches, scene.closed, scene.patches.part_index)
        spheres = self.walls.spheres.copy()
        # The kernels skip what lies below the horizon: with such a radius, at every place.
        spheres[scene.opaque_count :, 3] = -1e300
        self._open: Blockers = self.walls._replace(spheres=spheres)
        low, high = scene.patches.bounds()
        self._tolerance = 1e-9 * float(np.linalg.norm(high - low))

    def complete(
        self, rows: Rows, asked: Ask, elements: Elements, areas: FloatArray, *, mesh: bool
    ) -> Rows:
        """Rows to all ``elements``, panes among them, from ``rows`` to those that are none.

        Parameters
        ----------
        rows : Rows
            Closed already; changed.
        asked : Ask
            What they were asked for.
        areas : (n,) array
            Areas of the elements that take part. [m²]
        mesh : bool
            Whether the receivers are the elements, each as a whole: reciprocity then tells what
            panes send.
        """
        count = rows.factors.shape[1]
        opaque, glass = np.arange(count), np.arange(count, len(elements))
        self._keep_back(rows, asked, elements.take(opaque))
        m = len(rows.factors)
        added = np.zeros((m, len(glass)), np.float32), np.zeros((m, len(glass)), np.float32)
        if mesh:
            # Reciprocity: what panes send to an element, from what they see of it.
            share = areas[count:, None] / np.where(areas > 0.0, areas, np.inf)[None, :count]
            added[0][:count] = (share * rows.factors[count:]).T
            added[1][:count] = (share**2 * rows.variances[count:]).T
            own = Receivers.of_elements(elements).take(glass)
            own = replace(own, own=own.own - count)
            asked = replace(asked, receivers=own)
        found = self._columns(asked, elements.take(glass))
        self._keep_back(found, asked, elements.take(glass))
        some = slice(count if mesh else 0, m)
        added[0][some], added[1][some] = found.factors, found.variances
        return Rows(
            np.concatenate([rows.factors, added[0]], axis=1),
            np.concatenate([rows.variances, added[1]], axis=1),
            rows.counters,
            rows.outside,
        )

    def _columns(self, asked: Ask, glass: Elements) -> Rows:
        """Form factors of elements of panes, traced by pyramids."""
        receivers, budget = asked.receivers, asked.budget
        cells = np.full(len(glass), float(np.median(asked.sources.cell_eps)))
        return form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            make_sources(glass, self.scene.patches.control_points, cells),
            self._open,
            eps=budget.eps,
            trace=self.trace,
            own=receivers.own,
            single=True,
        )

    def left_of(self, factors: MatrixArray, asked: Ask, elements: Elements) -> FloatArray:
        """What panes leave of any form factors (m, k) of some elements.

        As `complete` takes it from those that there are: what is hidden besides is then told by
        comparing both.
        """
        kept = np.array(factors, dtype=np.float32)
        rows = Rows(kept, np.zeros_like(kept), {}, np.zeros((len(kept), 5)))
        self._take(rows, asked, elements)
        return np.asarray(kept, dtype=np.float64)

    def _keep_back(self, rows: Rows, asked: Ask, elements: Elements) -> None:
        """Multiply factors by the share that panes leave, in place."""
        self.stages.count({"pairs_through_panes": self._take(rows, asked, elements)})

    def _take(self, rows: Rows, asked: Ask, elements: Elements) -> int:
        """The same; returns how many pairs were looked at."""
        return keep_back(
            rows.factors,
            rows.variances,
            asked.receivers,
            elements,
            self.panes,
            self.tree,
            self._tolerance,
            TOLERANCE * float(np.median(asked.sources.cell_eps)),
        )


def keep_back(
    factors: MatrixArray,
    variances: MatrixArray,
    receivers: Receivers,
    elements: Elements,
    panes: Panes,
    tree: Tree,
    rounding: float,
    wanted: float,
) -> int:
    """Multiply form factors (m, k) of elements by the share that panes leave, in place.

    Parameters
    ----------
    factors, variances : (m, k) float32 arrays
        Both changed.
    panes, tree : Panes, Tree
        What is seen through, and what hides.
    rounding : float
        Distance from a flat pane that is none. [m]
    wanted : float
        Change of a form factor that does not matter.

    Returns
    -------
    int
        How many pairs were looked at.
    """
    nets, own = writable(elements.nets), panes.nets
    pieces = WebPieces.of(nets)
    points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
    corners = (own[..., :3] / own[..., 3:]).reshape(len(own), 16, 3)
    flat = shape_flags(own) & PLANAR != 0
    planes = np.concatenate(
        [normal_cones(own)[:, :3], np.where(flat, rounding, 0.0)[:, None]], axis=1
    )
    origins = corners[:, 0].copy()
    heights = np.empty((len(own), len(nets), 2))
    for p, (plane, origin) in enumerate(zip(planes, origins, strict=True)):
        above = (points - origin) @ plane[:3]
        heights[p, :, 0], heights[p, :, 1] = above.min(axis=1), above.max(axis=1)
    looked = np.zeros(len(receivers.nodes), dtype=np.int64)
    pane_rows(
        writable(receivers.nodes),
        writable(receivers.normals),
        writable(receivers.weights),
        panes,
        tree,
        np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1),
        planes,
        origins,
        points.min(axis=1),
        points.max(axis=1),
        heights,
        nets,
        pieces.points,
        pieces.areas,
        wanted,
        LEVELS,
        count_threads(),
        factors,
        variances,
        looked,
    )
    return int(looked.sum())
