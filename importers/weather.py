"""Weather files of EnergyPlus (.epw) [1], through pvlib.

What the file says of radiation is the mean over a step; its hour label is the end of the step.

References
----------
.. [1] U.S. Department of Energy, "EnergyPlus Auxiliary Programs", chapter "EnergyPlus Weather File
   (EPW) Data Dictionary".
"""

from __future__ import annotations

import calendar
import hashlib
import io
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import InputError
from patchlight.solver.model import Site, Weather
from patchlight.solver.model.arrays import FloatArray, frozen
from patchlight.solver.sun_position import sun_positions

from .numbers_in_text import read_text

if TYPE_CHECKING:
    from pandas import DataFrame

#: Size of a file, as of a year by minutes. [B]
MAX_BYTES = 200_000_000
#: Lines before the data.
HEAD = 8
#: Values of a line up to the visibility: files of old end there.
FIELDS = 25
#: The first values of a line, and their bounds.
_WHEN = (("year", 1800, 2300), ("month", 1, 12), ("day", 1, 31), ("hour", 1, 24))
#: Missing daylit steps that are filled from their neighbours at most, of a whole file.
FILLED = 24
#: Below this altitude of the sun's middle nothing is missed: the disc has set. [deg]
SET_DEG = -0.5
#: Difference between the longitude of the station and that of its time zone that is told. [h]
ODD_ZONE_H = 3.0
#: Sine of the sun's altitude below which the light of the sun on a level plane does not tell how
#: much there is of it.
LOW = 0.05
#: Closure of global = diffuse + direct · sin γ, of the year's sum, beyond which it is told.
OPEN = 0.1


class Column(NamedTuple):
    """Column of pvlib, its values as stated in the file: from here on missing, and the largest."""

    name: str
    missing: float
    most: float
    least: float = 0.0


_DIRECT, _DIFFUSE = Column("dni", 9999.0, 1500.0), Column("dhi", 9999.0, 1500.0)
_GLOBAL = Column("ghi", 9999.0, 2000.0)
_DIRECT_LX = Column("direct_normal_illum", 999900.0, 200_000.0)
_DIFFUSE_LX = Column("diffuse_horizontal_illum", 999900.0, 200_000.0)
_DEW = Column("temp_dew", 99.9, 70.0, -90.0)
_ALBEDO = Column("albedo", 999.0, 1.0)


def read_weather(path: str | os.PathLike[str]) -> Weather:
    """Weather of an EPW file.

    Steps may be parts of an hour, and the file part of a year. Daylit steps without radiation are
    told from the global one, or else, up to 24 of them, from their neighbours, and said.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    Weather
        Irradiances in W/m² and illuminances in lx, step by step.

    Raises
    ------
    MissingFileError
        If the file is not there or cannot be read.
    InputError
        Naming file, line, column, value and bound: for what is no EPW file, missing, doubled or
        unordered steps, values out of range, and radiation missing in many daylit steps.
    """
    path = Path(path)
    text, raw = read_text(path, MAX_BYTES)
    lines = text.splitlines()
    site, place, offset = _site(path, lines)
    data = _table(path, lines)
    step = _step_minutes(path, lines)
    starts = _starts(path, data, step)
    remarks = []
    if abs(offset - site.longitude_deg / 15.0) > ODD_ZONE_H:
        remarks.append(
            f"time zone UTC{offset:+g} h at longitude {site.longitude_deg:g}° (east is positive): "
            "the sun would be off by hours"
        )
    weather = Weather(
        site=site,
        place=place,
        utc_offset_h=offset,
        step_minutes=step,
        starts=starts,
        direct_normal_w_m2=_values(path, data, _DIRECT),
        diffuse_horizontal_w_m2=_values(path, data, _DIFFUSE),
        direct_normal_lx=None,
        diffuse_horizontal_lx=None,
        dew_point_c=frozen(_values(path, data, _DEW, remarks)),
        albedo=frozen(_values(path, data, _ALBEDO, remarks)),
        source=str(path),
        sha256=hashlib.sha256(raw).hexdigest(),
    )
    return _completed(path, data, weather, remarks)


def _site(path: Path, lines: list[str]) -> tuple[Site, str, float]:
    """Station, its name, and its time zone [h]."""
    words = lines[0].split(",") if lines else [""]
    if words[0].strip().upper() != "LOCATION":
        raise InputError(f"{path}: line 1 does not begin with LOCATION: this is no EPW file")
    if len(words) < 10:
        raise InputError(f"{path}: line 1: LOCATION has {len(words) - 1} fields: must have 9")
    names = ("latitude", "longitude", "time zone", "elevation")
    numbers = []
    for name, word in zip(names, words[6:10], strict=True):
        try:
            numbers.append(float(word))
        except ValueError:
            raise InputError(f"{path}: line 1: {name} = {word.strip()!r}: no number") from None
    latitude, longitude, zone, elevation = numbers
    if not -12.0 <= zone <= 14.0:
        raise InputError(f"{path}: line 1: time zone = {zone:g}: must lie between -12 and 14")
    try:
        site = Site(latitude, longitude, elevation)
    except InputError as error:
        raise InputError(f"{path}: line 1: {error}") from None
    place = ", ".join(w.strip() for w in words[1:4] if w.strip() not in ("", "-"))
    return site, place, zone


def _table(path: Path, lines: list[str]) -> DataFrame:
    """The steps as pvlib reads them, all lines checked to have what is needed."""
    from pvlib.iotools import read_epw

    data = [(k, line) for k, line in enumerate(lines[HEAD:], HEAD + 1) if line.strip()]
    if not data:
        raise InputError(f"{path}: no data after the {HEAD} lines of the head")
    for k, line in data:
        _check_line(path, k, line.split(","))
    whole = "\n".join([*lines[:HEAD], *(line for _, line in data)]) + "\n"
    try:
        table, _ = read_epw(io.StringIO(whole))
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(f"{path}: not readable as an EPW file: {error}") from None
    table["line"] = [k for k, _ in data]
    return table


def _check_line(path: Path, number: int, words: list[str]) -> None:
    """Raise `InputError` unless the line has enough values, and a date and hour that can be."""
    if len(words) < FIELDS:
        raise InputError(f"{path}: line {number} has {len(words)} values: must have {FIELDS}")
    for word, (name, low, high) in zip(words, _WHEN, strict=False):
        if not (word.strip().isdecimal() and low <= int(word) <= high):
            raise InputError(
                f"{path}: line {number}: {name} = {word.strip()!r}: must be a whole number from "
                f"{low} to {high}"
            )


def _step_minutes(path: Path, lines: list[str]) -> int:
    """Length of a step by the line DATA PERIODS. [min]"""
    words = next((s.split(",") for s in lines[:HEAD] if s.upper().startswith("DATA PERIODS")), [])
    if len(words) < 3:
        raise InputError(f"{path}: no line DATA PERIODS in the first {HEAD}")
    periods, records = words[1].strip(), words[2].strip()
    if periods != "1":
        raise InputError(f"{path}: {periods} data periods: must be 1")
    if not records.isdigit() or int(records) not in (1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60):
        raise InputError(f"{path}: {records} records an hour: must part 60 minutes evenly")
    return 60 // int(records)


def _starts(path: Path, data: DataFrame, step: int) -> NDArray[np.datetime64]:
    """When each step begins (n,), all in one year; `InputError` unless they follow one another."""
    year, month, day, hour = (data[c].to_numpy() for c in ("year", "month", "day", "hour"))
    leap = bool(((month == 2) & (day == 29)).any())
    # Typical years put months of different years together, and leave out the day of leap years.
    nominal = int(year[0]) if (year == year[0]).all() else 2001
    whole = bool((month <= 2).any() and (month >= 3).any())
    if calendar.isleap(nominal) != leap and (leap or whole):
        nominal = 2004 if leap else nominal - 1
    months = (month.astype(np.int64) - 1 + 12 * (nominal - 1970)).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (day.astype(np.int64) - 1)
    hours = days.astype("datetime64[m]") + 60 * (hour.astype(np.int64) - 1)
    same = np.flatnonzero(np.diff(hours.astype(np.int64), prepend=-1))  # where hours begin
    nth = np.arange(len(hours)) - np.repeat(same, np.diff(same, append=len(hours)))
    starts = hours + step * nth
    wrong = np.flatnonzero((np.diff(starts).astype(np.int64) != step) | (nth[1:] * step >= 60))
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"{path}: line {data['line'].iloc[k + 1]}: the step at {starts[k + 1]} follows that at "
            f"{starts[k]}: must be {step} min later"
        )
    return frozen(starts, "datetime64[m]")


def _values(
    path: Path, data: DataFrame, column: Column, remarks: list[str] | None = None
) -> FloatArray:
    """Values (n,) of a column, NaN where missing.

    Those that cannot be are errors or, with ``remarks``, missing.
    """
    import pandas as pd

    raw = data[column.name]
    values = np.array(pd.to_numeric(raw, errors="coerce"), dtype=np.float64)
    # A sensor's offset at night is some W/m² below nothing.
    slack = 10.0 if column.least == 0.0 else 0.0
    with np.errstate(invalid="ignore"):
        lacking = values >= column.missing
        odd = ~lacking & ~((values >= column.least - slack) & (values <= column.most))
    odd &= raw.notna().to_numpy()
    if odd.any():
        k = int(np.argmax(odd))
        what = f"line {data['line'].iloc[k]}: {column.name} = {raw.iloc[k]}"
        bound = f"must be a number from {column.least:g} to {column.most:g}"
        if remarks is None:
            raise InputError(f"{path}: {what}: {bound}")
        remarks.append(f"{what}: {bound}; taken for missing in {int(odd.sum())} steps")
    values[lacking | odd] = np.nan
    return np.maximum(values, column.least)


def _completed(path: Path, data: DataFrame, weather: Weather, remarks: list[str]) -> Weather:
    """With what is missing told from what is there, and illuminances where they are stated."""
    altitude, _ = sun_positions(weather.site, weather.middles_utc)
    height = np.sin(np.radians(altitude))
    # A step is daylit when any of it is: the sun climbs by 15 degrees an hour at most.
    day = altitude > SET_DEG - 0.125 * weather.step_minutes
    direct, diffuse = weather.direct_normal_w_m2, weather.diffuse_horizontal_w_m2
    whole = _values(path, data, _GLOBAL)
    _complete(direct, diffuse, whole, height, day, remarks)
    lacking = np.isnan(direct) | np.isnan(diffuse)
    if lacking.any():
        count = int(lacking.sum())
        if count > FILLED or lacking.all():
            raise InputError(
                f"{path}: line {data['line'].iloc[int(np.argmax(lacking))]}: dni or dhi is missing "
                f"here and in {count} daylit steps in all: must be in {FILLED} at most"
            )
        remarks.append(f"radiation of {count} steps is told from their neighbours")
        for values in (direct, diffuse):
            gap, place = np.isnan(values), np.arange(len(values))
            values[gap] = np.interp(place[gap], place[~gap], values[~gap])
    _tell_closure(direct, diffuse, whole, height, remarks)
    if not weather.whole_year:
        days = len(weather) * weather.step_minutes / 1440.0
        remarks.append(f"the file covers {days:g} days, no whole year")
    return replace(
        weather,
        direct_normal_w_m2=frozen(direct),
        diffuse_horizontal_w_m2=frozen(diffuse),
        direct_normal_lx=_illuminance(path, data, _DIRECT_LX, direct, remarks),
        diffuse_horizontal_lx=_illuminance(path, data, _DIFFUSE_LX, diffuse, remarks),
        remarks=tuple(remarks),
    )


def _complete(
    direct: FloatArray,
    diffuse: FloatArray,
    whole: FloatArray,
    height: FloatArray,
    day: NDArray[np.bool_],
    remarks: list[str],
) -> None:
    """Tell direct and diffuse radiation (n,) that is missing from the global one; none by night."""
    for values in (direct, diffuse):
        values[np.isnan(values) & ~day] = 0.0
    level = np.maximum(height, 0.0)
    no_direct = np.isnan(direct) & ~np.isnan(diffuse + whole)
    no_diffuse = np.isnan(diffuse) & ~np.isnan(direct + whole)
    high = no_direct & (height > LOW)
    direct[high] = np.maximum(whole - diffuse, 0.0)[high] / height[high]
    # So low a sun is spread over the sky.
    direct[no_direct & ~high], diffuse[no_direct & ~high] = 0.0, whole[no_direct & ~high]
    diffuse[no_diffuse] = np.maximum(whole - direct * level, 0.0)[no_diffuse]
    told = int(no_direct.sum() + no_diffuse.sum())
    if told:
        remarks.append(f"direct or diffuse radiation of {told} steps is told from the global one")


def _tell_closure(
    direct: FloatArray,
    diffuse: FloatArray,
    whole: FloatArray,
    height: FloatArray,
    remarks: list[str],
) -> None:
    """Say so when direct and diffuse radiation do not make up the global one."""
    known = ~np.isnan(whole)
    sums = float((diffuse + direct * np.maximum(height, 0.0))[known].sum())
    stated = float(whole[known].sum())
    if stated > 0.0 and abs(sums / stated - 1.0) > OPEN:
        remarks.append(
            f"direct and diffuse radiation add up to {100.0 * sums / stated:.0f} % of the global "
            "one: place, time zone or columns may be wrong"
        )


def _illuminance(
    path: Path, data: DataFrame, column: Column, irradiance: FloatArray, remarks: list[str]
) -> FloatArray | None:
    """Illuminances (n,) as stated; None where the file has none."""
    values = _values(path, data, column, remarks)
    lit = irradiance > 0.0
    if np.isnan(values[lit]).all() or not (values[lit] > 0.0).any():
        if lit.any():
            remarks.append(f"{column.name} is not in the file")
        return None
    return frozen(values)
