"""Public form factors: proved brackets past blockers, invariants, and further closed forms.

Closed forms as listed in J. R. Howell, "A Catalog of Radiation Heat Transfer Configuration
Factors"; those of test_closed_forms.py are not repeated. Points have a closed form or one
quadrature: 1e-7. Infinite bodies are cut at ±L: the cut-off angles take (r/L)² or less.
"""

import math
import subprocess
import sys

import numpy as np
import pytest
from patchlight.solver import FormFactors, PatchSet, form_factors, point_form_factors
from patchlight.solver.errors import InputError
from patchlight.solver.kernels.threads import set_threads

from .fixtures_light import UP, ceiling, rectangle, turned

ORIGIN = (0.0, 0.0, 0.0)
LAMP = ceiling(-1.5, 1.5, -1.5, 1.5, 2.0)


def strict(sources, blockers=None, points=ORIGIN, normals=UP, accuracy=1e-4) -> FormFactors:
    found = point_form_factors(
        points, normals, sources, blockers, accuracy=accuracy, visibility="strict"
    )
    assert found.proved
    assert (found.low <= found.value).all() and (found.value <= found.high).all()
    return found


def plain(sources, points=ORIGIN, normals=UP, accuracy=1e-9):
    return point_form_factors(points, normals, sources, accuracy=accuracy, visibility="none").value


def holds(found, truth, slack=1e-10):
    """The bracket contains the truth; slack: rounding, and quadrature of the truth."""
    assert (found.low.sum(axis=1) <= truth + slack).all()
    assert (found.high.sum(axis=1) >= truth - slack).all()


# --- what goes in


def test_importing_the_solver_loads_nothing_heavy():
    code = (
        "import sys, patchlight.solver as s; s.PatchSet; s.FormFactors; s.point_form_factors;"
        "s.form_factors; assert callable(s.form_factors);"
        "print([m for m in ('numba', 'scipy') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "options",
    [{"accuracy": 0.0}, {"accuracy": math.nan}, {"visibility": "some"}, {"method": "old"}],
)
def test_options_that_cannot_be_used(options):
    with pytest.raises(InputError):
        point_form_factors(ORIGIN, UP, LAMP, **options)


@pytest.mark.parametrize(
    ("points", "normals"),
    [((0, 0, math.inf), UP), (ORIGIN, (0, 0, 0)), ((0, 0), UP), (ORIGIN, np.ones((2, 3)))],
)
def test_receivers_that_cannot_be_used(points, normals):
    with pytest.raises(InputError):
        point_form_factors(points, normals, LAMP)


@pytest.mark.parametrize("visibility", ["auto", "strict", "none"])
def test_empty_sets_give_empty_arrays(visibility):
    found = point_form_factors(np.zeros((0, 3)), UP, LAMP, visibility=visibility)
    assert found.value.shape == (0, 1)


# --- semantics


@pytest.mark.parametrize("visibility", ["auto", "strict", "none"])
def test_only_the_front_of_a_source_counts(visibility):
    found = point_form_factors(ORIGIN, UP, LAMP.flipped(), visibility=visibility)
    assert found.value[0, 0] == 0.0 and found.high[0, 0] <= 1e-11


@pytest.mark.parametrize("visibility", ["auto", "strict"])
def test_a_blocker_identical_to_a_source_is_none(visibility):
    expected = plain(LAMP)[0, 0]
    same = PatchSet.concatenated(LAMP, LAMP.flipped())
    found = point_form_factors(ORIGIN, UP, LAMP, same, visibility=visibility)
    assert found.value[0, 0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("visibility", ["auto", "strict"])
def test_sources_hide_one_another_also_with_their_backs(visibility):
    near = ceiling(-0.4, 0.4, -0.4, 0.4, 1.0).flipped()
    found = point_form_factors(ORIGIN, UP, PatchSet.concatenated(LAMP, near), visibility=visibility)
    expected = plain(LAMP)[0, 0] - plain(near.flipped())[0, 0]
    assert found.value[0] == pytest.approx([expected, 0.0], abs=2e-4)


def test_rows_are_nodes_and_columns_elements():
    floor = rectangle((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    found = form_factors(PatchSet.concatenated(floor, LAMP), accuracy=1e-6)
    assert found.value.shape == (8, 2)
    assert (found.value[:4, 0] == 0.0).all() and (found.value[:4, 1] > 0.3).all()


# --- strict: brackets


def sphere_shadow(center, radius):
    c = np.asarray(center, float)
    d = np.linalg.norm(c)
    return (radius / d) ** 2 * c[2] / d


def test_unoccluded_brackets_are_as_narrow_as_rounding():
    found = strict(PatchSet.disk((0, 0, 0.6), 1.1, (0, 0, -1)))
    holds(found, 1.1**2 / (1.1**2 + 0.6**2), 1e-13)
    assert found.width.max() <= 1e-12


def test_penumbra_of_a_sphere_before_a_square():
    """21 points on a line: from full light through the penumbra into the umbra and out again."""
    ball = PatchSet.sphere((0, 0, 1.2), 0.3)
    x = np.linspace(-4, 4, 21)
    points = np.stack([x, 0 * x, 0 * x], axis=1)
    found = strict(LAMP, ball, points)
    assert found.width.max() <= 1e-4
    for k in range(21):
        # The reference by rings: rays to 600 x 600 midpoints, an error of 1e-5 or less.
        t = (np.arange(600) + 0.5) / 200 - 1.5
        px, py = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
        d = np.stack([px - x[k], py, np.full_like(px, 2.0)], axis=-1)
        c = np.array([-x[k], 0, 1.2])
        a, b = (d * d).sum(1), d @ c
        lit = ~((b * b - a * (c @ c - 0.09) > 0) & (b > 0))
        truth = float((4.0 / (math.pi * a * a))[lit].sum() / 200**2)
        assert found.low[k, 0] - 4e-5 <= truth <= found.high[k, 0] + 4e-5


@pytest.mark.parametrize("center", [(0, 0, 1.2), (0.05, 0.02, 1.2), (-0.2, 0.1, 0.7)])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-5])
def test_sphere_inside_the_outline_takes_away_its_own_factor(center, accuracy):
    found = strict(LAMP, PatchSet.sphere(center, 0.2), accuracy=accuracy)
    holds(found, plain(LAMP)[0, 0] - sphere_shadow(center, 0.2))
    assert found.width.max() <= accuracy


def slats(count, width=0.008, tilt=0.02):
    y = np.linspace(-1, 1, count)
    return PatchSet.from_bilinear(
        [[(-2, a, 1), (2, a, 1), (2, a + width, 1 + tilt), (-2, a + width, 1 + tilt)] for a in y]
    )


def test_blind_of_a_hundred_slats():
    """Slats wider than the lamp as seen: they take away the factors of strips of the lamp."""
    blind = slats(100)
    found = strict(LAMP, blind)
    assert found.width.max() <= 1e-4
    hidden, end = 0.0, -1.5
    for a in np.linspace(-1, 1, 100):
        # A slat hides what lies between the planes through its edges, on the lamp at z = 2;
        # towards the sides neighbours overlap.
        y0, y1 = sorted((2 * a, 2 * (a + 0.008) / 1.02))
        y0, y1 = max(y0, end), min(y1, 1.5)
        if y1 > y0:
            hidden += plain(ceiling(-1.5, 1.5, y0, y1, 2.0))[0, 0]
            end = y1
    holds(found, plain(LAMP)[0, 0] - hidden)


@pytest.mark.parametrize("radius", [1e-2, 1e-4])
def test_a_thin_pole_is_never_lost(radius):
    """Narrower than any cell: the bracket may be no wider than asked, yet has to hold it."""
    pole = PatchSet.cylinder((-9, 0, 1), (9, 0, 1), radius)
    half = math.asin(radius)
    y = 2 * math.tan(half)
    hidden = plain(ceiling(-1.5, 1.5, -y, y, 2.0))[0, 0]
    accuracy = 0.1 * hidden
    found = strict(LAMP, pole, accuracy=accuracy)
    holds(found, plain(LAMP)[0, 0] - hidden)
    assert found.high[0, 0] < plain(LAMP)[0, 0]


def test_two_blockers_that_share_an_edge_leak_nothing():
    pair = PatchSet.concatenated(ceiling(-2, 0.1, -2, 2, 1.0), ceiling(0.1, 2, -2, 2, 1.0))
    found = strict(LAMP, pair)
    assert found.high[0, 0] == 0.0


def test_curved_blockers_that_touch_leak_nothing():
    """Three quarters of a closed cylinder with the receiver inside."""
    tube = PatchSet.cylinder((0, 0, -1), (0, 0, 1), 1.0, inward=True)
    lid = PatchSet.disk((0, 0, 1), 1.0, (0, 0, -1))
    found = strict(LAMP, PatchSet.concatenated(tube, lid))
    # The rim of the lid is a curved edge where both are seen from the front.
    assert found.high[0, 0] <= 1e-4


@pytest.mark.parametrize("seed", range(4))
def test_adding_a_blocker_never_raises(seed):
    rng = np.random.default_rng(seed)
    blockers, previous = None, strict(LAMP)
    for _ in range(4):
        more = PatchSet.sphere(rng.uniform((-1, -1, 0.5), (1, 1, 1.5)), rng.uniform(0.05, 0.3))
        blockers = more if blockers is None else PatchSet.concatenated(blockers, more)
        found = strict(LAMP, blockers, accuracy=1e-3)
        assert (found.low <= previous.high).all()
        previous = found


def test_overlapping_blockers_count_as_their_union():
    first, second = ceiling(-0.5, 0.2, -0.4, 0.4, 1.0), ceiling(-0.2, 0.5, -0.4, 0.4, 1.1)
    found = strict(LAMP, PatchSet.concatenated(first, second))
    y = 0.8 / 1.1
    union = [ceiling(-1.0, 0.4, -0.8, 0.8, 2.0), ceiling(-0.4 / 1.1, 1 / 1.1, -y, y, 2.0)]
    both = ceiling(-0.4 / 1.1, 0.4, -y, y, 2.0)
    hidden = sum(plain(u)[0, 0] for u in union) - plain(both)[0, 0]
    holds(found, plain(LAMP)[0, 0] - hidden)


def test_brackets_are_nested_under_refinement():
    ball = PatchSet.sphere((0.4, 0.1, 1.0), 0.3)
    found = [strict(LAMP, ball, accuracy=a) for a in (0.3, 1e-2, 1e-3, 1e-5)]
    for coarse, fine in zip(found, found[1:], strict=False):
        assert (fine.low >= coarse.low).all() and (fine.high <= coarse.high).all()
        assert fine.width.max() < coarse.width.max()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_rigid_motion_and_scale(scale):
    ball = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
    before = strict(LAMP, ball)
    move = turned(0.7)
    grow = np.diag([scale, scale, scale, 1.0])
    point, normal = grow @ move @ [0, 0, 0, 1], move @ [0, 0, 1, 0]
    found = strict(
        LAMP.moved(move).moved(grow), ball.moved(move).moved(grow), point[:3], normal[:3]
    )
    # Cells are the same up to ties broken by rounding: the brackets must agree, not the bits.
    assert (found.low <= before.high).all() and (found.high >= before.low).all()
    np.testing.assert_allclose(found.value, before.value, rtol=1e-4)


def test_bits_do_not_depend_on_the_number_of_threads():
    ball = PatchSet.sphere((0.4, 0.1, 1.0), 0.3)
    points = np.stack([np.linspace(-1, 1, 6), np.zeros(6), np.zeros(6)], axis=1)
    previous = set_threads(1)
    try:
        one = strict(LAMP, ball, points)
        set_threads(2)
        two = strict(LAMP, ball, points)
    finally:
        set_threads(previous)
    assert one.low.tobytes() == two.low.tobytes() and one.high.tobytes() == two.high.tobytes()


def test_silhouettes_of_the_source_are_bracketed():
    source = PatchSet.sphere((0.3, 0.2, 3), 1.0)
    found = strict(source)
    holds(found, sphere_shadow((0.3, 0.2, 3), 1.0))
    assert found.width.sum() <= 1e-4


def test_auto_agrees_with_strict():
    ball = PatchSet.sphere((0.3, -0.2, 1.1), 0.25)
    points = [(0, 0, 0), (0.5, 0.2, 0.1), (-1, 0, 0.3)]
    sure = strict(LAMP, ball, points, accuracy=1e-5)
    found = point_form_factors(points, UP, LAMP, ball, accuracy=1e-3)
    assert not found.proved
    np.testing.assert_allclose(found.value, sure.value, rtol=1e-3)


# --- stress: points, horizon, scale, Bézier, visibility


@pytest.mark.parametrize("height", [1e-1, 1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("where", [(0.0, 0.0, 1.0), (1.5, 0.0, 0.5), (1.5, 1.5, 0.25)])
def test_point_close_below_a_plane(height, where):
    x, y, limit = where
    found = strict(LAMP, None, (x, y, 2.0 - height))
    # The edges are seen 1.5 away: what is missing falls with height (2 / 1.5 at an edge).
    assert found.value[0, 0] == pytest.approx(limit, abs=2 * height + 1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-15, -1e-15])
def test_point_in_the_plane_of_a_source(off):
    found = strict(LAMP, None, (4.0, 0.0, 2.0 + off), (-1, 0, 0))
    assert found.value[0, 0] <= 1e-14


def test_point_on_a_convex_patch_does_not_see_it():
    ball = PatchSet.sphere((0, 0, 0), 1.0)
    p = np.array([1.0, 2.0, 2.0]) / 3.0
    found = point_form_factors(p, p, ball)
    assert found.value.max() <= 1e-12


def test_edge_tangent_to_the_horizon():
    """A disc standing on the receiver's plane, touching it in one point (double root)."""
    source = PatchSet.disk((2, 0, 0.5), 0.5, (-1, 0, 0))
    found = strict(source, None)
    t = (np.arange(4000) + 0.5) / 4000
    r, q = 0.5 * np.sqrt(t), 2 * math.pi * (np.arange(400) + 0.5) / 400
    y, z = np.outer(r, np.cos(q)), 0.5 + np.outer(r, np.sin(q))
    truth = float((2 * z / (math.pi * (4 + y * y + z * z) ** 2)).mean() * math.pi * 0.25)
    holds(found, truth, 1e-7)


def test_a_sliver_and_a_far_patch():
    sliver = ceiling(-5, 5, 0, 1e-3, 1.0)
    holds(strict(sliver), plain(sliver)[0, 0], 1e-12)
    far = ceiling(-0.5, 0.5, -0.5, 0.5, 1e6)
    found = strict(far)
    # Cancellation: 1e-16 of edges seen under 1e-6 of a turn.
    assert found.value[0, 0] == pytest.approx(1 / (math.pi * 1e12), abs=1e-12)


@pytest.mark.parametrize("turn", ["u", "v", "both"])
def test_parameters_may_run_either_way(turn):
    ball = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
    nets = ball.control_points
    nets = {"u": nets[:, ::-1], "v": nets[:, :, ::-1], "both": nets.swapaxes(1, 2)}[turn]
    found, before = strict(LAMP, PatchSet(nets)), strict(LAMP, ball)
    assert (found.low <= before.high).all() and (found.high >= before.low).all()


def test_weights_may_have_any_scale():
    ball = PatchSet.sphere((0.2, 0.1, 1.0), 0.3)
    tiny = PatchSet(ball.control_points * 1e-30)
    np.testing.assert_allclose(strict(LAMP, tiny).value, strict(LAMP, ball).value, rtol=1e-4)


def test_blockers_behind_change_nothing():
    behind = PatchSet.concatenated(ceiling(-5, 5, -5, 5, 2.5), ceiling(-5, 5, -5, 5, -0.1))
    assert strict(LAMP, behind).value[0, 0] == pytest.approx(plain(LAMP)[0, 0], abs=1e-12)


def test_pinhole():
    """Four walls about a hole of 1e-3: the bracket holds the area law of the hole."""
    e = 5e-4
    plate = PatchSet.concatenated(
        ceiling(-3, 3, e, 3, 1), ceiling(-3, 3, -3, -e, 1), ceiling(-3, -e, -e, e, 1),
        ceiling(e, 3, -e, e, 1),
    )  # fmt: skip
    found = strict(LAMP, plate)
    expected = plain(ceiling(-e, e, -e, e, 1.0))[0, 0]
    holds(found, expected)
    assert found.width.max() <= 1e-4


def test_boxes_within_boxes_exchange_nothing():
    inner, outer = PatchSet.box((1, 1, 1)), PatchSet.box((3, 3, 3), inward=True)
    found = strict(outer, PatchSet.box((2, 2, 2)), (0, 0, 0.9), UP)
    assert found.high.max() == 0.0
    assert strict(inner, PatchSet.box((2, 2, 2)), (0, 0, 1.2), (0, 0, -1)).high.max() <= 1e-4


@pytest.mark.parametrize("inward", [False, True])
def test_a_receiver_inside_a_curve_is_hidden_by_what_it_lies_on(inward):
    """The wall of a tube hides what is behind it from its own inner side, whichever side is +."""
    wall = PatchSet.cylinder((0, 0, -5), (0, 0, 5), 1.0, inward=inward)
    corners = wall.control_points[:, ::3, ::3, :2] / wall.control_points[:, ::3, ::3, 3:]
    quarter = wall.take(np.flatnonzero((corners > -1e-9).all(axis=(1, 2, 3))))
    assert len(quarter) == 1  # from (1, 0) to (0, 1)
    lamp = rectangle((0.9, 0.7, 0), (0.9, 0.7, 1), (0.7, 0.9, 1), (0.7, 0.9, 0))
    inside, inwards = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
    free = plain(lamp, inside, inwards).sum()
    assert free > 1e-3
    # The wall is seen edge-on where the receiver is, so that the bracket stays wide.
    holds(strict(lamp, quarter, inside, inwards, accuracy=0.5), 0.0)


@pytest.mark.parametrize("visibility", ["auto", "strict"])
def test_the_near_wall_of_a_cavity_hides_its_inside_from_without(visibility):
    """A closed sheet that faces inwards is hollow only for receivers on it."""
    wall = PatchSet.sphere((0, 0, 0), 1.0, inward=True)
    seen = wall.take([0])
    found = point_form_factors((3, 0.1, 0.2), (-1, 0, 0), seen, wall, visibility=visibility)
    free = plain(seen, (3, 0.1, 0.2), (-1, 0, 0))
    assert free > 1e-3
    # The outlines of the near and of the far wall are one: what is sampled there is 1e-3 of all.
    assert found.value[0, 0] <= 2e-3 * free and found.low[0, 0] <= 1e-9


def test_a_sheet_that_shines_from_both_sides():
    """It bulges on one side only: on the other it hides part of its own light."""
    tube = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0)
    corners = tube.control_points[:, ::3, ::3, :2] / tube.control_points[:, ::3, ::3, 3:]
    quarter = tube.take(np.flatnonzero((corners > -1e-9).all(axis=(1, 2, 3))))
    both = PatchSet.concatenated(quarter, quarter.flipped())
    # From within, where a single hollow patch hides nothing of itself.
    c, s = math.cos(0.4), math.sin(0.4)
    inside = point_form_factors((c, s, 0.5), (-c, -s, 0), both)
    expected = plain(quarter.flipped(), (c, s, 0.5), (-c, -s, 0))[0, 0]
    assert expected > 0.05
    np.testing.assert_allclose(inside.value, [[0.0, expected]], atol=1e-4 * expected)
    # From without, where its outer side hides most of the inner one.
    point, normal = (-0.3, -1.3, 0.5), (1.0, 0.7, 0.0)
    alone = strict(quarter.flipped(), None, point, normal)
    for visibility in ("auto", "strict"):
        found = point_form_factors(point, normal, both, visibility=visibility)
        assert found.low[0, 1] - 1e-9 <= alone.high[0, 0]
        assert found.high[0, 1] + 1e-9 >= alone.low[0, 0]
        np.testing.assert_allclose(found.value[0, 1], alone.value[0, 0], atol=1e-4)


# --- closed forms not in test_closed_forms.py


def test_infinite_strip():
    b1, b2, length = 0.2, 0.9, 1e5
    strip = rectangle(
        (math.tan(b1), -length, 1), (math.tan(b1), length, 1), (math.tan(b2), length, 1),
        (math.tan(b2), -length, 1),
    )  # fmt: skip
    expected = 0.5 * (math.sin(b2) - math.sin(b1))
    assert plain(strip)[0, 0] == pytest.approx(expected, abs=1e-9)


def test_concentric_spheres():
    inner = PatchSet.sphere(ORIGIN, 0.4)
    p = np.array([0.6, 0.0, 0.8])
    assert plain(inner, p, -p).sum() == pytest.approx(0.16, abs=1e-7)


def test_infinite_coaxial_cylinders_and_a_plane_element_facing_one():
    inner = PatchSet.cylinder((0, 0, -2e3), (0, 0, 2e3), 0.4)
    # Both are r / d at distance d.
    for d in (1.0, 2.5):
        assert plain(inner, (d, 0, 0), (-1, 0, 0)).sum() == pytest.approx(0.4 / d, abs=1e-6)


def gauss(a, b, order):
    x, w = np.polynomial.legendre.leggauss(order)
    return 0.5 * (a + b) + 0.5 * (b - a) * x, 0.5 * (b - a) * w


def test_cylinder_sees_itself_from_inside():
    radius, length = 0.7, 1.3
    tube = PatchSet.cylinder((0, 0, 0), (0, 0, length), radius, inward=True)
    z, w = gauss(0, length, 12)
    q = 0.3  # anywhere round
    points = np.stack([radius * math.cos(q) + 0 * z, radius * math.sin(q) + 0 * z, z], axis=1)
    found = plain(tube, points, (-math.cos(q), -math.sin(q), 0.0)).sum(axis=1) @ w / length
    h = length / (2 * radius)
    assert found == pytest.approx(1 + h - math.hypot(1, h), abs=1e-6)


def test_finite_coaxial_cylinders_outer_to_inner():
    r1, r2, length = 0.5, 1.2, 1.6  # inner, outer
    inner = PatchSet.cylinder((0, 0, 0), (0, 0, length), r1)
    z, w = gauss(0, length, 16)
    points = np.stack([r2 + 0 * z, 0 * z, z], axis=1)
    found = plain(inner, points, (-1, 0, 0)).sum(axis=1) @ w / length
    r, h = r2 / r1, length / r1
    a, b = h * h + r * r - 1, h * h - r * r + 1
    expected = (1 / r) * (
        1
        - (
            math.acos(b / a)
            - (
                math.sqrt((a + 2) ** 2 - 4 * r * r) * math.acos(b / (r * a))
                + b * math.asin(1 / r)
                - 0.5 * math.pi * a
            )
            / (2 * h)
        )
        / math.pi
    )
    assert found == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("visibility", ["strict", "auto"])
@pytest.mark.parametrize("angle", [0.3, 0.0, 0.25 * math.pi])  # inside a patch, on a seam, halfway
def test_finite_coaxial_cylinders_outer_to_itself(visibility, angle):
    """Past the inner cylinder, whose silhouettes are straight: they part lit from dark exactly."""
    r1, r2, length = 0.5, 1.2, 1.6
    inner = PatchSet.cylinder((0, 0, 0), (0, 0, length), r1)
    outer = PatchSet.cylinder((0, 0, 0), (0, 0, length), r2, inward=True)
    z, w = gauss(0, length, 12)
    a, b = math.cos(angle), math.sin(angle)
    points = np.stack([r2 * a + 0 * z, r2 * b + 0 * z, z], axis=1)
    found = point_form_factors(
        points, (-a, -b, 0.0), outer, inner, accuracy=1e-7, visibility=visibility
    )
    r, h = r2 / r1, length / r1
    root = math.sqrt(4 * r * r + h * h) / h
    expected = (
        1
        - 1 / r
        + 2 / (math.pi * r) * math.atan(2 * math.sqrt(r * r - 1) / h)
        - h
        / (2 * math.pi * r)
        * (
            root
            * math.asin((4 * (r * r - 1) + h * h / r**2 * (r * r - 2)) / (h * h + 4 * (r * r - 1)))
            - math.asin((r * r - 2) / r**2)
            + 0.5 * math.pi * (root - 1)
        )
    )
    # Brackets as asked, each patch 1e-7 of its own factor; the quadrature over z leaves 1e-13.
    assert found.value.sum(axis=1) @ w / length == pytest.approx(expected, abs=5e-8)
    low, high = (bound.sum(axis=1) @ w / length for bound in (found.low, found.high))
    assert low - 1e-12 <= expected <= high + 1e-12
    assert high - low <= 1e-7


def test_cone_sees_itself_from_inside():
    height, radius = 1.0, 0.6
    cone = PatchSet.cone((0, 0, 0), (0, 0, height), 0.0, radius).flipped()
    beta = math.atan(radius / height)
    # Mean over the area, which grows with the distance from the tip: dA ~ t dt.
    t, w = gauss(0, 1, 24)
    a, b = math.cos(0.3), math.sin(0.3)  # not on a seam of the patches
    points = np.stack([radius * a * t, radius * b * t, height * t], axis=1)
    normal = (-math.cos(beta) * a, -math.cos(beta) * b, math.sin(beta))
    found = plain(cone, points, normal).sum(axis=1) @ (2 * t * w)
    assert found == pytest.approx(1 - math.sin(beta), abs=1e-6)


def test_infinite_groove_and_infinite_plates():
    big, a = 1e4, 1.1
    wall = rectangle(
        (0, -big, 0), (math.cos(a), -big, math.sin(a)), (math.cos(a), big, math.sin(a)), (0, big, 0)
    ).flipped()
    x, w = gauss(0, 1, 20)
    points = np.stack([x, 0 * x, 0 * x], axis=1)
    # Cut at ±1e4: a share of (1/1e4)^2 / 2 of what is seen at grazing angles, far below 1e-9.
    found = plain(wall, points) @ np.ones(1) @ w
    assert found == pytest.approx(1 - math.sin(a / 2), abs=1e-9)
    plate = ceiling(0, 1, -big, big, 0.8)
    assert plain(plate, points)[:, 0] @ w == pytest.approx(math.hypot(1, 0.8) - 0.8, abs=1e-7)


def crowded(a, b, order):
    """Gauss nodes that crowd at both ends, for integrands with a root there."""
    t, w = gauss(0, 1, order)
    half = 0.5 * math.pi
    return a + (b - a) * np.sin(half * t) ** 2, w * (b - a) * half * np.sin(2 * half * t)


def test_two_infinite_cylinders():
    """Mean round one of what it sees of the other; the horizon cuts in smoothly."""
    gap, big = 0.6, 2e3
    other = PatchSet.cylinder((2 + gap, 0, -big), (2 + gap, 0, big), 1.0)
    # Whole up to where the horizon touches the other one, nothing from a quarter turn on.
    touch = math.acos(2 / (2 + gap))
    (q1, w1), (q2, w2) = crowded(0, touch, 20), crowded(touch, math.pi / 2, 20)
    q, w = np.concatenate([q1, q2]), np.concatenate([w1, w2])
    points = np.stack([np.cos(q), np.sin(q), 0 * q], axis=1)
    found = plain(other, points, points).sum(axis=1) @ w / math.pi
    x = 1 + gap / 2
    expected = (math.sqrt(x * x - 1) + math.asin(1 / x) - x) / math.pi
    assert found == pytest.approx(expected, abs=1e-10)


def test_plane_to_a_row_of_tubes():
    """Two-dimensional: tubes of diameter d at pitch 1 close the view over a plane."""
    d, big, reach = 0.5, 2e3, 60
    x, w = gauss(-0.5, 0.5, 12)
    found = 0.0
    for point, weight in zip(x, w, strict=True):
        # Directions from a point at distance 0.9: the union of arcs of all tubes.
        k = np.arange(-reach, reach + 1)
        alpha = np.arctan2(k - point, 0.9)
        half = np.arcsin(0.5 * d / np.hypot(k - point, 0.9))
        lo, hi = alpha - half, alpha + half
        covered, end = 0.0, -math.pi / 2
        for i in np.argsort(lo):
            a, b = max(lo[i], end), hi[i]
            if b > a:
                covered += 0.5 * (math.sin(b) - math.sin(a))
                end = b
        found += weight * covered
    expected = 1 - math.sqrt(1 - d * d) + d * math.acos(d)
    assert found == pytest.approx(expected, abs=2e-2)  # the reference sum itself
    tubes = PatchSet.concatenated(
        *(PatchSet.cylinder((k, -big, 0.9), (k, big, 0.9), 0.5 * d) for k in (-1, 0, 1))
    )
    # Three tubes by the public function against the same union of arcs.
    k = np.array([-1, 0, 1])
    lo = np.arctan2(k, 0.9) - np.arcsin(0.5 * d / np.hypot(k, 0.9))
    hi = np.arctan2(k, 0.9) + np.arcsin(0.5 * d / np.hypot(k, 0.9))
    assert (hi[:-1] < lo[1:]).all()
    union = 0.5 * float((np.sin(hi) - np.sin(lo)).sum())
    assert plain(tubes).sum() == pytest.approx(union, abs=1e-6)


@pytest.mark.parametrize(
    ("r1", "r2", "distance", "expected"),
    [
        (1.0, 1.0, 2.5, 0.0441189329),
        (1.0, 0.5, 2.0, 0.0171471650),
        (1.0, 1.0, 2.0, 0.0755868183),  # they touch
    ],
)
def test_sphere_to_sphere(r1, r2, distance, expected):
    other = PatchSet.sphere((0, 0, distance), r2)
    # Cosines from which on the horizon touches the other sphere, and leaves it.
    low, high = (r1 - r2) / distance, min((r1 + r2) / distance, 1.0)
    parts = [crowded(low, high, 24), crowded(high, 1.0, 24)]
    c, w = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    s = np.sqrt(1 - c * c)
    normals = np.stack([s * math.cos(0.4), s * math.sin(0.4), c], axis=1)
    found = plain(other, r1 * normals, normals).sum(axis=1) @ w / 2
    # Ten digits of the reference; touching, the nodes next to the point of contact leave 1e-10.
    assert found == pytest.approx(expected, abs=3e-10)


@pytest.mark.parametrize("accuracy", [3e-4, 1e-5])
def test_what_is_next_to_nothing_is_that_within_its_error(accuracy):
    """1.5 mm of a disc over the horizon: F = 2e-8, of which 1e-12 at most may be wrong."""
    disk = PatchSet.disk((0, 0, 1), 0.9, (0, 0, -1))
    tilt = math.atan2(0.9 - 1.5e-3, 1.0)
    normal = (math.cos(tilt), 0.0, -math.sin(tilt))
    true = point_form_factors((0, 0, 0), normal, disk, accuracy=1e-9).value
    found = point_form_factors((0, 0, 0), normal, disk, accuracy=accuracy)
    assert 0.0 < true.sum() < 1e-6
    assert (found.low <= true + 1e-13).all() and (true <= found.high + 1e-13).all()


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6])
def test_what_is_seen_at_a_grazing_angle_is_as_accurate(accuracy):
    """Of little factor against their size: aslant, and just over the horizon.

    The reference asks for five more digits; where it states less than 1e-12 that is rounding.
    """
    rng = np.random.default_rng(1)
    for _ in range(20):
        radius = 10.0 ** rng.uniform(-1.0, 0.5)
        disk = PatchSet.disk((0, 0, 0), radius, (0, 0, 1))
        points = 2.0 * radius * rng.normal(size=(20, 3))
        points[:, 2] = np.abs(points[:, 2]) + 0.05 * radius
        normals = rng.normal(size=(20, 3))
        true = point_form_factors(points, normals, disk, accuracy=1e-5 * accuracy).value
        found = point_form_factors(points, normals, disk, accuracy=accuracy)
        slack = 1e-12 + 1e-5 * accuracy * true
        assert (np.abs(found.value - true) <= accuracy * true + slack).all()
        assert (found.low <= true + slack).all() and (true <= found.high + slack).all()
