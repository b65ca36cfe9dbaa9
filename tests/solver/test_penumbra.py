"""Half-shadows of the sun's disc: straight and curved edges, and the light a shadow lacks.

Where a cone or a cylinder hides part of the disc, a direction d is hidden when dᵀ Q d > 0. Along a
ray from the disc's middle in the plane that touches it there, that is a quadratic inequality, and
the light up to its roots a closed form: one integral over the turn is left.
"""

import math

import numpy as np
import pytest
from patchlight.solver.camera import _TURNS
from patchlight.solver.model import PatchSet, Sun
from patchlight.solver.model.sky import direction
from patchlight.solver.open_sky import OpenSky
from patchlight.solver.skies import sun_horizontal_illuminance
from patchlight.solver.sun_disc import DARKENING, DiscLight, stack_of
from patchlight.solver.sun_pictures import SunInPictures
from patchlight.solver.topology import make_blockers

from .fixtures_light import UP, Body, ceiling, rectangle, scene, setup

RADIUS = math.radians(16.0 / 60.0)
DISC = math.sin(RADIUS) ** 2
HIGH = Sun(90.0, 0.0, 1.0)
#: What a simulation of accuracy 0.01 asks for: parts of the disc that are sampled at last.
SHARE = 5e-4


def seen(points, *bodies, sun=HIGH, normal=None, small=SHARE):
    """Light of the disc, of 1 lx on a plane facing it, at points on planes that face it."""
    toward = direction(sun.altitude_deg, sun.azimuth_deg) if normal is None else normal
    parts = setup(*bodies)
    blockers = make_blockers(*parts)
    points = np.asarray(points, float)
    normals = np.broadcast_to(np.asarray(toward, float), points.shape)
    return DiscLight(blockers, trace=True).at(points, normals, sun, small)


def share(points, *bodies, sun=HIGH, small=SHARE):
    """Share (m,) of the disc's light that reaches points on planes that face it."""
    found = seen(points, *bodies, sun=sun, small=small)
    assert found.deviation.max() < 5e-3
    return found.illuminance


def hidden_share(point, form, sun=HIGH, turns=40_000):
    """Share of the disc's light in the directions d with dᵀ ``form`` d > 0."""
    s = np.array(direction(sun.altitude_deg, sun.azimuth_deg))
    e1 = np.cross(s, (1.0, 0.0, 0.0) if abs(s[0]) < 0.9 else (0.0, 1.0, 0.0))
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(s, e1)
    psi = 2.0 * math.pi * (np.arange(turns) + 0.5) / turns
    e = np.cos(psi)[:, None] * e1 + np.sin(psi)[:, None] * e2
    q = form(np.asarray(point, float))
    a, b, c = np.einsum("ni,ij,nj->n", e, q, e), e @ q @ s, float(s @ q @ s)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    edge = math.tan(RADIUS)
    low, high = np.sort([(-b - root) / a, (-b + root) / a], axis=0)
    low, high = np.clip(low, 0.0, edge), np.clip(high, 0.0, edge)
    none = b * b - a * c <= 0.0
    low[none] = high[none] = 0.0

    def light(rho):
        return 0.5 - 0.5 / (1.0 + rho * rho)  # ∫ ρ dρ / (1 + ρ²)²

    between = light(high) - light(low)
    # Between the roots the form has the sign of −a.
    hidden = np.where(a < 0.0, between, light(np.full(turns, edge)) - between)
    return float(hidden.mean() / light(edge))


def ball(center, radius):
    """dᵀ Q d > 0 inside the cone of tangents of a ball before the point."""

    def form(point):
        to = np.asarray(center) - point
        return np.outer(to, to) - (to @ to - radius**2) * np.eye(3)

    return form


def tube(middle, axis, radius):
    """dᵀ Q d > 0 where a line through the point meets an endless cylinder."""

    def form(point):
        a = np.asarray(axis) / np.linalg.norm(axis)
        across = np.cross(np.asarray(middle) - point, a)
        plane = np.eye(3) - np.outer(a, a)
        return radius**2 * plane - np.outer(across, across)

    return form


def test_straight_edge():
    """(acos t − t √(1 − t²)) / π of the disc beyond a chord at t radii."""
    t = np.array([-1.3, -0.98, -0.5, -0.1, 0.0, 0.6, 0.9, 1.02])
    points = np.column_stack([-t * 2.0 * math.tan(RADIUS), np.full(len(t), 0.013), 0.0 * t])
    inside = np.clip(t, -1.0, 1.0)
    expected = (np.arccos(inside) - inside * np.sqrt(1.0 - inside**2)) / math.pi
    found = share(points, ceiling(-1.0, 0.0, -1.0, 1.0, 2.0))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert found[0] == pytest.approx(1.0, abs=1e-9) and found[-1] == 0.0


SLANTED = Sun(35.0, 110.0, 1.0)


def test_edge_of_a_ball():
    """Points across the half-shadow of a ball 2 m away, whose radius is 4 times the sun's there."""
    center, radius = np.array([0.3, -0.2, 1.5]), 0.04
    s = np.array(direction(35.0, 110.0))
    side = np.cross(s, UP) / np.linalg.norm(np.cross(s, UP))
    foot = center - 2.0 * s
    width = 2.0 * math.tan(RADIUS)
    points = foot + np.outer(radius + np.array([-5.0, -0.7, -0.2, 0.0, 0.4, 0.8]) * width, side)
    expected = [1.0 - hidden_share(p, ball(center, radius), SLANTED) for p in points]
    found = share(points, Body(PatchSet.sphere(center, radius), True), sun=SLANTED)
    assert 0.05 < expected[1] < expected[-1] < 0.99
    np.testing.assert_allclose(found, expected, atol=3e-5)


def test_a_ball_smaller_than_the_sun():
    """It hides its share of the disc, wherever it stands before it: (r / d)² / sin² R nearly."""
    center, radius = np.array([0.0, 0.0, 3.0]), 0.005
    points = np.array([(0.0, 0.0, 0.0), (0.006, 0.002, 0.0), (0.013, 0.0, 0.0)])
    expected = [1.0 - hidden_share(p, ball(center, radius)) for p in points]
    assert expected[0] == pytest.approx(1.0 - (radius / 3.0) ** 2 / DISC, abs=1e-5)
    found = share(points, Body(PatchSet.sphere(center, radius), True))
    np.testing.assert_allclose(found, expected, atol=3e-5)


def test_edge_of_a_cylinder():
    """A pipe across the sun's path, longer than the disc is wide, at a slant."""
    start, end, radius = np.array([-1.0, -0.3, 1.4]), np.array([1.0, 0.2, 1.6]), 0.03
    s = np.array(direction(35.0, 110.0))
    middle, axis = 0.5 * (start + end), end - start
    across = np.cross(axis, s) / np.linalg.norm(np.cross(axis, s))
    width = 2.0 * math.tan(RADIUS)
    offsets = radius + np.array([-0.8, -0.3, 0.1, 0.7]) * width
    points = middle - 2.0 * s + np.outer(offsets, across)
    expected = [1.0 - hidden_share(p, tube(middle, axis, radius), SLANTED) for p in points]
    found = share(points, PatchSet.cylinder(start, end, radius), sun=SLANTED)
    assert 0.05 < min(expected) and max(expected) < 0.97
    np.testing.assert_allclose(found, expected, atol=3e-5)


def test_a_shadow_lacks_what_the_ball_takes():
    """∫ (E_n − E) dA of a ball's shadow is its cross-section times the light of the disc.

    From each direction of the disc a ball takes π r² of a plane's beam: with the solid angle
    2π (1 − cos R) in place of π sin² R.
    """
    radius, height = 0.03, 2.0
    width = height * math.tan(RADIUS)
    x, w = np.polynomial.legendre.leggauss(12)
    # The core, and the half-shadow in two parts; the light has a root at both ends of it.
    ends = [0.0, radius - 1.01 * width, radius, radius + 1.01 * width]
    r = np.concatenate(
        [a + 0.5 * (b - a) * (x + 1.0) for a, b in zip(ends, ends[1:], strict=False)]
    )
    weight = np.concatenate([0.5 * (b - a) * w for a, b in zip(ends, ends[1:], strict=False)])
    points = np.column_stack([r, 0.0 * r, 0.0 * r])
    sphere = Body(PatchSet.sphere((0.0, 0.0, height), radius), True)
    lacking = 1.0 - share(points, sphere)
    flux = float(2.0 * math.pi * (weight * r) @ lacking)
    expected = math.pi * radius**2 * 2.0 * (1.0 - math.cos(RADIUS)) / DISC
    # What twelve points a part miss of roots.
    assert flux == pytest.approx(expected, rel=1e-4)


def cut(height):
    """Share of a disc beyond a chord at ``height`` radii."""
    h = np.clip(height, -1.0, 1.0)
    return (np.arccos(h) - h * np.sqrt(1.0 - h * h)) / math.pi


def test_many_edges_at_once():
    """A wire across the gap between two boards, flat and curved edges within one disc."""
    width = 2.0 * math.tan(RADIUS)
    boards = (
        ceiling(-1.0, -0.3 * width, -1.0, 1.0, 2.0),
        ceiling(0.4 * width, 1.0, -1.0, 1.0, 2.0),
    )
    wire = 0.05 * width
    tube_ = PatchSet.cylinder((-1.0, 0.0, 2.0 - 1e-9), (1.0, 0.0, 2.0 - 1e-9), wire)
    point = np.zeros((1, 3))
    # The gap, less the wire's own band of it: along y the disc is 2 √(1 − x²) high.
    x = np.linspace(-0.3, 0.4, 20_001)
    free = 2.0 * np.sqrt(1.0 - x * x) - 2.0 * 0.05 / math.sqrt(1.0 - (wire / 2.0) ** 2)
    expected = float(np.trapezoid(free, x)) / math.pi
    assert share(point, *boards, tube_)[0] == pytest.approx(expected, abs=1e-4)


def test_a_wire_thinner_than_the_smallest_parts():
    """It takes its band out of the disc: 2 r / d by the disc's diameter, in units of its area."""
    wire, height = 2e-5, 2.0
    points = np.column_stack(
        [np.zeros(40), np.linspace(-0.5, 0.5, 40) * 2.0 * RADIUS, np.zeros(40)]
    )
    tube_ = PatchSet.cylinder((-1.0, 0.0, height), (1.0, 0.0, height), wire)
    found = seen(points, tube_)
    t = points[:, 1] / (height * math.tan(RADIUS))
    expected = 1.0 - 4.0 * np.sqrt(1.0 - t * t) * wire / (math.pi * height * math.tan(RADIUS))
    assert np.abs(found.illuminance - expected).mean() < 2.0 * found.deviation.mean() < 1e-2
    assert found.illuminance.mean() == pytest.approx(expected.mean(), abs=1.5e-3)


@pytest.mark.parametrize("radius_arcmin", [16.0, 300.0])
def test_darker_limb(radius_arcmin):
    """Past a straight edge, against the integral of I(μ) over the part beyond it."""
    sun = Sun(90.0, 0.0, 1.0, angular_radius_arcmin=radius_arcmin, limb_darkening=True)
    radius = math.radians(radius_arcmin / 60.0)
    t = np.array([-0.8, -0.3, 0.0, 0.5, 0.9])
    points = np.column_stack([-t * 2.0 * math.tan(radius), np.full(len(t), 0.01), 0.0 * t])
    u, v = DARKENING
    r = (np.arange(4000) + 0.5) / 4000 * math.tan(radius)
    mu = np.sqrt(1.0 - (np.sin(np.arctan(r)) / math.sin(radius)) ** 2)
    shine = (1.0 - u - v + u * mu + v * mu * mu) * r / (1.0 + r * r) ** 2
    turn = np.arccos(np.clip(t[:, None] * math.tan(radius) / r, -1.0, 1.0)) / math.pi
    expected = (turn * shine).sum(axis=1) / shine.sum()
    found = share(points, ceiling(-9.0, 0.0, -9.0, 9.0, 2.0), sun=sun)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert found[2] == pytest.approx(0.5, abs=1e-4)
    even = share(points, ceiling(-9.0, 0.0, -9.0, 9.0, 2.0), sun=Sun(90.0, 0.0, 1.0, radius_arcmin))
    assert found[0] - even[0] > 0.005 and even[-1] - found[-1] > 0.005


def test_discs_of_a_stack():
    assert stack_of(HIGH) == ((pytest.approx(math.tan(RADIUS)), 1.0),)
    for sun in (Sun(90.0, 0.0, 1.0, limb_darkening=True), Sun(90.0, 0.0, 1.0, 600.0)):
        radii, weights = np.array(stack_of(sun)).T
        assert weights.sum() == pytest.approx(1.0) and (weights > 0.0).all()
        assert radii.max() == pytest.approx(math.tan(math.radians(sun.angular_radius_arcmin / 60)))


@pytest.mark.parametrize("curved", [False, True])
def test_partly_below_the_horizon(curved):
    """A wall that faces it gets what a chord at the horizon leaves, a plane what Howell has."""
    # A speck before the disc, far away: past it the disc is told by parts, not by lines, and the
    # smallest part about the speck is sampled.
    speck = (0.0, 100.0, 100.0 * math.tan(0.9 * RADIUS))
    body = Body(PatchSet.sphere(speck, 1e-3), True) if curved else ceiling(5, 6, 5, 6, -9)
    for height in (-0.7, 0.0, 0.4):
        sun = Sun(height * 16.0 / 60.0, 0.0, 1.0)
        wall = seen([(0.0, 0.0, 0.0)], body, sun=sun)
        assert wall.illuminance[0] == pytest.approx(
            cut(np.array(-height)), abs=2e-4 if curved else 2e-5
        )
        level = seen([(0.0, 0.0, 0.0)], body, sun=sun, normal=UP).illuminance[0]
        assert level == pytest.approx(sun_horizontal_illuminance(sun), rel=1e-3)
    assert curved == (wall.counters["sun_past_curves"] > 0)
    assert seen([(0.0, 0.0, 0.0)], body, sun=Sun(-0.3, 0.0, 1.0)).illuminance[0] == 0.0


@pytest.mark.parametrize("gap", [0.01, 0.02, 0.1])
@pytest.mark.parametrize("turn", [0.3, 0.77])
def test_light_between_pipes_is_as_far_off_as_stated(gap, turn):
    """A slit of some hundredths of the disc's radius, narrower than the smallest part of it."""
    r, height, thick = math.tan(RADIUS), 20.0, 0.05
    across = np.array([math.cos(turn), math.sin(turn), 0.0])
    along, up = np.array([-across[1], across[0], 0.0]), np.array(UP)
    away = thick + 0.5 * gap * r * height
    pipes = []
    for k in (-1, 1):
        ends = (k * away * across + j * along + height * up for j in (-9, 9))
        pipes.append(Body(PatchSet.cylinder(*ends, thick)))
    places = r * height * np.linspace(-0.8, 0.8, 9)
    found = seen(places[:, None] * across, *pipes)

    def side(middle, way):
        """Share of the disc on this side of a pipe's edge, seen from each place."""
        turned = np.arctan2(middle - places, height)
        turned += way * np.arcsin(thick / np.hypot(middle - places, height))
        h = np.clip(np.tan(turned) / r, -1.0, 1.0)
        return 0.5 + (np.arcsin(h) + h * np.sqrt(1.0 - h * h)) / math.pi

    hidden = sum(side(k * away, 1.0) - side(k * away, -1.0) for k in (-1, 1))
    off = np.abs(found.illuminance - (1.0 - hidden))
    assert (off < 3.0 * found.deviation + 1e-5).all() and off.max() < 2e-3


def pictured(points, body):
    """Share of the disc that pictures show at points (k, 3), turned as they ask for it, (5, k)."""
    data = scene(setup(body), sun=HIGH)
    blockers = setup(body).blockers
    pictures = SunInPictures(data, OpenSky(data, blockers, trace=True), bands=1)
    normals = np.broadcast_to((0.0, 0.0, 1.0), points.shape)
    return np.stack([pictures.light(points, normals, turn) for turn in (0.0, *_TURNS)])


def test_pictures_see_a_bar_before_the_disc_and_a_ball_in_it():
    """Half as wide as the disc, they may leave all of its rim in sight."""
    height, r = 2.0, 2.0 * RADIUS
    bar = rectangle(
        (-0.5 * r, -1.0, height), (0.5 * r, -1.0, height), (0.5 * r, 1.0, height),
        (-0.5 * r, 1.0, height),
    )  # fmt: skip
    for body in (bar, PatchSet.sphere((0.0, 0.0, height), 0.5 * r)):
        for turn in (0.0, 0.4, 0.7):
            at = 2.1 * r * np.linspace(-1.0, 1.0, 43)[:, None] * (np.cos(turn), np.sin(turn), 0.0)
            exact = share(at, body)
            assert exact.min() < 0.8 and exact.max() > 0.99
            found = pictured(at, body)
            # Some tenth where a shadow lies between the places asked first, 0.03 each of the 32.
            np.testing.assert_allclose(found, np.broadcast_to(exact, found.shape), atol=0.13)
            # Half of the turns may miss it.
            off = np.abs(found[1:].mean(axis=0) - exact)
            assert off.max() < 0.07 and off.mean() < 0.02
