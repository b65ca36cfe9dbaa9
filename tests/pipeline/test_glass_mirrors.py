"""Mirrors and glossy surfaces beside panes: light by way of both."""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.pipeline import (
    Camera,
    CIESky,
    Emitter,
    Glass,
    Ground,
    Material,
    PatchSet,
    Scene,
    SensorGrid,
    Sun,
    simulate,
)

from .window_room import level

pytestmark = pytest.mark.slow  # kernels that little else needs

#: Index 1: nothing is thrown back, τ = exp(−a d / cosθ).
DARK = Glass(0.01, n=1.0, absorption_per_m=50.0)
NOTHING = Glass(n=1.0, absorption_per_m=0.0)
DOWN = (0.0, 0.0, -1.0)


def tau(cosine):
    return np.exp(-0.5 / np.asarray(cosine))


def over_a_floor(glass: Glass | None, floor: Material, *, lamp=None, z=1.0, points=()) -> Scene:
    """A floor, a pane over all of it at height z, and a lamp."""
    scene = Scene()
    scene.add(level(3.0, 0.0), "floor")
    scene.assign("floor", floor)
    if lamp is not None:
        scene.add(lamp, "lamp")
        scene.assign("lamp", Emitter(flux_lm=1e5))
    if glass is not None:
        scene.add(level(5.0, z), "pane")
        scene.assign("pane", glass)
    if len(points):
        scene.add(SensorGrid(np.array(points), np.tile(DOWN, (len(points), 1)), name="points"))
    return scene


def lux(scene: Scene, accuracy=0.1):
    return simulate(scene, accuracy=accuracy).sensors["points"]


MIRROR = Material(0.0, mirror=0.8)
LAMP = level(0.01, 3.0, up=False)


def test_a_lamp_in_a_mirror_through_a_pane():
    """One point below the pane, whose light passes it once; one above, whose light does twice."""
    points = [(0.8, 0.3, 0.5), (-0.6, 0.4, 1.5)]
    plain = lux(over_a_floor(None, MIRROR, lamp=LAMP, points=points))
    found = lux(over_a_floor(DARK, MIRROR, lamp=LAMP, points=points))
    way = np.array(points) * (1, 1, -1) - (0, 0, 3)
    kept = tau(np.abs(way[:, 2]) / np.linalg.norm(way, axis=1)) ** (1, 2)
    # The lamp is a three-hundredth of the distance wide.
    assert found.illuminance_lx == pytest.approx(kept * plain.illuminance_lx, rel=1e-4)


def test_a_lamp_in_a_curved_mirror_through_a_pane():
    """By rays. Through glass that keeps nothing back it is the same light, through other less."""
    light = []
    for glass in (None, NOTHING, DARK):
        scene = Scene()
        scene.add(PatchSet.sphere((0, 0, -1.0), 1.2), "ball")
        scene.assign("ball", MIRROR)
        scene.add(level(0.4, 3.0, up=False), "lamp")
        scene.assign("lamp", Emitter(flux_lm=1e4))
        if glass is not None:
            scene.add(level(5.0, 1.0), "pane")
            scene.assign("pane", glass)
        scene.add(SensorGrid(np.array([(0.8, 0.3, 0.5)]), np.array([DOWN]), name="points"))
        light.append(lux(scene, 0.02))
    plain, same, less = (one.illuminance_lx[0] for one in light)
    assert same == pytest.approx(plain, abs=light[0].error_lx[0] + light[1].error_lx[0])
    # From the lamp the way down to the ball is nearly straight: cosθ > 0.95.
    assert tau(0.95) * same < less < tau(1.0) * same


def test_sun_in_a_mirror_through_a_pane():
    points = [(0.0, 0.4, 0.5)]
    light = []
    for glass in (None, DARK):
        scene = over_a_floor(glass, MIRROR, points=points)
        scene.sun, scene.ground = Sun(40.0, 180.0, normal_illuminance_lx=1e4), Ground(0.0)
        light.append(lux(scene).components["sun.direct"])
    assert light[0] == pytest.approx(0.8 * 1e4 * np.sin(np.radians(40.0)), rel=1e-4)
    # The disc's radius is a quarter of a degree: the share at its middle is that of all to 1e-4.
    assert light[1] == pytest.approx(tau(np.sin(np.radians(40.0))) * light[0], rel=2e-4)


def test_sky_in_a_mirror_through_a_pane():
    """Even sky on a point just above an endless mirror: 2 ∫ τ(c) c dc of it, by rays."""
    t, weight = np.polynomial.legendre.leggauss(40)
    c = 0.5 * (t + 1.0)
    kept = float((weight * tau(c) * c).sum())
    scene = over_a_floor(DARK, MIRROR, z=0.2, points=[(0.0, 0.0, 0.15)])
    scene.sky, scene.ground = CIESky(5, diffuse_illuminance_lx=1000.0), Ground(0.0)
    found = lux(scene, 0.02)
    # The pane hides nothing up to 87° from the zenith; beyond it is dark anyway.
    expected = 0.8 * 1000.0 * kept
    assert found.illuminance_lx[0] == pytest.approx(expected, rel=2e-2)
    assert abs(found.illuminance_lx[0] - expected) <= found.error_lx[0]


def test_the_ledger_closes_with_mirrors_and_panes():
    scene = Scene()
    for k, (axis, sign) in enumerate((a, s) for a in range(3) for s in (-1, 1)):
        box = PatchSet.box((2, 2, 2), inward=True)
        middle = box.control_points[..., axis].mean(axis=(1, 2))
        scene.add(box.take(np.array([int(np.argmax(sign * middle))])), f"wall{k}")
        scene.assign(f"wall{k}", Material(0.2, mirror=0.6) if k == 1 else Material(0.5))
    net = np.array([[(0.3, -1, -1), (0.3, 1, -1), (0.3, 1, 1), (0.3, -1, 1)]], dtype=float)
    scene.add(PatchSet.from_bilinear(net), "pane")
    scene.assign("pane", Glass(0.006))
    scene.add(PatchSet.sphere((-0.4, 0.0, 0.0), 0.1), "lamp")
    scene.assign("lamp", Emitter(flux_lm=1000.0))
    result = simulate(scene, accuracy=0.1)
    assert {"mirrors", "form factors"} <= set(result.stages)
    # What passes is known to 2 % with four nodes an element.
    assert abs(result.balance.residual_fraction) < 0.03


@pytest.mark.parametrize("exponent", [10.0, 300.0])
def test_a_highlight_through_a_pane(exponent):
    """A small lamp straight above a glossy floor, the camera below the pane: τ at cosθ = 1."""
    images = []
    for glass in (None, DARK):
        scene = over_a_floor(glass, Material(0.0, specular=0.5, exponent=exponent), lamp=LAMP)
        camera = Camera((0, 0, 0.5), (0, 0, 0), name="c", up=(0, 1, 0), fov_deg=1.0, size=(3, 3))
        scene.add(camera)
        images.append(simulate(scene, accuracy=0.1).images["c"].luminance_cd_m2[1, 1])
    assert images[1] == pytest.approx(tau(1.0) * images[0], rel=1e-3)


def highlight(point, exponent, glass: bool) -> float:
    """What a glossy floor, of half the light, gives one point of a small lamp 3 m above it.

    By a sum over the floor, up to the lamp's luminance; with a pane just above the floor or none.
    """
    step = np.linspace(-3.0, 3.0, 601)
    middle = 0.5 * (step[1:] + step[:-1])
    x, y = (g.ravel() for g in np.meshgrid(middle, middle, indexing="ij"))
    floor = np.stack([x, y, 0.0 * x], axis=1)
    lamp, view = np.array([0.0, 0.0, 3.0]) - floor, point - floor
    r, d = (np.linalg.norm(way, axis=1) for way in (lamp, view))
    lamp, view = lamp / r[:, None], view / d[:, None]
    cosine = np.maximum((lamp * view * (-1.0, -1.0, 1.0)).sum(axis=1), 0.0)
    lobe = (exponent + 2.0) / (2.0 * np.pi) * cosine**exponent
    # What the lobe loses below the horizon stays diffuse: by sums over directions about its axis.
    c = (np.arange(400) + 0.5) / 400
    turn = (np.arange(180) + 0.5) * np.pi / 90.0
    table = np.linspace(0.0, 1.0, 41)
    here = (
        c[:, None, None] * table
        + np.sqrt(1.0 - c**2)[:, None, None] * np.sqrt(1.0 - table**2) * np.cos(turn)[:, None]
    )
    sent = (exponent + 2.0) * (np.maximum(here, 0.0).mean(axis=1) * c[:, None] ** exponent).mean(0)
    left = (1.0 - np.interp(view[:, 2], table, sent)) / np.pi
    kept = tau(lamp[:, 2]) * tau(view[:, 2]) if glass else 1.0
    light = (lobe + left) * lamp[:, 2] ** 2 / r**2 * view[:, 2] ** 2 / d**2
    return float(0.5 * (kept * light).sum())


def test_highlights_at_sensors_through_a_pane():
    """The pane just over the floor, so that light passes it on its way down and up."""
    floor = Material(0.0, specular=0.5, exponent=100.0)
    lamp, point = level(0.05, 3.0, up=False), (0.3, 0.0, 1.0)
    plain = lux(over_a_floor(None, floor, lamp=lamp, points=[point]), 0.02)
    found = lux(over_a_floor(DARK, floor, lamp=lamp, z=0.1, points=[point]), 0.02)
    share = found.illuminance_lx / plain.illuminance_lx
    expected = highlight(point, 100.0, True) / highlight(point, 100.0, False)
    # The accuracy asked for: cells of highlights are sampled.
    assert share == pytest.approx(expected, rel=0.02)
    assert np.abs(expected / tau(1.0) ** 2 - 1.0) > 0.05
