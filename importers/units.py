"""Units of length."""

from __future__ import annotations

from patchlight.solver.errors import InputError

#: Metres of one unit, by the names found in STEP files and accepted from users.
UNITS = {
    "mm": 1e-3, "millimetre": 1e-3, "millimeter": 1e-3,
    "cm": 1e-2, "centimetre": 1e-2, "centimeter": 1e-2,
    "dm": 0.1, "decimetre": 0.1, "m": 1.0, "metre": 1.0, "meter": 1.0,
    "km": 1e3, "kilometre": 1e3, "um": 1e-6, "micrometre": 1e-6,
    "in": 0.0254, "inch": 0.0254, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048,
}  # fmt: skip


def unit_metres(name: str) -> float:
    """Metres of a unit; `InputError` for an unknown one."""
    found = UNITS.get(name.strip().lower())
    if found is None:
        raise InputError(f"unit = {name!r}: one of mm, cm, m, km, in, ft")
    return found
