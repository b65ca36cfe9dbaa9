"""Writer of small EnergyPlus weather files of known content."""

from __future__ import annotations

import datetime

import numpy as np
from patchlight.solver.model import Site
from patchlight.solver.sun_position import sun_positions


def moments(days, step=60, year=2001, first=(6, 1)):
    """Beginning of each step, local standard time."""
    start = datetime.datetime(year, *first)
    return [start + datetime.timedelta(minutes=step * k) for k in range(days * 1440 // step)]


def radiation(site, zone, times, step=60):
    """Direct, diffuse and global irradiance (n,) that close, of a simple clear sky. [W/m²]"""
    utc = np.array(times, dtype="datetime64[s]") + round(30 * step - 3600 * zone)
    height = np.sin(np.radians(sun_positions(site, utc)[0]))
    up = height > 0.02
    direct = np.where(up, 900.0 * np.exp(-0.15 / np.maximum(height, 0.02)), 0.0)
    diffuse = np.where(up, 100.0 * np.maximum(height, 0.0), 0.0)
    return direct, diffuse, diffuse + direct * np.maximum(height, 0.0)


def row(time, step, direct, diffuse, whole, *, lux=None, dew=10.0, albedo=0.2):
    """One line: the hour is that which ends with or after the step, minutes are its end."""
    hour, minute = time.hour + 1, (time.minute + step) if step < 60 else 0
    n, d = (999999, 999999) if lux is None else lux
    return (
        f"{time.year},{time.month},{time.day},{hour},{minute},?9,20.0,{dew},50,101300,0,0,300,"
        f"{whole:.6g},{direct:.6g},{diffuse:.6g},999999,{n},{d},9999,0,0,5,5,20,77777,9,999999999,"
        f"100,0.1,0,88,{albedo},0,1"
    )


def epw_text(
    *, latitude=48.0, longitude=9.0, zone=1.0, days=3, step=60, year=2001, first=(6, 1), rows=None
):
    """A whole file; ``rows(lines)`` may change the lines of its data."""
    times = moments(days, step, year, first)
    values = radiation(Site(latitude, longitude), zone, times, step)
    data = [row(t, step, *v) for t, *v in zip(times, *values, strict=True)]
    data = data if rows is None else rows(data)
    head = [
        f"LOCATION,Nowhere,-,XX,own,0,{latitude},{longitude},{zone},400",
        "DESIGN CONDITIONS,0",
        "TYPICAL/EXTREME PERIODS,0",
        "GROUND TEMPERATURES,0",
        "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0",
        "COMMENTS 1,made by a test",
        "COMMENTS 2,",
        f"DATA PERIODS,1,{60 // step},Data,Sunday,1/1,12/31",
    ]
    return "\r\n".join(head + data) + "\r\n"
