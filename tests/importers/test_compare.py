"""What counts as the error of a patch: strips of a cylinder beside flat patches."""

import numpy as np
import pytest
from patchlight.importers.chains import TO_CONTROL
from patchlight.importers.compare import CHECK, NODE, Asked, compared

TOLERANCE = 1e-3


def strip(radius, *, arc=1.2, length=1.0):
    """Points, normals (1, 7, 7, 3) of a bent strip, and the flat patch through two of its sides."""
    s, t = np.meshgrid(CHECK, CHECK, indexing="ij")
    a = arc * (t - 0.5)
    normals = np.stack([0.0 * s, np.sin(a), np.cos(a)], axis=2)
    points = radius * normals + np.stack([length * s, 0.0 * s, 0.0 * s], axis=2)
    corners = points[np.ix_([0, 6], [0, 6])]
    f = np.arange(4) / 3.0
    g = np.stack([1.0 - f, f])
    net = np.ones((4, 4, 4))
    net[..., :3] = np.einsum("ai,bj,abk->ijk", g, g, corners)
    return points[None], normals[None], net[None]


def asked(tolerance=TOLERANCE, least=0.0):
    """One degree and ``tolerance``."""
    one = np.ones(1)
    return Asked(tolerance * one, one, np.inf * one, 1e-3 * one, 0.0 * one, least * one)


@pytest.mark.parametrize("radius", [4.0, 40.0])
def test_normals_of_what_is_wider_than_the_tolerance_count(radius):
    points, normals, net = strip(radius * TOLERANCE)
    found = compared(net, points, normals, asked())
    # The flat patch leans by half of the arc at the borders.
    assert found.errors[0, 1] == pytest.approx(np.degrees(0.6), rel=1e-9)
    assert not found.kept[0]


def test_normals_within_a_crease_do_not_count():
    # A radius of 0.4 tolerances: all of the arc, 1.2 rad, lies within the tolerance.
    points, normals, net = strip(0.4 * TOLERANCE)
    found = compared(net, points, normals, asked())
    # All but the middle line, where the flat patch has the normal of the surface.
    assert found.errors[0, 1] == pytest.approx(0.0, abs=1e-9) and found.errors[0, 4] == 42
    assert found.kept[0] and found.errors[0, 0] < TOLERANCE
    # The same strip counts in full where more is asked of the position.
    finer = compared(net, points, normals, asked(0.05 * TOLERANCE))
    assert finer.errors[0, 1] == pytest.approx(np.degrees(0.6), rel=1e-9)


def through(points):
    """The polynomial patch (1, 4, 4, 4) through the points (1, 7, 7, 3) at the nodes."""
    h = np.ones((4, 4, 4))
    h[..., :3] = points[0][np.ix_(NODE, NODE)]
    return np.einsum("ai,bj,ijk->abk", TO_CONTROL, TO_CONTROL, h)[None]


def turned(points, degrees):
    """The patch through points in a plane, turned about the x axis through their middle."""
    a = np.radians(degrees)
    matrix = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    middle = points[0].reshape(-1, 3).mean(axis=0)
    return through((points - middle) @ matrix.T + middle)


def sheet(x, y):
    """Points and normals (1, 7, 7, 3) of z = 0 at x, y (7, 7)."""
    points = np.stack([x, y, 0.0 * x], axis=2)[None]
    return points, np.broadcast_to([0.0, 0.0, 1.0], points.shape)


def test_normals_at_a_cusp_do_not_count_but_all_others_do():
    # Sides y = 0 and y = x² / 4 leave the origin in one direction: the Jacobian is t / 2, and the
    # sine of the angle between parameter lines 0.05 at t = 0.1 and 0.12 at t = 0.25.
    s, t = np.meshgrid(CHECK, CHECK, indexing="ij")
    points, normals = sheet(s + t, 0.25 * t**2)
    net = turned(points, 5.0)
    for least, left_out in ((0.0, 0), (0.04, 0), (0.06, 7), (0.2, 7)):
        found = compared(net, points, normals, asked(least=least))
        assert found.jacobian[0] == pytest.approx(0.5, rel=1e-9)
        assert found.errors[0, 4] == left_out
        assert found.errors[0, 1] == pytest.approx(5.0, rel=1e-9) and not found.kept[0]


def test_normals_where_parameters_run_slowly_count():
    # A profile of one length unit and one of a thousandth, in equal shares of the parameter: the
    # Jacobian is small there, and the sides meet at right angles.
    points, normals, net = strip(4.0 * TOLERANCE)
    found = compared(net, points, normals, asked(least=1e3 * TOLERANCE))
    assert found.errors[0, 1] == pytest.approx(np.degrees(0.6), rel=1e-9)
    assert found.errors[0, 4] == 0 and not found.kept[0]


def test_normals_beside_a_crease_count():
    # A flat sheet with a bend of a radius of 0.4 tolerances along one side: the patch that leans
    # over by 5 degrees is found out on the flat part.
    s, t = np.meshgrid(CHECK, CHECK, indexing="ij")
    points, normals = sheet(0.1 * s, 0.1 * t)
    normals = np.array(normals)
    normals[:, :, -1] = [0.0, np.sin(1.2), np.cos(1.2)]
    points[:, :, -2] = points[:, :, -1] - [0.0, 0.4 * TOLERANCE, 0.0]
    net = turned(points, 5.0)
    found = compared(net, points, normals, asked())
    assert found.errors[0, 4] == 14  # both rows of the bend
    assert found.errors[0, 1] == pytest.approx(5.0, abs=0.5) and not found.kept[0]


def test_the_distance_counts_inside_where_no_normal_is_known():
    s, t = np.meshgrid(CHECK, CHECK, indexing="ij")
    points, normals = sheet(s, t)
    normals = np.array(normals)
    normals[:, 3, 3] = 0.0
    net = through(points)
    points[:, 3, 3, 2] = 5.0 * TOLERANCE
    found = compared(net, points, normals, asked())
    assert found.errors[0, 0] == pytest.approx(5.0 * TOLERANCE, rel=1e-9) and not found.kept[0]


def test_what_is_narrower_than_the_tolerance_is_cut_across_alone():
    points, normals, net = strip(0.4 * TOLERANCE)
    points[..., 2] += 2.0 * TOLERANCE * np.sin(np.pi * CHECK)[:, None]  # bent along as well
    found = compared(net, points, normals, asked())
    assert not found.kept[0] and found.split[0] == 1
