"""What is told beforehand of the time of a run."""

from __future__ import annotations

import dataclasses

import pytest
from patchlight.solver.budget import Budget
from patchlight.solver.duration import SPREAD, duration
from patchlight.solver.model import PatchSet, Photometry, Web

from .fixtures_light import Body, ceiling, grid, scene, setup


def room(points=1, web=False):
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    lamp = ceiling(-0.3, 0.3, -0.3, 0.3, 1.2)
    sensors = [grid("plane", [(0.0, 0.0, -0.5)] * points)]
    made = scene(setup(walls, lamp), lamps=[(1, "lamp", 1000.0)], sensors=sensors)
    if not web:
        return made
    shape = Photometry([0.0, 360.0], [0.0, 45.0, 90.0], [[2.0, 1.0, 0.0]] * 2)
    lamps = [
        dataclasses.replace(one, web=Web.aimed(shape, (0, 0, -1), (1, 0, 0)))
        for one in made.luminaires
    ]
    return dataclasses.replace(made, luminaires=tuple(lamps))


def told(made, accuracy):
    low, high = duration(made, Budget.of(made, accuracy))
    assert high == pytest.approx(low * SPREAD**2)
    return low


@pytest.mark.parametrize(
    ("less", "more"),
    [
        ((room(), 0.1), (room(), 0.003)),
        ((room(), 0.1), (room(points=500), 0.1)),
        ((room(), 0.1), (room(web=True), 0.1)),
    ],
    ids=["accuracy", "sensors", "photometric web"],
)
def test_what_takes_longer_is_told_to(less, more):
    assert told(*more) > told(*less) > 0.0
