"""What clocks at a place show, and when a building is used."""

from __future__ import annotations

import datetime
import re
import zoneinfo

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .model.weather import Weather

_SCHEDULE = re.compile(r"(\d{1,2}):(\d{2})-(\d{1,2}):(\d{2})")
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def clock_times(weather: Weather, timezone: str | None) -> NDArray[np.datetime64]:
    """What clocks show (n,) when each step begins.

    With the name of a time zone daylight saving is theirs, in the nominal year of the steps;
    without, it is the local standard time of the file.

    Raises
    ------
    InputError
        For a time zone that is not known.
    """
    if timezone is None:
        return weather.starts
    try:
        zone = zoneinfo.ZoneInfo(timezone)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise InputError(
            f"Site.timezone = {timezone!r}: no such time zone; names are like Europe/Berlin"
        ) from None
    seconds = weather.starts.astype("datetime64[s]").astype(np.int64)
    seconds = seconds - round(3600.0 * weather.utc_offset_h)
    ahead = [
        (_EPOCH + datetime.timedelta(seconds=int(s))).astimezone(zone).utcoffset() for s in seconds
    ]
    shown = seconds + np.array([0 if a is None else a.total_seconds() for a in ahead], np.int64)
    return shown.astype("datetime64[s]").astype("datetime64[m]")


def schedule_minutes(schedule: str) -> tuple[int, int]:
    """Minutes of the day from which and to which a building is used, of text like 08:00-18:00.

    Raises
    ------
    InputError
        If it is not like that, or does not end after it begins.
    """
    found = _SCHEDULE.fullmatch(schedule) if isinstance(schedule, str) else None
    if found is not None:
        a, b, c, d = (int(word) for word in found.groups())
        start, end = 60 * a + b, 60 * c + d
        if b < 60 and d < 60 and 0 <= start < end <= 1440:
            return start, end
    raise InputError(
        f"schedule = {schedule!r}: must be two times of a day, like 08:00-18:00, the second later"
    )


def is_occupied(
    times: NDArray[np.datetime64], schedule: str, step_minutes: int
) -> NDArray[np.bool_]:
    """Whether the middle of each step (n,) that begins at ``times`` by clocks is in ``schedule``.

    Of every day of the week, as LM-83 has it.
    """
    start, end = schedule_minutes(schedule)
    minutes = (times - times.astype("datetime64[D]")).astype("timedelta64[m]").astype(np.float64)
    middle = minutes + 0.5 * step_minutes
    return np.asarray((middle >= start) & (middle < end))
