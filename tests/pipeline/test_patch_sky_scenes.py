"""Measured skies in whole scenes: past what is curved, through panes, in pictures."""

import numpy as np
import pytest
from patchlight.pipeline import (
    Camera,
    CIESky,
    Glass,
    Material,
    PatchSet,
    PatchSky,
    Scene,
    SensorGrid,
    simulate,
)
from patchlight.solver import skies

from .window_room import level, opening, window_room

UP = (0.0, 0.0, 1.0)
POINTS = np.array([(0.0, y, 0.8) for y in (0.6, 1.4, 2.6)])
RANDOM = PatchSky(np.random.default_rng(7).uniform(500.0, 20_000.0, 145))


def found(scene, sky, accuracy=0.02):
    scene.sky = sky
    return simulate(scene, accuracy=accuracy).sensors["plane"]


def room():
    scene = window_room(4.0, 3.0, 0.5)
    scene.add(SensorGrid(POINTS, np.tile(UP, (3, 1)), name="plane"))
    return scene


def test_even_patches_past_a_ball():
    """Meridians and pyramids instead of half-planes: as under the uniform sky of type 5."""
    scene = room()
    scene.add(PatchSet.sphere((0.8, 1.2, 1.2), 0.3), "ball")
    scene.assign("ball", Material(0.4))
    one = found(scene, PatchSky(np.full(145, 3000.0)))
    other = found(scene, CIESky(5, zenith_luminance_cd_m2=3000.0))
    slack = one.error_lx + other.error_lx
    assert (np.abs(one.illuminance_lx - other.illuminance_lx) <= slack).all()
    assert (one.error_lx <= 0.03 * one.illuminance_lx).all()


def test_a_pane_that_keeps_nothing_back():
    """Of index 1 and without absorption: what comes through is what comes with no pane at all."""
    free = found(room(), RANDOM)
    scene = room()
    scene.add(opening(), "pane", two_sided=True)
    scene.assign("pane", Glass(0.006, n=1.0, absorption_per_m=0.0))
    glazed = found(scene, RANDOM)
    slack = free.error_lx + glazed.error_lx
    assert (np.abs(free.illuminance_lx - glazed.illuminance_lx) <= slack).all()
    np.testing.assert_allclose(
        glazed.components["sky.direct"], free.components["sky.direct"], rtol=2e-3
    )


def test_another_measured_sky_needs_no_new_form_factors():
    """Of a brighter sky of the same pattern, and of another pattern: to what both tell."""
    scene = room()
    first = found(scene, RANDOM)
    bright = PatchSky(RANDOM.luminance_cd_m2, diffuse_illuminance_lx=1e5)
    scale = 1e5 / skies.horizontal_illuminance(RANDOM)
    again = found(scene, bright)
    np.testing.assert_allclose(again.illuminance_lx, scale * first.illuminance_lx, rtol=1e-6)
    turned = PatchSky(RANDOM.luminance_cd_m2[::-1])
    warm = found(scene, turned)
    cold = simulate(scene, accuracy=0.02, cache=False).sensors["plane"]
    assert (np.abs(warm.illuminance_lx - cold.illuminance_lx) <= cold.error_lx).all()


@pytest.mark.parametrize("kind", ["patches", "intermediate"])
def test_pictures_show_the_sky(kind):
    """Straight up over a plate: every pixel has the luminance of its direction."""
    scene = Scene()
    scene.add(level(0.2, -1.0), "plate")
    intermediate = CIESky("intermediate", 30.0, 200.0, zenith_luminance_cd_m2=4000.0)
    scene.sky = RANDOM if kind == "patches" else intermediate
    camera = Camera((0, 0, 0), (0, 0, 5), name="up", up=(0, 1, 0), fov_deg=100, size=(24, 24))
    scene.add(camera)
    image = simulate(scene, accuracy=0.2).images["up"]
    _, d = camera.rays()
    expected = skies.luminance(scene.sky, d)
    shown = image.luminance_cd_m2
    if kind == "patches":  # pixels that an edge crosses are of both sides
        same = np.abs(shown / expected - 1.0) < 1e-6
        assert same.mean() > 0.6
    else:
        np.testing.assert_allclose(shown, expected, rtol=2e-2)
