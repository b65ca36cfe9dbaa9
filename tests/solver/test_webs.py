"""Lamps with photometric webs: far and near field, flux, hiding, motion, pictures."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from patchlight.solver.model import Camera, PatchSet, Photometry, Web
from patchlight.solver.simulation import solve
from patchlight.solver.web_ledger import Faces, escaping_share
from patchlight.solver.web_shape import WebShape, directions
from patchlight.solver.webs import WebLamp

from .fixtures_light import (
    UP,
    Body,
    area_rule,
    ceiling,
    closed_cylinder,
    grid,
    rectangle,
    scene,
    setup,
    turned,
)

DOWN, EAST = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
#: A floor far below, so that a scene has a surface besides its lamp, black in most tests.
FLOOR = rectangle((-9, -9, -9), (9, -9, -9), (9, 9, -9), (-9, 9, -9))
BLACK = {"materials": [0.0, 0.0, 0.0]}


def cosine(flux=1000.0, step=1.0):
    """Intensity of a Lambertian disc, chords of the cosine over ``step`` degrees."""
    gamma = np.arange(0.0, 90.0 + 0.5 * step, step)
    row = flux / math.pi * np.cos(np.radians(gamma))
    row[-1] = 0.0
    return Photometry([0.0, 360.0], gamma, [row, row])


def uneven(top=180.0):
    """A web without any symmetry."""
    c, gamma = np.arange(0.0, 361.0, 15.0), np.arange(0.0, top + 1.0, 5.0)
    a, b = np.radians(c)[:, None], np.radians(gamma)[None]
    table = 120.0 + 60.0 * np.sin(b) * np.cos(a) + 35.0 * np.sin(b) * np.sin(a + 0.4)
    table = table + 25.0 * np.sin(2.0 * b) * np.cos(2.0 * a) + 40.0 * np.cos(b)
    table[-1] = table[0]
    return Photometry(c, gamma, table * np.ones_like(gamma))


def beam():
    """A narrow beam of 10 degrees with a steep edge, towards γ = 0."""
    gamma = np.array([0.0, 2.5, 5.0, 7.5, 10.0, 90.0])
    row = np.array([900.0, 850.0, 500.0, 60.0, 0.0, 0.0])
    return Photometry([0.0, 360.0], gamma, [row, row])


def with_web(data, photometry, *, row=0, aim=DOWN, c0=EAST, flux=None):
    """The scene with the luminaire ``row`` shining by a web, of its own flux unless given."""
    lamps = list(data.luminaires)
    web = Web.aimed(photometry, aim, c0)
    lamps[row] = dataclasses.replace(
        lamps[row], web=web, flux_lm=photometry.flux_lm if flux is None else flux
    )
    return dataclasses.replace(data, luminaires=tuple(lamps))


def toward(web, direction):
    """Intensity (m,) of a `Web` in directions (m, 3), from C and γ anew."""
    d = np.atleast_2d(direction) @ web.axes.T
    gamma = np.degrees(np.arccos(np.clip(d[:, 2], -1.0, 1.0)))
    return web.photometry.intensity(np.degrees(np.arctan2(d[:, 1], d[:, 0])), gamma)


def direct(data, accuracy=0.05):
    """Direct illuminance by the group ``lamp`` on the grid ``g``."""
    return solve(data, accuracy=accuracy).sensors["g"].components["lamp.direct"]


SHAPES = {
    "panel": Body(ceiling(-0.03, 0.03, -0.02, 0.02, 0.0), False),
    "box": Body(PatchSet.box((0.05, 0.03, 0.02))),
    "ball": Body(PatchSet.sphere((0, 0, 0), 0.02)),
    "rod": closed_cylinder((0, -0.03, 0), (0, 0.03, 0), 0.01),
}
FLAT = ("panel", "box")


@pytest.mark.parametrize("name", SHAPES)
def test_far_field_is_the_web(name):
    """E = I cosθ / r² where the lamp is a point: 0.06 m at 3 m, second order in their ratio."""
    rng = np.random.default_rng(7)
    d = rng.normal(size=(24, 3))
    if name == "panel":
        d[:, 2] = -np.abs(d[:, 2])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    d = d[d[:, 2] < -0.2] if name == "panel" else d
    points, normals = 3.0 * d, -d
    body = SHAPES[name]
    photometry = uneven(90.0 if name == "panel" else 180.0)
    data = scene(setup(FLOOR, body), lamps=[(1, "lamp", 1.0)], **BLACK)
    data = dataclasses.replace(data, sensors=(grid("g", points, normals),))
    data = with_web(data, photometry)
    expected = toward(data.luminaires[0].web, d) / 9.0
    # The web bends at its angles, under a lamp 1° wide; what curved faces show comes from a table
    # of 2.5°, which bends at the axis of the rod.
    np.testing.assert_allclose(direct(data), expected, rtol=2e-3 if name in FLAT else 5e-3)


@pytest.mark.parametrize("height", [0.05, 0.3, 2.0])
def test_cosine_web_on_a_disc_is_a_lambertian_disc(height):
    """E = Φ/(π R²) · R²/(R² + h²) on the axis: the closed form of a Lambertian disc."""
    radius = 0.2
    lamp = PatchSet.disk((0, 0, 0), radius, DOWN)
    sensor = grid("g", [(0, 0, -height)])
    data = scene(setup(FLOOR, lamp), lamps=[(1, "lamp", 1.0)], sensors=[sensor], **BLACK)
    expected = 1000.0 / math.pi / (radius**2 + height**2)
    # Chords of the cosine over 1° are 4e-5 off at most.
    assert direct(with_web(data, cosine(), flux=1000.0))[0] == pytest.approx(expected, rel=1e-4)


def test_cosine_web_on_a_large_panel_is_the_even_emitter_at_every_distance():
    room = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    lamp = ceiling(-0.6, 0.6, -0.3, 0.3, 2.5)
    points = [(x, y, z) for z in (2.45, 2.0, 1.0, 0.2) for x, y in ((0, 0), (0.7, 0.1), (1.5, 2))]
    data = scene(setup(room, lamp), lamps=[(1, "lamp", 1000.0 / 0.72)], sensors=[grid("g", points)])
    even = solve(data, accuracy=0.01)
    web = solve(with_web(data, cosine(), flux=1000.0), accuracy=0.01)
    assert len(web.elements) == len(even.elements)  # both were made finer alike
    # Luminance is within 4e-5 of even (chords); sums of positive terms keep that.
    for part in ("direct", "indirect"):
        np.testing.assert_allclose(
            web.sensors["g"].components[f"lamp.{part}"],
            even.sensors["g"].components[f"lamp.{part}"],
            rtol=1e-4,
        )
    assert web.balance.emitted_lm == pytest.approx(1000.0, rel=1e-12)
    assert web.balance.absorbed_lm == pytest.approx(even.balance.absorbed_lm, rel=1e-4)


@pytest.mark.parametrize("name", SHAPES)
def test_all_of_the_flux_is_emitted(name):
    """∫ L(d) A(d) dω by a rule of its own is the flux of the lamp."""
    photometry = uneven(90.0 if name == "panel" else 180.0)
    body = SHAPES[name]
    data = scene(setup(FLOOR, body), lamps=[(1, "lamp", 1.0)], **BLACK)
    lamp = WebLamp(with_web(data, photometry, flux=777.0), 0, 0.01)
    t, w = np.polynomial.legendre.leggauss(4)
    c0, g0 = np.meshgrid(photometry.c_deg[:-1], photometry.gamma_deg[:-1], indexing="ij")
    total = 0.0
    for a, wa in zip(t, w, strict=True):
        for b, wb in zip(t, w, strict=True):
            c, gamma = (c0 + 7.5 * (1 + a)).ravel(), (g0 + 2.5 * (1 + b)).ravel()
            d = directions(lamp.web, c, gamma)
            flux = lamp.luminance(d) * lamp.shape.projected(d) * np.sin(np.radians(gamma))
            total += flux.sum() * wa * wb * math.radians(7.5) * math.radians(2.5)
    # Flat faces to rounding of the 4-point rule; curved ones by a table of 2.5°.
    assert total == pytest.approx(777.0, rel=1e-6 if name in FLAT else 2e-4)


def test_copies_of_a_lamp_share_their_tables():
    balls = [Body(PatchSet.sphere((x, 0.3, 0.1), 0.02)) for x in (0.0, 1.7)]
    data = scene(setup(FLOOR, *balls), lamps=[(1, "a", 1.0), (2, "b", 1.0)], **BLACK)
    photometry = uneven()
    data = with_web(with_web(data, photometry), photometry, row=1)
    known = {}
    lamps = [WebLamp(data, row, 0.1, known) for row in (0, 1)]
    assert len(known) == 1 and lamps[1].tables is lamps[0].tables
    turned_web = with_web(data, photometry, row=1, c0=(0.0, 1.0, 0.0))
    assert WebLamp(turned_web, 1, 0.1, known).tables is not lamps[0].tables


def test_shapes_project_as_they_should():
    patches = SHAPES["rod"].patches
    shape = WebShape.of(patches, np.zeros(len(patches), bool))
    d = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.6, 0.8]])
    end, side = math.pi * 1e-4, 0.02 * 0.06
    # Twenty Gauss nodes over a quarter turn that the horizon may cut.
    np.testing.assert_allclose(shape.projected(d), [end, side, 0.6 * end + 0.8 * side], rtol=3e-3)
    panel = SHAPES["panel"].patches
    for flip, direction in ((False, DOWN), (True, UP)):
        one = WebShape.of(panel, np.full(len(panel), flip))
        assert one.projected(np.array([direction]))[0] == pytest.approx(0.0024, rel=1e-12)
        share = one.seen_share(Web.aimed(cosine(), DOWN, EAST))
        assert share == (0.0 if flip else 1.0)


def test_superposition_of_two_lamps():
    room = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    first, second = ceiling(-1.2, -0.9, 0.2, 0.5, 2.5), ceiling(0.8, 1.1, -0.4, -0.2, 2.4)
    points = grid("g", [(0.3, 0.4, 0.8), (-1.0, 0.3, 0.8), (1.5, -1.0, 1.2)])
    data = scene(
        setup(room, first, second),
        lamps=[(1, "a", 1.0), (2, "b", 1.0)],
        sensors=[points],
    )
    both = with_web(with_web(data, uneven(90.0)), beam(), row=1, flux=500.0)
    found = solve(both, accuracy=0.1).sensors["g"]
    for row, group in ((0, "b"), (1, "a")):
        lamps = list(both.luminaires)
        lamps[row] = dataclasses.replace(lamps[row], flux_lm=0.0)
        one = dataclasses.replace(both, luminaires=tuple(lamps))
        alone = solve(one, accuracy=0.1).sensors["g"]
        # Sensors see the lamps by pyramids. What is reflected depends on the mesh, and that on the
        # lamps: to what both state as their errors.
        for part, tolerance in (("direct", 1e-3), ("indirect", np.inf)):
            key = f"{group}.{part}"
            off = np.abs(alone.components[key] - found.components[key])
            assert (off <= alone.error_lx + found.error_lx).all()
            assert (off <= tolerance * found.components[key]).all()


@pytest.mark.parametrize("accuracy", [0.1, 0.02])
def test_ledger_of_a_closed_room_with_a_narrow_beam(accuracy):
    """All that the lamp emits arrives, though few nodes of the floor lie in its beam."""
    room = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    lamp = ceiling(-0.05, 0.12, 0.4, 0.55, 2.5)
    data = scene(setup(room, lamp), lamps=[(1, "lamp", 1.0)], rho=0.0)
    balance = solve(with_web(data, beam(), flux=1000.0), accuracy=accuracy).balance
    assert balance.emitted_lm == pytest.approx(1000.0, rel=1e-12)
    # The form factors of the nodes miss as much for a lamp that shines evenly.
    assert balance.absorbed_lm == pytest.approx(1000.0, rel=5e-3)


def test_rigid_motion_with_aim_and_c0():
    lamp = SHAPES["box"].patches
    points = np.array([(0.3, 0.2, -0.4), (-0.2, 0.5, 0.3), (0.1, -0.02, 0.06), (0.5, -1.0, 0.1)])
    normals = -points / np.linalg.norm(points, axis=1, keepdims=True)
    found = []
    for motion in (np.eye(4), turned(2.1)):
        turn, offset = motion[:3, :3], motion[:3, 3]
        data = scene(
            setup(FLOOR.moved(motion), Body(lamp.moved(motion))), lamps=[(1, "lamp", 1.0)], **BLACK
        )
        data = dataclasses.replace(
            data, sensors=(grid("g", points @ turn.T + offset, normals @ turn.T),)
        )
        found.append(direct(with_web(data, uneven(), aim=turn @ DOWN, c0=turn @ EAST)))
    # The mean luminance is found by the same points; form factors to their accuracy.
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5)
    assert np.ptp(found[0]) > 0.5 * found[0].mean()


def brute(web, lamp, blocked, point, normal, order=160):
    """Illuminance from a flat lamp by points on it, those for which ``blocked`` holds left out."""
    at, n, weight = area_rule(lamp, order)
    area = weight.sum()
    r = point - at
    distance = np.linalg.norm(r, axis=1)
    d = r / distance[:, None]
    cosine_there = np.maximum(np.einsum("ij,ij->i", d, n), 0.0)
    cosine_here = np.maximum(-d @ normal, 0.0)
    seen = ~blocked(at)
    return float(
        (toward(web, d) / area * cosine_here / distance**2 * weight * seen)[
            cosine_there > 0.0
        ].sum()
    )


@pytest.mark.parametrize("x", [-0.5, -0.1, 0.15, 0.4])
def test_partly_hidden_panel_with_an_uneven_web(x):
    """A plate hides the lamp from a line on: its shadow boundary on the lamp is known."""
    lamp = ceiling(-0.6, 0.6, -0.3, 0.3, 2.0)
    plate = rectangle((0, -3, 1.0), (3, -3, 1.0), (3, 3, 1.0), (0, 3, 1.0))
    point, normal = np.array([x, 0.1, 0.0]), np.array(UP)
    data = scene(setup(FLOOR, lamp, plate), lamps=[(1, "lamp", 1.0)], **BLACK)
    data = with_web(dataclasses.replace(data, sensors=(grid("g", [point]),)), uneven(90.0))
    web = data.luminaires[0].web
    # Seen through x < 0 at z = 1, half way: what lies at x' with (x + x')/2 < 0.
    expected = brute(web, lamp, lambda at: x + at[:, 0] > 0.0, point, normal, 400)
    result = solve(data, accuracy=0.01).sensors["g"]
    # The rule of 400² points meets the shadow edge within 3e-3 of the lamp.
    assert result.illuminance_lx[0] == pytest.approx(expected, rel=0.01)
    assert abs(result.illuminance_lx[0] - expected) <= result.error_lx[0] + 3e-3 * expected


def test_narrow_beam_from_a_panel_close_by():
    """Where the whole beam comes from within the panel, E = ∫ I/A dω = Φ/A at any distance."""
    lamp = ceiling(-0.5, 0.5, -0.5, 0.5, 1.0)
    points = [
        (0.0, 0.0, 0.5),
        (0.1, 0.2, 0.0),
        (0.3, -0.1, 0.95),
        (0.45, 0.1, 0.4),
        (0.6, 0.0, 0.0),
    ]
    data = scene(setup(FLOOR, lamp), lamps=[(1, "lamp", 1.0)], sensors=[grid("g", points)], **BLACK)
    data = with_web(data, beam())
    web, flux = data.luminaires[0].web, beam().flux_lm
    found = direct(data, 0.01)
    # At 5 cm the beam is a hundredth of the panel wide; the rule cuts it at 1/256.
    np.testing.assert_allclose(found[:3], flux, rtol=3e-3)
    edge = [brute(web, lamp, lambda at: at[:, 0] > 9.0, np.array(p), UP, 900) for p in points[3:]]
    np.testing.assert_allclose(found[3:], edge, rtol=3e-3)


def test_ledger_of_an_open_scene():
    """A table under a lamp that shines up and down: rays find what escapes, the ledger closes."""
    table = rectangle((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    lamp = Body(PatchSet.box((0.3, 0.2, 0.05), center=(0, 0, 1.0)))
    data = scene(setup(table, lamp), lamps=[(1, "lamp", 1.0)], **BLACK)
    data = with_web(data, uneven())
    balance = solve(data, accuracy=0.02).balance
    assert balance.emitted_lm == pytest.approx(uneven().flux_lm, rel=1e-12)
    # 2^14 even rays: 2e-3 of the lamp's light; the nodes of the table add as much.
    assert abs(balance.residual_fraction) < 3e-3
    assert 0.5 < balance.escaped_lm / balance.emitted_lm < 0.9


def test_rays_from_a_lamp_alone_all_escape():
    lamp = Body(PatchSet.sphere((0, 0, 0), 0.1))
    data = with_web(scene(setup(lamp), lamps=[(0, "lamp", 1.0)], rho=0.0), uneven())
    from patchlight.solver.raycast import RayCaster

    web = WebLamp(data, 0, 0.1)
    faces = Faces.of(web.elements(np.ones((len(data.patches), 2), dtype=np.int64)))
    caster = RayCaster(data.patches)
    assert escaping_share(faces, web.towards, web.sent, data, caster, 4096) == 1.0


def test_what_is_buried_of_a_lamp_emits_nothing():
    """A box half sunk into a slab, light straight down: the open lower half has all of it."""
    slab = Body(PatchSet.box((2.0, 2.0, 0.4), center=(0, 0, 2.2)))
    room = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    lamp = Body(PatchSet.box((0.3, 0.3, 0.2), center=(0, 0, 2.0)))
    data = scene(setup(room, slab, lamp), lamps=[(2, "lamp", 1.0)], rho=0.3)
    balance = solve(with_web(data, beam(), flux=1000.0), accuracy=0.1).balance
    # A beam of some degrees shows the sides, half of them buried, by a few per cent.
    assert balance.emitted_lm == pytest.approx(1000.0, rel=0.03)
    # Of what is reflected near the slab, half of the accuracy asked for.
    assert abs(balance.residual_fraction) < 5e-2


def test_faces_of_a_lamp_may_be_cut_for_the_light_of_others():
    """A web on a reflecting panel beside a bright bulb: cut, its light is the same."""
    room = Body(PatchSet.box((4, 5, 2.7), center=(0, 0, 1.35), inward=True))
    panel, bulb = (
        ceiling(-0.3, 0.3, -0.3, 0.3, 2.5),
        Body(PatchSet.box((0.04,) * 3, (0.2, 0.2, 2.42))),
    )
    points = grid("g", [(0.3, 0.4, 0.8), (-1.0, 0.3, 0.8)])
    setting = setup(room, panel, bulb)
    both = scene(setting, lamps=[(1, "web", 1.0), (2, "bulb", 2e4)], rho=0.5, sensors=[points])
    alone = scene(setting, lamps=[(1, "web", 1.0), (2, "bulb", 0.0)], rho=0.5, sensors=[points])
    found, true = (
        solve(with_web(data, cosine(), flux=1000.0), accuracy=0.1) for data in (both, alone)
    )
    assert found.counters["elements_added"] > 0
    assert found.balance.emitted_by_group["web"] == pytest.approx(1000.0, rel=1e-9)
    key = "web.direct"
    np.testing.assert_allclose(
        found.sensors["g"].components[key], true.sensors["g"].components[key], rtol=2e-3
    )
    # As the same panel without a web: the bulb is close to it for so coarse a mesh.
    assert abs(found.balance.residual_fraction) < 0.1


def test_a_web_that_is_the_same_in_all_directions():
    """An isotropic file: E = I / r² at every place around a ball."""
    level = Photometry([0.0, 360.0], np.array([0.0, 90.0, 180.0]), np.full((2, 3), 80.0))
    ball = Body(PatchSet.sphere((0, 0, 0), 0.02))
    points = 3.0 * np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -0.6, -0.8]])
    data = scene(setup(ball), lamps=[(0, "lamp", 1.0)], rho=0.0)
    data = dataclasses.replace(data, sensors=(grid("g", points, -points / 3.0),))
    np.testing.assert_allclose(direct(with_web(data, level)), 80.0 / 9.0, rtol=5e-3)


def test_cameras_see_the_luminance_of_their_direction():
    lamp = ceiling(-0.6, 0.6, -0.3, 0.3, 2.0)
    photometry = uneven(90.0)
    for eye in ((0.0, 0.0, 0.0), (1.5, 0.4, 0.5)):
        view = Camera(eye, (0.1, 0.05, 2.0), "c", fov_deg=2.0, size=(4, 4), up=(0, 1, 0))
        data = scene(setup(FLOOR, lamp), lamps=[(1, "lamp", 1.0)], **BLACK)
        data = with_web(dataclasses.replace(data, cameras=(view,)), photometry)
        image = solve(data, accuracy=0.2).images["c"]
        d = np.array(eye) - (0.1, 0.05, 2.0)
        d /= np.linalg.norm(d)
        expected = toward(data.luminaires[0].web, d)[0] / (0.72 * abs(d[2]))
        # The four by four pixels look within one degree of it.
        np.testing.assert_allclose(image.luminance_cd_m2, expected, rtol=0.02)
