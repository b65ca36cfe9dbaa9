"""Surfaces that are shut in where no light comes: the inside of a table leg made of sheets.

What is seen from somewhere sees that place too. Shares of small distant elements are told by lines
that may pass between both walls of something slender, so that its inside seems to be seen as well
as its outside, and light to end in there. The rows of the inside itself know better: they see
nothing but one another. What sees less than a hundredth of anything else is therefore taken to be
hidden from it; but not where more than a hundredth of the light of any element ends there, as that
of a small lamp does in all of a room.

What is left out is bounded by reciprocity. Of what an element in the open sees, less than a
hundredth is truly shut in (Σ A_j F_ji < A_i / 100 over hidden j), and all of them together see less
than a hundredth of the hidden area (Σ A_i F_ij). There it is dark: where ρ is the reflectance and B
the highest exitance in the open, what is hidden has at most ρ B / (100 − 99 ρ), a twelfth of B for
ρ = 0.9. So a row gets at most a hundredth of its view too bright, when it is closed. Single points
close before an opening may truly see more: rows of which more than a tenth is hidden stay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .exchange import OUTSIDE, Rows, products
from .kernels.closure import sum_rows
from .model.arrays import IntArray
from .unknowns import Unknowns

#: Elements that no light reaches, if there are any.
Hidden = NDArray[np.bool_] | None

#: Form factor of all that is not shut in, below which an element is; and share of the light of an
#: element in the open that may end in what is.
LEAST = 0.01
#: Rows that are summed at a time.
BLOCK = 256
#: Share of a row up to which it is taken to see what is hidden by mistake. Mistakes came to a
#: twentieth at most, among posts of 4 cm; a row of the inside has 99 hundredths.
MISTAKEN = 0.1


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
    # What lets a little of the sky or the sun in may be lit by it alone.
    lit = shining | (unknowns.mean(rows.outside[:, 1:3].sum(axis=1)) > OUTSIDE)
    while True:
        others = 1.0 - unknowns.mean(products(rows.factors, (~lit).astype(np.float64)))
        more = (others >= LEAST) & ~lit
        if not more.any():
            more = _lit_by_small(rows, unknowns, lit)
        if not more.any():
            return ~lit if lit.any() else lit
        lit |= more


def _lit_by_small(rows: Rows, unknowns: Unknowns, lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Elements (n,) that see a ``lit`` one whose light ends among those that are not.

    It is seen little where it is small, as the opening of a downlight is. What element i sends to
    all unlit j is the share Σ A_j F_ji / A_i of its light; the rows are those of the unlit.
    """
    areas = unknowns.sums(unknowns.areas)
    unlit = np.flatnonzero(~lit[unknowns.element])
    received = np.zeros(len(lit))
    for first in range(0, len(unlit), BLOCK):
        some = unlit[first : first + BLOCK]
        received += (unknowns.areas[some, None] * rows.factors[some]).sum(axis=0)
    sending = lit & (areas > 0.0) & (received >= LEAST * areas)
    if not sending.any():
        return np.zeros_like(lit)
    return ~lit & (unknowns.mean(products(rows.factors, sending.astype(np.float64))) > 0.0)


def hide(rows: Rows, hidden: NDArray[np.bool_], at: IntArray | None = None) -> None:
    """Let ``rows``, or those ``at`` (k,), see nothing of ``hidden`` (n,) elements, in place.

    Those that see more of it than a mistake gives are before it or inside, and stay.
    """
    if at is not None:
        some = rows.take(at)
        hide(some, hidden)
        rows.put(at, some)
        return
    open_ = products(rows.factors, (~hidden).astype(np.float64))
    seen = np.flatnonzero(open_ > (1.0 - MISTAKEN) * rows.sums[:, 0])
    pairs = np.ix_(seen, np.flatnonzero(hidden))
    rows.factors[pairs] = 0.0
    rows.variances[pairs] = 0.0
    sum_rows(rows.factors, rows.variances, rows.sums)


def same_hidden(one: Hidden, other: Hidden) -> bool:
    """Whether the same elements are hidden."""
    if one is None or other is None:
        return one is other
    return np.array_equal(one, other)
