"""Pictures through panes: what is behind them, dimmed, and what their faces send."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .panes import make_panes, shares_through
from .raycast import RayCaster

#: Panes seen one behind the other.
MOST_SEEN = 16
#: Luminance (m, 3) where rays with directions (m, 3) meet patches at (u, v) from a side. [cd/m²]
Shaded = Callable[[FloatArray, IntArray, FloatArray, FloatArray, IntArray], FloatArray]


class PaneView:
    """The panes of a scene before a camera.

    Parameters
    ----------
    scene : SceneData
        With see-through patches.
    """

    def __init__(self, scene: SceneData) -> None:
        rows = np.flatnonzero(scene.see_through)
        self._panes, self._first = make_panes(scene), int(rows[0])
        self._caster = RayCaster(scene.patches.take(rows))
        low, high = scene.patches.bounds()
        self._lift = 1e-9 * float(np.linalg.norm(high - low))

    def cover(
        self,
        rgb: FloatArray,
        origins: FloatArray,
        directions: FloatArray,
        distance: FloatArray,
        shaded: Shaded,
    ) -> None:
        """Put the panes before what is seen, in place.

        Parameters
        ----------
        rgb : (m, 3) array
            Luminance at the end of each ray. [cd/m²]
        origins, directions : (m, 3) array
            Rays, with unit directions.
        distance : (m,) array
            Where they end. [m]
        shaded : callable
            What the faces of panes send.
        """
        start = np.full(len(rgb), self._lift)
        layers: list[tuple[IntArray, FloatArray, FloatArray]] = []
        rows = np.flatnonzero(~np.isnan(directions[:, 0]))
        for _ in range(MOST_SEEN):
            at = origins[rows] + start[rows, None] * directions[rows]
            hits = self._caster.first_hit(at, directions[rows])
            met = (hits.patch >= 0) & (start[rows] + hits.t < distance[rows] - self._lift)
            rows, at = rows[met], at[met]
            if not len(rows):
                break
            patch, facing, t = hits.patch[met], hits.facing[met], hits.t[met]
            share, _ = shares_through(
                self._panes, at, directions[rows], t_min=0.0, t_max=t + self._lift
            )
            # The inside of a solid pane is not lit, and crossed already.
            own = shaded(directions[rows], patch + self._first, hits.u[met], hits.v[met], facing)
            own[self._panes.solid[patch] & (facing < 0)] = 0.0
            layers.append((rows, share, own))
            start[rows] += t + 2.0 * self._lift
        for rows, share, own in reversed(layers):
            rgb[rows] = own + share[:, None] * rgb[rows]
