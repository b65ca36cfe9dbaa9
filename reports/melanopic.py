"""Melanopic equivalent daylight illuminance (EDI, CIE S 026) through a year.

Illuminances are (m, n) of m points in n steps, as in `autonomy`.

References
----------
.. [1] T. M. Brown et al., "Recommendations for daytime, evening, and nighttime indoor light
   exposure to best support physiology, sleep, and wakefulness in healthy adults", PLoS Biology
   20(3), 2022, e3001571: by day at least 250 lx at the eye, facing sideways some 1.2 m above the
   floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.model.arrays import FloatArray

from .autonomy import daylight_autonomy

#: Least melanopic EDI at eyes by day. [1] [lx]
ENOUGH_LX = 250.0


def melanopic(edi: FloatArray, counted: NDArray[np.bool_]) -> FloatArray:
    """Mean [lx], and share of the steps with enough, (2, m) over the steps that count."""
    enough = daylight_autonomy(edi, counted, ENOUGH_LX)
    if not counted.any():
        return np.stack([enough, enough])
    return np.stack([edi[:, counted].mean(axis=1, dtype=np.float64), enough])
