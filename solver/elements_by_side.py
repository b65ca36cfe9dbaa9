"""Which elements lie on a patch side."""

from __future__ import annotations

import numpy as np

from .model.arrays import IntArray, frozen
from .model.elements import Elements


def elements_by_side(elements: Elements, patches: int) -> tuple[IntArray, IntArray]:
    """Elements of patch side 2 p + side as CSR: (start (2 p + 1,), order (n,))."""
    key = 2 * elements.patch_index + elements.side
    order = np.argsort(key, kind="stable")
    start = np.searchsorted(key[order], np.arange(2 * patches + 1))
    return frozen(start, np.int64), frozen(order, np.int64)
