"""Form factors of nets that are hardly surfaces, of wide arcs, and of shells given either way.

Closed forms of flat sources are sums over their edges, as in `test_stress_form_factors`; its
tolerances hold here too.
"""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, form_factors, point_form_factors
from patchlight.solver.errors import GeometryError, InputError

from .fixtures_light import UP, ceiling, closed_cylinder
from .test_stress_form_factors import LAMP, ORIGIN, WAYS, factor, polygon, total

# --- weights


@pytest.mark.parametrize("weight", [0.0, -1e-300, -1.0, math.nan])
def test_weights_that_are_not_positive_are_refused(weight):
    """A single one among many, by the number of its patch where there is one."""
    nets = PatchSet.concatenated(LAMP, LAMP, LAMP).control_points.copy()
    nets[1, 2, 3, 3] = weight
    with pytest.raises(GeometryError, match="patch 1"):
        PatchSet(nets)
    weights = np.ones((3, 4, 4))
    weights[1, 2, 3] = weight
    with pytest.raises(GeometryError, match="positive"):
        PatchSet.from_bezier(nets[..., :3], weights)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_control_points_that_are_not_finite_are_refused(value):
    nets = PatchSet.concatenated(LAMP, LAMP).control_points.copy()
    nets[1, 0, 0, 1] = value
    with pytest.raises(GeometryError, match="patch 1"):
        PatchSet(nets)
    with pytest.raises(InputError, match="control_points"):
        PatchSet.from_bezier(nets[..., :3])


# --- patches without area


def point_patch(place):
    return PatchSet.from_bezier(np.broadcast_to(np.array(place, float), (1, 4, 4, 3)).copy())


def line_patch():
    """All columns alike: a curve before the lamp."""
    net = np.zeros((4, 4, 3))
    net[:, :, 0] = np.linspace(-0.5, 0.5, 4)[:, None]
    net[:, :, 2] = np.array([1.0, 1.2, 1.2, 1.0])[:, None]
    return PatchSet.from_bezier(net[None])


NOTHING = {
    "before the lamp": point_patch((0.3, 0.2, 1.0)),
    "on the lamp": point_patch((0.3, 0.2, 2.0)),
    "on a corner of the lamp": point_patch((1.5, 1.5, 2.0)),
    "in the horizon": point_patch((1.0, 0.0, 0.0)),
    "on the receiver": point_patch(ORIGIN),
    "curve": line_patch(),
}


@pytest.mark.parametrize("visibility", ["strict", "auto", "none"])
@pytest.mark.parametrize("name", NOTHING)
def test_what_has_no_area_gives_no_light(name, visibility):
    """Alone, and among others, whose factors it leaves alone."""
    patch = NOTHING[name]
    alone = factor(patch, visibility=visibility)
    # No accuracy is asked below 1e-12.
    assert np.isfinite(alone.value).all() and 0.0 <= alone.value[0, 0] <= 1e-15
    assert alone.low[0, 0] == 0.0 and alone.high[0, 0] <= 1e-12
    ball = PatchSet.sphere((0.1, 0.0, 1.2), 0.3)
    others = factor(PatchSet.concatenated(LAMP, ball), visibility=visibility, accuracy=1e-3)
    every = factor(PatchSet.concatenated(LAMP, patch, ball), visibility=visibility, accuracy=1e-3)
    assert np.isfinite(every.value).all() and 0.0 <= every.value[0, 1] <= 1e-15
    # Behind it the contour may not close, and other methods be asked: to the accuracy asked.
    np.testing.assert_allclose(np.delete(every.value, 1, axis=1), others.value, rtol=1e-3)


@WAYS
@pytest.mark.parametrize("name", NOTHING)
def test_what_has_no_area_hides_nothing(name, visibility):
    found = factor(LAMP, NOTHING[name], visibility=visibility)
    assert np.isfinite(found.value).all()
    # What is seen may be found along its contour once more: to the accuracy asked.
    assert found.value.sum() == pytest.approx(total(LAMP), rel=1e-9)
    assert found.low.sum() - 1e-12 <= total(LAMP) <= found.high.sum() + 1e-12


@pytest.mark.parametrize("name", NOTHING)
def test_elements_without_area(name):
    """Refused, or, where rounding gives them a normal, of no weight to others."""
    try:
        found = form_factors(PatchSet.concatenated(LAMP, NOTHING[name]))
    except GeometryError as error:
        assert "patch 1" in str(error)
    else:
        assert np.isfinite(found.value).all() and found.value[:4].max() <= 1e-12


@pytest.mark.parametrize("visibility", ["strict", "auto", "none"])
def test_a_single_patch_with_a_pole_seen_from_itself(visibility):
    """The side that is one point has no neighbour; every point inside an octant sees 1/8."""
    octant = PatchSet.sphere((0, 0, 0), 1.0, inward=True).take([0])
    for u, v in ((0.4, 0.6), (0.0, 0.5), (0.999, 0.5)):
        found = point_form_factors(
            octant.evaluate(u, v)[0], octant.normals(u, v)[0], octant, visibility=visibility
        )
        # The share of a curved contour about its receiver: to 1e-4 of it, as is the default.
        assert found.value[0, 0] == pytest.approx(0.125, rel=1e-4)


# --- Bézier nets


def cusped(scale, z):
    """Flat patch (1, 4, 4, 3) whose edge v = 0 comes to a stop, and goes back, at u = 1/2."""
    net = np.empty((1, 4, 4, 3))
    f = np.arange(4) / 3.0
    x0, y0 = np.array([-1.0, 1.0, -1.0, 1.0]), np.array([-0.4, 0.6, 0.6, -0.4])
    net[0, :, :, 0] = np.outer(x0, 1 - f) + np.outer(np.linspace(-1.0, 1.0, 4), f)
    net[0, :, :, 1] = np.outer(y0, 1 - f) + f
    net[..., :2] *= scale
    net[..., 2] = z
    return net


def below_cusp(scale, z):
    """Its factor from the origin: a polygon of 20 000 corners, which lacks 1e-9."""
    t = np.linspace(0.0, 1.0, 20_001)
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    edge = basis @ cusped(scale, z)[0, :, 0]
    return polygon(*edge, (scale, scale, z), (-scale, scale, z))


@pytest.mark.parametrize("visibility", ["strict", "auto", "none"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
def test_an_edge_with_a_cusp(accuracy, visibility):
    source = PatchSet.from_bezier(cusped(1.0, 2.0)).flipped()
    found = total(source, visibility=visibility, accuracy=accuracy)
    assert found == pytest.approx(below_cusp(1.0, 2.0), rel=accuracy)


@WAYS
def test_the_shadow_of_an_edge_with_a_cusp(visibility):
    blocker = PatchSet.from_bezier(cusped(0.5, 1.0))
    found = total(LAMP, blocker, visibility=visibility, accuracy=1e-5)
    # As asked of the free factor of the lamp.
    assert found == pytest.approx(total(LAMP) - below_cusp(0.5, 1.0), abs=1e-5 * total(LAMP))


def wide_wall(low, high):
    """One patch that goes 298 degrees round the origin, its + side towards it, heights in z."""
    net = np.empty((1, 4, 4, 3))
    net[0, :, :, :2] = np.array([(-0.6, -1.0), (-4.0, 2.5), (4.0, 2.5), (0.6, -1.0)])[:, None]
    net[0, :, :, 2] = np.linspace(low, high, 4)
    return PatchSet.from_bezier(net)


def outline_of_wall(count=100_001):
    """Azimuths and distances of the wall from the origin."""
    t = np.linspace(0.0, 1.0, count)
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    x, y = (basis @ wide_wall(0.0, 1.0).control_points[0, :, 0, :2]).T
    azimuth = np.unwrap(np.arctan2(y, x))
    assert (np.diff(azimuth) < 0.0).all() and azimuth[0] - azimuth[-1] > 1.6 * math.pi
    return azimuth, np.hypot(x, y)


@pytest.mark.parametrize("visibility", ["strict", "auto", "none"])
def test_a_patch_that_goes_far_round_the_receiver(visibility):
    """Its contour closes along the horizon over more than half a turn."""
    azimuth, distance = outline_of_wall()
    share = 1.5**2 / (1.5**2 + distance**2)  # sin² of the wall's elevation
    expected = 0.5 * ((share[1:] + share[:-1]) @ -np.diff(azimuth)) / (2.0 * math.pi)
    wall = wide_wall(-1.0, 1.5)
    # As asked; trapezoids leave 1e-10.
    assert total(wall, visibility=visibility, accuracy=1e-6) == pytest.approx(expected, rel=1e-6)
    assert factor(wall.flipped(), visibility=visibility).high.max() <= 1e-12


@WAYS
def test_a_blocker_that_goes_far_round_the_receiver(visibility):
    """It lets through what is above its rim, and the lamp's part in its gap."""
    azimuth, distance = outline_of_wall()
    lamp = PatchSet.disk((0, 0, 2.0), 30.0, (0, 0, -1))
    seen = distance**2 / (1.5**2 + distance**2)
    over = 0.5 * ((seen[1:] + seen[:-1]) @ -np.diff(azimuth)) / (2.0 * math.pi)
    gap = 1.0 - (azimuth[0] - azimuth[-1]) / (2.0 * math.pi)
    expected = over + gap * 30.0**2 / (30.0**2 + 2.0**2)
    for wall in (wide_wall(-1.0, 1.5), wide_wall(-1.0, 1.5).flipped()):
        found = total(lamp, wall, visibility=visibility, accuracy=1e-4)
        assert found == pytest.approx(expected, abs=1e-4)


# --- scale


@WAYS
def test_a_bead_of_a_millimetre_in_a_room_of_ten_metres(visibility):
    """Both factors: the bead takes its own from the room."""
    room = PatchSet.box((10, 10, 10), center=(0, 0, 4.5), inward=True)
    bead = PatchSet.sphere((0.3, 0.2, 1.0), 5e-4)
    distance = math.sqrt(0.09 + 0.04 + 1.0)
    own = (5e-4 / distance) ** 2 / distance
    # 1e-3 of each patch of the bead, but no accuracy is asked below 1e-12: of eight, 4e-5 of all.
    found = total(bead, room, visibility=visibility, accuracy=1e-3)
    assert found == pytest.approx(own, rel=1e-3)
    # To a two-hundredth of the bead.
    beside = total(room, bead, visibility=visibility, accuracy=1e-9)
    assert beside == pytest.approx(1.0 - own, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_contours_of_what_is_seen_have_no_scale(scale):
    blockers = PatchSet.concatenated(
        PatchSet.sphere((0.2, 0.1, 1.0), 0.3),
        closed_cylinder((0.1, -0.2, 0.7), (0.4, 0.3, 1.1), 0.2).patches,
    )
    grow = np.diag([scale, scale, scale, 1.0])
    point = np.array([0.05, 0.1, 0.2])
    here = factor(LAMP, blockers, point, visibility="auto", accuracy=1e-6)
    there = factor(
        LAMP.moved(grow), blockers.moved(grow), scale * point, visibility="auto", accuracy=1e-6
    )
    assert here.counters["pairs_by_contour"] == there.counters["pairs_by_contour"] == 1
    # Rounding of the coordinates.
    np.testing.assert_allclose(there.value, here.value, rtol=0, atol=1e-12)


# --- shells


def halves(ball, z):
    """Lower and upper half of a ball of octants."""
    heights = ball.control_points[:, ::3, ::3, 2] / ball.control_points[:, ::3, ::3, 3]
    low = (heights <= z + 1e-9).all(axis=(1, 2))
    assert low.sum() == 4
    return ball.take(np.flatnonzero(low)), ball.take(np.flatnonzero(~low))


@WAYS
@pytest.mark.parametrize("turned", [False, True])
def test_open_and_inverted_shells_hide_like_bodies(turned, visibility):
    """From below the lower half of a ball hides what the ball does, the upper what its rim does."""
    ball = PatchSet.sphere((0, 0, 1.2), 0.3)
    lower, upper = halves(ball, 1.2)
    rim = 0.09 / (0.09 + 1.44)
    for shell, hidden in ((ball, 0.0625), (lower, 0.0625), (upper, rim)):
        found = factor(
            LAMP, shell.flipped() if turned else shell, visibility=visibility, accuracy=1e-4
        )
        # As asked of the lamp's free factor.
        assert found.value.sum() == pytest.approx(total(LAMP) - hidden, abs=1e-4 * total(LAMP))


@WAYS
def test_boxes_within_boxes_exchange_exactly_nothing(visibility):
    inner, outer = PatchSet.box((1, 1, 1)), PatchSet.box((3, 3, 3), inward=True)
    between = PatchSet.box((2, 2, 2))
    for source, point, normal in ((outer, (0, 0, 0.9), UP), (inner, (0, 0, 1.2), (0, 0, -1))):
        found = factor(source, between, point, normal, visibility=visibility, accuracy=1e-4)
        assert found.value.max() == 0.0
        # The error stated of what is found dark.
        assert found.high.max() <= 1e-12


@WAYS
def test_a_hollow_source_and_the_polygons_before_it(visibility):
    """A vault over a receiver, and a box in it: the wall does not shade itself near its own."""
    vault = PatchSet.sphere((0, 0, 0), 2.0, inward=True).take(range(4, 8))
    box = PatchSet.box((0.4, 0.4, 0.4), center=(0.0, 0.0, 0.9))
    own = total(ceiling(-0.2, 0.2, -0.2, 0.2, 0.7))
    found = total(vault, box, visibility=visibility, accuracy=1e-4)
    # From straight below only the bottom of the box is seen.
    assert found == pytest.approx(1.0 - own, abs=1e-4)
