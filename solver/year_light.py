"""Light at the sensors of a scene in many steps of a weather file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coefficients import Coefficients
from .model.arrays import FloatArray, IntArray
from .sky_series import SkySeries

#: Steps whose skies are held at a time: 9217 luminances each.
STEPS = 256


@dataclass(frozen=True, slots=True, eq=False)
class YearLight:
    """Illuminance (m, k) of m sensors in k steps, by what it comes from. [lx]

    Attributes
    ----------
    sky_direct, sky_indirect : (m, k) array
        Of the sky, before and after reflections in the scene.
    sun_direct, sun_indirect : (m, k) array
        Of the sun.
    ground : (m, k) array
        Of the ground that both light.
    melanopic_edi : (m, k) array or None
        Melanopic EDI of all of it, where the spectrum is asked for.
    """

    sky_direct: FloatArray
    sky_indirect: FloatArray
    sun_direct: FloatArray
    sun_indirect: FloatArray
    ground: FloatArray
    melanopic_edi: FloatArray | None = None

    @property
    def total(self) -> FloatArray:
        """Illuminance (m, k). [lx]"""
        parts = (self.sky_direct, self.sky_indirect, self.sun_direct, self.sun_indirect)
        return np.asarray(sum(parts, self.ground))


def light_in_steps(coefficients: Coefficients, skies: SkySeries, steps: IntArray) -> YearLight:
    """Light of some ``steps`` (k,) of ``skies``; by night it is 0.

    The disc of the sun stands where it does in each step; what it sends after reflections is
    linear between the places of `Coefficients.sun_grid`.
    """
    m, k = len(coefficients.ground), len(steps)
    names = ("sky_direct", "sky_indirect", "sun_direct", "sun_indirect", "ground")
    parts, own = {name: np.zeros((m, k)) for name in names}, coefficients.melanopic
    indirect = np.zeros((m, k))  # melanopic, of sky and sun
    day = np.flatnonzero(skies.sky_lx[steps] > 0.0)
    for start in range(0, len(day), STEPS):
        at = day[start : start + STEPS]
        luminances = skies.luminances(coefficients.sky_grid, steps[at])
        parts["sky_direct"][:, at] = coefficients.direct @ luminances
        parts["sky_indirect"][:, at] = coefficients.indirect @ luminances
        if own is not None:
            indirect[:, at] = own.indirect @ luminances
    sunny = np.flatnonzero(skies.sun_normal_lx[steps] > 0.0)
    if len(sunny):
        some = steps[sunny]
        level, suns = skies.sun_normal_lx[some], skies.suns[some]
        direct = coefficients.sun.light(skies.altitude_deg[some], skies.azimuth_deg[some])
        parts["sun_direct"][:, sunny] = level * direct
        parts["sun_indirect"][:, sunny] = level * coefficients.sun_indirect(suns)
        if own is not None:
            indirect[:, sunny] += level * coefficients.sun_grid.interpolated(own.beams, suns)
    on_ground = skies.level_lx[steps]
    parts["ground"] = coefficients.ground[:, None] * on_ground
    if own is None:
        return YearLight(**parts)
    by_sky = skies.sky_lx[steps]
    ground = own.ground_by_sky[:, None] * by_sky
    ground += own.ground_by_sun[:, None] * (on_ground - by_sky)
    direct = own.sky * parts["sky_direct"] + own.sun * parts["sun_direct"]
    return YearLight(**parts, melanopic_edi=direct + indirect + ground)
