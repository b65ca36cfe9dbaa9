"""Form factors past blockers: closed forms of shadows, references by own rays, invariants.

A body whose outline lies inside that of the source takes away exactly its own form factor; a
straight edge or a long pole takes away what a rectangle behind it would. Elsewhere the reference
is a dense sum over the source with a ray test written here. Sampled values are compared within
their own stated deviation: four of it, as each is a single draw and not all of it is normal.
"""

import math

import numpy as np
import pytest
from patchlight.solver.kernels.threads import set_threads
from patchlight.solver.model import PatchSet

from .fixtures_light import (
    UP,
    Body,
    area_rule,
    ceiling,
    closed_cylinder,
    rectangle,
    rows,
    setup,
    turned,
)

#: Absolute slack beside sampling: 1e-4 is the accuracy of cells that are sampled.
SLACK = 2e-6
DEVIATIONS = 4.0
ORIGIN = (0.0, 0.0, 0.0)


def visible(source, blockers, point=ORIGIN, normal=UP, **options):
    """Factor of ``source`` past ``blockers`` and its standard deviation."""
    found = rows(setup(source, *blockers), point, normal, **options)
    own = slice(0, len(source.patches if isinstance(source, Body) else source))
    return float(found.factors[0, own].sum()), float(np.sqrt(found.variances[0, own].sum()))


def unoccluded(source, point=ORIGIN, normal=UP):
    return float(rows(setup(source), point, normal, trace=False).factors.sum())


def agrees(found, deviation, expected, cell_eps):
    assert abs(found - expected) <= DEVIATIONS * deviation + SLACK + 0.1 * cell_eps


def square_sum(half, z, hidden, n=1500):
    """Factor of the square ceiling |x|, |y| <= half at height z from the origin, by midpoints.

    ``hidden(directions (k, 3))`` tells which segments from the origin to the square are cut. The
    error is that of the cells on the shadow's edge, 1/n of the edge's length at random signs.
    """
    t = (np.arange(n) + 0.5) / n * 2 * half - half
    x, y = np.meshgrid(t, t, indexing="ij")
    p = np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)
    r2 = (p * p).sum(-1)
    value = z * z / (math.pi * r2 * r2) * (2 * half / n) ** 2
    return float(value[~hidden(p)].sum())


def hits_sphere(center, radius):
    c = np.asarray(center, float)

    def test(p):
        a, b = (p * p).sum(-1), p @ c
        disc = b * b - a * (c @ c - radius**2)
        return (disc > 0) & (b > 0) & (b - np.sqrt(np.maximum(disc, 0)) < a)

    return test


def hits_box(size, center):
    low, high = (
        np.asarray(center) - 0.5 * np.asarray(size),
        np.asarray(center) + 0.5 * np.asarray(size),
    )

    def test(p):
        with np.errstate(divide="ignore", invalid="ignore"):
            t0, t1 = low / p, high / p
        near, far = np.minimum(t0, t1), np.maximum(t0, t1)
        outside = (p == 0) & ((low > 0) | (high < 0))
        near, far = near.max(-1), far.min(-1)
        return (near < far) & (far > 0) & (near < 1) & ~outside.any(-1)

    return test


LAMP = ceiling(-1.5, 1.5, -1.5, 1.5, 2.0)


def within_the_worst(found, expected, cell_eps):
    """Bound without statistics: every cell on the outline wrong by half of itself.

    Cells of factor e along an outline whose cells fill a share of the hemisphere: ~ sqrt(e).
    """
    assert abs(found - expected) <= 0.5 * math.sqrt(cell_eps)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
@pytest.mark.parametrize("cell_eps", [1e-3, 1e-5])
def test_sphere_inside_the_outline(tilt, cell_eps):
    normal = (math.sin(tilt), 0.0, math.cos(tilt))
    ball = Body(PatchSet.sphere((0, 0, 1.2), 0.3))
    expected = unoccluded(LAMP, normal=normal) - (0.3 / 1.2) ** 2 * math.cos(tilt)
    found, deviation = visible(LAMP, [ball], normal=normal, cell_eps=cell_eps)
    agrees(found, deviation, expected, cell_eps)


@pytest.mark.parametrize(
    "center", [(1.0, 0.2, 1.2), (0.7, 0.7, 1.0), (-0.6, 0.0, 0.5), (0.0, 0.0, 0.31)]
)
def test_sphere_across_the_outline(center):
    ball = Body(PatchSet.sphere(center, 0.3))
    expected = square_sum(1.5, 2.0, hits_sphere(center, 0.3))
    found, deviation = visible(LAMP, [ball], cell_eps=1e-5)
    # The reference's own 1500² cells leave 2e-5.
    assert abs(found - expected) <= DEVIATIONS * deviation + 2e-5


@pytest.mark.parametrize(
    ("size", "center"),
    [
        ((0.5, 0.3, 0.2), (0.1, 0.0, 1.0)),
        ((0.5, 0.3, 0.2), (0.6, -0.5, 1.4)),
        ((0.02, 5.0, 0.02), (0.2, 0.0, 1.0)),
        ((3.0, 3.0, 0.01), (1.6, 1.6, 1.0)),
    ],
)
def test_box_before_a_square(size, center):
    expected = square_sum(1.5, 2.0, hits_box(size, center))
    found, deviation = visible(LAMP, [Body(PatchSet.box(size, center))], cell_eps=1e-5)
    # Edges along the cells of the sum may be off by half a cell: 1e-3 x 2.4 m of 1 / (4 π) a m².
    assert abs(found - expected) <= DEVIATIONS * deviation + 2e-4


def strip_behind_pole(radius):
    """What a pole along y takes away: it reaches beyond the source on both sides."""
    middle, half = math.atan2(0.3, 1.0), math.asin(radius / math.hypot(0.3, 1.0))
    x0, x1 = 2 * math.tan(middle - half), 2 * math.tan(middle + half)
    return unoccluded(ceiling(x0, x1, -1.5, 1.5, 2.0))


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("radius", [1e-3, 1e-2, 0.1])
def test_pole_narrower_than_any_cell(radius, closed):
    pole = closed_cylinder((0.3, -9, 1), (0.3, 9, 1), radius)
    hidden = strip_behind_pole(radius)
    blocker = pole if closed else pole.patches
    found, _ = visible(LAMP, [blocker], cell_eps=1e-5, levels=12)
    within_the_worst(found, unoccluded(LAMP) - hidden, 1e-5)
    # It must be seen at all: the thinnest takes 1e-3 away.
    assert found < unoccluded(LAMP) - 0.5 * hidden


@pytest.mark.parametrize("radius", [1e-3, 1e-2, 0.1])
def test_pole_within_the_stated_deviation(radius):
    pole = closed_cylinder((0.3, -9, 1), (0.3, 9, 1), radius)
    found, deviation = visible(LAMP, [pole], cell_eps=1e-5, levels=12)
    agrees(found, deviation, unoccluded(LAMP) - strip_behind_pole(radius), 1e-5)


@pytest.mark.parametrize("x", [0.0, 0.1, 0.37, -0.5])
def test_straight_edge_before_a_square(x):
    """Half a plane: what is left is a rectangle. At x = 0 it follows the cells' edges."""
    sheet = ceiling(x, 5.0, -5.0, 5.0, 1.0)
    expected = unoccluded(ceiling(-1.5, 2 * x, -1.5, 1.5, 2.0))
    found, _ = visible(LAMP, [sheet], cell_eps=1e-5)
    within_the_worst(found, expected, 1e-5)


@pytest.mark.parametrize("x", [0.0, 0.1, 0.37, -0.5])
def test_straight_edge_within_the_stated_deviation(x):
    sheet = ceiling(x, 5.0, -5.0, 5.0, 1.0)
    expected = unoccluded(ceiling(-1.5, 2 * x, -1.5, 1.5, 2.0))
    found, deviation = visible(LAMP, [sheet], cell_eps=1e-5)
    agrees(found, deviation, expected, 1e-5)


def test_errors_along_an_edge_that_cuts_many_elements_alike_do_not_add_up():
    """Of 40 strips that one edge cuts at the same place the sum is as sure as it says."""
    strips = np.linspace(-2.0, 2.0, 41)
    lamps = [ceiling(-1.5, 1.5, a, b, 2.0) for a, b in zip(strips, strips[1:], strict=False)]
    off = []
    for x in np.linspace(-0.61, 0.57, 25):  # along no cells
        sheet = Body(ceiling(x, 5.0, -9.0, 9.0, 1.0))
        found = rows(setup(*map(Body, lamps), sheet), ORIGIN, UP, cell_eps=1e-4)
        expected = unoccluded(ceiling(-1.5, 2 * x, -2.0, 2.0, 2.0))
        deviation = math.sqrt(float(found.variances[0, :40].sum(dtype=float)))
        off.append((float(found.factors[0, :40].sum()) - expected) / deviation)
    # One pattern of samples in all strips would give up to sqrt(40), 6.3; 25 numbers scatter by a
    # seventh.
    assert 0.4 <= math.sqrt(np.mean(np.square(off))) <= 1.5, off


@pytest.mark.parametrize("turn", [0.2, 0.5, 0.9])
def test_slanting_edge_before_a_square(turn):
    """The same edge at an angle to the cells; the visible part is cut out by own rays."""
    c, s = math.cos(turn), math.sin(turn)
    across = np.array([c, s, 0.0])
    along = np.array([-s, c, 0.0])
    a = np.array([0.0, 0.0, 1.0]) + 0.1 * across
    sheet = rectangle(
        a - 9 * along, a + 9 * along, a + 9 * along + 9 * across, a - 9 * along + 9 * across
    )
    expected = square_sum(1.5, 2.0, lambda p: p @ across > 2 * 0.1)
    found, deviation = visible(LAMP, [sheet], cell_eps=1e-5)
    assert abs(found - expected) <= DEVIATIONS * deviation + 2e-5


@pytest.mark.parametrize("axis", [(1, 0, 0), (1.0, 2.0, -0.7)])
@pytest.mark.parametrize("cell_eps", [1e-3, 1e-4, 1e-5])
def test_sphere_turned_away_from_its_pole(axis, cell_eps):
    move = turned(1.1, axis, (0.0, 0.0, 1.2))
    ball = Body(PatchSet.sphere((0, 0, 0), 0.3).moved(move))
    found, deviation = visible(LAMP, [ball], cell_eps=cell_eps)
    agrees(found, deviation, unoccluded(LAMP) - (0.3 / 1.2) ** 2, cell_eps)


def test_disk_hides_its_own_factor():
    disk = PatchSet.disk((0.1, 0.0, 1.0), 0.2, (0.0, 0.3, 1.0))
    expected = unoccluded(LAMP) - unoccluded(disk.flipped())
    found, deviation = visible(LAMP, [disk], cell_eps=1e-5)
    agrees(found, deviation, expected, 1e-5)


def test_falls_towards_the_truth_with_the_cell_size():
    """Error and stated deviation fall; sampled cells lie on the outline, so ~ cell_eps^(3/4)."""
    ball = Body(PatchSet.sphere((0.31, 0.13, 1.1), 0.27))
    distance2 = 0.31**2 + 0.13**2 + 1.1**2
    expected = unoccluded(LAMP) - 0.27**2 / distance2 * 1.1 / math.sqrt(distance2)
    steps = [visible(LAMP, [ball], cell_eps=e, levels=14) for e in (1e-2, 1e-3, 1e-4, 1e-5)]
    errors = [abs(found - expected) for found, _ in steps]
    deviations = [deviation for _, deviation in steps]
    assert all(b < 0.5 * a for a, b in zip(deviations, deviations[1:], strict=False))
    assert all(e <= DEVIATIONS * d + SLACK for e, d in zip(errors, deviations, strict=True))
    assert errors[-1] < 0.02 * errors[0]


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_scale_changes_no_shadow(scale):
    def at(s):
        ball = Body(PatchSet.sphere((0.2 * s, 0.1 * s, 1.0 * s), 0.3 * s))
        lamp = ceiling(-1.5 * s, 1.5 * s, -1.5 * s, 1.5 * s, 2.0 * s)
        return visible(lamp, [ball], cell_eps=1e-4)[0]

    # Cells are decided alike; a cell on the edge of a decision may fall to the other side.
    assert at(scale) == pytest.approx(at(1.0), abs=1e-5)


def test_rigid_motion_changes_no_shadow():
    move = turned(0.8)
    ball = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
    at_home = visible(LAMP, [Body(ball)], cell_eps=1e-4)[0]
    moved = visible(
        LAMP.moved(move),
        [Body(ball.moved(move))],
        point=move[:3, 3],
        normal=move[:3, :3] @ np.array(UP),
        cell_eps=1e-4,
    )[0]
    assert moved == pytest.approx(at_home, abs=1e-5)


def furnished(*, table=True):
    """A room with a column, a ball and a table: receivers on a plane, all patches."""
    bodies = [
        Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True)),
        Body(PatchSet.sphere((0.9, 1.2, 0.9), 0.4)),
        closed_cylinder((-1.2, 0.3, 0.0), (-1.2, 0.3, 2.7), 0.2),
    ]
    if table:
        bodies.append(Body(PatchSet.box((1.6, 0.8, 0.05), center=(0.3, -1.0, 0.75))))
    return setup(*bodies)


POINTS = np.array(
    [(x, y, z) for x in (-1.7, 0.1, 1.6) for y in (-2.1, 0.05, 2.2) for z in (0.02, 1.5)]
)
NORMALS = np.array([UP, (0.6, 0.0, 0.8), (0.0, -1.0, 0.0)] * 6)


@pytest.fixture(scope="module")
def room_rows():
    return rows(furnished(), POINTS, NORMALS, cell_eps=1e-3)


def test_closed_room_sends_every_ray_somewhere(room_rows):
    deviation = np.sqrt(room_rows.variances.sum(axis=1, dtype=float))
    defect = np.abs(room_rows.factors.sum(axis=1) - 1.0)
    assert (defect <= DEVIATIONS * deviation + 1e-4).all(), (defect, deviation)


def test_visible_is_never_more_than_unoccluded(room_rows):
    free = rows(furnished(), POINTS, NORMALS, trace=False).factors
    assert (room_rows.factors <= free + 1e-6 + 1e-4 * free).all()
    assert (room_rows.factors >= 0.0).all()


def test_a_blocker_raises_no_factor(room_rows):
    """The same room without the table: everything else is seen at least as well."""
    without = rows(furnished(table=False), POINTS, NORMALS, cell_eps=1e-3)
    n = without.factors.shape[1]
    noise = DEVIATIONS * np.sqrt(
        room_rows.variances[:, :n].astype(float) + without.variances.astype(float)
    )
    assert (room_rows.factors[:, :n] <= without.factors + noise + 1e-5).all()


def test_splitting_the_sources_changes_no_sum(room_rows):
    parts = furnished()
    fine = parts.patches.refined()  # four quarters, one after the other
    n = len(parts.patches)
    order = np.argsort(np.tile(np.arange(n), 4), kind="stable")
    owner = np.repeat(np.arange(n), 4)
    found = rows(
        type(parts)(fine.take(order), parts.closed[owner], parts.solid[owner]),
        POINTS,
        NORMALS,
        cell_eps=1e-3,
    )
    total = found.factors.reshape(len(POINTS), n, 4).sum(axis=2)
    variance = found.variances.astype(float).reshape(len(POINTS), n, 4).sum(axis=2)
    noise = DEVIATIONS * np.sqrt(variance + room_rows.variances)
    assert (np.abs(total - room_rows.factors) <= noise + 1e-4).all()


def test_same_bits_for_any_number_of_threads(room_rows):
    previous = set_threads(1)
    try:
        one = rows(furnished(), POINTS, NORMALS, cell_eps=1e-3)
    finally:
        set_threads(previous)
    set_threads(2)
    two = rows(furnished(), POINTS, NORMALS, cell_eps=1e-3)
    set_threads(previous)
    assert np.array_equal(one.factors, two.factors)
    assert np.array_equal(one.variances, two.variances)
    assert one.counters == two.counters


def test_order_of_patches_changes_nothing():
    parts = furnished()
    order = np.random.default_rng(3).permutation(len(parts.patches))
    other = type(parts)(parts.patches.take(order), parts.closed[order], parts.solid[order])
    found = rows(other, POINTS[:4], NORMALS[:4], cell_eps=1e-3)
    expected = rows(parts, POINTS[:4], NORMALS[:4], cell_eps=1e-3)
    noise = DEVIATIONS * np.sqrt(expected.variances[:, order].astype(float))
    assert (np.abs(found.factors - expected.factors[:, order]) <= noise + 1e-6).all()


def test_box_in_box_exchanges_nothing():
    """What is outside a closed box sees nothing of what is inside, and the other way round."""
    shell = [
        Body(PatchSet.box((2, 2, 2))),
        Body(PatchSet.box((1.8, 1.8, 1.8), inward=True)),
        Body(PatchSet.box((0.5, 0.5, 0.5))),
        Body(PatchSet.box((6, 6, 6), inward=True)),
    ]
    parts = setup(*shell)
    outside = rows(parts, [(2.2, 0.3, 0.1), (0.1, 0.2, -2.4)], [(-1, 0, 0), (0, 0, 1)])
    inside = rows(parts, [(0.7, 0.3, 0.1), (-0.2, 0.1, 0.6)], [(-1, 0, 0), (0, 0, -1)])
    assert (outside.factors[:, 6:18] == 0.0).all()
    assert (inside.factors[:, :6] == 0.0).all()
    assert (inside.factors[:, 18:] == 0.0).all()


@pytest.mark.parametrize("seam", [0.0, 0.05, 0.123])
def test_sheets_with_a_common_edge_leak_nothing(seam):
    left = ceiling(-4, seam, -4, 4, 1.0)
    right = ceiling(seam, 4, -4, 4, 1.0)
    one_sheet = PatchSet.concatenated(left, right)
    assert visible(LAMP, [one_sheet], cell_eps=1e-4)[0] == 0.0
    assert visible(LAMP, [left, right], cell_eps=1e-4)[0] <= 1e-9


@pytest.mark.parametrize("seam", [0.0, 0.05, 0.123])
def test_boxes_side_by_side_leak_nothing(seam):
    left = Body(PatchSet.box((4, 8, 0.1), center=(seam - 2, 0, 1)))
    right = Body(PatchSet.box((4, 8, 0.1), center=(seam + 2, 0, 1)))
    assert visible(LAMP, [left, right], cell_eps=1e-4)[0] <= 1e-9


def test_overlapping_blockers_count_once():
    balls = [Body(PatchSet.sphere((0, 0, 1.2), 0.3)), Body(PatchSet.sphere((0, 0, 1.3), 0.3))]
    found, deviation = visible(LAMP, balls, cell_eps=1e-5)
    agrees(found, deviation, unoccluded(LAMP) - (0.3 / 1.2) ** 2, 1e-5)


@pytest.mark.parametrize(
    "blocker",
    [
        Body(PatchSet.box((3, 3, 0.2), center=(0, 0, 2.2))),
        Body(PatchSet.box((1, 1, 0.2), center=(0, 0, -0.2))),
        Body(PatchSet.sphere((0.4, 0, 2.5), 0.4)),
        Body(PatchSet.sphere((3.0, 0, 0.4), 0.3)),
        ceiling(-3, 3, -3, 3, 2.1),
        ceiling(-3, 3, -3, 3, -1e-3),
    ],
    ids=["box behind", "box below", "ball behind", "ball aside", "sheet behind", "sheet below"],
)
def test_what_is_not_in_the_way_changes_nothing(blocker):
    assert visible(LAMP, [blocker], cell_eps=1e-4) == (
        pytest.approx(unoccluded(LAMP), abs=1e-9),
        0.0,
    )


def test_blocker_touching_the_source():
    """A box hanging on the lamp hides the part of it that it covers and what its sides hide."""
    box = Body(PatchSet.box((0.6, 0.6, 0.4), center=(0.0, 0.0, 1.8)))
    expected = unoccluded(LAMP) - unoccluded(ceiling(-0.3, 0.3, -0.3, 0.3, 1.6))
    found, deviation = visible(LAMP, [box], cell_eps=1e-5)
    agrees(found, deviation, expected, 1e-5)


def test_blocker_through_the_plane_of_the_receiver():
    """A wall that goes through the receiver's plane hides the half of the lamp behind it."""
    wall = Body(PatchSet.box((0.2, 20, 20), center=(0.6, 0, 0)))
    lamp = ceiling(0.0, 4.0, -1.5, 1.5, 2.0)
    expected = unoccluded(ceiling(0.0, 0.5, -1.5, 1.5, 2.0))
    found, deviation = visible(lamp, [wall], cell_eps=1e-5)
    agrees(found, deviation, expected, 1e-5)


@pytest.mark.parametrize("cell_eps", [1e-2, 1e-3, 1e-4])
def test_torus_past_itself(cell_eps):
    """From its centre the inner half of a torus is seen, and nothing hides any of it."""
    ring = Body(PatchSet.torus((0, 0, 0), UP, 2.0, 0.5))
    e = math.asin(0.25)
    expected = (2 * e + math.sin(2 * e)) / math.pi
    found = rows(setup(ring), ORIGIN, (1, 0, 0), cell_eps=cell_eps)
    deviation = math.sqrt(float(found.variances.sum()))
    # A bias shows before it is four deviations: the sign is the same at every size of cell.
    assert abs(found.factors.sum() - expected) <= 1.5 * deviation


def test_slats_hide_more_the_more_they_are_closed():
    """A blind of 20 slats before a window: monotone in their angle, closed it hides all."""
    window = rectangle((-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1))
    pitch, values = 0.1, []
    for angle in (0.0, 0.3, 0.6, 0.9, 1.2, 0.5 * math.pi):
        c, s = 0.5 * 1.1 * pitch * math.cos(angle), 0.5 * 1.1 * pitch * math.sin(angle)
        slats = [
            rectangle((-4, 1 - c, z - s), (4, 1 - c, z - s), (4, 1 + c, z + s), (-4, 1 + c, z + s))
            for z in (np.arange(22) - 10.5) * pitch
        ]
        values.append(visible(window, slats, normal=(0, 1, 0), cell_eps=1e-4)[0])
    assert values[-1] == pytest.approx(0.0, abs=1e-9)
    assert all(b < a for a, b in zip(values, values[1:], strict=False))


@pytest.mark.parametrize("side", [1e-1, 1e-2, 1e-3])
def test_pinhole(side):
    """A hole in a sheet of four rectangles lets through the factor of the hole itself."""
    h, r = 0.5 * side, 4.0
    sheet = PatchSet.concatenated(
        ceiling(-r, -h, -r, r, 1.0),
        ceiling(h, r, -r, r, 1.0),
        ceiling(-h, h, -r, -h, 1.0),
        ceiling(-h, h, h, r, 1.0),
    )
    hole = unoccluded(ceiling(-h, h, -h, h, 1.0))
    found, deviation = visible(LAMP, [sheet], cell_eps=1e-3 * hole, levels=16)
    assert found == pytest.approx(hole, abs=DEVIATIONS * deviation + 1e-3 * hole)


def test_receiver_on_a_surface_of_the_room_sees_past_furniture():
    """Receivers on a body: their own convex patch is dark, and the row still adds up to one."""
    parts = furnished()
    ball = np.flatnonzero(parts.solid == 1)
    points, normals, _ = area_rule(parts.patches.take(ball), 1)
    found = rows(parts, points, normals, on_patch=ball, cell_eps=1e-3)
    assert (found.factors[np.arange(len(ball)), ball] == 0.0).all()
    deviation = np.sqrt(found.variances.sum(axis=1, dtype=float))
    assert (np.abs(found.factors.sum(axis=1) - 1.0) <= DEVIATIONS * deviation + 1e-4).all()
