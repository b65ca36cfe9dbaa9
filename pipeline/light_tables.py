"""Tables [sky], [sun] and [ground] of scene.toml."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from patchlight.solver.errors import InputError
from patchlight.solver.model import CIESky, Ground, PerezSky, Sky, Sun
from pydantic import Field, StrictBool

from .scene_table import Number, Table, Text

#: Keys of [sky] that belong to one model alone.
_OF_MODEL = {
    "cie": {"type", "diffuse_illuminance_lx", "zenith_luminance_cd_m2"},
    "perez": {"direct_normal_w_m2", "diffuse_horizontal_w_m2", "dew_point_c"},
}
_PEREZ_NEEDS = (
    "direct_normal_w_m2",
    "diffuse_horizontal_w_m2",
    "sun_altitude_deg",
    "sun_azimuth_deg",
)


class SkyTable(Table):
    """Sky of CIE S 011 or the traditional overcast one (cie), or from irradiances (perez)."""

    model: Literal["cie", "perez"] = "cie"
    type: Annotated[int, Field(strict=True)] | Text | None = None
    """cie: 1 to 15; 16, which is taken when none is given, is the traditional overcast sky."""
    sun_altitude_deg: Number | None = None
    """Taken from [sun] when not given. [deg]"""
    sun_azimuth_deg: Number | None = None
    diffuse_illuminance_lx: Number | None = None
    """cie: horizontal illuminance of the sky alone; 10 000 lx when no level is given. [lx]"""
    zenith_luminance_cd_m2: Number | None = None
    direct_normal_w_m2: Number | None = None
    """perez: irradiance by the sun on a plane facing it. [W/m²]"""
    diffuse_horizontal_w_m2: Number | None = None
    """perez: irradiance by the sky on a level plane. [W/m²]"""
    dew_point_c: Number | None = None
    """perez: tells the water in the atmosphere; 10.97 when not given. [°C]"""
    cct_k: Number = 6500.0

    def build(self) -> None:
        """Nothing yet: the position of the sun may stand in [sun]."""
        for model, keys in _OF_MODEL.items():
            odd = sorted(keys & self.given().keys()) if model != self.model else []
            if odd:
                raise InputError(f"{', '.join(odd)}: of model {model!r}, not {self.model!r}")

    def build_with(self, sun: SunTable | None) -> Sky:
        """The sky, with the sun's position of ``sun`` where it has none."""
        values = {k: v for k, v in self.given().items() if k != "model"}
        if sun is not None and self.sun_altitude_deg is None and self.sun_azimuth_deg is None:
            values["sun_altitude_deg"] = min(90.0, max(0.0, sun.altitude_deg))
            values["sun_azimuth_deg"] = sun.azimuth_deg
        if self.model == "cie":
            return CIESky(**values)
        lacking = [key for key in _PEREZ_NEEDS if key not in values]
        if lacking:
            raise InputError(f"model 'perez' needs {', '.join(lacking)}")
        return PerezSky(**values)


class SunTable(Table):
    """Disc of the sun."""

    altitude_deg: Number
    azimuth_deg: Number
    """Clockwise from north. [deg]"""
    normal_illuminance_lx: Number | None = None
    """That of the irradiance in [sky] when its model is perez and none is given. [lx]"""
    angular_radius_arcmin: Number = 16.0
    cct_k: Number = 5500.0

    def build(self) -> Sun:
        """The sun; dark where its level may stand in [sky]."""
        return Sun(**{"normal_illuminance_lx": 0.0, **self.given()})

    def build_with(self, sky: Sky | None) -> Sun:
        """The sun, with the level that ``sky`` tells where it has none."""
        if self.normal_illuminance_lx is not None:
            return self.build()
        if not isinstance(sky, PerezSky):
            raise InputError("give normal_illuminance_lx: only a sky of model 'perez' tells it")
        from patchlight.solver.perez import sun_of

        return dataclasses.replace(
            self.build(), normal_illuminance_lx=sun_of(sky).normal_illuminance_lx
        )


class GroundTable(Table):
    """Uniform lower hemisphere."""

    reflectance: Number = 0.2
    modelled: StrictBool = False
    """The terrain is part of the model: no light comes from below the horizon."""

    def build(self) -> Ground:
        """The ground."""
        return Ground(None if self.modelled else self.reflectance)
