"""Lamps whose exitance varies over their surface: from the emitter to the scene."""

from __future__ import annotations

import dataclasses

from patchlight.solver.model import Emitter, Luminaire
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.profiles import Profile, checked_profile


def with_profile(
    lamp: Luminaire, emitter: Emitter, placement: FloatArray, patches: IntArray
) -> Luminaire:
    """The lamp with the profile of its emitter.

    Parameters
    ----------
    placement : (4, 4) array
        From coordinates of the part to those of the frozen scene.
    patches : (p,) int array
        Emitting patches of the scene.

    Raises
    ------
    InputError
        If there are tables for another number of patches.
    """
    given = checked_profile(emitter.profile)
    profile = Profile.of(given, part=lamp.part, placement=placement, patches=patches)
    return dataclasses.replace(lamp, profile=profile)
