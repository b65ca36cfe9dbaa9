"""Insides of hollow things that no light reaches are seen from nowhere."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver import field_rows
from patchlight.solver.exchange import Rows
from patchlight.solver.model import PatchSet
from patchlight.solver.shut_in import hide, shut_in
from patchlight.solver.simulation import solve
from patchlight.solver.unknowns import Unknowns

from .fixtures_light import Body, grid, scene, setup

HEIGHT, WIDTH = 0.8, 0.04
ROOM = Body(PatchSet.box((4.0, 3.0, 2.5), center=(0.0, 0.0, 1.25), inward=True))
LAMP = Body(PatchSet.box((0.8, 0.6, 0.02), center=(0.3, 0.2, 2.3)))
AT = [(x, y) for x in (-1.4, -0.7, 0.0, 0.8, 1.5) for y in (-1.0, -0.2, 0.5, 1.1)]


def post(x, y, ends=True):
    """A slender upright box; without ``ends`` its sides alone, seen from outside."""
    box = PatchSet.box((WIDTH, WIDTH, HEIGHT), center=(x, y, 0.5 * HEIGHT))
    upright = np.abs(box.normals(0.5, 0.5)[:, 2]) < 0.5
    return box if ends else box.take(np.flatnonzero(upright))


def room(*things, two_sided):
    """A room with a lamp in the middle of it, and things that are sheets or not."""
    parts = setup(ROOM, LAMP, *things)
    points = np.array([(x, y, 1.2) for x in (-1.6, -0.4, 0.9, 1.7) for y in (-1.2, 0.1, 1.3)])
    data = scene(
        parts,
        lamps=[(1, "lamp", 1000.0)],
        materials=[0.6, 0.0, *[0.5] * len(things)],
        sensors=[grid("plane", points), grid("down", points, (0.0, 0.0, -1.0))],
    )
    sheets = (parts.solid > 1) & two_sided
    return dataclasses.replace(data, two_sided=sheets)


def test_nothing_is_shut_in_where_light_comes():
    """Not even the bottom of a box that is open above, from where a third of the room is seen."""
    box = PatchSet.box((0.6, 0.6, 0.4), center=(0.5, 0.4, 0.25))
    top = int(np.argmax(box.evaluate(0.5, 0.5)[:, 2]))
    data = room(box.take(np.setdiff1d(np.arange(6), [top])), two_sided=True)
    assert solve(data, accuracy=0.3).counters["elements_shut_in"] == 0


def test_insides_of_posts_are_shut_in_and_change_nothing():
    """Posts of sheets between floor and lid give the light that solid ones do."""
    lid = PatchSet.box((3.6, 2.7, 0.02), center=(0.0, 0.0, HEIGHT + 0.01))
    plate = Body(lid)
    hollow = room(plate, *(post(*at, ends=False) for at in AT), two_sided=True)
    # The plate is a solid.
    two_sided = hollow.two_sided.copy()
    two_sided[hollow.patches.part_index == 2] = False
    hollow = dataclasses.replace(hollow, two_sided=two_sided)
    solid = room(plate, *(Body(post(*at)) for at in AT), two_sided=False)
    found, expected = (solve(data, accuracy=0.1) for data in (hollow, solid))
    elements = found.elements
    inside = (elements.side == 1).sum()
    assert found.counters["elements_shut_in"] >= inside == 4 * len(AT)
    for name, sensors in expected.sensors.items():
        off = found.sensors[name].illuminance_lx / sensors.illuminance_lx - 1.0
        # Both are sampled alike, a little differently; what is lost inside has one sign, and is
        # four times as much.
        assert abs(off.mean()) < 1e-4 and np.abs(off).max() < 2e-3


def test_rows_that_see_much_of_it_stay():
    """The first receiver stands in the open, the second before an opening, the third inside."""
    factors = np.array([[0.5, 0.45, 0.05], [0.4, 0.4, 0.2], [0.01, 0.0, 0.99]], np.float32)
    rows = Rows(factors.copy(), np.full((3, 3), 1e-4, np.float32), {}, np.zeros((3, 5)))
    hide(rows, np.array([False, False, True]))
    np.testing.assert_array_equal(rows.factors[0], np.float32([0.5, 0.45, 0.0]))
    np.testing.assert_array_equal(rows.factors[1:], factors[1:])
    assert rows.sums[0] == pytest.approx([0.95, 2e-4]) and rows.variances[0, 2] == 0.0


def test_what_a_small_lamp_lights_in_the_open_is_seen():
    """A floor that sees a thousandth of lamps, and else nothing at all."""
    from .fixtures_light import rectangle

    floor = rectangle((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
    lamp = rectangle((-0.1, -0.1, 3), (-0.1, 0.1, 3), (0.1, 0.1, 3), (0.1, -0.1, 3))
    data = scene(
        setup(floor, lamp),
        lamps=[(1, "lamp", 1000.0)],
        materials=[0.5, 0.0],
        sensors=[grid("down", np.array([(0.5, 0.2, 1.0)]), (0.0, 0.0, -1.0))],
    )
    found = solve(data, accuracy=0.1)
    assert found.counters["elements_shut_in"] == 0
    assert found.sensors["down"].components["lamp.indirect"][0] > 0.0


@pytest.mark.parametrize("radius, depth", [(0.04, 0.12), (0.02, 0.06)])
def test_a_room_under_a_small_shielded_lamp_is_not_shut_in(monkeypatch, radius, depth):
    """Of the opening of a downlight each element sees less than a thousandth."""
    lamp = PatchSet.disk((0.7, 0.4, 2.4), radius, (0.0, 0.0, -1.0))
    housing = PatchSet.cylinder((0.7, 0.4, 2.4 - depth), (0.7, 0.4, 2.4), radius)
    parts = setup(ROOM, Body(lamp, False), Body(housing, False))
    points = np.array([(x, y, 0.8) for x in (-1.5, 0.7, 1.6) for y in (-1.0, 0.4)])
    data = scene(
        parts,
        lamps=[(1, "lamp", 1e5)],
        materials=[0.6, 0.3, 0.8],
        sensors=[grid("plane", points), grid("down", points, (0.0, 0.0, -1.0))],
    )
    data = dataclasses.replace(data, two_sided=parts.solid > 0)
    found = solve(data, accuracy=0.1)
    assert found.counters["elements_shut_in"] == 0
    monkeypatch.setattr(field_rows, "shut_in", lambda rows, unknowns, shining: ~shining & False)
    expected = solve(data, accuracy=0.1)
    for name, sensors in expected.sensors.items():
        assert np.array_equal(found.sensors[name].illuminance_lx, sensors.illuminance_lx)


@pytest.mark.parametrize("out", [0.0, 0.002])
def test_what_lets_in_some_sky_is_not_shut_in(out):
    """A lamp and a wall see one another; a third element sees itself, and the sky or nothing."""
    factors = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0 - out]], np.float32)
    outside = np.zeros((3, 5))
    outside[2, 1] = out
    rows = Rows(factors, np.zeros((3, 3), np.float32), {}, outside)
    unknowns = Unknowns(np.arange(3), np.ones(3), None, None, 3)
    hidden = shut_in(rows, unknowns, np.array([True, False, False]))
    assert hidden.tolist() == [False, False, out == 0.0]
