"""Meshes of which no edge has more than two neighbours, within patches and over smooth seams."""

import numpy as np
import pytest
from patchlight.solver.balance import balanced, smooth_seams
from patchlight.solver.mesh import Boxes
from patchlight.solver.model import PatchSet
from patchlight.solver.model.bezier import surface_points
from patchlight.solver.simulation import solve

from .fixtures_light import Body, ceiling, scene, setup

MANY = 100_000


def cut_at_random(count, patches, seed, rounds=25):
    """Boxes of which some, the smaller the likelier, are cut anywhere."""
    rng = np.random.default_rng(seed)
    boxes = Boxes.regular(np.full((patches, 2), count), np.zeros(patches, bool))
    for _ in range(rounds):
        chosen = np.array([rng.integers(max(0, len(boxes) - 6), len(boxes))])
        parts = boxes.take(chosen).cut(rng.integers(0, 2, 1), rng.choice([0.25, 0.5, 0.75], 1))
        kept = np.setdiff1d(np.arange(len(boxes)), chosen)
        boxes = boxes.take(kept).joined(parts)[0]
    return boxes


def most_corners_on_an_edge(nets, boxes, patches, chords=1):
    """Corners of others inside an edge of a box, at most; told by places in space alone.

    An edge is taken for ``chords``.
    """
    corners = np.array([[0, 2], [1, 2], [1, 3], [0, 3]])
    u, v = boxes.ends[:, corners[:, 0]], boxes.ends[:, corners[:, 1]]
    every = surface_points(nets[boxes.patch], u, v)[0].reshape(-1, 3)
    every = np.unique(np.round(every, 6), axis=0)
    t = np.linspace(0.0, 1.0, chords + 1)
    worst = 0
    for k in np.flatnonzero(np.isin(boxes.patch, patches)):
        net = nets[boxes.patch[k]][None]
        for side in range(4):
            s, r = (a[k, side] + t * (a[k, (side + 1) % 4] - a[k, side]) for a in (u, v))
            line = surface_points(net, s[None], r[None])[0][0]
            step = np.diff(line, axis=0)
            away = every[:, None] - line[:-1]
            share = (away * step).sum(axis=2) / np.maximum((step**2).sum(axis=1), 1e-300)
            foot = away - np.clip(share, 0.0, 1.0)[..., None] * step
            # Corners are known to 1e-6, chords of an 8th of a quarter turn to 3e-3.
            on = np.linalg.norm(foot, axis=2).min(axis=1) < (3e-6 if chords == 1 else 4e-3)
            for end in (line[0], line[-1]):
                on &= np.linalg.norm(every - end, axis=1) > 5e-6
            worst = max(worst, int(on.sum()))
    return worst


@pytest.mark.parametrize("seed", range(4))
def test_no_edge_in_a_patch_has_more_than_two_neighbours(seed):
    plate = PatchSet.from_bilinear(np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]], float))
    before = cut_at_random(2, 1, seed)
    after = balanced(before, [], MANY)
    assert len(after) > len(before)
    nets = plate.control_points
    assert most_corners_on_an_edge(nets, before, [0]) > 1
    assert most_corners_on_an_edge(nets, after, [0]) <= 1
    # Still a partition of the patch, that keeps all borders there were.
    size = (after.ends[:, 1] - after.ends[:, 0]) * (after.ends[:, 3] - after.ends[:, 2])
    assert size.sum() == pytest.approx(1.0, abs=1e-12)
    assert set(before.ends.ravel()) == set(after.ends.ravel())


def test_balance_goes_on_over_smooth_seams():
    """Two of the patches of a cylinder: cuts on one reach the other."""
    tube = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 0.7)
    seams = smooth_seams(setup(Body(tube, False)).blockers)
    assert len(seams) == len(tube)
    boxes = Boxes.regular(np.tile([1, 1], (len(tube), 1)), np.zeros(len(tube), bool))
    fine = Boxes.regular(np.tile([4, 8], (len(tube), 1)), np.zeros(len(tube), bool))
    mixed = boxes.take(np.flatnonzero(boxes.patch > 0)).joined(
        fine.take(np.flatnonzero(fine.patch == 0))
    )[0]
    after = balanced(mixed, seams, MANY)
    assert len(balanced(mixed, [], MANY)) == len(mixed) < len(after)
    nets, every = tube.control_points, range(len(tube))
    assert most_corners_on_an_edge(nets, mixed, every, chords=8) > 1
    assert most_corners_on_an_edge(nets, after, every, chords=8) <= 1


def test_creases_are_no_seams():
    assert smooth_seams(setup(Body(PatchSet.box((1, 2, 3)))).blockers) == []
    sphere = PatchSet.sphere((0, 0, 0), 1.0)
    found = smooth_seams(setup(Body(sphere)).blockers)
    # Every pair of patches that shares an edge of some length, once.
    assert len(found) == len({(s.patch, s.first) for s in found}) > len(sphere) // 2


def test_regular_meshes_are_left_alone():
    boxes = Boxes.regular(np.array([[3, 5], [2, 2]]), np.array([False, True]))
    assert balanced(boxes, [], MANY) is boxes


def test_no_more_boxes_than_allowed():
    before = cut_at_random(2, 1, 1)
    assert len(balanced(before, [], len(before))) == len(before)


def test_a_simulation_balances_its_mesh_when_asked():
    """A small lamp close to a floor of one patch: cuts close in on it."""
    floor = ceiling(-1.0, 1.0, -1.0, 1.0, 0.0).flipped()
    lamp = ceiling(-0.05, 0.08, -0.04, 0.05, 0.04)
    given = scene(setup(floor, lamp), lamps=[(1, "lamp", 4000.0)])
    as_cut, even = (solve(given, accuracy=0.1, balanced_mesh=b) for b in (False, True))
    assert as_cut.skipped["balance of the mesh"] == "not asked for"
    assert "balance of the mesh" not in even.skipped
    assert even.settings["balanced_mesh"] and not as_cut.settings["balanced_mesh"]

    def worst(result):
        elements = result.elements
        boxes = Boxes(elements.patch_index, elements.side, elements.boxes)
        return most_corners_on_an_edge(given.patches.control_points, boxes, [0])

    assert worst(as_cut) > 1 and worst(even) <= 1
    added = even.counters["elements_added_for_balance"]
    assert len(even.elements) == len(as_cut.elements) + added
