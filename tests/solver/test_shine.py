"""Second pass: highlights at sensors and in pictures; mirrors in pictures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from patchlight.solver.model import Camera, Material, PatchSet
from patchlight.solver.simulation import solve

from .fixtures_light import area_rule, ceiling, grid, rectangle, setup
from .fixtures_shine import BLACK, with_materials

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
FLOOR = rectangle((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))


def albedo(exponent, cosine):
    """(n + 2)/(2π) ∫ cosⁿα cosθ dω over the hemisphere, by Gauss' rule in cosα."""
    t, w = np.polynomial.legendre.leggauss(200)
    c, w = 0.5 * (t + 1.0), 0.5 * w
    turn = (np.arange(360) + 0.5) * math.pi / 180.0
    sine = math.sqrt(1.0 - cosine * cosine)
    here = c[:, None] * cosine + np.sqrt(1.0 - c * c)[:, None] * sine * np.cos(turn)
    mean = np.maximum(here, 0.0).mean(axis=1)
    return (exponent + 2.0) * float((w * c**exponent * mean).sum())


def brute_highlight(point, lamp, exitance, specular, exponent, order):
    """Illuminance that a glossy floor adds at one point, by sums over floor and lamp."""
    y, n, wy = area_rule(FLOOR.refined().refined(), order)
    z, nz, wz = area_rule(lamp.refined(), 8)
    to = z[None] - y[:, None]
    r = np.linalg.norm(to, axis=2)
    to = to / r[..., None]
    here, there = to[..., 2], -(to * nz[None]).sum(axis=2)
    light = wz * np.maximum(here, 0) * np.maximum(there, 0) / r**2  # cosθ dω
    view = point - y
    distance = np.linalg.norm(view, axis=1)
    view = view / distance[:, None]
    axis = 2.0 * view[:, 2:] * n - view
    cosine = np.maximum((to * axis[:, None]).sum(axis=2), 0.0)
    luminance = exitance / math.pi
    lobe = (exponent + 2.0) / (2 * math.pi) * (light * cosine**exponent).sum(axis=1)
    table = np.linspace(0.0, 1.0, 41)
    whole = np.interp(view[:, 2], table, [albedo(exponent, c) for c in table])
    left = (1.0 - whole) / math.pi
    sent = specular * luminance * (lobe + left * light.sum(axis=1))
    return float((sent * wy * view[:, 2] ** 2 / distance**2).sum())


@pytest.mark.parametrize("exponent", [5.0, 40.0])
def test_highlights_at_sensors_are_those_of_a_double_sum(exponent):
    lamp = ceiling(-0.3, 0.3, -0.2, 0.2, 1.5)
    points = np.array([(0.4, 0.3, 0.9), (-1.0, 0.5, 0.7)])
    made = with_materials(
        setup(FLOOR, lamp),
        [Material(0.0, specular=0.6, exponent=exponent), BLACK],
        lamps=[(1, "lamp", 1000.0)],
        sensors=[grid("g", points, DOWN)],
    )
    found = solve(made, accuracy=0.01).sensors["g"]
    exact = [brute_highlight(p, lamp, 1000.0, 0.6, exponent, 10) for p in points]
    # The floor's elements keep the share that stays diffuse even: with that, half a percent.
    assert found.components["lamp.indirect"] == pytest.approx(exact, rel=5e-3)
    assert (np.abs(found.illuminance_lx - exact) <= found.error_lx).all()


def test_highlights_take_away_what_sensors_were_given():
    """On a coarse mesh under a near lamp, light between the nodes is that of the last gather."""
    lamp = ceiling(-0.3, 0.3, -0.2, 0.2, 0.8)
    points = np.array([(-1.0, 0.5, 0.7), (0.0, 0.9, 0.5)])
    made = with_materials(
        setup(FLOOR, lamp),
        [Material(0.0, specular=0.6, exponent=5.0), BLACK],
        lamps=[(1, "lamp", 1000.0)],
        sensors=[grid("g", points, DOWN)],
    )
    found = solve(made, accuracy=0.2).sensors["g"].components["lamp.indirect"]
    exact = [brute_highlight(p, lamp, 1000.0, 0.6, 5.0, 10) for p in points]
    # The light at the nodes of the mesh itself, taken away, left 0.7 %; cells are good to 0.2 %.
    assert found == pytest.approx(exact, rel=3e-3)


def highlight_from_above(exponent, *, specular=0.4, half_angle=0.3, bands=1):
    """Picture of a glossy floor under a coaxial disc, seen straight down from below the disc."""
    lamp = PatchSet.disk((0, 0, 2), 2 * math.tan(half_angle), DOWN)
    shade = specular if bands == 1 else (specular, 0.5 * specular, 0.0)
    made = with_materials(
        setup(FLOOR, lamp),
        [Material(0.0, specular=shade, exponent=exponent), BLACK],
        lamps=[(1, "lamp", 1000.0)],
        cameras=(Camera((0, 0, 1), (0, 0, 0), "c", up=(0, 1, 0), fov_deg=1.0, size=(3, 3)),),
    )
    return solve(made, accuracy=0.02).images["c"].rgb[1, 1]


@pytest.mark.parametrize("exponent", [10.0, 200.0])
def test_highlight_of_a_cone_in_a_picture(exponent):
    found = highlight_from_above(exponent)
    exact = 0.4 * 1000.0 / math.pi * (1.0 - math.cos(0.3) ** (exponent + 2.0))
    # Normal incidence: nothing stays diffuse. Pictures allow lamps a tenth; cells do better.
    assert found == pytest.approx(np.full(3, exact), rel=2e-2)


def test_coloured_highlights():
    found = highlight_from_above(100.0, bands=3)
    assert found[1] == pytest.approx(0.5 * found[0], rel=1e-6) and found[2] == pytest.approx(0.0)


def test_a_flat_mirror_shows_what_is_behind_its_image():
    # A room of differently bright, black walls and a mirror; and its image without the mirror.
    left = rectangle((0, -1, 0), (0, 1, 0), (0, 1, 2), (0, -1, 2))
    ball = PatchSet.sphere((1.2, 0.3, 0.6), 0.4)
    back = rectangle((3, -1, 0), (3, -1, 2), (3, 1, 2), (3, 1, 0))
    image_ball = PatchSet.sphere((-1.2, 0.3, 0.6), 0.4)
    image_back = rectangle((-3, -1, 0), (-3, 1, 0), (-3, 1, 2), (-3, -1, 2))
    camera = Camera((2, -0.5, 1), (0, 0.2, 0.8), "c", fov_deg=50, size=(40, 30))
    how = {"cameras": (camera,)}
    with_mirror = with_materials(
        setup(left, ball, back),
        [Material(0.0, mirror=(0.5, 0.8, 0.9)), BLACK, BLACK],
        lamps=[(1, "a", 100.0), (2, "b", 300.0)],
        **how,
    )
    behind = with_materials(
        setup(image_ball, image_back, ball, back),
        [BLACK] * 4,
        lamps=[(0, "a", 100.0), (1, "b", 300.0), (2, "a", 100.0), (3, "b", 300.0)],
        **how,
    )
    seen, through = (solve(s, accuracy=0.1).images["c"] for s in (with_mirror, behind))
    origins, directions = camera.rays()
    way = -origins[..., 0] / directions[..., 0]
    at = origins + way[..., None] * directions
    in_mirror = (way > 0) & (np.abs(at[..., 1]) < 0.98) & (np.abs(at[..., 2] - 1) < 0.98)
    in_mirror &= np.isclose(seen.depth_m, way)  # the ball itself is not before it
    a, b = seen.rgb[in_mirror], through.rgb[in_mirror]
    assert in_mirror.sum() > 300 and len(np.unique(np.round(b, 6), axis=0)) >= 3
    # Pixels on outlines are means of four rays, which another contrast may have chosen.
    same = np.isclose(a, b * (0.5, 0.8, 0.9), rtol=1e-9).all(axis=1)
    assert same.mean() > 0.9


def test_a_curved_mirror_turns_the_view_as_its_normals_do():
    # A mirror ball between walls of different light: each pixel by the closed form for a sphere.
    centre, radius = np.array([0.0, 0.0, 0.0]), 0.5
    ball = PatchSet.sphere(centre, radius)
    box = PatchSet.box((4, 4, 4), inward=True)
    walls = [box.take(np.array([k])) for k in range(6)]
    parts = setup(ball, *walls)
    levels = [10.0, 20.0, 40.0, 80.0, 160.0, 320.0]
    camera = Camera((1.7, 0.1, 0.2), (0, 0, 0), "c", fov_deg=36, size=(24, 24))
    made = with_materials(
        parts,
        [Material(0.0, mirror=0.9), *(BLACK for _ in walls)],
        lamps=[(1 + k, f"w{k}", level) for k, level in enumerate(levels)],
        cameras=(camera,),
    )
    image = solve(made, accuracy=0.2).images["c"]
    o, d = (a.reshape(-1, 3) for a in camera.rays())
    b = (o * d).sum(axis=1)
    inside = b**2 - (o * o).sum(axis=1) + radius**2
    hit = inside > 0.01
    t = -b[hit] - np.sqrt(inside[hit])
    at = o[hit] + t[:, None] * d[hit]
    n = at / radius
    turned = d[hit] - 2.0 * (d[hit] * n).sum(axis=1)[:, None] * n
    way = np.where(turned > 0, 2.0 - at, -2.0 - at) / turned
    axis = np.argmin(way, axis=1)
    sign = np.take_along_axis(turned, axis[:, None], axis=1)[:, 0] > 0
    normals = [tuple(w.normals(0.5, 0.5)[0].round().astype(int)) for w in walls]
    exact = []
    for a, s in zip(axis, sign, strict=True):
        inward = [0, 0, 0]
        inward[a] = -1 if s else 1
        exact.append(0.9 * levels[normals.index(tuple(inward))] / math.pi)
    found = image.rgb.reshape(-1, 3)[hit][:, 0]
    assert hit.sum() > 100
    assert np.isclose(found, exact, rtol=1e-9).mean() > 0.6  # others are on images of edges


def test_facing_mirrors_end():
    # Two perfect mirrors: rays between them are followed a bounded number of times.
    a = rectangle((0, -1, 0), (0, 1, 0), (0, 1, 2), (0, -1, 2))
    b = rectangle((1, -1, 0), (1, -1, 2), (1, 1, 2), (1, 1, 0))
    lamp = ceiling(0.4, 0.6, -0.1, 0.1, 1.9)
    camera = Camera((0.5, 0, 1), (0, 0, 1), "c", fov_deg=40, size=(8, 8))
    mirror = Material(0.0, mirror=1.0)
    made = with_materials(
        setup(a, b, lamp), [mirror, mirror, BLACK], lamps=[(2, "a", 10.0)], cameras=(camera,)
    )
    result = solve(made, accuracy=0.1)
    assert np.isfinite(result.images["c"].rgb).all()


def test_pictures_of_diffuse_scenes_do_not_change():
    made = with_materials(
        setup(FLOOR, ceiling(-0.3, 0.3, -0.2, 0.2, 1.5)),
        [Material(0.5), BLACK],
        lamps=[(1, "lamp", 1000.0)],
        cameras=(Camera((1, -1, 1), (0, 0, 0), "c", size=(12, 9)),),
    )
    glossy = replace(made, materials=(Material(0.5, specular=0.0, exponent=9.0), BLACK))
    one, two = (solve(s, accuracy=0.1).images["c"].rgb for s in (made, glossy))
    assert (one == two).all()
