"""Bulk form factors: visible shares along meridians, unoccluded factors by shared edges."""

import math

import numpy as np
import pytest
from patchlight.solver.edges import make_edges, point_distance
from patchlight.solver.exchange import Scan, form_factor_matrix, make_sources
from patchlight.solver.kernels.edges import mean_factors
from patchlight.solver.kernels.threads import set_threads
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import CIESky, PatchSet
from patchlight.solver.skies import luminance
from patchlight.solver.surfaces import Receivers
from patchlight.solver.tables import make_facets

from .fixtures_light import Body, ceiling, closed_cylinder, setup

ROOM = Body(PatchSet.box((5, 4, 2.7), inward=True))
FURNISHED = setup(
    ROOM,
    Body(PatchSet.box((1.6, 0.8, 0.05), center=(0.4, 0.3, -0.6))),
    closed_cylinder((-1.2, 0.5, -1.35), (-1.2, 0.5, 1.35), 0.3),
    Body(PatchSet.sphere((1.5, -1.0, -0.8), 0.45)),
)


class Bulk:
    """Elements of a set-up as receivers and as sources."""

    def __init__(self, parts, divisions=4, two_sided=False):
        p = len(parts.patches)
        sides = np.full(p, two_sided)
        self.elements = make_elements(
            parts.patches, sides, np.full((p, 2), divisions, dtype=np.int64)
        )
        self.parts, self.blockers = parts, parts.blockers
        self.nets = parts.patches.control_points
        self.receivers = Receivers.of_elements(self.elements)
        self.facets, self.lifts = make_facets(
            self.elements, self.nets, self.blockers.closed, self.blockers.solid
        )

    def rows(self, lines, pick=slice(None), *, exact_above=9.0, cell_eps=1e-3, **options):
        """Rows of some receivers; ``lines`` = 0 traces every pair."""
        n = len(self.elements)
        scan = Scan(self.facets, lines, np.full(n, exact_above)) if lines else None
        sources = make_sources(self.elements, self.nets, np.full(n, cell_eps), scan)
        r = self.receivers
        return form_factor_matrix(
            r.nodes[pick],
            r.normals[pick],
            r.weights[pick],
            r.patches[pick],
            sources,
            self.blockers,
            own=r.own[pick],
            lifts=self.lifts[pick],
            **{"eps": 1e-5, **options},
        )


@pytest.fixture(scope="module")
def furnished():
    bulk = Bulk(FURNISHED)
    pick = np.random.default_rng(3).choice(len(bulk.elements), 16, replace=False)
    return bulk, pick, bulk.rows(0, pick, cell_eps=1e-4)


def total_variation(found, true):
    return np.abs(found.factors - true.factors).sum(axis=1)


def test_error_falls_with_the_number_of_meridians(furnished):
    bulk, pick, true = furnished
    errors = [total_variation(bulk.rows(m, pick), true).mean() for m in (32, 128, 512)]
    # Line sampling of areas: about 1/M. Mean over four nodes of each of 16 receivers.
    assert errors[0] < 3e-2
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[2] < 2e-3


@pytest.mark.parametrize("lines", [48, 192])
def test_stated_deviation_is_that_found(furnished, lines):
    """Squares of the errors against the variances, summed over all pairs of all rows."""
    bulk, pick, true = furnished
    found = bulk.rows(lines, pick)
    ratio = ((found.factors - true.factors) ** 2).sum() / found.variances.sum()
    assert 0.1 < ratio < 3.0


def test_what_nothing_hides_is_exact(furnished):
    """A pair in full sight has its unoccluded factor, however few the meridians."""
    bulk = Bulk(setup(ROOM))
    found, plain = bulk.rows(48), bulk.rows(0, trace=False)
    # With meridians, points stand for shared edges: both to the accuracy asked, 1e-5.
    np.testing.assert_allclose(found.factors, plain.factors, rtol=1e-5, atol=1e-15)
    assert found.outside[:, 1:3].max() < 1e-15  # rounding of directions
    # Straight edges in closed form meet those by four Gauss nodes.
    np.testing.assert_allclose(plain.factors.sum(axis=1), 1.0, atol=1e-8)


@pytest.mark.parametrize("eps", [5e-2, 5e-3])
def test_one_point_of_distant_elements_errs_as_little_as_allowed(eps):
    """Flat and curved elements against their exact factors, seen from all around."""
    bulk = Bulk(FURNISHED, 6)
    sources = make_sources(bulk.elements, bulk.nets, np.full(len(bulk.elements), 1e-6))
    edges = make_edges(
        bulk.elements.nets,
        bulk.nets,
        bulk.elements.patch_index,
        bulk.elements.boxes,
        bulk.elements.side,
        sources.cones,
    )
    distance = point_distance(edges, eps)
    rng = np.random.default_rng(4)
    points, normals = rng.uniform(-6.0, 6.0, (40, 3)), rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    exact = form_factor_matrix(
        points[:, None],
        normals[:, None],
        np.ones((40, 1)),
        np.full(40, -1),
        sources,
        bulk.blockers,
        eps=1e-8,
        trace=False,
    ).factors
    one = np.empty_like(exact)
    for x, n, row in zip(points, normals, one, strict=True):
        mean_factors(x, n, edges, distance**2, row)
    told = one > 0.0
    curved = edges.mean_reach[2] > 0.0
    assert told[:, curved].sum() > 100 and told[:, ~curved].sum() > 1000
    away = np.linalg.norm(points[:, None] - (edges.mean_point.T + edges.edge_origin), axis=2)
    facing = edges.mean_reach[1] / (np.pi * away**2)
    error = np.abs(one - exact)
    assert (error <= eps * facing)[told].all()
    assert error[told].max() <= eps / 40.0
    # What is called dark is.
    assert exact[one == 0.0].max() < 1e-12


def test_pairs_above_the_threshold_are_traced(furnished):
    bulk, pick, _ = furnished
    found = bulk.rows(48, pick, exact_above=2e-3)
    assert found.counters["pairs_traced"] > 0
    assert found.counters["pairs_scanned"] > 0
    none = bulk.rows(48, pick)
    assert none.counters["pairs_traced"] == 0


def test_little_leaks_through_a_wall():
    """Two halves of a room parted by a wall that touches floor, ceiling and walls.

    Elements between two meridians are told by one point and the surfaces of the nearer meridian,
    which may pass beside the wall: a sampling error, not a proof.
    """
    wall = Body(PatchSet.box((0.1, 4, 2.7)))
    bulk = Bulk(setup(ROOM, wall), 5)
    found = bulk.rows(64)
    x = bulk.elements.nodes.mean(axis=1)[:, 0]
    left, right = x < -0.06, x > 0.06
    # In one of four nodes a share of 1/64 of the elements next to the wall, at most.
    assert found.factors[np.ix_(left, right)].sum(axis=1).max() < 1e-3
    assert found.factors[np.ix_(left, right)].sum(axis=1).mean() < 2e-4
    inside = np.abs(x) > 0.06
    # No row misses more than one meridian carries.
    np.testing.assert_allclose(found.factors[inside].sum(axis=1), 1.0, atol=1 / 64)


def test_facets_of_a_hollow_shell_do_not_shade_it():
    """Inside a sphere every element has its share of the area, but for what the ball hides."""
    ball = np.array([0.3, 0.2, -0.1])
    bulk = Bulk(
        setup(
            Body(PatchSet.sphere((0, 0, 0), 2.0, inward=True)),
            Body(PatchSet.sphere(ball, 0.15)),
        )
    )
    shell = np.flatnonzero(bulk.elements.patch_index < 8)
    found = bulk.rows(48).factors[np.ix_(shell, shell)]
    share = bulk.elements.areas[shell] / (16 * math.pi)
    nodes = bulk.elements.nodes[shell]
    middle = nodes.mean(axis=1)
    # Twice as far as its nodes reaches no element: the ball is clear of all lines within that.
    reach = 2.0 * np.linalg.norm(nodes - middle[:, None], axis=2).max(axis=1)
    along = middle[None] - middle[:, None]
    length2 = np.maximum((along**2).sum(axis=-1), 1e-12)
    t = np.clip(np.einsum("ijk,ijk->ij", ball - middle[:, None], along) / length2, 0.0, 1.0)
    gap = np.linalg.norm(middle[:, None] + t[..., None] * along - ball, axis=-1)
    free = gap > 0.15 + np.maximum(reach[:, None], reach[None])
    assert free.mean() > 0.7 and free.diagonal().all()
    error = found - share
    # The accuracy asked of unoccluded factors; behind the ball a hundred times as much is missing.
    assert np.abs(error[free]).max() <= 1e-5
    assert error[~free].min() < -1e-3


def test_one_sided_patches_hide_with_their_backs():
    """Seen from behind a patch is black: it gives nothing and lets nothing through."""
    shade = ceiling(-3, 3, -3, 3, 0.0).flipped()  # lit from above
    parts = setup(ceiling(-0.5, 0.5, -0.5, 0.5, 1.0), shade, ceiling(-1, 1, -1, 1, -1).flipped())
    bulk = Bulk(parts, 3)
    found = bulk.rows(64).factors
    patch = bulk.elements.patch_index
    assert found[np.ix_(patch == 2, patch == 0)].max() == 0.0
    assert found[np.ix_(patch == 2, patch == 1)].max() == 0.0
    assert found[np.ix_(patch == 1, patch == 0)].min() > 0.0


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 90.0, 135.0])
def test_sky_and_ground_of_an_open_plate(tilt_deg):
    """(1 ± cos β)/2 of a tilted plate, and a sky against a fine sum over directions."""
    t = math.radians(tilt_deg)
    c, s = math.cos(t), math.sin(t)
    plate = PatchSet.from_bilinear(
        np.array([[(-c, -1, s), (c, -1, -s), (c, 1, -s), (-c, 1, s)]], float)
    )
    sky = CIESky(12, sun_altitude_deg=35, sun_azimuth_deg=60)
    found = Bulk(setup(plate), 1).rows(256, sky=sky).outside[0]
    # Of the horizon's elevation in azimuth only two harmonics count: even steps add them exactly.
    assert found[1] == pytest.approx(0.5 * (1 + c), abs=1e-14)
    assert found[2] == pytest.approx(0.5 * (1 - c), abs=1e-14)
    z = (np.arange(600) + 0.5) / 600
    a = (np.arange(2400) + 0.5) / 2400 * 2 * np.pi
    z, a = np.meshgrid(z, a)
    d = np.stack([np.sqrt(1 - z * z) * np.cos(a), np.sqrt(1 - z * z) * np.sin(a), z], axis=-1)
    cosine = np.maximum(d @ np.array([s, 0.0, c]), 0.0)
    expected = (luminance(sky, d) * cosine).mean() * 2.0
    # Gauss' rule along meridians that pass the peak at the sun.
    assert found[0] == pytest.approx(expected, rel=2e-3)


def test_receiver_on_the_axis_of_a_corner():
    """A corner of facets straight above a node: radial edges, and facets about the axis."""
    plate = ceiling(-1, 1, -1, 1, 1.0)
    shade = ceiling(-0.25, 0.25, -0.25, 0.25, 0.5)
    bulk = Bulk(setup(plate, shade), 2)
    sources = make_sources(
        bulk.elements,
        bulk.nets,
        np.full(len(bulk.elements), 1e-6),
        Scan(bulk.facets, 1024, np.full(len(bulk.elements), 9.0)),
    )
    found = form_factor_matrix(
        np.zeros((1, 1, 3)),
        np.array([[[0.0, 0.0, 1.0]]]),
        np.ones((1, 1)),
        np.array([-1]),
        sources,
        bulk.blockers,
    )
    x = 0.5
    quarter = x / np.hypot(1, x) * np.arctan(x / np.hypot(1, x)) / np.pi
    x = 1.0
    whole = x / np.hypot(1, x) * np.arctan(x / np.hypot(1, x)) / np.pi
    seen = found.factors[0]
    # The shade stands for a square twice its size at the height of the plate.
    np.testing.assert_allclose(seen[:4], whole - quarter, rtol=5e-3)
    np.testing.assert_allclose(seen[4:], quarter, rtol=1e-9)


def test_threads_give_the_same_bits(furnished):
    bulk, pick, _ = furnished
    before = set_threads(1)
    try:
        one = bulk.rows(64, pick)
        set_threads(2)
        two = bulk.rows(64, pick)
    finally:
        set_threads(before)
    np.testing.assert_array_equal(one.factors, two.factors)


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_scale_and_offset_change_nothing(furnished, scale):
    bulk, pick, _ = furnished
    parts = FURNISHED
    nets = parts.patches.control_points.copy()
    nets[..., :3] = scale * (nets[..., :3] + nets[..., 3:] * np.array([40.0, -20.0, 10.0]))
    moved = type(parts)(
        PatchSet(nets, parts.patches.face_index, parts.patches.part_index),
        parts.closed,
        parts.solid,
    )
    expected, found = bulk.rows(64, pick), Bulk(moved).rows(64, pick)
    # A meridian may pass a corner on the other side: one span of 64 in one of four nodes.
    difference = np.abs(found.factors - expected.factors)
    assert (difference > 1e-9).mean() < 1e-2
    assert difference.max() < 2e-3


@pytest.mark.parametrize("divisions", [(4, 5), (5, 4), (8, 8), (8, 3), (2, 6)])
def test_a_disc_hides_nothing_of_itself(divisions):
    """Whatever facets its elements have, and with one's corner straight over the receiver."""
    disc = setup(PatchSet.disk((0, 0, 0), 1.0, (0, 0, -1)))
    cuts = np.array([(2, 2)] + [divisions] * 4)
    elements = make_elements(disc.patches, np.zeros(5, bool), cuts)
    nets, n = disc.patches.control_points, len(elements)
    facets, _ = make_facets(elements, nets, disc.closed, disc.solid)
    rim = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    scattered = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 2))
    feet = np.concatenate([np.stack([-np.cos(rim), np.sin(rim)], axis=1), scattered])
    points = np.column_stack([feet, np.full(len(feet), -3.0)])[:, None]
    normals, weights = np.zeros_like(points), np.ones((len(points), 1))
    normals[..., 2] = 1.0
    sources = make_sources(elements, nets, np.full(n, 1e-3), Scan(facets, 48, np.full(n, 9.0)))
    nowhere = np.full(len(points), -1)
    found, plain = (
        form_factor_matrix(
            points, normals, weights, nowhere, sources, disc.blockers, eps=1e-5, trace=trace
        ).factors
        for trace in (True, False)
    )
    np.testing.assert_allclose(found, plain, rtol=1e-12)
