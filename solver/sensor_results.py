"""What was found at the sensors of a grid."""

from __future__ import annotations

import numpy as np

from .incident import Gathered
from .model.arrays import FloatArray
from .model.colorimetry import SpectralLight
from .model.daylight import DaylightShares
from .model.result import SensorResult, luminous
from .model.scene import SceneData
from .model.sky import CIESky
from .model.views import Sensors
from .skies import horizontal_illuminance


def sensor_result(
    scene: SceneData,
    index: int,
    gathered: Gathered,
    more: FloatArray,
    outdoors: FloatArray | float = 0.0,
    *,
    least: float = 0.0,
    spectral: bool = True,
) -> SensorResult:
    """Light at the sensors of a grid; ``more`` (m,) is all error but that of samples. [lx]

    ``outdoors`` (m,) of their light of sky and ground comes straight from surfaces outdoors. Light
    that is less than ``least`` with its error is none. [lx] Its colour is told with ``spectral``
    alone, where it is asked for.
    """
    grid = scene.sensors[index]
    dark = gathered.luminous() + more + 2.0 * gathered.deviation < least
    if dark.any():
        gathered, more = gathered.without(dark), np.where(dark, 0.0, more)
        outdoors = np.where(dark, 0.0, outdoors)
    components = {name: luminous(v) for name, v in gathered.components.items()}
    error = more + 2.0 * gathered.deviation
    return SensorResult(
        name=grid.name,
        points=grid.points,
        normals=grid.normals,
        area_m2=grid.area_m2,
        illuminance_lx=gathered.luminous(),
        error_lx=error,
        components=components,
        daylight=_daylight(scene, components, error, outdoors),
        outline=grid.outline,
        spectral=_spectral(scene, grid, gathered, error) if spectral else None,
    )


def _spectral(
    scene: SceneData, grid: Sensors, gathered: Gathered, error_lx: FloatArray
) -> SpectralLight | None:
    """Colour of the light, where it is asked for."""
    if not grid.spectral:
        return None
    from .spectral_sensors import spectral_light

    model = "constant" if scene.sky is None else scene.sky.color
    return spectral_light(gathered.components, error_lx, model)


def tells_daylight_factors(scene: SceneData) -> bool:
    """Whether the scene's own light tells daylight factors: no dark sky, and no sun."""
    sky = scene.sky
    if sky is None or not sky.of_daylight_factors or scene.sun is not None:
        return False
    return horizontal_illuminance(sky) > 0.0


def _daylight(
    scene: SceneData,
    components: dict[str, FloatArray],
    error_lx: FloatArray,
    outdoors: FloatArray | float,
) -> DaylightShares | None:
    """Shares of the unobstructed sky's horizontal illuminance, under type 1 or 16 only."""
    sky = scene.sky
    if not (tells_daylight_factors(scene) and isinstance(sky, CIESky)):
        return None
    nothing = np.zeros(len(error_lx))
    straight, ground, indirect, from_ground = (
        components.get(name, nothing)
        for name in ("sky.direct", "ground.direct", "sky.indirect", "ground.indirect")
    )
    level = horizontal_illuminance(sky)
    return DaylightShares(
        sky_type=int(sky.type),
        sky=straight / level,
        external=(ground + outdoors) / level,
        internal=(indirect + from_ground - outdoors) / level,
        error=error_lx / level,
    )
