"""View out of points, by EN 17037: sight angle, distance, and layers of what is seen.

From each point rays go to all sides, past the exact surfaces. The outside is seen where a ray
leaves the scene or meets what stands outdoors. The horizontal sight angle is the measure of the
azimuths in which that is so at any altitude; its ends are found by bisection. Distances are from
the eye; from the opening, as the standard has them, they are shorter by the way to it.

References
----------
.. [1] EN 17037:2018+A1:2021, "Daylight in buildings", 5.2 and annex C: horizontal sight angles of
   14, 28 and 54 degrees, outside distances of 6, 20 and 50 m, and the layer of landscape, one more,
   or all three of sky, landscape and ground, over 75 % of the utilised area.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .model.patches import PatchSet
from .raycast import RayCaster

#: Levels from the lowest on: sight angle [deg], distance [m], and number of layers. [1]
LEVELS = {"minimum": (14.0, 6.0, 1), "medium": (28.0, 20.0, 2), "high": (54.0, 50.0, 3)}
#: Share of the area that a level is asked of. [1]
AREA = 0.75
#: Degrees between rays in azimuth and altitude, and how often the interval at an end is halved.
STEP_DEG, HALVINGS = 1.0, 10
#: Distances that levels ask for, from the least on: bounds of the classes of an azimuth. [m]
_DISTANCES = np.array([distance for _, distance, _ in LEVELS.values()])
#: Distance in which rays begin, against the size of the scene.
_LIFT = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class ViewOut:
    """What is seen from m points; row i of every array is the same point.

    Attributes
    ----------
    area_m2 : (m,) array
        Of each point.
    sight_angle_deg : (m,) array
        Horizontal sight angle, of all openings together. [deg]
    far_deg : (3, m) array
        The part of it in which what is seen is as far from the eye as each of `LEVELS` asks. [deg]
    distance_m : (m,) array
        Median over the sight angle of the horizontal distance from the eye to what is seen next to
        the horizon; infinite where nothing stands there or level ground goes on, not a number where
        nothing is seen.
    sky, landscape, ground : (m,) bool array
        Which layers are seen.
    """

    area_m2: FloatArray
    sight_angle_deg: FloatArray
    far_deg: FloatArray
    distance_m: FloatArray
    sky: NDArray[np.bool_]
    landscape: NDArray[np.bool_]
    ground: NDArray[np.bool_]

    def reaches(self, level: str) -> NDArray[np.bool_]:
        """Points (m,) with the sight angle of a level, as far as it asks, and with its layers."""
        row = list(LEVELS).index(level)
        angle, _, layers = LEVELS[level]
        seen = self.sky.astype(int) + self.landscape + self.ground
        return np.asarray((self.far_deg[row] >= angle) & self.landscape & (seen >= layers))

    def share(self, level: str) -> float:
        """Share of the area that reaches a level."""
        return float(self.area_m2 @ self.reaches(level) / self.area_m2.sum())

    @property
    def level(self) -> str | None:
        """The highest level that enough of the area reaches; None where none does. [1]"""
        reached = [name for name in LEVELS if self.share(name) >= AREA - 1e-9]
        return reached[-1] if reached else None


class Viewer:
    """Sees out of one scene.

    Parameters
    ----------
    patches : PatchSet
        Surfaces that hide.
    outside, ground : (p,) bool array
        Patches outdoors: buildings, trees, terrain far away; and the ground, part of these or not.
        What lies beyond the scene is sky above the horizon, ground below it, landscape at it.
    """

    def __init__(
        self, patches: PatchSet, outside: NDArray[np.bool_], ground: NDArray[np.bool_]
    ) -> None:
        self._caster = RayCaster(patches)
        self._outside, self._ground = outside | ground, ground
        low, high = patches.bounds()
        self._lift = _LIFT * float(np.linalg.norm(high - low))
        count = round(90.0 / STEP_DEG)
        altitude = np.radians(STEP_DEG * np.arange(1 - count, count))
        altitude[count - 1] = 0.0
        #: Of rays of one azimuth: along it, up, and their order from the horizon away.
        self._along, self._up = np.cos(altitude), np.sin(altitude)
        self._order = np.argsort(np.abs(altitude), kind="stable")

    def view(
        self,
        points: FloatArray,
        area_m2: FloatArray,
        tell: Callable[[int, int], None] | None = None,
    ) -> ViewOut:
        """What is seen from ``points`` (m, 3), at the height of the eyes. [m]

        ``tell`` is called as ``tell(done, total)``.
        """
        found = []
        for done, point in enumerate(points):
            if tell is not None:
                tell(done, len(points))
            found.append(self._from(point))
        angles, distances, layers = (np.array(values) for values in zip(*found, strict=True))
        return ViewOut(
            np.asarray(area_m2, dtype=np.float64),
            angles[:, 0],
            angles[:, 1:].T,
            distances,
            *(layers[:, k].astype(bool) for k in range(3)),
        )

    def _from(self, point: FloatArray) -> tuple[FloatArray, float, NDArray[np.bool_]]:
        """Angles (4,): all, and as far as each level asks; distance; layers (3,)."""
        low = np.arange(0.0, 360.0, STEP_DEG)
        high = low + STEP_DEG
        distance, layers = self._look(point, low)
        kind = _kind(distance)
        widths = np.zeros(len(_DISTANCES) + 2)
        first, last = kind, np.roll(kind, -1)
        for _ in range(HALVINGS):
            same = first == last
            np.add.at(widths, first[same], (high - low)[same])
            low, high, first, last = (a[~same] for a in (low, high, first, last))
            if not len(low):
                break
            middle = 0.5 * (low + high)
            own = _kind(self._look(point, middle)[0])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            first, last = np.concatenate([first, own]), np.concatenate([own, last])
        np.add.at(widths, first, 0.5 * (high - low))
        np.add.at(widths, last, 0.5 * (high - low))
        seen = distance[kind > 0]
        middle_distance = float(np.sort(seen)[len(seen) // 2]) if len(seen) else float("nan")
        # At least as far: kind k + 1 is from the distance of level k on.
        far = np.cumsum(widths[::-1])[::-1]
        return far[1:], middle_distance, layers

    def _look(
        self, point: FloatArray, azimuth_deg: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Distance (k,) of what is seen outside in azimuths (k,), −1 of nothing; layers (3,)."""
        turn = np.radians(azimuth_deg)[:, None]
        d = np.stack(
            np.broadcast_arrays(self._along * np.sin(turn), self._along * np.cos(turn), self._up),
            axis=2,
        )
        origins = np.broadcast_to(point, d.shape).reshape(-1, 3)
        hits = self._caster.first_hit(origins, d.reshape(-1, 3), t_min=self._lift)
        patch = hits.patch.reshape(d.shape[:2])
        free = patch < 0
        on_ground, outdoors = _of(self._ground, patch), _of(self._outside, patch)
        seen = free | outdoors
        level = self._up == 0.0
        layers = np.array(
            [
                (free & (self._up > 0.0)).any(),
                ((outdoors & ~on_ground) | (free & level)).any(),
                ((free & (self._up < 0.0)) | on_ground).any(),
            ]
        )
        away = hits.t.reshape(d.shape[:2]) * self._along
        # Ground below the horizon goes on behind; where it rises above, it stands there.
        away[free | (on_ground & (self._up < 0.0))] = np.inf
        nearest = np.argmax(seen[:, self._order], axis=1)
        row = np.arange(len(away))
        distance = away[:, self._order][row, nearest]
        return np.where(seen.any(axis=1), distance, -1.0), layers


def _of(flags: NDArray[np.bool_], patch: IntArray) -> NDArray[np.bool_]:
    """Flags (...) of patches, False of none."""
    return np.asarray(flags[np.maximum(patch, 0)] & (patch >= 0))


def _kind(distance: FloatArray) -> IntArray:
    """Class of a distance: 0 of nothing, 1 below that of the first level, and so on."""
    far = 1 + np.searchsorted(_DISTANCES, distance, side="right")
    return np.where(distance < 0.0, 0, far)
