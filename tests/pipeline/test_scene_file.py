"""scene.toml: what it can say, and that everything wrong with it is said at once."""

from __future__ import annotations

import json
import tomllib

import pytest
from patchlight.pipeline import CIESky, Ground, PerezSky, Site, load_scene
from patchlight.pipeline.cli import main
from patchlight.pipeline.scene_file import read_scene_file, resolved_config
from patchlight.solver.errors import InputError, MissingFileError

from .scene_files import write

HEAD = 'schema_version = 1\n[[model]]\nfile = "room.step"\nname = "room"\n'


FULL = """\
schema_version = 1
title = "Büro"
accuracy = 0.02
basis = "biquadratic"
balanced_mesh = true
maintenance_factor = 0.8
[site]
latitude_deg = 50.1
longitude_deg = 8.7
timezone = "Europe/Berlin"
north_deg = 90
[[model]]
file = "room.step"
name = "room"
at_m = [1, 0, 0]
[[assign]]
parts = "room/room"
faces = "vertical"
material = { reflectance = [0.6, 0.5, 0.4], name = "paint" }
[[assign]]
parts = "lamp*"
emitter = { flux_lm = 3200, cct_k = 4000, group = "ceiling", power_w = 28 }
[sky]
type = 12
diffuse_illuminance_lx = 12000
[sun]
altitude_deg = 40
azimuth_deg = 180
normal_illuminance_lx = 80000
[ground]
reflectance = 0.1
[[sensors]]
name = "workplane"
z_m = 0.8
spacing_m = 0.5
over = "room/room"
[[sensors]]
name = "wall"
parts = "room/room"
faces = "vertical"
spacing_m = 1.0
[[sensors]]
name = "points"
points_m = [[1.5, 0.5, 1], [2, 1, 1]]
normal = [0, 1, 0]
[[cameras]]
name = "door"
eye_m = [1.5, 0.5, 1.6]
target_m = [3, 2, 1.2]
[[requirements]]
sensors = "workplane"
metric = "E_avg_lx"
min = 500
"""


def test_the_method_of_1993_has_a_basis_of_its_own(folder):
    one = FULL.replace('basis = "biquadratic"', 'method = "nn93"')
    assert load_scene(write(folder, one)).method == "nn93"
    both = FULL.replace("accuracy = 0.02", 'accuracy = 0.02\nmethod = "nn93"')
    with pytest.raises(InputError, match='basis: not used together with method = "nn93"'):
        load_scene(write(folder, both))


def test_everything_a_scene_file_can_say(folder):
    scene = load_scene(write(folder, FULL))
    data = scene.freeze()
    assert (data.title, scene.accuracy, data.maintenance_factor) == ("Büro", 0.02, 0.8)
    assert (scene.method, scene.basis) == ("default", "biquadratic") and scene.balanced_mesh
    assert data.site == Site(50.1, 8.7, timezone="Europe/Berlin")
    # The sky takes the position of the sun.
    assert data.sky == CIESky(
        12, sun_altitude_deg=40, sun_azimuth_deg=180, diffuse_illuminance_lx=12000
    )
    assert data.ground == Ground(0.1)
    assert data.groups == ("ceiling", "sky", "sun", "ground")
    assert [lamp.flux_lm for lamp in data.luminaires] == pytest.approx([2560, 2560])
    assert [len(s) for s in data.sensors] == [48, 2 * 3 * (4 + 3), 2]
    # at_m, then north along +x: the room's corner (1, 0) comes to (0, 1).
    low, _ = data.patches.bounds()
    assert low == pytest.approx([-3.0, 1.0, 0.0])
    assert scene.requirements[0].min == 500


def test_shares_of_reflection(folder):
    line = "reflectance = 0.2, specular = [0.1, 0.2, 0.3], exponent = 80, mirror = 0.4"
    text = HEAD + f"[[assign]]\nparts = 'desk'\nmaterial = {{ {line} }}\n"
    (material,) = [m for m in load_scene(write(folder, text)).freeze().materials if m.is_mirror]
    assert (material.reflectance, material.mirror, material.exponent) == (0.2, 0.4, 80.0)
    assert material.specular == (0.1, 0.2, 0.3)
    assert "specular 0.1 0.2 0.3 n 80" in material.name and "mirror 0.4" in material.name
    with pytest.raises(InputError, match=r"assign\[0\]\.material: .*= 1\.1: must not exceed 1"):
        load_scene(write(folder, text.replace("reflectance = 0.2", "reflectance = 0.4")))


def test_resolved_config_runs_again(folder):
    path = write(folder, FULL)
    text = resolved_config(read_scene_file(path), folder)
    values = tomllib.loads(text)
    assert values["model"][0]["file"] == str(folder / "room.step")
    assert values["sensors"][0]["quantity"] == "planar"
    assert "sha256" in text
    again = write(folder / "..", text)
    assert resolved_config(read_scene_file(again), folder) == text


WRONG = """\
schema_version = 1
acuracy = 0.01
[[model]]
file = "nofile.step"
scale = -1
[[assign]]
parts = "wall*"
material = { reflectance = nan, speculr = 0.1 }
[[assign]]
parts = "wall*"
material = { reflectance = [0.1, 0.2, 3] }
[[assign]]
parts = "lamp"
emitter = { flux_lm = 1, luminance_cd_m2 = 3 }
[[assign]]
parts = "lamp"
[sky]
type = 17
[sun]
altitude_deg = 100
azimuth_deg = "south"
normal_illuminance_lx = 1
[[sensors]]
name = "a"
[[sensors]]
name = "a"
z_m = 1
points_m = [[0, 0, 0]]
[[cameras]]
name = "c"
eye_m = [0, 0]
target_m = [1, 1, 1]
[[requirements]]
sensors = "workplane"
metric = "E_avg"
min = 3
"""


def test_all_problems_at_once_with_their_keys(tmp_path):
    with pytest.raises(InputError) as error:
        load_scene(write(tmp_path, WRONG))
    lines = str(error.value).splitlines()
    keys = {line.strip().split(": ")[0] for line in lines[1:]}
    assert keys == {
        "acuracy",
        "model[0].file",
        "model[0].scale",
        "assign[0].material.reflectance",
        "assign[0].material.speculr",
        "assign[1].material",
        "assign[2].emitter",
        "assign[3]",
        "sky",
        "sun.azimuth_deg",
        "sensors[0]",
        "sensors[1]",
        "sensors[1].name",
        "cameras[0].eye_m[2]",
        "requirements[0]",
        "requirements[0].sensors",
    }
    assert lines[0].endswith(f"{len(lines) - 1} problems")
    assert "did you mean 'accuracy'" in str(error.value)


def test_patterns_without_match_are_reported_together(folder):
    text = HEAD + "".join(
        f'[[assign]]\nparts = "{name}"\nmaterial = {{ reflectance = 0.3 }}\n'
        for name in ("wal*", "desk", "lampe")
    )
    with pytest.raises(InputError) as error:
        load_scene(write(folder, text))
    message = str(error.value)
    assert "assign[0]" in message and "assign[2]" in message and "assign[1]" not in message


def test_patterns_of_grids_are_reported_with_those_of_assignments(folder):
    text = (
        HEAD
        + """
[[assign]]
parts = "wal*"
material = { reflectance = 0.3 }
[[sensors]]
name = "plane"
z_m = 0.8
over = "flor"
[[sensors]]
name = "desks"
parts = "dessk"
[[sensors]]
name = "fine"
z_m = 0.8
over = "room/room"
"""
    )
    with pytest.raises(InputError) as error:
        load_scene(write(folder, text))
    lines = str(error.value).splitlines()
    assert [line.strip().split(": ")[0] for line in lines[1:]] == [
        "assign[0]",
        "sensors[0]",
        "sensors[1]",
    ]
    assert "nearest: room/desk" in lines[3] and lines[0].endswith("scene.toml: 3 problems")


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ('metric = "E_avg_lx"\nmin = 500\nmax = 300', "min = 500 lies above max = 300"),
        ('metric = "E_mean"\nmin = 500', "E_avg_lx"),
        ('metric = "DF_avg_percent"\nmin = 2', "overcast"),
        ('metric = "DF_avg_percent"\nmin = 2\n[sky]\ntype = 5', "overcast"),
        (
            'metric = "DF_avg_percent"\nmin = 2\n[sky]\n[sun]\naltitude_deg = 40\n'
            "azimuth_deg = 180\nnormal_illuminance_lx = 1e4",
            "overcast",
        ),
    ],
)
def test_requirements_that_nothing_can_meet(folder, monkeypatch, tables, words):
    def must_not_read(*_, **__):
        raise AssertionError("a model was read although the scene file is wrong")

    monkeypatch.setattr("patchlight.importers.read_step", must_not_read)
    grid = '[[sensors]]\nname = "p"\nz_m = 0.8\n[[requirements]]\nsensors = "p"\n'
    with pytest.raises(InputError, match=r"requirements\[0\]") as error:
        load_scene(write(folder, HEAD + grid + tables))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_wrong_sky_is_one_problem(folder):
    text = HEAD + (
        '[[sensors]]\nname = "p"\nz_m = 0.8\n'
        '[[requirements]]\nsensors = "p"\nmetric = "DF_avg_percent"\nmin = 2\n[sky]\ntype = 17\n'
    )
    with pytest.raises(InputError, match=r"toml: sky: .* 17: must be 1 to 16"):
        load_scene(write(folder, text))


PEREZ = "[sky]\nmodel = 'perez'\n"
IRRADIANCES = "direct_normal_w_m2 = 700\ndiffuse_horizontal_w_m2 = 120\n"


def test_an_all_weather_sky_tells_its_sun(folder):
    """Illuminances as Perez's efficacies have them at 40 degrees: 69.8 klx, within its nearness."""
    text = HEAD + PEREZ + IRRADIANCES + "[sun]\naltitude_deg = 40\nazimuth_deg = 170\n"
    scene = load_scene(write(folder, text))
    assert scene.sky == PerezSky(
        direct_normal_w_m2=700,
        diffuse_horizontal_w_m2=120,
        sun_altitude_deg=40,
        sun_azimuth_deg=170,
    )
    assert scene.sun is not None
    assert scene.sun.normal_illuminance_lx == pytest.approx(69_762, rel=5e-3)
    left_out = "its beam is left out"
    assert not any(left_out in note for note in scene.freeze().notes)
    scene.sun = None
    assert any(left_out in note for note in scene.freeze().notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PEREZ + IRRADIANCES, "sky: .*needs sun_altitude_deg, sun_azimuth_deg"),
        (PEREZ + "sun_altitude_deg = 4\nsun_azimuth_deg = 0\n", "sky: .*needs direct_normal_w_m2"),
        (PEREZ + IRRADIANCES + "type = 12\n", "sky: .*type: of model 'cie', not 'perez'"),
        ("[sky]\ndew_point_c = 3.0\n", "sky: .*dew_point_c: of model 'perez', not 'cie'"),
        ("[sun]\naltitude_deg = 40\nazimuth_deg = 170\n", "sun: give normal_illuminance_lx"),
    ],
)
def test_keys_of_skies_that_do_not_fit(folder, text, said):
    with pytest.raises(InputError, match=said):
        read_scene_file(write(folder, HEAD + text))


def test_the_sky_must_agree_with_the_sun(folder):
    text = HEAD + (
        "[sky]\ntype = 12\nsun_altitude_deg = 30\nsun_azimuth_deg = 180\n"
        "[sun]\naltitude_deg = 40\nazimuth_deg = 180\nnormal_illuminance_lx = 1e4\n"
    )
    with pytest.raises(InputError, match=r"sky: .* 10\.00 degrees apart"):
        read_scene_file(write(folder, text))


def test_misspelled_grids_of_requirements_get_a_hint(folder):
    text = HEAD + (
        '[[sensors]]\nname = "workplane"\nz_m = 0.8\n'
        '[[requirements]]\nsensors = "workplan"\nmetric = "E_avg_lx"\nmin = 2\n'
    )
    with pytest.raises(InputError, match="did you mean 'workplane'"):
        read_scene_file(write(folder, text))


@pytest.mark.parametrize(
    "line",
    [
        "[sky]\nmodel = 'patches'",
        "[[assign]]\nparts = 'desk'\nemitter = { flux_lm = 1, profile = 'a.txt' }",
        "[[sensors]]\nname = 'a'\nz_m = 1\nquantity = 'cylindrical'",
    ],
)
def test_what_is_not_computed_is_no_option(folder, line):
    # Top-level keys must stand before the first table.
    text = f"schema_version = 1\n{line}\n" + HEAD.split("\n", 1)[1]
    with pytest.raises(InputError):
        load_scene(write(folder, text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema_version = ", "not valid TOML"),
        ("", "schema_version: missing"),
        ("schema_version = 2\nmodel = []", "schema_version"),
        ("schema_version = 1\nmodel = 3", "model"),
    ],
)
def test_files_that_are_no_scene(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        load_scene(write(tmp_path, text))


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(MissingFileError, match="no such file"):
        load_scene(tmp_path / "none.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        load_scene(tmp_path / "b.toml")


def test_schema_describes_the_keys(capsys):
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["additionalProperties"] is False
    assert set(schema["required"]) == {"schema_version", "model"}
