"""Picture of a sky: luminance by direction, as a fisheye that looks up sees it."""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model import Sky
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.skies import luminance

from . import figures
from .tonemap import luminance_range

#: Pixels across the sky, and circles of altitude that are drawn. [deg]
PIXELS, CIRCLES_DEG = 601, (30.0, 60.0)


def fisheye_luminance(sky: Sky, pixels: int = PIXELS) -> FloatArray:
    """Luminance (pixels, pixels) of the upper hemisphere, NaN beyond it. [cd/m²]

    The distance from the middle is proportional to the angle from the zenith. North is at the top,
    and east on the left, as for an observer who looks up.
    """
    at = np.linspace(-1.0, 1.0, pixels)
    right, up = np.meshgrid(at, -at)
    angle = 0.5 * math.pi * np.hypot(right, up)
    turn = np.arctan2(-right, up)  # clockwise from north
    d = np.stack([np.sin(angle) * np.sin(turn), np.sin(angle) * np.cos(turn), np.cos(angle)], -1)
    inside = angle <= 0.5 * math.pi
    out = np.full(angle.shape, np.nan)
    out[inside] = luminance(sky, d[inside])
    return out


def sky_png(sky: Sky, sun: tuple[float, float] | None = None) -> bytes:
    """PNG of the sky in false colours, logarithmic, with the sun's altitude and azimuth [deg]."""
    from matplotlib.colors import LogNorm

    values = fisheye_luminance(sky)
    ends = luminance_range(values) or (1.0, 10.0)
    with figures.look():
        figure = figures.new_figure(4.6, 4.0)
        axes = figure.add_axes((0.03, 0.03, 0.76, 0.9))
        axes.set_axis_off()
        axes.set_aspect("equal")
        shown = axes.imshow(
            np.ma.masked_invalid(np.clip(values, *ends)),
            extent=(-1.0, 1.0, -1.0, 1.0),
            norm=LogNorm(*ends),
            cmap="turbo",
            interpolation="nearest",
        )
        turn = np.linspace(0.0, 2.0 * math.pi, 181)
        for altitude in (0.0, *CIRCLES_DEG):
            r = 1.0 - altitude / 90.0
            axes.plot(r * np.cos(turn), r * np.sin(turn), color=figures.INK, linewidth=0.4)
        for name, x, y in (("N", 0, 1.07), ("E", -1.07, 0), ("S", 0, -1.07), ("W", 1.07, 0)):
            axes.text(x, y, name, ha="center", va="center", weight="bold")
        if sun is not None and sun[0] >= 0.0:
            r, azimuth = 1.0 - sun[0] / 90.0, math.radians(sun[1])
            axes.plot(
                [-r * math.sin(azimuth)], [r * math.cos(azimuth)], marker="o", markersize=7,
                markerfacecolor="white", markeredgecolor=figures.INK, markeredgewidth=0.8,
            )  # fmt: skip
        axes.set_xlim(-1.14, 1.14)
        axes.set_ylim(-1.14, 1.14)
        bar = figure.add_axes((0.82, 0.15, 0.035, 0.66))
        figure.colorbar(shown, cax=bar)
        bar.set_title("cd/m²", size=8, weight="bold", pad=6, loc="left")
        return figures.png(figure)
