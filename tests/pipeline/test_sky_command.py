"""``patchlight sky`` and skies of scene files: numbers, pictures, and what does not fit."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from patchlight.pipeline import CIESky, PatchSky, Site, Sun, load_scene
from patchlight.pipeline.cli import main
from patchlight.reports.sky_figure import fisheye_luminance, sky_png
from patchlight.solver import skies
from patchlight.solver.errors import InputError
from patchlight.solver.gensky import estimated_sun_illuminance
from patchlight.solver.model.sky import direction
from patchlight.solver.perez import sky_illuminance

from ..importers.weather_files import epw_text
from .scene_files import write


@pytest.fixture
def sky(capsys):
    """Run the command: code, what it prints as JSON, and the error line."""

    def run(*options):
        code = main(["sky", *map(str, options), "--json"])
        out, err = capsys.readouterr()
        return code, json.loads(out) if out else None, err

    return run


def test_overcast(sky, capsys):
    code, found, _ = sky("overcast", "--zenith-luminance", 9000)
    assert code == 0 and found["sky"].startswith("CIE type 16")
    assert found["diffuse_horizontal_lx"] == pytest.approx(7000.0 * math.pi)
    assert found["global_horizontal_lx"] == found["diffuse_horizontal_lx"]
    assert found["sun_altitude_deg"] is None and not found["relative"]
    assert len(found["luminance"]) == 145 and found["luminance"][144]["altitude_deg"] == 90.0
    row = found["luminance"][0]
    assert row["luminance_cd_m2"] == pytest.approx(3000.0 * (1 + 2 * math.sin(math.radians(6))))
    assert main(["sky"]) == 0
    text = capsys.readouterr().out
    assert "relative" in text and "zenith luminance" in text and "4,093 cd/m2" in text


def test_estimated_with_its_sun(sky):
    _, found, _ = sky("clear", "--sun-altitude", 45, "--sun-azimuth", 120, "--estimated")
    one = CIESky("clear", 45.0, 120.0, estimated=True)
    assert "estimated" in found["sky"]
    assert found["diffuse_horizontal_lx"] == pytest.approx(9407.0, abs=0.6)
    assert found["direct_normal_lx"] == pytest.approx(estimated_sun_illuminance(one))
    assert found["direct_horizontal_lx"] == pytest.approx(found["direct_normal_lx"] / math.sqrt(2))


def test_place_and_time(sky):
    """London at noon on a midsummer day: NREL's algorithm, 61.93 degrees."""
    _, found, _ = sky(
        12, "--latitude", 51.5, "--longitude", 0, "--time", "2026-06-21T12:00+00:00",
        "--diffuse-illuminance", 9000,
    )  # fmt: skip
    assert found["sun_altitude_deg"] == pytest.approx(61.9346, abs=1e-3)
    assert found["diffuse_horizontal_lx"] == 9000.0
    summer = ("--latitude", 51.5, "--longitude", 0, "--timezone", "Europe/London")
    _, other, _ = sky(12, *summer, "--time", "2026-06-21T13:00", "--diffuse-illuminance", 9000)
    assert other == found


def test_of_a_weather_file(sky, tmp_path):
    path = tmp_path / "a.epw"
    path.write_text(epw_text(), encoding="utf-8")
    code, found, err = sky("--weather", path, "--time", "2030-06-02T12:20")
    assert code == 0, err
    # The file's own sun: 900 exp(−0.15 / sin γ) direct and 100 sin γ diffuse in the step's middle.
    height = math.sin(math.radians(found["sun_altitude_deg"]))
    direct, diffuse = 900.0 * math.exp(-0.15 / height), 100.0 * height
    assert f"{direct:.0f} W/m² direct normal" in found["sky"]
    assert any("06-02 12:00 local standard time" in text for text in found["remarks"])
    # A lumen a watt of the sky is 100 to 160.
    assert 100.0 * diffuse < found["diffuse_horizontal_lx"] < 160.0 * diffuse
    _, again, _ = sky("--weather", path, "--time", "2030-06-02T11:20+00:00")
    assert again == found  # the file is of UTC+1
    for time, said in (("2030-06-02T01:20", "no daylight"), ("2030-07-02T12:00", "has steps from")):
        code, _, err = sky("--weather", path, "--time", time)
        assert code == 2 and said in err and err.count("\n") == 1


def test_distance_of_the_sun():
    """Spencer's series: within 1e-4 of the orbit's extremes, 1 / (1 ∓ 0.0167)²."""
    from patchlight.solver.sun_position import nearness

    values = nearness(np.datetime64("2001-01-01") + np.arange(365))
    assert values.max() == pytest.approx(1 / (1 - 0.0167) ** 2, abs=1e-3)
    assert values.min() == pytest.approx(1 / (1 + 0.0167) ** 2, abs=1e-3)
    assert int(values.argmax()) < 8 and abs(int(values.argmin()) - 184) < 6


def test_irradiances(sky):
    place = ("--sun-altitude", 40, "--sun-azimuth", 180)
    _, found, _ = sky("--direct", 700, "--diffuse", 120, *place)
    # As gendaylit prints them for the sun at its nearest, 3.5 % more irradiance than at the mean.
    assert found["direct_normal_lx"] == pytest.approx(69_762, rel=5e-3)
    assert found["diffuse_horizontal_lx"] == pytest.approx(17_915, rel=1e-2)


def test_measured(sky, tmp_path):
    path = tmp_path / "sky.csv"
    path.write_text(" ".join(str(100 * (k + 1)) for k in range(145)), encoding="utf-8")
    _, found, _ = sky("--patches", path)
    assert [row["luminance_cd_m2"] for row in found["luminance"]] == [
        100.0 * (k + 1) for k in range(145)
    ]
    _, scaled, _ = sky("--patches", path, "--diffuse-illuminance", 5000)
    assert scaled["diffuse_horizontal_lx"] == pytest.approx(5000.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("hazy",), "'hazy': must be 1 to 16"),
        ((12,), "give sun_altitude_deg"),
        ((12, "--sun-altitude", 30), "together"),
        (("--time", "2026-06-21T12:00"), "--time: give --latitude and --longitude"),
        (("--latitude", 50), "--latitude: not used together with a sun that stands at no --time"),
        (("--direct", 100), "--direct and --diffuse together"),
        (("--direct", 100, "--diffuse", 100), "give --sun-altitude"),
        (("--weather", "a.epw"), "--weather: give --time"),
        (("--weather", "a.epw", "--turbidity", 3), "--turbidity: not used together with --weather"),
        (("--weather", "a.epw", "--scene", "s.toml"), "give one of --weather, --scene"),
        (("--patches", "none.csv"), "none.csv: no such file"),
        (
            ("--time", "2026-06-21T00:00+00:00", "--latitude", 50, "--longitude", 0),
            "no day",
        ),
    ],
)
def test_what_does_not_fit(sky, options, said):
    code, _, err = sky(*options)
    assert code == 2 and said in err and err.count("\n") == 1


def test_picture(sky, tmp_path):
    """North at the top and east on the left, the zenith in the middle, nothing in the corners."""
    one = CIESky(12, 30.0, 90.0)
    values = fisheye_luminance(one, 181)
    assert np.isnan(values[0, 0]) and np.isfinite(values[90, 0])
    assert values[90, 90] == pytest.approx(skies.zenith_luminance(one))
    for row, column, azimuth in ((30, 90, 0.0), (90, 30, 90.0), (150, 90, 180.0)):
        there = skies.luminance(one, direction(30.0, azimuth))
        assert values[row, column] == pytest.approx(there, rel=1e-9)
    path = tmp_path / "sky.png"
    code, _, _ = sky(12, "--sun-altitude", 30, "--sun-azimuth", 90, "-o", path)
    assert code == 0 and path.read_bytes().startswith(b"\x89PNG")
    assert path.read_bytes() == sky_png(one, (30.0, 90.0))
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    code, _, err = sky(16, "-o", tmp_path / "file" / "sky.png")
    assert code == 2 and err.count("\n") == 1


def test_colours(sky, capsys):
    """Chromaticity and daylight weights of every patch, and a table that says they are modelled."""
    place = ("--sun-altitude", 40, "--sun-azimuth", 0)
    _, found, _ = sky(12, *place, "--color", "preetham")
    top = found["luminance"][144]
    assert (top["x"], top["y"]) == pytest.approx((0.2444, 0.2505), abs=1e-4)
    assert "modelled" in found["color_model"]
    # D65 nearly: M1 = -0.296, M2 = -0.688 of the CIE.
    _, even, _ = sky(16, "--color", "constant")
    row = even["luminance"][7]
    assert (row["m1"], row["m2"]) == pytest.approx((-0.296, -0.688), abs=5e-3)
    capsys.readouterr()
    assert main(["sky", "overcast", "--color", "chain"]) == 0
    text = capsys.readouterr().out
    assert "modelled (chain; models differ by 0.02 in x and y)" in text
    assert main(["sky", "overcast", "--color", "preetham"]) == 2
    assert "has no sun" in capsys.readouterr().err


HEAD = 'schema_version = 1\n[[model]]\nfile = "desk.step"\n'
SITE = '[site]\nlatitude_deg = 51.5\nlongitude_deg = 0\ntimezone = "Europe/London"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    import cadquery as cq

    path = tmp_path_factory.mktemp("desk")
    cq.exporters.export(cq.Workplane("XY").box(1000, 1000, 100), str(path / "desk.step"))
    (path / "sky.csv").write_text(" ".join(["250"] * 145), encoding="utf-8")
    return path


def test_scene_files_say_all_that_the_api_can(folder, sky):
    text = (
        HEAD
        + SITE
        + (
            '[sky]\ntype = "intermediate"\nestimated = true\nturbidity = 4\n'
            '[sun]\ntime = "2026-06-21T13:00"\n'
        )
    )
    scene = load_scene(write(folder, text))
    place = Site(51.5, 0.0, timezone="Europe/London")
    sun = Sun.at(place, "2026-06-21T13:00", normal_illuminance_lx=0.0)
    expected = CIESky(
        "intermediate", sun.altitude_deg, sun.azimuth_deg, estimated=True, turbidity=4.0
    )
    assert scene.sky == expected
    assert scene.sun is not None and scene.sun.altitude_deg == sun.altitude_deg
    assert scene.sun.normal_illuminance_lx == estimated_sun_illuminance(expected)
    assert any("level of the sky is estimated" in note for note in scene.freeze().notes)
    _, found, _ = sky("--scene", folder / "scene.toml")
    assert found["direct_normal_lx"] == scene.sun.normal_illuminance_lx
    # TOML has times of its own.
    other = load_scene(write(folder, text.replace('"2026-06-21T13:00"', "2026-06-21T12:00:00Z")))
    assert other.sky == expected
    nearer = HEAD + (
        "[sky]\nmodel = 'perez'\ndirect_normal_w_m2 = 0\ndiffuse_horizontal_w_m2 = 90\n"
        "sun_altitude_deg = 30\nsun_azimuth_deg = 0\nsun_nearness = 1.03\n"
    )
    far = load_scene(write(folder, nearer.replace("1.03", "0.97"))).sky
    near = load_scene(write(folder, nearer)).sky
    assert sky_illuminance(near) != sky_illuminance(far) and near.sun_nearness == 1.03


def test_weather_of_scene_files(folder, sky):
    """Remarks on the file are told; the sun may set in the hour that is asked for."""

    def change(rows):
        values = [row.split(",") for row in rows]
        values[20][13] = values[20][15] = "5"  # W/m² on a level plane from 20 to 21 h
        values[2][32] = "-50"  # an albedo that cannot be
        return [",".join(row) for row in values]

    path = folder / "a.epw"
    path.write_text(epw_text(rows=change), encoding="utf-8")
    text = HEAD + "[sky]\nmodel = 'weather'\nfile = 'a.epw'\ntime = '2001-06-01T20:55'\n"
    scene = load_scene(write(folder, text))
    notes = scene.freeze().notes
    assert any("Nowhere, XX: step of 60 min from 06-01 20:00" in note for note in notes)
    assert any("taken for missing in 1 steps" in note for note in notes)
    assert any("the sun being up for 17% of it" in note for note in notes)
    # It sets at about 20:10, and stands in the middle of the part before.
    assert 0.2 < scene.sky.sun_altitude_deg < 1.5
    _, found, _ = sky("--scene", folder / "scene.toml")
    assert found["remarks"] == list(scene.notes)
    _, alone, _ = sky("--weather", path, "--time", "2001-06-01T20:55")
    assert alone["sun_altitude_deg"] == found["sun_altitude_deg"]


def test_limb_of_the_sun_in_scene_files(folder):
    text = HEAD + "[sun]\naltitude_deg = 30\nazimuth_deg = 180\nnormal_illuminance_lx = 1000\n"
    assert not load_scene(write(folder, text)).sun.limb_darkening
    text += "limb_darkening = true\n"
    scene = load_scene(write(folder, text))
    assert scene.sun == Sun(30.0, 180.0, 1000.0, limb_darkening=True)
    notes = scene.freeze().notes
    assert any("limb darkening is left out of the means over elements" in note for note in notes)
    assert not any("limb" in note and "mirrors" in note for note in notes)
    mirror = "[[assign]]\nparts = 'desk'\nmaterial = { reflectance = 0.1, mirror = 0.8 }\n"
    notes = load_scene(write(folder, text + mirror)).freeze().notes
    assert any("limb darkening" in note and "mirrors" in note for note in notes)
    with pytest.raises(InputError, match=r"sun\.limb_darkening"):
        load_scene(write(folder, text.replace("= true", "= 1")))


def test_turbidity_of_colours(sky):
    """That which is given, else that of the estimated level, else the usual one."""
    place = ("--sun-altitude", 40, "--sun-azimuth", 0, "--color", "preetham")

    def top(*options):
        code, found, err = sky("clear", *place, *options)
        assert code == 0, err
        return found["luminance"][144]["x"], found["diffuse_horizontal_lx"]

    assert top()[0] == top("--turbidity", 3)[0] != top("--turbidity", 5)[0]
    assert top("--turbidity", 5)[1] == top()[1]  # the level does not depend on it
    assert top("--estimated")[0] == top("--turbidity", 2.45)[0]
    hazy = top("--estimated", "--turbidity", 5)
    assert hazy[0] == top("--turbidity", 5)[0] and hazy[1] != top("--estimated")[1]
    code, _, err = sky("clear", *place, "--turbidity", 8)
    assert code == 2 and "turbidity = 8" in err and "6" in err


def test_measured_skies_of_scene_files(folder):
    text = HEAD + "[sky]\nmodel = 'patches'\nfile = 'sky.csv'\nsun_altitude_deg = 30\n"
    scene = load_scene(write(folder, text + "sun_azimuth_deg = 180\n"))
    assert scene.sky == PatchSky([250.0] * 145, 30.0, 180.0)
    from patchlight.pipeline.scene_file import read_scene_file, resolved_config

    path = folder / "scene.toml"
    config = resolved_config(read_scene_file(path), folder)
    assert f'file = "{folder / "sky.csv"}"' in config and config.count("# sha256") == 2
    again = folder / "again.toml"
    again.write_text(config, encoding="utf-8")
    assert load_scene(again).sky == scene.sky


def test_colour_of_measured_skies_takes_the_sun_of_the_scene(folder, sky):
    """And the command shows the model of the scene unless it is given another."""
    text = HEAD + (
        "[sky]\nmodel = 'patches'\nfile = 'sky.csv'\ncolor = 'preetham'\n"
        "[sun]\naltitude_deg = 30\nazimuth_deg = 180\nnormal_illuminance_lx = 1000\n"
    )
    scene = load_scene(write(folder, text))
    assert scene.sky == PatchSky([250.0] * 145, 30.0, 180.0, color="preetham")
    _, found, _ = sky("--scene", folder / "scene.toml")
    assert found["color_model"] == "preetham, modelled" and "x" in found["luminance"][0]
    _, other, _ = sky("--scene", folder / "scene.toml", "--color", "constant")
    assert other["color_model"] == "constant, modelled"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[sky]\nmodel = 'patches'\n", "sky: model 'patches' needs file"),
        ("[sky]\nmodel = 'patches'\nfile = 'none.csv'\n", r"sky\.file: .*none\.csv: no such file"),
        ("[sky]\nmodel = 'patches'\nfile = 'sky.csv'\ntype = 3\n", "type: of model 'cie', not"),
        ("[sky]\nmodel = 'patches'\nfile = 'scene.toml'\n", r"sky: .*scene\.toml, line 1"),
        ("[sky]\nmodel = 'weather'\n", "sky: model 'weather' needs file and time"),
        ("[sky]\nmodel = 'weather'\nfile = 'sky.csv'\ntime = 7\n", "sky.time"),
        ("[sun]\nnormal_illuminance_lx = 1\n", r"sun: .*or time: \[sky\] has no sun"),
        ("[sky]\nturbidity = 3.0\n", "sky: CIESky.turbidity: only"),
        ("[sun]\ntime = '2026-06-21T13:00'\nnormal_illuminance_lx = 1\n", "sun: time: give lat"),
        ("[sun]\naltitude_deg = 3\nnormal_illuminance_lx = 1\n", "sun: give altitude_deg and az"),
        (
            "[sun]\ntime = '2026-06-21T13:00'\naltitude_deg = 3\nazimuth_deg = 3\n",
            "sun: give altitude_deg and azimuth_deg, or time, or none",
        ),
    ],
)
def test_keys_that_do_not_fit(folder, text, said):
    with pytest.raises(InputError, match=said):
        load_scene(write(folder, HEAD + text))


def test_a_moment_of_a_weather_file(folder, sky):
    """The sky of its irradiances, and with an empty [sun] the sun that goes with it."""
    (folder / "a.epw").write_text(epw_text(), encoding="utf-8")
    text = HEAD + "[sky]\nmodel = 'weather'\nfile = 'a.epw'\ntime = 2030-06-02T12:20:00\n[sun]\n"
    scene = load_scene(write(folder, text))
    _, found, _ = sky("--weather", folder / "a.epw", "--time", "2030-06-02T12:20")
    assert scene.sun is not None and scene.sky is not None
    assert scene.sun.normal_illuminance_lx == found["direct_normal_lx"] > 0.0
    assert scene.sun.altitude_deg == scene.sky.sun_altitude_deg == found["sun_altitude_deg"]
    assert skies.horizontal_illuminance(scene.sky) == found["diffuse_horizontal_lx"]
    from patchlight.pipeline.scene_file import read_scene_file, resolved_config

    config = resolved_config(read_scene_file(folder / "scene.toml"), folder)
    again = folder / "again.toml"
    again.write_text(config, encoding="utf-8")
    assert load_scene(again).sky == scene.sky and load_scene(again).sun == scene.sun
