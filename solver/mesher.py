"""The meshes of one scene: equal boxes by the budget, cut where direct light changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .balance import Seam, balanced, is_balanced, smooth_seams
from .budget import Budget
from .containment import Containment
from .direct_light import sun_numbers
from .gap_cuts import in_gaps, with_gaps
from .horizon_lines import with_lines
from .kept_light import KeptLight
from .kept_mesh import LOOSER, Mesh
from .kernels.pyramid import Blockers
from .memory import fits
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.scene import CONTACT, SceneData
from .moved import points_in_new_light
from .profile_mesh import with_profiles
from .refinement import Looked, Refiner
from .reuse import Kept, tolerances
from .stages import Stages
from .surfaces import reflectances

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
    kept : Kept, optional
        What runs before this one have found; nothing when not given.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        *,
        trace: bool,
        stages: Stages,
        tester: Containment | None = None,
        kept: Kept | None = None,
    ) -> None:
        self.kept = Kept(scene, stages=stages) if kept is None else kept
        self.scene, self.blockers, self.trace, self.stages = scene, blockers, trace, stages
        self._containment = Containment(scene, blockers) if tester is None else tester
        self._refiner: Refiner | None = None
        self._sun = sun_numbers(scene, blockers)
        #: Whether neighbours are to differ by one cut at most; see `balance`.
        self.balance = False
        self._seams: list[Seam] | None = None

    def elements(self, budget: Budget, boxes: Boxes) -> Elements:
        """Elements over ``boxes``."""
        elements = self.plain_elements(budget, boxes)
        buried = self.buried(elements.nodes.reshape(-1, 3), elements.normals.reshape(-1, 3))
        return replace(elements, buried=buried.reshape(elements.weights.shape))

    def plain_elements(self, budget: Budget, boxes: Boxes) -> Elements:
        """The same without regard to what is buried."""
        small = (budget.small * budget.size) ** 2
        return elements_on(self.scene.patches, boxes, nodes=budget.nodes, small=small)

    @property
    def contact(self) -> float:
        """Distance above a surface at which it is asked whether something lies on it. [m]"""
        low, high = self.scene.patches.bounds()
        return CONTACT * float(np.linalg.norm(high - low))

    def buried(self, points: FloatArray, normals: FloatArray) -> IntArray:
        """Whether points (m, 3) of surfaces are covered, (m,) bool."""
        return self._containment.buried(points, normals, self.contact)

    def boxes(self, budget: Budget) -> tuple[Boxes, float]:
        """Boxes of the size that ``budget`` asks for, or smaller.

        Also the share of the reflected light that elements over them have in the wrong place.
        """
        boxes, misplaced = self._cut_where_light_changes(budget)
        return self.balanced(boxes, budget), misplaced

    def unrefined(self, budget: Budget) -> Boxes:
        """The same wherever light changes: cut at horizons alone."""
        return self.balanced(self._cut_at_horizons(budget), budget)

    def _cut_at_horizons(self, budget: Budget) -> Boxes:
        boxes = Boxes.regular(budget.divisions, self.scene.two_sided)
        if self.trace and (self.scene.sky is not None or self.scene.ground is not None):
            boxes = with_lines(boxes, self.blockers, budget.most_elements)
        return boxes

    def _cut_where_light_changes(self, budget: Budget) -> tuple[Boxes, float]:
        """The same, without regard to their neighbours."""
        boxes, most = self._cut_at_horizons(budget), budget.most_elements
        if self.trace and most > len(boxes) and fits(most):
            boxes, added = with_gaps(boxes, self.scene, budget)
            if added:
                self.stages.count({"elements_added_for_gaps": added})
        boxes, added = with_profiles(boxes, self.scene, budget, trace=self.trace)
        if added:
            self.stages.count({"elements_added_for_profiles": added})
        lamps = int((self.scene.luminaire_index >= 0).sum())
        if lamps == 0 and not len(self._sun):
            return boxes, 0.0
        if most <= len(boxes) or not fits(most):
            self.stages.skipped["refinement"] = (
                f"the mesh has {len(boxes)} elements, as many as it may"
                if most <= len(boxes)
                else f"the memory that is free does not hold {most} elements"
            )
            return boxes, 0.0
        if lamps > max(MANY_LAMPS, len(boxes) // 5):
            # To look at 20 points of each element would cost more than the form factors.
            self.stages.skipped["refinement"] = (
                f"{lamps} shining patches light {len(boxes)} elements"
            )
            return boxes, 0.0
        cut, misplaced = self._refine_by(budget).refine(boxes, budget.misplaced, most)
        self.stages.count({"elements_added": len(cut) - len(boxes)})
        return cut, misplaced

    def _refine_by(self, budget: Budget) -> Refiner:
        if self._refiner is None:
            light = KeptLight(self.scene, self.blockers, trace=self.trace, kept=self.kept)
            rho = reflectances(self.scene)
            self._refiner = Refiner(self.scene.patches, rho, light, budget.distance)
        return self._refiner

    @property
    def looked(self) -> Looked | None:
        """Light of lamps and sun on the last mesh; None where none was looked at."""
        return None if self._refiner is None else self._refiner.looked

    def lamps(self, budget: Budget) -> tuple[IntArray, FloatArray]:
        """Lamps of the sides (p, 2) of all patches; exitances of their pieces and the sun."""
        index = self.scene.luminaire_index
        if not (index >= 0).any() and not len(self._sun):
            return index, np.empty(0)
        return index, self._refine_by(budget).light.shining

    def misplaced_again(self, mesh: Mesh, budget: Budget) -> float:
        """Share of the reflected light in the wrong place on the mesh of a run before this one."""
        if with_profiles(mesh.boxes, self.scene, budget, trace=self.trace)[1]:
            return np.inf  # it was made for lamps that are more even
        if self._has_new_gaps(mesh, budget):
            return np.inf
        if mesh.looked is None and not len(self._sun):
            return 0.0
        refiner, (index, levels) = self._refine_by(budget), self.lamps(budget)
        moved = not np.array_equal(mesh.nets, self.scene.patches.control_points)
        dimmed, looked = not np.array_equal(mesh.lamps[1], levels), mesh.looked
        other = not np.array_equal(mesh.lamps[0], index) or len(mesh.lamps[1]) != len(levels)
        # Of what was looked at under a sun it is not known how much the lamps made, and pieces of
        # uneven lamps may be others.
        mixed = len(self._sun) > 0
        mixed |= any(lamp.profile is not None for lamp in self.scene.luminaires)
        if other or (dimmed and (moved or mixed or not refiner.light.is_like(mesh.lamps[1]))):
            return refiner.refine(mesh.boxes, 1.0, len(mesh.boxes))[1]
        if looked is None:
            return 0.0  # it is one that no light decides on
        if dimmed:
            looked = refiner.relit(mesh.boxes, looked, mesh.lamps[1])
        elif moved:
            places = refiner.places(mesh.boxes)
            touched = points_in_new_light(self.scene, mesh.nets, mesh.boxes.patch, *places)
            most = refiner.at_most(mesh.boxes, looked, np.asarray(touched.any(axis=1)))
            if mesh.still_good(most, budget.misplaced):
                return most
            looked = refiner.renewed(mesh.boxes, looked, touched)
        return refiner.again(mesh.boxes, looked)

    def _has_new_gaps(self, mesh: Mesh, budget: Budget) -> bool:
        """Whether ``mesh`` leaves uncut what it was not made for: gaps, or light in them."""
        if not self.trace or budget.most_elements <= len(mesh.boxes):
            return False
        if np.array_equal(mesh.nets, self.scene.patches.control_points):
            rho = reflectances(self.scene)
            some = (rho > 0.0) | (mesh.reflectances > 0.0)
            change = rho[some] / np.maximum(mesh.reflectances[some], 1e-300)
            # Shares of what is reflected change by no more than this.
            if not some.any() or change.max() <= LOOSER * change.min():
                return False
        of = tolerances(budget), mesh.boxes, reflectances(self.scene)
        caster = self._containment.caster_of_all
        found = in_gaps(mesh.boxes, self.scene, budget, self.kept.of_parts("gaps", of), caster)
        self.kept.keep_of_parts("gaps", of, found)
        return found.left > LOOSER

    def balanced(self, boxes: Boxes, budget: Budget) -> Boxes:
        """Boxes of which no edge has more than two neighbours, where that is asked for."""
        if not self.balance:
            self.stages.skipped["balance of the mesh"] = "not asked for"
            return boxes
        if self._seams is None:
            self._seams = smooth_seams(self.blockers)
        even = balanced(boxes, self._seams, budget.elements_at_most)
        if not is_balanced(even, self._seams):
            self.stages.skipped["balance of the mesh"] = (
                f"incomplete: no more than {budget.elements_at_most} elements are made"
            )
        if len(even) > len(boxes):
            self.stages.count({"elements_added_for_balance": len(even) - len(boxes)})
        return even

    def misplaced(self, boxes: Boxes, otherwise: float) -> float:
        """Share of the reflected light in the wrong place on ``boxes``, where that is known."""
        if self._refiner is None:
            return otherwise
        return self._refiner.refine(boxes, 1.0, len(boxes))[1]

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
        return self.balanced(boxes.take(kept).joined(halves)[0], budget)
