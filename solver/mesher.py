"""The meshes of one scene: equal boxes by the budget, cut where the light of the lamps changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .budget import Budget
from .containment import Containment
from .direct_light import DirectLight
from .horizon_lines import with_lines
from .kernels.pyramid import Blockers
from .memory import fits
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray
from .model.elements import Elements
from .model.scene import SceneData
from .profile_mesh import with_profiles
from .refinement import Refiner
from .stages import Stages
from .surfaces import reflectances

#: Distance above a surface at which it is asked whether something lies on it, relative to the
#: scene's size.
CONTACT = 1e-5
#: Shining patches that are never too many to look where their light changes.
MANY_LAMPS = 200
#: Share of what is wrong with the light of a mesh, in the elements that are halved.
CUT_SHARE = 0.6


class Mesher:
    """Makes meshes of different size.

    Parameters
    ----------
    scene : SceneData
        What is meshed.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    stages : Stages
        Receives counters.
    tester : Containment, optional
        Of the scene; made here where there is none yet.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        *,
        trace: bool,
        stages: Stages,
        tester: Containment | None = None,
    ) -> None:
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self._containment = Containment(scene) if tester is None else tester

    def elements(self, budget: Budget, boxes: Boxes) -> Elements:
        """Elements over ``boxes``."""
        scene = self.scene
        small = (budget.small * budget.size) ** 2
        elements = elements_on(scene.patches, boxes, nodes=budget.nodes, small=small)
        low, high = scene.patches.bounds()
        distance = CONTACT * float(np.linalg.norm(high - low))
        buried = self._containment.buried(
            elements.nodes.reshape(-1, 3), elements.normals.reshape(-1, 3), distance
        )
        return replace(elements, buried=buried.reshape(elements.weights.shape))

    def boxes(self, budget: Budget) -> Boxes:
        """Boxes of the size that ``budget`` asks for, or smaller."""
        boxes = Boxes.regular(budget.divisions, self.scene.two_sided)
        most = budget.most_elements
        if self.trace and (self.scene.sky is not None or self.scene.ground is not None):
            boxes = with_lines(boxes, self.blockers, most)
        boxes, added = with_profiles(boxes, self.scene, budget, trace=self.trace)
        if added:
            self.stages.count({"elements_added_for_profiles": added})
        lamps = int((self.scene.luminaire_index >= 0).sum())
        if lamps == 0:
            return boxes
        if most <= len(boxes) or not fits(most):
            self.stages.skipped["refinement"] = (
                f"the mesh has {len(boxes)} elements, as many as it may"
                if most <= len(boxes)
                else f"the memory that is free does not hold {most} elements"
            )
            return boxes
        if lamps > max(MANY_LAMPS, len(boxes) // 5):
            # To look at 20 points of each element would cost more than the form factors.
            self.stages.skipped["refinement"] = (
                f"{lamps} shining patches light {len(boxes)} elements"
            )
            return boxes
        light = DirectLight(self.scene, self.blockers, trace=self.trace)
        rho = reflectances(self.scene)
        refiner = Refiner(self.scene.patches, rho, light, budget.distance)
        cut, _ = refiner.refine(boxes, budget.misplaced, most)
        self.stages.count({"elements_added": len(cut) - len(boxes)})
        return cut

    def cut(self, boxes: Boxes, wrong: FloatArray, budget: Budget) -> Boxes:
        """Halve the boxes that hold most of what is ``wrong`` (n, 2), where it varies most.

        No more boxes are made than the budget allows.
        """
        total = wrong.sum(axis=1)
        order = np.argsort(-total, kind="stable")
        count = int(np.searchsorted(np.cumsum(total[order]), CUT_SHARE * total.sum())) + 1
        count = min(count, int((total > 0.0).sum()), budget.elements_at_most - len(boxes))
        if count <= 0:
            return boxes
        chosen = np.sort(order[:count])
        halves = boxes.take(chosen).halved(np.argmax(wrong[chosen], axis=1))
        kept = np.setdiff1d(np.arange(len(boxes)), chosen)
        return boxes.take(kept).joined(halves)[0]
