"""What pictures show of glossy surfaces and mirrors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .raycast import Hits

if TYPE_CHECKING:
    from .second_pass import SecondPass

#: Mirrors that a ray of a picture meets at most.
MOST_MIRRORS = 12
#: Distance within which rays from a mirror do not hit it, against the size of the scene.
NEAR = 1e-7
#: Accuracy of lamps in lobes, rays a direction for all else, and how many times more at most.
_ACCURACY, _RAYS, _ROUNDS = 0.1, 3, 12
#: Luminance that does not matter in a lobe, against that of what is around it.
_FLOOR = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What m rays meet; row i of every array is the same ray.

    Attributes
    ----------
    origins, directions : (m, 3) array
        The rays.
    hits : Hits
        What they meet.
    normals : (m, 3) array
        Towards the viewer, NaN where nothing is met.
    illuminance : (m,) array
        There. [lx]
    """

    origins: FloatArray
    directions: FloatArray
    hits: Hits
    normals: FloatArray
    illuminance: FloatArray

    @property
    def side(self) -> IntArray:
        """Side (m,) of the patch that is seen: 0 for +, 1 for −."""
        return np.asarray((self.hits.facing < 0).astype(np.int64))

    def points(self, rows: IntArray) -> FloatArray:
        """Where some of them hit (k, 3). [m]"""
        return np.asarray(self.origins[rows] + self.hits.t[rows, None] * self.directions[rows])


class Shine:
    """Shares of glossy and mirroring reflection by patch side, for pictures.

    Parameters
    ----------
    scene : SceneData
        The scene.
    second : SecondPass or None
        Light in lobes; without, glossy surfaces are shown as diffuse.
    bands : int
        Bands of light.
    """

    def __init__(self, scene: SceneData, second: SecondPass | None, bands: int) -> None:
        self.scene = scene
        self.second = second if second is not None and second.sides.any else None
        index = scene.material_index
        # Patch −1 is the last row.
        self._mirror = np.zeros((len(index) + 1, 2, 3))
        for row, material in enumerate(scene.materials):
            share = material.mirror_bands if bands == 3 else material.luminous_mirror
            self._mirror[:-1][index == row] = share
        self._mirror[:-1][~np.asarray(scene.two_sided), 1] = 0.0
        low, high = scene.patches.bounds()
        self.near = NEAR * float(np.linalg.norm(high - low))

    def mirrors(self, seen: Seen) -> FloatArray:
        """Share (m, 3) that what is seen mirrors."""
        return np.asarray(self._mirror[seen.hits.patch, seen.side])

    def add_lobes(
        self, rgb: FloatArray, seen: Seen, emitted: Callable[[IntArray], FloatArray]
    ) -> None:
        """Turn diffuse luminances (m, 3) into those of glossy surfaces where there are any.

        ``emitted`` tells what of the luminances (k, 3) of some rows the surfaces emit.
        """
        if self.second is None:
            return
        sides, patch, side = self.second.sides, seen.hits.patch, seen.side
        none = np.zeros((1, 2), dtype=bool)
        glossy = np.concatenate([np.asarray(sides.specular.any(axis=2)), none])
        # Behind a one-sided patch, where no light was computed, nothing shines.
        rows = np.flatnonzero(glossy[patch, side] & np.isfinite(seen.normals[:, 0]))
        if not len(rows):
            return
        patch, side = patch[rows], side[rows]
        scattered = rgb[rows]
        shining = np.flatnonzero(self.scene.luminaire_index[patch, side] >= 0)
        if len(shining):
            scattered[shining] -= emitted(rows[shining])
        found, albedo = self.second.lobes(
            seen.points(rows),
            seen.normals[rows],
            -seen.directions[rows],
            sides.exponent[patch, side],
            _FLOOR * (seen.illuminance[rows] / np.pi + 1e-12),
            accuracy=_ACCURACY,
            rays=_RAYS,
            rounds=_ROUNDS,
            by_group=False,
        )
        share, specular = sides.share[patch, side], sides.specular[patch, side]
        rgb[rows] += specular * found[:, 0] - share * albedo[:, None] * scattered
