"""How finely elements are told as sources of light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray

#: What is told this much more coarsely than asked for is told finely enough.
COARSER = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Fineness:
    """Of the sources of one mesh; row i of every array is the same element.

    Attributes
    ----------
    cell_eps : (n,) array
        Form factor below which a partly hidden cell is sampled.
    bright : (n,) bool array
        Whether it is told by lines of sight.
    dim : (n,) array
        Error of unoccluded form factors against the common one: less for what is bright.
    """

    cell_eps: FloatArray
    bright: NDArray[np.bool_]
    dim: FloatArray

    def does_for(self, asked: Fineness) -> bool:
        """Whether it is as fine as ``asked``, or nearly."""
        fine = (self.cell_eps <= COARSER * asked.cell_eps) & (self.dim <= COARSER * asked.dim)
        return bool(fine.all()) and not bool((asked.bright & ~self.bright).any())
