"""Checks of the numbers that skies, suns and places are made of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..errors import InputError


def finite_number(name: str, value: Any, low: float, high: float) -> float:
    """``value`` as a float between ``low`` and ``high``; `InputError` for all else."""
    plain = not isinstance(value, (str, bytes)) and np.ndim(value) == 0
    try:
        number = float(value) if plain else math.nan
    except (TypeError, ValueError):
        plain, number = False, math.nan
    if not plain:
        raise InputError(f"{name} = {value!r}: must be a number")
    if not (math.isfinite(number) and low <= number <= high):
        raise InputError(f"{name} = {value}: must lie between {low:g} and {high:g}")
    return number


def store_number(
    thing: Any, field: str, low: float, high: float, *, optional: bool = False
) -> None:
    """Check a field of a frozen dataclass and keep it as a float; None stays where it may."""
    value = getattr(thing, field)
    if value is not None or not optional:
        name = f"{type(thing).__name__}.{field}"
        object.__setattr__(thing, field, finite_number(name, value, low, high))


def check_cct(sky: Any) -> None:
    """Check the colour temperature of a sky: that of daylight."""
    store_number(sky, "cct_k", 4000.0, 25000.0)
