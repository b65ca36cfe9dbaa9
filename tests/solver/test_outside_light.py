"""Light of sky and ground by sweeping half-planes: closed forms, crossing edges, what is curved."""

import math
from itertools import pairwise

import numpy as np
import pytest
from patchlight.solver.dome import dome_cells
from patchlight.solver.model import CIESky, PatchSet
from patchlight.solver.model.bezier import gauss_rule
from patchlight.solver.outside_light import Horizon
from patchlight.solver.skies import relative_luminance
from patchlight.solver.surfaces import Receivers

from .fixtures_light import UP, Body, ceiling, dome, rows, setup

TILTS = np.radians([0.0, 1.0, 30.0, 45.0, 60.0, 89.0, 90.0, 91.0, 135.0, 179.0, 180.0])
SKY, GROUND = dome_cells(0.0, 90.0), dome_cells(-90.0, 0.0)
#: Only there where nothing is traced.
ANY = setup(Body(PatchSet.box((1, 1, 1))))


def light(points, normals, parts=ANY, sky=None, *, eps=1e-8, cell_eps=1e-4):
    points = np.atleast_2d(np.asarray(points, float))
    normals = np.broadcast_to(np.asarray(normals, float), points.shape).copy()
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    m = len(points)
    receivers = Receivers.of_points(points, normals, np.ones(m), np.full(m, -1))
    horizon = Horizon(parts.blockers, trace=parts is not ANY)
    return horizon.light(receivers, sky, eps=eps, cell_eps=cell_eps)


def tilted(angles, azimuth):
    a = np.asarray(angles)
    return np.stack([np.sin(a) * math.cos(azimuth), np.sin(a) * math.sin(azimuth), np.cos(a)], 1)


@pytest.mark.parametrize("azimuth", [0.0, 0.4, math.pi / 4, 3.0])
def test_uniform_sky_and_ground_at_every_tilt(azimuth):
    found = light(np.zeros((len(TILTS), 3)), tilted(TILTS, azimuth))
    # As asked; a horizon a degree off the world's turns within a degree of azimuth.
    np.testing.assert_allclose(found.sky.factor, 0.5 * (1 + np.cos(TILTS)), atol=1e-8)
    np.testing.assert_allclose(found.ground.factor, 0.5 * (1 - np.cos(TILTS)), atol=1e-8)


@pytest.mark.parametrize("number", range(1, 17))
def test_level_on_the_horizontal(number):
    for altitude in (15.0, 45.0, 75.0):
        sky = CIESky(
            number,
            sun_altitude_deg=altitude,
            sun_azimuth_deg=130.0,
            diffuse_illuminance_lx=12_000.0,
        )
        found = light((0, 0, 0), UP, sky=sky).sky.illuminance[0]
        # Rules of eight points in panels of half a radian, graded at horizon and sun.
        assert found == pytest.approx(12_000.0, rel=3e-6 if sky.needs_sun else 1e-7)


def test_overcast_vertical_over_horizontal():
    """3/14 + 4/(7π), the classical ratio of the traditional overcast sky."""
    found = light(np.zeros((2, 3)), [UP, (0, 1, 0)], sky=CIESky(16)).sky.illuminance
    assert found[1] / found[0] == pytest.approx(3 / 14 + 4 / (7 * math.pi), rel=1e-9)


def black_room(x0=-1.0, x1=0.7, z0=0.9, z1=2.4):
    """A room open to the sky through a rectangle in the wall y = 2."""
    xs, zs = (-2.0, x0, x1, 2.0), (0.0, z0, z1, 3.0)
    quads = [
        ((-2, -3, 0), (2, -3, 0), (2, 2, 0), (-2, 2, 0)),
        ((-2, -3, 3), (-2, 2, 3), (2, 2, 3), (2, -3, 3)),
        ((-2, -3, 0), (-2, 2, 0), (-2, 2, 3), (-2, -3, 3)),
        ((2, -3, 0), (2, -3, 3), (2, 2, 3), (2, 2, 0)),
        ((-2, -3, 0), (-2, -3, 3), (2, -3, 3), (2, -3, 0)),
    ]
    for i, (a, b) in enumerate(pairwise(xs)):
        for k, (c, d) in enumerate(pairwise(zs)):
            if (i, k) != (1, 1):
                quads.append(((a, 2, c), (b, 2, c), (b, 2, d), (a, 2, d)))
    return setup(PatchSet.from_bilinear(np.array(quads, float)))


def through_window(point, normal, sky, x0=-1.0, x1=0.7, z0=0.9, z1=2.4, order=60):
    """Illuminance through the opening by Gauss' rule over it."""
    s, w = gauss_rule(order)
    x, z = np.meshgrid(x0 + (x1 - x0) * s, z0 + (z1 - z0) * s, indexing="ij")
    d = np.stack([x, np.full_like(x, 2.0), z], -1) - np.asarray(point)
    r2 = (d**2).sum(-1)
    unit = d / np.sqrt(r2)[..., None]
    cosines = np.maximum(unit @ np.asarray(normal), 0.0) * unit[..., 1]
    values = relative_luminance(sky, unit) * cosines / r2
    return float((x1 - x0) * (z1 - z0) * (w[:, None] * w * values).sum())


@pytest.mark.parametrize(
    "point", [(0.0, 0.0, 0.3), (0.6, 1.2, 0.85), (-1.9, -2.9, 0.0), (1.9, 1.5, 0.8)]
)
@pytest.mark.parametrize("number", [5, 12, 16])
def test_window_of_a_black_room(point, number):
    """Smooth over the opening, which lies above the point: Gauss' rule is a reference of its own.

    Sills above the horizon, with the sun seen through the opening, beside it and behind.
    """
    for azimuth in (0.0, 20.0, 200.0):
        sky = CIESky(
            number, sun_altitude_deg=40.0, sun_azimuth_deg=azimuth, zenith_luminance_cd_m2=1.0
        )
        expected = through_window(point, UP, sky)
        found = light(point, UP, black_room(), sky, eps=1e-7).sky.illuminance[0]
        # 60 x 60 points leave 1e-5 of the cusp of types with a sun that is seen.
        assert found == pytest.approx(expected, rel=2e-5 if number != 16 else 1e-7)


def test_window_seen_from_a_wall():
    normal = np.array((0.6, 0.8, 0.0))
    sky = CIESky(16, zenith_luminance_cd_m2=1.0)
    found = light((-1.9, -1.0, 0.2), normal, black_room(), sky).sky
    assert found.illuminance[0] == pytest.approx(
        through_window((-1.9, -1.0, 0.2), normal, sky), rel=1e-7
    )


def test_ground_shows_below_the_horizon_of_the_world():
    """Sky and ground through a window make the form factor of the opening."""
    point, normal = (0.3, -1.0, 1.5), (0.0, 1.0, 0.0)
    found = light(point, normal, black_room())
    hole = PatchSet.from_bilinear(
        np.array([[(-1.0, 2, 0.9), (0.7, 2, 0.9), (0.7, 2, 2.4), (-1.0, 2, 2.4)]], float)
    )
    whole = rows(setup(hole), point, normal, trace=False).factors[0, 0]
    assert found.ground.factor[0] > 0.02
    # The matrix of `rows` has single precision.
    assert found.sky.factor[0] + found.ground.factor[0] == pytest.approx(whole, rel=1e-6)


def test_a_slit_of_a_millimetre_is_not_lost():
    """Between two plates 1 mm apart, 2 m above: 1e-3 of a strip, seen from the middle."""
    parts = setup(ceiling(-9, -0.4, -7, 8, 2.0), ceiling(-0.399, 9, -7, 8, 2.0))
    found = light((0, 0, 0), UP, parts).sky.factor[0]
    strip = rows(setup(ceiling(-0.4, -0.399, -7, 8, 2.0)), (0, 0, 0), UP, trace=False)
    around = 1.0 - rows(setup(ceiling(-9, 9, -7, 8, 2.0)), (0, 0, 0), UP, trace=False).factors[0, 0]
    # The slit adds 3e-4 to 0.16, of which six digits are kept.
    assert found - around == pytest.approx(strip.factors[0, 0], rel=2e-3)


def test_plates_that_cross_in_view():
    """Two rectangles at different heights: what they hide together is the sum less the overlap."""
    parts = setup(ceiling(-0.5, 1.0, -0.3, 0.9, 1.0), ceiling(0.4, 4.0, -2.0, 1.0, 2.0))
    # Seen from the origin the second covers (0.2, 2) x (-1, 0.5) of the first's plane.
    factors = [
        rows(setup(ceiling(*outline, 1.0)), (0, 0, 0), UP, trace=False).factors[0, 0]
        for outline in ((-0.5, 1.0, -0.3, 0.9), (0.2, 2.0, -1.0, 0.5), (0.2, 1.0, -0.3, 0.5))
    ]
    found = light((0, 0, 0), UP, parts).sky.factor[0]
    # Single precision of `rows`.
    assert 1.0 - found == pytest.approx(factors[0] + factors[1] - factors[2], abs=2e-7)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.4, 0.1), (3.0, -2.0)])
def test_disc_is_flat_with_a_curved_rim(centre):
    """A disc parallel to the receiver: (1 − (h² + d² − r²)/√((h² + d² + r²)² − 4 r² d²)) / 2."""
    h, r = 1.5, 0.8
    disc = PatchSet.disk((*centre, h), r, (0, 0, -1))
    found = light((0, 0, 0), UP, setup(disc), eps=1e-6)
    d2 = centre[0] ** 2 + centre[1] ** 2
    a = h * h + d2 + r * r
    expected = 0.5 * (1.0 - (h * h + d2 - r * r) / math.sqrt(a * a - 4 * r * r * d2))
    assert found.sky.counters["sky_sectors_traced"] == 0
    # As asked, where the rim is tangent to half-planes too.
    assert 1.0 - found.sky.factor[0] == pytest.approx(expected, abs=2e-6)


def test_curved_surfaces_are_left_to_the_pyramids():
    """A ball at 30° above the horizon: r²/d² sin γ of the sky, in one sector or two."""
    ball = Body(PatchSet.sphere((0.5 * math.sqrt(3) * 2.0, 0.2, 1.0), 0.3))
    found = light((0, 0, 0), UP, setup(ball), cell_eps=1e-6)
    assert 1 <= found.sky.counters["sky_sectors_traced"] <= 2
    d = math.sqrt(3.0 + 0.04 + 1.0)
    # Four standard deviations of what was sampled.
    slack = 4.0 * math.sqrt(found.sky.factor_variance[0])
    assert 1.0 - found.sky.factor[0] == pytest.approx(0.09 / d**2 * 1.0 / d, abs=slack + 1e-7)
    assert slack < 1e-4


def test_error_is_told():
    """Light that is not told to rounding lies within what it says, and more so the finer."""
    sky, points = CIESky(16), np.array([(0.6, 1.2, 0.2), (-1.9, 1.9, 0.1), (1.0, -2.5, 0.4)])
    expected = [light(p, UP, black_room(), sky, eps=1e-10).sky.illuminance[0] for p in points]
    for eps in (1e-2, 1e-4):
        found = light(points, UP, black_room(), sky, eps=eps).sky
        assert (np.abs(found.illuminance - expected) <= 2.0 * found.deviation).all()
        assert (2.0 * found.deviation <= eps * found.illuminance).all()


def test_closed_room_and_receivers_without_share():
    room = setup(Body(PatchSet.box((4, 5, 3), inward=True)))
    found = light([(0, 0, 0), (1.9, 2.4, -1.4)], UP, room)
    assert (found.sky.factor == 0.0).all()
    assert (found.ground.factor == 0.0).all()


@pytest.mark.parametrize("seed", [1, 2])
def test_heap_of_boxes_and_sheets_as_pyramids_see_it(seed):
    """Closed bodies and sheets at random, in view of receivers with any normal."""
    rng = np.random.default_rng(seed)
    bodies = []
    for _ in range(10):
        size, at = rng.uniform(0.2, 1.5, 3), rng.uniform(-3, 3, 3)
        bodies.append(Body(PatchSet.box(size, center=at)))
        corner, a, b = rng.uniform(-3, 3, 3), rng.normal(size=3), rng.normal(size=3)
        sheet = [corner, corner + a, corner + a + b, corner + b]
        bodies.append(PatchSet.from_bilinear(np.array([sheet])))
    parts, sky = setup(*bodies), CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=10.0)
    points, normals = rng.uniform(-4, 4, (6, 3)), rng.normal(size=(6, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Inside a box the fronts of its sides are not seen: such receivers look out through them.
    found = light(points, normals, parts, sky, eps=1e-5)
    for mine, cells, luminance in ((found.sky, SKY, sky), (found.ground, GROUND, 1.0)):
        traced = dome(cells, points, normals, luminance, parts=parts, cell_eps=1e-4)
        # Four standard deviations of what pyramids sample, and their 2 x 2 points at the sun.
        slack = 4.0 * traced.deviation + 1e-3 * traced.illuminance
        assert (np.abs(mine.illuminance - traced.illuminance) <= slack + 1e-6).all()
        assert traced.illuminance.max() > 0.0


def test_receivers_that_curved_surfaces_concern_can_be_left():
    """Elements have their meridians for that: nothing is traced, and those left are named."""
    ball = setup(Body(PatchSet.sphere((2.0, 0.3, 1.0), 0.3)))
    points = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 9.0)])
    receivers = Receivers.of_points(
        points, np.tile([UP], (2, 1)).astype(float), np.ones(2), np.full(2, -1)
    )
    horizon = Horizon(ball.blockers, trace=True)
    found = horizon.light(receivers, None, eps=1e-6, cell_eps=None)
    # From above, the ball lies below the horizon.
    assert found.left.tolist() == [True, False]
    assert found.sky.counters["sky_sectors_traced"] == 0
    assert found.sky.factor[1] == pytest.approx(1.0, abs=1e-9)
