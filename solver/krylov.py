"""GMRES for many systems with one operator at a time: all advance by the same product.

A product with a matrix of form factors waits for memory; with twenty columns it takes hardly longer
than with one. Each column has its own Krylov space, and is done when its own residual is small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .errors import ConvergenceError
from .model.arrays import FloatArray, IntArray

#: Steps at most: no restart is made.
MAX_ITERATIONS = 300
#: A new direction so much shorter than what it is made from has no digits left of its own.
_SPENT = 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """Solutions (n, k), and how many passes over the matrix they took."""

    values: FloatArray
    products: int


def solve_all(
    operate: Callable[[FloatArray, IntArray], FloatArray],
    right: FloatArray,
    *,
    tolerance: float,
    names: Callable[[int], str] = str,
) -> Solved:
    """Solve A_c x_c = b_c for all columns c.

    Parameters
    ----------
    operate : callable
        ``operate(x (n, c), columns (c,))`` returns A_c x_c of some of the columns.
    right : (n, k) array
        Right-hand sides; they are the first guess too.
    tolerance : float
        Norm of the residual asked for, relative to that of ``right``.
    names : callable
        Name of a column, for the error.

    Raises
    ------
    ConvergenceError
        If a column does not reach the tolerance.

    References
    ----------
    .. [1] Y. Saad, M. H. Schultz, "GMRES: a generalized minimal residual algorithm for solving
       nonsymmetric linear systems", SIAM J. Sci. Stat. Comput. 7(3), 1986.
    """
    values = right.copy()
    goal = tolerance * np.linalg.norm(right, axis=0)
    columns = np.flatnonzero(goal > 0.0)
    if not len(columns):
        return Solved(values, 0)
    residual = right[:, columns] - operate(right[:, columns], columns)
    products = 1
    size = np.linalg.norm(residual, axis=0)
    open_ = size > goal[columns]
    columns, residual, size = columns[open_], residual[:, open_], size[open_]
    basis = [residual / size]
    # Columns of H, turned to a triangle by Givens' rotations as they come; one system a column.
    triangle: list[FloatArray] = []
    cosines: list[FloatArray] = []
    sines: list[FloatArray] = []
    left = [size]  # the residual in the rotated basis
    while len(columns):
        step = len(triangle)
        if step == MAX_ITERATIONS:
            worst = int(np.argmax(np.abs(left[-1]) / goal[columns]))
            reached = tolerance * abs(left[-1][worst]) / goal[columns[worst]]
            raise ConvergenceError(
                f"{names(int(columns[worst]))}: residual {reached:.1e} after {MAX_ITERATIONS} "
                f"products, but {tolerance:.0e} was asked"
            )
        new = operate(basis[-1], columns)
        products += 1
        before = np.linalg.norm(new, axis=0)
        h = np.zeros((step + 2, len(columns)))
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            for k, direction in enumerate(basis):
                share = np.einsum("nc,nc->c", direction, new)
                h[k] += share
                new -= share * direction
        length = np.linalg.norm(new, axis=0)
        spent = length <= _SPENT * before
        h[-1] = np.where(spent, 0.0, length)
        basis.append(new / np.where(spent, 1.0, length))
        for k in range(step):
            a, b = h[k].copy(), h[k + 1].copy()
            h[k], h[k + 1] = cosines[k] * a + sines[k] * b, cosines[k] * b - sines[k] * a
        radius = np.hypot(h[-2], h[-1])
        radius = np.where(radius > 0.0, radius, 1.0)
        cosines.append(h[-2] / radius)
        sines.append(h[-1] / radius)
        h[-2] = radius
        triangle.append(h[:-1])
        left.append(-sines[-1] * left[-1])
        left[-2] = cosines[-1] * left[-2]
        done = (np.abs(left[-1]) <= goal[columns]) | spent
        if done.any():
            values[:, columns[done]] += _combined(basis, triangle, left, done)
            stay = ~done
            columns = columns[stay]
            basis = [direction[:, stay] for direction in basis]
            triangle, cosines, sines, left = (
                [array[..., stay] for array in many] for many in (triangle, cosines, sines, left)
            )
    return Solved(values, products)


def _combined(
    basis: list[FloatArray], triangle: list[FloatArray], left: list[FloatArray], done: np.ndarray
) -> FloatArray:
    """Best combination (n, d) of the directions for the columns that are ``done``."""
    steps = len(triangle)
    weight = np.zeros((steps, int(done.sum())))
    for k in range(steps - 1, -1, -1):
        rest = left[k][done]
        for later in range(k + 1, steps):
            rest = rest - triangle[later][k][done] * weight[later]
        weight[k] = rest / triangle[k][k][done]
    return np.asarray(sum(basis[k][:, done] * weight[k] for k in range(steps)))
