"""Elements after parts have moved: those of all other parts are known."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from .budget import Budget
from .mesh import Boxes
from .mesher import Mesher
from .model.arrays import FloatArray
from .model.elements import Elements
from .moved import moved_patches, places_of
from .reuse import Kept, tolerances


def kept_elements(kept: Kept, mesher: Mesher, budget: Budget, boxes: Boxes) -> Elements:
    """Elements over ``boxes``, as far as a run before this one has not made them."""
    of = tolerances(budget), boxes

    def make() -> Elements:
        before = kept.of_parts("elements", of)
        known = None if before is None else _renewed(before, mesher, budget, boxes)
        return known or mesher.elements(budget, boxes)

    found = kept.find("elements", of, make)
    kept.keep_of_parts("elements", of, (mesher.scene.patches.control_points, found))
    return found


def _renewed(
    known: tuple[FloatArray, Elements], mesher: Mesher, budget: Budget, boxes: Boxes
) -> Elements | None:
    """Elements as they are now; None where all are to be made.

    ``known`` are the control nets (p, 4, 4, 4) of the patches as they were, and the elements then.
    """
    nets, before = known
    patches = mesher.scene.patches
    now = patches.control_points
    ends = np.stack([(n[..., :3] / n[..., 3:]).reshape(-1, 3) for n in (nets, now)])
    if not (
        np.array_equal(ends[0].min(axis=0), ends[1].min(axis=0))
        and np.array_equal(ends[0].max(axis=0), ends[1].max(axis=0))
    ):
        return None  # what counts as touching depends on the size of the scene
    dirty = moved_patches(nets, now)
    rows = np.flatnonzero(dirty[boxes.patch])
    part = mesher.plain_elements(budget, boxes.take(rows))
    every = {one.name: getattr(before, one.name).copy() for one in fields(before)}
    for name, array in every.items():
        array[rows] = getattr(part, name)
    nodes, balls = every["nodes"], places_of(nets, now, dirty, patches.part_index).parts
    contact = mesher.contact
    near = np.zeros(nodes.shape[:2], dtype=bool)
    near[rows] = True
    for ball in balls:
        near |= np.linalg.norm(nodes - ball[:3], axis=2) <= ball[3] + contact
    every["buried"][near] = mesher.buried(nodes[near], every["normals"][near])
    return Elements(**every)
