"""Panes in a solve: the few places where clear glass differs from everything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .budget import Budget
from .exchange import Rows
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.scene import SceneData
from .pane_dome import Daylight, PaneDome
from .pane_rows import PaneRows
from .panes import make_panes, make_tree
from .row_finder import Ask
from .stages import Stages
from .surfaces import Receivers


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
        self.count = scene.opaque_count
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

    def receivers(self, elements: Elements) -> Receivers:
        """The elements as receivers; those of panes lie in the open."""
        receivers = Receivers.of_elements(elements)
        if not self.any:
            return receivers
        clear = elements.patch_index >= self.count
        own, patches = (np.where(clear, -1, a) for a in (receivers.own, receivers.patches))
        return replace(receivers, own=own, patches=patches)

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

    def daylight(
        self,
        receivers: Receivers,
        budget: Budget,
        scanned: FloatArray | None,
        tell: Callable[[int, int], None],
    ) -> Daylight:
        """Light from outside; see `PaneDome.light`."""
        return self.dome.light(receivers, budget, scanned, tell)
