"""The command ``patchlight sky``: numbers and picture of a sky."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from patchlight.solver.errors import InputError

if TYPE_CHECKING:
    from patchlight.solver.model import Sky, Sun

    from .sky_preview import SkyPreview


def sky(
    type_: Annotated[str | None, Parameter(name="TYPE")] = None,
    /,
    *,
    time: str | None = None,
    latitude: float | None = None,
    longitude: float | None = None,
    timezone: str | None = None,
    sun_altitude: float | None = None,
    sun_azimuth: float | None = None,
    weather: Path | None = None,
    patches: Path | None = None,
    scene: Path | None = None,
    direct: float | None = None,
    diffuse: float | None = None,
    diffuse_illuminance: float | None = None,
    zenith_luminance: float | None = None,
    estimated: Annotated[bool, Parameter(negative=())] = False,
    turbidity: float | None = None,
    color: Literal["constant", "chain", "preetham"] | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Show a sky: luminances, illuminances in the open, the sun, and a picture of it.

    Parameters
    ----------
    type_
        1 to 16 as by CIE S 011, or overcast, uniform, clear, intermediate as by Radiance's gensky;
        16 where nothing else tells the sky.
    time
        Such as 2026-06-21T12:00, as clocks at the place show it, or with its offset; with
        --weather local standard time, as the file has it.
    latitude
        Of the place, positive north. [degrees]
    longitude
        Positive east. [degrees]
    timezone
        Name such as Europe/Berlin, for a time without its offset.
    sun_altitude
        Where the sun stands, instead of time and place. [degrees]
    sun_azimuth
        Clockwise from north. [degrees]
    weather
        EPW file: the sky of Perez from its irradiances at --time.
    patches
        Text file of a measured sky, 145 luminances.
    scene
        Scene file: its sky and its sun.
    direct
        Direct normal irradiance of a sky of Perez. [W/m²]
    diffuse
        Its diffuse horizontal irradiance. [W/m²]
    diffuse_illuminance
        Level: horizontal illuminance of the sky alone. [lx]
    zenith_luminance
        Level: luminance of the zenith. [cd/m²]
    estimated
        Level: what is typical at the sun's altitude.
    turbidity
        Of estimated levels of clear skies, 2.45 when not given, and of the colour of the clear sky,
        3 when neither tells it.
    color
        Model of its colour by direction: one for all, by luminance (Chain 1999), or of the clear
        sky (Preetham 1999); with --scene that of the scene when not given.
    output
        Picture to write, a PNG file.
    json_
        Print everything as JSON.
    """
    place = {"latitude": latitude, "longitude": longitude, "timezone": timezone}
    position = {"sun_altitude": sun_altitude, "sun_azimuth": sun_azimuth}
    levels = {
        "diffuse_illuminance_lx": diffuse_illuminance,
        "zenith_luminance_cd_m2": zenith_luminance,
        "estimated": estimated or None,
        # Of a colour that depends on it there need be no such level.
        "turbidity": None if color == "preetham" and not estimated else turbidity,
    }
    irradiance = {"direct": direct, "diffuse": diffuse}
    files = {"weather": weather, "patches": patches, "scene": scene}
    given = {name: file for name, file in files.items() if file is not None}
    if len(given) > 1:
        raise InputError(f"give one of {', '.join(f'--{name}' for name in given)}")
    if weather is not None:
        _refuse("--weather", {"TYPE": type_, **place, **position, **irradiance, **levels})
        shown = _of_weather(weather, time)
    elif scene is not None:
        _refuse(
            "--scene", {"TYPE": type_, "time": time, **place, **position, **irradiance, **levels}
        )
        shown = _of_scene(scene)
    else:
        altitude, azimuth = _sun_place(time, place, position)
        if patches is not None:
            level = levels.pop("diffuse_illuminance_lx")
            _refuse("--patches", {"TYPE": type_, **irradiance, **levels})
            shown = _of_patches(patches, altitude, azimuth, level)
        elif direct is not None or diffuse is not None:
            _refuse("--direct and --diffuse", {"TYPE": type_, **levels})
            shown = _of_irradiance(direct, diffuse, altitude, azimuth)
        else:
            shown = _of_type(type_ or "16", altitude, azimuth, levels)
    model: str | None = color
    if scene is not None and color is None and shown.sky.color != "constant":
        model = shown.sky.color
    haze = turbidity if color == "preetham" else None
    shown = dataclasses.replace(shown, color=model, turbidity=haze)
    if output is not None:
        from patchlight.reports.files import write_bytes
        from patchlight.reports.sky_figure import sky_png

        write_bytes(output, sky_png(shown.sky, shown.sun_position))
    print(json.dumps(shown.record(), indent=2) if json_ else shown.text())
    return 0


def _refuse(by: str, options: dict[str, Any]) -> None:
    """Raise `InputError` for options that what ``by`` says leaves without effect."""
    odd = [name.split("_lx")[0].split("_cd")[0] for name, v in options.items() if v is not None]
    if odd:
        names = ", ".join(name if name == "TYPE" else "--" + name.replace("_", "-") for name in odd)
        raise InputError(f"{names}: not used together with {by}")


def _sun_place(
    time: str | None, place: dict[str, Any], position: dict[str, float | None]
) -> tuple[float | None, float | None]:
    """Altitude and azimuth of the sun as given, or at a time and place; None for neither."""
    altitude, azimuth = position["sun_altitude"], position["sun_azimuth"]
    if (altitude is None) != (azimuth is None):
        raise InputError("give --sun-altitude and --sun-azimuth together")
    if time is None:
        _refuse("a sun that stands at no --time", place)
        return altitude, azimuth
    _refuse("--time", position)
    if place["latitude"] is None or place["longitude"] is None:
        raise InputError("--time: give --latitude and --longitude, or --weather")
    from patchlight.solver.model import Site, Sun

    site = Site(place["latitude"], place["longitude"], timezone=place["timezone"])
    sun = Sun.at(site, time, normal_illuminance_lx=0.0)
    if sun.altitude_deg < 0.0:
        raise InputError(f"--time {time}: the sun is at {sun.altitude_deg:.2f} degrees: no day")
    return sun.altitude_deg, sun.azimuth_deg


def _of_type(
    type_: str, altitude: float | None, azimuth: float | None, levels: dict[str, Any]
) -> SkyPreview:
    from patchlight.solver.gensky import estimated_sun_illuminance
    from patchlight.solver.model import CIESky, Sun

    from .sky_preview import SkyPreview

    kind: int | str = int(type_) if type_.isdigit() else type_
    known = {name: value for name, value in levels.items() if value is not None}
    found: Sky = CIESky(kind, altitude, azimuth, **known)
    sun: Sun | None = None
    if isinstance(found, CIESky) and found.estimated and altitude is not None:
        level = estimated_sun_illuminance(found)
        if level > 0.0 and azimuth is not None:
            sun = Sun(altitude, azimuth, level)
    return SkyPreview(found, sun)


def _of_irradiance(
    direct: float | None, diffuse: float | None, altitude: float | None, azimuth: float | None
) -> SkyPreview:
    from patchlight.solver.model import PerezSky
    from patchlight.solver.perez import sun_of

    from .sky_preview import SkyPreview

    if direct is None or diffuse is None:
        raise InputError("give --direct and --diffuse together")
    if altitude is None or azimuth is None:
        raise InputError("--direct and --diffuse: give --sun-altitude and --sun-azimuth, or --time")
    found = PerezSky(
        direct_normal_w_m2=direct,
        diffuse_horizontal_w_m2=diffuse,
        sun_altitude_deg=altitude,
        sun_azimuth_deg=azimuth,
    )
    return SkyPreview(found, sun_of(found))


def _of_weather(file: Path, time: str | None) -> SkyPreview:
    from patchlight.importers import read_weather
    from patchlight.solver.weather_sky import sky_at

    from .sky_preview import SkyPreview

    if time is None:
        raise InputError("--weather: give --time")
    weather = read_weather(file)
    found, sun, told = sky_at(weather, time)
    return SkyPreview(found, sun, (f"{weather.place}: {told}", *weather.remarks))


def _of_patches(
    file: Path, altitude: float | None, azimuth: float | None, level: float | None
) -> SkyPreview:
    from patchlight.importers import read_patch_sky

    from .sky_preview import SkyPreview

    found = read_patch_sky(
        file, sun_altitude_deg=altitude, sun_azimuth_deg=azimuth, diffuse_illuminance_lx=level
    )
    return SkyPreview(found)


def _of_scene(file: Path) -> SkyPreview:
    from .scene_file import light_of_file
    from .sky_preview import SkyPreview

    light = light_of_file(file)
    if light.sky is None:
        raise InputError(f"{file}: sky: the scene has none")
    return SkyPreview(light.sky, light.sun, light.remarks)
