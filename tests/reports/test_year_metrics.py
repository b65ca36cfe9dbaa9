"""Metrics of a year on tables made up so that each is known."""

import numpy as np
import pytest
from patchlight.reports import year_rows
from patchlight.reports.autonomy import (
    continuous_autonomy,
    daylight_autonomy,
    useful_illuminance,
)
from patchlight.reports.en17037 import (
    daylight_hours,
    highest,
    median_diffuse,
    provision_by_factor,
    provision_by_year,
)
from patchlight.reports.green_credits import (
    OPTION_1,
    OPTION_2,
    USES,
    average_share,
    breeam_hours,
    equinox_steps,
    in_range,
    leed_points,
)
from patchlight.reports.lm83 import blinds_state, in_state, spatial_autonomy, sunlight_exposure
from patchlight.reports.sunlight import is_in_season, sunlight_hours, sunlight_level
from patchlight.solver.errors import InputError

#: Three points in ten steps.
LIGHT = np.array(
    [
        [0, 50, 100, 150, 299, 300, 301, 3000, 3001, 9000],
        [300] * 10,
        [0] * 10,
    ],
    dtype=float,
)
ALL = np.ones(10, bool)
AREA = np.array([1.0, 2.0, 1.0])


def test_autonomy():
    np.testing.assert_allclose(daylight_autonomy(LIGHT, ALL), [0.5, 1.0, 0.0])
    np.testing.assert_allclose(daylight_autonomy(LIGHT, ALL, 301.0), [0.4, 0.0, 0.0])
    expected = (0 + 50 + 100 + 150 + 299 + 5 * 300) / 3000
    np.testing.assert_allclose(continuous_autonomy(LIGHT, ALL), [expected, 1.0, 0.0])
    some = np.arange(10) >= 5
    np.testing.assert_allclose(daylight_autonomy(LIGHT, some), [1.0, 1.0, 0.0])
    assert np.isnan(daylight_autonomy(LIGHT, np.zeros(10, bool))).all()
    with pytest.raises(InputError, match="threshold_lx = 0"):
        daylight_autonomy(LIGHT, ALL, 0.0)


def test_useful_illuminance():
    """Bounds belong to the upper bin, but 3000 lx is still useful."""
    found = useful_illuminance(LIGHT, ALL)
    np.testing.assert_allclose(found[:, 0], [0.2, 0.3, 0.3, 0.2])
    np.testing.assert_allclose(found[:, 1], [0, 0, 1, 0])
    np.testing.assert_allclose(found.sum(axis=0), 1.0)
    with pytest.raises(InputError, match="rise"):
        useful_illuminance(LIGHT, ALL, (300.0, 100.0, 3000.0))


def test_spatial_autonomy_and_its_operators():
    assert spatial_autonomy(LIGHT, AREA, ALL) == 0.75
    assert spatial_autonomy(LIGHT, AREA, ALL, level=">") == 0.0  # 300 lx are not more than 300 lx
    assert spatial_autonomy(LIGHT, AREA, ALL, time=">") == 0.5  # half is not more than half
    with pytest.raises(InputError, match="operator '<'"):
        spatial_autonomy(LIGHT, AREA, ALL, level="<")


def test_sunlight_exposure_and_its_operators():
    sun = np.zeros((3, 300))
    sun[0, :250], sun[1, :251], sun[2, :] = 1001.0, 1001.0, 1000.0
    used = np.ones(300, bool)
    assert sunlight_exposure(sun, AREA, used, 1.0) == 0.5
    assert sunlight_exposure(sun, AREA, used, 1.0, time=">=") == 0.75
    assert sunlight_exposure(sun, AREA, used, 1.0, level=">=", time=">=") == 1.0
    assert sunlight_exposure(sun, AREA, used, 0.5) == 0.0  # of half an hour each
    assert sunlight_exposure(sun, AREA, np.zeros(300, bool), 1.0) == 0.0


def test_blinds_close_where_more_than_two_percent_are_exposed():
    open_ = np.zeros((100, 4))
    open_[:2, 1], open_[:3, 2], open_[:, 3] = 1001.0, 1001.0, 1000.0
    half, closed = open_.copy(), np.zeros((100, 4))
    half[:, 2] = 0.0
    assert blinds_state(np.stack([open_, closed])).tolist() == [0, 0, 1, 0]
    stacked = np.stack([open_, np.full((100, 4), 2000.0), half])
    assert blinds_state(stacked).tolist() == [0, 0, 2, 0]
    values = np.stack([np.full((2, 4), 1.0), np.full((2, 4), 2.0)])
    np.testing.assert_array_equal(in_state(values, np.array([0, 1, 1, 0]))[1], [1, 2, 2, 1])


def test_daylight_hours_are_half_a_year():
    sky = np.tile(np.concatenate([np.zeros(10), np.arange(1.0, 15.0)]), 365)
    counted = daylight_hours(sky, 1.0)
    assert counted.sum() == 4380
    assert sky[counted].min() >= sky[~counted].max()
    assert median_diffuse(sky, 1.0) == 8.5  # 12 hours a day: 3 … 14
    assert daylight_hours(np.repeat(sky, 2), 0.5).sum() == 8760


def test_orders_of_en17037_differ():
    """Of two halves each is lit in its own half of the time: by hours always, by points never."""
    light = np.zeros((4, 8760))
    light[:2, 0:8760:4] = light[2:, 2:8760:4] = 800.0
    light[:, 1::2] = 0.0
    sky = np.zeros(8760)
    sky[::2] = 1000.0
    area = np.ones(4)
    by_hour = provision_by_year(light, area, sky, 1.0)
    assert [one.target for one in by_hour] == [1.0, 1.0, 1.0]
    assert [one.minimum for one in by_hour] == [0.0, 0.0, 0.0]
    assert highest(by_hour) is None
    by_point = provision_by_year(light, area, sky, 1.0, order="sensor-first")
    assert [one.target for one in by_point] == [1.0, 1.0, 1.0]  # each just half of the time
    assert [one.minimum for one in by_point] == [1.0, 1.0, 1.0]
    assert highest(by_point) == "high"
    with pytest.raises(InputError, match="order = 'both'"):
        provision_by_year(light, area, sky, 1.0, order="both")


@pytest.mark.parametrize(("level", "low"), [("minimum", 100.0), ("medium", 300.0), ("high", 500.0)])
def test_levels_of_en17037(level, low):
    """Just what a level asks: target on half of the plane, the minimum on the rest."""
    target = {"minimum": 300.0, "medium": 500.0, "high": 750.0}[level]
    light = np.full((20, 8760), low)
    light[:10] = target
    sky = np.linspace(1.0, 2.0, 8760)
    area = np.ones(20)
    for order in ("hour-first", "sensor-first"):
        assert highest(provision_by_year(light, area, sky, 1.0, order=order)) == level
    light[19] = 0.0  # 95 % are enough
    assert highest(provision_by_year(light, area, sky, 1.0)) == level
    light[18] = 0.0
    found = provision_by_year(light, area, sky, 1.0)
    assert highest(found) is None
    assert highest(provision_by_year(light, area, sky, 1.0, level_roof=True)) is None


def test_method_1_of_bratislava():
    """The factors printed for 16 300 lx: 0.6, 1.8, 3.1 and 4.6 %."""
    median = 16_300.0
    for level, asked, low in (
        ("minimum", 300.0, 100.0), ("medium", 500.0, 300.0), ("high", 750.0, 500.0),
    ):  # fmt: skip
        factor = np.full(20, low / median)
        factor[:10] = asked / median
        assert highest(provision_by_factor(factor, np.ones(20), median)) == level
    printed = [round(100.0 * lux / median, 1) for lux in (100.0, 300.0, 500.0, 750.0)]
    assert printed == [0.6, 1.8, 3.1, 4.6]
    roof = provision_by_factor(np.full(20, 0.02), np.ones(20), median, level_roof=True)
    assert highest(roof) == "minimum"
    with pytest.raises(InputError, match="median_lx"):
        provision_by_factor(factor, np.ones(20), 0.0)


def test_hours_of_sun():
    normal = np.array([0.0, 5000.0, 20000.0, 80000.0])
    sun = np.array([[0.0, 100.0, 100.0, 0.0], [0.0, 4000.0, 15000.0, 70000.0]])
    np.testing.assert_array_equal(sunlight_hours(sun, normal, 0.5), [1.0, 1.5])
    least = sunlight_hours(sun, normal, 1.0, least_share=0.1, least_normal_lx=11000.0)
    np.testing.assert_array_equal(least, [0.0, 2.0])
    assert [sunlight_level(h) for h in (1.4, 1.5, 3.0, 5.0)] == [None, "minimum", "medium", "high"]
    days = np.array(["2001-01-31", "2001-02-01", "2001-03-21", "2001-03-22"], "datetime64[h]")
    assert is_in_season(days).tolist() == [False, True, True, False]
    leap = np.array(["2004-01-31", "2004-02-01", "2004-03-21", "2004-03-22"], "datetime64[h]")
    assert is_in_season(leap).tolist() == [False, True, True, False]


def test_leed():
    assert [leed_points(share, OPTION_1) for share in (0.39, 0.4, 0.6, 0.75)] == [0, 1, 2, 3]
    assert [leed_points(share, OPTION_2) for share in (0.54, 0.55, 0.75, 0.9)] == [0, 1, 2, 3]
    assert average_share(np.array([1.0, 0.0]), np.array([30.0, 10.0])) == 0.75
    light = np.array([[300.0, 3000.0], [299.0, 3000.0], [300.0, 3001.0]])
    assert in_range(light, AREA) == 0.25


def test_clearest_days_of_the_equinoxes():
    times = np.datetime64("2001-01-01T00", "h") + np.arange(8760)
    sun = np.ones(8760)
    days = times.astype("datetime64[D]")
    # Brighter ones just too far away must not be taken.
    for day, level in (("2001-03-05", 9.0), ("2001-03-06", 5.0), ("2001-09-30", 6.0)):
        sun[days == np.datetime64(day)] = level
    found = equinox_steps(times, sun, 60)
    expected = [["2001-03-06T09", "2001-03-06T15"], ["2001-09-30T09", "2001-09-30T15"]]
    np.testing.assert_array_equal(times[found], np.array(expected, "datetime64[h]"))
    with pytest.raises(InputError, match="lacks days about 2001-03-21"):
        equinox_steps(times[2000:], sun[2000:], 60)


def test_breeam():
    light = np.zeros((3, 8760))
    light[:, :2000] = 400.0
    light[2, :2000] = 90.0
    mean, least, met = breeam_hours(light, AREA, 1.0, USES["office"])
    assert (mean, least, met) == (2000.0, 2000.0, True)
    assert not breeam_hours(light, AREA, 1.0, USES["retail"])[2]
    light[2, 0] = 89.0
    assert breeam_hours(light, AREA, 1.0, USES["office"])[1:] == (1999.0, False)


def dataset(states=()):
    """A year in which two grids get the same light at all times by day."""
    import xarray as xr

    times = np.datetime64("2001-01-01T00", "h") + np.arange(8760)
    hour = np.arange(8760) % 24
    day = (hour >= 6) & (hour < 18)
    light = np.where(day, 400.0, 0.0) * np.array([1.0, 1.0, 0.5])[:, None]
    sun = np.where(day & (hour == 12), 2000.0, 0.0) * np.array([1.0, 0.0, 0.0])[:, None]
    dims = ("sensor", "time")
    if states:
        dims = ("state", *dims)
        light, sun = np.stack([light, 0.5 * light]), np.stack([sun, 0.0 * sun])
    sky = np.where(day, 10_000.0, 0.0)
    return xr.Dataset(
        {
            "illuminance": (dims, light.astype(np.float32)),
            "sun_illuminance": (dims, sun.astype(np.float32)),
            "sky_horizontal": ("time", sky),
            "sun_normal": ("time", 0.1 * sky),
        },
        coords={
            "time": times.astype("datetime64[ns]"),
            "clock": ("time", times.astype("datetime64[ns]")),
            "occupied": ("time", (hour >= 8) & (hour < 18)),
            "grid": ("sensor", np.array(["near", "near", "far"], dtype=object)),
            "area": ("sensor", [1.0, 3.0, 1.0]),
            **({"state": list(states)} if states else {}),
        },
        attrs={"step_minutes": 60},
    )


def test_rows_of_grids():
    found = {row["id"]: row["value"] for row in year_rows(dataset())}
    assert found["near.sDA300_50_pct"] == 100.0
    assert found["far.sDA300_50_pct"] == 0.0
    assert found["near.ASE1000_250h_pct"] == 25.0
    assert found["near.light_exposure_klx_h"] == pytest.approx(0.4 * 4380)
    assert found["near.EN17037_hour_first_level"] == "minimum"
    assert found["far.EN17037_hour_first_level"] == "none"
    assert found["near.LEED_option_2_points"] == 3
    assert found["near.BREEAM_office"] == "met"
    assert found["far.DA300_mean_pct"] == 0.0
    assert found["far.UDI_supplementary_mean_pct"] == 100.0


def test_rows_with_blinds():
    """They are down at noon, in the grid with sun: a tenth of the hours of use."""
    found = {row["id"]: row["value"] for row in year_rows(dataset(("open", "closed")))}
    assert found["near.DA300_mean_pct"] == pytest.approx(90.0)
    assert found["near.blinds_not_in_first_state_pct"] == pytest.approx(10.0)
    assert found["near.ASE1000_250h_pct"] == 25.0  # with blinds open
    assert found["far.blinds_not_in_first_state_pct"] == 0.0


def test_part_of_a_year_has_no_metrics_of_a_year():
    found = {row["quantity"] for row in year_rows(dataset().isel(time=slice(0, 240)))}
    assert "DA300_mean_pct" in found
    assert not any(name.startswith(("EN17037", "BREEAM", "LEED", "ASE", "sDA")) for name in found)
    with pytest.raises(InputError, match="lacks illuminance"):
        year_rows(dataset().drop_vars("illuminance"))
