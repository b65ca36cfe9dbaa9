"""Weather files: what is in them, where the sun stands meanwhile, what is wrong with bad ones."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from patchlight.pipeline import Weather, read_weather
from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.model import Site
from patchlight.solver.sun_position import sun_positions

from .weather_files import epw_text, moments, radiation

CORPUS = os.environ.get("PATCHLIGHT_CORPUS")


def read(tmp_path: Path, text: str) -> Weather:
    path = tmp_path / "a.epw"
    path.write_text(text, encoding="utf-8")
    return read_weather(path)


def replaced(line: int, field: int, value: object):
    """A change of one value of the data; both numbers count from 1."""

    def change(lines: list[str]) -> list[str]:
        words = lines[line - 1].split(",")
        words[field - 1] = str(value)
        return [*lines[: line - 1], ",".join(words), *lines[line:]]

    return change


@pytest.mark.parametrize(
    ("latitude", "longitude", "zone"),
    [(48.0, 9.0, 1.0), (-33.9, 151.2, 10.0), (28.6, 77.2, 5.5), (37.7, -122.2, -8.0)],
)
@pytest.mark.parametrize("step", [60, 15])
def test_the_middle_of_each_step_is_where_its_light_is_from(
    tmp_path, latitude, longitude, zone, step
):
    """Light is made for the middles of the steps: it closes only when they are read as such."""
    text = epw_text(latitude=latitude, longitude=longitude, zone=zone, step=step)
    weather = read(tmp_path, text)
    assert len(weather) == 3 * 1440 // step and weather.step_minutes == step
    site = Site(latitude, longitude)
    expected = radiation(site, zone, moments(3, step), step)
    np.testing.assert_allclose(weather.direct_normal_w_m2, expected[0], rtol=1e-5, atol=1e-3)
    height = np.sin(np.radians(sun_positions(weather.site, weather.middles_utc)[0]))
    level = weather.direct_normal_w_m2 * np.maximum(height, 0.0) + weather.diffuse_horizontal_w_m2
    np.testing.assert_allclose(level, expected[2], rtol=1e-4, atol=1e-2)
    # The middle of daylight is noon by the sun, within what a step and the equation of time are.
    noon = np.average(np.arange(len(weather)) % (1440 // step) + 0.5, weights=expected[2])
    by_clock = 12.0 + zone - longitude / 15.0
    assert abs(noon * step / 60.0 - by_clock) < 0.2
    assert weather.utc_offset_h == zone and weather.remarks == (
        "the file covers 3 days, no whole year",
        "direct_normal_illum is not in the file",
        "diffuse_horizontal_illum is not in the file",
    )


def test_months_of_different_years_make_one(tmp_path):
    def years(lines):
        return [f"{1980 + k // 730}" + line[4:] for k, line in enumerate(lines)]

    weather = read(tmp_path, epw_text(days=365, first=(1, 1), rows=years))
    assert weather.whole_year and len(weather) == 8760
    assert (np.diff(weather.starts) == np.timedelta64(60, "m")).all()
    assert str(weather.starts[0]) == "2001-01-01T00:00"


def test_leap_years_with_and_without_their_day(tmp_path):
    with_day = read(tmp_path, epw_text(days=366, year=2004, first=(1, 1)))
    assert with_day.whole_year and len(with_day) == 8784

    def without(lines):
        return [line for line in lines if not line.startswith("2004,2,29,")]

    weather = read(tmp_path, epw_text(days=366, year=2004, first=(1, 1), rows=without))
    assert weather.whole_year and len(weather) == 8760


def test_polar_night_is_dark(tmp_path):
    weather = read(tmp_path, epw_text(latitude=78.0, longitude=15.0, first=(12, 1), days=10))
    assert not weather.direct_normal_w_m2.any() and not weather.diffuse_horizontal_w_m2.any()


@pytest.mark.parametrize("field", [15, 16])  # direct, diffuse
def test_radiation_is_told_from_the_global_one(tmp_path, field):
    lines = epw_text().splitlines()[8:]
    noon = 12
    change = replaced(noon, field, 9999)
    weather = read(tmp_path, epw_text(rows=change))
    stated = float(lines[noon - 1].split(",")[field - 1])
    found = (weather.direct_normal_w_m2, weather.diffuse_horizontal_w_m2)[field - 15][noon - 1]
    assert found == pytest.approx(stated, rel=1e-3)
    assert any("1 steps is told from the global" in r for r in weather.remarks)


def test_a_few_steps_are_filled_and_many_are_not(tmp_path):
    def lacking(first, last):
        def change(lines):
            for k in range(first, last + 1):
                for field in (14, 15, 16):
                    lines = replaced(k, field, 9999)(lines)
            return lines

        return change

    weather = read(tmp_path, epw_text(rows=lacking(12, 13)))
    assert any("2 steps is told from their neighbours" in r for r in weather.remarks)
    line = np.interp([12, 13], [11, 14], weather.direct_normal_w_m2[[10, 13]])
    np.testing.assert_allclose(weather.direct_normal_w_m2[[11, 12]], line)
    with pytest.raises(InputError, match=r"a\.epw: line 1\d: dni or dhi is missing .* 24 at most"):
        read(tmp_path, epw_text(rows=lacking(1, 72)))


def test_stated_illuminances(tmp_path):
    def change(lines):
        return [replaced(1, 18, 50000)(replaced(1, 19, 12000)([line]))[0] for line in lines]

    weather = read(tmp_path, epw_text(rows=change))
    assert (weather.direct_normal_lx == 50000).all()
    assert (weather.diffuse_horizontal_lx == 12000).all()


def test_what_is_not_essential_is_taken_for_missing(tmp_path):
    weather = read(tmp_path, epw_text(rows=replaced(12, 33, 7)))
    said = "line 20: albedo = 7.0: must be a number from 0 to 1; taken for missing in 1 steps"
    assert weather.remarks[0] == said
    assert np.isnan(weather.albedo[11]) and weather.albedo[10] == 0.2


def test_files_without_direct_radiation(tmp_path):
    """All of it is told from the global one, and so is what comes in the evening."""

    def change(lines):
        return [replaced(1, 15, 9999)([line])[0] for line in lines]

    whole = read(tmp_path, epw_text(days=20))
    weather = read(tmp_path, epw_text(days=20, rows=change))
    altitude, _ = sun_positions(whole.site, whole.middles_utc)
    up = altitude > 3.0
    np.testing.assert_allclose(
        weather.direct_normal_w_m2[up], whole.direct_normal_w_m2[up], rtol=1e-3, atol=0.1
    )
    level = [
        w.diffuse_horizontal_w_m2
        + w.direct_normal_w_m2 * np.sin(np.radians(np.maximum(altitude, 0)))
        for w in (whole, weather)
    ]
    np.testing.assert_allclose(level[1], level[0], atol=0.1)


def test_a_part_of_a_leap_year_keeps_its_year(tmp_path):
    weather = read(tmp_path, epw_text(year=2020, first=(6, 1)))
    assert str(weather.starts[0]) == "2020-06-01T00:00"


def test_a_zone_of_the_wrong_sign_is_told(tmp_path):
    """Light is made right for the zone, and the file says another longitude."""
    text = epw_text(longitude=-122.0, zone=-8.0, days=365, first=(1, 1))
    weather = read(tmp_path, text.replace(",-122.0,-8.0,", ",122.0,-8.0,"))
    assert "time zone UTC-8 h at longitude 122°" in weather.remarks[0]
    assert any("of the global one: place" in remark for remark in weather.remarks)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1 does not begin with LOCATION"),
        (epw_text().replace("LOCATION", "PLACE"), "line 1 does not begin with LOCATION"),
        (epw_text().replace(",48.0,", ",148.0,", 1), "line 1: Site.latitude_deg = 148"),
        (epw_text().replace(",9.0,1.0", ",nine,1.0", 1), "line 1: longitude = 'nine': no number"),
        (epw_text().replace(",1.0,400", ",25,400", 1), "line 1: time zone = 25: must lie"),
        (epw_text().replace("DATA PERIODS", "DATA", 1), "no line DATA PERIODS"),
        (epw_text().replace("PERIODS,1,1", "PERIODS,2,1", 1), "2 data periods: must be 1"),
        (epw_text().replace("PERIODS,1,1", "PERIODS,1,7", 1), "7 records an hour"),
        ("\n".join(epw_text().splitlines()[:8]), "no data after the 8 lines"),
        (epw_text()[:3000], r"line \d+ has \d+ values: must have 25"),
        (epw_text(rows=lambda r: r[:10] + r[11:]), "line 19: .* must be 60 min later"),
        (epw_text(rows=lambda r: r[:10] + r[9:]), "line 19: .* must be 60 min later"),
        (epw_text(rows=lambda r: r[::-1]), "line 10: .* must be 60 min later"),
        (epw_text(rows=replaced(12, 15, "x")), "line 20: dni = x: must be a number from 0"),
        (
            epw_text(rows=replaced(12, 15, 5000)),
            "line 20: dni = 5000.0: must be a number",
        ),
        (
            epw_text(rows=replaced(12, 16, -50)),
            "line 20: dhi = -50.0: must be a number",
        ),
        (
            epw_text(rows=replaced(12, 2, 13)),
            "line 20: month = '13': must be a whole number from 1",
        ),
        (epw_text(rows=replaced(12, 4, "x")), "line 20: hour = 'x': must be"),
        ("\0" + epw_text(), "this is no text file"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, text)
    assert "a.epw" in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(MissingFileError, match=r"no\.epw: no such file"):
        read_weather(tmp_path / "no.epw")


@pytest.mark.skipif(not CORPUS, reason="PATCHLIGHT_CORPUS is not set")
def test_a_typical_year_from_the_corpus():
    weather = read_weather(next(Path(str(CORPUS), "weather").glob("*Oakland*.epw")))
    assert weather.whole_year and weather.site.latitude_deg == 37.72 and weather.utc_offset_h == -8
    # Line 19 of the file: 11 o'clock of 1 January.
    assert weather.direct_normal_w_m2[10] == 712.0 and weather.diffuse_horizontal_w_m2[10] == 95.0
    assert weather.diffuse_horizontal_lx is not None and weather.diffuse_horizontal_lx[10] == 12535
    assert weather.remarks == ()
    # Light comes while the sun is up.
    altitude, _ = sun_positions(weather.site, weather.middles_utc)
    assert altitude[weather.direct_normal_w_m2 > 200.0].min() > 0.0
