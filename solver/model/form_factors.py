"""Form factors with the bracket they lie in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from .arrays import FloatArray, check_shape, frozen


@dataclass(frozen=True, slots=True, eq=False)
class FormFactors:
    """Form factors from m receiving points (rows) to n source patches (columns).

    Attributes
    ----------
    value : (m, n) array
        Fraction of the light leaving point i that reaches the visible + side of patch j. [1]
    low, high : (m, n) array
        What the factor lies between. [1]
    proved : bool
        Whether the brackets are proved ("strict" and "none", up to rounding) or estimated.
    counters : mapping
        What was done: pairs skipped and traced, cells looked at.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray
    proved: bool
    counters: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        value = frozen(self.value)
        check_shape("FormFactors.value", value, (None, None))
        object.__setattr__(self, "value", value)
        for name in ("low", "high"):
            array = frozen(getattr(self, name))
            check_shape(f"FormFactors.{name}", array, value.shape)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "counters", MappingProxyType(dict(self.counters)))

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of points and of patches."""
        m, n = self.value.shape
        return m, n

    @property
    def width(self) -> FloatArray:
        """Widths (m, n) of the brackets. [1]"""
        return self.high - self.low
