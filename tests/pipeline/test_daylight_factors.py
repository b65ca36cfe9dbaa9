"""Daylight factors and their shares: closed forms in the open, and beside any other light."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from patchlight.pipeline import (
    CIESky,
    DaylightFactors,
    Emitter,
    Ground,
    Material,
    PatchSet,
    PerezSky,
    Scene,
    SensorGrid,
    Sun,
    forget,
    load_scene,
    simulate,
)
from patchlight.solver.daylight import with_daylight_factors
from patchlight.solver.errors import InputError
from patchlight.solver.model.reached import accuracy_message

from .scene_files import write
from .window_room import level, quad, window_room

UP, SOUTH = (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)
POINTS = np.array([(0.0, y, 0.85) for y in (0.5, 1.5, 2.5, 3.5)])
SUNNY = CIESky(12, sun_altitude_deg=40, sun_azimuth_deg=170, diffuse_illuminance_lx=9000.0)
#: Error of the sum of shares that are the same numbers added in another order.
ROUNDING = 1e-12


def room(rho=0.5, **changes):
    scene = window_room(4.0, 3.0, rho)
    scene.add(SensorGrid(POINTS, np.tile(UP, (4, 1)), name="plane"))
    scene.ground = Ground(0.2)
    for name, value in changes.items():
        setattr(scene, name, value)
    return scene


def of(result, name="plane"):
    shares = result.sensors[name].daylight
    assert shares is not None
    return shares


def test_in_the_open():
    """All of the sky; on a wall 3/14 + 4/(7π) of it and ρ/2 of the ground (type 16)."""
    scene = Scene()
    scene.add(level(0.1, -5.0), "plate")
    scene.add(SensorGrid(np.zeros((1, 3)), [UP], name="level"))
    scene.add(SensorGrid(np.zeros((1, 3)), [SOUTH], name="wall"))
    scene.sky, scene.sun = SUNNY, Sun(40, 170, 80_000.0)
    scene.ground, scene.daylight_factor = Ground(0.3), True
    result = simulate(scene, accuracy=0.01)
    flat, wall = of(result, "level"), of(result, "wall")
    # Less what little the plate hides and sends back, 1e-4 of a hemisphere below.
    assert flat.sky == pytest.approx(1.0, rel=1e-6) and flat.external[0] == 0.0
    assert flat.sky_type == 16
    vertical = 3 / 14 + 4 / (7 * math.pi)
    assert wall.sky == pytest.approx(vertical, rel=1e-6)
    assert wall.external == pytest.approx(0.15, rel=1e-3)
    metrics = result.sensors["wall"].metrics
    assert metrics["VSC_avg_percent"] == pytest.approx(100 * vertical, rel=1e-6)
    assert "VSC_avg_percent" not in result.sensors["level"].metrics
    errors = result.sensors["level"].metric_errors
    assert errors["ERC_avg_percent"] == 0.0 < errors["SC_avg_percent"]
    # Type 1 is another sky: 0.3792 of it on a wall, by quadrature.
    scene.daylight_factor = DaylightFactors(sky_type=1)
    other = of(simulate(scene, accuracy=0.01), "wall")
    assert other.sky_type == 1 and other.sky == pytest.approx(0.3792, abs=5e-5)


def test_beside_any_other_light():
    """The same as under that sky alone, and none of it counted as illuminance."""
    alone = room(sky=CIESky(16))
    lit = room(sky=SUNNY, sun=Sun(40, 170, 80_000.0))
    for scene in (alone, lit):
        scene.add(quad((-0.5, 2, 2.9), (-0.5, 3, 2.9), (0.5, 3, 2.9), (0.5, 2, 2.9)), "lamp")
        scene.assign("lamp", Material(0.5))
    lit.assign("lamp", Emitter(3000.0))
    plain = simulate(lit, accuracy=0.02)
    assert plain.sensors["plane"].daylight is None
    lit.daylight_factor = True
    beside = simulate(lit, accuracy=0.02)
    expected, found = of(simulate(alone, accuracy=0.02)), of(beside)
    slack = expected.error + found.error
    assert (np.abs(found.total - expected.total) <= slack).all()
    assert (found.error <= 0.03 * found.total).all()
    # Straight from the sky nothing else counts: exact past flat surfaces.
    np.testing.assert_allclose(found.sky, expected.sky, rtol=1e-4)
    np.testing.assert_allclose(
        beside.sensors["plane"].illuminance_lx, plain.sensors["plane"].illuminance_lx, rtol=1e-9
    )
    assert set(beside.sensors["plane"].components) == set(plain.sensors["plane"].components)
    assert beside.counters["daylight_factor_pairs_reused"] > 0
    assert beside.stages["daylight factor"] > 0.0


def test_an_accuracy_that_was_missed_is_told_in_daylight_factors():
    """Lux of a sky that nobody asked for would mean nothing."""
    scene = room(sky=SUNNY)
    plain = simulate(scene, accuracy=0.1)
    scene.daylight_factor = True

    def run(data, _):
        found = simulate(data, accuracy=0.1)
        missed = accuracy_message(found.sensors, 1e-9)
        return replace(found, settings={**found.settings, "accuracy": 1e-9}, warnings=(missed,))

    beside = with_daylight_factors(replace(plain, scene=scene.freeze()), run)
    (text,) = [t for t in beside.warnings if t.startswith("daylight factor: accuracy 1e-09 was")]
    assert " lx" not in text and " % at (" in text


@pytest.mark.parametrize("cache", [True, False])
def test_form_factors_serve_twice(cache):
    scene = room(sky=SUNNY, daylight_factor=True)
    result = simulate(scene, accuracy=0.05, cache=cache)
    assert result.counters["daylight_factor_pairs_reused"] > 0


def test_after_a_move_as_much_is_taken_again_as_without_them():
    """They are found last, under another sky: what they leave is not what the next run goes by."""
    taken = []
    for asked in (False, True):
        forget()
        for x in (0.6, 0.5):
            scene = room(sky=SUNNY, daylight_factor=asked)
            # Curved: what rows see of the sky is told with them.
            scene.add(PatchSet.cylinder((x, 2.2, 0.1), (x, 2.2, 0.5), 0.25), "seat")
            result = simulate(scene, accuracy=0.3)
        taken.append([result.counters[name] for name in ("rows_reused", "pairs_renewed")])
    assert taken[0] == taken[1]
    assert taken[0][0] > 0 and taken[0][1] > 0


def test_the_scene_lit_by_that_sky_needs_no_second_run():
    asked = simulate(room(sky=CIESky(16), daylight_factor=True), accuracy=0.05)
    assert "daylight factor" in asked.skipped and "daylight factor" not in asked.stages
    plain = simulate(room(sky=CIESky(16)), accuracy=0.05)
    np.testing.assert_array_equal(of(asked).total, of(plain).total)
    # Of the other overcast sky it is needed.
    other = room(sky=CIESky(16), daylight_factor=DaylightFactors(sky_type=1))
    found = simulate(other, accuracy=0.05)
    assert of(found).sky_type == 1 and "daylight factor" in found.stages


def facing(rho, outside=()):
    """The room with a wall across the street, which is black on the other side."""
    scene = room(rho, sky=CIESky(16))
    wall = quad((-9, -6, 0), (9, -6, 0), (9, -6, 5), (-9, -6, 5)).flipped()
    scene.add(wall, "opposite")
    scene.assign("opposite", Material(0.6))
    scene.daylight_factor = DaylightFactors(outside=outside)
    return scene


def test_what_stands_outside_is_external():
    """In a black room no light is reflected but that of the wall opposite, all of it external."""
    inside = of(simulate(facing(0.0), accuracy=0.01))
    outside = of(simulate(facing(0.0, ("opposite",)), accuracy=0.01))
    np.testing.assert_allclose(outside.total, inside.total, rtol=ROUNDING)
    np.testing.assert_array_equal(outside.sky, inside.sky)
    assert (inside.internal > 1e-3 * inside.total).all()
    # The light decides at which elements that are hidden in part is looked.
    least = 1e-5 * inside.total.max()
    np.testing.assert_allclose(outside.internal, 0.0, atol=least)
    np.testing.assert_allclose(outside.external - inside.external, inside.internal, atol=least)
    # Of a grey house the last reflection decides: its facade lights the wall opposite, which adds
    # ρ² of a form factor of 0.1 and less; what its own walls reflect stays internal.
    grey = of(simulate(facing(0.5, ("opposite",)), accuracy=0.02))
    assert (grey.internal > 0.0).all()
    assert (grey.external >= 0.999 * outside.external).all()
    assert (grey.external <= 1.1 * outside.external).all()


def test_levels_do_not_matter():
    """A share of the sky is one: a brighter sky of the same type, or another one's irradiance."""
    dim = simulate(room(sky=CIESky(16, diffuse_illuminance_lx=10.0)), accuracy=0.05)
    perez = PerezSky(
        direct_normal_w_m2=300,
        diffuse_horizontal_w_m2=200,
        sun_altitude_deg=30,
        sun_azimuth_deg=180,
    )
    other = simulate(room(sky=perez, daylight_factor=True), accuracy=0.05)
    np.testing.assert_allclose(of(dim).sky, of(other).sky, rtol=1e-4)


def test_wrong_asks():
    scene = room()
    with pytest.raises(InputError, match=r"Scene\.daylight_factor = 16: expected"):
        scene.daylight_factor = 16
    with pytest.raises(InputError, match="sky_type = 5: must be 16 or 1"):
        DaylightFactors(sky_type=5)
    with pytest.raises(InputError, match="outside: 3: expected a part pattern"):
        DaylightFactors(outside=(3,))
    scene.daylight_factor = DaylightFactors(outside=("oposite",))
    with pytest.raises(InputError, match=r"daylight_factor\.outside 'oposite': no part matches"):
        scene.freeze()


HEAD = 'schema_version = 1\n{}\n[[model]]\nfile = "desk.step"\n{}'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    import cadquery as cq

    path = tmp_path_factory.mktemp("desk")
    shape = cq.Workplane("XY").box(1000, 1000, 100)
    cq.exporters.export(shape, str(path / "desk.step"))
    return path


def test_scene_files(folder):
    plain = HEAD.format("daylight_factor = true", "")
    assert load_scene(write(folder, plain)).daylight_factor == DaylightFactors()
    more = HEAD.format("", '[daylight_factor]\nsky_type = 1\noutside = ["desk"]\n')
    scene = load_scene(write(folder, more))
    assert scene.daylight_factor == DaylightFactors(1, ("desk",))
    assert scene.freeze().outdoor_parts == (0,)
    assert load_scene(write(folder, HEAD.format("", ""))).daylight_factor is None
    required = '[[sensors]]\nname = "p"\nz_m = 1\n[[requirements]]\nsensors = "p"\n'
    wanted = HEAD.format("daylight_factor = true", required + 'metric = "SC_avg_percent"\nmin = 1')
    assert load_scene(write(folder, wanted)).requirements[0].metric == "SC_avg_percent"
    for wrong in ('daylight_factor = "yes"', "daylight_factor = { sky_type = 5 }"):
        with pytest.raises(InputError, match="daylight_factor"):
            load_scene(write(folder, HEAD.format(wrong, "")))


def test_a_box_of_daylight_seen_from_patches_that_are_missing():
    """Without a sensor grid nothing is asked that could be told."""
    scene = Scene()
    scene.add(PatchSet.box((1, 1, 1), inward=True), "box")
    scene.daylight_factor = True
    result = simulate(scene, accuracy=0.5)
    assert result.skipped["daylight factor"] == "no sensor grids"
