"""What the light of a year depends on, by which pieces of a run that was cut are known again."""

from __future__ import annotations

import dataclasses

import numpy as np
from patchlight.solver.model import Luminaire, SceneData
from patchlight.solver.model.arrays import FloatArray

#: Points a direction of each patch at which a profile that is a function is told apart: many
#: against the 7 by which the solver looks at an element. A change that shows at none of them is
#: not seen.
PROFILE_POINTS = 32


def of_scene(data: SceneData, with_lamps: bool) -> tuple[object, ...]:
    """What of a scene decides on the light of its sensors, as `year_store.key_of` takes it."""
    lamps: tuple[object, ...] = ()
    if with_lamps:
        told = [_of_lamp(data, k, lamp) for k, lamp in enumerate(data.luminaires)]
        lamps = (told, data.luminaire_index)
    return (
        data.patches, data.two_sided, data.closed, data.material_index, data.materials,
        data.glazings, data.glass_index, data.ground, data.sensors, lamps,
        [(part.path, part.kind) for part in data.parts],
    )  # fmt: skip


def _of_lamp(data: SceneData, row: int, lamp: Luminaire) -> tuple[object, ...]:
    """A lamp; of a profile that is a function its values, for functions have no hash."""
    profile = lamp.profile
    if profile is None or profile.function is None:
        return (lamp,)
    return dataclasses.replace(lamp, profile=None), profile.to_part, _values(data, row)


def _values(data: SceneData, row: int) -> FloatArray:
    """Profile of a lamp at points of the patches that it emits by, in their order."""
    profile = data.luminaires[row].profile
    assert profile is not None
    patches = np.flatnonzero((data.luminaire_index == row).any(axis=1))
    t = (np.arange(PROFILE_POINTS) + 0.5) / PROFILE_POINTS
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    points = data.patches.take(patches).evaluate(u, v)
    count = len(patches)
    patch = np.repeat(patches, len(u))
    return profile.at(points.reshape(-1, 3), patch, np.tile(u, count), np.tile(v, count))
