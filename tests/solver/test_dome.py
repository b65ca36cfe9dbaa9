"""Sky, ground and sun as sources at infinity: levels, tilts, closed forms, openings."""

import math

import numpy as np
import pytest
from patchlight.solver.dome import dome_cells, sun_cells
from patchlight.solver.model import CIESky, PatchSet, Sun
from patchlight.solver.model.sky import direction
from patchlight.solver.skies import relative_luminance

from .fixtures_light import UP, Body, ceiling, dome, rows, setup

SKY = dome_cells(0.0, 90.0)
GROUND = dome_cells(-90.0, 0.0)
SKY_AND_GROUND = np.concatenate([SKY, GROUND])
ORIGIN = (0.0, 0.0, 0.0)
TILTS = np.radians([0.0, 1.0, 30.0, 45.0, 60.0, 89.0, 90.0, 91.0, 135.0, 179.0, 180.0])
#: Sky and ground meet in circles, integrated to the accuracy asked, 1e-9.
CIRCLES = 1e-8


def tilted(angles, azimuth=0.4):
    a = np.asarray(angles)
    return np.stack(
        [np.sin(a) * math.sin(azimuth), np.sin(a) * math.cos(azimuth), np.cos(a)], axis=-1
    )


def illuminances(sky, normals, n=800):
    """Illuminance for luminance L / L_z on ``normals`` (m, 3): midpoints over the hemisphere."""
    z = (np.arange(n) + 0.5) / n  # equal steps of sin(altitude) are equal solid angles
    phi = 2 * math.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    z, phi = np.meshgrid(z, phi, indexing="ij")
    r = np.sqrt(1 - z * z)
    d = np.stack([r * np.sin(phi), r * np.cos(phi), z], axis=-1).reshape(-1, 3)
    values = relative_luminance(sky, d)
    return (
        np.array([(values * np.maximum(d @ normal, 0)).mean() for normal in normals]) * 2 * math.pi
    )


def test_uniform_sky_at_every_tilt():
    normals = tilted(TILTS)
    found = dome(SKY, np.zeros((len(TILTS), 3)), normals).factor
    np.testing.assert_allclose(found, 0.5 * (1 + np.cos(TILTS)), atol=CIRCLES)


def test_uniform_ground_at_every_tilt():
    found = dome(GROUND, np.zeros((len(TILTS), 3)), tilted(TILTS)).factor
    np.testing.assert_allclose(found, 0.5 * (1 - np.cos(TILTS)), atol=CIRCLES)


def test_sky_and_ground_of_one_luminance_are_all_there_is():
    rng = np.random.default_rng(1)
    found = dome(SKY_AND_GROUND, np.zeros((20, 3)), rng.normal(size=(20, 3)), 100.0)
    # The contours of the two cancel on the horizon, and are exact beyond it: rounding.
    np.testing.assert_allclose(found.illuminance, 100.0 * math.pi, rtol=1e-13)


def test_place_in_the_scene_does_not_matter():
    points = [(0, 0, 0), (1e3, -2e3, 50.0), (1e-6, 0, 1e5)]
    found = dome(SKY, points, (0.6, 0.0, 0.8)).factor
    np.testing.assert_allclose(found, 0.9, atol=CIRCLES)


def test_overcast_vertical_over_horizontal():
    """3/14 + 4/(7π), the classical ratio of the traditional overcast sky."""
    found = dome(SKY, np.zeros((2, 3)), [UP, (0, 1, 0)], CIESky(16)).illuminance
    # 2 x 2 points in cells of 8 degrees: (0.07)⁴ / 30 of a luminance that varies threefold.
    assert found[1] / found[0] == pytest.approx(3 / 14 + 4 / (7 * math.pi), abs=2e-6)


@pytest.mark.parametrize("number", range(1, 17))
def test_level_on_the_horizontal(number):
    """Cells of 8 degrees with 2 x 2 points: 5e-4 where the sky peaks at the sun, else 1e-5."""
    for altitude in (15.0, 45.0, 75.0):
        sky = CIESky(
            number,
            sun_altitude_deg=altitude,
            sun_azimuth_deg=130.0,
            diffuse_illuminance_lx=12_000.0,
        )
        found = dome(SKY, ORIGIN, UP, sky).illuminance[0]
        tolerance = 5e-4 if sky.needs_sun else 1e-5
        assert found == pytest.approx(12_000.0, rel=tolerance)


@pytest.mark.parametrize("number", [2, 6, 9, 12, 15])
def test_peaked_skies_on_tilted_planes(number):
    sky = CIESky(number, sun_altitude_deg=35.0, sun_azimuth_deg=60.0, zenith_luminance_cd_m2=1.0)
    normals = tilted(np.radians([20.0, 60.0, 90.0]), azimuth=math.radians(80.0))
    found = dome(SKY, np.zeros((3, 3)), normals, sky).illuminance
    # As on the horizontal.
    np.testing.assert_allclose(found, illuminances(sky, normals), rtol=5e-4)


@pytest.mark.parametrize("altitude", [5.0, 40.0, 89.9, 90.0])
def test_sun_on_planes_that_see_all_of_it(altitude):
    """E = E_n cos θ, whatever the disk's size."""
    sun = Sun(altitude, 215.0, 80_000.0)
    luminance = 80_000.0 / (math.pi * math.sin(math.radians(16 / 60)) ** 2)
    s = np.array(direction(altitude, 215.0))
    for normal in (s, np.array(UP), (s + np.array(UP)) / np.linalg.norm(s + np.array(UP))):
        found = dome(sun_cells(sun), ORIGIN, normal, luminance).illuminance[0]
        # As asked of the contour.
        assert found == pytest.approx(80_000.0 * float(s @ normal), rel=1e-9)


def test_sun_on_grazing_planes():
    """Planes that the disk is seen from at a degree above the horizon."""
    sun = Sun(30.0, 0.0, 1.0)
    s = np.array(direction(30.0, 0.0))
    across = np.array([1.0, 0.0, 0.0])
    angles = np.radians([0.5, 1.0, 2.0, 3.0])
    normals = np.sin(angles)[:, None] * s + np.cos(angles)[:, None] * across
    found = dome(sun_cells(sun), np.zeros((4, 3)), normals).factor
    expected = math.sin(math.radians(16 / 60)) ** 2 * np.sin(angles)
    np.testing.assert_allclose(found, expected, rtol=1e-9)  # as asked of the contour


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1, 2.0])
def test_half_of_the_sun_behind_a_straight_edge(turn):
    """An edge through the centre of the disk, at any angle, hides half of it."""
    sun = Sun(50.0, 20.0, 1.0)
    s = np.array(direction(50.0, 20.0))
    e1 = np.cross(s, UP) / np.linalg.norm(np.cross(s, UP))
    e2 = np.cross(s, e1)
    along = math.cos(turn) * e1 + math.sin(turn) * e2
    across = np.cross(s, along)
    a, b = 3 * s - 5 * along, 3 * s + 5 * along
    sheet = PatchSet.from_bilinear(np.array([[a, b, b + 5 * across, a + 5 * across]]))
    disk = math.sin(math.radians(16 / 60)) ** 2
    found = dome(sun_cells(sun), ORIGIN, s, parts=setup(sheet), cell_eps=1e-4 * disk).factor[0]
    # A hundred cells of 1e-4 of the disk on the edge, each sampled with a deviation of 0.2, are off
    # by 2e-4 together: 2.5 times that.
    assert found == pytest.approx(0.5 * disk, abs=5e-4 * disk)


@pytest.mark.parametrize("distance", [-1.0, -0.5, 0.2, 0.7])
def test_penumbra_is_a_circular_segment(distance):
    """Share of a disk beyond a chord at ``distance`` radii: (acos t − t √(1 − t²)) / π."""
    sun = Sun(90.0, 0.0, 1.0)
    radius = math.tan(math.radians(16 / 60))
    edge = distance * radius * 2.0
    sheet = ceiling(-1, edge, -1, 1, 2.0)
    disk = math.sin(math.radians(16 / 60)) ** 2
    found = dome(sun_cells(sun), ORIGIN, UP, parts=setup(sheet), cell_eps=1e-4 * disk).factor[0]
    expected = (math.acos(distance) - distance * math.sqrt(1 - distance**2)) / math.pi
    # As above.
    assert found == pytest.approx(expected * disk, abs=5e-4 * disk)


def test_sun_behind_a_wall_is_dark():
    sun = Sun(30.0, 0.0, 1.0)
    wall = Body(PatchSet.box((10, 0.2, 10), center=(0, 3, 5)))
    found = dome(sun_cells(sun), (0, 0, 0.5), UP, parts=setup(wall))
    assert found.factor[0] == 0.0


def window_wall(x0, x1, z0, z1, *, y=2.0, thick=1e-3, far=30.0):
    """A thin wall with a hole: four closed boxes side by side."""

    def piece(a, b, c, d):
        size = (b - a, thick, d - c)
        return Body(PatchSet.box(size, center=(0.5 * (a + b), y + 0.5 * thick, 0.5 * (c + d))))

    return setup(
        piece(-far, x0, -far, far),
        piece(x1, far, -far, far),
        piece(x0, x1, -far, z0),
        piece(x0, x1, z1, far),
    )


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.8, -1.0, 0.3), (-2.0, 1.0, 0.8)])
@pytest.mark.parametrize("normal", [UP, (0.0, 1.0, 0.0), (0.3, 0.4, 0.8)])
def test_window_is_the_factor_of_its_opening(point, normal):
    """A uniform sky through a hole: the form factor of the hole as a luminous rectangle.

    The wall ends at 30 m and the point looks past it nowhere above the horizon: its own half space
    behind is closed by a box.
    """
    wall = window_wall(-1.0, 0.7, 0.9, 2.4)
    back = Body(PatchSet.box((60, 0.2, 60), center=(0, -10, 0)))
    roof = Body(PatchSet.box((60, 12.3, 0.2), center=(0, -4.0, 20.0)))
    sides = [Body(PatchSet.box((0.2, 12.3, 60), center=(x, -4.0, 0))) for x in (-25, 25)]
    parts = type(wall)(
        PatchSet.concatenated(
            wall.patches, back.patches, roof.patches, *(s.patches for s in sides)
        ),
        np.ones(48, bool),
        np.repeat(np.arange(8), 6),
    )
    hole = PatchSet.from_bilinear(
        np.array([[(-1.0, 2, 0.9), (0.7, 2, 0.9), (0.7, 2, 2.4), (-1.0, 2, 2.4)]], float)
    )
    outer = hole.moved((0.0, 1e-3, 0.0))
    found = dome(SKY, point, normal, parts=parts, cell_eps=1e-5)
    sees = [
        rows(setup(opening), point, normal, trace=False).factors[0, 0] for opening in (hole, outer)
    ]
    # Between the factors of the two sides of the 1 mm thick hole, reduced by its reveal.
    slack = 4.0 * found.deviation[0] / math.pi + 2e-4
    assert min(sees) - 1e-3 * max(sees) - slack <= found.factor[0] <= max(sees) + slack


def test_closed_room_sees_no_sky():
    room = Body(PatchSet.box((4, 5, 3), inward=True))
    found = dome(SKY_AND_GROUND, [(0, 0, 0), (1.9, 2.4, -1.4)], UP, parts=setup(room))
    assert (found.factor == 0.0).all()


def test_what_is_hidden_and_what_is_seen_make_a_hemisphere():
    """Factors of a ball and a block, and of the sky and ground past them, add up to one."""
    parts = setup(
        Body(PatchSet.sphere((1.0, 0.5, 1.0), 0.6)),
        Body(PatchSet.box((1.0, 1.0, 2.0), center=(-1.5, 0.3, 0.5))),
    )
    points = np.array([(0, 0, 0), (0.2, -1, 0.5), (2.5, 0, 1.0)])
    normals = np.array([UP, (0.6, 0.8, 0), (-1, 0, 0.2)])
    own = rows(parts, points, normals, cell_eps=1e-4)
    far = dome(SKY_AND_GROUND, points, normals, parts=parts, cell_eps=1e-4)
    total = own.factors.sum(axis=1) + far.factor
    noise = np.hypot(np.sqrt(own.variances.sum(axis=1, dtype=float)), far.deviation / math.pi)
    assert (np.abs(total - 1.0) <= 4.0 * noise + 1e-3).all()
