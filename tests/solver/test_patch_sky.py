"""Skies of 145 patches: geometry, exact integrals in the open, past what is flat and curved."""

import math

import numpy as np
import pytest
from patchlight.solver import skies
from patchlight.solver.dome import dome_cells, patch_cells
from patchlight.solver.errors import InputError
from patchlight.solver.kernels.sky_luminance import BELOW, COUNTS, sky_luminances
from patchlight.solver.model import CIESky, PatchSet, PatchSky
from patchlight.solver.model.patch_sky import (
    PATCH_COUNT,
    ROW_COUNTS,
    ROW_ENDS_DEG,
    patch_middles,
    patch_weights,
)
from patchlight.solver.model.sky import direction
from patchlight.solver.patch_sky import patch_numbers

from .fixtures_light import UP, Body, dome, setup
from .test_outside_light import black_room, light

RANDOM = PatchSky(np.random.default_rng(7).uniform(500.0, 20_000.0, PATCH_COUNT))
MIDDLES = np.array([direction(*at) for at in zip(*patch_middles(), strict=True)])


def single(number, level=1000.0):
    values = np.zeros(PATCH_COUNT)
    values[number] = level
    return PatchSky(values)


def ends(number):
    """Low and high altitude, and azimuths clockwise from north, of a patch. [rad]"""
    row = int(np.searchsorted(np.cumsum(ROW_COUNTS), number, side="right"))
    k, count = number - sum(ROW_COUNTS[:row]), ROW_COUNTS[row]
    low, high = np.radians(ROW_ENDS_DEG[row : row + 2])
    return low, high, (k - 0.5) * 2 * math.pi / count, (k + 0.5) * 2 * math.pi / count


def illuminance(sky, normals, n=1200):
    """Illuminance on ``normals`` (m, 3) by Gauss' rule of 3 x 3 points in n parts of each patch."""
    total = np.zeros(len(normals))
    for number, level in enumerate(sky.luminance_cd_m2):
        low, high, west, east = ends(number)
        m = max(2, round(math.sqrt(n)))
        x = (np.arange(m) + 0.5) / m
        up, turn = np.meshgrid(low + (high - low) * x, west + (east - west) * x, indexing="ij")
        d = np.stack([np.cos(up) * np.sin(turn), np.cos(up) * np.cos(turn), np.sin(up)], axis=-1)
        weight = np.cos(up) * (high - low) * (east - west) / m**2
        total += level * np.einsum(
            "ij,kij->k", weight, np.maximum(np.einsum("ijc,kc->kij", d, normals), 0.0)
        )
    return total


def test_patches_of_kernel_and_model_are_the_same():
    assert COUNTS == ROW_COUNTS and sum(COUNTS) == PATCH_COUNT == 145
    assert BELOW == tuple(np.cumsum(COUNTS) - COUNTS)
    assert patch_numbers(MIDDLES).tolist() == list(range(PATCH_COUNT))
    rng = np.random.default_rng(2)
    d = rng.normal(size=(5000, 3))
    d[:, 2] = np.abs(d[:, 2])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    out = np.empty(len(d))
    sky_luminances(skies.sky_tone(RANDOM), *skies.sun_direction(RANDOM), d, out)
    np.testing.assert_allclose(out, skies.luminance(RANDOM, d), rtol=1e-14)
    np.testing.assert_array_equal(
        skies.luminance(RANDOM, MIDDLES), np.array(RANDOM.luminance_cd_m2)
    )


def test_solid_angles():
    """Δφ (sin² γ₂ − sin² γ₁) / 2, π in all; Tregenza's patches have nearly the same solid angle."""
    for number in (0, 47, 144):
        low, high, west, east = ends(number)
        expected = 0.5 * (east - west) * (math.sin(high) ** 2 - math.sin(low) ** 2)
        assert patch_weights()[number] == pytest.approx(expected, rel=1e-12)
    assert patch_weights().sum() == pytest.approx(math.pi, rel=1e-14)


def test_levels():
    total = float(patch_weights() @ np.array(RANDOM.luminance_cd_m2))
    assert skies.horizontal_illuminance(RANDOM) == pytest.approx(total, rel=1e-14)
    assert skies.zenith_luminance(RANDOM) == RANDOM.luminance_cd_m2[144]
    scaled = PatchSky(RANDOM.luminance_cd_m2, diffuse_illuminance_lx=8000.0)
    assert skies.horizontal_illuminance(scaled) == 8000.0
    np.testing.assert_allclose(
        skies.luminance(scaled, MIDDLES) / skies.luminance(RANDOM, MIDDLES), 8000.0 / total
    )
    black = PatchSky(np.zeros(PATCH_COUNT))
    assert skies.horizontal_illuminance(black) == 0.0
    assert light((0, 0, 0), UP, sky=black).sky.illuminance[0] == 0.0


@pytest.mark.parametrize("number", [0, 7, 29, 61, 100, 120, 140, 144])
def test_one_patch_on_planes_that_see_all_of_it(number):
    """∫∫ (n_h cos γ cos φ + n_z sin γ) cos γ dγ dφ in closed form."""
    low, high, west, east = ends(number)
    flat = 0.5 * (high - low + 0.5 * (math.sin(2 * high) - math.sin(2 * low)))
    up = 0.5 * (math.sin(high) ** 2 - math.sin(low) ** 2)
    vector = 1000.0 * np.array([
        flat * (math.cos(west) - math.cos(east)),
        flat * (math.sin(east) - math.sin(west)),
        up * (east - west),
    ])  # fmt: skip
    toward = MIDDLES[number]
    normals = np.array([UP, toward, (toward + np.array(UP)) / np.linalg.norm(toward + UP)])
    found = light(np.zeros((3, 3)), normals, sky=single(number)).sky.illuminance
    np.testing.assert_allclose(found, normals @ vector, rtol=1e-9)


def test_tilted_planes():
    angles = np.radians([0.0, 20.0, 70.0, 90.0, 130.0])
    normals = np.stack([np.sin(angles) * 0.6, np.sin(angles) * 0.8, np.cos(angles)], axis=1)
    found = light(np.zeros((5, 3)), normals, sky=RANDOM).sky.illuminance
    # Midpoints of 35 x 35 parts of a patch, some of which the plane's horizon cuts.
    np.testing.assert_allclose(found, illuminance(RANDOM, normals), rtol=2e-4)


def test_even_patches_are_the_uniform_sky():
    """A window with sky seen past it: the same as of CIE type 5."""
    even = PatchSky(np.full(PATCH_COUNT, 3000.0))
    uniform = CIESky(5, zenith_luminance_cd_m2=3000.0)
    points = [(0.0, 0.0, 0.3), (0.6, 1.2, 0.85), (-1.9, -2.9, 0.0)]
    one, other = (light(points, UP, black_room(), s, eps=1e-7).sky for s in (even, uniform))
    np.testing.assert_allclose(one.illuminance, other.illuminance, rtol=2e-7)


def test_window_adds_up_over_patches():
    """What each patch sends by itself makes what all of them send."""
    point = (0.6, 1.2, 0.3)
    parts = black_room()
    whole = light(point, UP, parts, RANDOM, eps=1e-7).sky.illuminance[0]
    each = sum(
        light(point, UP, parts, single(k, level), eps=1e-7).sky.illuminance[0]
        for k, level in enumerate(RANDOM.luminance_cd_m2)
        if MIDDLES[k, 1] > -0.1
    )
    assert whole == pytest.approx(each, rel=1e-6)


def test_cells_of_the_pyramids_pave_the_sky():
    """Every point of a cell lies in the patch whose luminance the cell has."""
    cells, shine = patch_cells(RANDOM)
    for net, level in zip(cells, shine, strict=True):
        for u in (0.2, 0.5, 0.9):
            for v in (0.1, 0.5, 0.8):
                b = [(1 - t) ** 3 for t in (u, v)]
                rest = [[3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3] for t in (u, v)]
                at = np.einsum("i,j,ijk->k", [b[0], *rest[0]], [b[1], *rest[1]], net)[:3]
                d = at / np.linalg.norm(at)
                assert skies.luminance(RANDOM, d) == level
    found = dome(cells, (0, 0, 0), UP, shine)
    assert found.factor[0] == pytest.approx(1.0, rel=1e-9)
    assert found.illuminance[0] == pytest.approx(skies.horizontal_illuminance(RANDOM), rel=1e-9)


def test_past_a_ball_as_pyramids_see_it():
    """Sectors with something curved: patch by patch, to the error told; the others stay exact."""
    ball = setup(Body(PatchSet.sphere((2.0, 0.3, 1.0), 0.3)))
    normals = np.array([UP, (0.8, 0.0, 0.6)])
    found = light(np.zeros((2, 3)), normals, ball, RANDOM, cell_eps=1e-6).sky
    assert found.counters["sky_sectors_traced"] >= 1
    free = light(np.zeros((2, 3)), normals, sky=RANDOM).sky.illuminance
    # What the ball hides, by rays through an equal-area map of its disc of directions.
    middle = np.array((2.0, 0.3, 1.0))
    distance = np.linalg.norm(middle)
    e3 = middle / distance
    e1 = np.cross(e3, UP) / np.linalg.norm(np.cross(e3, UP))
    e2 = np.cross(e3, e1)
    n, sine2 = 700, (0.3 / distance) ** 2
    # cos θ spaced evenly is even in solid angle.
    c = 1.0 - (1.0 - math.sqrt(1.0 - sine2)) * (np.arange(n) + 0.5) / n
    turn = 2 * math.pi * (np.arange(n) + 0.5) / n
    c, turn = np.meshgrid(c, turn, indexing="ij")
    s = np.sqrt(1.0 - c * c)[..., None]
    d = c[..., None] * e3 + s * (np.cos(turn)[..., None] * e1 + np.sin(turn)[..., None] * e2)
    solid = 2 * math.pi * (1.0 - math.sqrt(1.0 - sine2))
    level = skies.luminance(RANDOM, d)
    hidden = [solid * (level * np.maximum(d @ normal, 0.0)).mean() for normal in normals]
    slack = 4.0 * found.deviation + 1e-4 * np.array(hidden)
    assert (np.abs(free - found.illuminance - hidden) <= slack).all()


def test_pyramids_with_the_sky_itself():
    """Through panes cells are not of one patch: those across its edges are cut until they are."""
    cells = dome_cells(0.0, 90.0)
    normals = np.array([UP, (0.6, 0.0, 0.8)])
    exact = light(np.zeros((2, 3)), normals, sky=RANDOM).sky.illuminance
    # Sensors ask for cells of 2e-3 of the accuracy: what they miss takes a thirtieth of it.
    for accuracy in (0.05, 0.005, 5e-4):
        found = dome(cells, np.zeros((2, 3)), normals, RANDOM, cell_eps=2e-3 * accuracy)
        np.testing.assert_allclose(found.illuminance, exact, rtol=0.03 * accuracy)
        assert (np.abs(found.illuminance - exact) <= 4.0 * found.deviation).all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"luminance_cd_m2": np.ones(144)}, r"shape \(144,\): must be \(145,\)"),
        ({"luminance_cd_m2": ["a"] * 145}, "must be 145 numbers"),
        ({"luminance_cd_m2": np.r_[np.ones(9), -1.0, np.ones(135)]}, r"\[9\] = -1"),
        ({"luminance_cd_m2": np.r_[np.nan, np.ones(144)]}, r"\[0\] = nan"),
        ({"sun_altitude_deg": 30.0}, "together"),
        ({"diffuse_illuminance_lx": -1.0}, "diffuse_illuminance_lx = -1"),
        ({"luminance_cd_m2": np.zeros(145), "diffuse_illuminance_lx": 1.0}, "black sky"),
        ({"cct_k": 1000.0}, "cct_k = 1000"),
    ],
)
def test_what_cannot_be(given, said):
    with pytest.raises(InputError, match=said):
        PatchSky(**{"luminance_cd_m2": np.ones(145), **given})


def test_skies_of_the_same_numbers_are_the_same():
    again = PatchSky(list(RANDOM.luminance_cd_m2))
    assert again == RANDOM and hash(again) == hash(RANDOM)
