"""Defaults of a bare STEP file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from patchlight.pipeline.bare import bare_scene


@pytest.mark.parametrize("size", [(1, 1, 1), (0.06, 0.06, 0.23), (5, 0.1, 0.1), (0.1, 5, 0.1)])
def test_the_view_from_outside_holds_the_whole_model(make_model, size):
    """Tall and long ones too, without looking small."""
    center = (3.0, -2.0, 1.0)
    model = make_model("part", {"part": (size, center, False)})
    one_shell = np.zeros_like(model.patches.edge_index)  # an edge that all sides share
    model = replace(model, patches=replace(model.patches, edge_index=one_shell))
    camera = bare_scene(model, Path("part.step")).scene.freeze().cameras[0]
    assert camera.name == "outside"
    _, rays = camera.rays()
    corners = model.patches.control_points[:, ::3, ::3, :3].reshape(-1, 3) - camera.eye
    # The planes through the eye and the sides of the picture, a pixel less.
    sides = [rays[0, 0], rays[0, -1], rays[-1, -1], rays[-1, 0]]
    inward = np.array([np.cross(a, b) for a, b in zip(sides, sides[1:] + sides[:1], strict=True)])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    away = corners @ inward.T / np.linalg.norm(corners, axis=1, keepdims=True)
    assert away.min() > 0.0
    # A tenth is left free: of half of 47 degrees or of 60, so that some side is nearer than 4.
    assert away.min() < np.sin(np.radians(4.0))


def test_a_part_whose_name_holds_signs_of_patterns_is_meant_alone(make_model):
    # As a pattern the first name means the second one.
    air, desk = ((4, 3, 3), (0, 0, 0), False), ((1, 1, 0.7), (0, 0, -1.1), False)
    bare = bare_scene(make_model("m", {"hall [1]*": air, "hall 1": desk}), Path("m.step"))
    assert bare.values["assign"] == [{"parts": "m/hall [1]*", "air": True}]
    assert bare.scene.entries["m"].air == {0}
    # The floor of the hall, seen from inside, is its largest face that looks up.
    assert bare.values["sensors"][0]["parts"] == "m/hall [1]*"
    (sensors,) = bare.scene.freeze().sensors
    np.testing.assert_allclose(sensors.points[:, 2], -1.5, atol=2e-3)
