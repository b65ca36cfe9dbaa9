"""What is known of lamps with webs on receivers to which nothing has changed since an earlier run.

Whatever has been painted, dimmed or moved elsewhere: as a receiver stands and sees the lamp as it
did, so is what was found for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from .model.arrays import IntArray
from .reuse import Kept

#: How much coarser than asked for the digits of a lamp may be, which depend on how bright others
#: are: what they leave wrong is stated all the same.
COARSER = 2.0


class ByRows(Protocol):
    """Values of which each row is one receiver's."""

    def put(self, rows: IntArray, other: Self) -> Self:
        """These with those of ``other`` at ``rows``."""
        ...


Value = TypeVar("Value", bound=ByRows)


def kept_by_rows(
    kept: Kept,
    of: tuple[Any, ...],
    told: tuple[NDArray[Any], ...],
    make: Callable[[IntArray], Value],
    eps: float = 0.0,
) -> Value:
    """What ``make`` finds for m receivers; of those that are as before, what it found then.

    Parameters
    ----------
    kept : Kept
        What runs before this one have found.
    of : tuple
        What all rows depend on.
    told : tuple of (m, ...) arrays
        What else each row depends on.
    make : callable
        Finds what is asked for of receivers (k,) that are told by their numbers.
    eps : float
        Error that is asked for; what has up to `COARSER` times of it is taken.
    """
    count = len(told[0])
    key = (*of, *(a.shape for a in told))
    before: tuple[tuple[NDArray[Any], ...], Value, float] | None = kept.of_parts("webs", key)
    if before is None or before[2] > COARSER * eps:
        found = make(np.arange(count))
    else:
        differs = [
            (a != b).reshape(count, -1).any(axis=1) for a, b in zip(told, before[0], strict=True)
        ]
        again = np.flatnonzero(np.any(differs, axis=0))
        found = before[1].put(again, make(again)) if len(again) else before[1]
        kept.stages.count({"web_rows_reused": count - len(again)})
        eps = max(eps, before[2]) if len(again) < count else eps
    kept.keep_of_parts("webs", key, (told, found, eps))
    return found
