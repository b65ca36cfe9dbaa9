"""Direct light of the sun in pictures: told anew at each pixel.

Rays to the rim, to the middle and between them tell whether the disc is seen as a whole or not at
all; where they differ, rays to places of equal area all over it are counted. At pixels next to
others of another luminance that is done four times more, each with another turn of the places:
half-shadows are good to a hundredth on average, and to 0.07 of the light.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .light_colors import LightColors
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .model.shapes import frame, places_on_disk
from .model.sky import direction
from .open_sky import OpenSky
from .shine import Seen

#: Places on the rim and between it and the middle, and how far from that they are, in radii: what a
#: shadow edge beyond all of the rim's hides is a tenth of the disc at most, and a bar that passes
#: between all of them is less than two thirds of a radius wide.
RIM, OUT, INNER = 4, 0.98, 0.5
#: Places of equal area all over the disc.
PLACES = 32
#: Distance above a surface from which its light is told, relative to the size of the scene.
LIFT = 1e-6


class SunInPictures:
    """The sun of one scene on what its cameras see.

    Parameters
    ----------
    scene : SceneData
        With a sun.
    sky : OpenSky
        What is open of its sky.
    bands : int
        1 or 3.
    """

    def __init__(self, scene: SceneData, sky: OpenSky, *, bands: int) -> None:
        assert scene.sun is not None
        self.sun, self.sky = scene.sun, sky
        low, high = scene.patches.bounds()
        self.lift = LIFT * float(np.linalg.norm(high - low))
        toward = np.array(direction(self.sun.altitude_deg, self.sun.azimuth_deg))
        e1, e2, _ = frame(toward)
        radius = math.tan(math.radians(self.sun.angular_radius_arcmin / 60.0))
        spread, around = places_on_disk(PLACES)
        step = 2.0 * math.pi / RIM * np.arange(RIM)
        self._turns = np.concatenate([step, step + math.pi / RIM, [0.0], around])
        out, inner, middle = np.full(RIM, OUT), np.full(RIM, INNER), [0.0]
        self._far = radius * np.concatenate([out, inner, middle, spread])
        self._toward, self._across = toward, (e1, e2)
        color = LightColors(scene, bands).sun
        index = scene.material_index
        shares = np.zeros((*index.shape, bands))
        for row, material in enumerate(scene.materials):
            shares[index == row] = material.scattered_in(bands)
        #: What a side of a patch sends on of 1 lx, as luminance. [cd/(m² lx)]
        self._sent = shares * color / math.pi

    def light(self, points: FloatArray, normals: FloatArray, turn: float = 0.0) -> FloatArray:
        """Illuminance (k,) at points (k, 3) of surfaces, told by places turned by ``turn``. [lx]"""
        out = np.zeros(len(points))
        x, y = (self._far * a for a in (np.cos(self._turns + turn), np.sin(self._turns + turn)))
        places = self._toward + x[:, None] * self._across[0] + y[:, None] * self._across[1]
        first, every = places[:-PLACES], places[-PLACES:]
        some = np.flatnonzero(normals @ self._toward > -math.sin(0.01))
        at = points[some] + self.lift * normals[some]
        lit = self._lit(at, first)
        whole, partly = lit.all(axis=1), lit.any(axis=1) & ~lit.all(axis=1)
        share: FloatArray = np.where(whole, 1.0, 0.0)
        share[partly] = np.mean(self._lit(at[partly], every), axis=1)
        height = np.maximum(normals[some] @ self._toward, 0.0)
        out[some] = self.sun.normal_illuminance_lx * share * height
        seen = np.flatnonzero(out > 0.0)
        if self.sky.has_panes and len(seen):
            start = points[seen] + self.lift * normals[seen]
            out[seen] *= self.sky.share(start, np.broadcast_to(self._toward, start.shape))
        return out

    def _lit(self, points: FloatArray, places: FloatArray) -> NDArray[np.bool_]:
        """Whether places (r, 3) on the disc are seen from points (k, 3): (k, r)."""
        out = np.zeros((len(points), len(places)), dtype=bool)
        for k, d in enumerate(places):
            if d[2] > 0.0:  # what is below the horizon does not shine
                out[:, k] = self.sky.is_open(points, np.broadcast_to(d, points.shape))
        return out

    def add(
        self,
        rgb: FloatArray,
        illuminance: FloatArray,
        rows: IntArray,
        at: FloatArray,
        seen: Seen,
        turn: float,
    ) -> None:
        """Add it to luminance (m, 3) and illuminance (m,) where ``rows`` of m rays met surfaces.

        They did so ``at`` points (k, 3). See `light` for ``turn``.
        """
        lux = self.light(at, seen.normals[rows], turn)
        illuminance[rows] += lux
        rgb[rows] += lux[:, None] * self._sent[seen.hits.patch[rows], seen.side[rows]]
