"""Rows of form factors of one scene: what they say of it, and how they change with it.

Whether light can leave, what no light reaches, what moved parts leave of earlier rows, and what
panes keep back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrangement import Changed
from .exchange import Rows
from .model.arrays import FloatArray, IntArray
from .pane_field import PaneField
from .renewed import renewed_rows
from .reuse import Kept
from .row_finder import Ask, RowFinder
from .shut_in import Hidden, hide, shut_in
from .surfaces import Surfaces
from .unknowns import Unknowns

#: Share of rows above which the others are closed once more with them: these do so already, and to
#: part them takes longer.
NEARLY_ALL = 0.75


class FieldRows:
    """Rows of one scene.

    Parameters
    ----------
    finder : RowFinder
        Finds them.
    panes : PaneField
        What is seen through.
    kept : Kept
        What runs before this one have found.
    in_cavity : bool
        Whether all there is is one convex cavity.
    """

    def __init__(self, finder: RowFinder, panes: PaneField, kept: Kept, *, in_cavity: bool) -> None:
        self.finder, self.panes, self.kept, self.in_cavity = finder, panes, kept, in_cavity
        #: Whether it is asked what is shut in where no light comes.
        self.may_shut_in = finder.trace and not panes.any

    def sees_out(self, rows: Rows, lit: NDArray[np.bool_]) -> bool:
        """Whether light may leave the scene from ``lit`` rows, beyond what sampling explains."""
        if self.in_cavity:
            return False
        missing = 1.0 - rows.sums[lit, 0]
        noise = 3.0 * np.sqrt(rows.sums[lit, 1]) + 1e-4
        leaves = missing > noise
        if self.finder.trace:
            # What the meridians met is known besides, and must say as much: slivers between facets
            # of curved walls let all of them through somewhere.
            leaves &= rows.outside[lit, 1] + rows.outside[lit, 2] > noise
        return bool(leaves.any())

    def shut_in(self, rows: Rows, unknowns: Unknowns, lamps: NDArray[np.bool_]) -> Hidden:
        """Elements that no light reaches; None where it reaches all."""
        if not self.may_shut_in:
            return None
        hidden = shut_in(rows, unknowns, lamps)
        return hidden if hidden.any() else None

    def renewed(
        self,
        rows: Rows,
        asked: Ask,
        changed: Changed,
        tell: Callable[[int, int], None] | None = None,
    ) -> Rows | None:
        """Rows among surfaces that have moved; None where all are to be found anew."""
        if not (self.finder.trace and len(asked.sources.azimuths)):
            return None
        finder = self.finder
        found = renewed_rows(
            rows, asked, changed, finder.scene, finder.blockers, eps=finder.eps(asked), tell=tell
        )
        finder.stages.count(found.counters)
        if asked.hidden is not None:
            hide(found, asked.hidden, np.flatnonzero(changed.again))
        return found

    def close_again(
        self, rows: Rows, at: IntArray, asked: Ask, totals: FloatArray | float, **how: Any
    ) -> FloatArray:
        """Close some of the ``rows``, in place; see `RowFinder.close`."""
        count = len(rows.factors)
        if len(at) == count or (np.ndim(totals) == 0 and len(at) > NEARLY_ALL * count):
            return self.finder.close(rows, totals, asked, **how)[at]
        part = rows.take(at)
        sums = self.finder.close(part, totals, asked.taken(at), **how)
        rows.put(at, part)
        return sums

    def through_panes(
        self, rows: Rows, asked: Ask, surfaces: Surfaces, *, mesh: bool = False
    ) -> Rows:
        """Closed rows with what panes keep back and what they send; ``rows`` stay as they are."""
        if not self.panes.any:
            return rows
        of = (surfaces.elements, surfaces.areas)
        scene = self.finder.scene
        glass = scene.glazings, scene.glass_index, surfaces.elements.boxes

        def complete() -> Rows:
            own = replace(rows, factors=rows.factors.copy(), variances=rows.variances.copy())
            return self.panes.complete(own, asked, *of, mesh=mesh)

        through = self.kept.of_rows("panes", rows, (glass, surfaces.areas, mesh), complete)
        return replace(through, outside=rows.outside)  # of the sky as it is now
