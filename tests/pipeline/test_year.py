"""A year from a scene and a weather file: dataset, files, states, and what is refused."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from patchlight.pipeline import (
    Emitter,
    Ground,
    Material,
    Scene,
    SensorGrid,
    Site,
    simulate_year,
    year_fill,
    year_store,
)
from patchlight.pipeline.cli import main
from patchlight.pipeline.output import file_hash
from patchlight.pipeline.states import absent_parts, make_state
from patchlight.solver import daylit
from patchlight.solver.errors import InputError, OutputError

from ..importers.weather_files import epw_text
from .scene_files import write
from .window_room import opening, window_room

HOURS = 48


def epw(folder, name="two_days.epw", **given):
    path = folder / name
    path.write_text(epw_text(days=2, **given), encoding="ascii", newline="")
    return path


def room(site=None, blind=False):
    scene = window_room(4.0, 3.0, 0.5)
    scene.site = site
    scene.ground = Ground(0.2)
    scene.add(SensorGrid([(0, 1, 0.8), (0, 3, 0.8)], (0, 0, 1), name="desk"))
    scene.add(SensorGrid([(0, 2, 2.0)], (0, -1, 0), name="view"))
    if blind:
        scene.add(opening(-0.05), "blind", two_sided=True)
        scene.assign("blind", Material(0.5))
    return scene


@pytest.fixture(scope="module")
def weather_file(tmp_path_factory):
    return epw(tmp_path_factory.mktemp("weather"))


@pytest.fixture(scope="module")
def whole(weather_file):
    return simulate_year(room(), weather_file, accuracy=0.2)


def test_dataset(whole):
    assert dict(whole.sizes) == {"sensor": 3, "time": HOURS}
    assert whole["grid"].values.tolist() == ["desk", "desk", "view"]
    assert whole["y"].values.tolist() == [1.0, 3.0, 2.0]
    assert whole["ny"].values.tolist() == [0.0, 0.0, -1.0]
    for name in ("illuminance", "sun_illuminance", "sky_horizontal", "sun_normal"):
        assert whole[name].attrs["units"] == "lx"
    assert whole["illuminance"].dtype == np.float32
    light, altitude = whole["illuminance"].values, whole["sun_altitude"].values
    assert (light[:, altitude < 0.0] == 0.0).all()
    assert (light[:, altitude > 10.0] > 0.0).all()
    assert light[0].sum() > light[1].sum()  # nearer to the window
    assert (light >= whole["sun_illuminance"].values - 1e-3).all()
    # UTC+1: the middle of the first hour is half past eleven of the day before.
    assert str(whole["time"].values[0])[:16] == "2001-06-01T00:00"
    assert str(whole["time_utc"].values[0])[:16] == "2001-05-31T23:30"
    assert whole["occupied"].values.sum() == 20
    assert whole.attrs["place"] == "Nowhere, XX"
    assert 0.0 <= whole.attrs["sun_indirect_error"] < 0.5


def test_some_sensors_and_another_schedule(weather_file):
    found = simulate_year(
        room(Site(48.0, 9.0, timezone="Europe/Berlin")),
        weather_file,
        sensors="view",
        accuracy=0.2,
        schedule="06:00-07:00",
    )
    assert dict(found.sizes) == {"sensor": 1, "time": HOURS}
    # Clocks show an hour more than standard time in June.
    used = found["time"].values[found["occupied"].values]
    assert [str(t)[11:16] for t in used] == ["05:00", "05:00"]
    assert found.attrs["timezone"] == "Europe/Berlin"


def test_scene_far_from_the_station_is_said_and_its_clocks_do_not_count(weather_file):
    scene = room(Site(-33.9, 151.2, timezone="Australia/Sydney"))
    found = simulate_year(scene, weather_file, sensors="view", accuracy=0.2)
    assert "degrees from the station" in found.attrs["remarks"]
    np.testing.assert_array_equal(found["clock"].values, found["time"].values)


def test_quarters_of_an_hour(weather_file, whole):
    found = simulate_year(room(), weather_file, sensors="desk", accuracy=0.2, step_minutes=15)
    assert found.sizes["time"] == 4 * HOURS
    light = found["illuminance"].values.reshape(2, HOURS, 4).mean(axis=2)
    day = whole["sun_altitude"].values > 15.0
    np.testing.assert_allclose(light.sum(), whole["illuminance"].values[:2].sum(), rtol=0.1)
    assert (light[:, day] > 0.0).all()


def test_written_in_blocks_and_taken_up_again(tmp_path, weather_file, whole, monkeypatch):
    monkeypatch.setattr(year_fill, "BLOCK", 10)
    target = tmp_path / "annual.nc"
    calls = []

    def cut(stage, done, total):
        if stage == "year":
            calls.append(done)
            if done == 3:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_year(room(), weather_file, accuracy=0.2, out=target, progress=cut)
    assert not target.exists()
    kept = [p.name for p in (tmp_path / ".annual.nc.blocks").glob("*-000-0000000-*.npz")]
    assert sum(not name.endswith("-points.npz") for name in kept) == 3
    calls.clear()

    def told(stage, done, total):
        calls.append((stage, total))

    with simulate_year(
        room(),
        weather_file,
        accuracy=0.2,
        out=target,
        progress=lambda s, d, t: calls.append((s, t)),
    ) as found:
        assert ("year", 2) in calls  # of five blocks, three were there
        np.testing.assert_allclose(
            found["illuminance"].values, whole["illuminance"].values, rtol=1e-6
        )
        assert found["grid"].values.tolist() == ["desk", "desk", "view"]
        assert found["occupied"].dtype == bool
    assert [p.name for p in tmp_path.iterdir()] == ["annual.nc"]


def test_taken_up_again_with_other_blocks_of_sensors(tmp_path, weather_file, whole, monkeypatch):
    """As many as memory had room for: another time their ends are others."""
    monkeypatch.setattr(daylit, "BLOCK_BYTES", 1)
    monkeypatch.setattr(daylit, "SENSORS", 2)
    target = tmp_path / "annual.nc"

    def cut(stage, done, total):
        if stage == "year" and done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_year(room(), weather_file, accuracy=0.2, out=target, progress=cut)
    assert list((tmp_path / ".annual.nc.blocks").glob("*.npz"))
    monkeypatch.setattr(daylit, "SENSORS", 1)
    with simulate_year(room(), weather_file, accuracy=0.2, out=target) as found:
        values, own = found["illuminance"].values, whole["illuminance"].values
        # But for surfaces that hardly matter, which blocks leave out: `beams.LEFT_OUT`.
        np.testing.assert_allclose(values, own, rtol=2e-3, atol=2e-3 * own.max())


def test_blocks_of_another_run_are_not_taken(tmp_path, weather_file, monkeypatch):
    from patchlight.pipeline.year_store import YearStore, key_of

    one, two = key_of("a", np.arange(3.0)), key_of("a", np.arange(1.0, 4.0))
    store = YearStore(tmp_path / "a.nc", one)
    store.put("some", {"x": np.ones(3)})
    assert store.has("some")
    np.testing.assert_array_equal(store.get("some")["x"], np.ones(3))
    assert not YearStore(tmp_path / "a.nc", two).has("some")
    blocked = tmp_path / ".b.nc.blocks"
    blocked.write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        YearStore(tmp_path / "b.nc", one).put("some", {"x": np.ones(3)})


def test_states_are_solved_each(weather_file):
    scene = room(blind=True)
    scene.add_state("up", absent="blind")
    scene.add_state("down", present="blind")
    found = simulate_year(scene, weather_file, sensors="desk", accuracy=0.2)
    assert found["illuminance"].dims == ("state", "sensor", "time")
    assert found["state"].values.tolist() == ["up", "down"]
    up, down = found["illuminance"].values.sum(axis=(1, 2))
    assert up > 5.0 * down > 0.0  # what comes round its edges
    assert "blind" in {part.path for part in scene.freeze().parts}
    patches = [len(scene.freeze(state=name).patches) for name in ("up", "down")]
    assert patches == [9, 10]


@pytest.mark.parametrize("order", [("up", "shut"), ("shut", "up")])
def test_a_shut_blind_is_judged_beside_the_brightest_state(weather_file, order):
    """Light through a slit of 10 µm is not told to a twentieth, and nobody needs it to be."""
    scene = room()
    scene.add(SensorGrid([(0, 3, 0.8)], (0, 0, 1), name="deep"))
    scene.add(opening(-1e-5), "blind", two_sided=True)
    asked = {"sensors": "deep", "accuracy": 0.05}
    # Alone it is judged by its own light.
    alone = simulate_year(scene, weather_file, **asked)
    assert alone.attrs["converged"] == 0 and "accuracy 0.05 was not" in alone.attrs["remarks"]
    assert alone["relative_error"].values > 0.05
    for name in order:
        scene.add_state(name, **{"absent" if name == "up" else "present": "blind"})
    found = simulate_year(scene, weather_file, **asked)
    light = dict(zip(order, found["illuminance"].values.sum(axis=(1, 2)), strict=True))
    assert 0.0 < light["shut"] < 1e-4 * light["up"]
    assert found.attrs["converged"] == 1 and "not reached" not in found.attrs["remarks"]
    error = dict(zip(order, found["relative_error"].values[:, 0], strict=True))
    # Each is told of its own light.
    assert error["up"] < 1e-3 and error["shut"] > 0.05


def test_which_parts_are_there(make_model):
    box = ((1.0, 1.0, 1.0), (0, 0, 0), False)
    scene = Scene(make_model("room", dict.fromkeys(("wall", "blind", "shade"), box)))
    entries = scene.entries
    states = [
        make_state("open", None, None),
        make_state("blind", "blind", None),
        make_state("both", ["blind", "shade"], None),
        make_state("no wall", None, "room/w*"),
    ]
    found = {state.name: absent_parts(states, [state.name], entries) for state in states}
    assert found == {"open": [1, 2], "blind": [2], "both": [], "no wall": [0, 1, 2]}
    with pytest.raises(InputError, match="'blnd': no part matches; nearest: room/blind"):
        absent_parts([make_state("a", "blnd", None)], ["a"], entries)
    with pytest.raises(InputError, match="both present and absent"):
        absent_parts([make_state("a", "blind", "*d")], ["a"], entries)
    with pytest.raises(InputError, match="states: open"):
        absent_parts(states[:1], ["shut"], entries)
    for bad in ("", None, 3):
        with pytest.raises(InputError, match="must have a name"):
            make_state(bad, None, None)
    with pytest.raises(InputError, match="part pattern"):
        make_state("a", [3], None)


def test_states_name_parts_as_inspect_prints_them(make_model):
    box = ((1.0, 1.0, 1.0), (0, 0, 0), False)
    scene = Scene()
    scene.add(make_model("floor", {"slab": box}), name="below")
    scene.add(make_model("file", {"asm/wall": box, "asm/blind": box}), name="room")
    for pattern in ("asm/blind", "room/asm/blind", "blind"):
        states = [make_state("up", None, pattern), make_state("down", pattern, None)]
        assert absent_parts(states, ["up"], scene.entries) == [2]
        assert absent_parts(states, ["down"], scene.entries) == []
    scene.add_state("up", absent="asm/blind")
    assert len(scene.freeze(state="up").patches) == 12


def test_states_of_one_name():
    scene = room(blind=True)
    scene.add_state("up", absent="blind")
    with pytest.raises(InputError, match="state named 'up' exists"):
        scene.add_state("up", absent="blind")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sensors": "wall"}, "no grid named 'wall'; grids: desk, view"),
        ({"schedule": "8 to 6"}, "like 08:00-18:00"),
        ({"schedule": "12:00-12:20"}, "'12:00-12:20': holds the middle of no step of 60 minutes"),
        ({"step_minutes": 7}, "step_minutes = 7"),
        ({"accuracy": 2.0}, "accuracy"),
        ({"out": "year.csv"}, "ends in .nc"),
    ],
)
def test_bad_options(weather_file, options, message):
    with pytest.raises(InputError, match=message):
        simulate_year(room(), weather_file, **options)


def drop_hour(lines):
    return lines[:5] + lines[6:]


def without_radiation(lines):
    """Direct and diffuse and global radiation are missing everywhere."""
    out = []
    for line in lines:
        words = line.split(",")
        words[13:16] = ["9999", "9999", "9999"]
        out.append(",".join(words))
    return out


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rows": drop_hour}, "must be 60 min later"),
        ({"rows": without_radiation}, "dni or dhi is missing"),
        ({"zone": 20.0}, "time zone = 20"),
    ],
)
def test_bad_weather(tmp_path, given, message):
    with pytest.raises(InputError, match=message):
        simulate_year(room(), epw(tmp_path, **given), accuracy=0.2)


def test_polar_night_and_leap_day(tmp_path):
    dark = epw(tmp_path, "dark.epw", latitude=78.0, longitude=15.0, first=(12, 20))
    found = simulate_year(room(), dark, sensors="view", accuracy=0.2)
    assert not found["illuminance"].values.any()
    leap = epw(tmp_path, "leap.epw", year=2004, first=(2, 28))
    found = simulate_year(room(), leap, sensors="view", accuracy=0.2)
    assert str(found["time"].values[-1])[:10] == "2004-02-29"
    assert found["illuminance"].values[:, 24:].any()


ROOM = """\
schema_version = 1
[[model]]
file = "room.step"
name = "room"
{more}
[[sensors]]
name = "desk"
points_m = [[0, 0, -1.0], [0.5, 0.5, -1.0]]
"""


def test_scene_file_knows_states(tmp_path):
    from patchlight.pipeline.scene_file import read_scene_file

    (tmp_path / "room.step").write_text("")
    text = ROOM.format(more='[[state]]\nname = "up"\nabsent = ["blind", "b*"]')
    file = read_scene_file(write(tmp_path, text))
    assert file.state[0].absent == ["blind", "b*"]
    twice = '[[state]]\nname = "up"\n[[state]]\nname = "up"'
    with pytest.raises(InputError, match=r"state\[1\]\.name: 'up' is taken"):
        read_scene_file(write(tmp_path, ROOM.format(more=twice)))


@pytest.fixture
def step_room(tmp_path, monkeypatch):
    """A room with a window in its south wall, and a blind that leaves 20 cm of it free."""
    cq = pytest.importorskip("cadquery")
    monkeypatch.chdir(tmp_path)
    walls = cq.Workplane().box(4400, 4400, 3200)
    walls = walls.cut(cq.Workplane().box(4000, 4000, 2800))
    walls = walls.cut(cq.Workplane().box(2000, 400, 1200).translate((0, -2100, 200)))
    made = cq.Assembly(name="room")
    made.add(walls, name="walls")
    made.add(cq.Workplane().box(1800, 10, 1200).translate((0, -2150, 200)), name="blind")
    made.export(str(tmp_path / "room.step"))
    return tmp_path


@pytest.mark.slow
def test_command(step_room, capsys):
    more = '[[state]]\nname = "up"\nabsent = "blind"\n[[state]]\nname = "down"\n[view_out]'
    scene = write(step_room, ROOM.format(more=more))
    weather = epw(step_room)
    command = ["year", str(scene), "--weather", str(weather), "--accuracy", "0.2", "-o", "out"]
    assert main(command) == 0
    text = capsys.readouterr()
    assert "DA300_mean_pct" in text.out and "sDA300" not in text.out  # of a whole year
    assert "the file covers 2 days, no whole year" in text.err
    out = step_room / "out"
    names = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    assert names == {
        "run.json", "metrics.json", "metrics.csv", "config.resolved.toml", "grids/annual.nc",
        "grids/desk.csv", "report.html",
    }  # fmt: skip
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 2 and "View out (EN 17037): level" in page
    assert "Daylight autonomy DA300, mean of the area" in page
    with (out / "grids" / "desk.csv").open(encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == 2
    assert float(lines[0]["E_mean_lx"]) > 10.0
    # The opening is 2 m wide, seen from the two points through a wall 0.2 m thick.
    assert all(20.0 < float(line["sight_angle_deg"]) < 90.0 for line in lines)
    assert all(line["view_sky"] == "1" for line in lines)
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert {item["path"].rsplit("/", 1)[-1] for item in record["inputs"]} == {
        "room.step", "two_days.epw",
    }  # fmt: skip
    assert record["scene"] == {"path": str(scene.resolve()), "sha256": file_hash(scene)}
    assert record["photometry"] == []
    assert main([*command, "--json"]) == 0  # once more into the same folder
    rows = json.loads(capsys.readouterr().out)
    assert {row["sensor_id"] for row in rows} == {"desk"}
    found = {row["quantity"]: row for row in rows}
    mean = found["E_mean_lx"]
    assert mean["low"] < mean["value"] < mean["high"] < 2.0 * mean["value"]
    assert found["EN17037_view_level"]["value"] in ("none", "minimum", "medium", "high")


def test_view_out_asked_of_a_grid_that_there_is_not(tmp_path):
    from patchlight.pipeline.scene_file import read_scene_file

    (tmp_path / "room.step").touch()
    asked = '[view_out]\nsensors = ["dsk"]'
    with pytest.raises(InputError, match=r"view_out\.sensors: .*'dsk'"):
        read_scene_file(write(tmp_path, ROOM.format(more=asked)))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["no.toml", "--weather", "w.epw"], "no.toml: no such file"),
        (["room.step", "--weather", "w.epw"], "needs a scene file"),
        (["scene.toml", "--weather", "w.epw"], "w.epw: no such file"),
        (["scene.toml", "--weather", "w.epw", "--schedule", "8-6"], "like 08:00-18:00"),
        (["basis.toml", "--weather", "two_days.epw"], "basis = 'constant'"),
        (["scene.toml", "--weather", "w.epw", "--electric", "ceiling"], "like ceiling=08:00-18:00"),
        (
            [
                "scene.toml",
                "--weather",
                "w.epw",
                "--electric",
                "a=always",
                "--electric",
                "a=1:00-2:00",
            ],
            "--electric: 'a' is given twice, always and 1:00-2:00",
        ),
        (
            ["scene.toml", "--weather", "w.epw", "--electric", "a=8-6"],
            "--electric 'a=8-6': schedule = '8-6': must be two times of a day, like 08:00-18:00, "
            "the second later, or 'always'",
        ),
        (["scene.toml", "--weather", "w.epw", "--sun-day", "3-21"], "--sun-day: sun_day = '3-21'"),
        (
            ["scene.toml", "--weather", "w.epw", "--sun-day", "W12-3"],
            "--sun-day: sun_day = 'W12-3'",
        ),
        (
            ["scene.toml", "--weather", "two_days.epw", "--sun-day", "02-29"],
            "--sun-day: sun_day = '02-29': must be month and day of 2001",
        ),
        (
            ["scene.toml", "--weather", "w.epw", "--sun-above", "90"],
            "--sun-above: sun_above_deg = 90.0: must be at least 0 and below 90",
        ),
        (["scene.toml", "--weather", "w.epw", "--memory", "0"], "--memory: memory_gb = 0.0"),
        (["scene.toml"], "--weather"),
    ],
)
def test_bad_command(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.step").write_text("")
    write(tmp_path, ROOM.format(more=""))
    (tmp_path / "basis.toml").write_text("basis = 'constant'\n" + ROOM.format(more=""))
    epw(tmp_path)
    assert main(["year", *words]) == 2
    told = capsys.readouterr().err.strip()
    assert message in told
    assert "\n" not in told


def test_options_of_the_command_arrive(tmp_path, monkeypatch):
    asked = {}

    def simulated(scene, weather, **options):
        asked.update(options)
        raise InputError("enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("patchlight.pipeline.year_runs.simulate_year", simulated)
    monkeypatch.setattr("patchlight.pipeline.scene_file.build_scene", lambda *a, **b: room())
    (tmp_path / "room.step").write_text("")
    scene = write(tmp_path, ROOM.format(more=""))
    words = [
        "year",
        str(scene),
        "--weather",
        str(epw(tmp_path)),
        "--memory",
        "3",
        "--sensors",
        "desk",
    ]
    words += ["--electric", "ceiling=07:00-19:00", "--electric", "desk=lamps=always"]
    words += ["--sun-day", "02-01", "--sun-above", "8", "--step-minutes", "30", "--threads", "1"]
    assert main(words) == 2
    assert asked.pop("progress") is not None and asked.pop("out").name == "annual.nc"
    assert asked == {
        "sensors": ("desk",), "accuracy": 0.01, "schedule": "08:00-18:00", "step_minutes": 30,
        "electric": {"ceiling": "07:00-19:00", "desk=lamps": "always"}, "sun_day": "02-01",
        "sun_above_deg": 8.0, "threads": 1, "memory_gb": 3.0,
    }  # fmt: skip


def test_no_light_comes_into_a_closed_room(weather_file):
    """Also where it is one cavity of air, in which nothing hides anything."""
    import cadquery as cq
    from patchlight.pipeline import Air, Scene, from_cadquery

    room = cq.Workplane().box(3, 4, 2.5).translate((0, 0, 1.25))
    scene = Scene(from_cadquery(room, unit="m", name="air"))
    scene.assign("air", Air())
    scene.add(SensorGrid([(0, 0, 0.8)], (0, 0, 1), name="desk"))
    found = simulate_year(scene, weather_file, accuracy=0.3)
    assert (found["illuminance"].values == 0.0).all()
    assert (found["sun_illuminance"].values == 0.0).all()


def test_dim_sensors_keep_their_indirect_light(weather_file, monkeypatch):
    """What is little of the light of all sensors is all that some of them get."""
    from patchlight.solver import beams

    alone = simulate_year(room(), weather_file, sensors="view", accuracy=0.2)
    monkeypatch.setattr(beams, "LEFT_OUT", 0.3)
    scene = room()
    scene.add(SensorGrid([(0, -1.0 - 0.01 * k, 0.5) for k in range(300)], (0, 1, 0), name="facade"))
    many = simulate_year(scene, weather_file, accuracy=0.2)
    some = many["illuminance"].values[many["grid"].values == "view"]
    day = alone["sun_altitude"].values > 5.0
    assert (some[:, day] > 0.3 * alone["illuminance"].values[:, day]).all()


def test_states_of_what_sensors_lie_on_and_of_lamps(weather_file):
    scene = room(blind=True)
    scene.assign("blind", Emitter(flux_lm=100.0))
    scene.add_state("with", present="blind")
    scene.add_state("without")
    found = simulate_year(scene, weather_file, sensors="view", accuracy=0.3)
    assert found["state"].values.tolist() == ["with", "without"]
    bright = found["illuminance"].values.sum(axis=(1, 2))
    assert bright[1] > 2.0 * bright[0]


def test_notes_and_accuracy_not_reached_are_told(weather_file):
    scene = room(blind=True)
    scene.assignments.pop()
    found = simulate_year(scene, weather_file, sensors="view", accuracy=0.02)
    assert found.attrs["converged"] == ("not reached" not in found.attrs["remarks"])
    assert "got the default" in found.attrs["remarks"]
    assert "no light" not in found.attrs["remarks"]


def test_all_blocks_with_nothing_said_of_them(tmp_path, weather_file, monkeypatch):
    """What was found besides the blocks is known again."""
    target = tmp_path / "annual.nc"

    def cut(self, *given):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(year_store.YearStore, "dataset", cut)
        with pytest.raises(KeyboardInterrupt):
            simulate_year(room(), weather_file, sensors="view", accuracy=0.2, out=target)
    monkeypatch.setattr(year_fill.Filler, "_solve", None)
    found = simulate_year(room(), weather_file, sensors="view", accuracy=0.2, out=target)
    assert found.attrs["sun_indirect_error"] > 0.0
    assert found.attrs["converged"] in (0, 1)
