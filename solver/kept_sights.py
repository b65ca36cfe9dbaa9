"""Which points of elements receivers are known to see, for runs after the one that asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kernels.half_hidden import Sights


def without(sights: Sights, some: NDArray[np.bool_]) -> Sights:
    """All pairs but those of ``some`` receivers (m,)."""
    count = np.diff(sights.start)
    kept = np.repeat(~some, count)
    start = np.concatenate([[0], np.cumsum(np.where(some, 0, count))])
    return Sights(start, sights.element[kept], sights.seen[kept])


def joined(parts: list[Sights]) -> Sights:
    """Of the receivers of all ``parts``, one after the other."""
    count = np.concatenate([np.diff(part.start) for part in parts])
    start = np.concatenate([[0], np.cumsum(count)])
    element = np.concatenate([part.element for part in parts])
    return Sights(start, element, np.concatenate([part.seen for part in parts]))
