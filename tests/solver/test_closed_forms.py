"""Form factors against closed forms, on exact rational patches.

Formulas as listed in J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration Factors";
each test names its configuration. Tolerances: straight edges have a closed form and only round
(1e-13); curved edges are integrated to the accuracy asked (1e-10); silhouettes inside a patch are
chords of pieces whose error falls as the fourth power of their size (1e-7 at the depth used).
"""

import math

import numpy as np
import pytest
from patchlight.solver.dome import sun_cells
from patchlight.solver.model import PatchSet, Sun

from .fixtures_light import (
    UP,
    Body,
    area_rule,
    ceiling,
    dome,
    rectangle,
    rows,
    setup,
    turned,
)

ROUNDING = 1e-13
CURVED = 1e-10
SILHOUETTE = 1e-7


def seen(source, points, normals, *, on_patch=-1, eps=1e-10):
    """Form factors (m,) of a body that hides nothing of itself."""
    return rows(
        setup(source), points, normals, on_patch=on_patch, eps=eps, trace=False
    ).factors.sum(axis=1)


def factor(source, point, normal):
    return float(seen(source, point, normal)[0])


def atan(x):
    return math.atan(x)


def parallel_corner(a, b, c):
    """Plane element to a parallel rectangle a x b at distance c, one corner above it."""
    x, y = a / c, b / c
    return (
        x / math.hypot(1, x) * atan(y / math.hypot(1, x))
        + y / math.hypot(1, y) * atan(x / math.hypot(1, y))
    ) / (2 * math.pi)


def perpendicular_corner(height, width, distance):
    """Plane element to a rectangle in a plane at right angles, whose foot starts before it."""
    x, y = height / width, distance / width
    return (atan(1 / y) - y / math.hypot(x, y) * atan(1 / math.hypot(x, y))) / (2 * math.pi)


def offset_disk(radius, height, offset):
    """Plane element to a parallel disk whose axis is ``offset`` away."""
    h, r = height / offset, radius / offset
    z = 1 + h * h + r * r
    return 0.5 * (1 - (z - 2 * r * r) / math.sqrt(z * z - 4 * r * r))


def upright_to_disk(radius, height, offset):
    """Plane element at right angles to a disk's plane, ``offset`` > radius from its axis."""
    h, r = height / offset, radius / offset
    z = 1 + h * h + r * r
    return 0.5 * h * (z / math.sqrt(z * z - 4 * r * r) - 1)


def element_to_sphere(distance, tilt):
    """Plane element to a unit sphere, its normal ``tilt`` away from the centre, with horizon."""
    reach = math.asin(1 / distance)
    if tilt + reach <= 0.5 * math.pi:
        return math.cos(tilt) / distance**2
    if tilt - reach >= 0.5 * math.pi:
        return 0.0
    x = math.sqrt(distance**2 - 1)
    y = -x / math.tan(tilt)
    q = math.sin(tilt) * math.sqrt(1 - y * y)
    return (math.cos(tilt) * math.acos(y) - x * q) / (math.pi * distance**2) + atan(q / x) / math.pi


def parallel_rectangles(a, b, c):
    """Equal aligned parallel rectangles a x b at distance c."""
    x, y = a / c, b / c
    p, q = 1 + x * x, 1 + y * y
    return (2 / (math.pi * x * y)) * (
        math.log(math.sqrt(p * q / (1 + x * x + y * y)))
        + x * math.sqrt(q) * atan(x / math.sqrt(q))
        + y * math.sqrt(p) * atan(y / math.sqrt(p))
        - x * atan(x)
        - y * atan(y)
    )


def coaxial_disks(r1, r2, h):
    """Disk 1 to a parallel coaxial disk 2."""
    a, b = r1 / h, r2 / h
    x = 1 + (1 + b * b) / (a * a)
    return 0.5 * (x - math.sqrt(x * x - 4 * (b / a) ** 2))


SIZES = [(1.0, 1.0, 1.0), (1.3, 0.7, 0.9), (1e-3, 2e-3, 5.0), (40.0, 3.0, 0.01), (1.0, 1e-4, 1.0)]


@pytest.mark.parametrize(("a", "b", "c"), SIZES)
def test_parallel_rectangle_with_corner_above(a, b, c):
    expected = parallel_corner(a, b, c)
    assert factor(ceiling(0, a, 0, b, c), (0, 0, 0), UP) == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_rectangle_anywhere_is_a_sum_of_corners(turn):
    """Four corner rectangles about the foot point, after a rigid motion of everything."""
    move = turned(turn)
    source = ceiling(-0.3, 1.1, -0.6, 0.2, 0.8).moved(move)
    point, normal = move @ [0, 0, 0, 1], move @ [0, 0, 1, 0]
    expected = sum(parallel_corner(a, b, 0.8) for a in (0.3, 1.1) for b in (0.6, 0.2))
    assert factor(source, point[:3], normal[:3]) == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize(("height", "width", "distance"), SIZES)
@pytest.mark.parametrize("below", [0.0, 1.0])
def test_perpendicular_rectangle_cut_by_the_horizon(height, width, distance, below):
    """What lies below the receiver's horizon must not count."""
    d, w = distance, width
    source = rectangle((0, d, -below), (w, d, -below), (w, d, height), (0, d, height))
    expected = perpendicular_corner(height, width, distance)
    assert factor(source, (0, 0, 0), UP) == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize(
    ("radius", "height"),
    [(1.1, 0.6), (1.0, 1e-3), (0.01, 3.0), (50.0, 2.0)],
)
def test_coaxial_disk(radius, height):
    source = PatchSet.disk((0, 0, height), radius, (0, 0, -1))
    expected = radius**2 / (radius**2 + height**2)
    assert factor(source, (0, 0, 0), UP) == pytest.approx(expected, abs=CURVED)


@pytest.mark.parametrize(
    ("radius", "height", "offset"), [(1.1, 0.6, 1.7), (1.0, 0.2, 0.5), (2.0, 3.0, 2.0)]
)
def test_disk_off_the_axis(radius, height, offset):
    source = PatchSet.disk((offset, 0, height), radius, (0, 0, -1))
    expected = offset_disk(radius, height, offset)
    assert factor(source, (0, 0, 0), UP) == pytest.approx(expected, abs=CURVED)


@pytest.mark.parametrize(("radius", "height", "offset"), [(1.1, 0.6, 1.7), (1.0, 2.0, 1.05)])
def test_disk_seen_from_an_upright_element(radius, height, offset):
    source = PatchSet.disk((offset, 0, height), radius, (0, 0, -1))
    expected = upright_to_disk(radius, height, offset)
    assert factor(source, (0, 0, 0), (1, 0, 0)) == pytest.approx(expected, abs=CURVED)


@pytest.mark.parametrize("distance", [1.02, 1.5, 3.0, 20.0])
@pytest.mark.parametrize("tilt", [0.0, 0.3, 1.0, 1.4, 0.5 * math.pi, 1.8, 3.0])
def test_sphere_at_every_tilt(distance, tilt):
    source = Body(PatchSet.sphere((0, 0, distance), 1.0))
    normal = (math.sin(tilt), 0.0, math.cos(tilt))
    expected = element_to_sphere(distance, tilt)
    assert factor(source, (0, 0, 0), normal) == pytest.approx(expected, abs=SILHOUETTE)


@pytest.mark.parametrize("radius_arcmin", [16.0, 120.0, 600.0])
@pytest.mark.parametrize("tilt", [0.0, 0.9, 1.3])
def test_disk_at_infinity_is_sine_squared_times_cosine(radius_arcmin, tilt):
    cells = sun_cells(Sun(40.0, 110.0, 1.0, angular_radius_arcmin=radius_arcmin))
    sun = np.array(
        [
            math.cos(math.radians(40)) * math.sin(math.radians(110)),
            math.cos(math.radians(40)) * math.cos(math.radians(110)),
            math.sin(math.radians(40)),
        ]
    )
    side = np.cross(sun, UP) / np.linalg.norm(np.cross(sun, UP))
    normal = math.cos(tilt) * sun + math.sin(tilt) * side
    expected = math.sin(math.radians(radius_arcmin / 60)) ** 2 * math.cos(tilt)
    found = dome(cells, (0, 0, 0), normal).factor[0]
    # Relative: the factor itself is 2e-5 for the sun.
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("altitude_arcmin", [-15.0, -4.0, 0.0, 7.0, 15.0, 17.0, 60.0])
def test_disk_at_infinity_on_the_horizon(altitude_arcmin):
    """A sphere of the same angular radius, cut by the horizon."""
    cells = sun_cells(Sun(altitude_arcmin / 60, 200.0, 1.0))
    radius = math.radians(16 / 60)
    tilt = 0.5 * math.pi - math.radians(altitude_arcmin / 60)
    expected = element_to_sphere(1 / math.sin(radius), tilt)
    found = dome(cells, (0, 0, 0), UP).factor[0]
    # Of the whole disk: terms of the contour, asked to 1e-9, are 1 / sin r = 200 times as large.
    assert abs(found - expected) <= 2e-7 * math.sin(radius) ** 2


@pytest.mark.parametrize(("a", "b", "c"), [(1.0, 1.0, 1.0), (2.0, 0.5, 0.7)])
def test_equal_parallel_rectangles(a, b, c):
    points, normals, weights = area_rule(rectangle((0, 0, 0), (a, 0, 0), (a, b, 0), (0, b, 0)), 12)
    found = seen(ceiling(0, a, 0, b, c), points, normals) @ weights / (a * b)
    # 12 Gauss points a side leave 1e-9 of a function analytic beyond the rectangle by c.
    assert found == pytest.approx(parallel_rectangles(a, b, c), abs=1e-9)


def test_perpendicular_unit_squares_with_a_common_edge():
    """0.2000437761, from the closed form with H = W = 1."""
    wall = rectangle((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)).flipped()
    floor = rectangle((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    points, normals, weights = area_rule(floor.refined().refined(), 8)
    found = seen(wall, points, normals) @ weights
    expected = (
        2 * atan(1) - math.sqrt(2) * atan(1 / math.sqrt(2)) + 0.25 * math.log(0.75)
    ) / math.pi
    assert expected == pytest.approx(0.2000437761, abs=1e-10)
    # 8 Gauss points a side of 16 squares: rounding, as the factor stays smooth up to the edge.
    assert found == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize(
    ("r1", "r2", "h"),
    [(1.0, 1.0, 1.0), (0.5, 2.0, 0.8), (2.0, 0.3, 1.5)],
)
def test_coaxial_disks(r1, r2, h):
    points, normals, weights = area_rule(PatchSet.disk((0, 0, 0), r1, UP), 10)
    source = PatchSet.disk((0, 0, h), r2, (0, 0, -1))
    found = seen(source, points, normals) @ weights / weights.sum()
    # 10 Gauss points a direction leave 1e-11 of a factor that is smooth over the distance h.
    assert found == pytest.approx(coaxial_disks(r1, r2, h), abs=CURVED)


@pytest.mark.parametrize(("radius", "height"), [(1.0, 1.6), (3.0, 2.0)])
def test_sphere_to_coaxial_disk_by_reciprocity(radius, height):
    """A_sphere F = A_disk F_disk,sphere; the disk sees the whole sphere, so it is smooth there."""
    points, normals, weights = area_rule(PatchSet.disk((0, 0, 0), radius, UP), 8)
    ball = Body(PatchSet.sphere((0, 0, height), 1.0))
    found = seen(ball, points, normals, eps=1e-7) @ weights / (4 * math.pi)
    expected = 0.5 * (1 - 1 / math.hypot(1, radius / height))
    # Every node has its own silhouette; errors are of one sign and do not average out.
    assert found == pytest.approx(expected, abs=SILHOUETTE)


def test_inside_a_sphere_every_part_counts_by_its_area():
    shell = PatchSet.sphere((0.2, -0.1, 0.4), 1.7, inward=True).refined()
    points, normals, _ = area_rule(shell, 3)
    pick = slice(4, None, 23)
    on_patch = np.repeat(np.arange(len(shell)), 9)[pick]
    found = rows(
        setup(Body(shell)), points[pick], normals[pick], on_patch=on_patch, trace=False
    ).factors
    expected = shell.areas() / (4 * math.pi * 1.7**2)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=CURVED)


def test_hemisphere_sees_itself_by_half():
    """The point value equals the mean, as on every spherical cap."""
    bowl = PatchSet.sphere((0, 0, 0), 1.0, inward=True).take(range(4))
    points, normals, _ = area_rule(bowl, 4)
    on_patch = np.repeat(np.arange(4), 16)
    found = seen(Body(bowl, False), points, normals, on_patch=on_patch)
    np.testing.assert_allclose(found, 0.5, atol=CURVED)


def test_base_of_a_hemisphere_sees_nothing_else():
    vault = PatchSet.sphere((0, 0, 0), 2.0, inward=True).take(range(4, 8))
    points = [(0, 0, 0), (1.2, 0.3, 0), (0, -1.9, 0), (1.9999, 0, 0)]
    found = seen(Body(vault, False), points, UP)
    # The rim lies in the horizon, where only an angle is added up.
    np.testing.assert_allclose(found, 1.0, atol=ROUNDING)


def test_cylinder_seen_along_a_normal_through_its_end():
    d, length = 2.5, 1.8
    lateral = Body(PatchSet.cylinder((d, 0, 0), (d, 0, length), 1.0), False)
    x, y = (1 + d) ** 2 + length**2, (1 - d) ** 2 + length**2
    expected = atan(length / math.sqrt(d * d - 1)) / (math.pi * d) + (length / math.pi) * (
        (x - 2 * d) / (d * math.sqrt(x * y)) * atan(math.sqrt(x * (d - 1) / (y * (d + 1))))
        - atan(math.sqrt((d - 1) / (d + 1))) / d
    )
    assert factor(lateral, (0, 0, 0), (1, 0, 0)) == pytest.approx(expected, abs=SILHOUETTE)


@pytest.mark.parametrize(("major", "minor"), [(2.0, 0.5), (1.0, 0.1)])
def test_centre_of_a_torus(major, minor):
    ring = Body(PatchSet.torus((0, 0, 0), UP, major, minor))
    e = math.asin(minor / major)
    across, along = (2 * e + math.sin(2 * e)) / math.pi, math.sin(e) ** 2
    assert factor(ring, (0, 0, 0), (1, 0, 0)) == pytest.approx(across, abs=SILHOUETTE)
    assert factor(ring, (0, 0, 0), UP) == pytest.approx(along, abs=SILHOUETTE)
