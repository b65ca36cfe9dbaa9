"""The sky and the sun of every step of a weather file.

Perez' all-weather sky from irradiances, for all steps at once; see `perez`. Skies are told at the
middles of cells of the dome and are linear in between; each is scaled so that a level plane without
obstruction gets the diffuse illuminance that its irradiance makes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .dome_grid import DomeGrid
from .errors import InputError
from .model.arrays import FloatArray, IntArray, frozen
from .model.weather import Weather
from .perez import brightness, clearness, efficacies, in_form_of_cie, shapes
from .sun_position import nearness, sun_positions

#: Dew point taken where none is known: 2 cm of precipitable water, as Radiance's gendaylit has it.
DEW_POINT_C = 10.97
#: Places of the sun looked at in a step in which it rises or sets.
_LOOKS = 12
#: Lowest altitude for which shape and efficacies are told: it is that of the horizon below. [deg]
_LOWEST_DEG = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class SkySeries:
    """Skies and suns of n steps; row i of every array is the same step.

    Attributes
    ----------
    altitude_deg, azimuth_deg : (n,) array
        Where the sun stands in the middle of the step; of one in which it rises or sets, in the
        middle of the part in which it is up. [deg]
    suns : (n, 3) array
        Unit vectors to it, none below the horizon.
    shape : (n, 5) array
        a, b, c, d, e of the sky, in the form of CIE S 011.
    sky_lx : (n,) array
        Illuminance of the unobstructed sky on a level plane. [lx]
    sun_normal_lx : (n,) array
        Illuminance of the sun on a plane facing it; 0 while it is not up. [lx]
    clearness, brightness : (n,) array
        ε and Δ of Perez.
    """

    altitude_deg: FloatArray
    azimuth_deg: FloatArray
    suns: FloatArray
    shape: FloatArray
    sky_lx: FloatArray
    sun_normal_lx: FloatArray
    clearness: FloatArray
    brightness: FloatArray

    def __len__(self) -> int:
        return len(self.sky_lx)

    @classmethod
    def of(cls, weather: Weather) -> SkySeries:
        """Those of a weather file, its irradiances turned into light by Perez' efficacies."""
        altitude, azimuth, _ = suns_in(weather)
        return cls.from_irradiance(
            altitude,
            azimuth,
            weather.direct_normal_w_m2,
            weather.diffuse_horizontal_w_m2,
            np.where(np.isnan(weather.dew_point_c), DEW_POINT_C, weather.dew_point_c),
            nearness(weather.starts),
        )

    @classmethod
    def from_irradiance(
        cls,
        altitude_deg: FloatArray,
        azimuth_deg: FloatArray,
        direct_normal_w_m2: FloatArray,
        diffuse_horizontal_w_m2: FloatArray,
        dew_point_c: FloatArray,
        sun_nearness: FloatArray,
    ) -> SkySeries:
        """Skies (n,) from irradiances [W/m²]; see `PerezSky` for the others.

        Without diffuse radiation there is no sky, and while the sun is below the horizon no sun.
        """
        zenith = np.radians(90.0 - np.clip(altitude_deg, _LOWEST_DEG, 90.0))
        direct = np.where(altitude_deg > 0.0, direct_normal_w_m2, 0.0)
        epsilon = clearness(direct, diffuse_horizontal_w_m2, zenith)
        delta = brightness(diffuse_horizontal_w_m2, zenith, sun_nearness)
        of_sky, of_sun = efficacies(epsilon, delta, zenith, dew_point_c)
        turn = np.radians(azimuth_deg)
        suns = np.stack(
            [np.sin(zenith) * np.sin(turn), np.sin(zenith) * np.cos(turn), np.cos(zenith)], axis=1
        )
        return cls(
            altitude_deg=frozen(altitude_deg),
            azimuth_deg=frozen(azimuth_deg),
            suns=frozen(suns),
            shape=frozen(in_form_of_cie(shapes(epsilon, delta, zenith))),
            sky_lx=frozen(of_sky * diffuse_horizontal_w_m2),
            sun_normal_lx=frozen(of_sun * direct),
            clearness=frozen(epsilon),
            brightness=frozen(delta),
        )

    @property
    def is_day(self) -> NDArray[np.bool_]:
        """Steps (n,) with any light."""
        return np.asarray((self.sky_lx > 0.0) | (self.sun_normal_lx > 0.0))

    @property
    def level_lx(self) -> FloatArray:
        """Illuminance (n,) of sky and sun on an unobstructed level plane. [lx]"""
        return np.asarray(self.sky_lx + self.sun_normal_lx * np.maximum(self.suns[:, 2], 0.0))

    def luminances(self, grid: DomeGrid, steps: IntArray) -> FloatArray:
        """Luminances (B, k) of the skies of some ``steps`` (k,) at the middles of cells. [cd/m²]"""
        from .kernels.sky_tables import sky_table

        parameters = np.zeros((len(steps), 7))
        parameters[:, 1:6] = self.shape[steps]
        parameters[:, 6] = 1.0
        out = np.empty((len(grid), len(steps)))
        suns, directions = (np.array(a, order="C") for a in (self.suns[steps], grid.directions))
        sky_table(parameters, suns, directions, out)
        whole = grid.level @ out
        return np.asarray(out * (self.sky_lx[steps] / np.where(whole > 0.0, whole, 1.0)))


def suns_in(
    weather: Weather, steps: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where the sun stands in ``steps`` (n,) of a weather file, or in all of them.

    Returns
    -------
    altitude, azimuth : (n,) array
        In the middle of the part of each step in which it is up, or in its middle where it never
        is. [deg]
    part : (n,) array
        That part, over the step.
    """
    site, middles = weather.site, weather.middles_utc
    if steps is not None:
        middles = middles[np.asarray(steps)]
    altitude, azimuth = (np.array(a) for a in sun_positions(site, middles))
    part = (altitude > 0.0).astype(np.float64)
    # It climbs by no more than 15 degrees an hour.
    most = 0.25 * 0.5 * weather.step_minutes
    edge = np.flatnonzero(np.abs(altitude) < most)
    if not len(edge):
        return altitude, azimuth, part
    seconds = 60 * weather.step_minutes
    offsets = np.round((np.arange(_LOOKS) + 0.5) / _LOOKS * seconds - 0.5 * seconds)
    times = middles[edge, None] + offsets.astype("timedelta64[s]")
    heights = sun_positions(site, times.ravel())[0].reshape(times.shape)
    up = heights > 0.0
    part[edge] = up.mean(axis=1)
    some = up.any(axis=1) & ~up.all(axis=1)
    if some.any():
        rows = edge[some]
        lit = up[some]
        middle = (lit * offsets).sum(axis=1) / lit.sum(axis=1)
        at = middles[rows] + np.round(middle).astype("timedelta64[s]")
        altitude[rows], azimuth[rows] = sun_positions(site, at)
    return altitude, azimuth, part


def resampled(weather: Weather, step_minutes: int) -> Weather:
    """The same weather in shorter steps, each with the radiation of the longer one it is part of.

    Raises
    ------
    InputError
        If the steps of the file are no whole number of the shorter ones.
    """
    whole = isinstance(step_minutes, int) and not isinstance(step_minutes, bool)
    if not whole or step_minutes < 1 or weather.step_minutes % step_minutes:
        raise InputError(
            f"step_minutes = {step_minutes!r}: must part the steps of {weather.source}, "
            f"{weather.step_minutes} min, evenly"
        )
    parts = weather.step_minutes // step_minutes
    if parts == 1:
        return weather
    starts = weather.starts[:, None] + step_minutes * np.arange(parts)
    changed: dict[str, Any] = {
        "step_minutes": step_minutes,
        "starts": frozen(starts.ravel(), "datetime64[m]"),
    }
    for name in (
        "direct_normal_w_m2", "diffuse_horizontal_w_m2", "direct_normal_lx",
        "diffuse_horizontal_lx", "dew_point_c", "albedo",
    ):  # fmt: skip
        values = getattr(weather, name)
        if values is not None:
            changed[name] = frozen(np.repeat(values, parts))
    return replace(weather, **changed)
