"""Direct light of lamps averaged over elements: closed forms, and what all of it must add up to."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.mean_light import MeanLight, by_rays
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet, Photometry, Web
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
    # 144 points, each somewhere in its part: less than the gradient over a part, by their number.
    assert total == pytest.approx(4000.0 * between_squares(2.0, distance), rel=5e-3)


def test_all_light_arrives_past_tables_that_repeat():
    """Half shadows over a floor: what the tables do not catch falls on it and on the walls."""
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    tables = [
        Body(PatchSet.box((0.7, 0.5, 0.05), center=(x, y, -0.6)))
        for x in (-1.2, 0.0, 1.2)
        for y in (-1.5, 0.0, 1.5)
    ]
    lamp = ceiling(-0.6, 0.6, -0.6, 0.6, 1.3)
    data = scene(setup(walls, *tables, lamp), lamps=[(10, "lamp", 3000.0)])
    elements, found = mean_light(data, 5)
    flux = found[:, 0] * elements.areas / (3000.0 * 1.44)
    # A floor of 900 rays, of which a few hundred are in half shadows.
    assert flux.sum() == pytest.approx(1.0, abs=0.005)
    on_tables = (elements.patch_index >= 6) & (elements.patch_index < 60)
    # Two million rays from the lamp.
    assert flux[on_tables].sum() == pytest.approx(0.1204, abs=0.0007)


def test_lamps_that_shine_unevenly_are_not_told_by_rays():
    lamp = ceiling(-0.6, 0.6, -0.6, 0.6, 1.3)
    walls = Body(PatchSet.box((4, 5, 2.7), inward=True))
    data = scene(setup(walls, lamp), lamps=[(1, "lamp", 3000.0)])
    assert by_rays(data)
    row = [100.0, 70.0, 0.0]
    photometry = Photometry([0.0, 360.0], [0.0, 45.0, 90.0], [row, row])
    web = Web.aimed(photometry, (0, 0, -1), (1, 0, 0))
    shaped = dataclasses.replace(data.luminaires[0], web=web)
    assert not by_rays(dataclasses.replace(data, luminaires=(shaped,)))
