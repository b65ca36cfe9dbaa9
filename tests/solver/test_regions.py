"""Silhouettes of regions of a quadric: whole and cut ellipsoids, cones, cylinders, and seams."""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors

from .fixtures_light import UP, ceiling, closed_cylinder
from .test_visible_contour import found, receivers

LAMP = ceiling(-1.0, 1.0, -0.8, 0.8, 2.0)


def egg() -> PatchSet:
    """An ellipsoid askew: a ball squeezed."""
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    net = PatchSet.sphere((0.0, 0.0, 0.0), 1.0).control_points.copy()
    shape = turn @ np.diag([0.15, 0.3, 0.4])
    net[..., :3] = net[..., :3] @ shape.T + net[..., 3:] * np.array([0.1, 0.0, 1.0])
    return PatchSet(net)


def below(patches: PatchSet, height: float) -> PatchSet:
    """Those patches whose corners' mean is below a height: the bowl of a ball."""
    corners = patches.control_points[:, ::3, ::3]
    mean = (corners[..., 2] / corners[..., 3]).mean(axis=(1, 2))
    return patches.take(np.flatnonzero(mean < height))


BALL = PatchSet.sphere((0.1, 0.0, 1.0), 0.35)
TUBE = PatchSet.cylinder((-0.5, -0.1, 0.9), (0.5, 0.2, 1.1), 0.3)
POINTED = PatchSet.cone((0.0, 0.0, 0.7), (0.1, 0.05, 1.3), 0.4, 0.0)
BLOCKERS = {
    "egg": egg(),
    "part of an egg": egg().take([0, 1, 2, 5]),
    "bowl": below(BALL, 1.0),
    "ball with a hole": BALL.take(np.arange(len(BALL) - 1)),
    "two quarters that do not touch": TUBE.take([0, 2]),
    "half a tube": TUBE.take([0, 1]),
    "pointed cone": POINTED,
    "pointed cone with its base": PatchSet.concatenated(
        POINTED, PatchSet.disk((0.0, 0.0, 0.7), 0.4, (-0.1, -0.05, -0.6))
    ),
    "part of a pointed cone": POINTED.take([0, 1, 2]),
    "turned inside out": PatchSet.concatenated(BALL.flipped(), TUBE.flipped()),
}


@pytest.mark.parametrize("name", BLOCKERS)
def test_lies_in_proved_brackets(name):
    points, normals = receivers(24, len(name))
    value = found(points, normals, LAMP, BLOCKERS[name], accuracy=1e-5)
    proof = point_form_factors(
        points, normals, LAMP, BLOCKERS[name], accuracy=3e-3, visibility="strict"
    )
    clear = point_form_factors(points, normals, LAMP, accuracy=1e-5, visibility="none")
    assert (value.value >= proof.low - 1e-9).all()
    assert (value.value <= proof.high + 1e-9).all()
    partly = (value.value > 0.0) & (value.value < clear.value * (1.0 - 1e-9))
    assert partly.sum() > 5
    # Curves that nearly touch, within 1e-6 of what is looked at, are left to brackets.
    assert value.counters["pairs_by_contour"] >= 0.9 * partly.sum()


@pytest.mark.parametrize("body", ["can", "ball"])
@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0])
def test_silhouette_along_a_seam(body, turn):
    """At √2 radii from the axis, halfway between two seams, both lie in the silhouette.

    A receiver displaced by 1e-9 sees the same to that order.
    """
    radius = 0.25
    shape = (
        closed_cylinder((0.0, 0.0, -0.5), (0.0, 0.0, 0.5), radius).patches
        if body == "can"
        else PatchSet.sphere((0.0, 0.0, 0.0), radius)
    )
    a = math.radians(45.0 + turn)
    x = math.sqrt(2.0) * radius * np.array([math.cos(a), math.sin(a), 0.0])
    plate = PatchSet.disk(-4.0 * x, 4.0, x)
    here, there = (
        found([x + shift], [-x], plate, shape, accuracy=1e-9)
        for shift in (np.zeros(3), np.array([3e-10, -5e-10, 8e-10]))
    )
    assert 0.0 < there.value.sum() < 0.9 * found([x], [-x], plate, None).value.sum()
    # Factors change by less than 10 a metre this close.
    np.testing.assert_allclose(here.value, there.value, rtol=0, atol=1e-8)
    assert here.counters["pairs_by_contour"] == there.counters["pairs_by_contour"] > 0


def test_egg_on_the_axis_of_a_disk():
    """An ellipsoid of revolution seen along its axis: its silhouette is a circle.

    From distance d of the centre, of semi-axes b across and c along, the tangent cone touches at
    c²/d towards the receiver, on a circle of radius b sqrt(1 − c²/d²).
    """
    b, c, d, h, disk_radius = 0.2, 0.4, 1.1, 2.0, 1.0
    net = PatchSet.sphere((0.0, 0.0, 0.0), 1.0).control_points.copy()
    net[..., :3] = net[..., :3] * (b, b, c) + net[..., 3:] * np.array([0.0, 0.0, d])
    disk = PatchSet.disk((0.0, 0.0, h), disk_radius, (0.0, 0.0, -1.0))
    value = found([(0.0, 0.0, 0.0)], UP, disk, PatchSet(net), accuracy=1e-10)
    rim, height = b * math.sqrt(1.0 - (c / d) ** 2), d - c * c / d
    hidden = rim**2 / (rim**2 + height**2)
    whole = disk_radius**2 / (disk_radius**2 + h**2)
    # Quadrature to a tenth of the accuracy asked for; the fit of quadrics to 1e-11.
    assert value.value.sum() == pytest.approx(whole - hidden, abs=1e-10)
    assert value.counters["pairs_by_contour"] == len(disk)


def test_many_bodies_far_aside_change_nothing():
    """Sheets that are not in the way are not even looked at; the result has the same bits."""
    points, normals = receivers(12, 3)
    alone = found(points, normals, LAMP, BALL)
    aside = [PatchSet.sphere((5.0 + k, 3.0, 1.0), 0.4) for k in range(6)]
    beyond = PatchSet.box((0.5, 0.5, 0.5), (0.0, 0.0, 4.0))
    more = found(points, normals, LAMP, PatchSet.concatenated(*aside, BALL, beyond))
    assert np.array_equal(alone.value, more.value)
