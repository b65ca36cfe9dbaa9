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


#: Models of the colour of a sky by direction, see `patchlight.solver.sky_color`, and of the sun,
#: see `patchlight.solver.sun_spectrum`.
SKY_COLORS, SUN_COLORS = ("constant", "chain", "preetham"), ("constant", "spectrl2")
#: Colour temperatures where none is given. [K]
SKY_CCT_K, SUN_CCT_K = 6500.0, 5500.0


def check_sky_color(sky: Any) -> None:
    """Check the colour temperature of a sky, that of daylight, and its colour model."""
    store_number(sky, "cct_k", 4000.0, 25000.0)
    _check_model(sky, SKY_COLORS, SKY_CCT_K)
    if sky.color == "preetham" and (sky.sun_altitude_deg is None or sky.sun_azimuth_deg is None):
        raise InputError(
            f"{type(sky).__name__}.color = 'preetham': the sky has no sun; give sun_altitude_deg "
            "and sun_azimuth_deg"
        )


def check_sun_color(sun: Any) -> None:
    """Check the colour temperature of the sun, and its colour model."""
    store_number(sun, "cct_k", 1000.0, 25000.0)
    _check_model(sun, SUN_COLORS, SUN_CCT_K)


def _check_model(light: Any, models: tuple[str, ...], cct_k: float) -> None:
    name = type(light).__name__
    if light.color not in models:
        raise InputError(f"{name}.color = {light.color!r}: must be one of {', '.join(models)}")
    if light.color != "constant" and light.cct_k != cct_k:
        raise InputError(f"{name}: give cct_k or color = {light.color!r}, not both")
