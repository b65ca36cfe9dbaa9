"""Interreflection: the linear system of the reflected exitance, solved by GMRES."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .errors import ConvergenceError, NumericsError
from .exchange import products
from .model.arrays import FloatArray, MatrixArray
from .scattering import Scattering

#: Relative residual asked of GMRES at least, and for each unit of accuracy asked for: what is left
#: is far less than what meshes and form factors leave.
TOLERANCE, TOLERANCE_SHARE = 1e-9, 1e-4
MAX_ITERATIONS = 300
#: Least share of the light that an element must keep: sums of factors of single precision are known
#: to a tenth of that.
ABSORBED = 1e-6


def check_absorbs(factors: FloatArray, reflectance: FloatArray) -> float:
    """Largest share of light that an element sends on, max ρ Σ F; `NumericsError` when >= 1.

    Below 1 the inverse of I − ρ F is bounded by 1 / (1 − that share) in the maximum norm; in a
    closed scene that absorbs nothing the light grows without end and no balance exists.
    """
    sums = products(factors, np.ones(factors.shape[1]))
    share = float((reflectance.max(axis=1) * sums).max(initial=0.0))
    if share >= 1.0 - ABSORBED and float((reflectance.min(axis=1)).min()) >= 1.0 - 1e-9:
        raise NumericsError(
            f"no surface absorbs light (reflectance 1 everywhere, largest ρ ΣF = {share:.6f}): "
            "a closed scene has no balance; use reflectances below 1"
        )
    return share


def solve_radiosity(
    factors: MatrixArray,
    reflectance: FloatArray,
    direct: Mapping[str, FloatArray],
    *,
    accuracy: float = 0.0,
    scattering: Scattering | None = None,
) -> tuple[dict[str, FloatArray], int]:
    """Reflected exitance of every light group, (I − ρ F) B = ρ E_direct.

    With panels that scatter, ρ becomes ρ + S, and B holds what they scatter besides.

    Parameters
    ----------
    factors : (n, n) array
        Form factors, row i what element i sees.
    reflectance : (n, b) array
        Diffuse reflectance by band.
    direct : dict of (n, b) arrays
        Direct irradiance by light group. [lx]
    accuracy : float
        Relative accuracy asked for.
    scattering : Scattering, optional
        What elements send on to those behind them.

    Returns
    -------
    dict of (n, b) arrays, int
        Reflected exitance by light group [lm/m²], and the number of matrix products.

    Raises
    ------
    NumericsError
        If nothing absorbs light.
    ConvergenceError
        If GMRES does not reach its tolerance.
    """
    from scipy.sparse.linalg import LinearOperator, gmres

    kept = reflectance if scattering is None else reflectance + scattering.share[:, None]
    check_absorbs(factors, kept)
    n, count = len(factors), 0
    tolerance = max(TOLERANCE, TOLERANCE_SHARE * accuracy)
    out = {}
    for group, incident in direct.items():
        reflected = np.zeros_like(incident)
        for band in range(incident.shape[1]):
            rho = reflectance[:, band]
            source = rho * incident[:, band]
            if scattering is not None:
                source += scattering.sent(incident[:, band])
            if not source.any():
                continue

            def operate(b: FloatArray, rho: FloatArray = rho) -> FloatArray:
                nonlocal count
                count += 1
                light = products(factors, b)
                if scattering is not None:
                    b = b - scattering.sent(light)
                return np.asarray(b - rho * light)

            solution, info = gmres(
                LinearOperator((n, n), matvec=operate, dtype=np.float64),
                source,
                x0=source,
                rtol=tolerance,
                atol=0.0,
                restart=MAX_ITERATIONS,
                maxiter=1,
            )
            if info != 0 or not np.isfinite(solution).all():
                residual = np.abs(source - operate(solution)).max() / np.abs(source).max()
                raise ConvergenceError(
                    f"light group {group!r}: residual {residual:.1e} after {MAX_ITERATIONS} "
                    f"products, but {tolerance:.0e} was asked"
                )
            reflected[:, band] = solution
        out[group] = reflected
    return out, count
