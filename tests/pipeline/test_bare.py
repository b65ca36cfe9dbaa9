"""Defaults of a bare STEP file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from patchlight.pipeline.bare import bare_scene


def one_shell(model):
    """The model with an edge that all sides of its parts share."""
    edges = np.zeros_like(model.patches.edge_index)
    return replace(model, patches=replace(model.patches, edge_index=edges))


@pytest.mark.parametrize("size", [(1, 1, 1), (0.06, 0.06, 0.23), (5, 0.1, 0.1), (0.1, 5, 0.1)])
def test_the_view_from_outside_holds_the_whole_model(make_model, size):
    """Tall and long ones too, without looking small."""
    center = (3.0, -2.0, 1.0)
    model = make_model("part", {"part": (size, center, False)})
    camera = bare_scene(one_shell(model), Path("part.step")).scene.freeze().cameras[0]
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


ROOM = {
    "floor": ((5, 4, 0.2), (0, 0, -0.1), False),
    "roof": ((5.6, 4.6, 0.2), (0, 0, 2.9), False),
    "west": ((0.2, 4, 2.8), (-2.4, 0, 1.4), False),
    "east": ((0.2, 4, 2.8), (2.4, 0, 1.4), False),
    "north": ((4.6, 0.2, 2.8), (0, 1.9, 1.4), False),
}


def test_sensors_of_a_room_are_on_its_floor(make_model):
    """Its roof is the larger upward face, but has no ceiling."""
    bare = bare_scene(one_shell(make_model("room", ROOM)), Path("room.step"))
    (grid,) = bare.values["sensors"]
    assert (grid["name"], grid["parts"]) == ("floor", "room/floor")
    assert any("with a ceiling above it" in remark for remark in bare.remarks)
    (sensors,) = bare.scene.freeze().sensors
    np.testing.assert_allclose(sensors.points[:, 2], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    "parts",
    [
        {name: ROOM[name] for name in ROOM if name != "roof"},
        # A table is no ceiling of the terrace that it stands on, nor is a plate that lies on it.
        {"slab": ROOM["floor"], "table": ((1.5, 1, 0.1), (0, 0, 0.7), False)},
        {"slab": ROOM["floor"], "plate": ((4.9, 3.9, 0.01), (0, 0, 0.05), False)},
    ],
)
def test_without_a_ceiling_sensors_are_on_the_largest_face_and_that_is_said(make_model, parts):
    bare = bare_scene(one_shell(make_model("open", parts)), Path("open.step"))
    (grid,) = bare.values["sensors"]
    assert grid["name"] == "largest-face" and grid["parts"] in ("open/floor", "open/slab")
    assert any("none has a ceiling above it" in remark for remark in bare.remarks)
