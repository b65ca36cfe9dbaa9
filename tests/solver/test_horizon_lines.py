"""Borders of elements at the heights of sills and heads."""

import numpy as np
import pytest
from patchlight.solver.horizon_lines import kink_heights, upright_axes, with_lines
from patchlight.solver.mesh import Boxes
from patchlight.solver.model import PatchSet

from .fixtures_light import Body, setup
from .test_outside_light import black_room


def heights_of(boxes, patches, patch):
    """Heights of the borders of the boxes of one upright patch."""
    rows = np.flatnonzero(boxes.patch == patch)
    axis, reach = upright_axes(patches.control_points)
    ends = boxes.ends[rows][:, 2 * axis[patch] : 2 * axis[patch] + 2]
    return np.unique(reach[patch, 0] + ends * (reach[patch, 1] - reach[patch, 0]))


def is_cover(boxes, count):
    """Whether the boxes of every patch fill it."""
    size = (boxes.ends[:, 1] - boxes.ends[:, 0]) * (boxes.ends[:, 3] - boxes.ends[:, 2])
    return np.allclose(np.bincount(boxes.patch, size, count), 1.0, atol=1e-12) and (size > 0).all()


def test_heights_are_those_of_the_opening_and_the_room():
    assert kink_heights(black_room().blockers) == pytest.approx([0.0, 0.9, 2.4, 3.0])


def test_a_closed_body_has_none():
    blockers = setup(Body(PatchSet.box((1, 2, 3)))).blockers
    assert len(kink_heights(blockers)) == 0
    boxes = Boxes.regular(np.full((6, 2), 3), np.zeros(6, bool))
    assert with_lines(boxes, blockers, 1000) is boxes


def test_borders_near_enough_move_and_none_is_added():
    parts = black_room()
    n = len(parts.patches)
    boxes = Boxes.regular(np.full((n, 2), 4), np.zeros(n, bool))
    found = with_lines(boxes, parts.blockers, 10_000)
    assert len(found) == len(boxes)
    # 0.75, 1.5 and 2.25 before; walls are patches 2 to 4.
    for wall in (2, 3, 4):
        assert heights_of(found, parts.patches, wall) == pytest.approx([0, 0.9, 1.5, 2.4, 3.0])
    flat = np.isin(found.patch, [0, 1])
    assert (found.ends[flat] == boxes.ends[flat]).all()
    assert is_cover(found, n)


def test_boxes_without_a_border_near_are_cut_as_far_as_there_is_room():
    parts = black_room()
    n = len(parts.patches)
    boxes = Boxes.regular(np.ones((n, 2), int), np.zeros(n, bool))
    found = with_lines(boxes, parts.blockers, 10_000)
    for wall in (2, 3, 4):
        assert heights_of(found, parts.patches, wall) == pytest.approx([0, 0.9, 2.4, 3.0])
    assert is_cover(found, n)
    assert len(with_lines(boxes, parts.blockers, n + 2)) == n + 2
    assert is_cover(with_lines(boxes, parts.blockers, n + 2), n)


def test_upright_parameters():
    patches = PatchSet.from_bilinear(
        np.array(
            [
                [(0, 0, 0), (1, 0, 0), (1, 0, 2), (0, 0, 2)],  # rises along v
                [(0, 0, 2), (0, 0, 0), (1, 0, 0), (1, 0, 2)],  # falls along u
                [(0, 0, 0), (1, 0, 0), (1, 0, 2), (0, 0, 1)],  # a slanting top
                [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],  # level
            ],
            float,
        )
    )
    axis, reach = upright_axes(patches.control_points)
    assert axis.tolist() == [1, 0, -1, -1]
    assert reach[:2].tolist() == [[0.0, 2.0], [2.0, 0.0]]
