"""EULUMDAT photometric files (.ldt) [1]: one value a line in a fixed order, intensities in cd/klm.

References
----------
.. [1] A. Stockmar, "EULUMDAT – ein Leuchtendatenformat für den europäischen Beleuchtungsplaner",
   Tagungsband Licht '90, 1990.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import Photometry
from patchlight.solver.model.arrays import FloatArray

from .numbers_in_text import Numbers, number_in
from .web_planes import (
    SAME_DEG,
    Mirror,
    all_around,
    check_ascending,
    checked_table,
    reflected_c0,
    reflected_c90,
)

#: Most half-planes, angles in one, and sets of lamps.
MAX_PLANES, MAX_ANGLES, MAX_SETS = 1441, 721, 20
#: Difference between stated and integrated shares of the flux that is told, and the relative one
#: of the light output ratio beyond which the file cannot be meant. [1]
TELL, REFUSE = 0.02, 0.25


@dataclass(slots=True)
class _Lines:
    """Values by line number, from 1."""

    path: Path
    lines: list[str]

    def text(self, line: int) -> str:
        return self.lines[line - 1].strip() if line <= len(self.lines) else ""

    def number(
        self, line: int, what: str, low: float = -np.inf, high: float = np.inf, *, empty: str = ""
    ) -> float:
        if line > len(self.lines):
            raise InputError(
                f"{self.path}, line {len(self.lines)}: the file ends where {what} (line {line}) "
                "should come"
            )
        word = self.text(line) or empty
        return number_in(word, f"{self.path}, line {line}", what, low, high, comma=True)

    def whole(self, line: int, what: str, low: int, high: int) -> int:
        value = self.number(line, what, low, high)
        if value != int(value):
            raise InputError(f"{self.path}, line {line}: {what} = {value:g}: must be whole")
        return int(value)


def photometry_of_ldt(path: Path, text: str, sha256: str) -> Photometry:
    """The web of a EULUMDAT file; `InputError` names what is wrong with it and where."""
    given = _Lines(path, text.splitlines())
    symmetry = given.whole(3, "symmetry Isym", 0, 4)
    planes = given.whole(4, "number of half-planes Mc", 1, MAX_PLANES)
    angles = given.whole(6, "number of angles Ng", 2, MAX_ANGLES)
    if symmetry in (2, 3, 4) and planes % (2 if symmetry == 2 else 4):
        whole = 2 if symmetry == 2 else 4
        raise InputError(
            f"{path}, line 4: Mc = {planes}: must be a multiple of {whole} with Isym = {symmetry}"
        )
    length, width, height = (
        given.number(13 + k, "size of the luminaire [mm]", 0.0, empty="0") / 1000.0
        for k in range(3)
    )
    opening = [
        given.number(16 + k, "size of the luminous area [mm]", 0.0, empty="0") / 1000.0
        for k in range(2)
    ]
    heights = [
        given.number(18 + k, "height of the luminous area [mm]", empty="0") / 1000.0
        for k in range(4)
    ]
    downward = given.number(22, "downward flux fraction DFF [%]", 0.0, 101.0) / 100.0
    output = given.number(23, "light output ratio LORL [%]", 0.0, 1000.0) / 100.0
    conversion = given.number(24, "conversion factor", 1e-9)
    tilt = given.number(25, "tilt of the luminaire [deg]", -360.0, 360.0, empty="0")
    sets = given.whole(26, "number of lamp sets", 1, MAX_SETS)
    remarks = []
    if tilt != 0.0:
        remarks.append(f"it was measured with a tilt of {tilt:g} degrees, which is not undone")
    if sets > 1:
        remarks.append(f"it lists {sets} sets of lamps; the first is taken")
    lamps = given.number(27, "number of lamps")
    flux = given.number(29, "flux of the lamps [lm]", 1e-9)
    power = given.number(32, "power of the lamps [W]", 0.0, empty="0")
    # Ten direct ratios follow the sets of lamps, then all angles, then the stored intensities.
    numbers = Numbers(path, given.lines, 26 + 6 * sets, between=r"[\s;]+", comma=True)
    numbers.many(10, "direct ratio")
    c = np.asarray(numbers.many(planes, "half-plane C"))
    where = str(path)
    c = check_ascending(c.tolist(), where, "half-plane C", 360.0)
    gamma = check_ascending(numbers.many(angles, "angle gamma"), where, "angle gamma", 180.0)
    stored, mirrors = _stored(path, c, symmetry)
    per_klm = np.asarray(numbers.many(len(stored) * angles, "intensity")).reshape(-1, angles)
    numbers.end()
    table, noise = checked_table(per_klm, gamma, where)
    around, table = all_around(c[stored], table, mirrors)
    round_ = (opening[1] == 0.0) if any(opening) else (width == 0.0 and length > 0.0)
    along, across = opening if any(opening) else (length, width)
    web = Photometry(
        around,
        gamma,
        table * conversion * flux / 1000.0,
        name=given.text(9),
        shape="circle" if round_ else "rectangle" if along > 0.0 else "point",
        size_m=(along if round_ else across, along, max(heights) if any(heights) else height),
        lamp=given.text(28),
        lamp_flux_lm=None if lamps < 0.0 else flux,
        power_w=power or None,
        source=where,
        sha256=sha256,
        format="EULUMDAT",
        remarks=tuple(remarks + noise),
    )
    return _checked(web, flux, output, downward)


def _stored(path: Path, c: FloatArray, symmetry: int) -> tuple[np.ndarray, tuple[Mirror, ...]]:
    """Rows of the half-planes whose intensities the file holds, and its planes of symmetry."""
    count = len(c)
    mirrors: tuple[Mirror, ...]
    if symmetry == 1:
        return np.zeros(1, dtype=np.int64), ()
    if symmetry == 0:
        if count > 1 and c[-1] + 1.01 * float(np.diff(c).max()) < 360.0 - SAME_DEG:
            raise InputError(
                f"{path}: half-planes C end at {c[-1]:g} degrees: with Isym = 0 they must go all "
                "around"
            )
        return np.arange(count), ()
    if symmetry == 3:
        rows, ends = (3 * count // 4 + np.arange(count // 2 + 1)) % count, (270.0, 90.0)
        mirrors = (reflected_c90,)
    elif symmetry == 2:
        rows, ends, mirrors = np.arange(count // 2 + 1), (0.0, 180.0), (reflected_c0,)
    else:
        rows, ends = np.arange(count // 4 + 1), (0.0, 90.0)
        mirrors = (reflected_c0, reflected_c90)
    found = (float(c[rows[0]]), float(c[rows[-1]]))
    if max(abs(a - b) for a, b in zip(found, ends, strict=True)) > SAME_DEG:
        raise InputError(
            f"{path}: with Isym = {symmetry} the stored half-planes must run from C {ends[0]:g} to "
            f"{ends[1]:g}, not from {found[0]:g} to {found[1]:g}"
        )
    return rows, mirrors


def _checked(web: Photometry, lamp_flux: float, output: float, downward: float) -> Photometry:
    """The web with remarks where its integral differs from what the file says of itself.

    Raises
    ------
    InputError
        If the light output ratio is another one altogether: intensities in other units, then.
    """
    remarks = list(web.remarks)
    found = web.flux_lm / lamp_flux
    if output > 0.0 and abs(found - output) > TELL * max(output, found):
        if abs(found - output) > REFUSE * output:
            raise InputError(
                f"{web.source}: the intensities add up to {100.0 * found:.4g} % of the lamps' "
                f"flux, line 23 says {100.0 * output:.4g} %: at most {100.0 * REFUSE:g} % off it"
            )
        remarks.append(
            f"its intensities add up to {100.0 * found:.4g} % of the lamps' flux, not to the "
            f"{100.0 * output:.4g} % it says; the intensities are taken"
        )
    below = web.downward_fraction
    if abs(below - downward) > TELL:
        remarks.append(
            f"{100.0 * below:.3g} % of its flux goes down, not the {100.0 * downward:.3g} % it says"
        )
    return dataclasses.replace(web, remarks=tuple(remarks))
