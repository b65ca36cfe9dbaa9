"""What the sum of a row of form factors tells of its error, and its correction.

All directions together give 1: what is missing of a row is an error of the row, known to the last
digit. It costs nothing, and is independent of the deviations that the sampling itself states.
"""

from __future__ import annotations

import numpy as np

from .dome import carried_variance
from .exchange import Rows
from .kernels.closure import correct_rows
from .model.arrays import FloatArray, IntArray
from .topology import writable

#: Standard deviations beyond which a defect is not believed to be noise.
BEYOND = 4.0


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
    sums, variance = rows.sums.T.copy()
    variance += spread
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
    m = len(rows.factors)
    extra, sampled = np.empty((m, 0)), np.empty((m, 0))
    if outside:
        extra, sampled = writable(rows.outside[:, 1:3]), writable(_outside_variances(rows))
    before = extra.copy()
    done = correct_rows(
        writable(np.broadcast_to(totals, m)),
        writable(np.broadcast_to(spread, m)),
        eps,
        BEYOND,
        extra,
        sampled,
        rows.factors,
        rows.variances,
        rows.sums,
    )
    if outside:
        seen, old = rows.outside, before[:, 0]
        seen[:, 0] *= np.where(old > 0.0, extra[:, 0] / np.where(old > 0.0, old, 1.0), extra[:, 0])
        seen[:, 1:3], seen[:, 4] = extra, sampled[:, 1]
        seen[:, 3] = carried_variance(sampled[:, 0], seen[:, 1], seen[:, 0])
    return int(done.sum())


def _outside_variances(rows: Rows) -> FloatArray:
    """Variances (m, 2) of the factors of sky and ground; the first from that of its light."""
    bright, sky, _, sky_spread, ground_spread = rows.outside.T
    return np.stack([carried_variance(sky_spread, bright, sky), ground_spread], axis=1)
