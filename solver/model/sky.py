"""Sky, sun, ground and site. Azimuths are clockwise from north, altitudes above the horizon."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .patch_sky import PatchSky
from .sky_checks import check_sky_color, check_sun_color, store_number

#: Names of Radiance's gensky for types of CIE S 011, and for skies with a formula of their own.
SKY_NAMES = {"overcast": 16, "uniform": 5}
OWN_FORMULAS = ("clear", "intermediate")
#: Types whose level can be estimated from the height of the sun.
ESTIMATED_TYPES = (1, 5, 12, 16, *OWN_FORMULAS)


@dataclass(frozen=True, slots=True)
class CIESky:
    """Standard sky of CIE S 011 / ISO 15469 (types 1–15) or the traditional overcast sky (16).

    Attributes
    ----------
    type : int or str
        1 … 16, or as Radiance's gensky has them: ``"overcast"`` (16), ``"uniform"`` (5),
        ``"clear"`` and ``"intermediate"``; see `patchlight.solver.gensky`.
    sun_altitude_deg, sun_azimuth_deg : float, optional
        Position of the sun the sky belongs to; types 1, 3, 5 and 16 do not need one. [deg]
    diffuse_illuminance_lx, zenith_luminance_cd_m2 : float, optional
        Absolute level: horizontal illuminance of the sky alone [lx], or zenith luminance [cd/m²].
        Without any level the sky is scaled to 10 000 lx and `relative` is true.
    estimated : bool
        Whether the level is what is typical at the sun's altitude, as gensky has it: of types 1,
        5, 12, 16, ``"clear"`` and ``"intermediate"``.
    turbidity : float, optional
        Of estimated levels of types 12, ``"clear"`` and ``"intermediate"``; 2.45 when not given.
    cct_k : float
        Colour of the whole sky. [K]
    color : {"constant", "chain", "preetham"}
        Colour by direction, in scenes whose light has a colour: ``cct_k`` everywhere, or modelled;
        see `patchlight.solver.sky_color`.
    """

    type: int | str = 16
    sun_altitude_deg: float | None = None
    sun_azimuth_deg: float | None = None
    diffuse_illuminance_lx: float | None = None
    zenith_luminance_cd_m2: float | None = None
    cct_k: float = 6500.0
    estimated: bool = False
    turbidity: float | None = None
    color: str = "constant"

    def __post_init__(self) -> None:
        object.__setattr__(self, "type", _sky_type(self.type))
        store_number(self, "sun_altitude_deg", 0.0, 90.0, optional=True)
        store_number(self, "sun_azimuth_deg", -360.0, 360.0, optional=True)
        if self.needs_sun and (self.sun_altitude_deg is None or self.sun_azimuth_deg is None):
            raise InputError(
                f"CIESky: type {self.type} brightens towards the sun; "
                "give sun_altitude_deg and sun_azimuth_deg"
            )
        levels = ("diffuse_illuminance_lx", "zenith_luminance_cd_m2")
        for name in levels:
            store_number(self, name, 0.0, 1e7, optional=True)
        given = [name for name in levels if getattr(self, name) is not None]
        if len(given) + bool(self.estimated) > 1:
            raise InputError(
                "CIESky: give one of diffuse_illuminance_lx, zenith_luminance_cd_m2 and estimated"
            )
        self._check_estimate()
        check_sky_color(self)

    def _check_estimate(self) -> None:
        if not isinstance(self.estimated, bool):
            raise InputError(f"CIESky.estimated = {self.estimated!r}: must be True or False")
        store_number(self, "turbidity", 1.5, 20.0, optional=True)
        if self.turbidity is not None and not (self.estimated and self.type not in (1, 5, 16)):
            raise InputError(
                "CIESky.turbidity: only the estimated level of types 12, clear and intermediate "
                "depends on it"
            )
        if not self.estimated:
            return
        if self.type not in ESTIMATED_TYPES:
            names = ", ".join(map(str, ESTIMATED_TYPES))
            raise InputError(
                f"CIESky.estimated: the level of type {self.type} is not known; types: {names}"
            )
        if self.sun_altitude_deg is None:
            raise InputError("CIESky.estimated: the level follows from sun_altitude_deg; give it")

    @property
    def needs_sun(self) -> bool:
        """Whether the luminance depends on the position of the sun."""
        return self.type not in (1, 3, 5, 16)

    @property
    def relative(self) -> bool:
        """Whether the level is the default one and not a given one."""
        levels = (self.diffuse_illuminance_lx, self.zenith_luminance_cd_m2)
        return levels == (None, None) and not self.estimated

    @property
    def of_daylight_factors(self) -> bool:
        """Whether daylight factors are defined under it."""
        return self.type in (1, 16)


@dataclass(frozen=True, slots=True, kw_only=True)
class PerezSky:
    """All-weather sky of Perez et al. 1993 from irradiances; see `patchlight.solver.perez`.

    Attributes
    ----------
    direct_normal_w_m2, diffuse_horizontal_w_m2 : float
        Irradiance by the sun on a plane facing it, and by the sky on a level one. [W/m²]
    sun_altitude_deg, sun_azimuth_deg : float
        Position of the sun. [deg]
    dew_point_c : float
        Tells the water in the atmosphere, on which luminous efficacies depend. [°C]
    sun_nearness : float
        Square of the mean distance of the sun over its distance, 0.967 in July to 1.034 in January.
    cct_k : float
        Colour of the whole sky. [K]
    color : {"constant", "chain", "preetham"}
        Colour by direction, in scenes whose light has a colour: ``cct_k`` everywhere, or modelled;
        see `patchlight.solver.sky_color`.
    """

    direct_normal_w_m2: float
    diffuse_horizontal_w_m2: float
    sun_altitude_deg: float
    sun_azimuth_deg: float
    dew_point_c: float = 10.97
    sun_nearness: float = 1.0
    cct_k: float = 6500.0
    color: str = "constant"

    def __post_init__(self) -> None:
        store_number(self, "direct_normal_w_m2", 0.0, 1500.0)
        store_number(self, "diffuse_horizontal_w_m2", 0.0, 1500.0)
        store_number(self, "sun_altitude_deg", 0.0, 90.0)
        store_number(self, "sun_azimuth_deg", -360.0, 360.0)
        store_number(self, "dew_point_c", -90.0, 40.0)
        store_number(self, "sun_nearness", 0.96, 1.04)
        check_sky_color(self)

    @property
    def needs_sun(self) -> bool:
        """Whether the luminance depends on the position of the sun."""
        return True

    @property
    def relative(self) -> bool:
        """Whether the level is the default one and not a given one."""
        return False

    @property
    def of_daylight_factors(self) -> bool:
        """Whether daylight factors are defined under it."""
        return False


#: Every distribution of luminance over the sky.
Sky = CIESky | PerezSky | PatchSky


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun as a disc, of uniform luminance unless its limb is darker.

    Attributes
    ----------
    altitude_deg, azimuth_deg : float
        Position of the centre. [deg]
    normal_illuminance_lx : float
        Illuminance of the whole disc on a plane facing it. [lx]
    angular_radius_arcmin : float
        Radius of the disc. [arcmin]
    cct_k : float
        Colour. [K]
    limb_darkening : bool
        Whether the disc is darker towards its rim, as the sun is at 550 nm; see
        `patchlight.solver.sun_disc`. Shadows are a little sharper then.
    color : {"constant", "spectrl2"}
        ``cct_k``, or modelled by its altitude, in scenes whose light has a colour; see
        `patchlight.solver.sun_spectrum`.
    """

    altitude_deg: float
    azimuth_deg: float
    normal_illuminance_lx: float
    angular_radius_arcmin: float = 16.0
    cct_k: float = 5500.0
    limb_darkening: bool = False
    color: str = "constant"

    def __post_init__(self) -> None:
        if not isinstance(self.limb_darkening, bool):
            raise InputError(f"Sun.limb_darkening = {self.limb_darkening!r}: must be True or False")
        store_number(self, "altitude_deg", -90.0, 90.0)
        store_number(self, "azimuth_deg", -360.0, 360.0)
        store_number(self, "normal_illuminance_lx", 0.0, 1e6)
        store_number(self, "angular_radius_arcmin", 1e-3, 600.0)
        check_sun_color(self)

    @classmethod
    def at(
        cls,
        site: Site,
        time: datetime.datetime | str,
        *,
        normal_illuminance_lx: float,
        **more: Any,
    ) -> Sun:
        """The sun as it stands at a place and time.

        Parameters
        ----------
        site : Site
            The place; its time zone is what ``time`` is meant in when it has no offset of its own.
        time : datetime or str
            A moment, as clocks there show it with daylight saving, or with an offset.
        normal_illuminance_lx : float
            Illuminance of the whole disc on a plane facing it. [lx]
        **more
            Further attributes.

        Raises
        ------
        InputError
            As `patchlight.solver.clock.universal_time`.
        """
        from ..clock import universal_time
        from ..sun_position import sun_positions

        moment = np.array([universal_time(time, site.timezone).replace(tzinfo=None)])
        altitude, azimuth = sun_positions(site, moment.astype("datetime64[s]"))
        return cls(float(altitude[0]), float(azimuth[0]), normal_illuminance_lx, **more)


@dataclass(frozen=True, slots=True)
class Ground:
    """Uniform lower hemisphere; ``Ground(None)`` when the terrain is modelled."""

    reflectance: float | None = 0.2

    def __post_init__(self) -> None:
        store_number(self, "reflectance", 0.0, 1.0, optional=True)


@dataclass(frozen=True, slots=True)
class Site:
    """Place on earth; longitude positive to the east."""

    latitude_deg: float
    longitude_deg: float
    elevation_m: float = 0.0
    timezone: str | None = None

    def __post_init__(self) -> None:
        store_number(self, "latitude_deg", -90.0, 90.0)
        store_number(self, "longitude_deg", -180.0, 180.0)
        store_number(self, "elevation_m", -500.0, 9000.0)


def _sky_type(value: Any) -> int | str:
    """The type of a sky as a number from 1 to 16, or the name of one with its own formula."""
    if isinstance(value, str):
        found: Any = SKY_NAMES.get(value, value)
        if found in (*OWN_FORMULAS, *SKY_NAMES.values()):
            return int(found) if isinstance(found, int) else str(found)
    elif np.ndim(value) == 0 and not isinstance(value, bool) and value in range(1, 17):
        return int(value)
    names = ", ".join((*SKY_NAMES, *OWN_FORMULAS))
    raise InputError(f"CIESky.type = {value!r}: must be 1 to 16 or one of {names}")


def direction(altitude_deg: float, azimuth_deg: float) -> tuple[float, float, float]:
    """Unit vector (x east, y north, z up) towards altitude and azimuth."""
    altitude, azimuth = math.radians(altitude_deg), math.radians(azimuth_deg)
    horizontal = math.cos(altitude)
    return (horizontal * math.sin(azimuth), horizontal * math.cos(azimuth), math.sin(altitude))
