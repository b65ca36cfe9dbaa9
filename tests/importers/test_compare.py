"""What counts as the error of a patch: strips of a cylinder beside flat patches."""

import numpy as np
import pytest
from patchlight.importers.compare import CHECK, Asked, compared

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
    assert found.errors[0, 1] == 0.0
    assert found.kept[0] and found.errors[0, 0] < TOLERANCE
    # The same strip counts in full where more is asked of the position.
    finer = compared(net, points, normals, asked(0.05 * TOLERANCE))
    assert finer.errors[0, 1] == pytest.approx(np.degrees(0.6), rel=1e-9)


def test_normals_where_a_cell_has_no_area_do_not_count():
    points, normals, net = strip(4.0 * TOLERANCE)
    chord = 8.0 * TOLERANCE * np.sin(0.6)
    found = compared(net, points, normals, asked())
    assert found.jacobian[0] == pytest.approx(chord, rel=1e-9)
    for least, angle in ((0.99 * chord, np.degrees(0.6)), (1.01 * chord, 0.0)):
        found = compared(net, points, normals, asked(least=least))
        assert found.errors[0, 1] == pytest.approx(angle, rel=1e-9)


def test_what_is_narrower_than_the_tolerance_is_cut_across_alone():
    points, normals, net = strip(0.4 * TOLERANCE)
    points[..., 2] += 2.0 * TOLERANCE * np.sin(np.pi * CHECK)[:, None]  # bent along as well
    found = compared(net, points, normals, asked())
    assert not found.kept[0] and found.split[0] == 1
