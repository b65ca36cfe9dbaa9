"""Cells of the dome: Tregenza's and Reinhart's."""

import numpy as np
import pytest
from patchlight.solver.dome_grid import dome_grid
from patchlight.solver.errors import InputError

PARTS = (1, 2, 4)


@pytest.mark.parametrize(("parts", "cells"), [(1, 145), (2, 577), (4, 2305), (8, 9217)])
def test_numbers_of_cells(parts, cells):
    grid = dome_grid(parts)
    assert len(grid) == cells == int(grid.count.sum())
    assert grid.solid_angle.sum() == pytest.approx(2.0 * np.pi, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(grid.directions, axis=1), 1.0, rtol=1e-12)


def test_altitudes_of_tregenza():
    """Bands of 12 degrees, their middles at 6, 18, … 78 degrees, and the zenith."""
    grid = dome_grid(1)
    np.testing.assert_allclose(
        np.unique(grid.altitude_deg.round(9)), [6, 18, 30, 42, 54, 66, 78, 90], atol=1e-6
    )
    assert grid.azimuth_deg[:2] == pytest.approx([0.0, 12.0])


@pytest.mark.parametrize("parts", PARTS)
def test_weights_between_middles(parts):
    grid = dome_grid(parts)
    some = np.random.default_rng(parts).normal(size=(500, 3))
    some[:, 2] = np.abs(some[:, 2])
    some[0], some[1] = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
    cells, weights = grid.between(some)
    assert weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
    values = np.random.default_rng(0).normal(size=len(grid))
    np.testing.assert_allclose(
        grid.interpolated(values, grid.directions), values, atol=1e-9 * np.abs(values).max()
    )
    # What gathers weights is the transpose of what interpolates.
    light = np.random.default_rng(1).random(len(some))
    assert grid.gathered(some, light) @ values == pytest.approx(
        grid.interpolated(values, some) @ light
    )


def test_interpolation_is_of_second_order():
    """A smooth function is told with an error that falls to a quarter with each halving."""
    some = np.random.default_rng(2).normal(size=(2000, 3))
    some[:, 2] = np.abs(some[:, 2]) + 0.3
    some /= np.linalg.norm(some, axis=1, keepdims=True)

    def smooth(d):
        return np.exp(d[:, 0] + 0.5 * d[:, 1])

    errors = []
    for parts in PARTS:
        grid = dome_grid(parts)
        off = grid.interpolated(smooth(grid.directions), some) - smooth(some)
        errors.append(np.sqrt(np.mean(off**2)))
    assert errors[0] / errors[1] > 3.3
    assert errors[1] / errors[2] > 3.3


@pytest.mark.parametrize("parts", PARTS)
def test_level_receiver_sees_all(parts):
    """π for an even sky; 7 π / 9 of the zenith's for the traditional overcast one, nearly."""
    grid = dome_grid(parts)
    assert grid.level.sum() == pytest.approx(np.pi, rel=1e-12)
    overcast = (1.0 + 2.0 * grid.directions[:, 2]) / 3.0
    # Linear between middles, an error of the second order: 12 degrees squared over 8.
    assert grid.level @ overcast == pytest.approx(7.0 * np.pi / 9.0, rel=6e-3 / parts**2)


@pytest.mark.parametrize("parts", [0, 17, 1.5, "2"])
def test_bad_parts(parts):
    with pytest.raises(InputError, match=r"parts = .*from 1 to 16"):
        dome_grid(parts)
