"""A frozen scene as Radiance text: exact patches cut into polygons, materials, lamps and sky.

Radiance is fed luminance: 1 W/(sr m²) stands for 1 cd/m², so irradiance reads as lux and the
factor 179 lm/W never enters. Red, green and blue carry the three bands of the solver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model import BLACK, PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.skies import ground_luminance, zenith_luminance
from patchlight.solver.spectra import cct_to_rgb

#: Sine of the angle, and height over size, below which polylines are straight and quads flat.
FLAT = 1e-6

#: Luminance by the direction (Dx, Dy, Dz) of the ray. A1: zenith or ground luminance. [cd/m²]
SKY_CAL = """\
{ Traditional overcast sky, L = Lz (1 + 2 sin altitude) / 3, and a uniform ground below it. }
sky_luminance = if(Dz, A1 * (1 + 2 * Dz) / 3, 0);
ground_luminance = if(Dz, 0, A1);
"""


@dataclass(frozen=True, slots=True)
class Fineness:
    """Segments along a curved side of a patch; flat patches stay whole.

    Attributes
    ----------
    surface, lamp, flat_lamp : int
        Of reflecting patches, of curved emitters, and a side of flat emitters with curved sides.
    """

    surface: int = 12
    lamp: int = 16
    flat_lamp: int = 4


def polygons(patches: PatchSet, segments: int, flat_segments: int | None = None) -> list:
    """Polygons of every patch: a list per patch of (k, 3) arrays, counter-clockwise about +normal.

    A direction in which all parameter lines are straight is not divided. A flat patch becomes one
    polygon with its curved sides divided, or, when ``flat_segments`` is given and a side is curved,
    a grid of that many cells a side. Sides that patches share are divided alike, so that no light
    leaks between neighbours.
    """
    t = np.linspace(0.0, 1.0, segments + 1)
    grids = patches.evaluate(t[:, None], t[None, :])
    return [_patch_polygons(grid, patches.take([p]), flat_segments) for p, grid in enumerate(grids)]


def _patch_polygons(grid: FloatArray, patch: PatchSet, flat_segments: int | None) -> list:
    size = float(np.ptp(grid.reshape(-1, 3), axis=0).max())
    if _flat(grid.reshape(-1, 3), size):
        sides = [grid[:, 0], grid[-1, :], grid[::-1, -1], grid[0, ::-1]]
        straight = [_straight(side[None], size) for side in sides]
        if flat_segments is None or all(straight):
            ring = [side[:1] if s else side[:-1] for side, s in zip(sides, straight, strict=True)]
            return _faces([np.concatenate(ring)], size)
        t = np.linspace(0.0, 1.0, flat_segments + 1)
        grid = patch.evaluate(t[:, None], t[None, :])[0]
    else:
        if _straight(grid.swapaxes(0, 1), size):
            grid = grid[[0, -1]]
        if _straight(grid, size):
            grid = grid[:, [0, -1]]
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    return _faces(list(quads.reshape(-1, 4, 3)), size)


def _straight(lines: FloatArray, size: float) -> bool:
    """Whether all polylines (m, k, 3) are straight."""
    chord = lines[:, -1:] - lines[:, :1]
    away = np.cross(lines - lines[:, :1], chord)
    length = np.maximum(np.linalg.norm(chord, axis=-1), FLAT * size)
    return bool((np.linalg.norm(away, axis=-1) <= FLAT * size * length).all())


def _flat(points: FloatArray, size: float) -> bool:
    centred = points - points.mean(axis=0)
    return bool(
        np.abs(centred @ np.linalg.svd(centred, full_matrices=False)[2][2]).max() <= FLAT * size
    )


def _faces(rings: list, size: float) -> list:
    """The rings without repeated corners and without those of no area; warped quads are halved."""
    faces = []
    for ring in rings:
        ring = ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > 1e-9 * size]
        if len(ring) < 3:
            continue
        if len(ring) == 4 and not _flat(ring, size):
            halves = [ring[[0, 1, 2]], ring[[0, 2, 3]]]
        else:
            halves = [ring]
        faces.extend(h for h in halves if area(h) > 1e-14 * size * size)
    return faces


def area(ring: FloatArray) -> float:
    """Area of a flat polygon (k, 3). [m²]"""
    return 0.5 * float(
        np.linalg.norm(np.cross(ring - ring[0], np.roll(ring - ring[0], -1, 0)).sum(0))
    )


def polygon_text(material: str, name: str, rings: list) -> list[str]:
    """Radiance polygons."""
    lines = []
    for k, ring in enumerate(rings):
        numbers = " ".join(f"{x:.10g}" for x in ring.ravel())
        lines.append(f"{material} polygon {name}.{k} 0 0 {ring.size} {numbers}")
    return lines


def plastic(name: str, rgb: FloatArray) -> str:
    """A Lambertian reflector."""
    return f"void plastic {name} 0 0 5 {rgb[0]:.9g} {rgb[1]:.9g} {rgb[2]:.9g} 0 0"


def surfaces(
    scene: SceneData, *, lit: str | None, fineness: Fineness, reflecting: bool = True
) -> str:
    """Materials and polygons of a scene in which only the luminaires of group ``lit`` shine.

    The flux of each luminaire is kept: its radiance is scaled by exact area over polygon area.

    Raises
    ------
    InputError
        For what polygons with one material cannot say: sides with different materials that both
        see light, and emitters that reflect.
    """
    _check(scene)
    lines = [plastic("black", np.zeros(3))]
    for k, material in enumerate(scene.materials):
        lines.append(plastic(f"material{k}", material.bands * reflecting))
    lamp_rows = scene.luminaire_index[:, 0]
    dark = [k for k, lamp in enumerate(scene.luminaires) if lamp.group != lit]
    rest = np.flatnonzero((lamp_rows < 0) | np.isin(lamp_rows, dark))
    for p, rings in zip(rest, polygons(scene.patches.take(rest), fineness.surface), strict=True):
        row = scene.material_index[p, 0]
        lines += polygon_text("black" if row == BLACK else f"material{row}", f"p{p}", rings)
    for k, lamp in enumerate(scene.luminaires):
        if k in dark:
            continue
        rows = np.flatnonzero(lamp_rows == k)
        cut = polygons(scene.patches.take(rows), fineness.lamp, fineness.flat_lamp)
        scale = lamp.area_m2 / sum(area(ring) for rings in cut for ring in rings)
        rgb = lamp.luminance_cd_m2 * scale * np.asarray(lamp.color)
        lines.append(f"void light lamp{k} 0 0 3 {rgb[0]:.9g} {rgb[1]:.9g} {rgb[2]:.9g}")
        for p, rings in zip(rows, cut, strict=True):
            lines += polygon_text(f"lamp{k}", f"p{p}", rings)
    return "\n".join(lines) + "\n"


def _check(scene: SceneData) -> None:
    both = scene.two_sided & (scene.material_index[:, 0] != scene.material_index[:, 1])
    open_back = ~scene.two_sided & ~scene.closed
    if both.any() or open_back.any():
        p = int(np.argmax(both | open_back))
        raise InputError(f"patch {p}: its sides differ, which the comparison does not know")
    shining = scene.luminaire_index[:, 0] >= 0
    if (shining & (scene.material_index[:, 0] != BLACK)).any():
        raise InputError("an emitter reflects, which Radiance's light material does not know")
    if scene.sky is not None and scene.sky.type != 16:
        raise InputError(f"sky type {scene.sky.type}: only type 16 is known to the comparison")
    if scene.sun is not None:
        raise InputError("the comparison does not know the sun")


def _dome(scene: SceneData, group: str) -> tuple[str, FloatArray]:
    """The pattern of sky or ground, and the colour it multiplies."""
    if group == "sky":
        level = zenith_luminance(scene.sky)
    else:
        level = ground_luminance(scene.ground, scene.sky, scene.sun)
    pattern = f"void brightfunc {group}_pattern 2 {group}_luminance sky.cal 0 1 {level:.10g}"
    color = np.ones(3) if scene.is_grey else np.asarray(cct_to_rgb(scene.sky.cct_k))
    return pattern, color


def dome_as_glow(scene: SceneData, group: str) -> str:
    """Sky or ground as a half sphere at infinity, found by ambient rays only."""
    pattern, c = _dome(scene, group)
    z = 1 if group == "sky" else -1
    return (
        f"{pattern}\n{group}_pattern glow {group}_glow 0 0 4 {c[0]:.9g} {c[1]:.9g} {c[2]:.9g} 0\n"
        f"{group}_glow source {group} 0 0 4 0 0 {z} 180\n"
    )


def dome_as_portal(
    scene: SceneData, group: str, corners: FloatArray, pieces: tuple[int, int]
) -> str:
    """Sky or ground as seen through an opening: a rectangle that shines as what is behind it.

    Exact when nothing outside hides sky or ground, and light comes in nowhere else.

    Parameters
    ----------
    corners : (4, 3) array
        Counter-clockwise as seen from inside. [m]
    pieces : (int, int)
        Rectangles along the first and second side, each a source of its own.
    """
    pattern, c = _dome(scene, group)
    opening = PatchSet.from_bilinear(np.asarray(corners, dtype=np.float64)[None])
    s, t = (np.linspace(0.0, 1.0, n + 1) for n in pieces)
    grid = opening.evaluate(s[:, None], t[None, :])[0]
    rings = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    lines = [
        pattern,
        f"{group}_pattern light {group}_light 0 0 3 {c[0]:.9g} {c[1]:.9g} {c[2]:.9g}",
        *polygon_text(f"{group}_light", group, list(rings.reshape(-1, 4, 3))),
    ]
    return "\n".join(lines) + "\n"
