"""Numbers and units as people read them."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

#: Shown instead of a number that does not exist.
MISSING = "–"
#: Illuminance [lx], uniformity or percentage that is nothing but rounding.
NEGLIGIBLE = 1e-6
#: Thin, unbreakable: digit groups must not fall apart at the end of a line.
_GROUP = "\u202f"
_RAISED = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
_PLAIN, _UP = str.maketrans(_RAISED, "-0123456789"), str.maketrans("-0123456789", _RAISED)


def number(value: float | None, digits: int = 3) -> str:
    """``value`` with ``digits`` significant digits, without exponent between 1e-4 and 1e9."""
    if value is None or not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude >= 9 or magnitude < -4:
        return scientific(value, digits)
    places = digits - 1 - magnitude
    rounded = round(value, places)
    if abs(rounded) >= 10.0 ** (magnitude + 1):  # 9.996 becomes 10.0, not 10.00
        places -= 1
    return grouped(rounded, max(places, 0))


def grouped(value: float, places: int) -> str:
    """Fixed decimal ``places`` with groups of three digits from 10 000 on."""
    text = f"{value:,.{places}f}" if abs(value) >= 9999.5 else f"{value:.{places}f}"
    if float(text.replace(",", "")) == 0.0:
        text = text.lstrip("-")
    return text.replace(",", _GROUP).replace("-", "−")


def decimals(value: float, digits: int) -> int:
    """Decimal places that show ``value`` with ``digits`` significant digits, if need be none."""
    if not math.isfinite(value) or abs(value) < NEGLIGIBLE:
        return 0
    return max(digits - 1 - math.floor(math.log10(abs(value))), 0)


def addend(value: float, places: int) -> str:
    """``value`` with the decimal places of a sum it belongs to; two digits where it is tiny there.

    What is below `NEGLIGIBLE` is shown as 0.
    """
    if not math.isfinite(value):
        return MISSING
    if abs(value) < NEGLIGIBLE:
        return "0"
    if abs(value) < 10.0 ** (1 - places):
        return number(value, 2)
    return grouped(value, places)


def scientific(value: float | None, digits: int = 2) -> str:
    """``1.2·10⁻⁵``."""
    if value is None or not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = str(int(exponent)).translate(_UP)
    return f"{mantissa.replace('-', '−')}·10{power}"


def with_error(value: float | None, error: float | None = None, *, digits: int = 4) -> str:
    """``512.3 ± 5.0``: the error rounded up to two digits, the value to the same place.

    For illuminances, uniformities and percentages: what is below `NEGLIGIBLE` is shown as 0.
    """
    if value is None or not math.isfinite(value):
        return MISSING
    if abs(value) < NEGLIGIBLE:
        value = 0.0
    if error is None or not math.isfinite(error) or error < NEGLIGIBLE:
        return number(value, digits)
    if error <= 1e-6 * abs(value):
        return number(value, digits)
    mantissa, exponent = f"{error:.6e}".split("e")  # decimals: binary rounding adds no digit
    tens, magnitude = math.ceil(float(mantissa) * 10.0 - 1e-6), int(exponent)
    if tens == 100:  # 9.96 becomes 10, not 10.0
        tens, magnitude = 10, magnitude + 1
    places = 1 - magnitude
    value, error = round(value, places), tens * 10.0**-places
    places = max(places, 0)
    return f"{grouped(value, places)} ± {grouped(error, places)}"


def console(text: str) -> str:
    """Numbers of `number` and `with_error` for terminals: no digit groups, nothing beyond ASCII."""
    text = re.sub(f"·10([{_RAISED}]+)", lambda m: "e" + m[1].translate(_PLAIN), text)
    return text.replace(_GROUP, "").replace("−", "-")


def percent(value: float | None, digits: int = 2) -> str:
    """A fraction as per cent with ``digits`` significant digits."""
    if value is None or not math.isfinite(value):
        return MISSING
    return f"{number(100.0 * value, digits)} %"


def count(value: float) -> str:
    """A whole number with digit groups."""
    return grouped(float(value), 0)


def length(metres: float | None) -> str:
    """A length in the unit that suits it."""
    if metres is None or not math.isfinite(metres):
        return MISSING
    if metres == 0.0:
        return "0"
    for factor, unit in ((1.0, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm")):
        if abs(metres) * factor >= 1.0:
            return f"{number(metres * factor, 3)} {unit}"
    return "< 1 nm"


def coordinate(metres: float, extent: float, digits: int = 3) -> str:
    """A coordinate [m]; 0 where it is nothing against the ``extent`` [m] of what it places."""
    return "0" if abs(metres) <= 1e-4 * extent else number(metres, digits)


def angle(degrees: float | None) -> str:
    """An angular deviation; below 0.0001° it is rounding."""
    if degrees is None or not math.isfinite(degrees):
        return MISSING
    return "< 0.0001°" if 0.0 < abs(degrees) < 1e-4 else f"{number(degrees, 2)}°"


def setting(value: Any) -> Any:
    """A setting as shown: floats without the digits of binary rounding."""
    return f"{value:.6g}" if isinstance(value, float) else value


def seconds(value: float | None) -> str:
    """A duration."""
    if value is None or not math.isfinite(value):
        return MISSING
    if value < 1.0:
        return f"{number(1e3 * value, 2)} ms"
    if value < 120.0:
        return f"{number(value, 3)} s"
    minutes, rest = divmod(round(value), 60)
    if minutes < 120:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def srgb_hex(linear: Any) -> str:
    """``#rrggbb`` of a linear sRGB colour (3,), clipped. [IEC 61966-2-1]"""
    c = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    encoded = srgb_encode(c)
    return "#" + "".join(f"{round(255.0 * float(x)):02x}" for x in encoded)


def srgb_encode(linear: Any) -> Any:
    """Linear values in [0, 1] to the sRGB transfer curve. [IEC 61966-2-1]"""
    c = np.asarray(linear, dtype=np.float64)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 1e-12) ** (1 / 2.4) - 0.055)


def plain(value: Any) -> Any:
    """``value`` as JSON can hold it: NumPy types unpacked, NaN and infinities as null."""
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return str(value)
