"""Colours of the light of one scene, by source, in 1, 3 or 20 bands; each of illuminance 1.

Light of the sky has one colour everywhere, or one that depends on where it comes from [1]_. Then
each receiver gets the mean colour of what it sees of the sky: the cells of the dome weigh it, by
how much of each is open to the receiver and by their luminance. The level is told elsewhere, and
not changed by it. Where no cell is seen to be open, in pictures, and by way of mirrors and in
highlights, the sky has the mean colour that falls on level ground.

The ground has the colour of the light of sky and sun that falls on it.

.. [1] `sky_color`, whose chromaticities have the spectra S0 + M1 S1 + M2 S2 of CIE daylight.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .dome_grid import DomeGrid, dome_grid
from .model.arrays import FloatArray
from .model.result import luminous
from .model.scene import Luminaire, SceneData
from .model.sky import Sky
from .skies import horizontal_illuminance, luminance, sun_horizontal_illuminance
from .spectra import cct_color, daylight_basis, spectrum_bands, spectrum_color

if TYPE_CHECKING:
    from .open_sky import OpenSky

#: Cells that tell the colour of the sky on elements, at sensors and on level ground, as `dome_grid`
#: has them: the colour temperature of an open clear sky is good to 2 % and to 0.5 %, which is less
#: than what models of it differ by; that of what windows show is in `spectral_sensors`.
ELEMENT_PARTS, SENSOR_PARTS, LEVEL_PARTS = 1, 2, 4
#: Rays a direction of each cell where curved surfaces may hide something.
FINER = 2
#: Receivers that are done at a time: their weights take 5 MB.
BLOCK = 1024


def lamp_color(lamp: Luminaire, bands: int) -> FloatArray:
    """Colour (b,) of the light of a luminaire."""
    if bands == 1:
        return np.ones(1)
    if bands == 3:
        return np.asarray(lamp.color)
    return cct_color(lamp.cct_k, bands) if lamp.spectrum is None else spectrum_bands(lamp.spectrum)


class LightColors:
    """Colours of sky, sun and ground.

    Parameters
    ----------
    scene : SceneData
        The scene.
    bands : int
        1, 3 or 20.
    """

    def __init__(self, scene: SceneData, bands: int) -> None:
        self.scene, self.bands = scene, bands
        sky = scene.sky
        #: Whether the colour of the sky depends on where it is.
        self.sky_varies = bands > 1 and sky is not None and sky.color != "constant"

    @cached_property
    def sky(self) -> FloatArray:
        """Mean colour (b,) of the sky on level ground."""
        sky = self.scene.sky
        if sky is None or self.bands == 1:
            return np.ones(self.bands)
        if not self.sky_varies:
            return cct_color(sky.cct_k, self.bands)
        grid = dome_grid(LEVEL_PARTS)
        weights = grid.level @ self._weights(sky, grid)
        if not weights[0] > 0.0:
            # Black: no light has this colour, but it is told.
            return cct_color(sky.cct_k, self.bands)
        return self._of(weights[None])[0]

    @cached_property
    def sun(self) -> FloatArray:
        """Colour (b,) of the sun."""
        sun = self.scene.sun
        if sun is None or self.bands == 1:
            return np.ones(self.bands)
        if sun.color == "constant":
            return cct_color(sun.cct_k, self.bands)
        from .sun_spectrum import sun_spectrum

        spectrum = sun_spectrum(sun.altitude_deg)
        return spectrum_color(spectrum)[0] if self.bands == 3 else spectrum_bands(spectrum)

    @cached_property
    def ground(self) -> FloatArray:
        """Colour (b,) of the grey ground, which is that of the light on it."""
        sky, sun = self.scene.sky, self.scene.sun
        if sky is None or sun is None:
            return self.sun if sky is None else self.sky
        light = horizontal_illuminance(sky) * self.sky + sun_horizontal_illuminance(sun) * self.sun
        level = float(luminous(light))
        return light / level if level > 0.0 else self.sky

    def sky_at(
        self, open_sky: OpenSky, points: FloatArray, normals: FloatArray, parts: int
    ) -> FloatArray:
        """Colour (m, b) of what receivers at points (m, 3) see of the sky.

        Parameters
        ----------
        open_sky : OpenSky
            Tells what that is.
        points, normals : (m, 3) array
            Receivers [m] and unit normals.
        parts : int
            Fineness of the cells, as of `dome_grid`.
        """
        sky, grid = self.scene.sky, dome_grid(parts)
        assert sky is not None
        of_cells = self._weights(sky, grid)
        out = np.broadcast_to(self.sky, (len(points), self.bands)).copy()
        for start in range(0, len(points), BLOCK):
            rows = np.arange(start, min(start + BLOCK, len(points)))
            seen = open_sky.seen(points[rows], normals[rows], grid, np.ones(len(rows)), FINER)
            weights = seen.weights @ of_cells
            told = weights[:, 0] > 0.0
            out[rows[told]] = self._of(weights[told])
        return out

    @staticmethod
    def _weights(sky: Sky, grid: DomeGrid) -> FloatArray:
        """How much of S0, S1 and S2 (B, 3) there is in cells of a sky, by their luminance."""
        from .sky_color import daylight_weights, sky_chromaticity

        xy = sky_chromaticity(sky, grid.directions, sky.color)
        mixed = np.concatenate([np.ones((len(xy), 1)), daylight_weights(xy)], axis=1)
        # S1 and S2 have little luminance, and may have less than none.
        level = mixed @ luminous(daylight_basis(20))
        return np.asarray(mixed * (luminance(sky, grid.directions) / level)[:, None])

    def _of(self, weights: FloatArray) -> FloatArray:
        """Colour (m, b) of mixtures (m, 3) of S0, S1 and S2; what would be negative is 0."""
        light = np.maximum(weights @ daylight_basis(self.bands), 0.0)
        return np.asarray(light / luminous(light)[:, None])
