"""Daylight coefficients: what any sky and sun make of light at the sensors of a scene.

`DaylitScene` finds them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .beams import Beams
from .dome_grid import DomeGrid
from .model.arrays import FloatArray
from .model.sky import CIESky
from .skies import luminance
from .sun_light import SunLight

#: Suns of the year for which indirect light is told by themselves, to know the error of the others.
CHECKED = 48


@dataclass(frozen=True, slots=True, eq=False)
class Melanopic:
    """The same in melanopic EDI of CIE S 026, of light from outside of constant colour.

    Attributes
    ----------
    sky, sun : float
        That of 1 lx of light of the sky, and of the sun. [lx]
    indirect, beams : (m, B) and (m, C) array
        By what `Coefficients` has them by.
    ground_by_sky, ground_by_sun : (m,) array
        By what the ground makes of 1 lx of each on it.
    """

    sky: float
    sun: float
    indirect: FloatArray
    beams: FloatArray
    ground_by_sky: FloatArray
    ground_by_sun: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Coefficients:
    """What light from outside makes at m sensors; row i of every array is the same sensor.

    Attributes
    ----------
    sky_grid, sun_grid : DomeGrid
        Cells of the dome, B and C in number.
    direct, indirect : (m, B) array
        Illuminance by luminance 1 cd/m² at the middles of cells, linear between them. [sr]
    beams : (m, C) array
        Indirect illuminance by the sun, of 1 lx on a plane facing it, from the middles of cells;
        not a number of those that are not next to any sun asked for.
    ground : (m,) array
        Illuminance, direct and indirect, by what the ground makes of 1 lx on it.
    sun : SunLight
        Direct light of the sun.
    exact_beams : Beams
        Indirect light of suns by themselves, before it is scaled.
    beam_scale : (m,) array
        What indirect light told by beams was scaled by.
    melanopic : Melanopic or None
        Where the spectrum is asked for.
    """

    sky_grid: DomeGrid
    sun_grid: DomeGrid
    direct: FloatArray
    indirect: FloatArray
    beams: FloatArray
    ground: FloatArray
    sun: SunLight
    exact_beams: Beams
    beam_scale: FloatArray
    melanopic: Melanopic | None = None

    def sun_indirect(self, suns: FloatArray) -> FloatArray:
        """Indirect illuminance (m, k) by the sun in directions (k, 3), of 1 lx facing it."""
        return self.sun_grid.interpolated(self.beams, suns)

    def sun_error(self, suns: FloatArray) -> tuple[float, float]:
        """Squares of the error of `sun_indirect`, and of its values, summed over ``suns`` (k, 3).

        Found by beams from some of them.
        """
        if not len(suns):
            return 0.0, 0.0
        some = suns[np.unique(np.linspace(0, len(suns) - 1, CHECKED).astype(int))]
        exact = self.exact_beams.coefficients(some) * self.beam_scale[:, None]
        off = self.sun_indirect(some) - exact
        return float(np.sum(off**2)), float(np.sum(exact**2))

    def daylight_factor(self, sky_type: int = 16) -> FloatArray:
        """Daylight factors (m,) under an overcast CIE sky, as shares of 1."""
        sky = CIESky(sky_type, zenith_luminance_cd_m2=1.0)
        luminances = luminance(sky, self.sky_grid.directions)
        outside = float(self.sky_grid.level @ luminances)
        return np.asarray((self.direct + self.indirect) @ luminances / outside + self.ground)
