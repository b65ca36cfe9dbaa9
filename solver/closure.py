"""What the sum of a row of form factors tells of its error, and its correction.

All directions together give 1: what is missing of a row is an error of the row, known to the last
digit. It costs nothing, and is independent of the deviations that the sampling itself states.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .model.arrays import FloatArray, IntArray

#: Standard deviations beyond which a defect is not believed to be noise.
BEYOND = 4.0
#: Rows done at a time: what is made of them in between stays in the processor's cache.
_BLOCK = 16
#: Passes of the correction; factors that would fall below 0 leave their share to the others.
_PASSES = 4


def rows_beyond_noise(
    rows: Rows, totals: FloatArray | float, *, eps: float, outside: bool = False
) -> IntArray:
    """Rows whose sum misses ``totals`` (m,) by more than they say, the worst first.

    Parameters
    ----------
    rows : Rows
        Form factors and their variances.
    totals : (m,) array or float
        What each row must sum to; 0 for receivers that get no light.
    eps : float
        Relative error of what was not sampled.
    outside : bool
        Whether sky and ground, as the meridians saw them, count among the elements.
    """
    sums, spread = np.empty(len(rows.factors)), np.empty(len(rows.factors))
    for block in _blocks(rows):
        values, variances = _columns(rows, block, outside)
        sums[block], spread[block] = values.sum(axis=1), variances.sum(axis=1)
    excess = np.abs(totals - sums) - BEYOND * np.sqrt(spread) - eps
    found = np.flatnonzero((excess > 0.0) & (sums > 0.0))
    return np.asarray(found[np.argsort(-excess[found], kind="stable")])


def close_rows(
    rows: Rows, totals: FloatArray | float, *, eps: float = 0.0, outside: bool = False
) -> int:
    """Correct each row, in place, so that it sums to ``totals`` (m,).

    The least change in units of each factor's standard deviation, min Σ (δ_j / σ_j)² with
    Σ δ_j = defect, is δ_j = defect σ_j² / Σ σ². What was sampled has the deviation it states, all
    else the relative error ``eps``. Where the defect is more than four standard deviations, the
    deviations were wrong and are raised until it is four. Variances become what is left of them.

    Returns
    -------
    int
        How many rows were corrected.
    """
    all_totals = np.broadcast_to(np.asarray(totals, dtype=np.float64), len(rows.factors))
    count = 0
    for block in _blocks(rows):
        values, sampled = _columns(rows, block, outside)
        variances = sampled + (eps * values) ** 2
        values, left, ours = _closed(values, sampled, variances, all_totals[block])
        _put(rows, block, values, left, outside)
        count += int(ours.sum())
    return count


def _closed(
    values: FloatArray, sampled: FloatArray, variances: FloatArray, totals: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Corrected values, what is left of the sampled variances, and which rows needed it."""
    total = variances.sum(axis=1)
    defect = totals - values.sum(axis=1)
    ours = (total > 0.0) & (defect != 0.0)
    raised = np.maximum(defect**2 / (BEYOND**2 * np.where(ours, total, 1.0)), 1.0)
    raised = np.where(ours, raised, 1.0)
    # What is left of the variance after conditioning on the sum.
    share = np.where(ours, 1.0 / np.where(ours, total, 1.0), 0.0)
    left = sampled * raised[:, None] * (1.0 - variances * share[:, None])
    free = variances
    for _ in range(_PASSES):
        room = free.sum(axis=1)
        open_ = ours & (room > 0.0) & (np.abs(defect) > 1e-15)
        if not open_.any():
            break
        step = np.where(open_, defect / np.where(open_, room, 1.0), 0.0)
        values = np.maximum(values + step[:, None] * free, 0.0)
        free = np.where(values > 0.0, free, 0.0)
        defect = totals - values.sum(axis=1)
    return values, left, ours


def _blocks(rows: Rows) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, len(rows.factors), _BLOCK)]


def _columns(rows: Rows, block: slice, outside: bool) -> tuple[FloatArray, FloatArray]:
    """Factors and variances, those of sky and ground behind those of the elements."""
    factors, variances = rows.factors[block], rows.variances[block].astype(np.float64)
    if not outside:
        return factors, variances
    bright, sky, ground, sky_spread, ground_spread = rows.outside[block].T
    # The variance of the sky's factor, from that of its light.
    sky_spread = (
        sky_spread * np.where(bright > 0.0, sky / np.where(bright > 0.0, bright, 1.0), 0) ** 2
    )
    return (
        np.column_stack([factors, sky, ground]),
        np.column_stack([variances, sky_spread, ground_spread]),
    )


def _put(rows: Rows, block: slice, values: FloatArray, left: FloatArray, outside: bool) -> None:
    n = rows.factors.shape[1]
    rows.factors[block], rows.variances[block] = values[:, :n], left[:, :n]
    if outside:
        seen = rows.outside[block]
        old = np.where(seen[:, 1] > 0.0, seen[:, 1], 1.0)
        seen[:, 0] *= values[:, n] / old
        after = np.where(values[:, n] > 0.0, values[:, n], 1.0)
        seen[:, 3] = left[:, n] * (seen[:, 0] / after) ** 2
        seen[:, 1:3], seen[:, 4] = values[:, n:], left[:, n + 1]
