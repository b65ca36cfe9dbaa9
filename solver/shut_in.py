"""Surfaces that are shut in where no light comes: the inside of a table leg made of sheets.

What is seen from somewhere sees that place too. Shares of small distant elements are told by lines
that may pass between both walls of something slender, so that its inside seems to be seen as well
as its outside, and light to end in there. The rows of the inside itself know better: they see
nothing but one another. What sees less than a hundredth of anything else is therefore taken to be
hidden from it. By reciprocity, Σ A_i F_ij over all these i and hidden j is
less than a hundredth of the hidden area: that much, at most, is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows, products
from .kernels.closure import sum_rows
from .unknowns import Unknowns

#: Form factor of all that is not shut in, below which an element is; and light of lamps on what
#: they reach, against the mean of all.
LEAST = 0.01


def shut_in(rows: Rows, unknowns: Unknowns, shining: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which elements (n,) no light reaches: they see one another, and nothing else or outside.

    Parameters
    ----------
    rows : Rows
        Of the unknowns, to the n elements.
    unknowns : Unknowns
        Of the elements.
    shining : (n,) bool array
        Elements of lamps.
    """
    direct = unknowns.mean(products(rows.factors, shining.astype(np.float64)))
    lit = shining | (direct > LEAST * max(float(direct.mean()), 1e-300))
    while True:
        others = 1.0 - unknowns.mean(products(rows.factors, (~lit).astype(np.float64)))
        more = (others >= LEAST) & ~lit
        if not more.any():
            return ~lit if lit.any() else lit
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
