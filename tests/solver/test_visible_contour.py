"""Partly hidden form factors by the contour of what is seen: truths, and proved brackets."""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors
from patchlight.solver.kernels.threads import count_threads, set_threads

from .fixtures_light import UP, ceiling, closed_cylinder, rectangle

LAMP = ceiling(-1.0, 1.0, -0.8, 0.8, 2.0)
CAN = closed_cylinder((0.1, -0.2, 0.7), (0.4, 0.3, 1.1), 0.2).patches
BALL = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
BOX = PatchSet.box((0.5, 0.3, 0.2), (-0.3, 0.2, 1.2))
SHEET = rectangle((-0.6, -0.5, 0.9), (0.5, -0.4, 1.0), (0.6, 0.4, 1.1), (-0.5, 0.5, 1.0))
CONE = PatchSet.concatenated(
    PatchSet.cone((0.0, 0.0, 0.5), (0.0, 0.1, 1.3), 0.4, 0.1),
    PatchSet.disk((0.0, 0.0, 0.5), 0.4, (0.0, -0.1, -0.8)),
    PatchSet.disk((0.0, 0.1, 1.3), 0.1, (0.0, 0.1, 0.8)),
)
GLOBE = PatchSet.sphere((0.3, -0.2, 2.2), 0.5)
TUBE = PatchSet.cylinder((-0.8, 0.0, 2.0), (0.8, 0.1, 2.1), 0.2)
SCENES = {
    "ball": (LAMP, BALL),
    "box": (LAMP, BOX),
    "can": (LAMP, CAN),
    "cone": (LAMP, CONE),
    "open sheet": (LAMP, SHEET),
    "open tube": (LAMP, PatchSet.cylinder((-0.5, 0.0, 1.0), (0.5, 0.2, 1.0), 0.3)),
    "ball before box": (LAMP, PatchSet.concatenated(BALL, BOX)),
    "all": (LAMP, PatchSet.concatenated(BALL, BOX, CAN, SHEET)),
    "globe behind can": (GLOBE, CAN),
    "tube behind ball and box": (TUBE, PatchSet.concatenated(BALL, BOX)),
    "saddle behind ball": (
        PatchSet.from_bilinear(
            np.array([[(-1, -1, 2.0), (-1, 1, 2.2), (1, 1, 2.0), (1, -1, 2.2)]], dtype=float)
        ),
        BALL,
    ),
}


def receivers(count, seed):
    """Points below everything, looking up and askew."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1.2, 1.2, (count, 2)), rng.uniform(-0.5, 0.2, count)])
    normals = np.column_stack([rng.normal(0.0, 0.9, (count, 2)), np.ones(count)])
    return points, normals


def found(points, normals, sources, blockers, accuracy=1e-5):
    return point_form_factors(points, normals, sources, blockers, accuracy=accuracy)


@pytest.mark.parametrize("name", SCENES)
def test_lies_in_proved_brackets(name):
    """No shadow is lost and none invented."""
    sources, blockers = SCENES[name]
    points, normals = receivers(24, len(name))
    clear = point_form_factors(points, normals, sources, accuracy=1e-4, visibility="none")
    value = found(points, normals, sources, blockers, accuracy=1e-4)
    # Brackets that narrow take a second for all points.
    proof = point_form_factors(
        points, normals, sources, blockers, accuracy=3e-3, visibility="strict"
    )
    assert (value.high >= proof.low - 1e-12).all()
    assert (value.low <= proof.high + 1e-12).all()
    assert (value.value < 0.99 * clear.value).any()
    # Curves that nearly touch are left to brackets.
    partly = ((value.value > 0.0) & (value.value < clear.value * (1.0 - 1e-9))).sum()
    assert value.counters["pairs_by_contour"] >= 0.98 * partly


def test_ball_before_disk_is_their_difference():
    """On the axis the hidden part is a disk too: F = R²/(R² + h²) less the sine² of the ball."""
    disk = PatchSet.disk((0.0, 0.0, 2.0), 1.0, (0.0, 0.0, -1.0))
    ball = PatchSet.sphere((0.0, 0.0, 1.0), 0.3)
    value = found([(0.0, 0.0, 0.0)], UP, disk, ball, accuracy=1e-10)
    # Quadrature to a tenth of the accuracy asked for.
    assert value.value.sum() == pytest.approx(1.0 / 5.0 - 0.3**2, abs=1e-11)


def test_two_halves_of_a_sheet_leak_nothing():
    """Two rectangles that share an edge hide exactly as one does."""
    whole = rectangle((-0.5, -0.5, 1.0), (0.5, -0.5, 1.0), (0.5, 0.5, 1.0), (-0.5, 0.5, 1.0))
    halves = PatchSet.concatenated(
        rectangle((-0.5, -0.5, 1.0), (0.1, -0.5, 1.0), (0.1, 0.5, 1.0), (-0.5, 0.5, 1.0)),
        rectangle((0.1, -0.5, 1.0), (0.5, -0.5, 1.0), (0.5, 0.5, 1.0), (0.1, 0.5, 1.0)),
    )
    points, normals = receivers(30, 5)
    one = found(points, normals, LAMP, whole)
    two = found(points, normals, LAMP, halves)
    assert two.counters["pairs_by_contour"] == one.counters["pairs_by_contour"] > 0
    np.testing.assert_allclose(two.value, one.value, rtol=0, atol=1e-14)


def test_halves_that_are_not_neighbours_leak_nothing():
    """The shared edge stands in two sheets of different division: both sides of it are hidden."""
    whole = rectangle((-0.5, -0.5, 1.0), (0.5, -0.5, 1.0), (0.5, 0.5, 1.0), (-0.5, 0.5, 1.0))
    parts = PatchSet.concatenated(
        rectangle((-0.5, -0.5, 1.0), (0.1, -0.5, 1.0), (0.1, 0.5, 1.0), (-0.5, 0.5, 1.0)),
        rectangle((0.1, -0.5, 1.0), (0.5, -0.5, 1.0), (0.5, 0.2, 1.0), (0.1, 0.2, 1.0)),
        rectangle((0.1, 0.2, 1.0), (0.5, 0.2, 1.0), (0.5, 0.5, 1.0), (0.1, 0.5, 1.0)),
    )
    points, normals = receivers(30, 6)
    one = found(points, normals, LAMP, whole)
    three = found(points, normals, LAMP, parts)
    # Where the edges meet, other methods may be asked: to the accuracy asked for.
    np.testing.assert_allclose(three.value, one.value, rtol=0, atol=1e-6)
    assert three.counters["pairs_by_contour"] > 0


def test_adding_a_blocker_never_adds_light():
    points, normals = receivers(40, 7)
    less = found(points, normals, LAMP, PatchSet.concatenated(BALL, BOX))
    more = found(points, normals, LAMP, PatchSet.concatenated(BALL, BOX, SHEET))
    assert (more.value <= less.value + 1e-12).all()
    assert (more.value < less.value - 1e-4).any()


def test_thin_pole():
    """A pole of a tenth of a millimetre hides the strip it covers, to the second order of it."""
    radius = 5e-5
    pole = closed_cylinder((0.0, -3.0, 1.0), (0.0, 3.0, 1.0), radius).patches
    value = found([(0.0, 0.0, 0.0)], UP, LAMP, pole, accuracy=1e-9)
    clear = found([(0.0, 0.0, 0.0)], UP, LAMP, None, accuracy=1e-9)
    # At β from the zenith in the plane x = 0 the pole is 2 r cos β wide as an angle, and
    # dF = cos β · 2 r cos β dβ / π.
    edge = math.atan(0.8 / 2.0)
    strip = 2.0 * radius / math.pi * (edge + math.sin(edge) * math.cos(edge))
    assert value.counters["pairs_by_contour"] == 1
    assert (clear.value - value.value).sum() == pytest.approx(strip, rel=1e-6)


def test_below_the_horizon_hides_nothing_and_is_not_seen():
    """A receiver that stands on edge: the horizon cuts lamp and ball."""
    value = found([(0.1, 0.1, 0.0)], [(1.0, 0.2, 0.1)], LAMP, BALL, accuracy=1e-8)
    proof = point_form_factors(
        [(0.1, 0.1, 0.0)], [(1.0, 0.2, 0.1)], LAMP, BALL, accuracy=1e-5, visibility="strict"
    )
    assert value.counters["pairs_by_contour"] == 1
    assert proof.low[0, 0] <= value.value[0, 0] <= proof.high[0, 0]


def test_moving_the_scene_changes_nothing():
    turn = np.eye(4)
    turn[:3, :3] = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    if np.linalg.det(turn[:3, :3]) < 0.0:
        turn[:3, 0] *= -1.0
    turn[:3, 3] = (10.0, -20.0, 5.0)
    points, normals = receivers(20, 8)
    sources, blockers = SCENES["ball before box"]
    here = found(points, normals, sources, blockers)
    there = found(
        points @ turn[:3, :3].T + turn[:3, 3],
        normals @ turn[:3, :3].T,
        sources.moved(turn),
        blockers.moved(turn),
    )
    # Rounding of coordinates of size 20, at grazing curves.
    np.testing.assert_allclose(there.value, here.value, rtol=0, atol=1e-9)


def test_threads_change_no_bit():
    points, normals = receivers(40, 9)
    sources, blockers = SCENES["all"]
    before = set_threads(1)
    try:
        one = found(points, normals, sources, blockers).value
        set_threads(2)
        if count_threads() < 2:
            pytest.skip("one thread only")
        two = found(points, normals, sources, blockers).value
    finally:
        set_threads(before)
    assert np.array_equal(one, two)


def test_sources_hidden_by_each_other():
    """Two sources, one before the other: each hides, and is seen."""
    near = ceiling(-0.3, 0.3, -0.3, 0.3, 1.0)
    both = PatchSet.concatenated(LAMP, near)
    points, normals = receivers(20, 10)
    value = found(points, normals, both, None)
    apart = found(points, normals, LAMP, near)
    np.testing.assert_allclose(value.value[:, 0], apart.value[:, 0], rtol=0, atol=1e-9)
    alone = found(points, normals, near, None)
    np.testing.assert_allclose(value.value[:, 1], alone.value[:, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("first", [0, 1, 5])
def test_body_on_the_source_in_any_order(first):
    """A frustum whose wide end lies in the lamp's plane: that end hides nothing, its edges do."""
    low = np.array([(-0.1, -0.1, 1.7), (0.1, -0.1, 1.7), (0.1, 0.1, 1.7), (-0.1, 0.1, 1.7)])
    high = low * (3.0, 3.0, 0.0) + (0.0, 0.0, 2.0)
    sides = [(low[k], low[k - 3], high[k - 3], high[k]) for k in range(4)]
    faces = [high, low[::-1], *sides]
    frustum = PatchSet.from_bilinear(np.array(faces[first:] + faces[:first]))
    value = found([(0.0, 0.0, 0.0)], UP, LAMP, frustum, accuracy=1e-9)
    # What is hidden is what its wide end covers.
    hidden = found([(0.0, 0.0, 0.0)], UP, ceiling(-0.3, 0.3, -0.3, 0.3, 2.0), None, accuracy=1e-9)
    clear = found([(0.0, 0.0, 0.0)], UP, LAMP, None, accuracy=1e-9)
    assert value.value.sum() == pytest.approx(clear.value.sum() - hidden.value.sum(), abs=1e-8)


def test_receiver_on_a_hollow_wall_that_hides_the_source():
    """One quarter of a tube: its far part stands before a plate that is behind it."""
    wall = PatchSet.cylinder((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 1.0, inward=True).take([0])
    a = math.radians(5.0)
    x, n = (math.cos(a), math.sin(a), 0.0), (-math.cos(a), -math.sin(a), 0.0)
    plate = rectangle((0.3, 1.2, -0.2), (0.3, 1.2, 0.2), (0.6, 1.2, 0.2), (0.6, 1.2, -0.2))
    value = found([x], [n], plate, wall, accuracy=1e-3)
    apart = found([(0.9999 * x[0], 0.9999 * x[1], 0.0)], [n], plate, wall, accuracy=1e-3)
    assert value.value.sum() == pytest.approx(apart.value.sum(), abs=1e-6)
    assert value.counters["pairs_by_contour"] == 0


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-6, 1e-7])
def test_narrow_slit(gap):
    """Light through a slit between two sheets: width 2 g / h² at the middle, to first order."""
    sheets = PatchSet.concatenated(
        rectangle((-3, -3, 1), (-0.5 * gap, -3, 1), (-0.5 * gap, 3, 1), (-3, 3, 1)),
        rectangle((0.5 * gap, -3, 1), (3, -3, 1), (3, 3, 1), (0.5 * gap, 3, 1)),
    )
    value = found([(0.0, 0.0, 0.0)], UP, LAMP, sheets, accuracy=1e-9)
    edge = math.atan(0.8 / 2.0)
    # In the plane x = 0, dF = cos β · g cos β dβ / π.
    strip = gap / math.pi * (edge + math.sin(edge) * math.cos(edge))
    assert value.low.sum() <= strip * (1.0 + gap) + 1e-13
    assert value.high.sum() >= strip * (1.0 - gap) - 1e-13
    assert value.value.sum() == pytest.approx(strip, rel=1e-2)


def test_blockers_that_touch_the_source_are_left_to_others():
    """A rod through the lamp is neither before nor beyond it; the result holds all the same."""
    rod = PatchSet.box((0.2, 0.2, 1.0), (0.0, 0.0, 2.0))
    value = found([(0.3, 0.2, 0.0)], UP, LAMP, rod, accuracy=1e-3)
    proof = point_form_factors([(0.3, 0.2, 0.0)], UP, LAMP, rod, accuracy=1e-3, visibility="strict")
    assert value.counters["pairs_by_contour"] == 0
    assert abs(value.value.sum() - proof.value.sum()) <= 2e-3 * proof.value.sum()
