"""How much of the light comes back: the spectral radius of reflection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .errors import NumericsError
from .model.arrays import FloatArray

#: Least share of the light that must be lost from one reflection to the next: sums of factors of
#: single precision are known to a tenth of that.
ABSORBED = 1e-6
#: Steps of power iteration where one is not enough.
STEPS = 60


def radius_bound(reflect: Callable[[FloatArray], FloatArray], n: int) -> float:
    """Upper bound of the spectral radius of a matrix M >= 0, below 1 − `ABSORBED` if it can be.

    max (M x)_i / x_i bounds the radius for every x > 0, by Collatz and Wielandt [1]_. With x = 1
    it is the largest share of its light that an element sends on. Where that is no less than 1,
    as of white elements that see out elsewhere, x is improved by power iteration with I + M, whose
    eigenvalues do not alternate.

    Parameters
    ----------
    reflect : callable
        M x of x (n,).
    n : int
        Size of the matrix.

    References
    ----------
    .. [1] R. S. Varga, *Matrix Iterative Analysis*, 2nd ed., Springer, 2000, section 2.1.
    """
    x, best = np.ones(n), np.inf
    for _ in range(STEPS):
        sent = reflect(x)
        best = min(best, float((sent / x).max(initial=0.0)))
        if best < 1.0 - ABSORBED:
            break
        x = x + sent
        # Not below what rounding leaves of single precision: the bound holds for any x > 0.
        x = np.maximum(x / x.max(), 1e-30)
    return best


def check_radius(bound: float, white: bool) -> None:
    """Raise `NumericsError` where the radius may be 1; ``white`` if nothing absorbs at all."""
    if bound < 1.0 - ABSORBED:
        return
    if white:
        raise NumericsError(
            f"no surface absorbs light (reflectance 1 everywhere, largest ρ ΣF = {bound:.6f}): "
            "a closed scene has no balance; use reflectances below 1"
        )
    raise NumericsError(
        f"light that is enclosed is never absorbed (spectral radius {bound:.6f}, at most "
        f"{1.0 - ABSORBED:.6f} is allowed): use reflectances below 1 on all sides of each cavity"
    )
