"""Skies measured patch by patch, from a text file.

Two layouts are read. Lines that start with ``#`` are comments in both.

* 145 numbers [cd/m²], parted by spaces, commas, semicolons or line ends, in the order of
  `patchlight.solver.model.PatchSky`: rows from the horizon upwards, in each row clockwise from
  north.
* A table with the columns ``azimuth_deg``, ``altitude_deg`` and ``luminance_cd_m2`` under a line
  with these names, in any order of columns and rows: each row is of the patch whose middle lies
  there. Azimuths are clockwise from north.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import PatchSky
from patchlight.solver.model.patch_sky import MOST_CD_M2, PATCH_COUNT, patch_middles
from patchlight.solver.model.sky import direction

from .numbers_in_text import number_in, read_text

#: 145 numbers take far less. [B]
MAX_BYTES = 1_000_000
COLUMNS = ("azimuth_deg", "altitude_deg", "luminance_cd_m2")
#: How far from the middle of its patch a row may lie: rounding of tables, no other grid. [deg]
OFF_DEG = 1.5
_BETWEEN = re.compile(r"[\s,;]+")


def read_patch_sky(
    path: str | os.PathLike[str],
    *,
    sun_altitude_deg: float | None = None,
    sun_azimuth_deg: float | None = None,
    diffuse_illuminance_lx: float | None = None,
    cct_k: float = 6500.0,
) -> PatchSky:
    """The sky of a file; see the module for its layout.

    Parameters
    ----------
    path : path
        The file.
    sun_altitude_deg, sun_azimuth_deg, diffuse_illuminance_lx, cct_k
        As those of `PatchSky`.

    Raises
    ------
    MissingFileError
        If the file is not there or cannot be read.
    InputError
        Naming file, line, value and bound: for what is no number, too many or too few values,
        and rows that lie at no patch or at one that has its row already.
    """
    path = Path(path)
    text, _ = read_text(path, MAX_BYTES)
    lines = [
        (number, [word for word in _BETWEEN.split(line.strip()) if word])
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    lines = [(number, words) for number, words in lines if words]
    if not lines:
        raise InputError(f"{path}: no values")
    head = [word.strip('"').lower() for word in lines[0][1]]
    named = any(re.search("[a-z_]{3}", word) for word in head)
    values = _of_table(path, head, lines) if named else _in_order(path, lines)
    try:
        return PatchSky(
            values,
            sun_altitude_deg=sun_altitude_deg,
            sun_azimuth_deg=sun_azimuth_deg,
            diffuse_illuminance_lx=diffuse_illuminance_lx,
            cct_k=cct_k,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _in_order(path: Path, lines: list[tuple[int, list[str]]]) -> list[float]:
    """The values of the first layout."""
    found = [
        number_in(word, f"{path}, line {number}", "luminance_cd_m2", 0.0, MOST_CD_M2)
        for number, words in lines
        for word in words
    ]
    if len(found) != PATCH_COUNT:
        raise InputError(f"{path}: {len(found)} values: must be {PATCH_COUNT}, one a patch")
    return found


def _of_table(path: Path, head: list[str], lines: list[tuple[int, list[str]]]) -> list[float]:
    """The values of the second layout, by patch."""
    where = f"{path}, line {lines[0][0]}"
    if sorted(head) != sorted(COLUMNS):
        raise InputError(f"{where}: columns {', '.join(head)}: must be {', '.join(COLUMNS)}")
    azimuth, altitude, luminance = (head.index(name) for name in COLUMNS)
    middles = np.array([direction(*at) for at in zip(*patch_middles(), strict=True)])
    values: list[float | None] = [None] * PATCH_COUNT
    for number, words in lines[1:]:
        where = f"{path}, line {number}"
        if len(words) != len(COLUMNS):
            raise InputError(f"{where}: {len(words)} values: must be {len(COLUMNS)}")
        up = number_in(words[altitude], where, "altitude_deg", 0.0, 90.0)
        round_ = number_in(words[azimuth], where, "azimuth_deg", -360.0, 360.0)
        apart = np.degrees(np.arccos(np.clip(middles @ np.array(direction(up, round_)), -1.0, 1.0)))
        patch = int(np.argmin(apart))
        if apart[patch] > OFF_DEG:
            raise InputError(
                f"{where}: azimuth {round_:g}, altitude {up:g} degrees is {apart[patch]:.1f} "
                f"degrees from the middle of the nearest patch; at most {OFF_DEG:g}"
            )
        if values[patch] is not None:
            raise InputError(f"{where}: a second value of patch {patch + 1}")
        values[patch] = number_in(words[luminance], where, "luminance_cd_m2", 0.0, MOST_CD_M2)
    missing = [k + 1 for k, value in enumerate(values) if value is None]
    if missing:
        raise InputError(
            f"{path}: {len(missing)} of {PATCH_COUNT} patches have no value, the first is patch "
            f"{missing[0]}"
        )
    return [float(value) for value in values if value is not None]
