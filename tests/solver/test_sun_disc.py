"""The sun's disc past flat surfaces: exact, against closed forms, quadrature, and the pyramids."""

import numpy as np
import pytest
from patchlight.pipeline import PatchSet, Scene, SensorGrid
from patchlight.solver.budget import Budget
from patchlight.solver.dome_grid import dome_grid
from patchlight.solver.model.sky import direction
from patchlight.solver.open_sky import OpenSky
from patchlight.solver.sun_disc import straight_sided
from patchlight.solver.sun_light import RADIUS_ARCMIN, SunLight
from patchlight.solver.topology import make_blockers

UP = (0.0, 0.0, 1.0)
RADIUS = np.tan(np.radians(RADIUS_ARCMIN / 60.0))


def frozen_scene(patches, points=((0.0, 0.0, 0.0),), normals=UP):
    scene = Scene()
    scene.add(patches, "body", two_sided=True)
    scene.add(SensorGrid(points, normals, name="points"))
    return scene.freeze()


def sun_light(patches, points, normals=UP, accuracy=0.01):
    points = np.asarray(points, float).reshape(-1, 3)
    normals = np.broadcast_to(normals, points.shape)
    data = frozen_scene(patches, points, normals)
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    sky = OpenSky(data, blockers, trace=True)
    return SunLight(sky, Budget.of(data, accuracy, "bilinear"), points, normals)


def sheet(*corners):
    return PatchSet.from_bilinear(np.array([corners], float))


def cut_disc(height):
    """Share of a disc on the side of a line at ``height`` radii from its middle."""
    h = np.clip(height, -1.0, 1.0)
    return 0.5 + (np.arcsin(h) + h * np.sqrt(1.0 - h * h)) / np.pi


def test_penumbra_of_a_straight_edge():
    """Below a far wide sheet with an edge at x = 0 the share is that of a disc cut by a line."""
    roof = sheet((-50, -50, 10), (0, -50, 10), (0, 50, 10), (-50, 50, 10))
    height = np.linspace(-1.2, 1.2, 41)
    points = np.stack([10.0 * RADIUS * height, np.zeros(41), np.zeros(41)], axis=1)
    found = sun_light(roof, points).light(np.array([90.0]), np.array([0.0]))[:, 0]
    np.testing.assert_allclose(found, cut_disc(height), atol=2e-5)


def test_corner_slat_and_overlapping_sheets_by_counting():
    """Any arrangement, against half a million places on the disc that are counted."""
    sheets = PatchSet.concatenated(
        sheet((-5, -5, 10), (0.02, -5, 10), (0.01, 0.005, 10), (-5, 0.015, 10)),
        sheet((-0.01, -5, 8), (0.005, -5, 8), (-0.004, 5, 8), (-0.016, 5, 8)),
        sheet((0.0, 0.01, 9), (5, 0.02, 9), (5, 0.03, 9), (0.0, 0.018, 9)),
    )
    light = sun_light(sheets, [(0, 0, 0), (0.003, -0.004, 0.1)])
    altitude, azimuth = np.array([90.0, 89.95, 89.9]), np.array([0.0, 40.0, 200.0])
    found = light.light(altitude, azimuth)
    assert light.traced == 0
    n = 500_000
    turn, far = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n), np.sqrt((np.arange(n) + 0.5) / n)
    for k in range(3):
        s = np.array(direction(altitude[k], azimuth[k]))
        e1 = np.cross(s, (0.0, 1.0, 0.0))
        e1 /= np.linalg.norm(e1)
        e2 = np.cross(s, e1)
        d = s + RADIUS * ((far * np.cos(turn))[:, None] * e1 + (far * np.sin(turn))[:, None] * e2)
        for i, point in enumerate(light.points):
            hidden = np.zeros(n, bool)
            for net in sheets.control_points:
                corners = net[[0, 3, 3, 0], [0, 0, 3, 3], :3] - point
                at = d * (corners[0, 2] / d[:, 2:])
                inside = np.ones(n, bool)
                for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                    side = (b - a)[0] * (at - a)[:, 1] - (b - a)[1] * (at - a)[:, 0]
                    inside &= side > 0.0
                hidden |= inside
            expected = (~hidden).mean() * s[2]
            assert 0.05 < expected < 0.95
            assert found[i, k] == pytest.approx(expected, abs=2e-4)


def test_the_same_as_traced():
    """A slit seen as a whole and in part, against pyramids with small cells."""
    slit = PatchSet.concatenated(
        sheet((-1, 0, 0), (1, 0, 0), (1, 0, 0.9), (-1, 0, 0.9)),
        sheet((-1, 0, 2.0), (1, 0, 2.0), (1, 0, 3.0), (-1, 0, 3.0)),
    )
    level = 0.9 - 2.0 / np.cos(np.radians(10.0)) * np.tan(np.radians(30.0))
    points = [(0, 2, level - 0.008), (0, 2, level), (0, 2, level + 0.006), (0, 2, level + 0.5)]
    light = sun_light(slit, points, accuracy=0.02)
    found = light.light(np.array([30.0]), np.array([190.0]))[:, 0]
    traced = light._traced(np.arange(4), 30.0, 190.0)
    np.testing.assert_allclose(found, traced, atol=5e-3)
    assert 0.05 < found[0] < found[1] < found[2] < found[3] == pytest.approx(0.5)


def test_own_horizon_and_below_it():
    free = sheet((5, 5, -9), (6, 5, -9), (6, 6, -9), (5, 6, -9))
    light = sun_light(free, [(0, 0, 0)])
    found = light.light(np.array([30.0, 0.0, -1.0]), np.array([10.0, 0.0, 0.0]))[0]
    assert found[0] == pytest.approx(0.5, rel=1e-12)
    # Half of the disc, its middle of gravity 4 r / (3 π) above the horizon.
    assert found[1] == pytest.approx(0.5 * 4.0 / (3.0 * np.pi) * RADIUS, rel=1e-4)
    assert found[2] == 0.0


def test_curved_surfaces_are_traced():
    ball = PatchSet.sphere((0, 0, 5.0), 1.0)
    points = np.stack([np.linspace(0.9, 1.1, 30), np.zeros(30), np.zeros(30)], axis=1)
    light = sun_light(ball, points)
    found = light.light(np.array([90.0]), np.array([0.0]))[:, 0]
    assert light.traced > 0
    assert found[0] == 0.0
    assert found[-1] == pytest.approx(1.0, abs=1e-4)
    assert (np.diff(found) >= -5e-3).all()


def test_which_surfaces_have_straight_sides():
    twisted = ((0, 0, 0), (1, 0, 0), (1, 1, 0.2), (0, 1, 0))
    sets = [
        sheet((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        sheet((0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0)),  # a triangle
        sheet((0, 0, 0), (1, 0, 0), (0.2, 0.2, 0), (0, 1, 0)),  # a dart
        sheet(*twisted),
        PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0),
    ]
    for patches, expected in zip(sets, (True, True, False, False, False), strict=True):
        data = frozen_scene(patches)
        blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
        assert straight_sided(blockers).tolist() == [expected] * len(patches)


def test_sky_that_is_lost_counts_as_off_by_all_of_it():
    """A receiver that no direction is found for, though it is said to see some sky."""
    roof = sheet((-500, -500, 1), (500, -500, 1), (500, 500, 1), (-500, 500, 1))
    data = frozen_scene(roof)
    blockers = make_blockers(data.patches, data.closed, data.patches.part_index)
    sky, up = OpenSky(data, blockers, trace=True), np.array([UP, UP])
    free = np.array([(0.0, 0.0, 2.0), (3.0, 0.0, 2.0)])
    under = np.array([(0.0, 0.0, 2.0), (0.0, 0.0, 1.0 - 1e-3)])
    grid = dome_grid(2)
    assert sky.seen(free, up, grid, np.full(2, np.pi)).scaled < 0.02
    found = sky.seen(under, up, grid, np.array([np.pi, 0.1]))
    assert found.lost.tolist() == [False, True]
    assert found.scaled == pytest.approx(np.sqrt(0.5), rel=1e-3)
