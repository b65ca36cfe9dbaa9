"""Warnings about lamps where parts have moved: what a run before has asked is not asked again."""

from __future__ import annotations

import pytest
from patchlight.solver import kept_placement, store
from patchlight.solver.containment import Containment
from patchlight.solver.kept_placement import placement_remarks
from patchlight.solver.model import PatchSet
from patchlight.solver.reuse import Kept
from patchlight.solver.stages import Stages

from .fixtures_light import Body, grid, scene, setup

ROOM = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
LAMP = Body(PatchSet.sphere((0.9, 1.2, 1.8), 0.05))


def block(at, cuts):
    """A block of 60 cm, of 4 ** ``cuts`` patches a side, in a room with a small lamp."""
    patches = PatchSet.box((0.6, 0.6, 0.6), center=at)
    for _ in range(cuts):
        patches = patches.refined()
    parts = setup(ROOM, LAMP, Body(patches))
    plane = grid("plane", [(0.0, 0.0, 0.8)])
    return scene(parts, lamps=[(1, "lamp", 500.0)], sensors=[plane])


def remarks(made):
    kept = Kept(made, stages=Stages(), store=store.STORE)
    return placement_remarks(made, Containment(made), kept)


@pytest.mark.parametrize("cuts", [0, 3])
def test_a_lamp_that_a_block_is_moved_around_is_told(cuts):
    """However far it is from the patches of the block."""
    assert remarks(block((-0.9, -1.2, 0.5), cuts)) == ()
    (line,) = remarks(block((0.9, 1.2, 1.8), cuts))
    assert "lamp" in line and "inside" in line


def test_nothing_is_asked_where_a_block_stays_away_from_lamps(monkeypatch):
    assert remarks(block((-0.9, -1.2, 0.5), 1)) == ()
    monkeypatch.setattr(kept_placement, "check_placement", lambda *_: pytest.fail("asked again"))
    assert remarks(block((-0.5, -1.2, 0.5), 1)) == ()
