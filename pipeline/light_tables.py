"""Tables [sky], [sun], [ground] and [daylight_factor] of scene.toml."""

from __future__ import annotations

import dataclasses
import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from patchlight.solver.errors import InputError
from patchlight.solver.gensky import estimated_sun_illuminance
from patchlight.solver.model import CIESky, DaylightFactors, Ground, PerezSky, Site, Sky, Sun
from pydantic import Field, StrictBool

from .scene_table import Number, Table, Text

#: Keys of [sky] that belong to one model alone.
_OF_MODEL = {
    "cie": {"type", "zenith_luminance_cd_m2", "estimated", "turbidity", "diffuse_illuminance_lx"},
    "perez": {"direct_normal_w_m2", "diffuse_horizontal_w_m2", "dew_point_c", "sun_nearness"},
    "patches": {"file", "diffuse_illuminance_lx"},
    "weather": {"file", "time"},
}
_PEREZ_NEEDS = (
    "direct_normal_w_m2",
    "diffuse_horizontal_w_m2",
    "sun_altitude_deg",
    "sun_azimuth_deg",
)


#: A time as text, or as TOML writes it.
Moment = Text | Annotated[datetime.datetime, Field(strict=True)]


class SkyTable(Table):
    """Sky of CIE S 011 or of gensky (cie), from irradiances (perez), as measured (patches), or of a
    moment of a weather file, whose irradiances make a sky of Perez (weather)."""

    model: Literal["cie", "perez", "patches", "weather"] = "cie"
    type: Annotated[int, Field(strict=True)] | Text | None = None
    """cie: 1 to 15; 16, which is taken when none is given, is the traditional overcast sky; or
    overcast, uniform, clear or intermediate as by Radiance's gensky."""
    sun_altitude_deg: Number | None = None
    """Taken from [sun] when not given; patches: for the colour of model preetham alone. [deg]"""
    sun_azimuth_deg: Number | None = None
    diffuse_illuminance_lx: Number | None = None
    """cie, patches: horizontal illuminance of the sky alone; 10 000 lx when no level is given, and
    as measured. [lx]"""
    zenith_luminance_cd_m2: Number | None = None
    estimated: StrictBool | None = None
    """cie: the level is what is typical at the sun's altitude."""
    turbidity: Number | None = None
    """cie: of estimated levels of clear skies; 2.45 when not given."""
    direct_normal_w_m2: Number | None = None
    """perez: irradiance by the sun on a plane facing it. [W/m²]"""
    diffuse_horizontal_w_m2: Number | None = None
    """perez: irradiance by the sky on a level plane. [W/m²]"""
    dew_point_c: Number | None = None
    """perez: tells the water in the atmosphere; 10.97 when not given. [°C]"""
    sun_nearness: Number | None = None
    """perez: square of the mean distance of the sun over its distance; 1 when not given."""
    file: Text | None = None
    """patches: text file with 145 luminances, see `read_patch_sky`; weather: EPW file; relative to
    the scene file."""
    time: Moment | None = None
    """weather: a time with its offset, or in local standard time, as the file has it."""
    cct_k: Number = 6500.0
    color: Literal["constant", "chain", "preetham"] = "constant"
    """Where light has a colour: cct_k everywhere, or modelled by direction."""

    def build(self) -> None:
        """Nothing yet: the position of the sun may stand in [sun]."""
        for model, keys in _OF_MODEL.items():
            odd = sorted((keys - _OF_MODEL[self.model]) & self.given().keys())
            if odd:
                raise InputError(f"{', '.join(odd)}: of model {model!r}, not {self.model!r}")
        lacking = [k for k in ("file", "time") if k in _OF_MODEL[self.model] - self.given().keys()]
        if lacking:
            raise InputError(f"model {self.model!r} needs {' and '.join(lacking)}")
        own_sun = {"sun_altitude_deg", "sun_azimuth_deg"} & self.given().keys()
        if self.model == "weather" and own_sun:
            raise InputError("sun_altitude_deg, sun_azimuth_deg: model 'weather' tells the sun")

    def build_with(self, sun: Sun | None, folder: Path) -> tuple[Sky, tuple[str, ...]]:
        """The sky, with the sun's position of ``sun`` where it has none, and remarks on its file.

        Files are named relative to ``folder``.
        """
        values = {k: v for k, v in self.given().items() if k not in ("model", "file")}
        if self.model == "weather":
            from patchlight.importers import read_weather
            from patchlight.solver.weather_sky import sky_at

            assert self.time is not None
            weather = read_weather(folder / str(self.file))
            found, _, told = sky_at(weather, self.time)
            remarks = (f"the sky is that of {weather.place}: {told}", *weather.remarks)
            return dataclasses.replace(found, cct_k=self.cct_k, color=self.color), remarks
        own_sun = self.sun_altitude_deg is not None or self.sun_azimuth_deg is not None
        if self.model == "patches":
            from patchlight.importers import read_patch_sky

            color = values.pop("color", "constant")
            if color == "preetham" and sun is not None and not own_sun:
                values |= _place_of(sun)
            patches = read_patch_sky(folder / str(self.file), **values)
            return dataclasses.replace(patches, color=color), ()
        if sun is not None and not own_sun:
            values |= _place_of(sun)
        if self.model == "cie":
            return CIESky(**values), ()
        lacking = [key for key in _PEREZ_NEEDS if key not in values]
        if lacking:
            raise InputError(f"model 'perez' needs {', '.join(lacking)}")
        return PerezSky(**values), ()


def _place_of(sun: Sun) -> dict[str, float]:
    """Where the sun of a sky stands that goes with ``sun``: at the horizon if that is below it."""
    return {
        "sun_altitude_deg": min(90.0, max(0.0, sun.altitude_deg)),
        "sun_azimuth_deg": sun.azimuth_deg,
    }


class SunTable(Table):
    """Disc of the sun: at a place in the sky, as it stands at a time, or that of [sky]."""

    altitude_deg: Number | None = None
    azimuth_deg: Number | None = None
    """Clockwise from north. [deg]"""
    time: Moment | None = None
    """Instead of the position, with [site]: what clocks show there, or a time with its offset.
    With neither the sun is that of [sky]."""
    normal_illuminance_lx: Number | None = None
    """That which [sky] tells when none is given: of model perez, or with estimated = true. [lx]"""
    angular_radius_arcmin: Number = 16.0
    cct_k: Number = 5500.0
    color: Literal["constant", "spectrl2"] = "constant"
    """Where light has a colour: cct_k, or modelled by the altitude."""
    limb_darkening: StrictBool = False
    """Whether the disc is darker towards its rim, as the sun is at 550 nm."""

    def build(self) -> None:
        """Nothing yet: the place stands in [site], and the level may stand in [sky]."""
        position = [self.altitude_deg is not None, self.azimuth_deg is not None]
        if any(position) != all(position) or (any(position) and self.time is not None):
            raise InputError("give altitude_deg and azimuth_deg, or time, or none of them")
        if all(position):
            self.build_at(None)

    def build_at(self, site: Site | None) -> Sun | None:
        """The sun; dark where its level may stand in [sky], None where its position does."""
        values: dict[str, Any] = {"normal_illuminance_lx": 0.0, **self.given()}
        time = values.pop("time", None)
        if time is None:
            return None if self.altitude_deg is None else Sun(**values)
        if site is None:
            raise InputError("time: give latitude_deg and longitude_deg in [site]")
        return Sun.at(site, time, **values)

    def build_with(self, sky: Sky | None, site: Site | None) -> Sun:
        """The sun, with the position and the level that ``sky`` tells where it has none."""
        sun = self.build_at(site)
        if sun is None:
            if sky is None or sky.sun_altitude_deg is None or sky.sun_azimuth_deg is None:
                raise InputError("give altitude_deg and azimuth_deg, or time: [sky] has no sun")
            values = {"normal_illuminance_lx": 0.0, **self.given()}
            sun = Sun(sky.sun_altitude_deg, sky.sun_azimuth_deg, **values)
        if self.normal_illuminance_lx is not None:
            return sun
        from patchlight.solver.perez import sun_of

        if isinstance(sky, PerezSky):
            level = sun_of(sky).normal_illuminance_lx
        elif isinstance(sky, CIESky) and sky.estimated:
            level = estimated_sun_illuminance(sky)
        else:
            raise InputError(
                "give normal_illuminance_lx: only a sky of model 'perez', or an estimated one, "
                "tells it"
            )
        return dataclasses.replace(sun, normal_illuminance_lx=level)


class GroundTable(Table):
    """Uniform lower hemisphere."""

    reflectance: Number = 0.2
    modelled: StrictBool = False
    """The terrain is part of the model: no light comes from below the horizon."""

    def build(self) -> Ground:
        """The ground."""
        return Ground(None if self.modelled else self.reflectance)


class DaylightFactorTable(Table):
    """Daylight factors beside other light."""

    sky_type: Literal[1, 16] = 16
    """CIE overcast sky they are found under; 16 is the traditional one."""
    outside: list[Text] = Field(default_factory=list)
    """Part patterns of what stands outdoors: what it reflects straight to a sensor is external."""

    def build(self) -> DaylightFactors:
        """What is asked for."""
        return DaylightFactors(self.sky_type, tuple(self.outside))
