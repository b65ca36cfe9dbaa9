"""What the sum of a row of form factors tells of its error, and its correction.

All directions together give 1: what is missing of a row is an error of the row, known to the last
digit. It costs nothing, and is independent of the deviations that the sampling itself states.
"""

from __future__ import annotations

import numpy as np

from .dome import carried_variance
from .exchange import Rows
from .model.arrays import FloatArray, IntArray

#: Standard deviations beyond which a defect is not believed to be noise.
BEYOND = 4.0
#: Passes of the correction; factors that would fall below 0 leave their share to the others.
_PASSES = 4
#: Rows at a time: the arrays in between then stay in the processor's cache.
_BLOCK = 16


def rows_beyond_noise(
    rows: Rows,
    totals: FloatArray | float,
    *,
    eps: float,
    outside: bool = False,
    spread: FloatArray | float = 0.0,
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
    spread : (m,) array or float
        Variance of ``totals``.
    """
    sums = rows.factors.sum(axis=1)
    variance = rows.variances.sum(axis=1, dtype=np.float64) + spread
    if outside:
        sums += rows.outside[:, 1:3].sum(axis=1)
        variance += _outside_variances(rows).sum(axis=1)
    excess = np.abs(totals - sums) - BEYOND * np.sqrt(variance) - eps
    found = np.flatnonzero((excess > 0.0) & (sums > 0.0))
    return np.asarray(found[np.argsort(-excess[found], kind="stable")])


def close_rows(
    rows: Rows,
    totals: FloatArray | float,
    *,
    eps: float = 0.0,
    outside: bool = False,
    spread: FloatArray | float = 0.0,
) -> int:
    """Correct each row, in place, so that it sums to ``totals`` (m,); returns how many it did.

    The least change in units of each factor's standard deviation, min Σ (δ_j / σ_j)² with
    Σ δ_j = defect, is δ_j = defect σ_j² / Σ σ². What was sampled has the deviation it states, all
    else the relative error ``eps``. Where the defect is more than four standard deviations, the
    deviations were wrong and are raised until it is four. Variances become those that are left.
    ``totals`` take their share of the defect by their variance ``spread`` (m,).
    """
    totals = np.broadcast_to(totals, len(rows.factors))
    spread = np.broadcast_to(spread, len(rows.factors))
    count = 0
    for start in range(0, len(totals), _BLOCK):
        part = slice(start, start + _BLOCK)
        some = Rows(rows.factors[part], rows.variances[part], {}, rows.outside[part])
        count += _close_block(some, totals[part], spread[part], eps, outside)
    return count


def _close_block(
    rows: Rows, totals: FloatArray, spread: FloatArray, eps: float, outside: bool
) -> int:
    values, sampled = _columns(rows, outside)
    variances = sampled + (eps * values) ** 2
    own = variances.sum(axis=1)
    total = own + spread
    defect = totals - values.sum(axis=1)
    ours = (own > 0.0) & (defect != 0.0)
    safe = np.where(ours, total, 1.0)
    raised = np.where(ours, np.maximum(defect**2 / (BEYOND**2 * safe), 1.0), 1.0)
    left = np.where(raised[:, None] > 1.0, variances, sampled) * raised[:, None]
    left[ours] *= 1.0 - variances[ours] / total[ours, None]
    totals = totals - np.where(ours, defect * spread / safe, 0.0)
    defect = totals - values.sum(axis=1)
    free = variances
    for _ in range(_PASSES):
        room = free.sum(axis=1)
        step = np.where(ours & (room > 0.0), defect / np.where(room > 0.0, room, 1.0), 0.0)
        values = np.maximum(values + step[:, None] * free, 0.0)
        free = np.where(values > 0.0, free, 0.0)
        defect = totals - values.sum(axis=1)
        if not (ours & (np.abs(defect) > 1e-15)).any():
            break
    n = rows.factors.shape[1]
    rows.factors[:], rows.variances[:] = values[:, :n], left[:, :n]
    if outside:
        seen = rows.outside
        seen[:, 0] *= values[:, n] / np.where(seen[:, 1] > 0.0, seen[:, 1], 1.0)
        seen[:, 1:3], seen[:, 4] = values[:, n:], left[:, n + 1]
        seen[:, 3] = carried_variance(left[:, n], seen[:, 1], seen[:, 0])
    return int(ours.sum())


def _columns(rows: Rows, outside: bool) -> tuple[FloatArray, FloatArray]:
    """Factors and variances, those of sky and ground behind those of the elements."""
    if not outside:
        return rows.factors, rows.variances.astype(np.float64)
    return (
        np.hstack([rows.factors, rows.outside[:, 1:3]]),
        np.hstack([rows.variances.astype(np.float64), _outside_variances(rows)]),
    )


def _outside_variances(rows: Rows) -> FloatArray:
    """Variances (m, 2) of the factors of sky and ground; the first from that of its light."""
    bright, sky, _, sky_spread, ground_spread = rows.outside.T
    return np.stack([carried_variance(sky_spread, bright, sky), ground_spread], axis=1)
