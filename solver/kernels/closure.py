"""Sums of rows of form factors, and the correction of rows to what they must sum to.

A row stays in the processor's cache while it is summed and corrected; one thread owns one row.
"""

import numba as nb
import numpy as np

from .compiled import lean, parallel, reordered

#: Defect of a row that is rounding.
_ROUNDING = 1e-14


@lean
def sum_row(values):
    """Sum of an array, in an order of its own: four sums at a time wait less for each other."""
    a = b = c = d = 0.0
    whole = values.shape[0] - values.shape[0] % 4
    for j in range(0, whole, 4):
        a += values[j]
        b += values[j + 1]
        c += values[j + 2]
        d += values[j + 3]
    for j in range(whole, values.shape[0]):
        a += values[j]
    return (a + b) + (c + d)


@reordered
def multiply(matrix, light, out):
    """Products of a matrix (m, n) of any precision and columns of light (b, n) into ``out`` (m, b).

    Sums are of double precision.
    """
    for i in nb.prange(matrix.shape[0]):
        row = matrix[i]
        for column in range(light.shape[0]):
            total = 0.0
            for j in range(row.shape[0]):
                total += row[j] * light[column, j]
            out[i, column] = total


@parallel
def sum_rows(factors, variances, sums):
    """Sums of factors and of variances (m, n) into ``sums`` (m, 2)."""
    for i in nb.prange(factors.shape[0]):
        sums[i, 0], sums[i, 1] = sum_row(factors[i]), sum_row(variances[i])


@parallel
def correct_rows(totals, spreads, eps, beyond, extra, extra_variances, factors, variances, sums):
    """Correct rows so that they sum to ``totals``, as `closure.close_rows` says.

    Parameters
    ----------
    totals, spreads : (m,) arrays
        What the rows must sum to, and the variances of that.
    eps : float
        Relative error of what was not sampled.
    beyond : float
        Standard deviations that a defect may have.
    extra, extra_variances : (m, k) arrays
        Factors and variances that count among those of the row.
    factors, variances : (m, n) arrays
        Those of the elements.
    sums : (m, 2) array
        Of ``factors`` and ``variances``.

    All but the first four arguments are corrected. Returns which rows were, (m,) bool.
    """
    m, n, k = factors.shape[0], factors.shape[1], extra.shape[1]
    done = np.zeros(m, dtype=np.bool_)
    for i in nb.prange(m):
        count = n + k
        values, free = np.empty(count), np.empty(count)
        values[:n], values[n:] = factors[i], extra[i]
        for j in range(n):
            free[j] = variances[i, j] + (eps * values[j]) ** 2
        for j in range(k):
            free[n + j] = extra_variances[i, j] + (eps * extra[i, j]) ** 2
        room = sum_row(free)
        total = room + spreads[i]
        defect = totals[i] - sum_row(values)
        if room <= 0.0 or defect == 0.0:
            continue
        done[i] = True
        raised = max(defect * defect / (beyond * beyond * total), 1.0)
        # Rows whose deviations were wrong keep what was not sampled among them.
        whole = 1.0 if raised > 1.0 else 0.0
        for j in range(n):
            left = variances[i, j] + whole * (free[j] - variances[i, j])
            variances[i, j] = left * raised * (1.0 - free[j] / total)
        for j in range(k):
            left = extra_variances[i, j] + whole * (free[n + j] - extra_variances[i, j])
            extra_variances[i, j] = left * raised * (1.0 - free[n + j] / total)
        target = totals[i] - defect * spreads[i] / total
        # Factors that would fall below 0 leave their share to the others: a few passes.
        for _ in range(4):
            defect = target - sum_row(values)
            if room <= 0.0 or abs(defect) <= _ROUNDING:
                break
            step = defect / room
            for j in range(count):
                value = max(values[j] + step * free[j], 0.0)
                values[j] = value
                free[j] = free[j] if value > 0.0 else 0.0
            room = sum_row(free)
        factors[i], extra[i] = values[:n], values[n:]
        sums[i, 0], sums[i, 1] = sum_row(factors[i]), sum_row(variances[i])
    return done
