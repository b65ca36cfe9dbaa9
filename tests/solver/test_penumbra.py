"""Half-shadows of the sun's disc: straight and curved edges, and the light a shadow lacks.

Where a cone or a cylinder hides part of the disc, a direction d is hidden when dᵀ Q d > 0. Along a
ray from the disc's middle in the plane that touches it there, that is a quadratic inequality, and
the light up to its roots a closed form: one integral over the turn is left.
"""

import math

import numpy as np
import pytest
from patchlight.solver.dome import sun_cells
from patchlight.solver.model import PatchSet, Sun
from patchlight.solver.model.sky import direction

from .fixtures_light import UP, ceiling, dome, setup

RADIUS = math.radians(16.0 / 60.0)
DISC = math.sin(RADIUS) ** 2
#: Cells of the disc that are sampled: 600 of them lie on an edge across it, each off by 0.2 of
#: itself, 5e-5 of the disc together.
FINE = 1e-5 * DISC
HIGH = Sun(90.0, 0.0, 1.0)


def share(points, patches, sun=HIGH, cell_eps=FINE):
    """Share (m,) of the disc's light that reaches points on planes that face it."""
    toward = direction(sun.altitude_deg, sun.azimuth_deg)
    found = dome(sun_cells(sun), points, toward, parts=setup(patches), cell_eps=cell_eps)
    return found.factor / DISC


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
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert found[0] == pytest.approx(1.0, abs=1e-9) and found[-1] == 0.0


SLANTED = Sun(35.0, 110.0, 1.0)


@pytest.mark.slow
def test_edge_of_a_ball():
    """Points across the half-shadow of a ball 2 m away, whose radius is 4 times the sun's there."""
    center, radius = np.array([0.3, -0.2, 1.5]), 0.04
    s = np.array(direction(35.0, 110.0))
    side = np.cross(s, UP) / np.linalg.norm(np.cross(s, UP))
    foot = center - 2.0 * s
    width = 2.0 * math.tan(RADIUS)
    points = foot + np.outer(radius + np.array([-5.0, -0.7, -0.2, 0.0, 0.4, 0.8]) * width, side)
    expected = [1.0 - hidden_share(p, ball(center, radius), SLANTED) for p in points]
    found = share(points, PatchSet.sphere(center, radius), SLANTED)
    assert 0.05 < expected[1] < expected[-1] < 0.99
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_a_ball_smaller_than_the_sun():
    """It hides its share of the disc, wherever it stands before it: (r / d)² / sin² R nearly."""
    center, radius = np.array([0.0, 0.0, 3.0]), 0.005
    points = np.array([(0.0, 0.0, 0.0), (0.006, 0.002, 0.0), (0.013, 0.0, 0.0)])
    expected = [1.0 - hidden_share(p, ball(center, radius)) for p in points]
    assert expected[0] == pytest.approx(1.0 - (radius / 3.0) ** 2 / DISC, abs=1e-5)
    np.testing.assert_allclose(share(points, PatchSet.sphere(center, radius)), expected, atol=2e-4)


@pytest.mark.slow
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
    found = share(points, PatchSet.cylinder(start, end, radius), SLANTED)
    assert 0.05 < min(expected) and max(expected) < 0.97
    np.testing.assert_allclose(found, expected, atol=2e-4)


@pytest.mark.slow
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
    sphere = PatchSet.sphere((0.0, 0.0, height), radius)
    lacking = 1.0 - share(points, sphere, cell_eps=1e-4 * DISC)
    flux = float(2.0 * math.pi * (weight * r) @ lacking)
    expected = math.pi * radius**2 * 2.0 * (1.0 - math.cos(RADIUS)) / DISC
    # 36 points that are off by 3e-4 of the disc at random, and what twelve miss of a root.
    assert flux == pytest.approx(expected, rel=5e-4)
