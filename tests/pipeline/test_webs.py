"""Photometric files in scenes: from the emitter to world axes, and what is wrong with them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from patchlight.pipeline import Emitter, PatchSet, Photometry, Scene, load_scene
from patchlight.pipeline.scene_file import photometry_files, read_scene_file, resolved_config
from patchlight.solver.errors import InputError, MissingFileError

from .scene_files import write

DOWN = np.arange(0.0, 91.0, 5.0)
HEAD = 'schema_version = 1\n[[model]]\nfile = "room.step"\nname = "room"\n'
LAMP = '[[assign]]\nparts = "lamp:1"\nemitter = { photometry = "webs/own.ldt"%s }\n'


def web(up=0.0, source=""):
    """An even web downwards, with the share ``up`` of its flux upwards."""
    gamma = np.array([0.0, 89.999, 90.001, 180.0])
    row = 100.0 * np.array([1.0 - up, 1.0 - up, up, up])
    return Photometry([0.0, 360.0], gamma, [row, row], power_w=20.0, source=source)


def ldt(flux=2000.0, output=100.0):
    """A EULUMDAT file, rotationally symmetric, Lambertian downwards."""
    per_klm = np.cos(np.radians(DOWN)) * 1000.0 / np.pi * output / 100.0
    numbers = [600, 300, 20, 600, 300, 0, 0, 0, 0, 100, output, 1, 0, 1, -1]
    lines = ["nobody", 1, 1, 1, 0, len(DOWN), 5, "1", "own lamp", "", "own.ldt", "today"]
    lines += [*numbers, "LED", flux, "4000", "80", 21.0, *[0.5] * 10, 0.0, *DOWN, *per_klm]
    return "\n".join(str(x) for x in lines) + "\n"


@pytest.fixture
def folder(folder):
    """The same with a photometric file."""
    (folder / "webs").mkdir()
    (folder / "webs" / "own.ldt").write_text(ldt())
    return folder


def panel_scene(emitter, *, at=(0.0, 0.0, 0.0), **options):
    """A sheet of 1 m² that looks down."""
    scene = Scene(**options)
    corners = [[[0, 0, 2], [0, 1, 2], [1, 1, 2], [1, 0, 2]]]
    scene.add(PatchSet.from_bilinear(np.array(corners, dtype=float)), "lamp", at=at)
    scene.assign("lamp", emitter)
    return scene


def test_flux_power_and_axes_by_default():
    data = panel_scene(Emitter(photometry=web(), group="g", dim=0.5)).freeze()
    (lamp,) = data.luminaires
    assert lamp.flux_lm == pytest.approx(0.5 * web().flux_lm) and lamp.power_w == 20.0
    assert lamp.web.axes.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
    other = panel_scene(
        Emitter(flux_lm=300.0, photometry=web(), power_w=7.0), maintenance_factor=0.8
    )
    (lamp,) = other.freeze().luminaires
    assert (lamp.flux_lm, lamp.power_w) == (240.0, 7.0)


def test_the_web_turns_with_its_part_and_with_north():
    turn = np.eye(4)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # +x to +y
    (lamp,) = panel_scene(Emitter(photometry=web()), at=turn).freeze().luminaires
    np.testing.assert_allclose(lamp.web.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-15)
    # North along +x of the scene: turning everything by 90° brings +x to +y.
    (lamp,) = panel_scene(Emitter(photometry=web()), north_deg=90.0).freeze().luminaires
    np.testing.assert_allclose(lamp.web.axes[0], [0, 1, 0], atol=1e-15)


def test_aim_and_c0_are_of_the_scene():
    given = Emitter(photometry=web(), aim=(0.3, 0, -3), c0=(0, 2, 0))
    (lamp,) = panel_scene(given).freeze().luminaires
    nadir = np.array([0.3, 0, -3]) / np.hypot(0.3, 3)
    np.testing.assert_allclose(lamp.web.axes[2], nadir, rtol=1e-14)
    np.testing.assert_allclose(lamp.web.axes[0], [0, 1, 0], atol=1e-15)
    scene = Scene()
    scene.add(PatchSet.box((1, 1, 1)), "lamp")
    scene.assign("lamp", Emitter(photometry=web(0.5), aim=(1, 0, 0)))
    (lamp,) = scene.freeze().luminaires
    # Aimed along its own x, C0 is where x goes when z comes to −x: +z.
    np.testing.assert_allclose(lamp.web.axes[0], [0, 0, 1], atol=1e-15)


def test_light_that_no_face_can_give():
    with pytest.raises(InputError, match=r"emitter of lamp: 30 % of the light of a.ies goes where"):
        panel_scene(Emitter(photometry=web(0.3, "x/a.ies"))).freeze()
    data = panel_scene(Emitter(photometry=web(0.05, "x/a.ies"))).freeze()
    assert any("5 % of its light goes where the emitting faces" in note for note in data.warnings)
    assert data.luminaires[0].flux_lm == pytest.approx(web(0.05).flux_lm)
    with pytest.raises(InputError, match="100 % of the light of its photometric web"):
        panel_scene(Emitter(photometry=web(), aim=(0, 0, 1))).freeze()


def test_remarks_of_the_file_are_told_once():
    said = dataclasses.replace(web(), remarks=("odd",), source="a.ies")
    scene = panel_scene(Emitter(photometry=said))
    assert "photometry a.ies: odd (lamp)" in scene.freeze().warnings


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "exactly one of flux_lm, luminance_cd_m2 and photometry"),
        ({"photometry": web(), "luminance_cd_m2": 5.0}, "not used together with photometry"),
        ({"photometry": 5}, "Emitter.photometry = 5"),
        ({"flux_lm": 5.0, "aim": (0, 0, 1)}, "Emitter.aim is used together with photometry only"),
        ({"photometry": web(), "aim": (0, 0, 0)}, "Emitter.aim = .0, 0, 0."),
        ({"photometry": web(), "c0": (0, float("nan"), 1)}, "Emitter.c0.*finite"),
    ],
)
def test_emitters_that_cannot_be(given, said):
    with pytest.raises(InputError, match=said):
        Emitter(**given)


def test_aim_along_c0_and_missing_files_name_the_part(tmp_path):
    with pytest.raises(InputError, match="emitter of lamp: c0 = .*parallel to aim"):
        panel_scene(Emitter(photometry=web(), c0=(0, 0, 1))).freeze()
    with pytest.raises(MissingFileError, match="none.ies: no such file"):
        panel_scene(Emitter(photometry=tmp_path / "none.ies"))


def test_files_are_read_when_assigned_and_equal_ones_once(tmp_path):
    path = tmp_path / "own.ldt"
    path.write_text(ldt()[:-40])
    scene = panel_scene(Emitter(flux_lm=1.0))
    with pytest.raises(InputError, match=r"own\.ldt, line \d+: the file ends"):
        scene.assign("lamp", Emitter(photometry=path))
    assert len(scene.assignments) == 1  # nothing of it stays
    path.write_text(ldt())
    for given in (path, str(path)):
        scene.assign("lamp", Emitter(photometry=given))
    first, second = (a.what.photometry for a in scene.assignments[1:])
    assert first is second
    path.write_text(ldt(flux=1000.0))  # mended after the lamp was made: the next one has it
    scene.assign("lamp", Emitter(photometry=path))
    (lamp,) = scene.freeze().luminaires
    assert lamp.flux_lm == pytest.approx(1000.0, rel=1e-3)
    assert scene.assignments[-1].what.photometry is not first


def test_scene_file(folder):
    path = write(folder, HEAD + LAMP % ", aim = [0, 0.1, -1], c0 = [0, 1, 0], group = 'desk'")
    (one,) = load_scene(path).freeze().luminaires
    # Chords of the cosine over 5 degrees: 6e-4 below it.
    assert one.flux_lm == pytest.approx(2000.0, rel=1e-3)
    assert (one.group, one.power_w) == ("desk", 21.0)
    assert one.web.photometry.name == "own lamp"
    np.testing.assert_allclose(one.web.axes[2], np.array([0, 0.1, -1]) / np.hypot(0.1, 1))
    file = read_scene_file(path)
    assert photometry_files(file, folder) == [folder / "webs" / "own.ldt"]
    again = write(folder / "webs", resolved_config(file, folder))
    assert load_scene(again).freeze().luminaires[0].flux_lm == one.flux_lm
    assert again.read_text().count("# sha256") == 2


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (LAMP % ", aim = [0, 0, 0]", r"assign\[0\].emitter: Emitter.aim = "),
        (LAMP % ", luminance_cd_m2 = 1.0", r"assign\[0\].emitter: Emitter: luminance_cd_m2"),
        (LAMP % ", c1 = [1, 0, 0]", r"assign\[0\].emitter.c1: unknown key; .*, aim, c0"),
        (LAMP.replace("own", "no") % "", r"assign\[0\].emitter.photometry: .*no.ldt: no such"),
    ],
)
def test_scene_file_problems_have_their_key(folder, line, said):
    with pytest.raises(InputError, match=said):
        load_scene(write(folder, HEAD + line))


def test_bad_photometric_file_has_its_key(folder):
    (folder / "webs" / "own.ldt").write_text(ldt(output=40.0).replace("\n40.0\n", "\n90.0\n", 1))
    with pytest.raises(InputError, match=r"assign\[0\].emitter.photometry: .*own.ldt: the inten"):
        load_scene(write(folder, HEAD + LAMP % ""))


def test_record_of_a_batch_knows_the_file(folder):
    from patchlight.pipeline.batch_items import identity

    path = write(folder, HEAD + LAMP % "")
    before = identity(path)
    (folder / "webs" / "own.ldt").write_text(ldt(flux=2500.0))
    assert identity(path) != before and len(before["photometry"]) == 1
