"""The method of Nishita and Nakamae 1993, against closed forms and against ours.

Figure 2 of the paper: a hexagonal box with a rectangular source; form factors to the source from
points on the floor and on walls. Discs are off by more than 40 % at the edge of the source, the
paper's polygons by 0.05 %.
"""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors
from patchlight.solver.nn93 import corners, disc_form_factors

from .fixtures_light import UP, ceiling, rectangle

LAMP = ceiling(-1.5, 1.5, -1.5, 1.5, 2.0)

#: Its kernels take most of a minute to compile.
pytestmark = pytest.mark.slow


def polygon(point, normal, vertices):
    """Lambert's formula for a polygon wholly above the horizon, seen from its + side."""
    r = vertices - point
    total = 0.0
    for p, q in zip(r, np.roll(r, -1, axis=0), strict=True):
        c = np.cross(p, q)
        s = np.linalg.norm(c)
        total += (c @ normal) * math.atan2(s, p @ q) / s
    return -total / (2 * math.pi)


def hexagonal_box():
    """Source: one wall of a hexagonal prism; points on the floor and on three other walls."""
    ring = [np.array([math.cos(a), math.sin(a), 0.0]) for a in np.arange(6) * math.pi / 3]
    up = np.array([0.0, 0.0, 1.0])
    walls = [
        np.array([ring[k], ring[k] + up, ring[(k + 1) % 6] + up, ring[(k + 1) % 6]])
        for k in range(6)
    ]
    points, normals = [], []
    for r in (0.0, 0.3, 0.6, 0.9, 0.999):
        for k in range(6):
            points += [r * ring[k], r * 0.5 * (ring[k] + ring[(k + 1) % 6])]
            normals += [up, up]
    for k in (1, 2, 3):  # the neighbour of the source, the next one and the one facing it
        inward = -(ring[k] + ring[(k + 1) % 6])
        for s in (1e-3, 0.25, 0.5, 0.75, 1 - 1e-3):
            for z in (0.0, 1e-3, 0.5, 1.0):
                points.append((1 - s) * ring[k] + s * ring[(k + 1) % 6] + z * up)
                normals.append(inward / np.linalg.norm(inward))
    return walls[0], np.array(points), np.array(normals)


def test_figure_two():
    source, points, normals = hexagonal_box()
    patches = rectangle(*source)
    truth = np.array([polygon(p, n, source) for p, n in zip(points, normals, strict=True)])
    assert (truth > 0).all()
    ours = point_form_factors(points, normals, patches, accuracy=1e-7).value[:, 0]
    theirs = point_form_factors(points, normals, patches, method="nn93").value[:, 0]
    discs = disc_form_factors(points, normals, patches, divisions=3)[:, 0]
    assert np.abs(ours / truth - 1).max() <= 1e-6
    assert np.abs(theirs / truth - 1).max() <= 5e-4
    assert np.abs(discs / truth - 1).max() > 0.4


@pytest.mark.parametrize("seed", range(3))
def test_the_band_is_a_bound(seed):
    rng = np.random.default_rng(seed)
    for _ in range(10):
        corner = rng.uniform((-1, -1, 0.3), (1, 1, 2), size=(4, 3))
        patch = PatchSet.from_bilinear(corner[None])
        found = point_form_factors((0, 0, 0), UP, patch, method="nn93", visibility="none")
        exact = point_form_factors((0, 0, 0), UP, patch, visibility="none")
        assert exact.value[0, 0] <= found.high[0, 0] * (1 + 1e-4) + 1e-12


def test_curved_source_by_polygons():
    source = PatchSet.disk((0, 0, 0.6), 1.1, (0, 0, -1))
    found = point_form_factors((0, 0, 0), UP, source, method="nn93", visibility="none")
    expected = 1.1**2 / (1.1**2 + 0.6**2)
    assert found.value.sum() == pytest.approx(expected, rel=2e-3)


def test_shadow_of_a_square_by_pyramids():
    screen = ceiling(-0.5, 0.4, -0.3, 0.2, 1.0)
    found = point_form_factors((0, 0, 0), UP, LAMP, screen, method="nn93").value[0, 0]
    both = PatchSet.concatenated(LAMP, screen)
    whole = point_form_factors((0, 0, 0), UP, both, visibility="none")
    assert found == pytest.approx(whole.value[0, 0] - whole.value[0, 1], rel=5e-3)


def test_shadow_of_a_sphere_by_pyramids():
    ball = PatchSet.sphere((0.05, 0.02, 1.2), 0.3)
    found = point_form_factors((0, 0, 0), UP, LAMP, ball, method="nn93").value[0, 0]
    sure = point_form_factors((0, 0, 0), UP, LAMP, ball, visibility="strict").value[0, 0]
    # Scanlines and shares of sub-elements, as in the paper: a percent of the shadow.
    assert found == pytest.approx(sure, rel=1e-2)


def test_corners_of_patches():
    at, normals = corners(LAMP)
    np.testing.assert_allclose(sorted(at[0].tolist()), sorted(
        [[-1.5, -1.5, 2], [1.5, -1.5, 2], [1.5, 1.5, 2], [-1.5, 1.5, 2]]), atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(normals, [[[0, 0, -1]] * 4], atol=1e-12)
