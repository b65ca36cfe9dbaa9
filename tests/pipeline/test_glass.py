"""Glass in scenes: what a user assigns, and what the light then does."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from patchlight.pipeline import (
    Camera,
    CIESky,
    Emitter,
    Glass,
    Ground,
    Material,
    PatchSet,
    Scene,
    SensorGrid,
    Sun,
    load_scene,
    simulate,
)
from patchlight.solver.errors import InputError
from patchlight.solver.glass import GlassLaw
from patchlight.solver.model import Glazing
from patchlight.solver.skies import luminance

from .scene_files import write
from .window_room import level, opening, quad, window_room

PANE = Glass(0.006)
LAW = GlassLaw.of(Glazing(PANE, 0.006))
NOTHING = Glass(n=1.0, absorption_per_m=0.0)
UP = (0.0, 0.0, 1.0)
HEAD = 'schema_version = 1\n[[model]]\nfile = "room.step"\nname = "room"\n'


def room(glass: Glass | None, *, rho=0.0, sky=None, panes=(0.0,), **options) -> Scene:
    """A room 4 x 4 x 3 m, in its wall y = 0 an opening 2 x 1 m from z = 1 m."""
    scene = window_room(4.0, 3.0, rho)
    for k, y in enumerate(panes if glass is not None else ()):
        scene.add(opening(y), f"pane{k}")
        scene.assign(f"pane{k}", glass)
    scene.sky, scene.ground = sky, Ground(options.pop("ground", 0.0))
    assert not options
    return scene


POINTS = np.array([(0.3, 3.2, 0.0), (0.0, 1.2, 0.0), (-1.4, 0.3, 0.0), (0.5, 3.999, 1.4)])
NORMALS = np.array([UP, UP, UP, (0.0, -1.0, 0.0)])


def with_points(scene: Scene, points=POINTS, normals=NORMALS) -> Scene:
    scene.add(SensorGrid(points, normals, name="points"))
    return scene


def at_points(scene: Scene, accuracy=0.2) -> np.ndarray:
    return simulate(scene, accuracy=accuracy).sensors["points"].illuminance_lx


def through_opening(sky: CIESky, ground_luminance: float, crossings=1) -> np.ndarray:
    """Light at `POINTS` by Gauss' rule over the opening, cut at the height of the point. [lx]"""
    t, weight = leggauss(80)
    out = []
    for point, normal in zip(POINTS, NORMALS, strict=True):
        total = 0.0
        cuts = sorted({1.0, 2.0, min(max(point[2], 1.0), 2.0)})
        for low, high in zip(cuts[:-1], cuts[1:], strict=True):
            x, z = np.meshgrid(t, 0.5 * (low + high) + 0.5 * (high - low) * t, indexing="ij")
            way = np.stack([x - point[0], 0.0 * x - point[1], z - point[2]], axis=-1)
            length = np.linalg.norm(way, axis=-1)
            way /= length[..., None]
            there = np.abs(way[..., 1])
            level = np.where(way[..., 2] > 0.0, luminance(sky, way), ground_luminance)
            value = level * LAW.transmittance(there) ** crossings
            value *= np.maximum(way @ normal, 0.0) * there / length**2
            total += np.einsum("i,j,ij->", weight, weight, value) * 0.5 * (high - low)
        out.append(total)
    return np.array(out)


@pytest.mark.parametrize("kind", [16, 1])
def test_a_window_under_an_overcast_sky(kind):
    """No surface reflects; measured differences are 1e-5, asked for are 1e-4."""
    sky = CIESky(kind, diffuse_illuminance_lx=10_000.0)
    scene = with_points(room(PANE, sky=sky, ground=0.3))
    result = simulate(scene, accuracy=0.2)
    expected = through_opening(sky, 0.3 * 10_000.0 / np.pi)
    np.testing.assert_allclose(result.sensors["points"].illuminance_lx, expected, rtol=1e-4)
    assert "light through panes" in result.stages and "glass" not in result.skipped


def test_two_panes_one_behind_the_other():
    sky = CIESky(16, diffuse_illuminance_lx=10_000.0)
    scene = with_points(room(PANE, sky=sky))
    # So large that all that is seen through the inner one is seen through the outer one.
    scene.add(quad((-4, -0.1, -4), (4, -0.1, -4), (4, -0.1, 6), (-4, -0.1, 6)), "outer")
    scene.assign("outer", PANE)
    found = simulate(scene, accuracy=0.2).sensors["points"].components["sky.direct"]
    np.testing.assert_allclose(found, through_opening(sky, 0.0, 2), rtol=1e-4)


def test_light_varies_over_elements_beside_panes():
    """Meshes of 90 and 190 elements agree; exitance that is even on each left four times that."""
    light = []
    points = np.array([(x, y, 0.8) for x in (-1.5, -0.5, 0.5, 1.5) for y in (0.5, 1.5, 2.5, 3.5)])
    for accuracy in (0.1, 0.02):
        sky = CIESky(16, diffuse_illuminance_lx=10_000.0)
        scene = with_points(room(PANE, rho=0.6, sky=sky, ground=0.2), points, np.tile(UP, (16, 1)))
        result = simulate(scene, accuracy=accuracy)
        assert result.settings["basis"] == "bilinear"
        light.append(result.sensors["points"])
    coarse, fine = light
    np.testing.assert_allclose(coarse.illuminance_lx, fine.illuminance_lx, rtol=3e-3)
    assert (np.abs(coarse.illuminance_lx - fine.illuminance_lx) <= coarse.error_lx).all()
    diffusing = with_points(room(Glass(0.006, diffuse=0.5), rho=0.6, sky=sky))
    assert simulate(diffusing, accuracy=0.2).settings["basis"] == "constant"


def outdoors(scene: Scene) -> None:
    """A lamp outside, before a wall."""
    scene.add(quad((-3, -5, 0), (3, -5, 0), (3, -5, 6), (-3, -5, 6)), "opposite", two_sided=True)
    scene.assign("opposite", Material(0.6))
    scene.add(PatchSet.sphere((0.4, -2.0, 2.0), 0.2), "globe")
    scene.assign("globe", Emitter(flux_lm=10_000.0))


@pytest.mark.slow
def test_glass_that_keeps_nothing_back_is_no_glass():
    """Lamp and reflected light: the same factors, times 1, and columns of panes that send none."""
    found = []
    for glass in (None, NOTHING):
        scene = with_points(room(glass, rho=0.5))
        outdoors(scene)
        found.append(at_points(scene))
    # The same mesh but for the pane, and other meridians: a twentieth of the accuracy.
    np.testing.assert_allclose(found[1], found[0], rtol=0.01)


def test_glass_that_keeps_nothing_back_under_a_sky():
    """Another quadrature: as far apart as both are from the truth at most."""
    sky = CIESky(1, diffuse_illuminance_lx=10_000.0)
    plain, clear = (
        simulate(with_points(room(glass, sky=sky, ground=0.2)), accuracy=0.05).sensors["points"]
        for glass in (None, NOTHING)
    )
    both = plain.error_lx + clear.error_lx
    assert (np.abs(clear.illuminance_lx - plain.illuminance_lx) <= both).all()


def beam(glass: Glass | None, angle_deg: float, count=1) -> float:
    """Illuminance by a small far globe through panes tilted by an angle."""
    scene = Scene()
    scene.add(PatchSet.sphere((0, 0, 50.0), 0.01), "globe")
    scene.assign("globe", Emitter(flux_lm=1e6))
    a = np.radians(angle_deg)
    c, s = 0.5 * np.cos(a), 0.5 * np.sin(a)
    for k in range(count if glass is not None else 0):
        z = 1.0 + k
        net = quad((-c, -0.5, z - s), (c, -0.5, z + s), (c, 0.5, z + s), (-c, 0.5, z - s))
        scene.add(net, f"pane{k}")
        scene.assign(f"pane{k}", glass)
    return float(at_points(with_points(scene, [(0, 0, 0)], [UP]))[0])


@pytest.mark.parametrize("angle", [0.0, 45.0, 80.0])
def test_a_pane_before_a_small_far_lamp(angle):
    # The same mesh of the globe, whose form factor is found to 2e-4.
    plain = beam(NOTHING, angle)
    assert plain == pytest.approx(beam(None, 0.0), rel=1e-3)
    tau = float(LAW.transmittance(np.cos(np.radians(angle))))
    # What panes throw back goes up and away; the globe is black.
    assert beam(PANE, angle) == pytest.approx(tau * plain, rel=1e-6)
    if angle == 45.0:
        # What is reflected between the two panes comes down too: glass of index 1 has none.
        dark = Glass(0.006, n=1.0, absorption_per_m=50.0)
        tau = np.exp(-0.3 / np.cos(np.radians(angle)))
        assert beam(dark, angle, 2) == pytest.approx(tau**2 * beam(NOTHING, angle, 2), rel=1e-6)


def test_sun_through_a_window():
    sun = Sun(30.0, 180.0, normal_illuminance_lx=50_000.0)
    found = []
    for glass in (None, PANE):
        scene = with_points(room(glass), [(0.0, 2.5, 0.0), (1.5, 3.5, 0.0)], [UP, UP])
        scene.sun = sun
        found.append(simulate(scene, accuracy=0.2).sensors["points"].illuminance_lx)
    assert found[0][0] == pytest.approx(25_000.0, rel=1e-4)
    tau = float(LAW.transmittance(np.cos(np.radians(30.0))))
    # The disc is half a degree wide: the mean over it is not that at its middle.
    assert found[1][0] == pytest.approx(tau * found[0][0], rel=2e-5)
    assert found[0][1] == found[1][1] == 0.0


@pytest.mark.slow
def test_light_adds_up():
    """Twice the sky is twice its light, and that of the lamp stays."""
    found = []
    for sky_lx in (1000.0, 2000.0):
        scene = with_points(room(PANE, rho=0.4, sky=CIESky(16, diffuse_illuminance_lx=sky_lx)))
        outdoors(scene)
        found.append(simulate(scene, accuracy=0.5).sensors["points"].components)
    for name in found[0]:
        times = 2.0 if name.startswith("sky") else 1.0
        # All light together decides at which elements that are hidden in part is looked: to a
        # hundredth of the accuracy.
        np.testing.assert_allclose(found[1][name], times * found[0][name], rtol=5e-3)


@pytest.mark.parametrize("diffuse", [0.0, 0.4, 1.0])
def test_the_ledger_closes(diffuse):
    sky = CIESky(16, diffuse_illuminance_lx=10_000.0)
    glass = Glass(0.006, diffuse=diffuse)
    result = simulate(with_points(room(glass, rho=0.6, sky=sky, ground=0.2)), accuracy=0.3)
    balance = result.balance
    assert abs(balance.residual_fraction) < 1e-4
    (name,) = (n for n in balance.absorbed_by_material if "glass" in n)
    window = result.surfaces["pane*"]
    flux = float((window.area_m2 * window.illuminance_lx).sum())
    lost = 1.0 - LAW.diffuse_transmittance - LAW.diffuse_reflectance
    # The light of the sky is not even; of what passes the share by angle counts.
    assert balance.absorbed_by_material[name] == pytest.approx(lost * flux, rel=0.35)


def test_a_furnace_with_a_pane_across_it():
    """A closed box that absorbs in the pane only: all that the lamp gives ends there.

    Of white walls all that rows have wrong comes back tenfold: to the 3 % that what passes is known
    to with four nodes an element, and what the ledger lacks.
    """
    scene = Scene()
    scene.add(PatchSet.box((2, 2, 2), inward=True), "box")
    scene.assign("box", Material(1.0))
    scene.add(level(1.0, 0.0), "pane")
    scene.assign("pane", Glass(0.05, n=1.0, absorption_per_m=4.0))
    scene.add(PatchSet.disk((0, 0, 0.4), 0.3, (0, 0, -1)), "lamp", two_sided=True)
    scene.assign("lamp", Emitter(flux_lm=1000.0))
    scene.assign("lamp", Material(1.0))
    balance = simulate(scene, accuracy=0.03).balance
    assert balance.emitted_lm == pytest.approx(1000.0)
    assert balance.absorbed_by_material["glass 50 mm"] == pytest.approx(1000.0, rel=0.03)


def test_a_diffusing_sphere_about_a_lamp():
    """Inside E = Φ / (A (1 − ρ)), as a sphere sees itself with factor 1; outside B = t E."""
    glass = Glass(0.003, diffuse=1.0)
    law = GlassLaw.of(Glazing(glass, 0.003))
    scene = Scene()
    scene.add(PatchSet.sphere((0, 0, 0), 1.0), "shade")
    scene.assign("shade", glass)
    scene.add(PatchSet.sphere((0, 0, 0), 0.01), "lamp")
    scene.assign("lamp", Emitter(flux_lm=1000.0))
    result = simulate(scene, accuracy=0.1)
    shade = result.surfaces["shade"]
    outside = result.elements.side[shade.element_index] == 0
    inside = 1000.0 / (4.0 * np.pi * (1.0 - law.diffuse_reflectance))
    # The lamp, a ten-thousandth of the surface, takes as much of what falls on it.
    mean = np.average(shade.exitance_lm_m2[outside], weights=shade.area_m2[outside])
    assert mean == pytest.approx(law.diffuse_transmittance * inside, rel=1e-3)
    assert result.balance.escaped_lm == pytest.approx(
        4.0 * np.pi * law.diffuse_transmittance * inside, rel=1e-3
    )
    assert abs(result.balance.residual_fraction) < 1e-3


def test_a_diffusing_plate(make_model):
    """What falls on one face of a solid leaves by the other, and no flux is lost on the way."""
    scene = Scene(make_model("m", {"plate": ((1.0, 1.0, 0.01), (0, 0, 0), False)}))
    glass = Glass(absorption_per_m=0.0, diffuse=1.0)
    scene.assign("plate", glass)
    scene.add(PatchSet.sphere((0.2, 0.1, 2.0), 0.05), "lamp")
    scene.assign("lamp", Emitter(flux_lm=1000.0))
    result = simulate(scene, accuracy=0.1)
    plate = result.surfaces["plate"]
    faces = result.elements.normals[plate.element_index, 0, 2]
    lit, other = (plate.area_m2 * (sign * faces > 0.5) for sign in (1.0, -1.0))
    tau = GlassLaw.of(Glazing(glass)).diffuse_transmittance
    assert plate.exitance_lm_m2 @ other == pytest.approx(tau * (plate.illuminance_lx @ lit))
    assert not plate.illuminance_lx[other > 0.0].any()
    # Nothing is absorbed but by the black lamp, which sees little of the plate.
    glass_name = "diffusing glass"
    edges = plate.area_m2 @ (plate.illuminance_lx * (np.abs(faces) < 0.5))
    assert result.balance.absorbed_by_material[glass_name] <= edges + 1e-6


def test_a_solid_pane_is_a_slab(make_model):
    """A box is crossed once, at its own thickness; the same as a sheet of that thickness."""
    found = []
    for solid in (True, False):
        scene = Scene()
        if solid:
            scene.add(make_model("m", {"pane": ((1.0, 1.0, 0.006), (0, 0, 1.0), False)}))
            scene.assign("pane", Glass())
        else:
            scene.add(level(0.5, 1.0), "pane")
            scene.assign("pane", PANE)
        scene.add(PatchSet.sphere((1.0, 0, 5.0), 0.05), "globe")
        scene.assign("globe", Emitter(flux_lm=1e5))
        scene.sky, scene.ground = CIESky(5, diffuse_illuminance_lx=100.0), Ground(0.0)
        data = with_points(scene, [(0, 0, 0.9)], [UP])
        if solid:
            (glazing,) = data.freeze().glazings
            assert glazing.solid and glazing.thickness_m == pytest.approx(0.006, rel=1e-12)
        found.append(simulate(data, accuracy=0.1).sensors["points"].components)
    assert found[0]["globe.direct"] == pytest.approx(found[1]["globe.direct"], rel=1e-6)
    # Edges of 6 mm are seen beside the pane.
    assert found[0]["sky.direct"] == pytest.approx(found[1]["sky.direct"], rel=3e-3)


def test_cameras_see_through_glass():
    sky = CIESky(5, diffuse_illuminance_lx=10_000.0)
    images = []
    for glass in (None, PANE):
        scene = room(glass, sky=sky)
        scene.add(Camera((0, 3.0, 1.5), (0, 0, 1.6), name="c", fov_deg=1.0, size=(3, 3)))
        images.append(simulate(scene, accuracy=0.3).images["c"])
    plain, clear = (image.luminance_cd_m2[1, 1] for image in images)
    # Nothing in the room reflects, so that only the sky itself lights the outer face.
    assert clear == pytest.approx(float(LAW.transmittance(1.0)) * plain, rel=1e-3)
    assert images[1].part_index[1, 1] == -1


def test_scenes_without_glass_pay_nothing():
    result = simulate(with_points(room(None, sky=CIESky(16))), accuracy=0.3)
    assert result.skipped["glass"] == "nothing is seen through"
    assert "light through panes" not in result.stages
    assert "pairs_through_panes" not in result.counters


def test_the_last_assignment_wins(make_model):
    model = make_model("m", {"pane": ((1.0, 1.0, 0.01), (0, 0, 0), False)})
    scene = Scene(model)
    scene.assign("pane", Glass())
    assert scene.freeze().see_through.all()
    assert not any("named like glass" in note for note in scene.freeze().notes)
    scene.assign("pane", Material(0.3))
    assert not scene.freeze().see_through.any()
    assert any("named like glass, but opaque" in note for note in scene.freeze().notes)


def test_panes_come_last(make_model):
    boxes = {
        "pane": ((1.0, 1.0, 0.01), (0, 0, 0), False),
        "desk": ((1.0, 1.0, 0.5), (0, 0, -3.0), False),
    }
    scene = Scene(make_model("m", boxes))
    scene.assign("pane", Glass(n=1.5))
    data = scene.freeze()
    assert data.opaque_count == 6 and len(data.without_panes.patches) == 6
    assert data.parts[data.patches.part_index[-1]].path == "m/pane"
    assert data.faces[data.patches.face_index[-1]].part == 0


@pytest.mark.parametrize(
    ("assign", "message"),
    [
        (lambda s: s.assign("sheet", Glass()), "m2: a sheet has no thickness|give thickness_m"),
        (lambda s: s.assign("pane", Glass(), faces="#1"), "in part only"),
        (
            lambda s: (s.assign("sheet", PANE), s.assign("sheet", Emitter(flux_lm=1.0))),
            "both an emitter and glass",
        ),
    ],
)
def test_glass_that_cannot_be_assigned(make_model, monkeypatch, assign, message):
    monkeypatch.setattr(
        "patchlight.importers.select_faces", lambda model, part, selector: [0], raising=False
    )
    scene = Scene(make_model("m", {"pane": ((1.0, 1.0, 0.01), (0, 0, 0), False)}))
    scene.add(quad((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)), "sheet", two_sided=True)
    assign(scene)
    with pytest.raises(InputError, match=message):
        scene.freeze()


def test_glass_in_a_scene_file(folder):
    text = HEAD + '[[assign]]\nparts = "desk"\nglass = { thickness_m = 0.006, n = 1.5 }\n'
    (glazing,) = load_scene(write(folder, text)).freeze().glazings
    assert (glazing.thickness_m, glazing.glass.n, glazing.solid) == (0.006, 1.5, True)
    table = text.replace("thickness_m = 0.006", "transmittance = [[0, 0.7], [60, 0.5]]")
    (glazing,) = load_scene(write(folder, table)).freeze().glazings
    assert glazing.glass.transmittance == ((0.0, 0.7), (60.0, 0.5), (90.0, 0.0))
    for wrong, message in (("n = 0.5", "between 1 and 10"), ("color = 3", "unknown key")):
        with pytest.raises(InputError, match=message):
            load_scene(write(folder, text.replace("n = 1.5", wrong)))
    both = text.replace("glass =", "material = { reflectance = 0.5 }\nglass =")
    with pytest.raises(InputError, match="material or glass"):
        load_scene(write(folder, both))


@pytest.mark.slow
def test_under_a_dome_of_glass():
    """In the middle of a sphere all light comes at normal incidence; the bright disc, too."""
    found = []
    for glass in (None, PANE):
        scene = Scene()
        scene.add(level(0.2, -0.5), "a")
        scene.assign("a", Material(0.0))
        if glass is not None:
            scene.add(PatchSet.sphere((0, 0, 0), 1.0), "bulb")
            scene.assign("bulb", glass)
        scene.sky, scene.ground = CIESky(5, diffuse_illuminance_lx=10_000.0), Ground(0.2)
        scene.sun = Sun(50.0, 120.0, normal_illuminance_lx=10_000.0)
        grid = with_points(scene, [(0, 0, 0), (0, 0, 0)], [UP, (0, 1, 0)])
        found.append(simulate(grid, accuracy=0.3).sensors["points"].components)
    tau = float(LAW.transmittance(1.0))
    # Cells along the horizon are cut by chords; the plate's edges are sampled.
    for name, share in (("sky", 1e-4), ("sun", 1e-6), ("ground", 5e-3)):
        key = f"{name}.direct"
        np.testing.assert_allclose(found[1][key], tau * found[0][key], rtol=share, atol=1e-9)
