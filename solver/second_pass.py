"""The second pass: at sensors and cameras glossy surfaces send their last reflection by the lobe.

Interreflection knows the glossy share r_s of a surface as diffuse. Here r_s E / π is taken away
from what a surface sends to a viewer, and r_s times the light in the lobe is put in its place. Of
the diffuse share as much stays as the lobe loses below the horizon, (1 − a) r_s E / π with the
lobe's albedo a: so even light remains even whatever reflects it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .elements_by_side import elements_by_side
from .glossy import NEAR, radiance, shining_of
from .light_colors import LightColors, lamp_color
from .model.arrays import FloatArray, frozen
from .model.result import luminous
from .model.scene import SceneData
from .panes import make_panes
from .raycast import RayCaster
from .skies import ground_luminance, sky_tone, sun_luminance
from .surfaces import Surfaces
from .uneven_pieces import shining_pieces

if TYPE_CHECKING:
    from .kernels.glossy import Beyond
    from .webs import WebLamp


class GlossySides:
    """Glossy share and sharpness by patch side.

    Attributes
    ----------
    specular : (p, 2, b) array
        Glossy reflectance r_s.
    share : (p, 2, b) array
        Of all scattered light, 0 where there is none.
    exponent : (p, 2) array
        Sharpness.
    """

    def __init__(self, scene: SceneData, bands: int) -> None:
        index = scene.material_index
        self.specular = np.zeros((*index.shape, bands))
        self.share = np.zeros_like(self.specular)
        self.exponent = np.ones(index.shape)
        for row, m in enumerate(scene.materials):
            at = index == row
            all_of_it = m.scattered_in(bands)
            self.specular[at] = m.specular_in(bands)
            self.share[at] = m.specular_in(bands) / np.where(all_of_it > 0.0, all_of_it, 1.0)
            self.exponent[at] = m.exponent
        back = ~np.asarray(scene.two_sided)
        self.specular[back, 1] = self.share[back, 1] = 0.0

    @property
    def any(self) -> bool:
        """Whether anything is glossy."""
        return bool(self.specular.any())


class SecondPass:
    """Light in the lobes of glossy points of one solved scene.

    Parameters
    ----------
    scene : SceneData
        The scene.
    surfaces : Surfaces
        Its n elements.
    reflected : mapping of (n, b) arrays
        Reflected exitance by light group. [lm/m²]
    mirrors : (p, 2) array
        Share that each patch side mirrors.
    webs : sequence of WebLamp
        Lamps whose luminance depends on where they are seen from.
    trace : bool
        Whether anything can hide anything.
    caster : RayCaster, optional
        Of ``scene.patches``, when there already is one.
    conserving : bool
        Whether the lobe keeps the balance of energy; else it is that of 1993, see `glossy`.
    """

    def __init__(
        self,
        scene: SceneData,
        surfaces: Surfaces,
        reflected: Mapping[str, FloatArray],
        *,
        mirrors: FloatArray,
        webs: Sequence[WebLamp] = (),
        trace: bool = True,
        caster: RayCaster | None = None,
        conserving: bool = True,
    ) -> None:
        from .kernels.paths import Sides, Tree

        self.scene, self.surfaces, self.webs, self.trace = scene, surfaces, webs, trace
        self.conserving = conserving
        self.groups, self.bands = tuple(reflected), surfaces.reflectance.shape[1]
        self.sides = GlossySides(scene, self.bands)
        low, high = scene.patches.bounds()
        self.near = NEAR * float(np.linalg.norm(high - low))
        self._light = np.stack([reflected[g] for g in self.groups], axis=1) / np.pi
        self._emitted = (
            np.stack([surfaces.emitted_by(scene, g) for g in self.groups], axis=1) / np.pi
        )
        elements = surfaces.elements
        start, order = elements_by_side(elements, len(scene.patches))
        self._sides = Sides(start, order, elements.boxes, frozen(np.asarray(mirrors).ravel()))
        self._tree = Tree(
            *(RayCaster(scene.without_panes.patches) if caster is None else caster).arrays
        )
        self.panes = make_panes(scene)
        self._lamps, self._levels, self._nets = shining_pieces(scene, surfaces)
        self._centers = [elements.nodes[surfaces.lamp == web.row].mean(axis=(0, 1)) for web in webs]

    def lobes(
        self,
        points: FloatArray,
        normals: FloatArray,
        views: FloatArray,
        exponents: FloatArray,
        floors: FloatArray,
        *,
        accuracy: float,
        rays: int,
        rounds: int = 1,
        by_group: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Radiance for a glossy reflectance of 1, and the albedo (m,) of the lobes.

        Parameters
        ----------
        points, normals, views : (m, 3) array
            Points [m], unit normals there and unit directions to the viewer.
        exponents, floors : (m,) array
            Sharpness, and luminance beside which little does not matter. [cd/m²]
        accuracy : float
            Of lamps.
        rays, rounds : int
            Rays a direction for all else, and how many times more at most where they differ.
        by_group : bool
            Whether groups are kept apart.

        Returns
        -------
        (m, g, b) array, (m,) array
            One group unless they are kept apart. [cd/m²]
        """
        from .kernels.glossy import Lobe

        count = len(self.groups) if by_group else 1
        light, emitted = self._light, self._emitted
        if not by_group:
            light, emitted = light.sum(axis=1, keepdims=True), emitted.sum(axis=1, keepdims=True)
        columns, own = count * self.bands, len(self.webs)

        def flat(values: FloatArray) -> FloatArray:
            table = values.reshape(len(values), columns)
            return np.concatenate([table, np.zeros((len(values), own))], axis=1)

        lamps, levels = self._lamps, self._levels
        luminance = flat(emitted[lamps] * levels[:, None, None])
        brightness = luminous(self.surfaces.emitted[lamps]) * levels / np.pi
        for k, web in enumerate(self.webs):
            # By shape alone here; times the luminance in the direction of each point below.
            luminance[:, columns + k] = self.surfaces.lamp[lamps] == web.row
        found = radiance(
            points, normals, views, exponents, floors,
            Lobe(self.conserving, self.trace, accuracy, rays, rounds, self.near),
            shining_of(self._nets, luminance, brightness),
            flat(light), flat(emitted), self._beyond(by_group, columns + own),
            self._tree, self.panes, self._sides,
        )  # fmt: skip
        out = found[:, :columns].reshape(-1, count, self.bands)
        for k, web in enumerate(self.webs):
            rows = np.flatnonzero(found[:, columns + k] > 0.0)
            away = points[rows] - self._centers[k]
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            level = found[rows, columns + k] * web.luminance(away)
            color = lamp_color(web.luminaire, self.bands)
            group = self.groups.index(web.luminaire.group) if by_group else 0
            out[rows, group] += level[:, None] * color
        return out, found[:, -1]

    def _beyond(self, by_group: bool, columns: int) -> Beyond:
        """Sky, sun and ground in columns."""
        from .kernels.glossy import Beyond
        from .model.sky import direction

        scene, colors = self.scene, LightColors(self.scene, self.bands)
        sky, ground, disc = np.zeros(columns), np.zeros(columns), np.zeros(columns)
        tone, sun = np.empty(0), np.full(5, 2.0)

        def put(out: FloatArray, group: str, level: float, color: FloatArray) -> None:
            if group not in self.groups:
                return
            first = self.groups.index(group) * self.bands if by_group else 0
            out[first : first + self.bands] += level * color

        if scene.sky is not None:
            tone = sky_tone(scene.sky)
            put(sky, "sky", 1.0, colors.sky)
        if scene.sun is not None:
            radius = np.radians(scene.sun.angular_radius_arcmin / 60.0)
            sun[:3] = direction(scene.sun.altitude_deg, scene.sun.azimuth_deg)
            sun[3], sun[4] = np.cos(radius), 4.0 * np.pi * np.sin(0.5 * radius) ** 2
            put(disc, "sun", sun_luminance(scene.sun), colors.sun)
        level = ground_luminance(scene.ground, scene.sky, scene.sun)
        put(ground, "ground", level, colors.ground)
        return Beyond(frozen(tone), frozen(sky), frozen(ground), frozen(sun), frozen(disc))
