"""Direct light at points of a scene, as runs before this one have found it."""

from __future__ import annotations

import numpy as np

from .direct_light import DirectLight, lamp_boxes, lamp_exitances, sun_numbers
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .reuse import Kept

#: Relative difference of exitances that is rounding.
_SAME = 1e-9
#: By how much unlike lamps may be dimmed: those that were faint beside others, and have no shadows,
#: make up more of the light then by as much.
UNLIKE = 4.0


class KeptLight:
    """As `DirectLight`, which is made only where something is asked for the first time.

    Parameters
    ----------
    scene : SceneData
        Geometry and lamps.
    blockers : Blockers
        Its patches as obstacles.
    trace : bool
        Whether anything can hide anything.
    kept : Kept
        What runs before this one have found.

    Attributes
    ----------
    shining : (k,) array
        Exitances of the pieces of lamps that the light comes from [lm/m²], and the sun.
    """

    def __init__(self, scene: SceneData, blockers: Blockers, *, trace: bool, kept: Kept) -> None:
        self.scene, self.blockers, self.trace, self.kept = scene, blockers, trace, kept
        lamps = lamp_exitances(scene, lamp_boxes(scene))
        self.shining = np.concatenate([lamps, sun_numbers(scene, blockers)])
        self._lamps = scene.luminaire_index, self.shining
        self._light: DirectLight | None = None

    def at(
        self, points: FloatArray, normals: FloatArray, patches: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Illuminance [lx] and nearness [1/m] at points (m, 3) on ``patches`` (m,)."""

        def find() -> tuple[FloatArray, FloatArray]:
            return self._made.at(points, normals, patches)

        return self.kept.find("direct light", (self._lamps, points, normals, patches), find)

    def is_like(self, before: FloatArray) -> bool:
        """Whether lamps that had exitances ``before`` (k,) [lm/m²] are dimmed much alike."""
        shone = before > 0.0
        if not np.array_equal(shone, self.shining > 0.0):
            return False
        ratios = self.shining[shone] / before[shone]
        return bool(ratios.max(initial=0.0) <= UNLIKE * ratios.min(initial=np.inf))

    def change(
        self, points: FloatArray, normals: FloatArray, patches: IntArray, before: FloatArray
    ) -> tuple[float, FloatArray]:
        """What has become of the illuminance at points (m, 3) on ``patches`` (m,), without a sun.

        Pieces of lamps had exitances ``before`` (k,) [lm/m²]. Returns by what the light of then is
        to be multiplied, and what comes to that (m,) [lx]: of lamps which have changed unlike most.
        """
        ratios = self.shining / np.where(before > 0.0, before, 1.0)
        usual = float(np.quantile(ratios, 0.5, method="lower"))
        more = self.shining - usual * before
        more[np.abs(more) <= _SAME * self.shining] = 0.0
        if not more.any():
            return usual, np.zeros(len(points))

        def find() -> FloatArray:
            lamps = DirectLight(self.scene, self.blockers, trace=self.trace, more=more)
            return lamps.at(points, normals, patches)[0]

        of = (self._lamps, before, points, normals, patches)
        return usual, self.kept.find("change of light", of, find)

    def stays(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """See `DirectLight.stays`."""
        if not len(sun_numbers(self.scene, self.blockers)):
            return np.ones(len(points))
        return self._made.stays(points, normals)

    @property
    def _made(self) -> DirectLight:
        if self._light is None:
            self._light = DirectLight(self.scene, self.blockers, trace=self.trace)
        return self._light
