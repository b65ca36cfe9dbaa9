"""Matrices of form factors: precision, products, and rows that are told apart."""

import numpy as np
import pytest
from patchlight.solver import PatchSet
from patchlight.solver.exchange import ROUNDING, products
from patchlight.solver.kernels.threads import set_threads
from patchlight.solver.model.arrays import unique_rows

from .fixtures_light import Body, rows, setup


@pytest.mark.parametrize("shape", [(300,), (300, 1), (300, 3), (300, 0)])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_products_sum_in_double_precision(shape, kind):
    rng = np.random.default_rng(2)
    matrix, light = rng.random((50, 300)).astype(kind), rng.random(shape)
    # 300 roundings of double precision.
    np.testing.assert_allclose(products(matrix, light), matrix.astype(float) @ light, rtol=1e-13)


def test_products_with_nothing():
    assert products(np.empty((5, 0), np.float32), np.empty((0, 3))).shape == (5, 3)
    assert not products(np.empty((5, 0), np.float32), np.empty(0)).any()


def test_products_are_the_same_for_any_number_of_threads():
    rng = np.random.default_rng(3)
    matrix, light = rng.random((64, 999), np.float32), rng.random((999, 3))
    found = products(matrix, light)
    before = set_threads(1)
    try:
        np.testing.assert_array_equal(products(matrix, light), found)
        np.testing.assert_array_equal(products(matrix[:7], light[:, 1]), found[:7, 1])
    finally:
        set_threads(before)


def test_single_precision_is_the_rounding_of_double():
    room = setup(Body(PatchSet.box((4, 5, 3), inward=True)))
    points, normals = np.array([[0.3, 0.2, -1.0], [1.0, -2.0, 1.2]]), np.array([[0, 0, 1.0]] * 2)
    double = rows(room, points, normals, trace=False)
    single = rows(room, points, normals, trace=False, single=True)
    assert single.factors.dtype == np.float32
    np.testing.assert_allclose(single.factors, double.factors, rtol=ROUNDING)
    np.testing.assert_array_equal(single.sums, double.sums)


def test_unique_rows_are_those_of_numpy():
    rng = np.random.default_rng(5)
    table = rng.integers(0, 4, (500, 3)).astype(float) / 3.0
    expected, place = np.unique(table, axis=0, return_inverse=True)
    found, own = unique_rows(table)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(own, place.ravel())
    empty, nowhere = unique_rows(np.empty((0, 3)))
    assert empty.shape == (0, 3) and nowhere.shape == (0,)
