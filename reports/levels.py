"""Illuminance levels and colours of false-colour figures.

The levels follow the illuminance scale of EN 12464-1:2021, 5.3.2 (… 100, 150, 200, 300, 500, 750,
1000 … lx, steps of about 1.5), continued to both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5)
#: More colours than this cannot be told apart in a legend.
MAX_LEVELS = 9
_LOWEST, _HIGHEST = 1e-6, 1e12


@dataclass(frozen=True, slots=True)
class Scale:
    """Class limits of a false-colour figure.

    Attributes
    ----------
    levels : (k,) array
        Increasing limits, k >= 2; values outside take the end colours. [lx]
    """

    levels: NDArray[np.float64]

    @property
    def classes(self) -> int:
        """Number of colours."""
        return len(self.levels) - 1

    def position(self, values: ArrayLike) -> NDArray[np.float64]:
        """Position of ``values`` on the colour bar, 0 … 1; each class takes the same length."""
        v = np.asarray(values, dtype=np.float64)
        return np.interp(v, self.levels, np.linspace(0.0, 1.0, len(self.levels)))

    def index(self, values: ArrayLike) -> NDArray[np.int64]:
        """Class of each value, 0 … classes − 1."""
        found = np.searchsorted(self.levels, np.asarray(values, dtype=np.float64), "right") - 1
        return np.clip(found, 0, self.classes - 1).astype(np.int64)

    def colors(self) -> NDArray[np.float64]:
        """sRGB colour of each class, (classes, 3)."""
        if self.classes == 1:  # nothing but darkness
            return palette([0.0])
        return palette((np.arange(self.classes) + 0.5) / self.classes)


def palette(t: ArrayLike) -> NDArray[np.float64]:
    """sRGB colours (..., 3) at ``t`` in [0, 1], from blue over green to red.

    The customary order of false-colour illuminance, on the turbo map without its dark ends, so that
    black lines and numbers stay readable on every class.
    """
    from matplotlib import colormaps

    return np.asarray(colormaps["turbo"](0.06 + 0.88 * np.asarray(t, dtype=np.float64)))[..., :3]


def pale(colors: ArrayLike) -> NDArray[np.float64]:
    """Colours mixed with white, as ground for lines and numbers."""
    return 0.28 + 0.72 * np.asarray(colors, dtype=np.float64)


def standard_levels(low: float, high: float) -> NDArray[np.float64]:
    """Levels of the standard's scale that cover [low, high]."""
    low, high = max(low, _LOWEST), min(high, _HIGHEST)
    decades = range(math.floor(math.log10(low)) - 1, math.floor(math.log10(high)) + 2)
    series = np.array([s * 10.0**d for d in decades for s in _STEPS])
    first = max(int(np.searchsorted(series, low * (1 + 1e-9), "right")) - 1, 0)
    last = min(int(np.searchsorted(series, high * (1 - 1e-9), "left")), len(series) - 1)
    return series[first : last + 1]


def scale_for(values: ArrayLike, weights: ArrayLike | None = None) -> Scale:
    """Levels that suit ``values``: two to eight classes over nearly all of them (of their weight).

    Narrow ranges get equal round steps, wide ranges the scale of EN 12464-1, very wide ones every
    second or third level of it. Isolated extremes (below 1 % of the values) do not stretch it.
    """
    v = np.asarray(values, dtype=np.float64)
    w = np.ones_like(v) if weights is None else np.asarray(weights, dtype=np.float64)
    use = np.isfinite(v) & (v > 0.0) & (w > 0.0)
    v, w = v[use], w[use]
    if v.size == 0:
        return Scale(np.array([0.0, 1.0]))
    low, high = float(v.min()), float(v.max())
    if v.size >= 200:
        order = np.argsort(v)
        share = np.cumsum(w[order]) / w.sum()
        low, high = v[order][np.searchsorted(share, (0.01, 0.99))]
    if high / low < 1.8:
        return Scale(_linear_levels(float(low), float(high)))
    # Under a hundredth of the top nothing is read off a plan: the first class takes it all.
    low = max(float(low), float(high) / 300.0)
    levels = standard_levels(low, float(high))
    if len(levels) < 5:
        return Scale(_linear_levels(low, float(high)))
    for keep in ((0, 2, 4), (0, 4), (0,)):
        if len(levels) <= MAX_LEVELS:
            break
        full = standard_levels(low, float(high))
        wanted = {_STEPS[k] for k in keep}
        mantissa = np.round(full / 10.0 ** np.floor(np.log10(full) + 1e-9), 6)
        levels = full[np.isin(mantissa, list(wanted))]
        if levels[0] > low:
            levels = np.concatenate([[_next_below(levels[0], wanted)], levels])
        if levels[-1] < high:
            levels = np.concatenate([levels, [_next_above(levels[-1], wanted)]])
    return Scale(levels)


def _next_above(level: float, wanted: set[float]) -> float:
    decade = 10.0 ** math.floor(math.log10(level) + 1e-9)
    series = sorted(s * decade * f for s in wanted for f in (1.0, 10.0))
    return next(s for s in series if s > level * (1 + 1e-9))


def _next_below(level: float, wanted: set[float]) -> float:
    decade = 10.0 ** math.floor(math.log10(level) + 1e-9)
    series = sorted((s * decade * f for s in wanted for f in (0.1, 1.0)), reverse=True)
    return next(s for s in series if s < level * (1 - 1e-9))


def _linear_levels(low: float, high: float) -> NDArray[np.float64]:
    """Four to eight equal round steps around [low, high]; never finer than 1 % of the value."""
    span = max(high - low, 0.04 * high)
    center = 0.5 * (low + high)
    raw = span / 6.0
    decade = 10.0 ** math.floor(math.log10(raw))
    step = next(s * decade for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * decade >= raw * 0.999)
    first = math.floor((center - 0.5 * span) / step + 1e-9)
    last = math.ceil((center + 0.5 * span) / step - 1e-9)
    return np.asarray(np.arange(max(first, 0), last + 1) * step, dtype=np.float64)


def level_text(level: float) -> str:
    """A level as written on lines and bars."""
    if level >= 10000.0:
        return f"{level:,.0f}".replace(",", "\u202f")
    return f"{level:.4g}"
