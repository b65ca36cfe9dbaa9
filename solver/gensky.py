"""Clear and intermediate skies, and levels, as Radiance's program gensky computes them [1].

With Z and Z_s the angles of a direction and of the sun from the zenith, χ that between them and
γ_s = π/2 − Z_s [2], [3]:

    clear         L ∝ (0.91 + 10 exp(−3 χ) + 0.45 cos² χ) (1 − exp(−0.32 / cos Z))
    intermediate  L ∝ {[1.35 sin(5.631 − 3.59 Z) + 3.12] sin(4.396 − 2.6 Z_s) + 6.37 − Z}
                      · exp(−0.563 χ [(2.629 − Z)(1.562 − Z_s) + 0.812])

Zenith luminances [kcd/m²] with the turbidity T:

    overcast, uniform  0.123 + 8.6 sin γ_s
    clear              (1.376 T − 1.81) tan γ_s + 0.38
    intermediate       the mean of both

They, and the illuminance of the sun, are estimates of what is typical at a height of the sun: the
same sky may well be half or twice as bright.

.. [1] G. Ward, "gensky" and "skybright.cal" in Radiance 5.4.
.. [2] R. Kittler, "Standardisation of outdoor conditions for the calculation of the daylight factor
   with clear skies", CIE Intersessional Meeting on Sunlight in Buildings, Newcastle upon Tyne 1965;
   CIE 22-1973.
.. [3] H. Nakamura, M. Oki and Y. Hayashi, "Luminance distribution of intermediate sky", Journal of
   Light and Visual Environment 9(1), 1985, pp. 6-13.
"""

from __future__ import annotations

import math

import numpy as np

from .model.arrays import FloatArray
from .model.sky import CIESky

#: Turbidity where none is given. [1]
TURBIDITY = 2.45
#: Highest sun that levels are told for: the tangent grows without bounds. [1] [deg]
HIGHEST_SUN_DEG = 87.0
#: Gradation a, b and indicatrix c, d, e of the clear sky in the form of CIE S 011: 0.91 becomes
#: 1 − c exp(d π/2), all divided by their sum.
_WHOLE = 0.91 + 10.0 * math.exp(-1.5 * math.pi)
CLEAR = (-1.0, -0.32, 10.0 / _WHOLE, -3.0, 0.45 / _WHOLE)
#: Luminance times solid angle of the sun outside the atmosphere, and how the intermediate sky
#: weakens it. [1] [lx]
SUN_LX, SUN_BETWEEN = 6e-5 * 1.5e9, 0.15


def intermediate_terms(sun_altitude_deg: float) -> tuple[float, float]:
    """sin(4.396 − 2.6 Z_s) and 1.562 − Z_s of the intermediate sky."""
    zenith = math.radians(90.0 - sun_altitude_deg)
    return math.sin(4.396 - 2.6 * zenith), 1.562 - zenith


def intermediate_form(sun_altitude_deg: float, zenith: FloatArray, angle: FloatArray) -> FloatArray:
    """The intermediate sky up to a factor, at angles from the zenith and from the sun. [rad]"""
    sine, low = intermediate_terms(sun_altitude_deg)
    level = (1.35 * np.sin(5.631 - 3.59 * zenith) + 3.12) * sine + 6.37 - zenith
    return np.asarray(level * np.exp(-0.563 * angle * ((2.629 - zenith) * low + 0.812)))


def estimated_zenith_luminance(sky: CIESky) -> float:
    """Typical zenith luminance at the height of the sun. [cd/m²]"""
    altitude = math.radians(min(float(sky.sun_altitude_deg or 0.0), HIGHEST_SUN_DEG))
    overcast = 0.123 + 8.6 * math.sin(altitude)
    if sky.type in (1, 5, 16):
        return 1e3 * overcast
    turbidity = TURBIDITY if sky.turbidity is None else sky.turbidity
    clear = (1.376 * turbidity - 1.81) * math.tan(altitude) + 0.38
    return 1e3 * (0.5 * (clear + overcast) if sky.type == "intermediate" else clear)


def at_zenith(sky: CIESky) -> float:
    """What the program divides the formula of a clear or intermediate sky by, at the zenith 1.

    It is rounded: at the zenith the clear sky is 5e-4 darker than its zenith luminance, the
    intermediate one up to 3e-4 brighter or darker.
    """
    altitude = math.radians(float(sky.sun_altitude_deg or 0.0))
    zenith = 0.5 * math.pi - altitude
    if sky.type == "intermediate":
        steady = 2.739 + 0.9891 * math.sin(0.3119 + 2.6 * altitude)
        return 2.326 * steady * math.exp(-zenith * (0.4441 + 1.48 * altitude))
    return 0.274 * (0.91 + 10.0 * math.exp(-3.0 * zenith) + 0.45 * math.cos(zenith) ** 2) / _WHOLE


def estimated_sun_illuminance(sky: CIESky) -> float:
    """Typical illuminance by the sun on a plane facing it; 0 under an overcast sky. [lx]"""
    if sky.type not in (12, "clear", "intermediate"):
        return 0.0
    height = max(math.sin(math.radians(float(sky.sun_altitude_deg or 0.0))), 0.16)
    share = SUN_BETWEEN if sky.type == "intermediate" else 1.0
    return share * SUN_LX * (1.147 - 0.147 / height)
