"""Pictures: rays through pixels, exact curved surfaces, smooth luminance, anti-aliased edges."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .elements_by_side import elements_by_side
from .errors import InputError
from .light_colors import LightColors, lamp_color
from .model.arrays import FloatArray, IntArray, check_shape, frozen
from .model.elements import Elements
from .model.result import CameraImage, luminous
from .model.scene import SceneData
from .model.sky import direction
from .model.views import Camera
from .raycast import Hits, RayCaster
from .shine import MOST_MIRRORS, Seen, Shine
from .skies import (
    ground_luminance,
    sky_parameters,
    sun_direction,
    sun_luminance,
    with_patches,
)
from .vertex_values import corner_values

if TYPE_CHECKING:
    from .second_pass import SecondPass
    from .sun_pictures import SunInPictures
    from .webs import WebLamp

#: Rays per kernel call, which bounds memory and lets Ctrl-C through.
_BLOCK = 1 << 17
#: Neighbouring pixels whose luminances differ by this share of the larger are sampled again.
_CONTRAST = 0.1
_SUBPIXELS = ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))
#: Turns of the places on the sun's disc that they ask, evenly over the right angle between these.
_TURNS = tuple(0.5 * np.pi * (k + 0.5) / len(_SUBPIXELS) for k in range(len(_SUBPIXELS)))


class Renderer:
    """Views of one solved scene; build once for all cameras.

    Parameters
    ----------
    scene : SceneData
        Geometry, sky, sun and ground.
    elements : Elements
        n elements. A side of a patch without elements is black.
    reflected : (n, b) array
        Reflected exitance, shown smoothly; b = 1 gives a grey picture, b = 3 linear sRGB. [lm/m²]
    emitted : (n, b) or (n, 4, b) array
        Emitted exitance, uniform in each element, or at the corners (u0, v0), (u1, v0), (u1, v1),
        (u0, v1) of its box. [lm/m²]
    irradiance : (n,) array
        Illuminance, shown smoothly. [lx]
    caster : RayCaster, optional
        Of the patches of ``scene`` that nothing is seen through, when there already is one.
    webs : sequence of WebLamp
        Lamps whose luminance depends on where they are seen from; they are not in ``emitted``.
    second : SecondPass, optional
        Shows glossy surfaces by their lobes; without, they are diffuse.
    sun : SunInPictures, optional
        Tells the direct light of the sun at each pixel; it is not in ``reflected`` and
        ``irradiance``.

    Raises
    ------
    InputError
        If the arrays do not fit the elements.
    """

    def __init__(
        self,
        scene: SceneData,
        elements: Elements,
        *,
        reflected: FloatArray,
        emitted: FloatArray,
        irradiance: FloatArray,
        caster: RayCaster | None = None,
        webs: Sequence[WebLamp] = (),
        second: SecondPass | None = None,
        sun: SunInPictures | None = None,
    ) -> None:
        if emitted.ndim == 2:
            emitted = np.repeat(emitted[:, None], 4, axis=1)
        reflected, emitted = frozen(reflected), frozen(emitted)
        n, bands = len(elements), reflected.shape[-1] if reflected.ndim == 2 else 0
        if bands not in (1, 3):
            raise InputError(f"reflected: shape {reflected.shape}, but expected (n, 1) or (n, 3)")
        check_shape("reflected", reflected, (n, bands))
        check_shape("emitted", emitted, (n, 4, bands))
        irradiance = frozen(irradiance)
        check_shape("irradiance", irradiance, (n,))
        self.scene, self._webs, self._bands, self._sun = scene, webs, bands, sun
        # By patch and side, as a ray sees it; the last row stands for patch −1.
        self._lamp_of = np.concatenate([scene.luminaire_index, [[-1, -1]]])
        # Patches that are seen through come last: rows of the others are the same without them.
        self._caster = RayCaster(scene.without_panes.patches) if caster is None else caster
        self._panes = None
        if scene.see_through.any():
            from .pane_view import PaneView

            self._panes = PaneView(scene)
        self._shine = Shine(scene, second, bands)
        means = np.concatenate([reflected, irradiance[:, None]], axis=1)
        start, order = elements_by_side(elements, len(scene.patches))
        self._shading = (
            scene.patches.control_points,
            start,
            order,
            elements.boxes,
            frozen(corner_values(scene, elements, means)),
            emitted,
            _environment(scene, bands),
        )

    def render(self, camera: Camera) -> CameraImage:
        """The view of ``camera``; pixels outside a fisheye's circle are black and hit nothing."""
        width, height = (int(s) for s in camera.size)
        origins, directions = (a.reshape(-1, 3) for a in camera.rays())
        seen = self._trace(origins, directions)
        rgb, illuminance, depth, normals, patch = seen
        again = np.flatnonzero(self._edges(rgb, patch, (height, width)))
        if again.size:
            total = np.zeros((again.size, 3))
            for subpixel, turn in zip(_SUBPIXELS, _TURNS, strict=True):
                origins, directions = camera.rays(subpixel=subpixel)
                total += self._trace(
                    origins.reshape(-1, 3)[again], directions.reshape(-1, 3)[again], turn=turn
                )[0]
            rgb[again] = total / len(_SUBPIXELS)
        parts = np.append(self.scene.patches.part_index, -1)  # patch −1 is the last row
        return CameraImage(
            camera=camera,
            rgb=rgb.reshape(height, width, 3),
            illuminance_lx=illuminance.reshape(height, width),
            depth_m=depth.reshape(height, width),
            normals=normals.reshape(height, width, 3),
            part_index=parts[patch].reshape(height, width),
        )

    def _trace(
        self,
        origins: FloatArray,
        directions: FloatArray,
        near: float = 0.0,
        bounces: int = 0,
        turn: float = 0.0,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
        """Luminance, illuminance, depth, normal and patch along rays (m, 3).

        ``turn`` is that of the places on the sun's disc. [rad]
        """
        from .kernels.render import shade

        m = len(directions)
        rgb = np.zeros((m, 3))
        illuminance, depth = np.full(m, np.nan), np.full(m, np.nan)
        normals, patch = np.full((m, 3), np.nan), np.full(m, -1, dtype=np.int64)
        for first in range(0, m, _BLOCK):
            rows = slice(first, min(first + _BLOCK, m))
            d = frozen(directions[rows])
            hits = self._caster.first_hit(origins[rows], d, t_min=near)
            shade(
                *self._shading, d, hits.patch, hits.u, hits.v, hits.facing,
                rgb[rows], illuminance[rows], normals[rows],
            )  # fmt: skip
            seen = Seen(origins[rows], d, hits, normals[rows], illuminance[rows])
            if self._sun is not None:
                met = np.flatnonzero(hits.patch >= 0)
                self._sun.add(rgb[rows], illuminance[rows], met, seen.points(met), seen, turn)
            self._shine.add_lobes(rgb[rows], seen, partial(self._emitted, d, hits))
            self._add_webs(rgb[rows], d, hits.patch, hits.facing)
            self._add_mirrors(rgb[rows], seen, bounces, turn)
            if self._panes is not None:
                self._panes.cover(rgb[rows], origins[rows], d, hits.t, self._shaded)
            depth[rows] = np.where(hits.patch >= 0, hits.t, np.nan)
            patch[rows] = hits.patch
        return rgb, illuminance, depth, normals, patch

    def _emitted(self, directions: FloatArray, hits: Hits, rows: IntArray) -> FloatArray:
        """Luminance (k, 3) that surfaces emit by themselves where some rays hit. [cd/m²]"""
        nets, start, order, boxes, corners, emitted, environment = self._shading
        dark = (nets, start, order, boxes, np.zeros_like(corners), emitted, environment)
        where = (hits.patch[rows], hits.u[rows], hits.v[rows], hits.facing[rows])
        return _shaded(dark, directions[rows], *where)

    def _shaded(
        self, directions: FloatArray, patch: IntArray, u: FloatArray, v: FloatArray, side: IntArray
    ) -> FloatArray:
        """Luminance (m, 3) of surfaces where rays meet them. [cd/m²]"""
        return _shaded(self._shading, directions, patch, u, v, side)

    def _add_mirrors(self, rgb: FloatArray, seen: Seen, bounces: int, turn: float) -> None:
        """Add to ``rgb`` (m, 3) what is seen in mirrors, and in mirrors seen in them."""
        shares = self._shine.mirrors(seen)
        rows = np.flatnonzero(shares.any(axis=1))
        if not len(rows) or bounces == MOST_MIRRORS:
            return
        at = seen.points(rows)
        n, d = seen.normals[rows], seen.directions[rows]
        turned = d - 2.0 * (d * n).sum(axis=1)[:, None] * n
        found = self._trace(at, turned, self._shine.near, bounces + 1, turn)
        rgb[rows] += shares[rows] * found[0]

    def _add_webs(
        self, rgb: FloatArray, directions: FloatArray, patch: IntArray, facing: IntArray
    ) -> None:
        """Add to ``rgb`` (m, 3) what lamps with webs send back along rays that hit them."""
        if not self._webs:
            return
        seen = self._lamp_of[patch, (facing < 0).astype(np.int64)]
        for lamp in self._webs:
            rows = np.flatnonzero(seen == lamp.row)
            color = lamp_color(lamp.luminaire, self._bands)
            level = lamp.luminance(-directions[rows])
            rgb[rows] += level[:, None] * color

    def _edges(self, rgb: FloatArray, patch: IntArray, shape: tuple[int, int]) -> IntArray:
        """Pixels (h w,) with another face or another luminance next to them."""
        face = np.append(self.scene.patches.face_index, -1)[patch].reshape(shape)
        level = luminous(rgb).reshape(shape)
        out = np.zeros(shape, dtype=bool)
        for axis in (0, 1):
            a = np.moveaxis(face, axis, 0)
            b = np.moveaxis(level, axis, 0)
            change = (a[1:] != a[:-1]) | (
                np.abs(b[1:] - b[:-1]) > _CONTRAST * np.maximum(b[1:], b[:-1])
            )
            view = np.moveaxis(out, axis, 0)
            view[1:] |= change
            view[:-1] |= change
        return out.ravel()


def _shaded(
    shading: tuple[FloatArray | IntArray, ...],
    directions: FloatArray,
    patch: IntArray,
    u: FloatArray,
    v: FloatArray,
    side: IntArray,
) -> FloatArray:
    """Luminance (m, 3) of surfaces where rays meet them. [cd/m²]"""
    from .kernels.render import shade

    m = len(patch)
    rgb, lux, normals = np.zeros((m, 3)), np.zeros(m), np.zeros((m, 3))
    shade(*shading, frozen(directions), patch, u, v, side, rgb, lux, normals)
    return rgb


def render(
    scene: SceneData,
    elements: Elements,
    camera: Camera,
    *,
    reflected: FloatArray,
    emitted: FloatArray,
    irradiance: FloatArray,
    caster: RayCaster | None = None,
) -> CameraImage:
    """One view of a solved scene; see `Renderer`."""
    renderer = Renderer(
        scene,
        elements,
        reflected=reflected,
        emitted=emitted,
        irradiance=irradiance,
        caster=caster,
    )
    return renderer.render(camera)


def _environment(scene: SceneData, bands: int) -> FloatArray:
    """Sky, ground and sun packed for `kernels.render`."""
    from .kernels import render as kernel

    sky, sun = scene.sky, scene.sun
    out = np.zeros(kernel.ENVIRONMENT)
    out[kernel.DISC_CHORD] = -1.0
    colors = LightColors(scene, bands)
    if sky is not None:
        out[: kernel.SKY_SUN] = sky_parameters(sky)
        out[kernel.SKY_SUN : kernel.SKY_SUN + 3] = sun_direction(sky)
        out[kernel.SKY_COLOR : kernel.SKY_COLOR + 3] = colors.sky
    if sun is not None:
        radius = np.radians(sun.angular_radius_arcmin / 60.0)
        out[kernel.DISC : kernel.DISC + 3] = direction(sun.altitude_deg, sun.azimuth_deg)
        out[kernel.DISC_CHORD] = 4.0 * np.sin(0.5 * radius) ** 2
        out[kernel.DISC_LUMINANCE : kernel.DISC_LUMINANCE + 3] = sun_luminance(sun) * colors.sun
    level = ground_luminance(scene.ground, sky, sun)
    out[kernel.GROUND : kernel.GROUND + 3] = level * colors.ground
    return frozen(with_patches(out, sky))
