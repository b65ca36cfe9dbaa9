"""Modelled spectrum of the sun's direct light by its altitude: the model of Bird and Riordan [1].

Air and what is in it are those of the reference spectra of [2]: sea level, 1.42 cm of water, 0.344
cm of ozone, and aerosol of optical depth 0.084 at 500 nm. More aerosol makes a low sun redder.

.. [1] R. E. Bird and C. Riordan, "Simple solar spectral model for direct and diffuse irradiance on
   horizontal and tilted planes at the earth's surface for cloudless atmospheres", Journal of
   Climate and Applied Meteorology 25(1), 1986, pp. 87-97; as pvlib has it.
.. [2] ASTM G173-03, "Standard tables for reference solar spectral irradiances: direct normal and
   hemispherical on 37 degree tilted surface".
.. [3] I. Reda and A. Andreas, "Solar position algorithm for solar radiation applications", NREL
   TP-560-34302, revised 2008, eq. 42; as pvlib has it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .model.reflectance import Spectrum

#: The atmosphere. [Pa, cm, cm, 1] [2]
PRESSURE_PA, WATER_CM, OZONE_CM, AEROSOL = 101325.0, 1.42, 0.344, 0.084
#: Its temperature at sea level, and refraction at the horizon as it is usual. [degrees C, deg] [3]
TEMPERATURE_C, AT_HORIZON_DEG = 15.0, 0.5667
#: Lowest altitude of the fit of the air mass: below it the sun is as there. [deg]
LOWEST_DEG = 0.0


@lru_cache(maxsize=64)
def sun_spectrum(altitude_deg: float) -> Spectrum:
    """Pairs of wavelength [nm] and direct irradiance facing the sun. [W/(m² nm)]

    Parameters
    ----------
    altitude_deg : float
        Of the middle of the disc, without refraction. [deg]
    """
    import pvlib

    # Where the sun is seen: refraction lifts it, at the horizon by its own width.
    lifted = pvlib.spa.atmospheric_refraction_correction(
        0.01 * PRESSURE_PA, TEMPERATURE_C, altitude_deg, AT_HORIZON_DEG
    )
    zenith = np.array([max(90.0 - max(altitude_deg + lifted, LOWEST_DEG), 0.0)])
    mass = pvlib.atmosphere.get_relative_airmass(zenith, model="kastenyoung1989")
    found = pvlib.spectrum.spectrl2(
        apparent_zenith=zenith,
        aoi=np.zeros(1),
        surface_tilt=np.zeros(1),
        ground_albedo=0.2,  # of no account to direct light
        surface_pressure=PRESSURE_PA,
        relative_airmass=mass,
        precipitable_water=WATER_CM,
        ozone=OZONE_CM,
        aerosol_turbidity_500nm=AEROSOL,
        dayofyear=np.array([93]),  # when the sun is at its mean distance; its level is given
    )
    power = np.maximum(found["dni"][:, 0], 0.0)
    seen = found["wavelength"] < 1000.0
    pairs = zip(found["wavelength"][seen].tolist(), power[seen].tolist(), strict=True)
    return tuple(pairs)
