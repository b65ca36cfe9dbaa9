"""I − ρ F taken apart once, for many lights of the same scene."""

from __future__ import annotations

import numpy as np

from .errors import ConvergenceError
from .exchange import products
from .memory import check_bytes
from .model.arrays import FloatArray, MatrixArray

#: Bytes that the triangles take of a pair, and another copy while they are found.
LU_BYTES = 8
#: Corrections at most: each gains six digits less those of the condition number.
CORRECTIONS = 6


class Factorised:
    """LU decomposition of I − ρ F in single precision, corrected in double.

    It serves any light: to re-light a scene costs a substitution a right-hand side. Other
    reflectances need another one.

    Parameters
    ----------
    factors : (n, n) array
        Form factors. They are kept, not copied.
    reflectance : (n,) array
        Diffuse reflectance in one band.

    Raises
    ------
    OutOfMemoryError
        If the triangles do not fit into the memory that is free.
    """

    def __init__(self, factors: MatrixArray, reflectance: FloatArray) -> None:
        from scipy.linalg import lu_factor

        n = len(factors)
        check_bytes(LU_BYTES * n**2, f"the LU decomposition of {n} x {n} form factors")
        self.factors, self.reflectance = factors, reflectance
        matrix = np.empty((n, n), dtype=np.float32, order="F")
        np.multiply(factors, -reflectance[:, None], out=matrix, casting="same_kind")
        matrix[np.diag_indices(n)] += 1.0
        self._triangles = lu_factor(matrix, overwrite_a=True, check_finite=False)

    def solve(self, direct: FloatArray, *, tolerance: float = 1e-9) -> FloatArray:
        """Reflected exitance (n, k) for direct irradiance (n, k) [lm/m²], of (n,) for (n,).

        Raises
        ------
        ConvergenceError
            If corrections do not reach ``tolerance``, relative to the norm of each source.
        """
        from scipy.linalg import lu_solve

        source = (direct.reshape(len(direct), -1) * self.reflectance[:, None]).astype(np.float64)
        size = np.linalg.norm(source, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        values, residual = np.zeros_like(source), source
        for _ in range(CORRECTIONS):
            # Scaled, so that weak light keeps its digits in single precision.
            level = np.maximum(np.abs(residual).max(axis=0), 1e-300)
            scaled = (residual / level).astype(np.float32)
            values += level * lu_solve(self._triangles, scaled, check_finite=False)
            reflected = self.reflectance[:, None] * products(self.factors, values)
            residual = source - (values - reflected)
            worst = float((np.linalg.norm(residual, axis=0) / size).max())
            if worst <= tolerance:
                return values.reshape(direct.shape)
        raise ConvergenceError(
            f"LU of {len(values)} elements: residual {worst:.1e} after {CORRECTIONS} corrections, "
            f"but {tolerance:.0e} was asked"
        )
