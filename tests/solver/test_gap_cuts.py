"""Boxes cut at the borders of narrow gaps."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.budget import Budget
from patchlight.solver.gap_cuts import SHARE, WIDTH, with_gaps
from patchlight.solver.mesh import Boxes
from patchlight.solver.model import PatchSet
from patchlight.solver.simulation import solve

from .fixtures_light import Body, grid, scene, setup

SIZE = (8.0, 6.0, 3.0)
ROOM = Body(PatchSet.box(SIZE, center=(0.0, 0.0, 1.5), inward=True))
LAMP, THICK = 1.2, 0.02
#: Middles of lamps: no border of an element of equal parts lies at their edges.
AT = [(x, y) for x in (-2.7, 0.1, 2.6) for y in (-1.6, 1.3)]


def room(gap, ceiling=0.8):
    """A room with flat lamps ``gap`` [m] below its ceiling, which shine all over."""
    lamps = [
        Body(PatchSet.box((LAMP, LAMP, THICK), center=(x, y, SIZE[2] - gap - 0.5 * THICK)))
        for x, y in AT
    ]
    points = np.array([(x, y, 0.8) for x in (-3.1, -1, 0.9, 3) for y in (-2.2, -0.4, 2.1)])
    shining = [(1 + k, f"lamp{k}", 1000.0) for k in range(len(AT))]
    parts = setup(ROOM, *lamps)
    return scene(
        parts,
        lamps=shining,
        materials=[ceiling, *[0.0] * len(AT)],
        sensors=[grid("plane", points)],
    )


def cut(data, accuracy=0.1):
    budget = Budget.of(data, accuracy)
    boxes = Boxes.regular(budget.divisions, data.two_sided)
    return (boxes, *with_gaps(boxes, data, budget), budget)


def is_over_a_lamp(points):
    return np.any([(np.abs(points[:, :2] - at) < 0.5 * LAMP).all(axis=1) for at in AT], axis=0)


def mixed(data, boxes):
    """Area of the ceiling in boxes where it is not as in the middle of them. [m²]"""
    z = data.patches.evaluate(0.5, 0.5)[:, 2]
    rows = np.flatnonzero(boxes.patch == int(np.argmax(np.where(np.arange(len(z)) < 6, z, 0.0))))
    t = (np.arange(40) + 0.5) / 40
    wrong = 0.0
    for row in rows:
        u0, u1, v0, v1 = boxes.ends[row]
        u, v = (a.ravel() for a in np.meshgrid(u0 + (u1 - u0) * t, v0 + (v1 - v0) * t))
        over = is_over_a_lamp(data.patches.take([boxes.patch[row]]).evaluate(u, v)[0])
        share = over.mean()
        wrong += 2.0 * share * (1.0 - share) * (u1 - u0) * (v1 - v0) * SIZE[0] * SIZE[1]
    return wrong


def test_ceiling_is_cut_at_the_borders_of_what_hangs_close_below_it():
    data = room(0.03)
    boxes, found, added, budget = cut(data)
    assert added == len(found) - len(boxes) > 0
    before, after = mixed(data, boxes), mixed(data, found)
    # All that reflects is the room: its large boxes are all of it. The gap is not quite closed for
    # the rays: 1 − 0.03 m / width; and the grid of 40 x 40 points tells shares to a fortieth.
    area = 2.0 * (8 * 6 + 8 * 3 + 6 * 3)
    assert after <= SHARE * 0.1 * area / (1.0 - 0.03 / (WIDTH * budget.size)) + 0.02 * before
    assert after < 0.1 * before
    # Each patch is still covered once, and nothing but the ceiling is cut.
    size = (found.ends[:, 1] - found.ends[:, 0]) * (found.ends[:, 3] - found.ends[:, 2])
    assert np.allclose(np.bincount(found.patch, size, len(data.patches)), 1.0)
    counts = np.bincount(found.patch) - np.bincount(boxes.patch)
    assert np.count_nonzero(counts) == 1


def test_what_hangs_lower_leaves_no_gap():
    assert cut(room(0.5))[2] == 0


def test_black_surfaces_are_not_cut():
    assert cut(room(0.03, ceiling=0.0))[2] == 0


def test_no_more_boxes_than_the_budget_allows():
    data = room(0.03)
    budget = Budget.of(data, 0.1)
    boxes = Boxes.regular(budget.divisions, data.two_sided)
    for room_left in (0, 3):
        few = dataclasses.replace(budget, most_elements=len(boxes) + room_left)
        assert with_gaps(boxes, data, few)[1] == room_left


def test_a_patch_without_area_is_left_alone():
    """A sliver whose long edges are one: it neither reflects nor spoils the rest."""
    data = room(0.03)
    nets = data.patches.control_points.copy()
    side = int(np.argmin(data.patches.evaluate(0.5, 0.5)[:, 2]))  # the floor
    nets[side] = nets[side][:, :1]
    patches = PatchSet(nets, data.patches.face_index, data.patches.part_index)
    with np.errstate(all="raise"):
        boxes, found, added, _ = cut(dataclasses.replace(data, patches=patches))
    assert added > 0 and np.isfinite(found.ends).all()
    assert (found.patch == side).sum() == (boxes.patch == side).sum()


@pytest.mark.slow
def test_light_is_found_with_few_elements(monkeypatch):
    """Six lamps hide a fifth of the ceiling."""
    data = room(0.03)
    fine = solve(data, accuracy=0.03).sensors["plane"]
    found = solve(data, accuracy=0.1)
    assert found.counters["elements_added_for_gaps"] > 0
    monkeypatch.setattr("patchlight.solver.mesher.with_gaps", lambda boxes, *_: (boxes, 0))
    without = solve(data, accuracy=0.1)
    off, before = (
        np.abs(run.sensors["plane"].illuminance_lx / fine.illuminance_lx - 1.0)
        for run in (found, without)
    )
    assert off.mean() < 0.5 * before.mean() and off.max() < 0.02
