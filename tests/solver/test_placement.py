"""Warnings about lamps, cameras and sensors in places where they make no sense."""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.solver.ledger import ledger_warning
from patchlight.solver.model import Balance, Camera, Luminaire, PatchSet, Sensors
from patchlight.solver.placement import check_placement

from .fixtures_bodies import scene_of

UP = (0.0, 0.0, 1.0)
ROOM = (PatchSet.box((4, 3, 2.8), center=(0, 0, 1.4), inward=True), "air")


def test_placement_warnings_name_the_thing_and_the_solid():
    lamp_flux = Luminaire("b", "lamps", 500.0, 0.1, np.ones(3), 4000.0)
    lamp = PatchSet.sphere((0, 0, 0), 0.1)
    wall = PatchSet.box((1, 1, 1))
    emitting = np.full((14, 2), -1)
    emitting[6:, 0] = 0
    scene = scene_of(
        (wall, "solid"),
        (lamp, "solid"),
        luminaire_index=emitting,
        luminaires=(lamp_flux,),
        cameras=(Camera((0.3, 0.3, 0.3), (0, 0, 0), name="door"),),
        sensors=(Sensors("plane", [(0.3, 0.3, 0.3), (2.0, 0.0, 0.0)], (0.0, 0.0, 1.0)),),
    )
    lines = check_placement(scene)
    assert len(lines) == 3
    assert "lamp 'b'" in lines[0] and "'a'" in lines[0] and "500 lm" in lines[0]
    assert "camera 'door'" in lines[1] and "'a'" in lines[1]
    assert "sensors 'plane': 1 of 2" in lines[2] and "'a'" in lines[2]
    free = scene_of((wall, "solid"), cameras=(Camera((3, 0, 0), (0, 0, 0), name="far"),))
    assert check_placement(free) == ()


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0, 0, 800.0), (1, 0, 800.0)], "all 2 points lie above the whole model: z = 800 m"),
        ([(0, 0, -1.0)], "below the whole model: z = -1 m, but the model ends at 0 m"),
        ([(9, 0, 1.0), (8, 1, 1.0)], "beside the whole model: x = 8 m"),
        ([(0, -5, 1.0)], "beside the whole model: y = -5 m"),
        ([(0, 0, 800.0), (1, 0, 1.0)], ""),
        ([(0, 0, 2.8)], ""),
    ],
)
def test_grids_outside_the_model(points, words):
    walls = (PatchSet.box((4, 3, 2.8), center=(0, 0, 1.4), inward=True), "solid")
    lines = check_placement(scene_of(walls, sensors=(Sensors("plane", points, UP),)))
    assert len(lines) == (1 if words else 0)
    assert all(words in line and "'plane'" in line for line in lines)


def test_sensors_outside_the_air():
    """In the roof space of a house, and through the wall of its only room."""
    roof = (PatchSet.box((5, 4, 0.2), center=(0, 0, 4.0)), "solid")
    sensors = (
        Sensors("good", [(0, 0, 0.8), (1.9, 1.4, 2.7)], UP),
        Sensors("roof space", [(0, 0, 3.5), (1, 0, 3.5)], UP),
        Sensors("long", [(1, 0, 0.8), (2.2, 0, 0.8)], UP),
    )
    lines = check_placement(scene_of(ROOM, roof, sensors=sensors))
    assert len(lines) == 2
    assert "'roof space': 2 of 2 points lie outside the air 'a'" in lines[0]
    assert "'long': 1 of 2 points" in lines[1] and "(2.2, 0, 0.8) m" in lines[1]


def lamp_line(height):
    """The warning on a lamp box, 0.4 x 0.4 x 0.2 m about ``height``, all of whose sides emit."""
    body = (PatchSet.box((0.4, 0.4, 0.2), center=(0, 0, height)), "solid")
    emitting = np.full((12, 2), -1)
    emitting[6:, 0] = 0
    lamp = Luminaire("b", "lamps", 500.0, 0.64, np.ones(3), 4000.0)
    return check_placement(scene_of(ROOM, body, luminaire_index=emitting, luminaires=(lamp,)))


def test_lamps_that_reach_out_of_the_air():
    assert lamp_line(2.0) == ()
    (through,) = lamp_line(2.8)
    # The top, 0.16 of 0.64 m², and half of the sides, 0.04 m² each.
    assert "lamp 'b': about 50 %" in through and "500 lm" in through
    (flush,) = lamp_line(2.7)
    assert "about 25 %" in flush
    assert any("all of its emitting faces lies outside" in line for line in lamp_line(3.5))


def test_a_lamp_flush_with_a_ceiling_loses_what_its_top_would_give():
    """A box of 0.4 x 0.4 x 0.2 m under a slab: its top is a quarter of its surface."""
    slab = (PatchSet.box((4, 3, 0.3), center=(0, 0, 2.95)), "solid")
    emitting = np.full((12, 2), -1)
    emitting[6:, 0] = 0
    lamp = Luminaire("b", "lamps", 500.0, 0.64, np.ones(3), 4000.0)

    def lines(height):
        body = (PatchSet.box((0.4, 0.4, 0.2), center=(0, 0, height)), "solid")
        return check_placement(scene_of(slab, body, luminaire_index=emitting, luminaires=(lamp,)))

    assert lines(2.5) == ()
    (flush,) = lines(2.7)
    assert "lamp 'b': about 25 %" in flush and "25 % of its 500 lm stay dark" in flush


def test_emitting_faces_of_the_air_itself_are_inside():
    emitting = np.full((6, 2), -1)
    emitting[0, 0] = 0
    lamp = Luminaire("a", "lamps", 500.0, 1.0, np.ones(3), 4000.0)
    scene = scene_of(ROOM, luminaire_index=emitting, luminaires=(lamp,))
    assert check_placement(scene) == ()


@pytest.mark.parametrize(
    ("absorbed", "accuracy", "words"),
    [
        (995.0, 0.001, ()),
        (994.9, 0.001, ("0.11 %", "1.1 lm", "lacking", "accuracy asked for, 0.001")),
        (994.9, 0.01, ()),  # counted 2.4 times it is less than half of what is asked
        (1100.0, 0.1, ("10 %", "nowhere")),
    ],
)
def test_a_ledger_that_lacks_much_for_the_accuracy_is_a_warning(absorbed, accuracy, words):
    found = ledger_warning(Balance(900.0, 100.0, absorbed, 4.0), accuracy)
    assert len(found) == (1 if words else 0)
    assert all(word in found[0] for word in words)


def test_a_dark_ledger_closes():
    assert ledger_warning(Balance(0.0, 0.0, 0.0, 0.0), 0.01) == ()
