"""Mirrors: image sources, doubled rooms, sky and sun, balance of energy, what costs nothing."""

import math

import numpy as np
import pytest
from patchlight.solver import point_form_factors
from patchlight.solver.budget import Budget
from patchlight.solver.field import FieldSolver
from patchlight.solver.iterated import ANYWHERE, weights_at
from patchlight.solver.mesh import Boxes
from patchlight.solver.model import Camera, CIESky, Ground, Material, PatchSet, Sun
from patchlight.solver.simulation import solve
from patchlight.solver.stages import Stages

from .fixtures_light import Body, ceiling, closed_cylinder, grid, rectangle, scene, setup
from .fixtures_shine import BLACK, doubled_rooms, room_parts, with_materials
from .test_webs import cosine, toward, uneven, with_web

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


SQUARE = ((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))


def lamp_over_mirror(mirror, points, *bodies, accuracy=0.01, share=0.8):
    """Sensors that look down at a mirror, in which they see a lamp that shines down from z = 3."""
    parts = setup(mirror, ceiling(-0.4, 0.6, -0.3, 0.3, 3.0), *bodies)
    materials = [Material(0.0, mirror=share), BLACK, *(BLACK for _ in bodies)]
    how = {"lamps": [(1, "lamp", 1000.0)], "sensors": [grid("g", points, DOWN)]}
    return solve(with_materials(parts, materials, **how), accuracy=accuracy)


def test_a_mirror_shows_the_image_of_a_lamp():
    # Wholly in sight, the lamp at z = 3 is one at z = −3 that shines up.
    points = np.array([(0.3, 0.2, 0.8), (-0.5, 0.4, 1.5), (1.2, -0.7, 0.4)])
    mirror = rectangle((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))
    result = lamp_over_mirror(mirror, points)
    image = rectangle((-0.4, -0.3, -3), (0.6, -0.3, -3), (0.6, 0.3, -3), (-0.4, 0.3, -3))
    exact = 800.0 * point_form_factors(points, DOWN, image, accuracy=1e-9).value[:, 0]
    assert result.sensors["g"].components["lamp.direct"] == pytest.approx(exact, rel=1e-6)
    assert abs(result.balance.residual_fraction) < 1e-3


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_the_outline_of_the_mirror_cuts_the_image(turn):
    # Seen from height h a point (x, y) of the mirror shows p + (1 + 3 / h) ((x, y) − p) of z = −3:
    # the outline comes there as a larger one of the same shape. The lamp covers all of it.
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([(-0.05, -0.02), (0.07, -0.02), (0.05, 0.03), (-0.05, 0.03)]) @ [
        [c, s],
        [-s, c],
    ]
    mirror = rectangle(*np.pad(corners, ((0, 0), (0, 1))))
    point = np.array([(0.02, 0.01, 1.0)])
    result = lamp_over_mirror(mirror, point)
    shown = point[0, :2] + 4.0 * (corners - point[0, :2])
    assert np.abs(shown).max() < 0.3  # all of it on the lamp
    window = rectangle(*np.pad(shown, ((0, 0), (0, 1)), constant_values=((0, 0), (0, -3))))
    exact = 800.0 * point_form_factors(point, DOWN, window, accuracy=1e-9).value[:, 0]
    assert result.sensors["g"].components["lamp.direct"] == pytest.approx(exact, rel=1e-6)


def test_a_round_mirror_and_what_stands_before_it():
    # The disc is four curved outlines; a post between lamp and mirror hides some of the image.
    points = np.array([(0.1, 0.2, 0.8), (-0.3, 0.1, 1.2)])
    disc = PatchSet.disk((0, 0, 0), 2.0, (0, 0, 1))
    plain = lamp_over_mirror(disc, points).sensors["g"].components["lamp.direct"]
    image = rectangle((-0.4, -0.3, -3), (0.6, -0.3, -3), (0.6, 0.3, -3), (-0.4, 0.3, -3))
    exact = 800.0 * point_form_factors(points, DOWN, image, accuracy=1e-9).value[:, 0]
    assert plain == pytest.approx(exact, rel=1e-6)
    post = closed_cylinder((0.3, 0.0, 1.9), (0.3, 0.0, 2.9), 0.15)
    hidden = lamp_over_mirror(disc, points, post).sensors["g"].components["lamp.direct"]
    behind = closed_cylinder((0.3, 0.0, -1.9), (0.3, 0.0, -2.9), 0.15).patches
    exact = 800.0 * point_form_factors(points, DOWN, image, behind, accuracy=1e-6).value[:, 0]
    assert hidden == pytest.approx(exact, rel=1e-5) and (hidden < 0.97 * plain).all()


@pytest.mark.slow
@pytest.mark.parametrize("table", [False, True])
def test_a_mirror_wall_doubles_the_room(table):
    points = [(0.3, 0.2, 0.4), (0.6, 0.3, -0.8), (1.5, -1.0, 0.9), (3.0, 0.2, 0.0)]
    bodies, images = (), ()
    if table:
        bodies = (Body(PatchSet.box((1.1, 0.8, 0.05), center=(1.05, 0, 0))),)
        images = (Body(PatchSet.box((1.1, 0.8, 0.05), center=(-1.05, 0, 0))),)
    mirror = Material(0.0, mirror=1.0)
    rooms = doubled_rooms(mirror, Material(0.5), points, (-1, 0, 0), *bodies, images=images)
    one, two = (solve(room, accuracy=0.03) for room in rooms)
    a, b = one.sensors["g"], two.sensors["g"]
    assert a.components["lamp.direct"] == pytest.approx(b.components["lamp.direct"], rel=1e-5)
    assert (np.abs(a.illuminance_lx - b.illuminance_lx) <= a.error_lx + b.error_lx).all()
    assert a.illuminance_lx == pytest.approx(b.illuminance_lx, rel=0.01)
    # A sixth of the accuracy asked: form factors of large elements are not reciprocal.
    assert abs(one.balance.residual_fraction) < 5e-3


def test_facing_mirrors_show_rows_of_images():
    # Walls at x = ±1 of 70 % each, all else black: images at 2k ± x, by rays from the second on.
    walls = (
        rectangle((-1, -2, 0), (-1, 2, 0), (-1, 2, 3), (-1, -2, 3)),
        rectangle((1, -2, 0), (1, -2, 3), (1, 2, 3), (1, 2, 0)),
    )
    parts = setup(*walls, ceiling(-0.1, 0.3, -0.3, 0.3, 2.5))
    mirror = Material(0.0, mirror=0.7)
    point = np.array([(0.2, 0.1, 0.5)])
    made = with_materials(
        parts, [mirror, mirror, BLACK], lamps=[(2, "lamp", 1000.0)], sensors=[grid("g", point, UP)]
    )
    found = solve(made, accuracy=0.01).sensors["g"]
    exact = 0.0
    for k in range(-12, 13):
        # An image past k walls is turned where k is odd.
        x0, x1 = (2 * k - 0.1, 2 * k + 0.3) if k % 2 == 0 else (2 * k - 0.3, 2 * k + 0.1)
        window = [1000.0 * 0.7 ** abs(k)]
        # The last wall passed bounds what is seen: the mirrors are 4 m wide, and 3 m high.
        image = ceiling(x0, x1, -0.3, 0.3, 2.5)
        exact += window[0] * point_form_factors(point, UP, image, accuracy=1e-8).value[0, 0]
    assert found.illuminance_lx[0] == pytest.approx(exact, rel=5e-3)
    assert abs(found.illuminance_lx[0] - exact) <= found.error_lx[0]


def test_even_light_stays_even_with_mirrors_and_lobes():
    # Emission 100 (1 − all that is reflected) makes 100 everywhere, whatever reflects it.
    made = [
        Material(0.2, mirror=0.3),
        Material(0.5),
        Material(0.3, specular=0.2, exponent=20),
        Material(0.1, specular=0.2, mirror=0.2, exponent=200),
        Material(0.5),
        Material(0.4, specular=0.1, exponent=5),
    ]
    box = PatchSet.box((4, 3, 2.5), inward=True)
    parts = setup(*(box.take(np.array([k])) for k in range(6)))
    points = [(0.3, 0.2, 0.4), (-1.0, 0.5, -0.8)]
    lamps = [(k, "a", 50.0) for k in range(6)]
    result = solve(
        with_materials(parts, made, lamps=lamps, sensors=[grid("g", points, UP)]), accuracy=0.05
    )
    on_surfaces = sum(result.components.values())
    assert on_surfaces == pytest.approx(100.0, rel=1e-4)
    found = result.sensors["g"]
    assert found.illuminance_lx == pytest.approx(100.0, rel=3e-3)
    assert abs(result.balance.residual_fraction) < 1e-4


def test_a_half_mirrored_sphere_stays_even():
    # Curved mirrors: rays over the mirrored half, whose shares sum to its form factors.
    ball = PatchSet.sphere((0, 0, 0), 2.0, inward=True)
    half = ball.control_points[..., 2].mean(axis=(1, 2)) > 0.0
    parts = setup(ball.take(np.flatnonzero(half)), ball.take(np.flatnonzero(~half)))
    made = with_materials(
        parts,
        [Material(0.1, mirror=0.5), Material(0.6)],
        lamps=[(0, "a", 40.0), (1, "a", 40.0)],
    )
    result = solve(made, accuracy=0.05)
    assert sum(result.components.values()) == pytest.approx(100.0, rel=2e-2)
    assert np.average(sum(result.components.values())) == pytest.approx(100.0, rel=3e-3)
    assert any("curved mirrors" in text and "part0" in text for text in result.warnings)


def test_sky_in_a_mirror():
    # A mirror that leans back at 45° shows a sensor that looks along x the sky above.
    mirror = rectangle((1, -0.5, 0), (1.7, -0.5, 0.7), (1.7, 0.5, 0.7), (1, 0.5, 0))
    sky = CIESky(5, zenith_luminance_cd_m2=1000.0)
    points = np.array([(0.0, 0.0, 0.3), (0.2, 0.3, 0.5)])
    parts, sensors = setup(mirror), [grid("g", points, (1, 0, 0))]
    how = {"sky": sky, "ground": Ground(0.0), "sensors": sensors}
    dark = solve(with_materials(parts, [BLACK], **how), accuracy=0.01)
    bright = solve(with_materials(parts, [Material(0.0, mirror=0.6)], **how), accuracy=0.01)
    normal = parts.patches.normals(0.5, 0.5)[0]
    assert normal[2] > 0.0 > normal[0]
    seen = point_form_factors(points, (1, 0, 0), parts.patches, accuracy=1e-8).value[:, 0]
    change = bright.sensors["g"].illuminance_lx - dark.sensors["g"].illuminance_lx
    assert change == pytest.approx(0.6 * 1000.0 * math.pi * seen, rel=2e-3)


def test_sun_in_a_mirror():
    # On the ground a mirror sends the sun up: half of the sensors are over what it lights.
    mirror = rectangle((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    sun = Sun(40.0, 180.0, normal_illuminance_lx=1000.0)
    shift = 1.0 / math.tan(math.radians(40.0))
    points = [(0.0, 0.5 + shift, 1.0), (0.9, -0.9 + shift, 1.0), (0.0, -1.2 + shift, 1.0)]
    made = with_materials(
        setup(mirror), [Material(0.0, mirror=0.9)], sun=sun, sensors=[grid("g", points, DOWN)]
    )
    found = solve(made, accuracy=0.01).sensors["g"].components["sun.direct"]
    lit = 0.9 * 1000.0 * math.sin(math.radians(40.0))
    assert found == pytest.approx([lit, lit, 0.0], rel=1e-4, abs=1e-4)


def test_pictures_keep_the_sun_that_mirrors_throw():
    """Before a mirror on a floor: the sun twice, at each pixel and by the elements.

    The latter is smoothed towards elements about it of which some get less: here by a tenth of all.
    Without what the mirror throws, half is missing.
    """
    floor = rectangle((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
    mirror = rectangle((-3, 1, 0), (3, 1, 0), (3, 1, 3), (-3, 1, 3))
    sun = Sun(40.0, 180.0, normal_illuminance_lx=1000.0)
    # Of the lit y = −2.6 … 1 the middle.
    above = Camera(
        (0, -0.6, 5), (0, -0.6, 0), name="above", up=(0, 1, 0), projection="parallel", fov_deg=9.0,
        size=(8, 8),
    )  # fmt: skip
    made = with_materials(
        setup(floor, mirror), [Material(0.5), Material(0.0, mirror=0.9)], sun=sun, cameras=(above,)
    )
    image = solve(made, accuracy=0.05).images["above"]
    lit = 1.9 * 1000.0 * math.sin(math.radians(40.0))
    assert image.illuminance_lx == pytest.approx(np.full((8, 8), lit), rel=0.2)
    assert image.luminance_cd_m2 == pytest.approx(np.full((8, 8), 0.5 * lit / math.pi), rel=0.2)


def test_scenes_without_mirrors_pay_nothing():
    parts = setup(PatchSet.box((4, 3, 2.5), inward=True), ceiling(-0.3, 0.3, -0.2, 0.2, 1.2))
    made = scene(parts, lamps=[(1, "a", 100.0)], sensors=[grid("g", [(0, 0, 0)])])
    result = solve(made, accuracy=0.05)
    assert result.skipped["mirrors"] == "no mirrors"
    assert result.skipped["second pass"] == "nothing is glossy"
    assert not {"mirror_rays", "mirror_pairs", "glossy_points"} & set(result.counters)
    assert not {"mirrors", "second pass"} & set(result.stages)


@pytest.mark.parametrize("web", [cosine(), uneven(90.0)])
def test_a_web_in_a_mirror_keeps_its_directions(web):
    # From afar the lamp is its web: the image of the sensor is in the direction that counts.
    mirror = rectangle((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))
    points = np.array([(0.7, 0.3, 1.0), (-1.0, 0.8, 1.6), (0.2, -1.4, 0.6)])
    parts = setup(mirror, ceiling(-0.01, 0.01, -0.01, 0.01, 3.0))
    made = with_materials(
        parts,
        [Material(0.0, mirror=0.8), BLACK],
        lamps=[(1, "lamp", 1.0)],
        sensors=[grid("g", points, DOWN)],
    )
    made = with_web(made, web)
    found = solve(made, accuracy=0.02)
    way = points * (1, 1, -1) - (0, 0, 3)
    distance = np.linalg.norm(way, axis=1)
    intensity = toward(made.luminaires[0].web, way / distance[:, None])
    exact = 0.8 * intensity * -way[:, 2] / distance**3
    # The lamp is a five-hundredth of the distance wide, and webs bend at their angles.
    assert found.sensors["g"].components["lamp.direct"] == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("curved", [False, True])
def test_without_visibility_nothing_hides_in_mirrors(curved):
    """A screen between lamp and mirror, and one between mirror and sensor, change nothing."""
    mirror = PatchSet.sphere((0, 0, -3), 3.0) if curved else rectangle(*SQUARE)
    screens = (ceiling(-0.6, 0.6, -0.6, 0.6, 1.2), ceiling(-0.4, 0.4, -0.4, 0.4, 0.3))
    points = np.array([(0.3, 0.2, 0.6), (-0.2, -0.3, 0.9)])
    how = {"lamps": [(1, "lamp", 1000.0)], "sensors": [grid("g", points, DOWN)]}
    how |= {"sky": CIESky(5, zenith_luminance_cd_m2=100.0), "ground": Ground(0.0)}
    light = []
    for more in ((), screens):
        parts = setup(mirror, ceiling(-0.3, 0.2, -0.3, 0.3, 2.0), *more)
        made = [Material(0.0, mirror=0.8), BLACK, *(BLACK for _ in more)]
        made = with_materials(parts, made, **how)
        light.append(solve(made, accuracy=0.03, visibility="none").sensors["g"])
    plain, hidden = light
    assert plain.components["lamp.direct"].min() > 1.0
    for name in ("lamp.direct", "sky.direct"):
        # Rays are the same, but for what the larger scene does to their rounding.
        np.testing.assert_allclose(hidden.components[name], plain.components[name], rtol=1e-6)


def test_what_sensors_see_in_mirrors_matters():
    """A sensor looks at a mirror wall; the wall behind it counts by what is seen of it there."""
    one, wall = room_parts(0.0, 4.0, [(1.0, 1.5)])
    made = [Material(0.5)] * 6 + [BLACK]
    made[wall] = Material(0.0, mirror=0.9)
    sensors = [grid("g", [(0.5, 0.0, 0.0)], (-1, 0, 0))]
    data = with_materials(one, made, lamps=[(6, "lamp", 1000.0)], sensors=sensors)
    stages = Stages()
    solver = FieldSolver(data, one.blockers, trace=True, stages=stages)
    budget = Budget.of(data, 0.3)
    field = solver.solve(budget, Boxes.regular(budget.divisions, data.two_sided))
    seen = solver.seen(sensors[0], budget, field)
    weights = weights_at(seen.factors, field.surfaces.areas)
    straight = weights_at(seen.factors[:1], field.surfaces.areas)
    opposite = field.surfaces.elements.nodes[..., 0].mean(axis=1) > 3.9
    assert opposite.any()
    # Behind the back of the sensor nothing is seen straight: what is left there is for anything.
    assert straight[opposite] == pytest.approx(ANYWHERE)
    assert weights[opposite].min() > 1.5 * ANYWHERE
