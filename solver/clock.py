"""Universal time of what clocks show at a place."""

from __future__ import annotations

import datetime
import zoneinfo

from .errors import InputError


def universal_time(time: datetime.datetime | str, timezone: str | None) -> datetime.datetime:
    """Universal time (UTC) of a moment.

    Parameters
    ----------
    time : datetime or str
        A moment with an offset of its own, or as the clocks of the place show it, with daylight
        saving; also as text, such as "2026-06-21T12:00". Of an hour that clocks show twice it is
        the first, unless the datetime has ``fold=1``.
    timezone : str or None
        Name such as Europe/Berlin, for what clocks show.

    Raises
    ------
    InputError
        For text that is no time, an unknown time zone, a time that clocks skip, and what clocks
        show where no time zone is given.
    """
    moment = time
    if isinstance(moment, str):
        try:
            if len(moment) <= len("2026-06-21"):
                raise ValueError("a day has no one sun")
            moment = datetime.datetime.fromisoformat(moment)
        except ValueError:
            raise InputError(f"time = {time!r}: must be like 2026-06-21T12:00") from None
    if not isinstance(moment, datetime.datetime):
        raise InputError(f"time = {time!r}: must be a datetime or text like 2026-06-21T12:00")
    if moment.tzinfo is not None:
        return moment.astimezone(datetime.UTC)
    if timezone is None:
        raise InputError(
            f"time = {time}: of which time zone? Give Site(timezone=…) or a time with its offset"
        )
    try:
        zone = zoneinfo.ZoneInfo(timezone)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
        raise InputError(
            f"Site.timezone = {timezone!r}: no such time zone; names are like Europe/Berlin"
        ) from None
    found = moment.replace(tzinfo=zone).astimezone(datetime.UTC)
    if found.astimezone(zone).replace(tzinfo=None) != moment:
        raise InputError(f"time = {time}: clocks in {timezone} skip it")
    return found
