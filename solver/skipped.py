"""Which stages a scene does not need."""

from __future__ import annotations

import numpy as np

from .kernels.pyramid import Blockers
from .model.scene import BLACK, SceneData
from .outside_light import PLAIN
from .skies import ground_luminance
from .topology import is_single

#: Why nothing is looked for that surfaces send each other.
NOTHING_REFLECTS = "no surface reflects or emits light"
#: What is not done then.
FOR_REFLECTED = ("form factors", "radiosity", "iterated gather", "refinement", "reuse of the mesh")


def reflects_nothing(scene: SceneData) -> bool:
    """Whether all light comes straight from outside, and is told without the surfaces' own.

    Form factors between elements are wanted all the same for pictures, for panes, and where so many
    surfaces hide the sky that elements know by their meridians what is open of it.
    """
    if scene.luminaires or scene.cameras or scene.glazings:
        return False
    for row in np.unique(scene.material_index[scene.material_index != BLACK]):
        material = scene.materials[row]
        sent = (material.scattered_in(scene.bands), material.mirror_bands)
        if any(np.any(np.asarray(share) > 0.0) for share in sent):
            return False
    ground = ground_luminance(scene.ground, scene.sky, scene.sun)
    return len(scene.patches) <= PLAIN or (scene.sky is None and ground == 0.0)


def not_needed(scene: SceneData, blockers: Blockers, visibility: str) -> dict[str, str]:
    """Stages that a scene does not need, and why; see `simulation.solve` for ``visibility``."""
    skipped: dict[str, str] = {}
    clear = scene.opaque_count < len(scene.patches)
    if visibility == "none":
        skipped["visibility"] = "switched off"
    elif clear:
        pass  # light from outside comes past the edges of panes
    elif is_single(blockers, blockers.hollow):
        skipped["visibility"] = "one convex cavity: nothing can hide anything"
    elif is_single(blockers, blockers.bulging) and not scene.sensors:
        skipped["visibility"] = "one convex body: nothing can hide anything"
    if scene.bands == 1:
        skipped["colour"] = "every material is grey: one band"
        if any(light is not None and light.color != "constant" for light in (scene.sky, scene.sun)):
            skipped["colour of the sky"] = "one band: no surface and no sensor tells colours apart"
    if not clear:
        off = visibility == "none"
        skipped["glass"] = "switched off" if off else "nothing is seen through"
    if not scene.luminaires:
        skipped["electric light"] = "no luminaires"
    if scene.sky is None:
        skipped["sky"] = "no sky"
    if scene.sun is None:
        skipped["sun"] = "no sun"
    if not scene.cameras:
        skipped["images"] = "no cameras"
    if not scene.sensors:
        skipped["sensors"] = "no sensor grids"
    return skipped
