"""Parts of cells that one patch each is made for, and the patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from .compare import BoolArray


@dataclass(slots=True)
class Boxes:
    """Parts of cells: row of the cell and (s0, s1, t0, t1).

    ``before`` is the angle of the box that one was cut from, ``vain`` the number of last halvings
    that made it no better.
    """

    cell: IntArray
    box: FloatArray
    before: FloatArray
    vain: IntArray

    @classmethod
    def of(cls, cell: IntArray, box: FloatArray) -> Boxes:
        """Boxes of which nothing is known."""
        return cls(cell, box, np.full(len(cell), np.inf), np.zeros(len(cell), dtype=np.int64))

    def on_border(self) -> BoolArray:
        """Mask (n, 4) of boxes whose side v=0, u=1, v=1, u=0 lies on that of the cell."""
        s0, s1, t0, t1 = self.box.T
        return np.stack([t0 == 0.0, s1 == 1.0, t1 == 1.0, s0 == 0.0], axis=1)

    @property
    def area(self) -> FloatArray:
        """Share (n,) of the unit square of their cells."""
        s0, s1, t0, t1 = self.box.T
        return np.asarray((s1 - s0) * (t1 - t0))

    def take(self, rows: IntArray | BoolArray | slice) -> Boxes:
        """Some of the boxes."""
        return Boxes(self.cell[rows], self.box[rows], self.before[rows], self.vain[rows])

    def cut(self, split: IntArray, cuts: FloatArray) -> Boxes:
        """The boxes cut in s (1), in t (2), in both (3) or not (0) at ``cuts`` (n, 2)."""
        box, row = self.box, np.arange(len(self.cell))
        for axis in (0, 1):
            some = (split[row] & (1 + axis)) > 0
            first, second = box.copy(), box[some]
            first[some, 2 * axis + 1] = second[:, 2 * axis] = cuts[row[some], axis]
            box, row = np.concatenate([first, second]), np.append(row, row[some])
        return Boxes(self.cell[row], box, self.before[row], self.vain[row])


@dataclass(slots=True)
class Leaves:
    """Boxes with their patches, what was measured on these, and what they were compared with.

    ``errors`` (n, 5) as in `compare.Found`; ``points`` and ``normals`` (n, 7, 7, 3) of the surface.
    """

    boxes: Boxes
    nets: FloatArray
    errors: FloatArray
    points: FloatArray
    normals: FloatArray

    def take(self, rows: IntArray | BoolArray) -> Leaves:
        """Some of the leaves."""
        return Leaves(
            self.boxes.take(rows), self.nets[rows], self.errors[rows], self.points[rows],
            self.normals[rows],
        )  # fmt: skip


def together(some: Sequence[Boxes]) -> Boxes:
    """All boxes of several sets."""
    return Boxes(*(np.concatenate([getattr(b, name) for b in some]) for name in Boxes.__slots__))


def all_leaves(some: Sequence[Leaves]) -> Leaves:
    """All leaves of several sets."""
    arrays = (np.concatenate([getattr(x, n) for x in some]) for n in Leaves.__slots__[1:])
    return Leaves(together([x.boxes for x in some]), *arrays)
