"""Daylight factors beside other light: the scene once more, under an overcast sky.

Surfaces, mesh and tolerances are those of the first run, so that its form factors serve again, and
one more right-hand side is all there is to solve where they are kept; see `reuse`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from .model.reached import accuracy_message
from .model.result import Result
from .model.scene import SceneData
from .model.sky import CIESky, Ground

#: Name of the stage, and what stands before its warnings.
STAGE = "daylight factor"


def overcast_scene(scene: SceneData) -> SceneData:
    """The scene under the overcast sky its daylight factors are asked for; lamps are dark."""
    asked = scene.daylight_factors
    assert asked is not None
    ground = Ground() if scene.ground is None else scene.ground
    return replace(
        scene.without_spectra,
        sky=CIESky(asked.sky_type),
        sun=None,
        ground=ground,
        luminaires=tuple(replace(lamp, flux_lm=0.0) for lamp in scene.luminaires),
        cameras=(),
        daylight_factors=None,
    )


def with_daylight_factors(result: Result, run: Callable[[SceneData, str], Result]) -> Result:
    """``result`` with the daylight factors that its scene asks for, if any.

    Parameters
    ----------
    result : Result
        Of the scene as it is.
    run : callable
        Solves a scene as ``result`` was solved, beside it; told what for.
    """
    scene = result.scene
    if scene.daylight_factors is None:
        return result
    if not scene.sensors:
        why = "no sensor grids"
    elif _tells_them(result):
        why = "the scene is lit by that overcast sky alone"
    else:
        why = ""
    if why:
        return replace(result, skipped={**result.skipped, STAGE: why})
    start = time.perf_counter()
    other = run(overcast_scene(scene), STAGE)
    seconds = time.perf_counter() - start
    known = set(result.warnings)
    # What is off by so many lx there is a part of a sky of another level than that of the scene.
    accuracy = float(other.settings["accuracy"])
    in_lx = accuracy_message(other.sensors, accuracy)
    as_factors = accuracy_message(other.sensors, accuracy, as_factors=True)
    told = [as_factors if text == in_lx else text for text in other.warnings]
    return replace(
        result,
        sensors={
            name: replace(grid, daylight=other.sensors[name].daylight)
            for name, grid in result.sensors.items()
        },
        stages={**result.stages, STAGE: seconds},
        counters={
            **result.counters,
            "daylight_factor_pairs_reused": other.counters.get("pairs_reused", 0),
        },
        warnings=(
            *result.warnings,
            *(f"{STAGE}: {text}" for text in told if text not in known),
        ),
        converged=result.converged and other.converged,
    )


def _tells_them(result: Result) -> bool:
    """Whether the light of the scene itself is what daylight factors are asked for under."""
    asked, scene = result.scene.daylight_factors, result.scene
    if asked is None or any(lamp.flux_lm > 0.0 for lamp in scene.luminaires):
        return False
    found = [grid.daylight for grid in result.sensors.values()]
    return all(shares is not None and shares.sky_type == asked.sky_type for shares in found)
