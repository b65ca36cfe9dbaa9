"""Lamps whose exitance varies over them: flux, light near and far, cavities, superposition."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.model import PatchSet
from patchlight.solver.model.profiles import Profile, checked_profile
from patchlight.solver.simulation import solve

from .fixtures_light import Body, area_rule, ceiling, grid, scene, setup

DISC = PatchSet.disk((0, 0, 0), 1.0, (0, 0, -1))
SPHERE = Body(PatchSet.sphere((0, 0, 0), 1.0, inward=True))


def shaped(data, given, lamp=0):
    """The scene with a profile on one of its lamps."""
    patches = np.flatnonzero((data.luminaire_index == lamp).any(axis=1))
    lamps = list(data.luminaires)
    profile = Profile.of(
        checked_profile(given), part=lamps[lamp].part, placement=np.eye(4), patches=patches
    )
    lamps[lamp] = dataclasses.replace(lamps[lamp], profile=profile)
    return dataclasses.replace(data, luminaires=tuple(lamps))


def by_quadrature(patches, profile, flux, points, order=64):
    """Unhidden light on upward points, by Gauss points on the lamp; far from it only."""
    at, normals, weights = area_rule(patches, order)
    level = np.asarray(profile(at))
    level = level * flux / (level @ weights)
    ray = at[None] - np.asarray(points)[:, None]
    square = (ray**2).sum(axis=2)
    up, down = ray[..., 2], -(ray * normals).sum(axis=2)
    kernel = np.maximum(up, 0.0) * np.maximum(down, 0.0) / (np.pi * square**2)
    return kernel @ (level * weights)


def radial(p):
    return 1.0 - 0.8 * (p[:, 0] ** 2 + p[:, 1] ** 2)


def bell(p):
    return np.exp(-6.0 * (p[:, 0] ** 2 + p[:, 1] ** 2)) + 0.02


def off_centre(p):
    return np.exp(1.5 * p[:, 0]) * (1.2 + np.sin(3.0 * p[:, 1]))


@pytest.mark.parametrize("profile", [radial, bell, off_centre])
@pytest.mark.parametrize("away", [0.5, 1.0, 3.0])
def test_disc_over_a_plane(profile, away):
    x = np.linspace(-1.5, 1.5, 7)
    points = np.array([(a, b, -away) for a in x for b in (0.0, 0.7)])
    parts = setup(DISC)
    data = scene(parts, rho=0.0, lamps=[(0, "lamp", 100.0)], sensors=[grid("plane", points)])
    found = solve(shaped(data, profile), accuracy=0.01).sensors["plane"]
    truth = by_quadrature(DISC, profile, 100.0 * np.pi, points)
    # A tenth of the accuracy asked for is left to form factors and profile each.
    np.testing.assert_allclose(found.illuminance_lx, truth, rtol=1e-3)
    assert (np.abs(found.illuminance_lx - truth) <= found.error_lx).all()
    even = solve(data, accuracy=0.01).sensors["plane"]
    assert np.abs(even.illuminance_lx / truth - 1.0).max() > 0.02  # the profile tells


def test_a_constant_profile_is_none():
    points = [(0.0, 0.2, -0.7), (1.0, 1.0, -1.0)]
    for lamp in (DISC, PatchSet.sphere((0, 0, 0), 0.3), ceiling(-1, 1, -0.2, 0.2, 0.0)):
        data = scene(setup(lamp), lamps=[(0, "lamp", 100.0)], sensors=[grid("plane", points)])
        plain = solve(data, accuracy=0.05)
        given = solve(shaped(data, lambda p: np.full(len(p), 7.3)), accuracy=0.05)
        np.testing.assert_allclose(
            given.sensors["plane"].illuminance_lx,
            plain.sensors["plane"].illuminance_lx,
            rtol=1e-13,
        )
        assert given.balance.emitted_lm == pytest.approx(plain.balance.emitted_lm, rel=1e-9)


def test_flux_is_exact_for_jumps_tables_and_curved_lamps():
    profiles = [
        lambda p: (p[:, 0] > 0.113) * 1.0,
        lambda p: 2.0 + p[:, 2] + p[:, 0],
        [[1, 2], [0, 3]],
    ]
    for lamp in (
        DISC,
        PatchSet.sphere((0, 0, 0), 0.5),
        PatchSet.cylinder((0, 0, 0), (1, 0, 0), 0.1),
    ):
        data = scene(setup(lamp), lamps=[(0, "lamp", 100.0)])
        flux = data.luminaires[0].flux_lm
        for profile in profiles:
            result = solve(shaped(data, profile), accuracy=0.1)
            assert result.balance.emitted_lm == pytest.approx(flux, rel=1e-12)
            own = result.exitance[:, 0] @ result.elements.areas
            # The lamp's own concave light comes besides, of which these have none.
            assert own == pytest.approx(flux, rel=1e-9)


def test_profiles_add_up():
    points = [(0.3, 0.2, -0.6), (-1.0, 1.0, -1.0), (0, 0, -0.3)]
    parts = setup(DISC)
    data = scene(parts, rho=0.0, lamps=[(0, "lamp", 100.0)], sensors=[grid("plane", points)])

    def light(profile):
        mean = float(np.average(profile(at), weights=weights))
        found = solve(shaped(data, profile), accuracy=0.003).sensors["plane"]
        return mean * found.illuminance_lx

    at, _, weights = area_rule(DISC, 40)
    both = light(lambda p: radial(p) + off_centre(p))
    np.testing.assert_allclose(light(radial) + light(off_centre), both, rtol=3e-4)


@pytest.mark.parametrize("profile", [lambda p: 1.0 + p[:, 2], lambda p: np.exp(2.0 * p[:, 0])])
def test_uneven_wall_of_a_sphere_lights_it_evenly(profile):
    """Every point of a sphere sees every piece of it by its share of the area."""
    data = scene(setup(SPHERE), rho=0.5, lamps=[(0, "wall", 100.0)])
    result = solve(shaped(data, profile), accuracy=0.01)
    direct, indirect = result.components["wall.direct"], result.components["wall.indirect"]
    # Form factors in the cavity are asked for to 3e-5, a tenth of what the budget says.
    np.testing.assert_allclose(direct, 100.0, rtol=1e-5)
    np.testing.assert_allclose(indirect, 100.0, rtol=1e-5)
