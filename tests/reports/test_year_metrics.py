"""Metrics of a year on tables made up so that each is known."""

import numpy as np
import pytest
from patchlight.reports import write_year, year_remarks, year_rows
from patchlight.reports.autonomy import (
    continuous_autonomy,
    daylight_autonomy,
    useful_illuminance,
)
from patchlight.reports.en17037 import (
    YearProvision,
    daylight_hours,
    highest,
    median_diffuse,
    provision_by_factor,
)
from patchlight.reports.green_credits import (
    OPTION_1,
    OPTION_2,
    USES,
    Climate,
    ClimateHours,
    average_share,
    equinox_steps,
    in_range,
    leed_points,
)
from patchlight.reports.lm83 import (
    blinds_states,
    exposed_hours,
    exposed_points,
    group_rows,
    in_states,
    spatial_autonomy,
    sunlight_exposure,
)
from patchlight.reports.sunlight import is_in_season, sunlight_hours, sunlight_level
from patchlight.reports.year_names import metric_name
from patchlight.reports.year_tables import light_errors
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
    shares = daylight_autonomy(LIGHT, ALL)
    assert spatial_autonomy(shares, AREA) == 0.75
    assert spatial_autonomy(shares, AREA, time=">") == 0.5  # half is not more than half
    # 300 lx are not more than 300 lx.
    assert spatial_autonomy(daylight_autonomy(LIGHT, ALL, level=">"), AREA) == 0.0
    assert np.isnan(spatial_autonomy(daylight_autonomy(LIGHT, ~ALL), AREA))
    with pytest.raises(InputError, match="operator '<'"):
        daylight_autonomy(LIGHT, ALL, level="<")


def test_sunlight_exposure_and_its_operators():
    sun = np.zeros((3, 300))
    sun[0, :250], sun[1, :251], sun[2, :] = 1001.0, 1001.0, 1000.0
    used = np.ones(300, bool)
    hours = exposed_hours(sun, used, 1.0)
    assert hours.tolist() == [250.0, 251.0, 0.0]
    assert sunlight_exposure(hours, AREA) == 0.5
    assert sunlight_exposure(hours, AREA, time=">=") == 0.75
    more = exposed_hours(sun, used, 1.0, level=">=")
    assert sunlight_exposure(more, AREA, time=">=") == 1.0
    assert sunlight_exposure(exposed_hours(sun, used, 0.5), AREA) == 0.0  # of half an hour each
    assert sunlight_exposure(exposed_hours(sun, ~used, 1.0), AREA) == 0.0


def chosen(sun, window_group=None):
    """Rows of states in each step, of sun (k, m, n), the points looked at in two parts."""
    names = window_group or [""] * len(sun)
    groups = group_rows(names)
    parts = [exposed_points(sun[:, some], names) for some in (slice(0, 40), slice(40, None))]
    counts = [a + b for a, b in zip(*parts, strict=True)]
    return blinds_states(counts, sun.shape[1], groups)


def test_blinds_close_where_more_than_two_percent_are_exposed():
    open_ = np.zeros((100, 4))
    open_[:2, 1], open_[:3, 2], open_[:, 3] = 1001.0, 1001.0, 1000.0
    half, closed = open_.copy(), np.zeros((100, 4))
    half[:, 2] = 0.0
    assert chosen(np.stack([open_, closed])).tolist() == [[0, 0, 1, 0]]
    stacked = np.stack([open_, np.full((100, 4), 2000.0), half])
    assert chosen(stacked).tolist() == [[0, 0, 2, 0]]
    values = np.stack([np.full((2, 4), 1.0), np.full((2, 4), 2.0)])
    found = in_states(values, np.array([[0, 1, 1, 0]]))
    np.testing.assert_array_equal(found[1], [1, 2, 2, 1])


def test_blinds_of_each_window_group_close_by_the_sun_through_it():
    """South sun in step 1, west sun in step 2, both in step 3, each on other points."""
    south, west = np.zeros((2, 100, 4))
    south[:10, [1, 3]], west[50:60, [2, 3]] = 3000.0, 3000.0
    sun = np.stack([south + west, west, south])  # none closed, south closed, west closed
    names = ["", "south", "west"]
    assert [rows.tolist() for rows in group_rows(names)] == [[0, 1], [0, 2]]
    states = chosen(sun, names)
    assert states.tolist() == [[0, 1, 0, 1], [0, 0, 2, 2]]
    np.testing.assert_array_equal(in_states(sun, states), np.zeros((100, 4)))
    # Light through windows adds: 400 by one and 300 by the other, a tenth of it past blinds.
    light = np.stack([np.full((100, 4), v) for v in (700.0, 340.0, 430.0)])
    np.testing.assert_allclose(in_states(light, states)[0], [700.0, 340.0, 430.0, 70.0])


def test_sun_that_blinds_let_through_closes_no_other_group():
    """A point that gets 600 lx through each of two windows is too bright through none of them."""
    each = np.full((100, 1), 600.0)
    sun = np.stack([2.0 * each, each, each])
    assert chosen(sun, ["", "south", "west"]).tolist() == [[0], [0]]
    assert chosen(sun[:2]).tolist() == [[1]]


def test_sun_through_a_window_without_blinds_closes_no_others():
    """A group of one state has no row of its own: its sun is there in every state."""
    other = np.full((100, 1), 3000.0)
    own = np.concatenate([np.zeros((98, 1)), np.full((2, 1), 5000.0)])
    sun = np.stack([own + other, other])
    assert chosen(sun, ["", "south"]).tolist() == [[0]]
    own[:3] = 2000.0
    assert chosen(np.stack([own + other, other]), ["", "south"]).tolist() == [[1]]


def test_daylight_hours_are_half_a_year():
    sky = np.tile(np.concatenate([np.zeros(10), np.arange(1.0, 15.0)]), 365)
    counted = daylight_hours(sky, 1.0)
    assert counted.sum() == 4380
    assert sky[counted].min() >= sky[~counted].max()
    assert median_diffuse(sky, 1.0) == 8.5  # 12 hours a day: 3 … 14
    assert daylight_hours(np.repeat(sky, 2), 0.5).sum() == 8760


def provision_by_year(light, area, sky, step_h, order="hour-first", level_roof=False):
    """The levels, half of the points being added at a time."""
    year, half = YearProvision(sky, step_h), len(light) // 2
    for some in (slice(0, half), slice(half, None)):
        year.add(light[some], area[some])
    return year.levels(order, level_roof=level_roof)


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
    """It shines from 120 W/m² on."""
    normal = np.array([0.0, 5000.0, 20000.0, 80000.0])
    sun = np.array([[0.0, 100.0, 100.0, 0.0], [0.0, 4000.0, 15000.0, 70000.0]])
    np.testing.assert_array_equal(sunlight_hours(sun, normal, 0.5), [0.5, 1.0])
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


def climate(light, area, use):
    """The points being added one by one."""
    hours = ClimateHours(1.0)
    for k in range(len(light)):
        hours.add(light[k : k + 1], area[k : k + 1])
    return hours.of(USES[use])


def test_breeam():
    light = np.zeros((5, 8760))
    light[:, :2000] = 600.0
    light[4, :2000] = 90.0
    area = np.ones(5)
    assert climate(light, area, "office") == Climate(2000.0, 2000.0, 1.0, True)
    assert not climate(light, area, "retail").met
    light[4, 0] = 89.0  # the worst fifth of the area does not count
    assert climate(light, area, "office") == Climate(2000.0, 2000.0, 0.8, True)
    light[3, 0:2] = 89.0
    found = climate(light, area, "office")
    assert (found.least_h, found.share, found.met) == (1999.0, pytest.approx(0.6), False)
    assert climate(light, area, "education_one_credit").met
    # Of kitchens all of it does, also where the mean has more than it needs.
    light[:, :3450] = 400.0
    assert climate(light, area, "kitchen").met
    light[0, 5] = 29.0
    found = climate(light, area, "kitchen")
    assert (found.mean_h, found.least_h, found.met) == (3450.0, 3449.0, False)


def dataset(states=()):
    """A year in which two grids get the same light at all times by day; of states half as much."""
    import xarray as xr

    times = np.datetime64("2001-01-01T00", "h") + np.arange(8760)
    hour = np.arange(8760) % 24
    day = (hour >= 6) & (hour < 18)
    light = np.where(day, 400.0, 0.0) * np.array([1.0, 1.0, 0.5])[:, None]
    sun = np.where(day & (hour == 12), 2000.0, 0.0) * np.array([1.0, 0.0, 0.0])[:, None]
    dims = ("sensor", "time")
    if states:
        dims = ("state", *dims)
        dimmed = len(states) - 1
        light = np.stack([light, *dimmed * [0.5 * light]])
        sun = np.stack([sun, *dimmed * [0.0 * sun]])
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
            "nz": ("sensor", [1.0, 1.0, 1.0]),
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
    assert found["near.LEED_option_1_sun_to_be_explained"] == "yes"
    assert found["far.LEED_option_1_sun_to_be_explained"] == "no"
    # By area 4 of 5 m² are lit.
    assert found["level grids.sDA300_50_pct"] == 80.0
    assert found["level grids.LEED_option_1_points"] == 3
    assert found["far.DA300_mean_pct"] == 0.0
    assert found["far.UDI_supplementary_mean_pct"] == 100.0


def test_only_work_planes_are_graded():
    """Of a grid of eyes, or of a facade, illuminance and hours of sun are told, and no grades."""
    year = dataset()
    year["nz"][2] = 0.0
    rows = year_rows(year)
    assert not any(row["sensor_id"] == "level grids" for row in rows)
    own = {row["quantity"] for row in rows if row["sensor_id"] == "far"}
    assert own == {"E_mean_lx", "light_exposure_klx_h"}
    (text,) = year_remarks(year)
    assert text.startswith("far: not all points face straight up") and "near is graded" in text
    year["grid"] = "sensor", np.array(["near", "far", "facade"], dtype=object)
    found = {row["id"]: row["value"] for row in year_rows(year)}
    assert found["level grids.sDA300_50_pct"] == 100.0  # the facade has none
    assert found["facade.E_mean_lx"] == pytest.approx(200.0) and "facade.sDA300_50_pct" not in found
    # One point that faces sideways is enough.
    year["grid"] = "sensor", np.array(["all"] * 3, dtype=object)
    assert {row["quantity"] for row in year_rows(year)} == own
    assert "no grid is graded" in year_remarks(year)[0]


def test_every_metric_has_a_name_that_engineers_know():
    year = dataset(("all up", "south down", "east down"))
    year = year.assign_coords(window_group=("state", ["", "south", "east"]))
    year["sunlight_hours"] = "sensor", [1.0, 2.0, 3.0]
    year["daylight_factor"] = "sensor", [0.02, 0.02, 0.02]
    year["electric_illuminance"] = ("state", "lamps", "sensor"), np.ones((3, 1, 3))
    year["electric_on"] = ("lamps", "time"), np.ones((1, 8760), bool)
    year["melanopic_edi"] = 0.9 * year["illuminance"]
    year["electric_melanopic_edi"] = 0.5 * year["electric_illuminance"]
    year = year.assign_coords(lamps=["ceiling_row"])
    year.attrs["sun_day"] = "03-21"
    rows = year_rows(year)
    names = {row["quantity"]: metric_name(row["quantity"]) for row in rows}
    assert len(set(names.values())) == len(names) > 60
    for quantity, name in names.items():
        assert name != quantity and "_" not in name.replace("ceiling_row", "")
    assert names["sDA300_50_pct"] == "Spatial daylight autonomy sDA300/50% (LM-83)"
    assert names["UDI_exceeded_mean_pct"].endswith("exceeded (above 3000 lx), mean")
    assert names["electric_ceiling_row_h"] == "Burning hours of the lamps ceiling_row"
    assert names["EN17037_by_factor_high_target_pct"].endswith(
        "high: area with the factor of 750 lx"
    )
    assert names["blinds_south_not_in_first_state_pct"].startswith("Blinds of south not in")
    for level in ("minimum", "medium", "high"):
        assert metric_name(f"EN17037_view_{level}_pct").endswith(f"level {level} or better")
    assert metric_name("EN17037_view_level") == "View out (EN 17037): level"
    assert metric_name("anything") == "anything"


def test_rows_of_lm83_are_of_its_hours():
    """Of others they are left out, and that is said; nothing else is."""
    year = dataset()
    assert year_remarks(year) == []
    year.attrs["schedule"] = "09:00-17:00"
    hour = np.arange(8760) % 24
    year["occupied"] = "time", (hour >= 9) & (hour < 17)
    lm83 = ("sDA", "ASE", "LEED_option_1")
    told = {row["quantity"] for row in year_rows(dataset())}
    found = {row["quantity"] for row in year_rows(year)}
    assert told - found == {name for name in told if name.startswith(lm83)} and found < told
    (text,) = year_remarks(year)
    assert text.startswith("schedule = 09:00-17:00: sDA, ASE and option 1 of LEED are left out")
    assert year_remarks(year.isel(time=slice(0, 240))) == []  # there are none anyway


def test_rows_with_blinds():
    """They are down at noon, in the grid with sun: a tenth of the hours of use."""
    found = {row["id"]: row["value"] for row in year_rows(dataset(("open", "closed")))}
    assert found["near.DA300_mean_pct"] == pytest.approx(90.0)
    assert found["near.blinds_not_in_first_state_pct"] == pytest.approx(10.0)
    assert found["near.ASE1000_250h_pct"] == 25.0  # with blinds open
    assert found["far.blinds_not_in_first_state_pct"] == 0.0


def test_second_option_of_leed_is_without_blinds():
    """With 2500 lx open and 200 lx behind blinds, which are down at all times."""
    year = dataset(("open", "closed"))
    year["illuminance"][:] = np.array([2500.0, 200.0])[:, None, None]
    year["sun_illuminance"][0] = 2000.0
    found = {row["id"]: row["value"] for row in year_rows(year)}
    assert found["near.blinds_not_in_first_state_pct"] == 100.0
    assert found["near.DA300_mean_pct"] == 0.0
    assert found["near.LEED_option_2_pct"] == 100.0


def test_rows_of_window_groups():
    """Sun at noon through one window, in the first hour of use through the other."""
    year = dataset(("all up", "south down", "east down"))
    year = year.assign_coords(window_group=("state", ["", "south", "east"]))
    hour = np.arange(8760) % 24
    south, east = (np.where(hour == at, 2000.0, 0.0) for at in (12, 8))
    for row, sun in enumerate((south + east, east, south)):
        year["sun_illuminance"][row] = sun
        year["illuminance"][row] = 100.0 + sun
    found = {row["id"]: row["value"] for row in year_rows(year)}
    for name in ("blinds_south", "blinds_east"):
        assert found[f"near.{name}_not_in_first_state_pct"] == pytest.approx(10.0)
    assert found["near.blinds_not_in_first_state_pct"] == pytest.approx(20.0)
    assert found["near.E_mean_lx"] == pytest.approx(100.0)  # no sun ever gets in
    assert found["near.ASE1000_250h_pct"] == 100.0  # but with blinds open
    (text,) = year_remarks(year)
    assert "2 window groups (south, east) is summed" in text
    assert year_remarks(year.isel(state=[0, 1])) == []


def test_rows_do_not_depend_on_how_many_sensors_are_read_at_a_time(monkeypatch):
    year = dataset(("open", "closed"))
    whole = year_rows(year)
    monkeypatch.setattr("patchlight.reports.year_tables.BLOCK", 1)
    assert year_rows(year) == whole


def test_rows_of_what_is_told_besides():
    """Daylight factors, a day of sun, and electric light that burns half of the hours of use."""
    year = dataset()
    year["daylight_factor"] = "sensor", [0.04, 0.02, 0.0]
    year["sunlight_hours"] = "sensor", [3.5, 1.0, 0.0]
    year["lamps"] = "lamps", np.array(["ceiling"], dtype=object)
    year["electric_illuminance"] = ("lamps", "sensor"), [[200.0, 200.0, 100.0]]
    hour = np.arange(8760) % 24
    year["electric_on"] = ("lamps", "time"), ((hour >= 8) & (hour < 13))[None]
    year.attrs["sun_day"] = "03-21"
    found = {row["id"]: row["value"] for row in year_rows(year)}
    assert found["near.DF_mean_pct"] == pytest.approx((4.0 + 3 * 2.0) / 4)
    # Of a median of 10 000 lx 2 % are 200 lx, 4 % are 400 lx.
    assert found["near.EN17037_by_factor_minimum_target_pct"] == pytest.approx(25.0)
    assert found["near.EN17037_by_factor_minimum_minimum_pct"] == pytest.approx(100.0)
    assert found["near.EN17037_by_factor_level"] == "none"
    assert found["near.EN17037_sunlight_03-21_level"] == "medium"
    assert found["near.sunlight_03-21_mean_h"] == pytest.approx((3.5 + 3.0) / 4)
    assert found["far.EN17037_sunlight_03-21_level"] == "none"
    assert found["near.E_mean_lx"] == pytest.approx(400.0)
    assert found["near.E_mean_with_electric_lx"] == pytest.approx(500.0)
    assert found["far.E_mean_with_electric_lx"] == pytest.approx(250.0)
    assert found["near.electric_ceiling_h"] == 5 * 365
    (text,) = year_remarks(year)
    assert text.startswith("EN17037_sunlight_03-21_level: sun_above_deg = 0 counts")
    year.attrs["sun_above_deg"] = 8.0
    assert year_remarks(year) == []
    year.attrs.update(sun_day="06-21", sun_above_deg=0.0)
    assert year_remarks(year) == []
    assert not any("EN17037_sunlight" in row["id"] for row in year_rows(year))


def test_rows_of_melanopic_light():
    """0.7 of 400 and of 200 lx: the nearer grid has enough, the other one with electric light.

    Stated errors of a tenth are those of light of the same colour; 280 lx less a tenth still do.
    """
    year = dataset()
    year["melanopic_edi"] = 0.7 * year["illuminance"]
    year["relative_error"] = "sensor", [0.1, 0.1, 0.1]
    found = {row["id"]: row for row in year_rows(year)}
    assert found["near.EDI_mean_lx"]["value"] == pytest.approx(280.0)
    # What the sun sends straight has no error: at one of two points, a tenth of the hours.
    assert found["near.EDI250_mean_pct"]["value"] == 100.0
    assert found["far.EDI_mean_lx"]["low"] == pytest.approx(126.0)
    assert found["far.EDI_mean_lx"]["high"] == pytest.approx(154.0)
    assert found["far.EDI250_mean_pct"]["value"] == 0.0
    year["lamps"] = "lamps", np.array(["ceiling"], dtype=object)
    year["electric_illuminance"] = ("lamps", "sensor"), [[200.0, 200.0, 200.0]]
    year["electric_melanopic_edi"] = ("lamps", "sensor"), [[120.0, 120.0, 120.0]]
    hour = np.arange(8760) % 24
    year["electric_on"] = ("lamps", "time"), ((hour >= 8) & (hour < 13))[None]
    found = {row["id"]: row["value"] for row in year_rows(year)}
    assert found["far.EDI_mean_with_electric_lx"] == pytest.approx(200.0)
    assert found["far.EDI250_mean_with_electric_pct"] == pytest.approx(50.0)


def test_stated_errors_are_carried_to_the_metrics():
    """A tenth of 250 + 75 lx decides on 300 lx; what the sun sends straight has no error."""
    year = dataset()
    for row in year_rows(year):
        assert row["low"] is None and row["high"] is None  # none are told
    year["illuminance"][:] = 310.0
    year["relative_error"] = "sensor", [0.08, 0.0, 0.02]
    year.attrs["sun_indirect_error"] = 0.03  # hypot(0.08, 0.06) = 0.1
    np.testing.assert_allclose(light_errors(year), [[0.1, 0.06, np.hypot(0.02, 0.06)]])
    year["sun_illuminance"][:] = 0.0
    found = {row["id"]: row for row in year_rows(year)}
    one = found["near.E_mean_lx"]
    spread = 310.0 * (0.1 + 3.0 * 0.06) / 4.0
    assert one["low"] == pytest.approx(310.0 - spread)
    assert one["high"] == pytest.approx(310.0 + spread)
    sda = found["near.sDA300_50_pct"]
    assert (sda["low"], sda["value"], sda["high"]) == (0.0, 100.0, 100.0)
    points = found["near.LEED_option_1_points"]
    assert (points["low"], points["high"]) == (0, 3)
    ase = found["near.ASE1000_250h_pct"]
    assert ase["low"] == ase["value"] == ase["high"] == 0.0
    level = found["near.EN17037_hour_first_level"]
    assert (level["low"], level["high"]) == ("none", "minimum")
    # Of light that is the sun's alone nothing is in doubt.
    year["sun_illuminance"][:] = 310.0
    one = {row["id"]: row for row in year_rows(year)}["near.E_mean_lx"]
    assert one["low"] == one["value"] == one["high"]


def test_page_of_a_year(tmp_path):
    """Of sensors in one place it draws points; without stated errors there are no ranges."""
    year = dataset()
    for key in ("x", "y", "z", "nx", "ny"):
        year[key] = "sensor", [0.0, 0.0, 0.0]
    year = year.assign_coords(nz=("sensor", [1.0, 1.0, 1.0]))
    write_year(year, tmp_path, inputs=[{"path": "a.epw", "sha256": "0" * 64}])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "sDA300_50_pct" in page and "a.epw" in page
    assert page.count("<svg") == 4 and "stated error" not in page


def test_part_of_a_year_has_no_metrics_of_a_year():
    found = {row["quantity"] for row in year_rows(dataset().isel(time=slice(0, 240)))}
    assert "DA300_mean_pct" in found
    assert not any(name.startswith(("EN17037", "BREEAM", "LEED", "ASE", "sDA")) for name in found)
    with pytest.raises(InputError, match="lacks illuminance"):
        year_rows(dataset().drop_vars("illuminance"))
