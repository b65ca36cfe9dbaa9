"""What one sky is like: its levels, its sun, its luminance by direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from patchlight.solver.model import Sky, Sun
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.patch_sky import patch_middles
from patchlight.solver.model.sky import direction
from patchlight.solver.skies import (
    horizontal_illuminance,
    luminance,
    sun_horizontal_illuminance,
    zenith_luminance,
)

#: Directions of the printed table. [deg]
ALTITUDES = (75.0, 60.0, 45.0, 30.0, 15.0, 5.0)
#: What is said of modelled colours.
COLOR_DOUBT = "models differ by 0.02 in x and y"
COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


@dataclass(frozen=True, slots=True)
class SkyPreview:
    """A sky, the sun that goes with it if there is one, and remarks on both.

    ``color`` names a model of `patchlight.solver.sky_color` for the colour of each direction, and
    ``turbidity`` is that of the model where it is not that of the sky.
    """

    sky: Sky
    sun: Sun | None = None
    remarks: tuple[str, ...] = ()
    color: str | None = None
    turbidity: float | None = None

    @property
    def levels(self) -> dict[str, float]:
        """Zenith luminance [cd/m²] and illuminances in the open [lx] by name."""
        values = {
            "zenith_luminance_cd_m2": zenith_luminance(self.sky),
            "diffuse_horizontal_lx": horizontal_illuminance(self.sky),
        }
        if self.sun is not None:
            values["direct_normal_lx"] = self.sun.normal_illuminance_lx
            values["direct_horizontal_lx"] = sun_horizontal_illuminance(self.sun)
        values["global_horizontal_lx"] = values["diffuse_horizontal_lx"] + values.get(
            "direct_horizontal_lx", 0.0
        )
        return values

    @property
    def sun_position(self) -> tuple[float, float] | None:
        """Altitude and azimuth of the sun, or of that which the sky brightens towards. [deg]"""
        if self.sun is not None:
            return self.sun.altitude_deg, self.sun.azimuth_deg
        if self.sky.sun_altitude_deg is None or self.sky.sun_azimuth_deg is None:
            return None
        return self.sky.sun_altitude_deg, self.sky.sun_azimuth_deg

    def text(self) -> str:
        """Levels and a table of luminances for a terminal."""
        from patchlight.reports.formats import console
        from patchlight.reports.inputs import sky_text

        lines = [console(sky_text(self.sky))]
        lines += list(self.remarks)
        position = self.sun_position
        if position is not None:
            lines.append(f"sun: altitude {position[0]:.2f}, azimuth {position[1]:.2f} degrees")
        for name, value in self.levels.items():
            quantity, _, unit = name.partition("_lx" if name.endswith("_lx") else "_cd")
            unit = "lx" if not unit else "cd/m2"
            lines.append(f"  {quantity.replace('_', ' '):<20} {value:>12,.0f} {unit}")
        lines.append("luminance [cd/m2] by altitude [degrees] and azimuth")
        lines.append("      " + "".join(f"{name:>9}" for name in COMPASS))
        for altitude in ALTITUDES:
            row = self._at([(altitude, 45.0 * k) for k in range(len(COMPASS))])
            lines.append(f"{altitude:>4.0f}  " + "".join(f"{value:>9,.0f}" for value in row))
        return "\n".join(lines + self._color_lines())

    def _color_lines(self) -> list[str]:
        """Table of colour temperatures, where a colour model is asked for."""
        if self.color is None:
            return []
        from patchlight.solver.spectra import correlated_temperature

        lines = [f"colour temperature [K], modelled ({self.color}; {COLOR_DOUBT})"]
        for altitude in ALTITUDES:
            xy = self._colors([(altitude, 45.0 * k) for k in range(len(COMPASS))])
            row = correlated_temperature(xy)
            lines.append(f"{altitude:>4.0f}  " + "".join(f"{value:>9,.0f}" for value in row))
        return lines

    def record(self) -> dict[str, Any]:
        """The same for scripts, with luminances at the middles of the 145 patches of Tregenza."""
        from patchlight.reports.inputs import sky_text

        altitude, azimuth = patch_middles()
        places = list(zip(altitude.tolist(), azimuth.tolist(), strict=True))
        rows: list[dict[str, float]] = [
            {"altitude_deg": place[0], "azimuth_deg": place[1], "luminance_cd_m2": value}
            for place, value in zip(places, self._at(places).tolist(), strict=True)
        ]
        if self.color is not None:
            from patchlight.solver.sky_color import daylight_weights

            xy = self._colors(places)
            for row, color, weights in zip(rows, xy, daylight_weights(xy), strict=True):
                row |= dict(zip(("x", "y"), color.tolist(), strict=True))
                row |= dict(zip(("m1", "m2"), weights.tolist(), strict=True))
        position = self.sun_position
        return {
            "schema_version": 1,
            "sky": sky_text(self.sky),
            "relative": self.sky.relative,
            "remarks": list(self.remarks),
            "sun_altitude_deg": None if position is None else position[0],
            "sun_azimuth_deg": None if position is None else position[1],
            "color_model": None if self.color is None else f"{self.color}, modelled",
            **self.levels,
            "luminance": rows,
        }

    def _colors(self, places: list[tuple[float, float]]) -> FloatArray:
        from patchlight.solver.sky_color import sky_chromaticity

        d = np.array([direction(*place) for place in places])
        return sky_chromaticity(self.sky, d, str(self.color), turbidity=self.turbidity)

    def _at(self, places: list[tuple[float, float]]) -> FloatArray:
        return luminance(self.sky, np.array([direction(*place) for place in places]))
