"""View out of the sensors of a scene, by EN 17037."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError

from .assigning import matched_parts, row_offsets
from .scene import Scene
from .states import settings_of
from .year import with_grids

if TYPE_CHECKING:
    from patchlight.solver.view_out import ViewOut

    from .simulation import Progress

Patterns = str | Iterable[str]


def view_out(
    scene: Scene,
    *,
    sensors: str | Iterable[str] | None = None,
    outside: Patterns = (),
    ground: Patterns = (),
    state: str | Iterable[str] | None = None,
    progress: Progress | None = None,
) -> dict[str, ViewOut]:
    """Sight angle, distance and layers of the view out of every sensor, by EN 17037 [1].

    Sensors are eyes, which look to all sides whatever way they face: their grid should lie at the
    height of eyes, 1.2 m of who sits and 1.7 m of who stands. Clear panes are seen through, those
    that scatter are not.

    Parameters
    ----------
    scene : Scene
        The room and what stands around it; lamps and sky do not count.
    sensors : str or several, optional
        Names of grids; all of them when not given.
    outside : str or several
        Patterns of parts that stand outdoors and are seen as landscape, such as houses and trees.
    ground : str or several
        Patterns of parts that are the ground outdoors.
    state : str or several, optional
        State of the scene (`Scene.add_state`), or one of each window group; the first of each when
        not given, such as blinds that are up.
    progress : callable, optional
        Called as ``progress(stage, done, total)``.

    Returns
    -------
    dict of ViewOut
        By the name of the grid: angles [deg], distances from the eye [m], layers, and levels.

    Raises
    ------
    InputError
        For patterns that match nothing, grids that there are not, and all that `Scene.freeze`
        finds.

    References
    ----------
    .. [1] EN 17037:2018+A1:2021, "Daylight in buildings", 5.2.
    """
    from patchlight.solver.view_out import Viewer

    if state is None and scene.states:
        state = settings_of(scene.states.values())[0].states
    # Sensors may lie on parts that are not there in this state.
    grids = with_grids(scene.freeze(), sensors).sensors
    data = dataclasses.replace(scene.freeze(state=state), sensors=grids)
    if not data.sensors:
        raise InputError("view_out: the scene has no sensors; give a grid")
    clear = np.array([glazing.glass.diffuse == 0.0 for glazing in data.glazings] + [False])
    hides = data.taken(np.flatnonzero(~clear[data.glass_index]))

    def of(key: str, patterns: Patterns) -> NDArray[np.bool_]:
        """Patches (p,) of the parts that match."""
        starts = row_offsets(scene.entries)[0]
        rows: set[int] = set()
        for pattern in (patterns,) if isinstance(patterns, str) else patterns:
            label = f"view_out: {key} {pattern!r}"
            hits = matched_parts(scene.entries, pattern, label=label)
            rows |= {starts[name] + k for name, k in hits}
        return np.isin(hides.patches.part_index, list(rows))

    viewer = Viewer(hides.patches, of("outside", outside), of("ground", ground))
    tell = None if progress is None else partial(progress, "view out")
    return {grid.name: viewer.view(grid.points, grid.area_m2, tell) for grid in data.sensors}
