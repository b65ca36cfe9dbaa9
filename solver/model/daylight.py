"""Daylight factors: what is asked for, and what is found.

The daylight factor is the illuminance of a point over that of an unobstructed horizontal plane,
both under an overcast sky and without the sun [1]. It has three shares: light straight from the
sky, light that surfaces outdoors and the ground reflect straight to the point, and light that
comes to it by surfaces indoors.

.. [1] CIE S 017:2020, "ILV: International Lighting Vocabulary", 17-29-121 and following.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from .arrays import FloatArray, IntArray

#: Types of the overcast skies under which daylight factors are defined.
OVERCAST_TYPES = (1, 16)


@dataclass(frozen=True, slots=True)
class DaylightFactors:
    """Asks for daylight factors beside whatever light a scene has.

    Attributes
    ----------
    sky_type : {16, 1}
        The traditional overcast sky, or CIE type 1.
    outside : tuple of str
        Part patterns of what stands outdoors, such as a building across the street: what it
        reflects straight to a point counts as externally reflected. All other parts count as
        indoors, the ground does not.
    """

    sky_type: int = 16
    outside: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.sky_type, bool) or self.sky_type not in OVERCAST_TYPES:
            raise InputError(
                f"DaylightFactors.sky_type = {self.sky_type!r}: must be 16 or 1, an overcast sky"
            )
        object.__setattr__(self, "sky_type", int(self.sky_type))
        patterns = (self.outside,) if isinstance(self.outside, str) else tuple(self.outside)
        for pattern in patterns:
            if not isinstance(pattern, str) or not pattern:
                raise InputError(
                    f"DaylightFactors.outside: {pattern!r}: expected a part pattern such as "
                    '"neighbour/**"'
                )
        object.__setattr__(self, "outside", patterns)


@dataclass(frozen=True, slots=True, eq=False)
class DaylightShares:
    """Daylight factors of n sensors as fractions; row i of every array is the same sensor.

    Attributes
    ----------
    sky_type : int
        1 or 16, the overcast sky they hold under.
    sky : (n,) array
        Sky component: light straight from the sky, through panes too. On a vertical plane
        outdoors it is the vertical sky component.
    external : (n,) array
        Externally reflected component: straight from the ground and from what is outside.
    internal : (n,) array
        Internally reflected component: all other light of sky and ground.
    error : (n,) array
        Half-width of the numerical error of the sum.
    """

    sky_type: int
    sky: FloatArray
    external: FloatArray
    internal: FloatArray
    error: FloatArray

    @property
    def total(self) -> FloatArray:
        """The daylight factor (n,)."""
        return self.sky + self.external + self.internal

    def take(self, rows: IntArray) -> DaylightShares:
        """Those of some sensors."""
        return DaylightShares(
            self.sky_type,
            self.sky[rows],
            self.external[rows],
            self.internal[rows],
            self.error[rows],
        )
