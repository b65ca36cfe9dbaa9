"""Lamps whose exitance varies over them: flux, light near and far, cavities, superposition."""

import dataclasses

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.model import PatchSet
from patchlight.solver.model.profiles import Profile, checked_profile
from patchlight.solver.simulation import solve

from .fixtures_light import Body, area_rule, ceiling, grid, rectangle, scene, setup

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
        assert "uneven lamps" not in plain.stages and "uneven_pairs" not in plain.counters
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


def test_corner_values_are_bilinear():
    """A strip with an exitance at every corner, as the method of 1993 gives them, near and far."""
    strip = rectangle((-1, -0.1, 0), (-1, 0.1, 0), (1, 0.1, 0), (1, -0.1, 0))
    c0, c1, c2, c3 = 1.0, 2.0, 5.0, 0.5  # (−1, −0.1), (−1, 0.1), (1, 0.1), (1, −0.1)

    def bilinear(p):
        u, v = (p[:, 1] + 0.1) / 0.2, (p[:, 0] + 1.0) / 2.0
        return (1 - u) * ((1 - v) * c0 + v * c3) + u * ((1 - v) * c1 + v * c2)

    points = [(x, y, z) for x in (-1.2, 0.1, 0.9) for y in (0.0, 0.15) for z in (-0.06, -0.3, -2)]
    data = scene(setup(strip), rho=0, lamps=[(0, "lamp", 100.0)], sensors=[grid("at", points)])
    truth = by_quadrature(strip, bilinear, 40.0, points, order=200)
    for given in ([c0, c1, c2, c3], [[c0, c3], [c1, c2]], bilinear):
        found = solve(shaped(data, given), accuracy=0.01).sensors["at"].illuminance_lx
        np.testing.assert_allclose(found, truth, rtol=1e-3)


def test_table_with_kinks():
    """Lines of tables become sides of elements, so that their kinks are exact."""
    strip = rectangle((-1, -0.1, 0), (-1, 0.1, 0), (1, 0.1, 0), (1, -0.1, 0))
    table = [[1.0, 0.0, 3.0, 0.2], [1.0, 0.0, 3.0, 0.2]]

    def folded(p):
        return np.interp(p[:, 0], np.linspace(-1, 1, 4), table[0])

    points = [(x, 0.05, z) for x in (-1.2, 0.1, 0.9) for z in (-0.2, -1)]
    data = scene(setup(strip), rho=0, lamps=[(0, "lamp", 100.0)], sensors=[grid("at", points)])
    found = solve(shaped(data, table), accuracy=0.01)
    thirds = PatchSet.concatenated(
        *(ceiling(a, a + 2 / 3, -0.1, 0.1, 0.0) for a in (-1, -1 / 3, 1 / 3))
    )
    truth = by_quadrature(thirds, folded, 40.0, points)
    np.testing.assert_allclose(found.sensors["at"].illuminance_lx, truth, rtol=1e-4)


def test_lamp_behind_an_edge():
    """Which part of a lamp is hidden counts where its parts differ; some see faint ends alone."""
    lamp = ceiling(-1, 1, -0.5, 0.5, 0.0)
    plate = rectangle((0.1, -1, -1), (2, -1, -1), (2, 1.2, -1), (0.3, 1.2, -1))

    def ramp(p):
        return np.exp(2 * p[:, 0]) * (1 + 0.5 * p[:, 1])

    points = np.array([(x, -0.3, -2.0) for x in (-0.7, -0.1, 0.5, 0.9)])
    data = scene(
        setup(lamp, plate), rho=0, lamps=[(0, "lamp", 100.0)], sensors=[grid("at", points)]
    )
    found = solve(shaped(data, ramp), accuracy=0.01).sensors["at"]
    # Middles of a million cells: what the edge cuts of them leaves 1e-4.
    n = 700
    x, y = np.meshgrid((np.arange(2 * n) + 0.5) / n - 1, (np.arange(n) + 0.5) / n - 0.5)
    level = ramp(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
    for point, value in zip(points, found.illuminance_lx, strict=True):
        hx, hy = 0.5 * (x + point[0]), 0.5 * (y + point[1])  # half-way, where the plate is
        free = (hx < 0.1 + 0.2 * (hy + 1) / 2.2) | (hx > 2) | (hy < -1) | (hy > 1.2)
        kernel = 4.0 / np.pi / ((x - point[0]) ** 2 + (y - point[1]) ** 2 + 4.0) ** 2
        truth = float((kernel * level * free).sum() / level.sum() * 200.0)
        assert value == pytest.approx(truth, rel=0.01)


def test_both_sides_of_a_sheet_show_the_profile_at_the_same_places():
    sheet = ceiling(-1, 1, -1, 1, 0.0)
    points = np.array([(0.6, 0.2, -0.5), (0.6, 0.2, 0.5)])
    data = scene(
        setup(sheet),
        rho=0,
        lamps=[(0, "lamp", 100.0)],
        sensors=[grid("below", points[:1]), grid("above", points[1:], (0, 0, -1))],
    )
    lamp = dataclasses.replace(data.luminaires[0], area_m2=8.0)
    data = dataclasses.replace(data, two_sided=[True], luminaire_index=[[0, 0]], luminaires=(lamp,))
    for given in (off_centre, [[1, 2], [5, 0.3]]):
        found = solve(shaped(data, given), accuracy=0.02).sensors
        below, above = (found[name].illuminance_lx[0] for name in ("below", "above"))
        assert above == pytest.approx(below, rel=1e-6)


def test_ledger_closes_and_escaped_light_knows_the_profile():
    """A lamp whose bright end faces a black wall near it: more of its flux is absorbed there."""
    lamp, wall = ceiling(-1, 1, -0.2, 0.2, 0.0), ceiling(0.2, 1.5, -0.6, 0.6, -0.3)
    wall = PatchSet.from_bilinear(
        np.array([[(0.2, -1, -0.3), (1.5, -1, -0.3), (1.5, 1, -0.3), (0.2, 1, -0.3)]])
    )
    data = scene(setup(lamp, wall), rho=0.0, lamps=[(0, "lamp", 100.0)])
    share = []
    for given in ([[1, 0], [1, 0]], [[0, 1], [0, 1]]):
        balance = solve(shaped(data, given), accuracy=0.01).balance
        assert balance.emitted_lm == pytest.approx(80.0, rel=1e-12)
        assert abs(balance.residual_fraction) < 2e-3
        share.append(balance.absorbed_lm / 80.0)
    assert max(share) > 1.5 * min(share)


def test_a_profile_may_be_wrong():
    data = scene(setup(DISC), lamps=[(0, "lamp", 100.0)])
    for given, text in (
        (lambda p: -p[:, 0], "must be a finite number >= 0"),
        (lambda p: p[:, 0] * np.nan, "must be a finite number >= 0"),
        (lambda p: np.ones(3), "not"),
        (lambda p: np.zeros(len(p)), "0 everywhere"),
        (lambda p: "x", "part0: profile"),
    ):
        with pytest.raises(InputError, match=text):
            solve(shaped(data, given), accuracy=0.2)
    with pytest.raises(InputError, match="has 3 tables"):
        shaped(data, np.ones((3, 2, 2)))
    for value in ("bright", [1, 2, 3], [[1, 2]], [[1, -2], [0, 0]], [[0, 0], [0, 0]], [1, [2]]):
        with pytest.raises(InputError, match=r"Emitter\.profile"):
            checked_profile(value)
