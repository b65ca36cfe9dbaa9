"""What is small or far off is told with less: facets, strips, runs of units, long meridians."""

import math

import numpy as np
import pytest
from patchlight.solver.exchange import Scan, form_factor_matrix, make_sources
from patchlight.solver.kernels.meridian import BRIDGED, list_runs
from patchlight.solver.kernels.sweep import RUN, _sort_chords
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.tables import FACET_TURN, SMALL_TURN, facet_counts, make_facets

from .fixtures_light import closed_cylinder, setup


@pytest.mark.parametrize("radius", [1.0, 0.4, 0.02])
def test_small_elements_get_fewer_facets_that_leave_them_as_little(radius):
    """Quarters of a cylinder, against an element of 0.5 m."""
    nets = PatchSet.cylinder((0, 0, 0), (0, 0, 0.7), radius).control_points
    fine, coarse = facet_counts(nets), facet_counts(nets, 0.5)
    around = int(np.argmax(fine[0]))
    assert (fine[:, around] == 8).all() and (fine[:, 1 - around] == 1).all()
    turn = 0.5 * math.pi / coarse[:, around]
    # Quarters are whole numbers of facets: 90 degrees in 3 or in 8 to the bit.
    assert (turn <= SMALL_TURN + 1e-12).all()
    sagitta, allowed = radius * (1.0 - np.cos(0.5 * turn)), 0.5 * FACET_TURN / 8.0
    assert ((sagitta <= allowed) | (turn <= FACET_TURN)).all()
    assert (coarse[:, around] < 8).all() == (0.5 * math.pi * radius < 0.5)


def test_distant_elements_that_show_both_sides_err_as_little_as_points():
    """Quarters of a leg from all around, most of them turned away in part."""
    leg = setup(closed_cylinder((0, 0, 0), (0, 0, 0.4), 0.03))
    nets = leg.patches.control_points
    count = len(nets)
    elements = make_elements(leg.patches, np.zeros(count, bool), np.ones((count, 2), np.int64))
    facets, _ = make_facets(elements, nets, leg.blockers.closed, leg.blockers.solid)
    eps = 5e-3
    scan = Scan(facets, 16, np.full(count, 9.0), point_eps=eps)
    told, exact = (make_sources(elements, nets, np.full(count, 1e-6), how) for how in (scan, None))
    assert (told.point_from < 5.0**2).all()
    rng = np.random.default_rng(8)
    away = rng.normal(size=(300, 3))
    away *= rng.uniform(5.0, 9.0, 300)[:, None] / np.linalg.norm(away, axis=1)[:, None]
    normals = rng.normal(size=(300, 3)) - 0.5 * away
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    places = away[:, None], normals[:, None], np.ones((300, 1)), np.full(300, -1)
    found, truth = (
        form_factor_matrix(*places, sources, leg.blockers, eps=1e-8 if k else 1e-3, trace=False)
        for k, sources in enumerate((told, exact))
    )
    distance = np.linalg.norm(away[:, None] - (told.mean_point.T + told.edge_origin), axis=2)
    facing = np.linalg.norm(told.mean_parts, axis=2).sum(axis=1) / (math.pi * distance**2)
    error = np.abs(found.factors - truth.factors) / facing
    partly = (truth.factors > 0.0) & (truth.factors < 0.3 * facing) & (told.cones[:, 3] > 0.0)
    assert partly.sum() > 100
    # Four strips of 22 degrees: 1 − cos 11° = 0.02 of one that is about to turn away, see
    # `kernels.edges.AREA_ERROR`, besides what one point may leave.
    assert error.max() < 0.02 + eps
    assert np.sqrt((error**2).mean()) < eps


def test_runs_hold_all_that_may_be_seen_and_few_others():
    rng = np.random.default_rng(2)
    size = rng.integers(1, 90, 400)
    end = np.cumsum(size)
    points = np.stack([end - size, end], axis=1)
    ranges = np.zeros((401, 2), dtype=np.int64)
    dark = rng.random(400) < 0.9
    runs = np.empty((400, 2), dtype=np.int64)
    some = runs[: list_runs(dark, ranges, points, runs)]
    held = np.zeros(400, dtype=bool)
    for first, last in some:
        assert not dark[first] and not dark[last - 1] and not held[first:last].any()
        held[first:last] = True
    assert held[~dark].all() and 1 < len(some) < (~dark).sum()
    gaps = points[some[1:, 0], 0] - points[some[:-1, 1] - 1, 1]
    assert (gaps > BRIDGED).all()
    for first, last in some:
        lit = first + np.flatnonzero(~dark[first:last])
        assert (points[lit[1:], 0] - points[lit[:-1], 1] <= BRIDGED).all()
    assert list_runs(np.ones(400, dtype=bool), ranges, points, runs) == 0
    # The backs of one-sided patches hide from where their fronts are dark.
    ranges[400] = 0, 3
    assert list_runs(dark, ranges, points, runs) == 1 and (runs[0] == (0, 400)).all()


@pytest.mark.parametrize("count", [0, 1, RUN, RUN + 1, 5 * RUN + 3, 500])
def test_chords_are_sorted_with_equals_in_order(count):
    rng = np.random.default_rng(count)
    place = rng.permutation(700)[:count]  # of the chords in the chain, in its order
    span, chain = np.empty((700, 4)), np.full(700, -1)
    span[place, 0] = rng.integers(0, 60, count) / 7.0
    chain[place[:-1]] = place[1:]
    order, other = np.full((2, 700), -1)
    first = int(place[0]) if count else -1
    assert _sort_chords(first, span, chain, order, other) == count
    expected = place[np.argsort(span[place, 0], kind="stable")]
    assert np.array_equal(order[:count], expected)


@pytest.mark.parametrize("eps", [1e-3, 1e-4, 1e-5])
def test_disks_seen_at_a_grazing_angle_are_as_accurate_as_others(eps):
    """Quarter arcs, near and far: four nodes on each left a hundred times ``eps``."""
    disk = PatchSet.disk((0, 0, 0), 0.2, (0, 0, 1))
    elements = make_elements(disk, np.zeros(5, bool), np.ones((5, 2), np.int64))
    sources = make_sources(elements, disk.control_points, np.ones(5))
    rng = np.random.default_rng(3)
    away = rng.normal(size=(600, 3))
    away[:, 2] = np.abs(away[:, 2]) * rng.uniform(0.1, 1.0, 600)
    away *= rng.uniform(0.3, 3.0, 600)[:, None] / np.linalg.norm(away, axis=1)[:, None]
    normals = rng.normal(size=(600, 3)) - 0.3 * away
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    places = away[:, None], normals[:, None], np.ones((600, 1)), np.full(600, -1)
    blockers = setup(disk).blockers
    found, truth = (
        form_factor_matrix(*places, sources, blockers, eps=e, trace=False).factors.sum(axis=1)
        for e in (eps, 1e-10)
    )
    # What is small may be off by a twentieth of eps of the hemisphere, see `rows.how_to_see`.
    error = np.abs(found - truth) / (eps * np.maximum(truth, 0.05))
    assert (truth > 0.0).sum() > 400
    assert np.quantile(error, 0.95) < 0.5 and error.max() < 10.0
