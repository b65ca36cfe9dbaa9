"""Where the sun stands, by NREL's solar position algorithm as pvlib has it [1].

.. [1] I. Reda and A. Andreas, "Solar position algorithm for solar radiation applications", Solar
   Energy 76(5), 2004, pp. 577-589: 0.0003 degrees between the years -2000 and 6000.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray
from .model.sky import Site


def sun_positions(site: Site, times: NDArray[np.datetime64]) -> tuple[FloatArray, FloatArray]:
    """Altitude and azimuth of the middle of the sun's disc, without refraction.

    Parameters
    ----------
    site : Site
        Place on earth.
    times : (n,) array of datetime64
        Universal time (UTC).

    Returns
    -------
    altitude_deg, azimuth_deg : (n,) array
        Above the horizon, and clockwise from north. [deg]
    """
    import pandas as pd
    import pvlib

    found = pvlib.solarposition.spa_python(
        pd.DatetimeIndex(times, tz="UTC"), site.latitude_deg, site.longitude_deg, site.elevation_m
    )
    return found["elevation"].to_numpy(np.float64), found["azimuth"].to_numpy(np.float64)


def nearness(times: NDArray[np.datetime64]) -> FloatArray:
    """Square of the mean distance of the sun over its distance (n,), by Spencer's series.

    References
    ----------
    J. W. Spencer, "Fourier series representation of the position of the sun", Search 2(5), 1971,
    p. 172.
    """
    days = times.astype("datetime64[D]") - times.astype("datetime64[Y]").astype("datetime64[D]")
    turn = 2.0 * math.pi * days.astype(np.float64) / 365.0
    return np.asarray(
        1.000110
        + 0.034221 * np.cos(turn)
        + 0.001280 * np.sin(turn)
        + 0.000719 * np.cos(2.0 * turn)
        + 0.000077 * np.sin(2.0 * turn)
    )
