"""What a simulation may take, told before it starts."""

from __future__ import annotations

import numpy as np

from .budget import USUALLY_MORE, Budget
from .model.scene import SceneData
from .raycast import flat

#: Wall-clock time on two idle cores: half of the CPU time of each stage of the demos and of rooms
#: with one lamp and with one window (accuracy 0.1 to 0.01). [s]
_START = 0.3
#: A pair of node and element, with the comparison with a coarser mesh: 0.2 … 0.3 µs.
_PAIR = 3e-7
#: A pair of element and lamp patch, to find where to cut, on two meshes.
_LAMP = 1e-5
#: A receiver and a lamp patch that shines by a photometric web: 5 to 7 µs of many lamps, 30 of two.
_WEB = 1e-5
#: A sensor, times the accuracy: lamps and surfaces, and besides them the sky. Where all surfaces
#: are flat, their contours and the sky past them are exact, and cost a hundredth.
_SENSOR, _SENSOR_SKY, _FLAT = 2.5e-4, 1.2e-3, 0.01
#: A pixel of a camera: 2 µs on one core, the picture's file not counted; and in the sun's light.
_PIXEL, _PIXEL_SUN = 1.5e-6, 1e-5
#: Actual times of these scenes are 0.4 to 1.6 of what is told of them, and less of what is hardly
#: a second; where a mesh is made anew because it does not do, more.
SPREAD = 3.0


def duration(scene: SceneData, budget: Budget) -> tuple[float, float]:
    """From how many seconds to how many `solve` may take on two idle cores, without compiling. [s]

    Reading of models and writing of files are not in it.
    """
    more = 1.0 + (USUALLY_MORE if scene.luminaires else 0.0)
    pairs = float(budget.receivers) * budget.elements * more**2
    cuts = _LAMP * budget.elements * int((scene.luminaire_index >= 0).sum())
    by_web = np.array([lamp.web is not None for lamp in scene.luminaires] + [False])
    webs = _WEB * budget.receivers * int(by_web[scene.luminaire_index].sum())
    sensor = _SENSOR if scene.sky is None else _SENSOR + _SENSOR_SKY
    if flat(scene.patches.control_points).all():
        sensor *= _FLAT
    sensors = sum(len(grid) for grid in scene.sensors)
    pixels = sum(camera.size[0] * camera.size[1] for camera in scene.cameras)
    pixel = _PIXEL if scene.sun is None else _PIXEL + _PIXEL_SUN
    seen = sensor / budget.accuracy * sensors + pixel * pixels
    told = _START + cuts + webs + _PAIR * pairs + seen
    return told / SPREAD, told * SPREAD
