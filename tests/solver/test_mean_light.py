"""Direct light of lamps averaged over elements: closed forms, and what all of it must add up to."""

import numpy as np
import pytest
from patchlight.solver.budget import Budget
from patchlight.solver.mean_light import MeanLight, by_rays
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.topology import make_blockers

from .fixtures_light import Body, ceiling, scene, setup


def mean_light(data, counts):
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    elements = make_elements(data.patches, data.two_sided, np.full((len(data.patches), 2), counts))
    return elements, MeanLight(data, blockers).on(elements, np.arange(len(elements)))


def between_squares(side, distance):
    """Form factor between two parallel squares face to face, Howell's C-11."""
    x = side / distance
    root = np.sqrt(1.0 + x * x)
    terms = np.log(root**2 / np.sqrt(1.0 + 2.0 * x * x))
    terms += 2.0 * x * root * np.arctan(x / root) - 2.0 * x * np.arctan(x)
    return 2.0 / (np.pi * x * x) * terms


@pytest.mark.parametrize("distance", [1.0, 2.5])
def test_the_mean_over_a_square_under_a_square(distance):
    floor = Body(PatchSet.from_bilinear([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]]))
    lamp = ceiling(-1, 1, -1, 1, distance)
    data = scene(setup(floor, lamp), lamps=[(1, "lamp", 1000.0)])
    elements, found = mean_light(data, 2)
    total = float((found[:4, 0] * elements.areas[:4]).sum())
    # Middles of 12 x 12 parts of a smooth function.
    assert total == pytest.approx(1000.0 * between_squares(2.0, distance), rel=2e-3)


@pytest.mark.parametrize("counts", [1, 3])
def test_all_light_arrives_past_what_hides_it(counts):
    """Half shadows over the whole room, and elements as large as its walls."""
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    tables = [
        Body(PatchSet.box((0.7, 0.5, 0.05), center=(x, y, -0.6)))
        for x in (-1.2, 0.0, 1.2)
        for y in (-1.5, 0.0, 1.5)
    ]
    lamp = ceiling(-0.6, 0.6, -0.6, 0.6, 1.3)
    data = scene(setup(walls, *tables, lamp), lamps=[(10, "lamp", 3000.0)])
    elements, found = mean_light(data, counts)
    total = float((found[:, 0] * elements.areas).sum())
    # 36 rays an element: half of those in a half shadow may be wrong by a twentieth.
    assert total == pytest.approx(3000.0, rel=0.03 / counts)


def test_lamps_through_glass_and_uneven_ones_are_not_told_by_rays():
    lamp = ceiling(-0.6, 0.6, -0.6, 0.6, 1.3)
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    data = scene(setup(walls, lamp), lamps=[(1, "lamp", 3000.0)])
    assert by_rays(data)
    assert not Budget.of(data, 0.1).is_large
