"""Lamps' light on large elements near them, by what the lamps see of these.

The few nodes of an element that is larger than its distance to a lamp tell the mean of the lamp's
light badly. The lamp knows it better: A_lamp F_lamp→element is the same flux [1], and its form
factor is exact over the whole of the element, however large and near that is.

References
----------
.. [1] M. F. Modest, "Radiative Heat Transfer", 3rd ed., Academic Press, 2013, section 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .model.arrays import FloatArray, IntArray
from .surfaces import Surfaces
from .unknowns import Unknowns

#: Elements that are this much larger than the lamp's and nearer than this many times their size.
LARGER, NEAR = 2.0, 2.0
#: Deviation of the lamp's form factor up to which it is believed, relative to it.
SURE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class LampShares:
    """Mean form factors of elements to lamps, where the lamps know them better.

    Attributes
    ----------
    lamps : (k,) int array
        Shining elements that nothing but form factors tells of: webs are none of them.
    means : (n, k) array
        Mean form factors from the elements to them by reciprocity.
    better : (n, k) bool array
        Where these are to be used: on elements near the lamp that are larger than it.
    """

    lamps: IntArray
    means: FloatArray
    better: NDArray[np.bool_]

    @classmethod
    def of(cls, rows: Rows, surfaces: Surfaces, unknowns: Unknowns) -> LampShares:
        """Those of a mesh, by the ``rows`` from all its unknowns."""
        lamps = np.flatnonzero((surfaces.diffuse > 0.0).any(axis=1) & (surfaces.areas > 0.0))
        n, areas, centers = (
            len(surfaces.areas),
            surfaces.areas,
            surfaces.elements.nodes.mean(axis=1),
        )
        means, better = np.zeros((n, len(lamps))), np.zeros((n, len(lamps)), dtype=bool)
        for k, lamp in enumerate(lamps):
            own = np.flatnonzero(unknowns.element == lamp)
            share = unknowns.areas[own] / unknowns.areas[own].sum()
            seen = share @ rows.factors[own]
            variance = share**2 @ rows.variances[own]
            means[:, k] = areas[lamp] * seen / np.where(areas > 0.0, areas, np.inf)
            away = np.linalg.norm(centers - centers[lamp], axis=1)
            near = (areas > LARGER * areas[lamp]) & (away**2 < NEAR**2 * areas)
            better[:, k] = near & (variance <= (SURE * seen) ** 2) & (seen > 0.0)
        return cls(lamps, means, better)

    def factors(self, rows: Rows, unknowns: Unknowns) -> FloatArray:
        """Form factors (m, k) of receivers on elements to the lamps, scaled to the better means."""
        found = np.asarray(rows.factors[:, self.lamps], dtype=np.float64)
        if not self.better.any():
            return found
        mean, of = unknowns.mean(found), unknowns.element
        scale = np.where(
            self.better & (mean > 0.0), self.means / np.where(mean > 0.0, mean, 1.0), 1
        )
        even = np.where(self.better & (mean == 0.0), self.means, 0.0)
        return np.asarray(found * scale[of] + even[of])
