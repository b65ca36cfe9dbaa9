"""Joined panels: what is joined, that it changes no share, and where meridians cut polygons."""

import math

import numpy as np
import pytest
from patchlight.solver import tables
from patchlight.solver.kernels.cuts import cut_polygon, place_points, tangent_frame
from patchlight.solver.kernels.meridian import carried
from patchlight.solver.model import PatchSet
from patchlight.solver.panels import Panels, make_panels, split_concave
from patchlight.solver.tables import meridians

from .fixtures_light import Body, closed_cylinder, rectangle, setup
from .test_meridian import FURNISHED, ROOM, Bulk


def facets_of(*bodies, divisions=4):
    return Bulk(setup(*bodies), divisions).facets


def test_a_flat_patch_is_one_panel():
    """A trapezoid, whose elements are no parallelograms: the lines across it are straight."""
    facets = facets_of(rectangle((0, 0, 0), (4, 0, 0), (3, 1, 0), (1, 1, 0)), divisions=3)
    # An open patch hides with its back too: one panel more, which belongs to no unit.
    assert facets.panel_corners.shape == (2, 4)
    assert facets.panel_grid.tolist() == [0, -1]
    assert facets.unit_ranges.tolist() == [[0, 1], [1, 2]]
    assert facets.grid_size.tolist() == [[3, 3, 0, 0]]
    assert facets.grid_element.tolist() == list(range(9))
    assert facets.panel_element.tolist() == [-1, -1]


def test_a_cylinder_is_strips_along_its_axis():
    facets = facets_of(PatchSet.cylinder((0, 0, 0), (0, 0, 3), 1.0), divisions=3)
    joined = facets.panel_grid >= 0
    height = np.ptp(facets.panel_points[2][facets.panel_corners], axis=1)
    np.testing.assert_allclose(height[joined], 3.0, rtol=1e-14)  # rounding
    assert (facets.grid_size[:, :2].max(axis=1) == 3).all()
    assert (facets.grid_size[:, :2].min(axis=1) == 1).all()
    # Every element has as many cells as it has facets around the axis.
    assert len(set(np.bincount(facets.grid_element))) == 1


def test_a_sphere_stays_facets():
    facets = facets_of(Body(PatchSet.sphere((0, 0, 0), 1.0)))
    assert (facets.panel_grid < 0).all() and (facets.panel_element >= 0).all()
    assert not facets.unit_joined.any()


def test_curved_outlines_are_not_joined():
    """The facets of a disk reach its rim; a quadrangle through four points of it would not."""
    disk = facets_of(Body(PatchSet.disk((0, 0, 0), 1.0, (0, 0, 1))), divisions=2)
    radius = np.hypot(*disk.panel_points[:2])
    assert disk.panel_corners.shape[0] > 12
    assert (np.abs(radius - 1.0) < 1e-12).sum() > 12


def test_concave_facets_are_split():
    points = np.array([[[0, 0, 0], [2, 0, 0], [0.4, 0.4, 0], [0, 2, 0]]], dtype=float)
    found, corner = split_concave(points)
    assert found.tolist() == [0] and corner.tolist() == [2]
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
    assert len(split_concave(square)[0]) == 0


def test_facets_that_do_not_share_their_corners_are_not_joined():
    """Two facets on one side of a line, three on the other: their cuts do not go through."""
    vertices = np.array([[x, y, 0.0] for x in (0, 1, 2) for y in (0, 1, 1.5, 2)])
    corners = np.array([[0, 4, 5, 1], [1, 5, 7, 3], [4, 8, 10, 6], [6, 10, 11, 7]])
    boxes = np.array([[0, 1, 0, 1], [0, 1, 1, 2], [1, 2, 0, 1.5], [1, 2, 1.5, 2]], dtype=float)
    found = make_panels(vertices, corners, boxes, np.zeros(4, dtype=np.int64))
    # Not all four, but each pair above one another.
    assert sorted(map(np.size, found.cells)) == [2, 2]


def test_joining_changes_no_share(monkeypatch):
    """Shares of joined panels handed on to elements against those of every facet by itself."""

    def apart(vertices, corners, boxes, unit):
        rows = np.arange(len(corners))
        return Panels(corners, rows, np.full(len(rows), -1))

    joined = Bulk(FURNISHED)
    pick = np.random.default_rng(5).choice(len(joined.elements), 24, replace=False)
    found = joined.rows(512, pick)
    monkeypatch.setattr(tables, "make_panels", apart)
    single = Bulk(FURNISHED)
    assert 2 * len(single.facets.panel_corners) > 3 * len(joined.facets.panel_corners)
    expected = single.rows(512, pick)
    # The same lines cut the same chords: rounding. Elements between two meridians are told by a
    # point, which may fall to either side of a facet's edge: elsewhere one in ten thousand did, by
    # 3e-5 of the hemisphere.
    difference = np.abs(found.factors - expected.factors)
    assert (difference > 1e-15).mean() < 2e-4
    assert difference.max() < 3e-5


@pytest.mark.parametrize("seed", range(6))
def test_chords_of_a_polygon_add_up_to_its_form_factor(seed):
    """Random squares, some about the axis or through the horizon, against Lambert's formula."""
    rng = np.random.default_rng(seed)
    middle = rng.normal(size=3) * (1.0, 1.0, 0.3 if seed % 2 else 1.0) + (0.0, 0.0, 0.8)
    facing = -middle / np.linalg.norm(middle)
    side = np.cross(facing, rng.normal(size=3))
    side *= rng.uniform(0.3, 1.5) / np.linalg.norm(side)
    other = np.cross(facing, side)
    points = np.array([middle - side - other, middle + side - other, middle + side + other])
    points = np.vstack([points, middle - side + other])
    lines = 4096
    axes = np.tile(meridians(lines), (3, 1))
    local, ends, frame = np.empty((4, 4)), np.empty((3 * lines, 2)), np.empty((2, 3))
    before = np.empty(4, dtype=np.int64)
    x, n = np.zeros(3), np.array([0.0, 0.0, 1.0])
    tangent_frame(n, 0.37, frame)
    place_points(x, n, frame, np.ascontiguousarray(points.T), 0, len(points), axes, local, before)
    corners = np.array([[0, 1, 2, 3]])
    first, end = cut_polygon(local, corners, 0, facing[2] < 0.0, axes, ends)
    low, high = np.maximum(ends[first:end, 0], 0.0), ends[first:end, 1]
    found = sum(carried(a, b) for a, b in zip(low, high, strict=True) if b > a) / lines
    # Midpoints of steps h = 2π/lines across kinks of slope 1: h²/8 over 2π each, at four corners,
    # two crossings of the horizon and both ends.
    assert found == pytest.approx(
        lambert(points), abs=8 * (2 * math.pi / lines) ** 2 / 16 / math.pi
    )


def lambert(points):
    """Form factor of a polygon seen from the origin, up being +z."""
    clipped = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        if a[2] >= 0.0:
            clipped.append(a)
        if (a[2] >= 0.0) != (b[2] >= 0.0):
            clipped.append(a + (b - a) * a[2] / (a[2] - b[2]))
    total = 0.0
    for a, b in zip(clipped, clipped[1:] + clipped[:1], strict=True):
        normal = np.cross(a, b)
        size = np.linalg.norm(normal)
        if size > 0.0:
            total += math.atan2(size, a @ b) * normal[2] / size
    return abs(total) / (2.0 * math.pi)


def test_both_neighbours_of_an_edge_find_the_same_crossings():
    """The first polygon's upper ends are the second's lower ends, to the bit."""
    edge = np.array([[0.9, -1, 0.7], [1.1, 1, 0.8]])
    # The other sides rise in planes through the axis, where nothing crosses them.
    points = np.vstack([1.1 * edge - [0, 0, 0.6], edge, 0.8 * edge + [0, 0, 1]])
    lines = 256
    axes = np.tile(meridians(lines), (3, 1))
    local, frame, before = np.empty((4, 6)), np.empty((2, 3)), np.empty(6, dtype=np.int64)
    x, n = np.zeros(3), np.array([0.0, 0.0, 1.0])
    tangent_frame(n, 0.1, frame)
    place_points(x, n, frame, np.ascontiguousarray(points.T), 0, len(points), axes, local, before)
    corners = np.array([[1, 0, 2, 3], [3, 2, 4, 5]])
    below, above = np.full((3 * lines, 2), np.nan), np.full((3 * lines, 2), np.nan)
    cut_polygon(local, corners, 0, True, axes, below)
    cut_polygon(local, corners, 1, True, axes, above)
    at_below, at_above = below[:, 1].reshape(3, -1), above[:, 0].reshape(3, -1)
    met = np.isfinite(at_below).any(axis=0)
    assert met.sum() > 20 and (met == np.isfinite(at_above).any(axis=0)).all()
    ends = (np.nanmax(side[:, met], axis=0) for side in (at_below, at_above))
    np.testing.assert_array_equal(*ends)


def test_a_room_of_joined_panels_is_closed():
    """Nothing but panels is met from within: no gap between patches, nor at their edges."""
    bulk = Bulk(setup(ROOM, closed_cylinder((-1.2, 0.5, -1.35), (-1.2, 0.5, 1.35), 0.3)), 3)
    inside = np.flatnonzero(~bulk.elements.buried.any(axis=1))
    found = bulk.rows(96, inside[:40])
    assert found.outside[:, 1:3].max() < 1e-15  # rounding of directions
