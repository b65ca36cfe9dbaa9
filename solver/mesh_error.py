"""The error that a mesh leaves in indirect light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .incident import Gathered
from .model.arrays import FloatArray
from .model.result import luminous

#: Error of indirect light against the share of light that is misplaced: what 95 % of the sensors of
#: plain rooms need at most.
OF_MISPLACED = 3.0


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
    lamps : tuple of str or None
        Light groups whose light it is that is misplaced; all when not given.
    """

    misplaced: float
    lacking: float
    unseen: float
    lamps: tuple[str, ...] | None

    def of(self, light: Gathered, change: FloatArray) -> FloatArray:
        """Error (m,) of the indirect ``light`` that the iterated gather moved by ``change``. [lx]

        One value's change may pass through zero: none is taken for less than the root mean square.
        """
        indirect = light.luminous("indirect")
        change = np.abs(change) * (1.0 + self.unseen)
        if len(change):
            change = np.maximum(change, np.sqrt(np.mean(change**2)))
        told = indirect
        if self.lamps is not None:
            own = [luminous(light.components[f"{group}.indirect"]) for group in self.lamps]
            told = np.asarray(sum(own, np.zeros(len(indirect))))
        least = OF_MISPLACED * self.misplaced * told
        return np.asarray(np.maximum(change, least) + self.lacking * indirect)
