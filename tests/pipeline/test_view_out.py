"""View out through the opening of a room: closed forms of angles, distances and layers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from patchlight.pipeline import Glass, SensorGrid, view_out
from patchlight.solver.errors import InputError
from patchlight.solver.view_out import LEVELS

from .window_room import opening, quad, window_room

#: Bisection leaves less at both ends of the opening.
END_DEG = 2e-3


def room(*points):
    """Of `window_room`: opening 2 x 1 m from z = 1 m in the wall y = 0."""
    scene = window_room(4.0, 3.0, 0.5)
    scene.add(SensorGrid(list(points), (0, 0, 1), name="eyes"))
    return scene


def facade(distance, low=-5.0, high=20.0, half=100.0):
    """A wall parallel to that of the opening."""
    y = -distance
    return quad((-half, y, low), (half, y, low), (half, y, high), (-half, y, high))


def seen(scene, **given):
    return view_out(scene, **given)["eyes"]


def test_open_field():
    """Sight angle of an opening 2 m wide from points before it, and from one aside."""
    points = [(0.0, 1.9, 1.5), (0.0, 2.1, 1.5), (0.9, 3.5, 1.2), (-1.8, 0.5, 1.5)]
    found = seen(room(*points))
    expected = [
        math.degrees(math.atan2(1.0 - x, y) - math.atan2(-1.0 - x, y)) for x, y, _ in points
    ]
    np.testing.assert_allclose(found.sight_angle_deg, expected, atol=END_DEG)
    np.testing.assert_allclose(found.far_deg, [found.sight_angle_deg] * 3)
    assert np.isinf(found.distance_m).all()
    assert found.sky.all() and found.landscape.all() and found.ground.all()
    assert found.reaches("high").tolist() == [angle >= 54.0 for angle in expected]
    assert found.reaches("minimum").all()


@pytest.mark.parametrize(
    ("distance", "level"), [(2.0, None), (8.0, "minimum"), (25.0, "minimum"), (60.0, "minimum")]
)
def test_a_facade_is_landscape_alone(distance, level):
    """It hides sky and ground, so that more than one layer is never seen."""
    scene = room((0.0, 1.0, 1.5))
    scene.add(facade(distance, low=-60.0, high=90.0, half=300.0), "house", two_sided=True)
    found = seen(scene, outside="house")
    assert found.sight_angle_deg[0] == pytest.approx(90.0, abs=END_DEG)
    # Straight on as far as it stands, 1 m behind the opening; aside farther.
    assert distance + 1.0 <= found.distance_m[0] < (distance + 1.0) * math.sqrt(2.0)
    assert (found.sky[0], found.landscape[0], found.ground[0]) == (False, True, False)
    assert found.level == level
    hidden = seen(scene)  # not said to stand outdoors: nothing is seen of it, and nothing past it
    assert hidden.sight_angle_deg[0] == 0.0 and np.isnan(hidden.distance_m[0])
    assert hidden.level is None


def test_as_far_as_asked():
    """Of a wall 19 m away only what is seen askew is 20 m off: cos of its azimuth below 19/20."""
    scene = room((0.0, 1.0, 1.5))
    scene.add(facade(18.0, high=5.0), "house", two_sided=True)
    found = seen(scene, outside="house")
    near = 2.0 * math.degrees(math.acos(19.0 / 20.0))
    np.testing.assert_allclose(found.far_deg[:, 0], [90.0, 90.0 - near, 0.0], atol=2 * END_DEG)
    assert found.sky[0] and found.landscape[0]  # above its top at 5 m
    assert found.level == "medium"


def test_layers():
    """Past a low wall the sky alone; of ground that is modelled the ground."""
    scene = room((0.0, 3.0, 0.5))  # lower than the sill: sky alone
    found = seen(scene)
    assert (found.sky[0], found.landscape[0], found.ground[0]) == (True, False, False)
    assert found.sight_angle_deg[0] > 14.0 and found.level is None
    scene = room((0.0, 1.0, 1.9))
    lawn = quad((-50, -60, 0), (50, -60, 0), (50, -0.1, 0), (-50, -0.1, 0))
    scene.add(lawn, "lawn", two_sided=True)
    scene.add(facade(30.0, low=1.8, high=60.0), "house", two_sided=True)
    found = seen(scene, outside="house", ground="lawn")
    assert (found.sky[0], found.landscape[0], found.ground[0]) == (False, True, True)
    assert found.level == "medium"


def test_ground_that_rises_is_as_far_as_it_stands():
    """A slope that is ground hides the horizon: it stands there, unlike ground that goes on."""
    scene = room((0.0, 1.0, 1.5))
    slope = quad((-300, -5, 0), (300, -5, 0), (300, -15, 10), (-300, -15, 10))  # y = -5 - z
    scene.add(slope, "slope", two_sided=True)
    found = seen(scene, ground="slope")
    # Straight on at the height of the eye 1 + 5 + 1.5 m away, farther aside; 45 degrees to each.
    assert 7.5 <= found.distance_m[0] < 7.5 * math.sqrt(2.0)
    near = 2.0 * math.degrees(math.acos(7.5 / 20.0))
    assert near > 90.0 and found.far_deg[1, 0] == 0.0
    assert found.far_deg[0, 0] == pytest.approx(90.0, abs=END_DEG)
    assert (found.sky[0], found.landscape[0], found.ground[0]) == (False, False, True)


def test_panes_and_what_scatters():
    scene = room((0.0, 1.0, 1.5))
    scene.add(opening(), "pane", two_sided=True)
    scene.assign("pane", Glass(0.006))
    assert seen(scene).sight_angle_deg[0] == pytest.approx(90.0, abs=END_DEG)
    scene.assign("pane", Glass(0.006, diffuse=0.3))
    assert seen(scene).sight_angle_deg[0] == 0.0


def test_blinds_that_are_up_hide_nothing():
    """The first state counts where none is named, as in a year."""
    scene = room((0.0, 1.0, 1.5))
    wide = quad((-3, -0.05, -1), (3, -0.05, -1), (3, -0.05, 4), (-3, -0.05, 4))
    scene.add(wide, "blind", two_sided=True)
    assert seen(scene).sight_angle_deg[0] == 0.0
    scene.add_state("up", absent="blind")
    scene.add_state("down", present="blind")
    assert seen(scene).sight_angle_deg[0] == pytest.approx(90.0, abs=END_DEG)
    assert seen(scene, state="down").sight_angle_deg[0] == 0.0
    with pytest.raises(InputError, match="'half': there is none of the name; states: up, down"):
        seen(scene, state="half")


def test_area_that_reaches_a_level():
    scene = room(*[(0.0, y, 1.5) for y in (0.5, 1.0, 1.5, 3.9)])
    found = seen(scene)
    assert found.share("high") == 0.75 and found.level == "high"
    assert list(LEVELS) == ["minimum", "medium", "high"]
    with pytest.raises(InputError, match="view_out: outside 'hose': no part matches"):
        seen(scene, outside=["hose"])
    with pytest.raises(InputError, match="no grid named 'desk'"):
        view_out(scene, sensors="desk")
    scene.grids.clear()
    with pytest.raises(InputError, match="no sensors"):
        view_out(scene)
