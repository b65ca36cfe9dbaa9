"""What rows see of the sky, when that is another one than they were found under."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from .exchange import OUTSIDE, Rows
from .model.arrays import FloatArray
from .row_finder import Ask

#: Where `sky_tone` has the luminance of a sky.
LEVEL = 6


def under_sky(
    rows: Rows,
    known: FloatArray,
    tone: FloatArray,
    asked: Ask,
    find: Callable[[Ask], Rows],
) -> Rows:
    """The same rows under another sky, given what kernels need of both (10,), (0,) of none.

    Of another luminance of the same sky they see as much; of another one the rows that see any are
    found once more, for its light alone.
    """
    outside = rows.outside.copy()
    seen = np.flatnonzero(outside[:, 1] > OUTSIDE)
    if not len(tone) or not len(seen):
        return dataclasses.replace(rows, outside=outside)
    same = len(known) and np.array_equal(np.delete(known, LEVEL), np.delete(tone, LEVEL))
    if same and known[LEVEL] > 0.0:
        outside[:, [0, 3]] *= (tone[LEVEL] / known[LEVEL]) ** np.array([1, 2])
    else:
        new = find(asked.taken(seen)).outside
        # Slivers are as bright as what others see.
        bright = float(new[:, 0].sum()) / max(float(new[:, 1].sum()), 1e-300)
        outside[:, 0] = bright * outside[:, 1]
        share = outside[seen, 1] / np.where(new[:, 1] > 0.0, new[:, 1], 1.0)
        outside[seen, 0], outside[seen, 3] = share * new[:, 0], share**2 * new[:, 3]
    return dataclasses.replace(rows, outside=outside)
