"""What lets light through: the glass a user assigns, and panes of it in a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError

#: Transmittance at one angle of incidence, (angle [deg], transmittance).
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Glass:
    """Clear or diffusing glass; a pane of it is a slab with two parallel faces.

    Attributes
    ----------
    thickness_m : float, optional
        Of the pane; that of the solid when not given. [m]
    n : float
        Refractive index.
    absorption_per_m : float
        Absorption coefficient inside the glass. [1/m]
    transmittance : float or sequence of (angle_deg, transmittance), optional
        Instead of the absorption: that at normal incidence, which a slab of index ``n`` then
        has, or a table, linear in the angle and falling to 0 at 90 degrees.
    diffuse : float
        Share of the transmitted light that leaves the other side alike in all directions, 0 … 1.
        At 1 nothing is seen through the pane.
    """

    thickness_m: float | None = None
    n: float = 1.52
    absorption_per_m: float = 6.783
    transmittance: float | tuple[Pair, ...] | None = None
    diffuse: float = 0.0

    def __post_init__(self) -> None:
        if self.thickness_m is not None:
            _check("thickness_m", self.thickness_m, 0.0, math.inf, above=True)
        _check("n", self.n, 1.0, 10.0)
        _check("absorption_per_m", self.absorption_per_m, 0.0, math.inf)
        _check("diffuse", self.diffuse, 0.0, 1.0)
        given = self.transmittance
        if given is None:
            return
        if isinstance(given, Sequence) and not isinstance(given, str):
            object.__setattr__(self, "transmittance", _table(given))
            return
        _check("transmittance", given, 0.0, 1.0)
        most = 2.0 * self.n / (self.n**2 + 1.0)
        if given > most + 1e-12:
            raise InputError(
                f"Glass.transmittance = {given:g}: faces of index {self.n:g} let through at most "
                f"{most:.4f} at normal incidence; give a smaller n or a table of (angle_deg, "
                "transmittance)"
            )

    @property
    def needs_thickness(self) -> bool:
        """Whether the transmittance depends on how thick the pane is."""
        return self.transmittance is None and self.absorption_per_m > 0.0


@dataclass(frozen=True, slots=True)
class Glazing:
    """Panes of one kind in a scene.

    Attributes
    ----------
    glass : Glass
        What they are made of.
    thickness_m : float
        Thickness of each; 0 where it does not matter. [m]
    solid : bool
        Whether the faces bound a solid, which light crosses by one entry and one exit. A sheet
        is crossed at once.
    """

    glass: Glass
    thickness_m: float = 0.0
    solid: bool = False

    @property
    def name(self) -> str:
        """How reports call it."""
        glass = self.glass
        given = glass.transmittance
        kind = "diffusing glass" if glass.diffuse > 0.0 else "glass"
        if isinstance(given, tuple):
            return f"{kind}, table from {given[0][1]:g}"
        if given is not None:
            return f"{kind}, transmittance {given:g}"
        return f"{kind} {1e3 * self.thickness_m:.3g} mm" if self.thickness_m else kind


def _check(name: str, value: object, low: float, high: float, *, above: bool = False) -> None:
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if good and low <= float(value) <= high and not (above and float(value) == low):  # type: ignore[arg-type]
        return
    if math.isinf(high):
        bound = f"greater than {low:g}" if above else f"at least {low:g}"
    else:
        bound = f"between {low:g} and {high:g}"
    raise InputError(f"Glass.{name} = {value!r}: must be a number {bound}")


def _table(given: Sequence[object]) -> tuple[Pair, ...]:
    """Checked pairs, the angles ascending from 0."""
    pairs: list[Pair] = []
    for row in given:
        if not (isinstance(row, Sequence) and len(row) == 2):
            raise InputError(
                f"Glass.transmittance: {row!r}: expected pairs (angle_deg, transmittance)"
            )
        _check("transmittance: angle_deg", row[0], 0.0, 90.0)
        _check("transmittance", row[1], 0.0, 1.0)
        pairs.append((float(row[0]), float(row[1])))
    angles = [angle for angle, _ in pairs]
    if not pairs or angles[0] != 0.0 or (np.diff(angles) <= 0.0).any():
        raise InputError(
            f"Glass.transmittance: angles {angles}: must begin at 0 and grow, in degrees"
        )
    if angles[-1] < 90.0:
        pairs.append((90.0, 0.0))
    return tuple(pairs)
