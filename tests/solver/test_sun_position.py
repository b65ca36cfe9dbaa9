"""Where the sun stands at a place, by its clocks."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from patchlight.solver.clock import universal_time
from patchlight.solver.errors import InputError
from patchlight.solver.model import Site, Sun
from patchlight.solver.sun_position import sun_positions

BERLIN = Site(52.52, 13.4, timezone="Europe/Berlin")


def test_altitudes():
    """What pvlib's SPA was found to give, to its printed digits; close to noon in the south."""
    times = ["2026-06-21T12:00", "2026-12-21T12:00", "2026-03-20T09:00"]
    altitude, azimuth = sun_positions(Site(51.5, 0.0), np.array(times, dtype="datetime64[s]"))
    np.testing.assert_allclose(altitude, [61.9346, 15.0595, 25.1043], atol=1e-4)
    assert abs(azimuth[0] - 180.0) < 2.0 and azimuth[2] < 135.0


@pytest.mark.parametrize(("latitude", "month"), [(52.5, 6), (-33.9, 12), (0.0, 3), (52.5, 12)])
def test_noon_of_solstices_and_equinoxes(latitude, month):
    """The sun culminates at 90° − |latitude − declination|: the tropic's 23.44°, or none."""
    hours = np.datetime64(f"2026-{month:02d}-21T00:00", "s") + 60 * np.arange(1440)
    altitude, azimuth = sun_positions(Site(latitude, 0.0), hours)
    declination = {6: 23.44, 12: -23.44, 3: 0.2}[month]
    top = int(np.argmax(altitude))
    assert altitude[top] == pytest.approx(90.0 - abs(latitude - declination), abs=0.2)
    if abs(latitude - declination) > 1.0:  # not overhead
        towards = 180.0 if latitude > declination else 0.0
        assert abs((azimuth[top] - towards + 180.0) % 360.0 - 180.0) < 0.5


@pytest.mark.parametrize(
    ("shown", "universal"),
    [
        ("2026-01-15T12:00", "2026-01-15T11:00"),
        ("2026-07-15T12:00", "2026-07-15T10:00"),  # daylight saving
        ("2026-07-15T12:00+00:00", "2026-07-15T12:00"),
        ("2026-07-15T12:00-05:00", "2026-07-15T17:00"),
        ("2026-10-25T02:30", "2026-10-25T00:30"),  # shown twice: the first
    ],
)
def test_clocks(shown, universal):
    expected = datetime.datetime.fromisoformat(universal).replace(tzinfo=datetime.UTC)
    assert universal_time(shown, "Europe/Berlin") == expected
    by_clock = Sun.at(BERLIN, shown, normal_illuminance_lx=8e4)
    by_offset = Sun.at(BERLIN, expected, normal_illuminance_lx=8e4)
    assert by_clock == by_offset


def test_the_second_of_two_hours():
    second = datetime.datetime(2026, 10, 25, 2, 30, fold=1)
    assert universal_time(second, "Europe/Berlin").hour == 1


@pytest.mark.parametrize(
    ("time", "site", "said"),
    [
        ("2026-03-29T02:30", BERLIN, "clocks in Europe/Berlin skip it"),
        ("noon", BERLIN, "time = 'noon': must be like"),
        ("2026-06-21", BERLIN, "time = '2026-06-21': must be like"),
        (12, BERLIN, "time = 12: must be a datetime"),
        ("2026-06-21T12:00", Site(52.5, 13.4), "of which time zone"),
        ("2026-06-21T12:00", Site(52.5, 13.4, timezone="Berlin"), "'Berlin': no such time zone"),
        ("2026-06-21T12:00", Site(52.5, 13.4, timezone="../x"), "no such time zone"),
    ],
)
def test_times_that_are_none(time, site, said):
    with pytest.raises(InputError, match=said):
        Sun.at(site, time, normal_illuminance_lx=8e4)


def test_other_attributes_go_on():
    sun = Sun.at(BERLIN, "2026-06-21T13:00", normal_illuminance_lx=8e4, angular_radius_arcmin=15.9)
    assert sun.angular_radius_arcmin == 15.9 and sun.altitude_deg == pytest.approx(60.9, abs=0.2)
    with pytest.raises(InputError, match="normal_illuminance_lx = -1"):
        Sun.at(BERLIN, "2026-06-21T13:00", normal_illuminance_lx=-1.0)
