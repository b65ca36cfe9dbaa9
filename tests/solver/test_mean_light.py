"""Direct light of lamps averaged over elements: closed forms, and what all of it must add up to."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.lamp_flux import as_much
from patchlight.solver.mean_light import MeanLight, by_rays
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet, Photometry, Web
from patchlight.solver.surfaces import Surfaces
from patchlight.solver.topology import make_blockers
from patchlight.solver.unknowns import Unknowns

from .fixtures_light import Body, ceiling, scene, setup


def mean_light(data, counts):
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    elements = make_elements(data.patches, data.two_sided, np.full((len(data.patches), 2), counts))
    return elements, MeanLight(data, blockers).on(elements, np.arange(len(elements)))[0]


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


def test_all_light_of_lamps_that_are_faint_arrives():
    """Most of 256 lamps make up less than `FAINT` of what arrives, and are hidden more than near
    ones: without asking about some of them 2 % too much would arrive."""
    walls = Body(PatchSet.box((48, 48, 2.6), inward=True))
    at = np.arange(-22.5, 23.0, 3.0)
    lamps = [ceiling(x - 0.3, x + 0.3, y - 0.3, y + 0.3, 1.2) for x in at for y in at]
    screens = [
        Body(PatchSet.box(size, center=(x, y, -0.3)))
        for x in at[::2] + 1.5
        for y in at[::2] + 1.5
        for size in ((2.4, 0.05, 1.8),)
    ]
    every = range(len(screens) + 1, len(screens) + 1 + len(lamps))
    data = scene(setup(walls, *screens, *lamps), lamps=[(k, f"lamp {k}", 100.0) for k in every])
    elements, found = mean_light(data, 2)
    flux = found.sum(axis=1) * elements.areas / (100.0 * 0.36 * len(lamps))
    # Parts of 4 m: with four times as many elements 1e-4 is left.
    assert flux.sum() == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("alone", [False, True])
def test_groups_of_faint_lamps_are_as_much_in_all(alone):
    """However the lamps are parted in groups: less than nothing counts in none of them."""
    walls = Body(PatchSet.box((30, 30, 2.6), inward=True))
    at = np.arange(-13.5, 14.0, 3.0)
    lamps = [ceiling(x - 0.3, x + 0.3, y - 0.3, y + 0.3, 1.2) for x in at for y in at]
    screen = Body(PatchSet.box((24.0, 0.05, 1.8), center=(0.0, 0.0, -0.3)))
    data = scene(
        setup(walls, screen, *lamps), lamps=[(k + 2, f"lamp {k}", 100.0) for k in range(len(lamps))]
    )
    groups = [f"{k}" if alone else "all" for k in range(len(lamps))]
    data = dataclasses.replace(
        data,
        luminaires=tuple(
            dataclasses.replace(lamp, group=group)
            for lamp, group in zip(data.luminaires, groups, strict=True)
        ),
    )
    surfaces, unknowns = surfaces_of(data, 2)
    direct = {group: np.ones((len(unknowns), 1)) for group in dict.fromkeys(groups)}
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    deviation = MeanLight(data, blockers).put(direct, surfaces, unknowns, 0.0)
    light = unknowns.mean(sum(direct.values()))[:, 0]
    assert (light * surfaces.areas).sum() == pytest.approx(100.0 * 36.0, rel=0.006)
    assert all((values >= 0.0).all() for values in direct.values())
    assert (deviation >= 0.0).all() and deviation[light > 0.0].max() < light.max()


def surfaces_of(data, counts):
    elements = make_elements(data.patches, data.two_sided, np.full((len(data.patches), 2), counts))
    return Surfaces.of(data, elements, 1), Unknowns.of(elements, "bilinear")


def test_deviation_covers_what_other_points_find():
    """Of squares under a lamp past a grating: what places of other elements would have told."""
    walls = Body(PatchSet.box((4, 4, 2.7), inward=True))
    bars = [
        Body(PatchSet.box((3.6, 0.06, 0.06), center=(0, y, 0.0))) for y in np.arange(-1.5, 1.6, 0.2)
    ]
    lamp = ceiling(-0.2, 0.2, -0.2, 0.2, 1.3)
    data = scene(setup(walls, *bars, lamp), lamps=[(len(bars) + 1, "lamp", 3000.0)])
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    elements = make_elements(data.patches, data.two_sided, np.full((len(data.patches), 2), 4))
    floor = np.flatnonzero(elements.nodes[..., 2].max(axis=1) < -1.3)
    means = MeanLight(data, blockers)
    found, deviation = means.on(elements, floor)
    truth = means.on(elements, floor, look=60)[0]
    off = np.abs(found - truth)[:, 0] / deviation
    assert len(floor) == 16 and np.quantile(off, 0.95) <= 2.0 and np.sqrt(np.mean(off**2)) > 0.05


@pytest.mark.parametrize("bands", [1, 3])
def test_pieces_get_as_much_light_as_is_told(bands):
    """And vary as they were found to; where next to nothing was found, not at all."""
    rng = np.random.default_rng(3)
    pieces = np.arange(2, 18).reshape(2, 8)
    areas, found, told = (rng.random(s) + 0.1 for s in (20, (20, bands), (20, bands)))
    found[pieces[1]] *= 1e-3
    light = as_much(found, told, areas, pieces)
    untouched = np.setdiff1d(np.arange(20), pieces)
    assert np.array_equal(light[untouched], found[untouched])
    flux = [(v[pieces] * areas[pieces][..., None]).sum(axis=1) for v in (light, told)]
    assert flux[0] == pytest.approx(flux[1], rel=1e-12)
    ratio = light[pieces[0]] / found[pieces[0]]
    assert ratio == pytest.approx(np.broadcast_to(ratio[0], ratio.shape), rel=1e-12)
    assert light[pieces[1]] == pytest.approx(np.broadcast_to(light[pieces[1]][0], (8, bands)))
    assert (light > 0.0).all()
