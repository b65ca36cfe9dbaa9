"""What a user should know about the colour of light in a scene, one line each."""

from __future__ import annotations

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.light_colors import lamp_color
from patchlight.solver.model import CIESky, Material, SceneData
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.bands import SPECTRAL
from patchlight.solver.model.result import luminous
from patchlight.solver.sky_color import is_overcast

#: Share of the illuminance by which three bands and twenty may differ without a remark.
NOTED = 0.05
#: Most that is taken for the mean reflectance of a band: as of a room with some opening.
MOST_MEAN = 0.95


def color_warnings(data: SceneData) -> list[str]:
    """What makes colours that are computed others than the scene asks for."""
    found = []
    sky = data.sky
    by_level = isinstance(sky, CIESky) and sky.color == "chain" and not is_overcast(sky)
    if sky is not None and by_level and sky.relative and data.bands > 1:
        found.append(
            "the colour of the sky goes by its luminance (chain), but it has no level: that of "
            "10 000 lx is taken; give diffuse_illuminance_lx, zenith_luminance_cd_m2 or estimated"
        )
    if data.bands == SPECTRAL:
        names = [m.name for m in _used(data) if np.ptp(m.mirror_in(SPECTRAL)) > 1e-9]
        if names:
            from .remarks import listed

            found.append(
                "mirrors of a colour send grey light to spectral sensors and to surfaces, by their "
                f"luminous share: {listed(names)}"
            )
    return found


def color_notes(data: SceneData) -> list[str]:
    """What three bands leave of illuminance in coloured rooms under lamps."""
    if data.bands != 3:
        return []
    off = three_against_twenty(data)
    if abs(off) < NOTED:
        return []
    return [
        "coloured surfaces under lamps: mean illuminance in three bands is roughly "
        f"{abs(off):.0%} {'above' if off > 0.0 else 'below'} that of twenty, which a grid with "
        "spectral = true asks for"
    ]


def three_against_twenty(data: SceneData) -> float:
    """Excess of the mean illuminance by lamps in three bands over that in twenty, a fraction.

    Of a closed room whose surfaces all reflect as they do on average: in each band 1 / (1 − ρ) of
    the light that lamps send arrives.
    """
    area, shares = _reflected(data)
    flux = np.zeros(0)
    lights: dict[int, list[FloatArray]] = {3: [], SPECTRAL: []}
    for lamp in data.luminaires:
        try:
            colors = {bands: lamp_color(lamp, bands) for bands in lights}
        except InputError:
            continue  # light that no band has
        flux = np.append(flux, lamp.flux_lm)
        for bands, color in colors.items():
            lights[bands].append(color)
    if not (flux.sum() > 0.0 and area > 0.0):
        return 0.0
    level = {}
    for bands, colors_of in lights.items():
        mean = np.minimum(shares[bands] / area, MOST_MEAN)
        level[bands] = float(luminous(flux @ np.stack(colors_of) / flux.sum() / (1.0 - mean)))
    return level[3] / level[SPECTRAL] - 1.0


def _reflected(data: SceneData) -> tuple[float, dict[int, FloatArray]]:
    """Area of all sides [m²], and what of it reflects in 3 and in 20 bands."""
    areas = data.patches.areas()
    lit = np.column_stack([np.ones(len(areas), dtype=bool), data.two_sided])
    shares = {bands: np.zeros(bands) for bands in (3, SPECTRAL)}
    for row, material in enumerate(data.materials):
        own = float((areas[:, None] * (lit & (data.material_index == row))).sum())
        for bands in shares:
            whole = material.scattered_in(bands) + material.mirror_in(bands)
            shares[bands] = shares[bands] + own * whole
    return float((areas[:, None] * lit).sum()), shares


def _used(data: SceneData) -> list[Material]:
    """Materials of any surface."""
    return [data.materials[k] for k in np.unique(data.material_index) if k >= 0]
