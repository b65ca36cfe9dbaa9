"""What was computed with, in the words and tables of the report; no layout here."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.model import (
    CIESky,
    Luminaire,
    PatchSky,
    PerezSky,
    SceneData,
    SensorResult,
    Sky,
    Sun,
)
from patchlight.solver.model.bands import LUMINANCE_WEIGHTS
from patchlight.solver.skies import horizontal_illuminance

from . import formats as f

#: Sky types of ISO 15469:2004 (CIE S 011), table 1; 16 is the traditional overcast sky of the CIE.
SKY_TYPES = {
    1: "CIE standard overcast sky",
    2: "overcast, steep gradation, slightly brighter towards the sun",
    3: "overcast, moderate gradation, the same in all azimuths",
    4: "overcast, moderate gradation, slightly brighter towards the sun",
    5: "sky of uniform luminance",
    6: "partly cloudy, no gradation, slightly brighter towards the sun",
    7: "partly cloudy, no gradation, brighter around the sun",
    8: "partly cloudy, no gradation, distinct solar corona",
    9: "partly cloudy, sun obscured",
    10: "partly cloudy, brighter around the sun",
    11: "white-blue sky with distinct solar corona",
    12: "CIE standard clear sky, low turbidity",
    13: "CIE standard clear sky, polluted atmosphere",
    14: "cloudless turbid sky with broad solar corona",
    15: "white-blue turbid sky with broad solar corona",
    16: "traditional CIE overcast sky (Moon and Spencer)",
}


#: Models of the colour of the sky, as reports name them.
SKY_COLOR_MODELS = {
    "chain": "Chain et al. 1999, by luminance",
    "preetham": "Preetham et al. 1999, clear sky",
}


def sky_text(sky: Sky | None) -> str:
    """Sky model and its absolute level."""
    if sky is None:
        return "none"
    if isinstance(sky, PerezSky):
        return (
            f"all-weather sky of Perez 1993; {f.number(sky.direct_normal_w_m2)} W/m² direct normal "
            f"and {f.number(sky.diffuse_horizontal_w_m2)} W/m² diffuse horizontal, "
            f"{f.number(horizontal_illuminance(sky))} lx of these; dew point "
            f"{f.number(sky.dew_point_c)} °C; sun at "
            f"{_position(sky.sun_altitude_deg, sky.sun_azimuth_deg)}; {_sky_color(sky)}"
        )
    if isinstance(sky, PatchSky):
        scaled = "as measured" if sky.diffuse_illuminance_lx is None else "scaled"
        text = (
            f"145 patches of even luminance; {f.number(horizontal_illuminance(sky))} lx diffuse "
            f"horizontal, {scaled}"
        )
        if sky.sun_altitude_deg is not None:
            text += f"; sun at {_position(sky.sun_altitude_deg, sky.sun_azimuth_deg)}"
        return f"{text}; {_sky_color(sky)}"
    known = f"CIE type {sky.type}, {SKY_TYPES[sky.type]}" if isinstance(sky.type, int) else ""
    text = known or f"{sky.type} sky as by Radiance's gensky"
    if sky.estimated:
        text += (
            f"; level estimated from the sun's altitude{_turbidity(sky)}: "
            f"{f.number(horizontal_illuminance(sky))} lx diffuse horizontal"
        )
    elif sky.diffuse_illuminance_lx is not None:
        text += f"; {f.number(sky.diffuse_illuminance_lx)} lx diffuse horizontal"
    elif sky.zenith_luminance_cd_m2 is not None:
        text += f"; zenith luminance {f.number(sky.zenith_luminance_cd_m2)} cd/m²"
    else:
        text += "; no level given: scaled to 10 000 lx diffuse horizontal (relative)"
    if sky.needs_sun:
        text += f"; sun at {_position(sky.sun_altitude_deg, sky.sun_azimuth_deg)}"
    return f"{text}; {_sky_color(sky)}"


def _sky_color(sky: Sky) -> str:
    """Colour temperature of a sky, or the model it is by."""
    if sky.color == "constant":
        return f"{f.number(sky.cct_k, 4)} K"
    return f"colour by direction modelled ({SKY_COLOR_MODELS[sky.color]})"


def _sun_color(sun: Sun) -> str:
    """Colour temperature of the sun, or the model it is by."""
    if sun.color == "constant":
        return f"{f.number(sun.cct_k, 4)} K"
    return "colour by altitude modelled (Bird and Riordan 1986, air of ASTM G173)"


def _turbidity(sky: CIESky) -> str:
    return "" if sky.turbidity is None else f" and the turbidity {sky.turbidity:g}"


def overcast_text(grid: SensorResult) -> str:
    """The sky that the daylight factors of a grid hold under; empty where there are none."""
    if grid.daylight is None:
        return ""
    return f"{SKY_TYPES[grid.daylight.sky_type]}, type {grid.daylight.sky_type}"


def _position(altitude: float | None, azimuth: float | None) -> str:
    return f"altitude {f.number(altitude, 4)}°, azimuth {f.number(azimuth, 4)}° from north"


def light_facts(scene: SceneData) -> list[tuple[str, str]]:
    """Sky, sun, ground, site, north and maintenance factor."""
    sun, ground, site = scene.sun, scene.ground, scene.site
    daylight = scene.sky is not None or sun is not None
    facts = [("Sky", sky_text(scene.sky))]
    if sun is None:
        facts.append(("Sun", "none"))
    else:
        facts.append((
            "Sun",
            f"{_position(sun.altitude_deg, sun.azimuth_deg)}; "
            f"{f.number(sun.normal_illuminance_lx)} lx normal; disc of radius "
            f"{f.number(sun.angular_radius_arcmin)}′; {_sun_color(sun)}",
        ))  # fmt: skip
    if daylight:
        known = ground is not None and ground.reflectance is not None
        facts.append(
            ("Ground", f"uniform, reflectance {ground.reflectance:g}" if known else "none")  # type: ignore[union-attr]
        )
    if site is not None:
        place = (
            f"{abs(site.latitude_deg):g}° {'N' if site.latitude_deg >= 0 else 'S'}, "
            f"{abs(site.longitude_deg):g}° {'E' if site.longitude_deg >= 0 else 'W'}, "
            f"{site.elevation_m:g} m"
        )
        facts.append(("Site", place + (f", {site.timezone}" if site.timezone else "")))
    if daylight or scene.north_deg:
        facts.append(("True north", f"{scene.north_deg:g}° clockwise from +y of the model"))
    if scene.luminaires:
        facts.append(("Maintenance factor", f"{scene.maintenance_factor:g}, on all luminaires"))
    return facts


def material_rows(scene: SceneData) -> list[dict[str, Any]]:
    """Materials in use with swatch, reflectance, number of faces and area. [m²]"""
    areas = scene.patches.areas() if len(scene.patches) else np.zeros(0)
    rows = []
    sides = np.asarray(scene.material_index)
    active = np.column_stack([np.ones(len(areas), dtype=bool), scene.two_sided])
    default = np.zeros(max(len(scene.faces), 1), dtype=bool)
    default[: len(scene.default_faces)] = scene.default_faces
    for k, material in enumerate(scene.materials):
        used = (sides == k) & active
        patches = used.any(axis=1)
        if not patches.any():
            continue
        faces = np.unique(scene.patches.face_index[patches])
        color = material.scattered_bands + material.mirror_bands
        text = _shares(material.bands)
        if material.is_glossy:
            text += f"; specular {_shares(material.specular_bands)}, n {material.exponent:g}"
        if material.is_mirror:
            text += f"; mirror {_shares(material.mirror_bands)}"
        on_default = int(default[faces[faces < len(default)]].sum())
        rows.append(
            {
                "name": material.name or f"material {k + 1}",
                "swatch": f.srgb_hex(color),
                "reflectance": text,
                "faces": f.count(len(faces)),
                "area": f.number(float((areas[:, None] * used).sum())),
                "default": f.count(on_default) if on_default else "",
            }
        )
    black = (sides == -1) & active & (np.asarray(scene.luminaire_index) < 0)
    if black.any():
        rows.append(
            {
                "name": "black",
                "swatch": "#000000",
                "reflectance": "0",
                "faces": f.count(len(np.unique(scene.patches.face_index[black.any(axis=1)]))),
                "area": f.number(float((areas[:, None] * black).sum())),
                "default": "",
            }
        )
    return rows


def _shares(bands: np.ndarray) -> str:
    """Luminous value of shares (3,) by band, and all of them where they differ."""
    text = f"{float(bands @ np.array(LUMINANCE_WEIGHTS)):.2f}"
    if np.ptp(bands) != 0.0:
        text += " (RGB " + ", ".join(f"{b:.2f}" for b in bands) + ")"
    return text


def default_faces(scene: SceneData, *, limit: int = 40) -> tuple[int, list[str]]:
    """Number of faces on the default material, and their names by part, the first ``limit``."""
    rows = np.flatnonzero(scene.default_faces)
    by_part: dict[str, list[int]] = defaultdict(list)
    for row in rows:
        face = scene.faces[row]
        by_part[scene.parts[face.part].path].append(face.number)
    lines = []
    for path, numbers in list(by_part.items())[:limit]:
        shown = ", ".join(f"#{n}" for n in sorted(numbers)[:12])
        more = f" and {len(numbers) - 12} more" if len(numbers) > 12 else ""
        lines.append(f"{path}: {shown}{more}")
    if len(by_part) > limit:
        lines.append(f"and {len(by_part) - limit} more parts")
    return len(rows), lines


def luminaire_rows(scene: SceneData) -> list[dict[str, str]]:
    """Luminaires with what was computed with; equal ones of a group are counted together."""
    merged: dict[tuple[Any, ...], list[Luminaire]] = defaultdict(list)
    for lamp in scene.luminaires:
        # Rounded: copies of one lamp differ by rounding of their area.
        area = float(f"{lamp.area_m2:.6g}")
        key = (
            lamp.group,
            lamp.flux_lm,
            # Not the number alone: of saturated light it is none, and equals not itself.
            lamp.cct_k if lamp.spectrum is None else lamp.spectrum,
            lamp.power_w,
            area,
            f.srgb_hex(_bright(lamp.color)),
            web_name(lamp),
            "" if lamp.profile is None else lamp.profile.kind,
        )
        merged[key].append(lamp)
    rows = []
    for (group, flux, _, power, area, swatch, web, profile), lamps in merged.items():
        parts, cct = [lamp.part for lamp in lamps], lamps[0].cct_k
        new = flux / scene.maintenance_factor
        rows.append(
            {
                "part": parts[0] + (f" … {parts[-1]}" if len(parts) > 1 else ""),
                "count": f.count(len(parts)),
                "group": group,
                "flux": f.number(flux, 4),
                "cct": f.number(cct, 4),
                "power": f.number(power) if power else f.MISSING,
                "efficacy": f.number(new / power) if power else f.MISSING,
                "area": f.number(area),
                # That of a web is another one in every direction.
                "luminance": f.MISSING if web or not area > 0.0 else f.number(flux / area / np.pi),
                "swatch": swatch,
                "web": web,
                "profile": profile,
            }
        )
    return rows


def web_name(lamp: Luminaire) -> str:
    """What a luminaire's photometric web is called; empty for one without."""
    if lamp.web is None:
        return ""
    photometry = lamp.web.photometry
    return Path(photometry.source).name or photometry.name or "photometric web"


def web_rows(scene: SceneData) -> list[dict[str, str]]:
    """Photometric webs in use: name, file, hash, format and flux, each once."""
    webs = {id(lamp.web.photometry): lamp.web.photometry for lamp in scene.luminaires if lamp.web}
    return [
        {
            "name": p.name,
            "file": p.source,
            "sha256": p.sha256,
            "format": p.format,
            "flux": f.number(p.flux_lm, 4),
        }
        for p in webs.values()
    ]


def _bright(color: Any) -> Any:
    """Light colours are scaled to luminance 1 and may leave the display's range."""
    c = np.maximum(np.asarray(color, dtype=np.float64), 0.0)
    return c / max(float(c.max()), 1e-9)


def luminaire_totals(scene: SceneData) -> str:
    """Sum of flux and power, when there is more than one luminaire."""
    if len(scene.luminaires) < 2:
        return ""
    flux = sum(lamp.flux_lm for lamp in scene.luminaires)
    powers = [lamp.power_w for lamp in scene.luminaires]
    text = f"Together {f.number(flux, 4)} lm"
    if all(p is not None for p in powers):
        text += f" and {f.number(sum(p for p in powers if p is not None))} W"
    return text
