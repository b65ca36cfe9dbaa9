"""Clocks, and when a building is used."""

import numpy as np
import pytest
from patchlight.solver.errors import InputError
from patchlight.solver.local_time import clock_times, is_occupied, schedule_minutes

from .fixtures_weather import weather


def test_clocks_of_a_zone_with_daylight_saving():
    winter = weather(first="2001-01-10")
    np.testing.assert_array_equal(clock_times(winter, "Europe/Berlin"), winter.starts)
    summer = weather(first="2001-06-20")
    np.testing.assert_array_equal(
        clock_times(summer, "Europe/Berlin") - summer.starts, np.timedelta64(60, "m")
    )
    np.testing.assert_array_equal(clock_times(summer, None), summer.starts)
    with pytest.raises(InputError, match="Europe/Nowhere"):
        clock_times(summer, "Europe/Nowhere")


def test_a_year_has_3650_hours_of_use():
    year = weather(first="2001-01-01", days=365)
    for zone in (None, "Europe/Berlin"):
        used = is_occupied(clock_times(year, zone), "08:00-18:00", 60)
        assert used.sum() == 3650
    quarters = weather(first="2001-01-01", days=2, step=15)
    assert is_occupied(quarters.starts, "08:15-09:00", 15).sum() == 6


@pytest.mark.parametrize("text", ["8-18", "18:00-08:00", "08:00-25:00", "08:61-18:00", "", None])
def test_bad_schedules(text):
    with pytest.raises(InputError, match="like 08:00-18:00"):
        schedule_minutes(text)
