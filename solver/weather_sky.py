"""The sky and the sun of one moment of a weather file."""

from __future__ import annotations

import datetime
import math

from .clock import universal_time
from .errors import InputError
from .model.sky import PerezSky, Sun
from .model.weather import Weather
from .perez import sun_of
from .sky_series import suns_in
from .sun_position import nearness


def sky_at(weather: Weather, time: datetime.datetime | str) -> tuple[PerezSky, Sun, str]:
    """Sky and sun of the step of ``weather`` in which ``time`` lies, and that step in words.

    Radiation is the mean over a step, and the sun stands as it does in its middle; where it rises
    or sets meanwhile, in the middle of the part in which it is up.

    Parameters
    ----------
    weather : Weather
        From `read_weather`.
    time : datetime or str
        A moment with an offset, or in local standard time, as the file has it; the year does not
        matter.

    Raises
    ------
    InputError
        For a time of which the file has no step, and where the sun or all light is below the
        horizon.
    """
    zone = datetime.timezone(datetime.timedelta(hours=weather.utc_offset_h))
    if isinstance(time, str):
        time = _parsed(time)
    local = time if time.tzinfo is None else universal_time(time, None).astimezone(zone)
    first = weather.starts[0].astype("datetime64[s]").item()
    try:
        local = local.replace(year=first.year, tzinfo=None)
    except ValueError:
        raise InputError(
            f"{weather.source}: time = {time}: the year of the file has none"
        ) from None
    minutes = (local - first).total_seconds() / 60.0
    step = math.floor(minutes / weather.step_minutes)
    if not 0 <= step < len(weather):
        last = weather.starts[-1].astype("datetime64[s]").item()
        raise InputError(
            f"{weather.source}: time = {time}: the file has steps from {first:%m-%d %H:%M} to "
            f"{last:%m-%d %H:%M}"
        )
    begin = weather.starts[step].astype("datetime64[s]").item()
    altitude, azimuth, part = suns_in(weather, [step])
    told = f"step of {weather.step_minutes} min from {begin:%m-%d %H:%M} local standard time"
    if 0.0 < part[0] < 1.0:
        told += f", the sun being up for {part[0]:.0%} of it"
    diffuse = float(weather.diffuse_horizontal_w_m2[step])
    if altitude[0] <= 0.0 or not diffuse > 0.0:
        raise InputError(
            f"{weather.source}: {told}: no daylight: sun at {altitude[0]:.1f} degrees, "
            f"{diffuse:g} W/m² diffuse horizontal"
        )
    dew = float(weather.dew_point_c[step])
    known = {} if math.isnan(dew) else {"dew_point_c": min(max(dew, -90.0), 40.0)}
    sky = PerezSky(
        direct_normal_w_m2=float(weather.direct_normal_w_m2[step]),
        diffuse_horizontal_w_m2=diffuse,
        sun_altitude_deg=float(altitude[0]),
        sun_azimuth_deg=float(azimuth[0]),
        sun_nearness=float(nearness(weather.starts[step : step + 1])[0]),
        **known,  # type: ignore[arg-type]  # a number, which color is not
    )
    return sky, sun_of(sky), told


def _parsed(text: str) -> datetime.datetime:
    try:
        if len(text) <= len("2026-06-21"):
            raise ValueError("a day has no one sun")
        return datetime.datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"time = {text!r}: must be like 2026-06-21T12:00") from None
