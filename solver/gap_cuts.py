"""Boxes cut where narrow gaps before them begin and end.

Under a panel that hangs close below a ceiling the ceiling is dark, and what light it has is seen
from nowhere else. An element that is larger than the panel gives the mean of what is over it and of
what lies open, although only the open part is seen: of the light that is reflected there, the panel
takes its share twice. Halving finds the border slowly, and the lamps' own light, by which other
cuts are chosen, may not show it at all. So large boxes are asked how much of them has a surface
close before it, along the normal, and are cut where that leaves the least variance; see
`refinement`. What is a gap depends on the size of the elements: of a wide one both sides are seen.
"""

from __future__ import annotations

import numpy as np

from .budget import Budget
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .model.patches import PatchSet
from .model.scene import SceneData
from .raycast import RayCaster
from .refinement import CUT, best_cut, equal_parts, points_in
from .surfaces import reflectances

#: Width of a gap against the size that elements are aimed to have, and length of the boxes that are
#: asked against it: in smaller ones light can be told to vary.
WIDTH, LONGER = 1.0 / 16.0, 4.0
#: Share of what large boxes reflect that may be taken for in the open, or not, for each unit of
#: accuracy. It has one sign for all that sees them, and few boxes mend it: a fiftieth.
SHARE = 0.02
#: Rounds of cutting: each finds a border to a 64th of a box.
ROUNDS = 12
#: Distance above a surface from which rays start, relative to the gap.
LIFT = 1e-4
#: Difference that is rounding, of shares of an area.
_EVEN = 1e-9
#: Smallest number divided by: patches may have no area.
_TINY = 1e-300


def with_gaps(boxes: Boxes, scene: SceneData, budget: Budget) -> tuple[Boxes, int]:
    """``boxes`` cut at the borders of gaps, no more than the budget allows; how many were added."""
    gaps = _Gaps(scene, WIDTH * budget.size)
    rows = gaps.large(boxes)
    most = budget.most_elements - len(boxes) + len(rows)
    if not len(rows) or most <= len(rows):
        return boxes, 0
    others, own = boxes.take(np.setdiff1d(np.arange(len(boxes)), rows)), boxes.take(rows)
    wrong, total = gaps.judge(own)
    allowed = max(SHARE * budget.accuracy * float(total.sum()), _TINY)
    for _ in range(ROUNDS):
        order = np.argsort(-np.round(wrong / allowed, 9), kind="stable")
        # The fewest boxes without which the rest is good enough.
        rest = np.cumsum(wrong[order][::-1])[::-1]
        count = min(int(np.searchsorted(-rest, -allowed)), most - len(own))
        if count <= 0:
            break
        chosen = np.sort(order[:count])
        parts = gaps.cut(own.take(chosen))
        kept = np.setdiff1d(np.arange(len(own)), chosen)
        wrong = np.append(wrong[kept], gaps.judge(parts)[0])
        own, order = own.take(kept).joined(parts)
        wrong = wrong[order]
    return others.joined(own)[0], len(own) - len(rows)


def left_in_gaps(boxes: Boxes, scene: SceneData, budget: Budget) -> float:
    """What ``boxes`` leave of the light in gaps, against what `with_gaps` would."""
    gaps = _Gaps(scene, WIDTH * budget.size)
    own = boxes.take(gaps.large(boxes))
    if not len(own):
        return 0.0
    # Of the boxes that it would begin with: fewer are large once they are cut.
    regular = Boxes.regular(budget.divisions, scene.two_sided)
    total = gaps.reflecting(regular.take(gaps.large(regular)))
    allowed = max(SHARE * budget.accuracy * float(total.sum()), _TINY)
    return float(gaps.judge(own)[0].sum()) / allowed


class _Gaps:
    """How much of a box has something close before it."""

    def __init__(self, scene: SceneData, width: float) -> None:
        self.patches: PatchSet = scene.without_panes.patches
        self.width, self.reflectance = width, reflectances(scene)
        self._caster = RayCaster(self.patches)

    def large(self, boxes: Boxes) -> IntArray:
        """Rows of the boxes that are asked: those that are large, opaque and not black."""
        rho = self.reflectance[boxes.patch, boxes.side]
        rows = np.flatnonzero((boxes.patch < len(self.patches)) & (rho > 0.0))
        lengths = points_in(self.patches, boxes.take(rows), *equal_parts(2))[3]
        return rows[lengths.max(axis=1) > LONGER * self.width]

    def reflecting(self, boxes: Boxes) -> FloatArray:
        """Reflecting area (n,) of boxes. [m²]"""
        areas = points_in(self.patches, boxes, *equal_parts(CUT))[2]
        return np.asarray(self.reflectance[boxes.patch, boxes.side] * areas.sum(axis=1))

    def judge(self, boxes: Boxes) -> tuple[FloatArray, FloatArray]:
        """Reflecting area (n,) of boxes that is not as the mean of them, and all of it. [m²]"""
        hidden, areas = self._hidden(boxes, *equal_parts(CUT))
        total = areas.sum(axis=1)
        mean = (hidden * areas).sum(axis=1) / np.maximum(total, _TINY)
        rho = self.reflectance[boxes.patch, boxes.side]
        return rho * (np.abs(hidden - mean[:, None]) * areas).sum(axis=1), rho * total

    def cut(self, boxes: Boxes) -> Boxes:
        """Both parts of every box, one after the other."""
        hidden, areas = (a.reshape(-1, CUT, CUT) for a in self._hidden(boxes, *equal_parts(CUT)))
        axis, place = best_cut(hidden, areas)
        rows = np.arange(len(boxes))
        along = np.stack([np.average(hidden, axis=2 - k, weights=areas) for k in (0, 1)], axis=1)
        before, after = along[rows, axis, place - 1], along[rows, axis, place]
        # Between the middles of both parts, once more in as many.
        strips = boxes.ends.copy()
        low = boxes.ends[rows, 2 * axis]
        step = (boxes.ends[rows, 2 * axis + 1] - low) / CUT
        strips[rows, 2 * axis] = low + (place - 0.5) * step
        strips[rows, 2 * axis + 1] = low + (place + 0.5) * step
        hidden, areas = (
            a.reshape(-1, CUT, CUT)
            for a in self._hidden(Boxes(boxes.patch, boxes.side, strips), *equal_parts(CUT))
        )
        fine = np.stack([np.average(hidden, axis=2 - k, weights=areas) for k in (0, 1)], axis=1)
        middle, rise = 0.5 * (before + after)[:, None], (after - before)[:, None]
        nearer = (fine[rows, axis] - middle) * np.sign(rise) <= _EVEN
        return boxes.cut(axis, (place - 0.5 + nearer.mean(axis=1)) / CUT)

    def _hidden(
        self, boxes: Boxes, t: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """How narrow (n, k²) the gap before places of boxes is, 0 … 1, and area about each. [m²]"""
        points, normals, areas, _ = points_in(self.patches, boxes, t, weight)
        start = points + LIFT * self.width * normals
        hits = self._caster.first_hit(
            start.reshape(-1, 3), self.width * normals.reshape(-1, 3), t_max=1.0
        )
        return np.maximum(1.0 - hits.t, 0.0).reshape(areas.shape), areas
