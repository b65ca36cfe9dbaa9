"""Form factors where numbers get hard: points, horizon, scale, Bézier nets and visibility.

Closed forms of polygons come from the sum over edges written here; tolerances are those of
rounding unless they state another reason.
"""

import math

import numpy as np
import pytest
from patchlight.solver import PatchSet, point_form_factors

from .fixtures_light import UP, ceiling, rectangle

ORIGIN = (0.0, 0.0, 0.0)
LAMP = ceiling(-1.5, 1.5, -1.5, 1.5, 2.0)
WAYS = pytest.mark.parametrize("visibility", ["strict", "auto"])


def factor(sources, blockers=None, point=ORIGIN, normal=UP, visibility="none", accuracy=1e-9):
    return point_form_factors(
        point, normal, sources, blockers, accuracy=accuracy, visibility=visibility
    )


def total(*args, **options):
    return float(factor(*args, **options).value.sum())


def polygon(*corners):
    """Factor of a polygon above the horizon of the origin, which looks up: a sum over its edges."""
    p = np.array(corners, float)
    q = np.roll(p, -1, axis=0)
    c = np.cross(p, q)
    size = np.linalg.norm(c, axis=1)
    angle = np.arctan2(size, np.einsum("ij,ij->i", p, q))
    return abs(float((c[:, 2] / size * angle).sum())) / (2 * math.pi)


def square_net(x, y, z):
    """Flat square patch (4, 4, 3) that faces down, from coordinates of its control points."""
    net = np.empty((4, 4, 3))
    net[..., 0], net[..., 1], net[..., 2] = *np.meshgrid(x, y, indexing="ij"), z
    return net.swapaxes(0, 1)


# --- points


@pytest.mark.parametrize("visibility", ["strict", "auto", "none"])
@pytest.mark.parametrize("point", [(0.3, 0.2, 2), (1.5, 0.2, 2), (1.5, 1.5, 2)])
def test_a_point_on_a_flat_source_does_not_see_it(point, visibility):
    """Inside it, on an edge and on a corner: it is seen edge-on."""
    assert factor(LAMP, point=point, visibility=visibility).high.max() <= 1e-12


@WAYS
@pytest.mark.parametrize("degrees", [0.01, 1.0, 90.0, 179.0])
@pytest.mark.parametrize("distance", [0.5, 1e-3])
def test_two_long_plates_at_an_angle(degrees, distance, visibility):
    """A strip takes half the difference of the sines of the angles to its edges."""
    a, long = math.radians(degrees), 1e5
    x, z = math.cos(a), math.sin(a)
    plate = rectangle((0, -long, 0), (x, -long, z), (x, long, z), (0, long, 0)).flipped()
    floor = rectangle((0, -long, 0), (1, -long, 0), (1, long, 0), (0, long, 0))
    found = factor(plate, floor, (distance, 0, 0), visibility=visibility)
    far = (x - distance) / math.hypot(x - distance, z)
    # The ends at ±1e5 leave (1 / 1e5)² / 2.
    assert found.value.sum() == pytest.approx(0.5 * (1.0 + far), abs=1e-9)


@WAYS
@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-6])
def test_coplanar_neighbours(gap, visibility):
    """They do not see each other, and seen from elsewhere they make one plate without the gap."""
    pair = PatchSet.concatenated(ceiling(-1, 0, -1, 1, 1.0), ceiling(gap, 1, -1, 1, 1.0))
    beside = factor(pair, point=(0.5, 0.3, 1.0), normal=(-1, 0, 0), visibility=visibility)
    assert beside.high.max() <= 1e-12
    # A gap of 1e-6 takes 1e-6 of a plate seen under a solid angle of order one.
    assert total(pair, visibility=visibility) == pytest.approx(
        total(ceiling(-1, 1, -1, 1, 1.0)), abs=1e-11 + gap
    )


@WAYS
def test_plates_that_nearly_touch(visibility):
    c, half = 1e-6, 0.5
    found = total(ceiling(-half, half, -half, half, c), visibility=visibility)
    # 1 − F = 4 c² / (π a²) … for the middle of a square of half-width a: below 1e-11.
    assert found == pytest.approx(1.0, abs=1e-11)


# --- horizon


@pytest.mark.parametrize("tilt", [0.0, 1e-14, -1e-14])
def test_horizon_through_corners(tilt):
    """An upright square on its corner, its diagonal in the horizon: half of it counts."""
    r, d = 0.7, 1.3
    plate = rectangle((d, 0, -r), (d, -r, tilt), (d, 0, r), (d, r, -tilt))
    expected = polygon((d, r, 0), (d, -r, 0), (d, 0, r))
    assert total(plate) == pytest.approx(expected, abs=1e-13)
    assert total(plate.flipped()) == 0.0


@WAYS
def test_inside_of_a_patch_dips_below_the_horizon(visibility):
    """Boundary above, middle below: an own sum over the surface's visible part."""
    t = np.arange(4) / 3.0
    net = np.empty((4, 4, 3))
    net[..., 0], net[..., 1] = np.meshgrid(2.0 + t, t - 0.5, indexing="ij")
    net[..., 2] = 0.2
    net[1:3, 1:3, 2] = -0.5
    bowl = PatchSet.from_bezier(net[None])
    found = factor(bowl, visibility=visibility, accuracy=1e-5)
    # Midpoints: dF = (n · H)(−det) / (π |H|⁴); the kink at the horizon leaves 1e-7.
    m = 1200
    s = (np.arange(m) + 0.5) / m
    b = np.stack([(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s * s * (1 - s), s**3], axis=1)
    e = np.stack([(1 - s) ** 2, 2 * s * (1 - s), s * s], axis=1)
    h = np.einsum("ui,vj,ijk->uvk", b, b, net)
    hu = 3 * np.einsum("ui,vj,ijk->uvk", e, b, np.diff(net, axis=0))
    hv = 3 * np.einsum("ui,vj,ijk->uvk", b, e, np.diff(net, axis=1))
    g = -np.einsum("uvk,uvk->uv", h, np.cross(hu, hv))
    r2 = (h * h).sum(axis=-1)
    lit = np.maximum(h[..., 2], 0.0) * np.maximum(g, 0.0) / (math.pi * r2 * r2)
    # From outside the bowl some of what faces the receiver may lie behind its own rim.
    assert found.value.sum() <= lit.mean() + 1e-6
    plain = factor(bowl, accuracy=1e-6)
    assert plain.value.sum() == pytest.approx(lit.mean(), abs=1e-6)


# --- scale


@WAYS
def test_far_from_the_origin_of_coordinates(visibility):
    """1e5 away coordinates round to 1e-11: what is seen may change by as much."""
    ball = PatchSet.sphere((0.3, -0.2, 1.1), 0.25)
    move = np.eye(4)
    move[:3, 3] = (1e5, -2e5, 3e4)
    here = factor(LAMP, ball, visibility=visibility, accuracy=1e-4)
    there = factor(
        LAMP.moved(move), ball.moved(move), move[:3, 3], visibility=visibility, accuracy=1e-4
    )
    assert (there.low <= here.high + 1e-9).all() and (there.high >= here.low - 1e-9).all()
    assert there.width.sum() <= 2e-4


@WAYS
@pytest.mark.parametrize("ratio", [1e3, 1e4, 1e6])
def test_blockers_that_are_long_and_thin(ratio, visibility):
    """A strip across the lamp hides the strip of the lamp behind it, slanting too."""
    width = 8.0 / ratio
    for angle in (0.0, 0.4):
        c, s = math.cos(angle), math.sin(angle)
        along, across = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
        middle = np.array([0.0, 0.0, 1.0]) + 0.1 * across
        corner = [
            middle + a * 4.0 * along + b * 0.5 * width * across
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        strip = rectangle(*corner)
        # On the lamp, twice as far, the strip covers what its planes cut out of it.
        y0, y1 = 2 * (0.1 - 0.5 * width), 2 * (0.1 + 0.5 * width)
        square = [(-1.5, -1.5), (1.5, -1.5), (1.5, 1.5), (-1.5, 1.5)]
        for sign, limit in ((1.0, y1), (-1.0, -y0)):
            kept = []
            for p, q in zip(square, square[1:] + square[:1], strict=True):
                dp, dq = (limit - sign * (-s * a[0] + c * a[1]) for a in (p, q))
                if dp >= 0:
                    kept.append(p)
                if dp * dq < 0:
                    f = dp / (dp - dq)
                    kept.append((p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1])))
            square = kept
        hidden = polygon(*[(a, b, 2.0) for a, b in square])
        found = total(LAMP, strip, visibility=visibility, accuracy=1e-7)
        # As asked: 1e-7 of 0.4.
        assert found == pytest.approx(total(LAMP) - hidden, abs=5e-8)
        assert hidden > 0.0


# --- Bézier nets


@WAYS
@pytest.mark.parametrize(
    "inner",
    [(0.6, 0.4), (1.0, 0.0), (0.0, 1.0), (1.0 / 3.0, 1.0 / 3.0)],
    ids=["crossed", "standing still inside", "standing still at the ends", "bunched"],
)
def test_parameters_that_run_unevenly(inner, visibility):
    """Crossed control points, zero derivatives inside and at the ends: the square is the same."""
    t = 2 * np.array([0.0, *inner, 1.0]) - 1
    odd = PatchSet.from_bezier(square_net(1.5 * t, 1.5 * t, 2.0)[None])
    assert total(odd, visibility=visibility) == pytest.approx(total(LAMP), abs=1e-10)
    blocker = PatchSet.from_bezier(square_net(0.3 * t, 0.3 * t, 1.0)[None])
    hidden = total(ceiling(-0.6, 0.6, -0.6, 0.6, 2.0))
    found = total(LAMP, blocker, visibility=visibility, accuracy=1e-6)
    assert found == pytest.approx(total(LAMP) - hidden, abs=1e-6)


@WAYS
@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_weights_of_one_patch_that_differ_widely(ratio, visibility):
    """A Möbius change of both parameters: weights 1 : ratio, the same plate, ball and shadow."""
    w = ratio ** (np.add.outer(np.arange(4), np.arange(4)) / 6.0)
    plate = PatchSet(LAMP.control_points * w[None, :, :, None])
    assert plate.control_points[..., 3].max() / plate.control_points[..., 3].min() == (
        pytest.approx(ratio)
    )
    assert total(plate, visibility=visibility) == pytest.approx(total(LAMP), abs=1e-10)
    ball = PatchSet.sphere((0.1, 0.0, 1.2), 0.3)
    odd = PatchSet(ball.control_points * w[None, :, :, None])
    d = math.hypot(0.1, 1.2)
    expected = total(LAMP) - (0.3 / d) ** 2 * 1.2 / d
    assert total(plate, odd, visibility=visibility, accuracy=1e-4) == (
        pytest.approx(expected, abs=1e-4 * total(LAMP))
    )


@WAYS
def test_a_ball_of_lunes(visibility):
    """Patches from pole to pole, both ends collapsed and half a turn high: two, three of them."""
    # Half a circle as a rational cubic: weights 1, 1/3, 1/3, 1 [Farin, sec. 13.7].
    arc = np.array([[0, -1.0, 1], [2 / 3, -1 / 3, 1 / 3], [2 / 3, 1 / 3, 1 / 3], [0, 1.0, 1]])
    quarter = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0).control_points[:, :, 0, :]
    if not np.allclose(np.ptp(quarter[0, :, 2]), 0.0):  # the parameter round it is the other one
        quarter = PatchSet.cylinder((0, 0, 0), (0, 0, 1), 1.0).control_points[:, 0, :, :]
    nets = []
    for ring in quarter:
        net = np.empty((4, 4, 4))
        for j, (r, z, w) in enumerate(arc):
            # (x, y) = r (cos, sin) / w with the weights of both directions.
            net[:, j, 0], net[:, j, 1] = ring[:, 0] * r, ring[:, 1] * r
            net[:, j, 2], net[:, j, 3] = ring[:, 3] * z, ring[:, 3] * w
        nets.append(net)
    lunes = np.array(nets)
    lunes[..., :3] *= 0.4
    lunes[..., :3] += lunes[..., 3:] * np.array([0.2, 0.1, 1.3])
    ball = PatchSet(lunes)
    assert ball.areas().sum() == pytest.approx(4 * math.pi * 0.16, rel=1e-6)
    d = math.sqrt(0.04 + 0.01 + 1.69)
    own = (0.4 / d) ** 2 * 1.3 / d
    assert total(ball, visibility=visibility, accuracy=1e-4) == pytest.approx(own, abs=1e-4 * own)
    found = total(LAMP, ball, visibility=visibility, accuracy=1e-4)
    assert found == pytest.approx(total(LAMP) - own, abs=1e-4 * total(LAMP))


# --- visibility


@WAYS
@pytest.mark.parametrize("x", [0.0, 0.375, -0.75])
def test_edges_along_the_edges_of_cells(x, visibility):
    """Where halving cuts the lamp at 2 x, the shadow's edge lies exactly on a cell's edge."""
    sheet = ceiling(x, 5.0, -5.0, 5.0, 1.0)
    expected = total(ceiling(-1.5, 2 * x, -1.5, 1.5, 2.0))
    assert total(LAMP, sheet, visibility=visibility) == pytest.approx(expected, abs=1e-9)


@WAYS
@pytest.mark.parametrize("gap", [1e-2, 1e-6, 1e-9])
def test_a_wall_that_nearly_touches_the_receiver(gap, visibility):
    """It stands on the receiver's plane and hides all that is on its other side."""
    wall = rectangle((gap, -50, 0), (gap, 50, 0), (gap, 50, 50), (gap, -50, 50))
    expected = total(ceiling(-1.5, 0.0, -1.5, 1.5, 2.0))
    # What the top of the wall lets by: 50 high, it hides all beyond gap / 25.
    assert total(LAMP, wall, visibility=visibility) == pytest.approx(expected, abs=gap + 1e-9)


@WAYS
def test_a_wall_through_the_plane_of_the_receiver(visibility):
    """Its control points lie before and behind: on both sides of w = 0 of the projection."""
    box = PatchSet.box((0.2, 20, 20), center=(0.6, 0, 0))
    lamp = ceiling(0.0, 4.0, -1.5, 1.5, 2.0)
    expected = total(ceiling(0.0, 0.5, -1.5, 1.5, 2.0))
    # Where the wall goes through the lamp no plane parts them: cells along that line stay open.
    found = factor(lamp, box, visibility=visibility, accuracy=1e-3)
    assert found.value.sum() == pytest.approx(expected, abs=1e-3 * total(lamp))
    assert found.low.sum() - 1e-9 <= expected <= found.high.sum() + 1e-9


@WAYS
def test_a_box_hanging_on_the_lamp(visibility):
    """It touches the source: what it covers and what its sides hide is gone."""
    box = PatchSet.box((0.6, 0.6, 0.4), center=(0.0, 0.0, 1.8))
    expected = total(LAMP) - total(ceiling(-0.3, 0.3, -0.3, 0.3, 1.6))
    found = total(LAMP, box, visibility=visibility, accuracy=1e-5)
    assert found == pytest.approx(expected, abs=1e-5)


@WAYS
def test_a_flat_blocker_before_a_hollow_wall(visibility):
    """From the axis of a tube a plate parallel to it hides the part of the wall behind it."""
    wall = PatchSet.cylinder((0, 0, -40), (0, 0, 40), 1.0, inward=True)
    # Seen from the axis along x: a strip between two planes through the axis.
    plate = rectangle((0.5, -0.2, -60), (0.5, 0.3, -60), (0.5, 0.3, 60), (0.5, -0.2, 60))
    found = total(wall, plate, normal=(1, 0, 0), visibility=visibility, accuracy=1e-6)
    hidden = 0.5 * (0.3 / math.hypot(0.3, 0.5) + 0.2 / math.hypot(0.2, 0.5))
    # The open ends, seen edge-on from 40 radii: (1 / 40)² / 2 of each half, and less.
    assert found == pytest.approx(1.0 - hidden, abs=1e-3)
    ends = 1.0 - total(wall, normal=(1, 0, 0))
    behind = total(
        wall,
        PatchSet.concatenated(plate, ceiling(-9, 9, -9, 9, 41.0), ceiling(-9, 9, -9, 9, -41.0)),
        normal=(1, 0, 0),
        visibility=visibility,
        accuracy=1e-6,
    )
    assert behind == pytest.approx(found, abs=2e-6)
    assert 0.0 <= ends <= 1e-3


@WAYS
def test_the_order_of_blockers_changes_nothing(visibility):
    rng = np.random.default_rng(5)
    balls = [
        PatchSet.sphere(rng.uniform((-0.8, -0.8, 0.6), (0.8, 0.8, 1.4)), rng.uniform(0.05, 0.2))
        for _ in range(4)
    ]
    some = factor(LAMP, PatchSet.concatenated(*balls), visibility=visibility, accuracy=1e-4)
    other = factor(LAMP, PatchSet.concatenated(*balls[::-1]), visibility=visibility, accuracy=1e-4)
    # Cells are the same; sums over their lists may round otherwise.
    np.testing.assert_allclose(other.low, some.low, atol=1e-13)
    np.testing.assert_allclose(other.high, some.high, atol=1e-13)


@WAYS
def test_one_more_blocker_never_raises(visibility):
    rng = np.random.default_rng(8)
    blockers, previous = [], factor(LAMP, visibility=visibility, accuracy=1e-4)
    for k in range(6):
        place, size = rng.uniform((-1, -1, 0.5), (1, 1, 1.5)), rng.uniform(0.05, 0.3)
        blockers.append(
            PatchSet.sphere(place, size)
            if k % 2
            else PatchSet.box((size, 2 * size, 0.5 * size), center=tuple(place))
        )
        found = factor(LAMP, PatchSet.concatenated(*blockers), visibility=visibility, accuracy=1e-4)
        assert found.low.sum() <= previous.high.sum()
        # Values are off by 1e-4 of the free factor, each.
        assert found.value.sum() <= previous.value.sum() + 1e-4
        previous = found
    assert previous.value.sum() < 0.95 * total(LAMP)


@WAYS
@pytest.mark.parametrize("seam", [0.0, 0.05, 0.123])
@pytest.mark.parametrize("slant", [0.0, 0.4])
def test_sheets_with_a_common_edge_leak_exactly_nothing(seam, slant, visibility):
    """Given as one set or as two: the seam is not an opening, level or folded along it."""
    left = rectangle((-4, -4, 1 - slant), (-4, 4, 1 - slant), (seam, 4, 1), (seam, -4, 1))
    right = rectangle((seam, -4, 1), (seam, 4, 1), (4, 4, 1 - slant), (4, -4, 1 - slant))
    found = factor(LAMP, PatchSet.concatenated(left, right), visibility=visibility)
    assert found.high.max() == 0.0


@WAYS
def test_a_blind_of_a_hundred_slats(visibility):
    y = np.linspace(-1, 1, 100)
    blind = PatchSet.from_bilinear(
        [[(-2, a, 1), (2, a, 1), (2, a + 0.008, 1.02), (-2, a + 0.008, 1.02)] for a in y]
    )
    found = factor(LAMP, blind, visibility=visibility, accuracy=1e-4)
    hidden, end = 0.0, -1.5
    for a in y:
        # A slat hides what lies between the planes through its edges; neighbours overlap.
        y0, y1 = sorted((2 * a, 2 * (a + 0.008) / 1.02))
        y0, y1 = max(y0, end), min(y1, 1.5)
        if y1 > y0:
            hidden += total(ceiling(-1.5, 1.5, y0, y1, 2.0))
            end = y1
    assert found.low.sum() - 1e-10 <= total(LAMP) - hidden <= found.high.sum() + 1e-10
    assert found.width.sum() <= 1e-4
    assert found.value.sum() == pytest.approx(total(LAMP) - hidden, abs=1e-4 * total(LAMP))
