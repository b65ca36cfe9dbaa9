"""Boxes of lamps cut where their exitance varies."""

from __future__ import annotations

import math

import numpy as np

from .budget import Budget
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray
from .model.scene import SceneData
from .profile_boxes import cut_at_tables, uneven_rows
from .profile_shape import Shape, sampled
from .refinement import best_cut

#: Share of the lamps' flux that their polynomials may miss, for each unit of accuracy.
MISSED = 0.1
#: Change of the exitance over an element, against the mean of its lamp, at an accuracy of 1 %: it
#: counts where something hides a part of the element, whose light is then taken for any part's.
CHANGE = 0.5
#: Share of the elements that may be added which lamps may get, and how many they always may.
ROOM, ROOM_AT_LEAST = 0.5, 64
#: Equal parts a direction between which boxes are cut, and rounds of cutting.
CUT, ROUNDS = 8, 12


def with_profiles(
    boxes: Boxes, scene: SceneData, budget: Budget, *, trace: bool
) -> tuple[Boxes, int]:
    """``boxes`` cut until they tell the profiles of lamps well enough; and how many were added.

    Tables are cut at their lines first, where their light has kinks.
    """
    rows = uneven_rows(scene, boxes)
    if not len(rows):
        return boxes, 0
    room = max(ROOM_AT_LEAST, int(ROOM * (budget.most_elements - len(boxes))))
    most = len(rows) + room
    others = boxes.take(np.setdiff1d(np.arange(len(boxes)), rows))
    own = cut_at_tables(scene, boxes.take(rows), most)
    judge = _Judge(scene, own, CHANGE * math.sqrt(budget.accuracy / 0.01) if trace else math.inf)
    wrong = judge(own)
    allowed = MISSED * budget.accuracy * judge.flux
    for _ in range(ROUNDS):
        order = np.argsort(-wrong, kind="stable")
        # The fewest boxes without which the rest is good enough.
        rest = np.cumsum(wrong[order][::-1])[::-1]
        count = min(int(np.searchsorted(-rest, -allowed)), most - len(own))
        if count <= 0:
            break
        chosen = np.sort(order[:count])
        halves = _cut(own.take(chosen), scene)
        kept = np.setdiff1d(np.arange(len(own)), chosen)
        wrong = np.append(wrong[kept], judge(halves))
        own, order = own.take(kept).joined(halves)
        wrong = wrong[order]
    return others.joined(own)[0], len(own) - len(rows)


class _Judge:
    """Tells what is wrong with the exitance of boxes (n,). [lm]

    ``change`` is what may stay of the change over an element, against the mean of its lamp.
    """

    def __init__(self, scene: SceneData, boxes: Boxes, change: float) -> None:
        self.scene, self.change = scene, change
        lamps = len(scene.luminaires)
        shape, lamp, areas = self._shape(boxes)
        flux = np.bincount(lamp, weights=shape.mean * areas, minlength=lamps)
        given = np.array([one.flux_lm for one in scene.luminaires])
        self._scale = given / np.where(flux > 0.0, flux, np.inf)
        self._level = np.array([one.exitance_lm_m2 for one in scene.luminaires])
        self.flux = float(given[np.unique(lamp)].sum())

    def __call__(self, boxes: Boxes) -> FloatArray:
        shape, lamp, areas = self._shape(boxes)
        scale = self._scale[lamp]
        wrong = shape.missed * scale * areas
        if math.isfinite(self.change):
            over = shape.span * scale - self.change * self._level[lamp]
            wrong += np.maximum(over, 0.0) * areas
        return wrong

    def _shape(self, boxes: Boxes) -> tuple[Shape, np.ndarray, FloatArray]:
        elements = elements_on(self.scene.patches, boxes, nodes=1)
        lamp = self.scene.luminaire_index[boxes.patch, boxes.side]
        return Shape.of(self.scene, elements, lamp), lamp, elements.areas


def _cut(boxes: Boxes, scene: SceneData) -> Boxes:
    """Both parts of every box, one after the other."""
    elements = elements_on(scene.patches, boxes, nodes=1)
    lamp = scene.luminaire_index[boxes.patch, boxes.side]
    t = (np.arange(CUT) + 0.5) / CUT
    _, vectors, values = sampled(scene, elements, lamp, (t, np.full(CUT, 1.0 / CUT)))
    areas = np.linalg.norm(vectors, axis=2)
    # Nets on the − side run against u of the patch.
    values, areas = (a.reshape(-1, CUT, CUT).copy() for a in (values, areas))
    turned = boxes.side == 1
    values[turned], areas[turned] = values[turned][:, ::-1], areas[turned][:, ::-1]
    axis, place = best_cut(values, areas)
    return boxes.cut(axis, place / CUT)
