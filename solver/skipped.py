"""Which stages a scene does not need."""

from __future__ import annotations

from .kernels.pyramid import Blockers
from .model.scene import SceneData
from .topology import is_single


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
