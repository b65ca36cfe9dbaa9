"""Luminances of many skies in many directions."""

import numba as nb

from .compiled import parallel
from .sky_luminance import sky_luminance


@parallel
def sky_table(parameters, suns, directions, out):
    """Luminance of n skies in B directions. [cd/m²]

    Parameters
    ----------
    parameters : (n, 7) array
        As of `sky_luminance.sky_luminance`.
    suns, directions : (n, 3) and (B, 3) array
        Unit vectors.
    out : (B, n) array
        Receives the luminances; none is less than 0.
    """
    for b in nb.prange(directions.shape[0]):
        x, y, z = directions[b, 0], directions[b, 1], directions[b, 2]
        for i in range(parameters.shape[0]):
            value = sky_luminance(parameters[i], suns[i, 0], suns[i, 1], suns[i, 2], x, y, z)
            out[b, i] = max(value, 0.0)
