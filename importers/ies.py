"""IES LM-63 photometric files, versions of 1986 to 2019, type C photometry [1].

Everything after the TILT line is numbers in one order, wherever lines end. Editions differ in their
first line, and in the second of the three values after the dimensions: up to 1995 it is a factor on
the intensities, since 2002 it is none.

References
----------
.. [1] ANSI/IES LM-63-19, "Approved Method: IES Standard File Format for the Electronic Transfer of
   Photometric Data and Related Information".
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Photometry
from patchlight.solver.model.arrays import FloatArray

from .numbers_in_text import Numbers
from .web_planes import (
    SAME_DEG,
    Mirror,
    all_around,
    check_ascending,
    checked_table,
    reflected_c0,
    reflected_c90,
)

#: Most vertical or horizontal angles, and most tilt angles.
MAX_ANGLES = 7200
FOOT_M = 0.3048
#: Editions by their first line; those without one are of 1986.
EDITIONS = {"IESNA91": 1991, "IESNA:LM-63-1995": 1995, "IESNA:LM-63-2002": 2002}
#: Difference of a flux stated in the file that is told. [1]
TELL = 0.02
_TYPES = {2: "B", 3: "A"}


def photometry_of_ies(path: Path, text: str, sha256: str) -> Photometry:
    """The web of an IES file; `InputError` names what is wrong with it and where."""
    lines = text.splitlines()
    label, year, remarks = _edition(lines)
    at = next((k for k, line in enumerate(lines) if re.match(r"\s*TILT\s*=", line, re.I)), None)
    if at is None:
        raise InputError(f"{path}: no line TILT=…: this is no IES LM-63 file")
    keywords = _keywords(lines[:at])
    numbers = Numbers(path, lines, at + 1, between=r"[\s,]+")
    factor = _tilt_factor(path, lines[at], at + 1, numbers, remarks)
    lamps = numbers.count("number of lamps", low=1, high=100_000)
    lumens = numbers.take("lumens per lamp")
    if lumens <= 0.0 and lumens != -1.0:
        raise InputError(f"{path}: lumens per lamp = {lumens:g}: must be > 0, or -1 for absolute")
    factor *= numbers.take("candela multiplier", low=1e-12)
    vertical = numbers.count("number of vertical angles", low=2, high=MAX_ANGLES)
    horizontal = numbers.count("number of horizontal angles", low=1, high=MAX_ANGLES)
    kind = numbers.count("photometric type", low=1, high=3)
    if kind != 1:
        raise InputError(
            f"{path}: photometric type {kind} ({_TYPES[kind]}): only type C (1) can be used; ask "
            "for the file in type C, or convert it"
        )
    unit = numbers.count("units type", low=1, high=2)
    width, length, height = numbers.many(3, "luminous dimension")
    factor *= numbers.take("ballast factor", low=1e-6, high=100.0)
    second = numbers.take("ballast-lamp factor")
    if year < 2002:
        if not second > 0.0:
            raise InputError(f"{path}: ballast-lamp factor = {second:g}: must be > 0")
        factor *= second
    power = numbers.take("input watts")
    gamma = check_ascending(
        numbers.many(vertical, "vertical angle"), str(path), "vertical angle", 180.0
    )
    c = check_ascending(
        numbers.many(horizontal, "horizontal angle"), str(path), "horizontal angle", 360.0
    )
    stored = np.asarray(numbers.many(horizontal * vertical, "intensity")) * factor
    numbers.end()
    table, noise = checked_table(stored.reshape(horizontal, vertical), gamma, str(path))
    around, table = _expanded(path, c, table, remarks)
    scale = FOOT_M if unit == 1 else 1.0
    shape, size = _opening(width * scale, length * scale, height * scale)
    web = Photometry(
        around,
        gamma,
        table,
        name=keywords.get("LUMINAIRE") or keywords.get("LUMCAT", ""),
        shape=shape,
        size_m=size,
        lamp=keywords.get("LAMP", ""),
        lamp_flux_lm=None if lumens < 0.0 else lamps * lumens,
        power_w=power if power > 0.0 else None,
        source=str(path),
        sha256=sha256,
        format=label,
    )
    remarks += noise + _checks(web, keywords, " ".join(lines[:at]))
    return dataclasses.replace(web, remarks=tuple(remarks))


def _edition(lines: list[str]) -> tuple[str, int, list[str]]:
    """Name and year of the edition, and a remark where it is not known."""
    first = lines[0].strip() if lines else ""
    key = first.upper().replace(" ", "")
    if key in EDITIONS:
        return first, EDITIONS[key], []
    found = re.match(r"(?:IES|IESNA|ANSI/IES):?LM-63-(\d{4}|\d\d)$", key)
    if found:
        year = int(found[1])
        year += (1900 if year > 50 else 2000) if year < 100 else 0
        remarks = [] if year in (1986, 1991, 1995, 2002, 2019) else [f"unknown edition {first!r}"]
        return first, year, remarks
    return "IES LM-63-1986", 1986, []


def _keywords(lines: list[str]) -> dict[str, str]:
    """Values by keyword, the first where one comes twice; [MORE] goes on with the one before."""
    found: dict[str, str] = {}
    last = None
    for line in lines:
        match = re.match(r"\s*\[([^\]]+)\]\s*(.*)", line)
        if not match:
            continue
        key, value = match[1].strip().upper(), match[2].strip()
        if key == "MORE":
            if last is not None:
                found[last] = f"{found[last]} {value}".strip()
        elif key in found:
            last = None
        else:
            found[key], last = value, key
    return found


def _tilt_factor(path: Path, line: str, number: int, numbers: Numbers, remarks: list[str]) -> float:
    """Factor on the intensities for a lamp that hangs as its file means, without tilt."""
    value = line.split("=", 1)[1].strip()
    if value.upper() == "NONE":
        return 1.0
    if value.upper() != "INCLUDE":
        raise InputError(
            f"{path}, line {number}: TILT={value[:40]}: tilt in a file of its own is not read; "
            "copy it into this file as TILT=INCLUDE, or write TILT=NONE"
        )
    numbers.count("lamp to luminaire geometry", low=1, high=3)
    count = numbers.count("number of tilt angles", low=1, high=MAX_ANGLES)
    angles = check_ascending(numbers.many(count, "tilt angle"), str(path), "tilt angle", 180.0)
    factors = np.asarray(numbers.many(count, "tilt factor", low=0.0))
    if np.ptp(factors) > 0.0:
        remarks.append(
            "its lamps give another flux when tilted (TILT=INCLUDE); the factor for no tilt is "
            "taken however the lamp is aimed"
        )
    at_rest = float(np.interp(0.0, angles, factors))
    if not at_rest > 0.0:
        raise InputError(f"{path}: tilt factor for 0 degrees = {at_rest:g}: must be > 0")
    return at_rest


def _expanded(
    path: Path, c: FloatArray, table: FloatArray, remarks: list[str]
) -> tuple[FloatArray, FloatArray]:
    """All half-planes from those that the file stores, by the symmetry that their range means."""
    first, last = float(c[0]), float(c[-1])

    def spans(low: float, high: float) -> bool:
        return abs(first - low) < SAME_DEG and abs(last - high) < SAME_DEG

    mirrors: tuple[Mirror, ...]
    if len(c) == 1:
        mirrors = ()
    elif spans(0.0, 90.0):
        mirrors = (reflected_c0, reflected_c90)
    elif spans(0.0, 180.0):
        mirrors = (reflected_c0,)
    elif spans(90.0, 270.0):
        mirrors = (reflected_c90,)
    elif spans(0.0, 360.0):
        mirrors = ()
        gap = float(np.abs(table[0] - table[-1]).max()) / float(table.max())
        if gap > TELL:
            remarks.append(f"half-planes 0 and 360 differ by {100.0 * gap:.2g} % of the largest")
        table = np.concatenate([0.5 * (table[:1] + table[-1:]), table[1:-1]])
        c = c[:-1]
    elif first < SAME_DEG and last + 1.01 * float(np.diff(c).max()) >= 360.0:
        mirrors = ()
        remarks.append(f"horizontal angles end at {last:g} degrees; 0 stands for 360")
    else:
        raise InputError(
            f"{path}: horizontal angles from {first:g} to {last:g}: they must be one, or run from "
            "0 to 90, 180 or 360, or from 90 to 270"
        )
    return all_around(c, table, mirrors)


def _opening(width: float, length: float, height: float) -> tuple[str, tuple[float, float, float]]:
    """Shape and size along C0 (the length), C90 (the width) and upwards; negative is round."""
    if width == 0.0 and length == 0.0:
        return "point", (0.0, 0.0, abs(height))
    if width < 0.0 or length < 0.0:
        wide = max(abs(width), abs(length))
        return "circle", (abs(length) or wide, abs(width) or wide, abs(height))
    return "rectangle", (length, width, abs(height))


def _checks(web: Photometry, keywords: dict[str, str], header: str) -> list[str]:
    """What the file says of itself against its flux integral, and in which unit."""
    remarks = []
    flux, rated = web.flux_lm, web.lamp_flux_lm
    if rated is not None and rated > 0.0 and flux > (1.0 + TELL) * rated:
        remarks.append(
            f"{flux:.4g} lm leave the luminaire, more than the {rated:.4g} lm its lamps are said "
            "to give"
        )
    for key in ("_TOTALLUMINAIRELUMENS", "_TOTALLUMINAIREFLUX"):
        try:
            stated = float(keywords.get(key, "").split()[0])
        except (IndexError, ValueError):
            continue
        if stated > 0.0 and abs(flux / stated - 1.0) > TELL:
            remarks.append(f"its intensities add up to {flux:.4g} lm, its keywords say {stated:g}")
    if re.search(r"\b[mµu]?W\s*/\s*sr\b", header):
        remarks.append(
            "it says that its intensities are in W/sr or mW/sr: its flux is in W or mW, not in lm, "
            "unless another is given"
        )
    return remarks
