"""Emitters as users write them: profiles, spectra, and how bright lamps of known flux are."""

from __future__ import annotations

import numpy as np
import pytest
from patchlight.pipeline import (
    Camera,
    Emitter,
    Material,
    PatchSet,
    Photometry,
    Scene,
    SensorGrid,
    load_scene,
    simulate,
)
from patchlight.reports.inputs import luminaire_rows
from patchlight.solver.errors import InputError

from .scene_files import write

HEAD = 'schema_version = 1\n[[model]]\nfile = "room.step"\nname = "room"\n'
LAMP = '[[assign]]\nparts = "lamp:1"\nemitter = { flux_lm = 100, %s }\n'
SHEET = PatchSet.from_bilinear(np.array([[[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]]], float))
UP = np.array([[0.0, 0.0, 1.0]])


def sheet_scene(emitter, points, **options):
    """A sheet of 1 m² at a height of 2 m that shines down, and sensors."""
    scene = Scene()
    scene.add(SHEET, "lamp", **{"at": (0, 0, 2), **options})
    scene.assign("lamp", emitter)
    points = np.asarray(points, float)
    scene.add(SensorGrid(points, np.repeat(UP, len(points), axis=0), name="grid"))
    return scene


def lux(scene, accuracy=0.01):
    return simulate(scene, accuracy=accuracy).sensors["grid"].illuminance_lx


GAMMA = np.arange(0.0, 181.0, 5.0)
COSINE = np.maximum(np.cos(np.radians(GAMMA)), 0.0) * 100.0 / np.pi
PANEL = PatchSet.from_bilinear(
    np.array([[[-5, -5, 0], [-5, 5, 0], [5, 5, 0], [5, -5, 0]]], float) * 1e-3
)


@pytest.mark.parametrize(
    ("thing", "photometry", "expected"),
    [
        (PANEL, None, 100 / np.pi),
        (PANEL, Photometry([0.0, 360.0], GAMMA, [COSINE, COSINE]), 100 / np.pi),
        (PatchSet.sphere((0, 0, 0), 0.005), None, 100 / (4 * np.pi)),
    ],
    ids=["panel", "web", "ball"],
)
def test_a_hundred_lumens(thing, photometry, expected):
    """A panel of 1 cm at 1 m, E = Φ / π d² to 1e-4; its photometric file; a ball, Φ / 4 π d²."""
    scene = Scene()
    scene.add(thing, "lamp", at=(0, 0, 1))
    scene.assign("lamp", Emitter(100, photometry=photometry))
    scene.add(SensorGrid(np.zeros((1, 3)), UP, name="grid"))
    # Steps of 5 degrees, between which the web is linear, leave less than 1e-3 of its flux.
    assert lux(scene)[0] == pytest.approx(expected, rel=1e-3)


def test_points_of_a_profile_are_those_of_the_part():
    """Bright at x = 1 of the part, wherever and however that is put; north is no matter either."""
    ramp = Emitter(100, profile=lambda p: p[:, 0])
    here = lux(sheet_scene(ramp, [(0.9, 0.5, 1.0), (0.1, 0.5, 1.0)]))
    assert here[0] > 1.4 * here[1]
    turned = np.array([[0, -1, 0, 5.0], [1, 0, 0, 6], [0, 0, 1, 2], [0, 0, 0, 1]])
    there = sheet_scene(ramp, [(4.5, 6.9, 1.0), (4.5, 6.1, 1.0)], at=turned)
    np.testing.assert_allclose(lux(there), here, rtol=1e-6)
    there.north_deg = 30.0
    np.testing.assert_allclose(lux(there), here, rtol=1e-6)


def test_profile_and_spectrum_in_a_scene_file(folder):
    what = "profile = [[0, 1, 0], [0, 2, 0]], spectrum = [[400, 1], [500, 1], [700, 1.5]]"
    data = load_scene(write(folder, HEAD + LAMP % what)).freeze()
    (lamp,) = data.luminaires
    assert lamp.flux_lm == 100 and lamp.profile.tables.shape[1:] == (2, 3)
    (row,) = luminaire_rows(data)
    assert row["profile"] == "by a table of 2 x 3" and float(row["cct"].replace(" ", "")) > 4000
    for what, text in (
        ("profile = [[0, 1, 0], [0, 2]]", "profile"),
        ("profile = [[0, -1], [0, 2]]", "must be a finite number >= 0"),
        ("spectrum = [[400, 1], [300, 1]]", "must ascend"),
        ("spectrum = [[400, 1], [500, 1]], cct_k = 3000", "not both"),
        ('profile = [[1, 0], [0, 2]], photometry = "a.ies"', "together with photometry"),
    ):
        with pytest.raises(InputError, match=text):
            load_scene(write(folder, HEAD + LAMP % what))


def test_emitters_say_what_is_wrong():
    with pytest.raises(TypeError):
        Emitter(100, 200)
    with pytest.raises(InputError, match="expected two or more pairs"):
        Emitter(100, spectrum=[(500, 1)])
    with pytest.raises(InputError, match=r"power -1 at 500 nm"):
        Emitter(100, spectrum=[(400, 1), (500, -1)])
    dark = sheet_scene(Emitter(100, spectrum=[(900, 1), (1000, 1)]), [(0, 0, 0)])
    with pytest.raises(InputError, match="emitter of lamp: spectrum from 900 to 1000 nm"):
        dark.freeze()


def test_spectra_have_the_colour_and_temperature_of_their_light():
    wavelength = np.arange(360.0, 831.0, 5.0)
    planck = wavelength**-5.0 / np.expm1(1.438776877e7 / (wavelength * 2700.0))
    (lamp,) = (
        sheet_scene(Emitter(100, spectrum=np.column_stack([wavelength, planck])), [(0, 0, 0)])
        .freeze()
        .luminaires
    )
    (same,) = sheet_scene(Emitter(100, cct_k=2700), [(0, 0, 0)]).freeze().luminaires
    assert lamp.cct_k == pytest.approx(2700, abs=2)  # Ohno's method is good to 1 K
    np.testing.assert_allclose(lamp.color, same.color, atol=2e-4)
    (red,) = (
        sheet_scene(Emitter(100, spectrum=[(620, 1), (640, 1)]), [(0, 0, 0)]).freeze().luminaires
    )
    assert np.isnan(red.cct_k) and red.color[0] > 4.0


def test_warm_light_in_a_grey_room_is_as_warm_everywhere():
    scene = sheet_scene(Emitter(1000, cct_k=2700, profile=[[0, 1], [2, 3]]), [(0.5, 0.5, 1.0)])
    scene.add(PatchSet.box((4, 4, 3), center=(0.5, 0.5, 1.5), inward=True), "room")
    # Not quite grey: otherwise one band does for all.
    scene.assign("room", Material((0.5, 0.5, 0.5 + 1e-9)))
    result = simulate(scene, accuracy=0.1)
    (lamp,) = result.scene.luminaires
    for light in result.components.values():
        lit = light[light.sum(axis=1) > 0]
        np.testing.assert_allclose(
            lit / lit[:, :1], np.tile(lamp.color / lamp.color[0], (len(lit), 1)), rtol=1e-6
        )


def test_pictures_show_the_profile():
    scene = sheet_scene(Emitter(100 * np.pi, profile=lambda p: 0.5 + p[:, 0]), [(0.5, 0.5, 1.0)])
    view = Camera((0.5, 0.5, 0.0), (0.5, 0.5, 2.0), name="up", up=(0, 1, 0), size=(40, 40))
    scene.add(view)
    image = simulate(scene, accuracy=0.1).images["up"]
    level = image.rgb[20, :, 0]
    lit = level[level > 0][1:-1]  # the outermost show the lamp's edge
    # 100 cd/m² on average, from 50 to 150, along the picture's rows.
    assert lit.mean() == pytest.approx(100.0, rel=0.02)
    steps = np.diff(lit)
    assert np.ptp(lit) > 80 and (np.sign(steps) == np.sign(steps[0])).mean() > 0.9
