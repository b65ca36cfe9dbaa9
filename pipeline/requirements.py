"""Bounds on metrics, checked before the long computation and judged in the report."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from difflib import get_close_matches

from patchlight.solver.errors import InputError
from patchlight.solver.model import Sky, Sun

#: Metrics that are shares of the light of an overcast sky.
DAYLIGHT_METRICS = frozenset({
    "DF_avg_percent", "DF_median_percent", "SC_avg_percent", "ERC_avg_percent", "IRC_avg_percent",
    "VSC_avg_percent",
})  # fmt: skip
#: Metrics of light that is told by wavelength.
SPECTRAL_METRICS = frozenset({"EDI_avg_lx", "EDI_min_lx", "CCT_avg_K", "Duv_avg", "DER_avg"})


@dataclass(frozen=True, slots=True)
class Requirement:
    """A bound on a metric of a sensor grid, judged in the report."""

    sensors: str
    metric: str
    min: float | None = None
    max: float | None = None

    def __post_init__(self) -> None:
        from patchlight.reports.metrics import QUANTITIES

        name = f"requirement on {self.sensors!r} {self.metric}"
        if self.metric not in QUANTITIES:
            raise InputError(f"metric {self.metric!r}: one of {', '.join(QUANTITIES)}")
        if self.min is None and self.max is None:
            raise InputError(f"{name}: give min, max or both")
        for key in ("min", "max"):
            value = getattr(self, key)
            if value is not None and not math.isfinite(value):
                raise InputError(f"{name}: {key} = {value}: must be a finite number")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise InputError(
                f"{name}: min = {self.min:g} lies above max = {self.max:g}: nothing can meet both"
            )

    def problem(
        self,
        grids: Collection[str],
        sky: Sky | None,
        sun: Sun | None,
        *,
        daylight_factor: bool = False,
        spectral: Collection[str] = (),
    ) -> str:
        """Why a scene with these grids and this light has no such value; empty when it has.

        With ``daylight_factor`` those are found beside the light of the scene; of the grids
        ``spectral`` the light is told by wavelength.
        """
        if self.sensors not in grids:
            return f"requirement on {unknown_grid(self.sensors, grids)}"
        overcast = sky is not None and sky.of_daylight_factors and sun is None
        if self.metric in DAYLIGHT_METRICS and not (overcast or daylight_factor):
            return (
                f"requirement on {self.sensors!r} {self.metric}: daylight factors need "
                "daylight_factor = true, or an overcast sky (type 1 or 16) without a sun"
            )
        if self.metric in SPECTRAL_METRICS and self.sensors not in spectral:
            return (
                f"requirement on {self.sensors!r} {self.metric}: colour and melanopic values need "
                "spectral = true in its [[sensors]]"
            )
        return ""


def unknown_grid(name: str, grids: Collection[str]) -> str:
    """What to say of a grid that there is not."""
    near = get_close_matches(name, grids, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"grids: {', '.join(grids) or 'none'}"
    return f"{name!r}: no such grid; {hint}"
