"""The mesh of a run, and what decided on it: taken again by later runs while it is good enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fineness import Fineness
from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .refinement import Looked

#: Misplaced light up to which a mesh is taken again, against what it may have.
LOOSER = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """What the light of a run decided on, besides the values it led to.

    Attributes
    ----------
    boxes : Boxes
        Of its n elements.
    misplaced : float
        Share of the reflected light in the wrong place.
    looked : Looked or None
        Light of lamps and sun on it, where that decided on it.
    nets : (p, 4, 4, 4) array
        Control nets of the patches.
    reflectances : (p, 2) array
        Luminous reflectances of their sides.
    lamps : tuple of (p, 2) int array and array
        Lamp of each side of the patches; exitances of their pieces [lm/m²], and the sun.
    fineness : Fineness
        Of the elements as sources.
    halved : (c,) int array
        Elements on which the light was looked at more closely.
    converged : bool
        Whether the accuracy asked for was reached.
    """

    boxes: Boxes
    misplaced: float
    looked: Looked | None
    nets: FloatArray
    reflectances: FloatArray
    lamps: tuple[IntArray, FloatArray]
    fineness: Fineness
    halved: IntArray
    converged: bool

    def still_good(self, misplaced: float, allowed: float) -> bool:
        """Whether the mesh serves light of which it has the share ``misplaced`` wrong."""
        return misplaced <= LOOSER * max(allowed, self.misplaced)

    def fine_enough(self, boxes: Boxes, asked: Fineness) -> Fineness:
        """Its own fineness where that does, else what is asked for."""
        does = same_boxes(self.boxes, boxes) and self.fineness.does_for(asked)
        return self.fineness if does else asked


def same_boxes(one: Boxes, other: Boxes) -> bool:
    """Whether two meshes have the same elements."""
    return one is other or (
        len(one) == len(other)
        and np.array_equal(one.patch, other.patch)
        and np.array_equal(one.side, other.side)
        and np.array_equal(one.ends, other.ends)
    )
