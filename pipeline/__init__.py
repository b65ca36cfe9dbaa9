"""Scenes, simulation, batches and the command line.

Importing this package loads nothing heavy; each name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from patchlight.solver.lazy import lazy_attributes

if TYPE_CHECKING:
    from patchlight.importers import (
        from_cadquery,
        read_patch_sky,
        read_photometry,
        read_step,
        read_weather,
    )
    from patchlight.reports import write_report
    from patchlight.solver.model import (
        Air,
        Camera,
        CIESky,
        DaylightFactors,
        Emitter,
        Glass,
        Ground,
        Material,
        Model,
        PatchSet,
        PatchSky,
        PerezSky,
        Photometry,
        Result,
        SceneData,
        Sensors,
        Site,
        Sun,
        Weather,
    )

    from .batch_items import BatchItem
    from .batches import batch
    from .grids import SensorGrid
    from .scene import Scene
    from .scene_file import load_scene
    from .simulation import forget, simulate
    from .viewing import view_out
    from .year import simulate_year

#: Module of every public name.
_HOME = {
    "Scene": ".scene",
    "SensorGrid": ".grids",
    "simulate": ".simulation",
    "simulate_year": ".year",
    "view_out": ".viewing",
    "forget": ".simulation",
    "load_scene": ".scene_file",
    "batch": ".batches",
    "BatchItem": ".batch_items",
    "read_patch_sky": "patchlight.importers",
    "read_photometry": "patchlight.importers",
    "read_step": "patchlight.importers",
    "read_weather": "patchlight.importers",
    "from_cadquery": "patchlight.importers",
    "write_report": "patchlight.reports",
} | dict.fromkeys(
    (
        "Air",
        "CIESky",
        "Camera",
        "DaylightFactors",
        "Emitter",
        "Glass",
        "Ground",
        "Material",
        "Model",
        "PatchSet",
        "PatchSky",
        "PerezSky",
        "Photometry",
        "Result",
        "SceneData",
        "Sensors",
        "Site",
        "Sun",
        "Weather",
    ),
    "patchlight.solver.model",
)

__all__ = [
    "Air",
    "BatchItem",
    "CIESky",
    "Camera",
    "DaylightFactors",
    "Emitter",
    "Glass",
    "Ground",
    "Material",
    "Model",
    "PatchSet",
    "PatchSky",
    "PerezSky",
    "Photometry",
    "Result",
    "Scene",
    "SceneData",
    "SensorGrid",
    "Sensors",
    "Site",
    "Sun",
    "Weather",
    "batch",
    "forget",
    "from_cadquery",
    "load_scene",
    "read_patch_sky",
    "read_photometry",
    "read_step",
    "read_weather",
    "simulate",
    "simulate_year",
    "view_out",
    "write_report",
]


__getattr__ = lazy_attributes(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted(__all__)
