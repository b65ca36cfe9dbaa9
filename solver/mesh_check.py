"""Comparison of one scene solved on two meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .field import Field
from .model.arrays import FloatArray

#: Most that is taken for left of a change, where meshes hardly differ.
MOST_LEFT = 5.0
#: Error of indirect light against the share of light that is misplaced: what 95 % of the sensors of
#: plain rooms need at most.
OF_MISPLACED = 1.25


@dataclass(frozen=True, slots=True)
class MeshError:
    """Error of indirect light by the mesh.

    Attributes
    ----------
    misplaced, lacking : float
        Share of the lamps' reflected light in the wrong place, and of all flux that the ledger
        lacks.
    """

    misplaced: float
    lacking: float

    def of(
        self, light: FloatArray, of_lamps: FloatArray, change: FloatArray | float = 0.0
    ) -> FloatArray:
        """Error (m,) of indirect ``light`` (m,), given what is left of its ``change``. [lx]

        ``of_lamps`` (m,) is the part of it that comes from lamps.
        """
        least = OF_MISPLACED * self.misplaced * of_lamps
        return np.asarray(np.maximum(change, least) + self.lacking * light)


def left_of_change(field: Field, coarse: Field) -> float:
    """Error of the finer mesh against its change from a coarser one, of a second-order method.

    Errors go with the square of the elements' sizes. Patches are cut into whole numbers: how much
    smaller the elements are is seen from their areas, each weighted with itself.
    """
    fine, large = (float((a**2).sum() / a.sum()) for a in (_areas(field), _areas(coarse)))
    return 1.0 / max(large / fine - 1.0, 1.0 / MOST_LEFT)


def _areas(field: Field) -> FloatArray:
    return field.surfaces.elements.areas


def element_shift(field: Field, coarse: Field) -> FloatArray:
    """Change (n,) of the mean illuminance over the coarse element that holds each fine one. [lx]"""
    fine, large = field.surfaces.elements, coarse.surfaces.elements
    fine_key, large_key = fine.patch_index * 2 + fine.side, large.patch_index * 2 + large.side
    first = np.searchsorted(large_key, fine_key)
    last = np.searchsorted(large_key, fine_key, side="right")
    center = 0.5 * (fine.boxes[:, ::2] + fine.boxes[:, 1::2])
    parent = np.empty(len(fine), dtype=np.int64)
    for k, (u, v) in enumerate(center):
        box = large.boxes[first[k] : last[k]]
        inside = (box[:, 0] <= u) & (u <= box[:, 1]) & (box[:, 2] <= v) & (v <= box[:, 3])
        parent[k] = first[k] + int(np.argmax(inside))
    areas, values = field.surfaces.areas, field.light.luminous()
    total = np.bincount(parent, weights=areas, minlength=len(large))
    flux = np.bincount(parent, weights=areas * values, minlength=len(large))
    mean = flux / np.where(total > 0.0, total, 1.0)
    return np.asarray(np.abs(mean - coarse.light.luminous())[parent])
