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

from dataclasses import dataclass

import numpy as np

from .budget import Budget
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .model.bezier import sub_nets
from .model.patches import PatchSet
from .model.scene import SceneData
from .moved import moved_patches, places_of
from .raycast import RayCaster
from .refinement import CUT, best_cut, equal_parts, points_in
from .surfaces import reflectances
from .topology import bounding_spheres

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


@dataclass(frozen=True, slots=True, eq=False)
class InGaps:
    """What boxes leave of the light in gaps.

    Attributes
    ----------
    nets : (p, 4, 4, 4) array
        Control nets of the patches.
    rows : (k,) int array
        Boxes that were asked.
    wrong : (k,) array
        Reflecting area of each that is not as the mean of it. [m²]
    allowed : float
        Sum of it that may be left. [m²]
    """

    nets: FloatArray
    rows: IntArray
    wrong: FloatArray
    allowed: float

    @property
    def left(self) -> float:
        """What is left against what may be."""
        return float(self.wrong.sum()) / self.allowed if len(self.rows) else 0.0


def in_gaps(
    boxes: Boxes,
    scene: SceneData,
    budget: Budget,
    before: InGaps | None,
    caster: RayCaster | None = None,
) -> InGaps:
    """What ``boxes`` leave of the light in gaps, against what `with_gaps` would.

    Parameters
    ----------
    boxes : Boxes
        A mesh.
    scene : SceneData
        What is meshed.
    budget : Budget
        Its tolerances.
    before : InGaps or None
        Of the same boxes and paint, some parts having stood elsewhere: only boxes that these come
        near are asked again.
    caster : RayCaster, optional
        Of the patches without panes; made here where there is none yet.
    """
    gaps, nets = _Gaps(scene, WIDTH * budget.size, caster), scene.patches.control_points
    rows = gaps.large(boxes)
    own = boxes.take(rows)
    # Of the boxes that it would begin with: fewer are large once they are cut.
    regular = Boxes.regular(budget.divisions, scene.two_sided)
    if before is None or not np.array_equal(before.rows, rows):
        total = gaps.reflecting(regular.take(gaps.large(regular))) if len(rows) else np.zeros(0)
        allowed = max(SHARE * budget.accuracy * float(total.sum()), _TINY)
        return InGaps(nets, rows, gaps.judge(own)[0], allowed)
    dirty = moved_patches(before.nets, nets)
    again = dirty[own.patch]
    spheres = bounding_spheres(sub_nets(nets[own.patch], own.ends))
    for ball in places_of(before.nets, nets, dirty, scene.patches.part_index).patches:
        away = np.linalg.norm(spheres[:, :3] - ball[:3], axis=1)
        again |= away <= spheres[:, 3] + ball[3] + 2.0 * gaps.width
    wrong = before.wrong.copy()
    wrong[again] = gaps.judge(own.take(np.flatnonzero(again)))[0]
    return InGaps(nets, rows, wrong, before.allowed)


class _Gaps:
    """How much of a box has something close before it."""

    def __init__(self, scene: SceneData, width: float, caster: RayCaster | None = None) -> None:
        self.patches: PatchSet = scene.without_panes.patches
        self.width, self.reflectance = width, reflectances(scene)
        self._caster = caster

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
        if self._caster is None:
            self._caster = RayCaster(self.patches)
        start = points + LIFT * self.width * normals
        hits = self._caster.first_hit(
            start.reshape(-1, 3), self.width * normals.reshape(-1, 3), t_max=1.0
        )
        return np.maximum(1.0 - hits.t, 0.0).reshape(areas.shape), areas
