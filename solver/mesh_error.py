"""The error that a mesh leaves in indirect light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .model.arrays import FloatArray

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
    unseen : float
        Elements that the iterated gather left out, against those it looked at, by their worth.
    """

    misplaced: float
    lacking: float
    unseen: float

    def of(self, light: FloatArray, of_lamps: FloatArray, change: FloatArray) -> FloatArray:
        """Error (m,) of indirect ``light`` (m,) that the iterated gather moved by ``change``. [lx]

        ``of_lamps`` (m,) is the part of it that comes from lamps. One value's change may pass
        through zero: none is taken for less than the root mean square.
        """
        change = np.abs(change) * (1.0 + self.unseen)
        if len(change):
            change = np.maximum(change, np.sqrt(np.mean(change**2)))
        least = OF_MISPLACED * self.misplaced * of_lamps
        return np.asarray(np.maximum(change, least) + self.lacking * light)
