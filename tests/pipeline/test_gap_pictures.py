"""Pictures of a wall beside a plate that hangs close to it, against sensors on that wall."""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.pipeline import Camera, Emitter, Material, PatchSet, Scene, SensorGrid, simulate

#: Half the side of the room, of the plate, and height of its middle. [m]
HALF, PLATE, MIDDLE = 2.0, 0.3, 1.2


@pytest.mark.parametrize("gap", [0.005, 0.02])
def test_light_beside_the_gap_is_that_of_sensors(gap):
    """Means of lit and dark elements showed 33 lx where a sensor says 81, up to 0.3 m around."""
    scene = Scene()
    scene.add(PatchSet.box((2 * HALF, 2 * HALF, 2.6), (0, 0, 1.3), inward=True), "room")
    plate = PatchSet.box((2 * PLATE, 0.01, 0.4), (0.0, HALF - gap - 0.005, MIDDLE))
    scene.add(plate, "plate")
    scene.add(PatchSet.disk((0.3, -0.3, 2.5), 0.15, (0, 0, -1)), "lamp")
    scene.assign("room", Material(0.6))
    scene.assign("lamp", Emitter(flux_lm=2000))
    x = np.concatenate([np.linspace(-0.5, -0.33, 8), np.linspace(0.33, 0.5, 8)])
    points = np.stack([x, np.full_like(x, HALF - 1e-4), np.full_like(x, MIDDLE)], axis=1)
    scene.add(SensorGrid(points, (0, -1, 0), name="wall"))
    eye = np.array([0.0, 0.5, MIDDLE])
    scene.add(Camera(tuple(eye), (0, HALF, MIDDLE), name="front", fov_deg=40, size=(101, 21)))
    result = simulate(scene, accuracy=0.05, cache=False)
    image = result.images["front"]
    _, rays = image.camera.rays()
    seen = eye + image.depth_m[..., None] * rays
    row = 10
    lit = np.abs(seen[row, :, 1] - HALF) < 1e-6
    shown = np.interp(x, seen[row, lit, 0], image.illuminance_lx[row, lit])
    told = result.sensors["wall"].illuminance_lx
    # Light on the wall changes by a tenth from element to element there.
    np.testing.assert_allclose(shown, told, rtol=0.12)
