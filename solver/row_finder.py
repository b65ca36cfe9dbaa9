"""Rows of form factors of one scene, found anew where their sums show that they are wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .budget import Budget
from .closure import close_rows, rows_beyond_noise
from .exchange import Rows, form_factor_matrix
from .kernels.pyramid import Blockers
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .shut_in import hide
from .stages import Stages
from .surfaces import Receivers
from .tables import meridians

#: How often wrong rows are found anew, how much finer each time, and the inverse of the share of
#: the rows that this is done for at most: all together cost no more than twice the first pass.
LEVELS, FINER = 2, 4
#: Defect of a row, for each unit of accuracy asked for, that is left to the correction alone.
WORTH = 0.05
#: What rows that were wrong beyond their noise miss, in the mean over all rows, that is told: a
#: fifth of the accuracy asked for. A few rows off by more do not show in what others get of them.
MATTERS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Ask:
    """What rows are asked for.

    Attributes
    ----------
    budget : Budget
        Tolerances.
    receivers : Receivers
        Of the rows.
    sources : Sources
        Of the columns.
    lifts : (m,) array or None
        How far facets may lie before the surface a receiver is on. [m]
    fine : bool
        Whether unoccluded factors are found as at sensors; see `Budget.fine_eps`.
    first : int
        Number of the first receiver among all there are.
    hidden : (n,) bool array or None
        Elements that nothing sees which light comes from; see `shut_in`.
    """

    budget: Budget
    receivers: Receivers
    sources: Sources
    lifts: FloatArray | None = None
    fine: bool = False
    first: int = 0
    hidden: NDArray[np.bool_] | None = None

    def some(self, rows: IntArray) -> Ask:
        """Some of the rows; those that follow one another as they are found among all."""
        return replace(self.taken(rows), first=self.first + int(rows[0]))

    def taken(self, found: IntArray) -> Ask:
        """The rows ``found``."""
        lifts = None if self.lifts is None else self.lifts[found]
        return replace(self, receivers=self.receivers.take(found), lifts=lifts)

    def finer(self, found: IntArray, factor: int) -> Ask:
        """The rows ``found`` with more meridians and smaller cells."""
        sources = self.sources._replace(
            azimuths=meridians(factor * len(self.sources.azimuths)),
            cell_eps=self.sources.cell_eps / factor,
        )
        return replace(self.taken(found), sources=sources)


class RowFinder:
    """Finds rows, and closes them.

    Parameters
    ----------
    scene : SceneData
        The scene.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives counters.
    """

    def __init__(
        self, scene: SceneData, blockers: Blockers, *, trace: bool, stages: Stages
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        # Backs of one-sided patches count nowhere: rows then sum to less than 1.
        self._sums_known = bool((scene.closed | scene.two_sided).all())

    def rows(self, ask: Ask, tell: Callable[[int, int], None] | None = None) -> Rows:
        """Rows as they come."""
        receivers = ask.receivers
        rows = form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            ask.sources,
            self.blockers,
            eps=self.eps(ask),
            trace=self.trace,
            own=receivers.own,
            lifts=ask.lifts,
            sky=self.scene.sky,
            single=True,
            first=ask.first,
            progress=tell,
        )
        self.stages.count(rows.counters)
        if ask.hidden is not None:
            hide(rows, ask.hidden)
        return rows

    def eps(self, ask: Ask) -> float:
        """Relative accuracy of unoccluded factors."""
        return ask.budget.fine_eps if ask.fine or not self.trace else ask.budget.eps

    def close(
        self,
        rows: Rows,
        totals: FloatArray | float,
        ask: Ask,
        *,
        outside: bool = False,
        spread: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Correct ``rows``, in place, by what all directions together must give: ``totals`` (m,).

        Rows that miss it by more than they say, and by more than matters, are found anew first.
        With ``outside``, sky and ground as the meridians saw them count among the elements;
        ``spread`` (m,) is the variance of ``totals``. Returns the sums of the rows before the
        correction.
        """
        if not self._sums_known or not self.trace:
            return rows.sums[:, 0].copy()
        known: dict[str, Any] = {"eps": self.eps(ask), "outside": outside, "spread": spread}
        worth = known | {"eps": max(known["eps"], WORTH * ask.budget.accuracy)}
        for level in range(1, LEVELS + 1):
            found = rows_beyond_noise(rows, totals, **worth)
            found = found[: -(-len(rows.factors) // FINER**level)]
            if not len(found):
                break
            rows.put(found, self.rows(ask.finer(found, FINER**level)))
            self.stages.count({"rows_redone": len(found)})
        wrong = rows_beyond_noise(rows, totals, **known)
        sums = rows.sums[:, 0].copy()
        count = close_rows(rows, totals, **known)
        self.stages.count({"rows_closed": count, "rows_beyond_noise": len(wrong)})
        change = np.abs(rows.sums[:, 0] - sums)[wrong]
        # Of the light of all receivers, which is what others get of it.
        if len(wrong) and change.sum() > MATTERS * ask.budget.accuracy * len(sums):
            worst = int(wrong[np.argmax(change)])
            patch = int(ask.receivers.patches[worst])
            parts = self.scene.parts
            where = (
                f", on {parts[self.scene.patches.part_index[patch]].path!r}" if patch >= 0 else ""
            )
            self.stages.warnings.append(
                f"what {len(wrong)} of {len(sums)} elements or sensors see of the scene misses "
                f"what it must add up to, by {change.max():.1%} at most{where}, and was scaled to "
                "it: light is off by about as much there; a smaller accuracy finds it more exactly"
            )
        return sums
