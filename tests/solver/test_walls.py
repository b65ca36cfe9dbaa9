"""Walls of hollow spheres: which surfaces they are, and form factors by area."""

import numpy as np
import pytest
from patchlight.solver.exchange import form_factor_matrix, make_sources
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.quadrics import fit_quadrics
from patchlight.solver.unknowns import Unknowns
from patchlight.solver.walls import SAME, find_walls, no_walls, walls_under

from .fixtures_light import Body, setup

CENTER, RADIUS = (10.0, -20.0, 3.0), 2.5
HOLLOW = PatchSet.sphere(CENTER, RADIUS, inward=True)


def walls_of(patches):
    return find_walls(fit_quadrics(patches.control_points), patches.areas())


def between(parts, cuts, *, inset=0.0, **options):
    """Elements of closed bodies, the elements as sources, and the factors among them.

    Receivers are moved ``inset`` off the surface. [m]
    """
    p = len(parts.patches)
    elements = make_elements(parts.patches, np.zeros(p, bool), np.tile(cuts, (p, 1)))
    nets = parts.patches.control_points
    sources = make_sources(elements, nets, np.full(len(elements), 1e-4))
    found = form_factor_matrix(
        elements.nodes + inset * elements.normals,
        elements.normals,
        elements.weights / elements.areas[:, None],
        elements.patch_index if inset == 0.0 else np.full(len(elements), -1),
        sources,
        parts.blockers,
        own=np.arange(len(elements)) if inset == 0.0 else None,
        **options,
    )
    return elements, sources, found


def stretched(patches, by):
    net = patches.control_points.copy()
    net[..., 2] *= by
    return PatchSet(net)


def test_all_of_a_hollow_sphere_is_one_wall():
    found = walls_of(HOLLOW)
    assert found.wall.tolist() == [0] * 8
    np.testing.assert_allclose(found.wall_share, 0.125, rtol=1e-9)
    np.testing.assert_allclose(found.wall_spheres, [(*CENTER, RADIUS)], rtol=SAME)


@pytest.mark.parametrize(
    "patches",
    [
        PatchSet.sphere(CENTER, RADIUS),  # seen from outside
        PatchSet.cylinder((0, 0, 0), (0, 0, 1), 0.5, inward=True),
        PatchSet.box((1, 2, 3), inward=True),
        stretched(PatchSet.sphere((0, 0, 0), 1.0, inward=True), 1.0 + 1e-6),
    ],
)
def test_other_surfaces_are_none(patches):
    found = walls_of(patches)
    assert (found.wall == -1).all() and not found.wall_share.any()
    assert not len(found.wall_spheres)


def test_spheres_are_told_apart():
    """By centre and by radius; patches of one sphere belong together whichever body they are of."""
    parts = [HOLLOW, PatchSet.sphere(CENTER, 2.6, inward=True), HOLLOW.take([2, 5])]
    parts.append(PatchSet.sphere((10.1, -20.0, 3.0), RADIUS, inward=True))
    wall = walls_of(PatchSet.concatenated(*parts)).wall
    of = np.split(wall, np.cumsum([len(p) for p in parts])[:-1])
    assert [len(set(own)) for own in of] == [1, 1, 1, 1]
    assert of[0][0] == of[2][0] and len({of[0][0], of[1][0], of[3][0]}) == 3


def test_receivers_on_a_wall():
    """On its inner side, looking to the centre: to 1e-9 of the radius."""
    n = np.array([(0.6, 0.0, 0.8)] * 6)
    x = np.array(CENTER) - RADIUS * n
    x[1] += 1e-4 * n[1]  # off the wall
    n[2] *= -1.0  # on its other side
    n[3] = (0.8, 0.0, 0.6)  # turned
    spheres = np.array([(0.0, 0.0, 0.0, 1.0), (*CENTER, RADIUS)])
    weights = np.ones((6, 1))
    weights[4] = 0.0  # gets no light
    found = walls_under(x[:, None], n[:, None], weights, spheres)
    assert found.tolist() == [1, -1, -1, -1, -1, 1]


def test_factors_within_a_sphere_are_areas():
    """A / (4 π R²), near and far, and as contours have it for receivers a little off the wall."""
    elements, _, found = between(setup(Body(HOLLOW)), (3, 2), eps=1e-7, trace=False)
    share = elements.areas / (4.0 * np.pi * RADIUS**2)
    np.testing.assert_allclose(found.factors, np.tile(share, (48, 1)), rtol=1e-9)
    assert found.counters["pairs_by_area"] == 48 * 48 * 4
    close = {"eps": 1e-7, "trace": False, "inset": 1e-6 * RADIUS}
    _, _, moved = between(setup(Body(HOLLOW)), (3, 2), **close)
    assert moved.counters["pairs_by_area"] == 0
    # The horizon has moved by h, 1e-6 R: what is cut off next to the receiver is h / R.
    np.testing.assert_allclose(moved.factors, found.factors, rtol=1e-6, atol=1.1e-6)


def test_what_stands_in_a_sphere_hides_some_of_its_wall():
    """From anywhere on the wall, all of it but (r / R)² behind a ball of radius r in the middle."""
    radius = 1.5
    ball = Body(PatchSet.sphere(CENTER, radius))
    elements, _, found = between(setup(Body(HOLLOW), ball), (1, 1), eps=1e-6)
    wall = elements.patch_index < 8
    seen = found.factors[wall][:, wall]
    # Cells of a form factor below 1e-4 are sampled.
    np.testing.assert_allclose(seen.sum(axis=1), 1.0 - (radius / RADIUS) ** 2, rtol=2e-3)
    assert (seen <= elements.areas[wall] / (4.0 * np.pi * RADIUS**2) * (1.0 + 2e-3)).all()
    assert found.counters["pairs_by_area"] == 8 * 8 * 4


def test_light_of_a_wall_is_the_same_all_over_it():
    """Any light on the nodes gives all of the wall the mean of it by area."""
    known = {"eps": 1e-6, "trace": False, "single": True}
    elements, sources, found = between(setup(Body(HOLLOW)), (2, 2), **known)
    unknowns = Unknowns.at_nodes(elements)
    light = np.random.default_rng(1).uniform(size=(len(unknowns), 2))
    single = found.take(np.repeat(np.arange(len(elements)), 4))
    got = unknowns.gather(single, unknowns.receivers, sources, 1e-4, light)
    mean = unknowns.areas @ light / unknowns.areas.sum()
    # Factors are of single precision.
    np.testing.assert_allclose(got, np.tile(mean, (len(got), 1)), rtol=1e-6)


def test_nothing_is_a_wall_unless_looked_for():
    assert (no_walls(3).wall == -1).all() and len(no_walls(3).wall_spheres) == 0


def test_light_that_is_even_is_told_by_means():
    """To a tenth of what the shares of nodes may be off."""
    known = {"eps": 1e-6, "trace": False, "single": True, "inset": 1e-3 * RADIUS}
    elements, sources, found = between(setup(Body(HOLLOW)), (2, 2), **known)
    unknowns, eps = Unknowns.at_nodes(elements), 1e-2
    light = np.ones((len(unknowns), 2))
    light[:, 1] = 1e-3 * (1.0 + 0.1 * np.sin(np.arange(len(unknowns))))  # against the other
    assert unknowns.even(light, eps).all()
    light[5, 0] = 1.0 + 2.0 * eps
    even = unknowns.even(light, eps)
    assert np.flatnonzero(~even).tolist() == [1]
    # A receiver of one node each: the first of the elements.
    first = unknowns.receivers.take(unknowns.of_elements(np.arange(len(elements)))[:, 0])
    of = found.take(np.arange(len(elements))), first, sources, eps, light
    told, exact = unknowns.gather(*of, even), unknowns.gather(*of)
    assert not np.array_equal(told, exact)
    np.testing.assert_allclose(told[:, 0], exact[:, 0], rtol=0.1 * eps)
    np.testing.assert_allclose(told[:, 1], exact[:, 1], atol=0.1 * eps)
    # Of kept factors it is the same to the bit, and none are asked for where all is even.
    kept = unknowns.factors(*of[:4])
    assert np.array_equal(told, unknowns.gather(*of, even, lambda: kept))

    def must_not():
        raise AssertionError("factors of nodes were asked for")

    unknowns.gather(*of, np.ones(len(elements), bool), must_not)


def test_a_dark_scene_is_even():
    elements, _, _ = between(setup(Body(HOLLOW)), (1, 1), eps=1e-6, trace=False)
    unknowns = Unknowns.at_nodes(elements)
    assert unknowns.even(np.zeros((len(unknowns), 1)), 1e-3).all()
