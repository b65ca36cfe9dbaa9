"""Surfaces that are shut in where no light comes: the inside of a table leg made of sheets.

What is seen from somewhere sees that place too. Shares of small distant elements are told by lines
that may pass between both walls of something slender, so that its inside seems to be seen as well
as its outside, and light to end in there. The rows of the inside itself know better: they see
nothing but one another. What sees less than a hundredth of surfaces that light can come from is
therefore taken to be hidden from them. By reciprocity, Σ A_i F_ij over all these i and hidden j is
less than a hundredth of the hidden area: that much, at most, is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows, products
from .kernels.closure import sum_rows
from .model.arrays import FloatArray
from .unknowns import Unknowns

#: Form factor of all that light can come from, below which it is taken to come from nowhere.
LEAST = 0.01


def shut_in(
    rows: Rows, unknowns: Unknowns, shining: NDArray[np.bool_], *, outside: bool
) -> NDArray[np.bool_]:
    """Which elements (n,) no light reaches.

    Parameters
    ----------
    rows : Rows
        Of the unknowns, to the n elements.
    unknowns : Unknowns
        Of the elements.
    shining : (n,) bool array
        Elements of lamps.
    outside : bool
        Whether light comes from sky, sun or ground.
    """
    lit = np.asarray(shining, dtype=bool).copy()
    sky: FloatArray | float = rows.outside[:, 1:3].sum(axis=1) if outside else 0.0
    while True:
        seen = products(rows.factors, lit.astype(np.float64)) + sky
        more = (unknowns.mean(seen) >= LEAST) & ~lit
        if not more.any():
            return ~lit
        lit |= more


def hide(rows: Rows, hidden: NDArray[np.bool_]) -> None:
    """Let ``rows`` see nothing of ``hidden`` (n,) elements, in place.

    Those that see little else are among them, and stay.
    """
    open_ = products(rows.factors, (~hidden).astype(np.float64))
    some = np.flatnonzero(open_ > 0.5 * rows.sums[:, 0])
    at = np.ix_(some, np.flatnonzero(hidden))
    rows.factors[at] = 0.0
    rows.variances[at] = 0.0
    sum_rows(rows.factors, rows.variances, rows.sums)
