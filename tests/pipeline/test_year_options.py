"""Memory of a year, its electric light, its window groups and its day of sun."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from patchlight.pipeline import (
    CIESky,
    Emitter,
    Ground,
    Material,
    SensorGrid,
    simulate,
    simulate_year,
)
from patchlight.pipeline.output import file_hash
from patchlight.pipeline.states import make_state, settings_of
from patchlight.pipeline.year_key import of_scene
from patchlight.pipeline.year_parts import electric_schedules
from patchlight.pipeline.year_store import key_of
from patchlight.reports import write_year
from patchlight.reports.lm83 import in_states
from patchlight.solver import daylit
from patchlight.solver.errors import InputError, OutOfMemoryError
from patchlight.solver.memory import available_bytes, limited, used_bytes
from patchlight.solver.store import STORE
from patchlight.solver.year_memory import YearMemory

from ..importers.weather_files import epw_text
from .test_webs import ldt
from .window_room import level, quad, window_room

POINTS = [(x, y, 0.8) for x in (-1.0, 0.0, 1.0) for y in (0.6, 1.6, 2.6)]


def room():
    scene = window_room(4.0, 3.0, 0.5)
    scene.ground = Ground(0.2)
    scene.add(SensorGrid(POINTS, (0, 0, 1), name="desk"))
    return scene


def half_blinds(scene):
    """Two blinds, each before one half of the opening, and two window groups of them."""
    for name, (a, b) in {"west": (-1.0, 0.0), "east": (0.0, 1.0)}.items():
        at = quad((a, -0.01, 1), (b, -0.01, 1), (b, -0.01, 2), (a, -0.01, 2))
        scene.add(at, f"blind {name}", two_sided=True)
        scene.assign(f"blind {name}", Material(0.5))
        scene.add_state(f"{name} up", group=name)
        scene.add_state(f"{name} down", present=f"blind {name}", group=name)
    return scene


@pytest.fixture(scope="module")
def weather_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("weather") / "two_days.epw"
    path.write_text(epw_text(days=2), encoding="ascii", newline="")
    return path


@pytest.fixture(scope="module")
def whole(weather_file):
    return simulate_year(room(), weather_file, accuracy=0.2)


def test_some_sensors_at_a_time_get_the_light_of_all(weather_file, whole, tmp_path, monkeypatch):
    """But for surfaces that hardly matter, which are others: `beams.LEFT_OUT`, a thousandth."""
    monkeypatch.setattr(daylit, "SENSORS", 4)
    monkeypatch.setattr(daylit, "BLOCK_BYTES", 1)
    told = []
    with simulate_year(
        room(),
        weather_file,
        accuracy=0.2,
        out=tmp_path / "a.nc",
        progress=lambda s, d, t: told.append((s, d, t)),
    ) as found:
        assert ("year", 0, 3) in told and ("year", 2, 3) in told
        for name in ("illuminance", "sun_illuminance", "daylight_factor", "sunlight_hours"):
            values, own = found[name].values, whole[name].values
            np.testing.assert_allclose(values, own, rtol=2e-3, atol=2e-3 * own.max())
        assert found.attrs["sun_indirect_error"] == pytest.approx(
            whole.attrs["sun_indirect_error"], rel=0.05
        )


def test_memory_is_told_and_refused(weather_file):
    with pytest.raises(OutOfMemoryError, match=r"9 sensors on \d+ elements needs 0\.\d GB"):
        simulate_year(room(), weather_file, accuracy=0.2, memory_gb=0.01)

    told = []

    def cut(*words):
        told.append(words)
        if len(told) > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_year(room(), weather_file, accuracy=0.2, progress=cut)
    assert any("GB of memory besides the program" in stage for stage, *_ in told)
    for bad in (0.0, -1.0, float("nan"), "4", True):
        with pytest.raises(InputError, match="memory_gb = "):
            simulate_year(room(), weather_file, accuracy=0.2, memory_gb=bad)


def test_what_is_kept_for_later_runs_gives_way(monkeypatch):
    """It is cleared before a year is refused; here that gives a byte, the last that was missing."""
    year = YearMemory.of(room().freeze(), accuracy=0.2, steps=48, states=1, in_memory=True)
    STORE.put(b"of an earlier run", np.zeros(10))
    free = [year.least - 1]

    def clear():
        free[0] = year.least

    monkeypatch.setattr(STORE, "clear", clear)
    monkeypatch.setattr("patchlight.solver.memory.available_bytes", lambda: free[0])
    year.check()
    assert free[0] == year.least
    monkeypatch.undo()
    STORE.clear()


def test_packed_form_factors_may_be_in_a_file(monkeypatch):
    """What must be memory is less; with less room for both, that is refused."""
    gb = 10**9
    year = YearMemory(
        mesh=20 * gb, least_mesh=gb, packed=8 * gb, block=gb, least_block=gb // 10, result=0,
        elements=60_000, sensors=1000,
    )  # fmt: skip
    disk = [10 * gb]
    monkeypatch.setattr("patchlight.solver.memory.available_bytes", lambda: 2 * gb)
    monkeypatch.setattr("patchlight.solver.memory.free_on_disk", lambda: disk[0])
    year.check()
    assert year.least == 1.1 * gb and year.most == 2 * gb
    disk[0] = 7 * gb
    with pytest.raises(OutOfMemoryError, match=r"needs 1\.1 GB .* and 8\.0 GB of memory or temp"):
        year.check()
    # As many sensors at a time as there is room for, and never fewer than are told of.
    usual = daylit.block_of(10_000, 1)
    each = daylit.bytes_of_sensor(10_000, 1)
    assert usual > 2 * daylit.SENSORS
    assert daylit.block_of(10_000, 1, 50 * gb) == usual
    assert daylit.block_of(10_000, 1, 2 * daylit.SENSORS * each) == 2 * daylit.SENSORS
    assert daylit.block_of(10_000, 1, 0) == daylit.block_of(10_000, 1, -gb) == daylit.SENSORS


def test_memory_grows_with_what_is_kept():
    """Values of all steps count where no file takes them, and a state has as many again."""
    data = room().freeze()
    of = {"accuracy": 0.1, "steps": 8760}
    file = YearMemory.of(data, **of, states=1, in_memory=False)
    own = YearMemory.of(data, **of, states=3, in_memory=True)
    assert file.result == 0 and own.mesh == file.mesh >= file.least_mesh > 0
    assert own.result == 2 * 4 * 3 * 9 * 8760
    scene = room()
    scene.add(SensorGrid(POINTS, (0, 0, 1), name="spectral", spectral=True))
    spectral = YearMemory.of(scene.freeze(), **of, states=1, in_memory=True)
    assert spectral.result == 3 * 4 * 18 * 8760  # melanopic values, too
    assert spectral.block > 2 * file.block  # in twenty bands
    many = SensorGrid(np.tile(POINTS, (2000, 1)), (0, 0, 1), name="many")
    scene = room()
    scene.add(many)
    large = YearMemory.of(scene.freeze(), **of, states=1, in_memory=False)
    # Sensors are done some at a time: their memory does not grow with their number.
    assert file.block < large.block <= max(daylit.BLOCK_BYTES, 64 * large.block / 18009)


def test_a_limit_holds_meanwhile():
    free = available_bytes()
    if free is None or not used_bytes():
        pytest.skip("the system does not tell how much memory there is")
    with limited(1.0):
        assert available_bytes() <= max(0, 1e9 - 0.9 * used_bytes())
        with limited(0.001):
            assert available_bytes() == 0
    with limited(None):
        assert available_bytes() > 0.5 * free


def lamp_room():
    scene = room()
    scene.add(level(0.3, 2.9, up=False), "lamp")
    scene.assign("lamp", Emitter(flux_lm=3000.0, group="ceiling"))
    return scene


def test_electric_light_beside_daylight(weather_file, whole):
    """It is that of a simulation by night, and daylight is as without it."""
    scene = lamp_room()
    found = simulate_year(scene, weather_file, accuracy=0.2, electric={"ceiling": "17:00-20:00"})
    lux = found["electric_illuminance"]
    assert lux.dims == ("lamps", "sensor") and lux.attrs["units"] == "lx"
    assert found["lamps"].values.tolist() == ["ceiling"]
    night = dataclasses.replace(scene.freeze(), ground=None)
    own = simulate(night, accuracy=0.2).sensors["desk"]
    np.testing.assert_allclose(lux.values[0], own.illuminance_lx, rtol=1e-9)
    on = found["electric_on"].values[0]
    assert [str(t)[11:16] for t in found["time"].values[on]] == 2 * ["17:00", "18:00", "19:00"]
    assert found.attrs["electric"] == "ceiling 17:00-20:00"
    # The lamp is one more surface, a black one.
    light, plain = (year["illuminance"].values.sum() for year in (found, whole))
    assert light == pytest.approx(plain, rel=0.03)
    assert "electric_on" not in simulate_year(lamp_room(), weather_file, accuracy=0.3)


def spectral_room():
    """A reddish floor and two lamps of different white, sensors as eyes have them."""
    scene = room()
    scene.assign("floor", Material((0.6, 0.4, 0.2)))
    for k, (group, cct) in enumerate({"warm": 2700, "cold": 6500}.items()):
        scene.add(level(0.2, 2.9 - 0.1 * k, up=False), group)
        scene.assign(group, Emitter(flux_lm=3000.0, cct_k=cct, group=group))
    scene.add(SensorGrid([(0.0, 1.5, 1.2)], (0, -1, 0), name="eye", spectral=True))
    return scene


def test_melanopic_light_of_a_year(weather_file, tmp_path):
    """In the file as in memory, of lamps as simulations by night have it, and told in metrics."""
    given = {"accuracy": 0.3, "electric": {"warm": "always", "cold": "12:00-13:00"}}
    own = simulate_year(spectral_room(), weather_file, **given)
    with simulate_year(spectral_room(), weather_file, out=tmp_path / "a.nc", **given) as file:
        for name in ("melanopic_edi", "electric_melanopic_edi"):
            np.testing.assert_allclose(file[name].values, own[name].values, rtol=1e-6)
        assert file["melanopic_edi"].attrs["spectrum"].startswith("modelled: daylight of 6500 K")
    edi, lux = (own[name].values for name in ("melanopic_edi", "illuminance"))
    day = lux.sum(axis=0) > 0.0
    assert (edi[:, ~day] == 0.0).all() and day.any()
    # 1 lx of daylight of 5500 and 6500 K is 0.905 and 0.996 lx; the floor's red takes some of it.
    ratio = edi[:, day] / lux[:, day]
    assert 0.75 < ratio.min() < 0.9 < ratio.max() < 1.0
    for g, group in enumerate(("warm", "cold")):
        scene = spectral_room()
        other = "cold" if group == "warm" else "warm"
        scene.assign(other, Emitter(flux_lm=0.0, group=other))
        night = dataclasses.replace(scene.freeze(), ground=None)
        found = simulate(night, accuracy=0.3).sensors["eye"].spectral
        told = own["electric_melanopic_edi"].values[g, -1:]
        np.testing.assert_allclose(told, found.melanopic_edi_lx, rtol=1e-6)
    write_year(own, tmp_path, inputs=[])
    rows = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))["metrics"]
    values = {row["id"]: row["value"] for row in rows}
    used = own["occupied"].values
    assert values["eye.EDI_mean_lx"] == pytest.approx(edi[-1, used].mean())
    lamps = own["electric_melanopic_edi"].values.T @ own["electric_on"].values
    whole = (edi + lamps)[-1, used]
    assert values["eye.EDI_mean_with_electric_lx"] == pytest.approx(whole.mean())
    share = 100.0 * (whole >= 250.0).mean()
    assert values["eye.EDI250_mean_with_electric_pct"] == pytest.approx(share)
    lines = (tmp_path / "grids" / "eye.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].endswith("EDI_mean_lx,EDI250_pct")
    # Sensors that ask for no spectrum are another year, whose parts are not taken for these.
    scene = spectral_room()
    plain, asked = of_scene(scene.freeze().without_spectra, True), of_scene(scene.freeze(), True)
    assert key_of(plain) != key_of(asked)
    assert "melanopic_edi" not in simulate_year(room(), weather_file, accuracy=0.3)


def test_electric_light_leaves_what_is_kept_of_the_scene_itself(weather_file):
    """A simulation of it, which a change of its lamps is to follow, stays known as it was."""
    scene = lamp_room()
    scene.sky = CIESky(5, zenith_luminance_cd_m2=2000.0)
    STORE.clear()
    simulate(scene, accuracy=0.2)
    before = {key: value for key, (value, _) in STORE._values.items()}
    assert before
    simulate_year(scene, weather_file, accuracy=0.2, electric={"ceiling": "always"})
    for key, value in before.items():
        found = STORE.get(key)
        assert found is value or np.array_equal(found, value)  # the same surfaces, kept again
    STORE.clear()


def test_lamps_with_profiles_by_functions(weather_file):
    """They light the room, and a run that was cut is known again by what they return."""

    def keys(*functions):
        out = []
        for function in functions:
            scene = lamp_room()
            scene.assign("lamp", Emitter(flux_lm=3000.0, group="ceiling", profile=function))
            out.append(key_of(of_scene(scene.freeze(), True)))
        return out

    plain, same, other = keys(
        lambda points: 1.0 + points[:, 0] ** 2,
        lambda points: 1.0 + points[:, 0] * points[:, 0],
        lambda points: 1.0 + points[:, 1] ** 2,
    )
    assert plain == same != other
    scene = lamp_room()
    scene.assign("lamp", Emitter(flux_lm=3000.0, group="ceiling", profile=lambda points: 1.0))
    lux = simulate_year(scene, weather_file, accuracy=0.3, electric={"ceiling": "always"})
    even = simulate_year(lamp_room(), weather_file, accuracy=0.3, electric={"ceiling": "always"})
    name = "electric_illuminance"
    np.testing.assert_allclose(lux[name].values, even[name].values, rtol=1e-6)


def test_photometric_files_of_lamps_that_burn_are_told(weather_file, tmp_path):
    scene = room()
    for k, group in enumerate(("flood", "spot")):
        path = tmp_path / f"{group}.ldt"
        path.write_text(ldt(flux=1000.0 * (k + 1)))
        scene.add(level(0.1, 2.7 + 0.1 * k, up=False), group)
        scene.assign(group, Emitter(photometry=path, group=group))
    for electric, expected in (({"spot": "always"}, [path]), (None, [])):
        year = simulate_year(scene, weather_file, accuracy=0.3, electric=electric)
        write_year(year, tmp_path, inputs=[])
        record = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
        assert record["photometry"] == [
            {"path": str(one), "sha256": file_hash(one)} for one in expected
        ]
        assert "photometry" not in record["settings"]


def test_schedules_of_lamps():
    data = lamp_room().freeze()
    clock = np.datetime64("2001-01-01T00:00", "m") + 60 * np.arange(24)
    found = electric_schedules({"ceiling": "always"}, [data], clock, 60)
    assert found["ceiling"].all()
    found = electric_schedules({"ceiling": "20:00-22:00"}, [data], clock, 60)
    assert np.flatnonzero(found["ceiling"]).tolist() == [20, 21]
    assert electric_schedules(None, [data], clock, 60) == {}


@pytest.mark.parametrize(
    ("electric", "message"),
    [
        ({"floor": "always"}, "no lamps in a light group 'floor'; groups: ceiling"),
        ({"ceiling": "by night"}, "electric: ceiling: .*like 08:00-18:00.* or 'always'"),
    ],
)
def test_bad_electric_light(weather_file, electric, message):
    with pytest.raises(InputError, match=message):
        simulate_year(lamp_room(), weather_file, accuracy=0.2, electric=electric)


def test_settings_of_window_groups():
    states = [make_state(n, None, None, g) for n, g in (("a1", "a"), ("b1", "b"), ("a2", "a"))]
    found = [(s.name, s.states, s.group) for s in settings_of(states)]
    assert found == [("a1 + b1", ("a1", "b1"), ""), ("a2", ("a2", "b1"), "a")]
    alone = settings_of([make_state(n, None, None) for n in ("up", "down")])
    assert [(s.name, s.states, s.group) for s in alone] == [
        ("up", ("up",), ""), ("down", ("down",), ""),
    ]  # fmt: skip
    with pytest.raises(InputError, match="'c': has no group, but others have"):
        settings_of([*states, make_state("c", None, None)])
    with pytest.raises(InputError, match="group = 3"):
        make_state("c", None, None, 3)


def test_light_through_window_groups_adds(weather_file):
    """With both blinds down the sum of what each keeps back is what they keep back together.

    Exact for direct light. Of reflected light what one blind sends back of the light through the
    other is left out: 1 m² in a room of 80 m² that absorbs half, a hundredth and less. Meshes are
    coarse, and the light of single steps differs by that; of days it is told.
    """
    year = simulate_year(half_blinds(room()), weather_file, accuracy=0.1)
    assert year["state"].values.tolist() == ["west up + east up", "west down", "east down"]
    assert year["window_group"].values.tolist() == ["", "west", "east"]
    count = year.sizes["time"]
    shut = np.stack([np.full(count, 1), np.full(count, 2)])
    scene = half_blinds(room())
    scene.states.clear()
    both = simulate_year(scene, weather_file, accuracy=0.1)
    sun, own = year["sun_illuminance"].values, both["sun_illuminance"].values
    np.testing.assert_allclose(in_states(sun, shut), own, atol=1e-6 * sun.max())
    light = year["illuminance"].values
    found, own = (values.sum(axis=1) for values in (in_states(light, shut), both["illuminance"]))
    np.testing.assert_allclose(found, own, atol=0.02 * light[0].sum(axis=1).max())
    assert (own < 0.1 * light[0].sum(axis=1)).all()


def test_hours_of_sun_of_a_day(weather_file):
    """In the open half a day at the equinox; behind the window those in which the sun comes in."""
    scene = room()
    scene.add(SensorGrid([(0.0, -50.0, 10.0)], (0, 0, 1), name="roof"))
    found = simulate_year(scene, weather_file, accuracy=0.3)["sunlight_hours"].values
    # Without refraction, and with the middle of the disc as horizon, within steps of 5 minutes.
    assert found[-1] == pytest.approx(12.0, abs=0.2)
    assert 0.0 < found[3] < 8.0  # 0.6 m behind the opening, in the middle
    high = simulate_year(
        scene, weather_file, sensors="roof", accuracy=0.3, sun_day="06-21", sun_above_deg=30.0
    )["sunlight_hours"].values
    # Of the hour angle, with latitude φ and declination δ: (sin 30° − sin φ sin δ) / (cos φ cos δ).
    phi, delta = np.radians([48.0, 23.44])
    angle = np.arccos((0.5 - np.sin(phi) * np.sin(delta)) / (np.cos(phi) * np.cos(delta)))
    assert high[0] == pytest.approx(np.degrees(angle) * 2 / 15, abs=0.15)
    for bad in ({"sun_day": "02-30"}, {"sun_day": "21 March"}, {"sun_above_deg": 95.0}):
        with pytest.raises(InputError, match="sun_"):
            simulate_year(scene, weather_file, accuracy=0.3, **bad)
