"""The demo out of doors: light on its open hill in closed form, and shadows where they must be."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from patchlight.pipeline import SensorGrid, load_scene, simulate
from patchlight.pipeline.demo.outdoors import (
    BALL,
    BALL_AT,
    CURVATURE,
    PLINTH,
    RING,
    RING_TURN,
    TUBE,
    height,
)
from patchlight.solver import skies
from patchlight.solver.model.sky import direction
from patchlight.solver.open_sky import OpenSky
from patchlight.solver.sun_disc import DiscLight
from patchlight.solver.sun_pictures import SunInPictures
from patchlight.solver.topology import make_blockers


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    from patchlight.pipeline.demo import write_demo

    return load_scene(write_demo("outdoors", tmp_path_factory.mktemp("outdoors")))


def on_hill(places):
    """Points (n, 3) a hair above the hill, and its normals there. [m]"""
    x, y = np.asarray(places, float).T
    radius = CURVATURE / 1000.0
    normals = np.stack([x / radius, y / radius, np.ones(len(x))], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = np.stack([x, y, -(x * x + y * y) / (2.0 * radius)], axis=1)
    return points + 1e-4 * normals, normals


def with_points(scene, places, only=None):
    """The frozen scene with sensors on the hill alone; ``only`` its terrain."""
    scene.grids.clear()
    points, normals = on_hill(places)
    scene.add(SensorGrid(points, normals, name="hill"))
    data = dataclasses.replace(scene.freeze(), cameras=())
    if only is None:
        return data
    keep = np.array([data.parts[k].path == only for k in data.patches.part_index])
    rows = {
        name: getattr(data, name)[keep]
        for name in ("two_sided", "closed", "material_index", "luminaire_index", "glass_index")
    }
    return dataclasses.replace(data, patches=data.patches.take(keep), **rows)


def on_slope(sky, normal, steps=800):
    """Illuminance of what is above both horizons of an unobstructed sky, by a fine even rule."""
    up = 0.5 * math.pi * (np.arange(steps) + 0.5) / steps
    turn = 2.0 * math.pi * (np.arange(2 * steps) + 0.5) / (2 * steps)
    c, s = np.cos(up)[:, None], np.sin(up)[:, None]
    d = np.stack([c * np.sin(turn), c * np.cos(turn), np.broadcast_to(s, (steps, 2 * steps))], -1)
    height = np.maximum(d @ normal, 0.0)
    cell = 0.5 * math.pi / steps * math.pi / steps
    return float((skies.luminance(sky, d) * height * c).sum() * cell)


def test_open_hill_in_closed_form(scene):
    """It is convex: sun and sky alone light it, each cut by the slope's own horizon."""
    data = with_points(scene, [(0, 0), (-9, -7), (8, 9), (11, -10)], only="outdoors/terrain")
    found = simulate(data, accuracy=0.05).sensors["hill"]
    toward = np.array(direction(data.sun.altitude_deg, data.sun.azimuth_deg))
    expected = data.sun.normal_illuminance_lx * found.normals @ toward
    np.testing.assert_allclose(found.components["sun.direct"], expected, rtol=1e-6)
    sky = [on_slope(data.sky, n) for n in found.normals]
    np.testing.assert_allclose(found.components["sky.direct"], sky, rtol=2e-3)
    for name in ("sun.indirect", "sky.indirect"):
        assert found.components[name].max() < 1e-3 * found.illuminance_lx.min()
    assert "ground.direct" not in found.components


def test_shadows_are_where_they_must_be(scene):
    """Along the sun's direction from ball and ring down to the hill."""
    s = np.array(direction(scene.sun.altitude_deg, scene.sun.azimuth_deg))

    def below(point):
        """Where a line against the sun meets the hill."""
        place = np.asarray(point, float) / 1000.0
        for _ in range(50):
            place = place - s * (place[2] - height(*(1000.0 * place[:2])) / 1000.0) / s[2]
        return place[:2]

    x, y = BALL_AT
    top = height(x, y) + BALL
    middle = (0.0, 0.0, PLINTH[1] + RING + TUBE)
    turn = math.radians(RING_TURN)
    side = RING * np.array([math.cos(turn), -math.sin(turn), 0.0])
    places = [
        below((x, y, top)),  # the middle of the ball's shadow
        below(np.add(middle, side)),  # of both sides of the ring's, and of its top
        below(np.subtract(middle, side)),
        below(np.add(middle, (0.0, 0.0, RING))),
        below(middle),  # through the ring
        (-8.0, 5.0),
    ]
    data = with_points(scene, places)
    found = simulate(data, accuracy=0.2).sensors["hill"]
    open_ = data.sun.normal_illuminance_lx * found.normals @ s
    share = found.components["sun.direct"] / open_
    np.testing.assert_allclose(share, [0, 0, 0, 0, 1, 1], atol=1e-9)
    # In its shadow the ball takes a part of the sky too, and sends some light back.
    assert found.components["sky.direct"][0] < 0.95 * found.components["sky.direct"][5]
    assert found.components["sky.indirect"][0] > 0.0


def test_half_shadows_of_pictures(scene):
    """What rays count at a pixel, against the disc cut exactly: across the ball's half-shadow."""
    data = with_points(scene, [(0, 0)])
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    s = np.array(direction(data.sun.altitude_deg, data.sun.azimuth_deg))
    x, y = BALL_AT
    ball = np.array([x, y, height(x, y) + BALL]) / 1000.0
    side = np.cross(s, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(s, (0.0, 0.0, 1.0)))
    foot = ball - 1.0 * s
    points = foot + (BALL / 1000.0 + np.linspace(-0.006, 0.006, 25))[:, None] * side
    normals = np.broadcast_to(s, points.shape)
    exact = DiscLight(blockers, trace=True).at(points, normals, data.sun, 5e-4).illuminance
    found = SunInPictures(data, OpenSky(data, blockers, trace=True), bands=1).light(points, normals)
    level = data.sun.normal_illuminance_lx
    assert exact.min() < 0.01 * level < 0.99 * level < exact.max()
    # 32 places: 0.03 each; beyond the rim's four a tenth.
    np.testing.assert_allclose(found, exact, atol=0.11 * level)
    assert np.abs(found - exact).mean() < 0.03 * level
