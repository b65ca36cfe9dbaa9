"""Sky, sun, ground and site. Azimuths are clockwise from north, altitudes above the horizon."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError

#: Names of Radiance's gensky for skies of this module.
SKY_NAMES = {"overcast": 16, "uniform": 5, "clear": 12}


def _finite(name: str, value: float, low: float, high: float) -> float:
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(f"{name} = {value}: must lie between {low:g} and {high:g}")
    return float(value)


@dataclass(frozen=True, slots=True)
class CIESky:
    """Standard sky of CIE S 011 / ISO 15469 (types 1–15) or the traditional overcast sky (16).

    Attributes
    ----------
    type : int or str
        1 … 16, or ``"overcast"`` (16), ``"uniform"`` (5), ``"clear"`` (12).
    sun_altitude_deg, sun_azimuth_deg : float, optional
        Position of the sun the sky belongs to; types 1, 3, 5 and 16 do not need one. [deg]
    diffuse_illuminance_lx, zenith_luminance_cd_m2 : float, optional
        Absolute level: horizontal illuminance of the sky alone [lx], or zenith luminance [cd/m²].
        Without either the sky is scaled to 10 000 lx and `relative` is true.
    cct_k : float
        Colour of the whole sky. [K]
    """

    type: int | str = 16
    sun_altitude_deg: float | None = None
    sun_azimuth_deg: float | None = None
    diffuse_illuminance_lx: float | None = None
    zenith_luminance_cd_m2: float | None = None
    cct_k: float = 6500.0

    def __post_init__(self) -> None:
        number = SKY_NAMES.get(self.type, self.type) if isinstance(self.type, str) else self.type
        if number not in range(1, 17):
            names = ", ".join(SKY_NAMES)
            raise InputError(f"CIESky.type = {self.type!r}: must be 1 to 16 or one of {names}")
        object.__setattr__(self, "type", int(number))
        if self.sun_altitude_deg is not None:
            _finite("CIESky.sun_altitude_deg", self.sun_altitude_deg, 0.0, 90.0)
        if self.sun_azimuth_deg is not None:
            _finite("CIESky.sun_azimuth_deg", self.sun_azimuth_deg, -360.0, 360.0)
        if self.needs_sun and (self.sun_altitude_deg is None or self.sun_azimuth_deg is None):
            raise InputError(
                f"CIESky: type {self.type} brightens towards the sun; "
                "give sun_altitude_deg and sun_azimuth_deg"
            )
        levels = (self.diffuse_illuminance_lx, self.zenith_luminance_cd_m2)
        if None not in levels:
            raise InputError("CIESky: give diffuse_illuminance_lx or zenith_luminance_cd_m2")
        for name in ("diffuse_illuminance_lx", "zenith_luminance_cd_m2"):
            value = getattr(self, name)
            if value is not None:
                _finite(f"CIESky.{name}", value, 0.0, 1e7)
        if not 4000.0 <= self.cct_k <= 25000.0:
            raise InputError(f"CIESky.cct_k = {self.cct_k}: must lie between 4000 and 25000")

    @property
    def needs_sun(self) -> bool:
        """Whether the luminance depends on the position of the sun."""
        return self.type not in (1, 3, 5, 16)

    @property
    def relative(self) -> bool:
        """Whether the level is the default one and not a given one."""
        return self.diffuse_illuminance_lx is None and self.zenith_luminance_cd_m2 is None

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
    """

    direct_normal_w_m2: float
    diffuse_horizontal_w_m2: float
    sun_altitude_deg: float
    sun_azimuth_deg: float
    dew_point_c: float = 10.97
    sun_nearness: float = 1.0
    cct_k: float = 6500.0

    def __post_init__(self) -> None:
        _finite("PerezSky.direct_normal_w_m2", self.direct_normal_w_m2, 0.0, 1500.0)
        _finite("PerezSky.diffuse_horizontal_w_m2", self.diffuse_horizontal_w_m2, 0.0, 1500.0)
        _finite("PerezSky.sun_altitude_deg", self.sun_altitude_deg, 0.0, 90.0)
        _finite("PerezSky.sun_azimuth_deg", self.sun_azimuth_deg, -360.0, 360.0)
        _finite("PerezSky.dew_point_c", self.dew_point_c, -90.0, 40.0)
        _finite("PerezSky.sun_nearness", self.sun_nearness, 0.96, 1.04)
        if not 4000.0 <= self.cct_k <= 25000.0:
            raise InputError(f"PerezSky.cct_k = {self.cct_k}: must lie between 4000 and 25000")

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
Sky = CIESky | PerezSky


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun as a disc of uniform luminance.

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
    """

    altitude_deg: float
    azimuth_deg: float
    normal_illuminance_lx: float
    angular_radius_arcmin: float = 16.0
    cct_k: float = 5500.0

    def __post_init__(self) -> None:
        _finite("Sun.altitude_deg", self.altitude_deg, -90.0, 90.0)
        _finite("Sun.azimuth_deg", self.azimuth_deg, -360.0, 360.0)
        _finite("Sun.normal_illuminance_lx", self.normal_illuminance_lx, 0.0, 1e6)
        _finite("Sun.angular_radius_arcmin", self.angular_radius_arcmin, 1e-3, 600.0)
        _finite("Sun.cct_k", self.cct_k, 1000.0, 25000.0)

    @classmethod
    def at(
        cls,
        site: Site,
        time: datetime.datetime | str,
        *,
        normal_illuminance_lx: float,
        **more: float,
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
        if self.reflectance is not None:
            _finite("Ground.reflectance", self.reflectance, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Site:
    """Place on earth; longitude positive to the east."""

    latitude_deg: float
    longitude_deg: float
    elevation_m: float = 0.0
    timezone: str | None = None

    def __post_init__(self) -> None:
        _finite("Site.latitude_deg", self.latitude_deg, -90.0, 90.0)
        _finite("Site.longitude_deg", self.longitude_deg, -180.0, 180.0)
        _finite("Site.elevation_m", self.elevation_m, -500.0, 9000.0)


def direction(altitude_deg: float, azimuth_deg: float) -> tuple[float, float, float]:
    """Unit vector (x east, y north, z up) towards altitude and azimuth."""
    altitude, azimuth = math.radians(altitude_deg), math.radians(azimuth_deg)
    horizontal = math.cos(altitude)
    return (horizontal * math.sin(azimuth), horizontal * math.cos(azimuth), math.sin(altitude))
