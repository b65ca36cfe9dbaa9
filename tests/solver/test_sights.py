"""Bright elements by lines of sight: exact where nothing or all is hidden, shadows else."""

import numpy as np
import pytest
from patchlight.solver.exchange import Scan, form_factor_matrix, make_sources
from patchlight.solver.kernels.sights import SIGHT_DEVIATION, SIGHT_ORDER
from patchlight.solver.model import PatchSet
from patchlight.solver.sights import with_sights

from .fixtures_light import Body, ceiling, setup
from .test_meridian import ROOM, Bulk

LAMP = ceiling(-0.5, 0.5, -0.5, 0.5, 1.0)


def seen(parts, lamp, points, count, lines=24, divisions=2):
    """Rows of points that look up, patch ``lamp`` being told by lines of sight."""
    bulk = Bulk(parts, divisions)
    bright = bulk.elements.patch_index == lamp
    facets = with_sights(bulk.facets, bulk.elements, bulk.blockers.solid, bright, count)
    n, m = len(bulk.elements), len(points)
    sources = make_sources(
        bulk.elements, bulk.nets, np.full(n, 1e-5), Scan(facets, lines, np.full(n, 9.0))
    )
    traced = make_sources(bulk.elements, bulk.nets, np.full(n, 1e-6))
    nodes = np.asarray(points, dtype=float)[:, None]
    normals = np.broadcast_to([0.0, 0.0, 1.0], nodes.shape).copy()
    out = [
        form_factor_matrix(
            nodes, normals, np.ones((m, 1)), np.full(m, -1), s, bulk.blockers, eps=1e-7
        )
        for s in (sources, traced)
    ]
    return bright, *out


def grid(count, half, z):
    x, y = np.meshgrid(*2 * [np.linspace(-half, half, count)])
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)


def test_nothing_in_the_way_is_exact():
    """Few meridians, fewer points, and every factor is the unoccluded one: a share of one."""
    bright, found, true = seen(setup(LAMP), 0, grid(5, 1.5, -1.0), 8)
    # Points and shared edges, both to the accuracy asked.
    np.testing.assert_allclose(found.factors, true.factors, rtol=1e-7, atol=1e-15)
    assert found.variances.max() == 0.0


def test_a_blocker_beside_the_view_changes_nothing():
    parts = setup(LAMP, Body(PatchSet.box((0.2, 0.2, 0.2), center=(3.0, 0.0, 0.0))))
    bright, found, true = seen(parts, 0, grid(3, 0.3, -1.0), 8)
    np.testing.assert_array_equal(found.factors[:, bright], true.factors[:, bright])
    assert found.variances[:, bright].max() == 0.0


def test_behind_a_plate_is_dark():
    parts = setup(LAMP, Body(PatchSet.box((4, 4, 0.05), center=(0, 0, 0))))
    bright, found, _ = seen(parts, 0, grid(3, 0.3, -1.0), 16)
    assert found.factors[:, bright].max() == 0.0


def test_behind_the_lamp_is_no_blocker():
    parts = setup(LAMP, Body(PatchSet.box((0.4, 0.4, 0.2), center=(0, 0, 1.2))))
    bright, found, true = seen(parts, 0, grid(3, 0.3, -1.0), 16)
    np.testing.assert_array_equal(found.factors[:, bright], true.factors[:, bright])


@pytest.mark.parametrize("count", [64, 1024])
def test_penumbra_of_a_box_along_the_lamp(count):
    """Edges parallel to the lamp's: a regular grid of points would see them all at once."""
    parts = setup(LAMP, Body(PatchSet.box((0.5, 0.5, 0.1), center=(0.1, 0.1, 0.2))))
    bright, found, true = seen(parts, 0, grid(9, 1.0, -1.0), count)
    error = (found.factors - true.factors)[:, bright].sum(axis=1)
    whole = true.factors[:, bright].sum(axis=1).max()
    partly = (found.variances[:, bright] > 0.0).any(axis=1)
    assert partly.sum() > 20
    # The deviation that is stated of m points, and three of it.
    deviation = SIGHT_DEVIATION * count**SIGHT_ORDER * whole
    assert np.sqrt((error[partly] ** 2).mean()) < deviation
    assert np.abs(error).max() < 3.0 * deviation


def test_stated_deviation_is_that_found():
    rng = np.random.default_rng(8)
    boxes = [
        Body(PatchSet.box(rng.uniform(0.05, 0.4, 3), center=(*rng.uniform(-0.8, 0.8, 2), z)))
        for z in np.linspace(-0.3, 0.6, 5)
    ]
    bright, found, true = seen(setup(LAMP, *boxes), 0, grid(9, 1.2, -1.0), 128)
    square = ((found.factors - true.factors)[:, bright] ** 2).sum()
    # Errors of neighbours go together: scenes of other seeds gave 0.7 to 1.15.
    assert 0.5 < square / found.variances[:, bright].sum() < 1.5


@pytest.mark.parametrize("count", [90, 1440])
def test_points_lie_on_the_elements_and_stand_for_their_area(count):
    bulk = Bulk(setup(ROOM, LAMP, Body(PatchSet.sphere((0, 0, 0), 0.4))), 3)
    bright = np.isin(bulk.elements.patch_index, [6, 7, 8])
    facets = with_sights(bulk.facets, bulk.elements, bulk.blockers.solid, bright, count)
    each = np.diff(facets.sight_start)
    assert (each[bright] > 0).all() and (each[~bright] == 0).all()
    area = np.add.reduceat(
        np.linalg.norm(facets.sight_areas, axis=0), facets.sight_start[:-1][bright]
    )
    flat = bulk.elements.patch_index[bright] == 6
    np.testing.assert_allclose(area[flat], bulk.elements.areas[bright][flat], rtol=1e-12)
    # Next to a pole the area element runs from 0 to twice its mean, and a mean of k evenly spread
    # points is off by the order of 1/k of that.
    np.testing.assert_allclose(area, bulk.elements.areas[bright], rtol=3.0 / each[bright].min())
    sphere = np.linalg.norm(
        facets.sight_points[:, np.repeat(bulk.elements.patch_index, each) > 6], axis=0
    )
    np.testing.assert_allclose(sphere, 0.4, rtol=1e-12)


def test_hollow_sides_are_left_out():
    """A bowl may hide parts of itself: its elements are left to the meridians."""
    bulk = Bulk(setup(Body(PatchSet.sphere((0, 0, 0), 1.0, inward=True))), 2)
    facets = with_sights(
        bulk.facets, bulk.elements, bulk.blockers.solid, np.ones(len(bulk.elements), bool), 50
    )
    assert len(facets.sight_units) == 0 and facets.sight_points.shape == (3, 0)
