"""What gathers light and what sends it back: receivers, and the optical state of elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .light_colors import lamp_color
from .model.arrays import FloatArray, IntArray
from .model.bezier import area_points
from .model.elements import Elements
from .model.scene import BLACK, SceneData
from .model.views import Sensors

if TYPE_CHECKING:
    from .emission import Emission
    from .unknowns import Unknowns


@dataclass(frozen=True, slots=True, eq=False)
class Receivers:
    """Nodes (m, q, 3) and normals, their shares (m, q), and what each receiver lies on.

    ``patches`` and ``own`` (m,) are its patch and its element, −1 in the open.
    """

    nodes: FloatArray
    normals: FloatArray
    weights: FloatArray
    patches: IntArray
    own: IntArray

    @classmethod
    def of_elements(cls, elements: Elements) -> Receivers:
        share = np.where(elements.buried, 0.0, elements.weights)
        total = share.sum(axis=1)
        share = share / np.where(total > 0.0, total, 1.0)[:, None]
        own = np.arange(len(elements))
        return cls(elements.nodes, elements.normals, share, elements.patch_index, own)

    @classmethod
    def with_nodes(cls, elements: Elements, rows: IntArray, order: int) -> Receivers:
        """Some elements with ``order`` Gauss nodes a direction."""
        points, vectors = area_points(elements.nets[rows], order)
        share = np.linalg.norm(vectors, axis=2)
        return cls(
            points,
            vectors / np.where(share > 0.0, share, 1.0)[..., None],
            share / share.sum(axis=1)[:, None],
            elements.patch_index[rows],
            rows,
        )

    @classmethod
    def of_sensors(cls, grid: Sensors) -> Receivers:
        ones = np.ones(len(grid))
        return cls.of_points(grid.points, grid.normals, ones, np.full(len(grid), -1))

    @classmethod
    def of_points(
        cls, points: FloatArray, normals: FloatArray, share: FloatArray, on: IntArray
    ) -> Receivers:
        """Points (m, 3) with a share (m,) of 0 where they get no light, and what they lie on."""
        return cls(points[:, None], normals[:, None], share[:, None], on, np.full(len(on), -1))

    def take(self, rows: IntArray) -> Receivers:
        """Some of them."""
        return Receivers(
            self.nodes[rows],
            self.normals[rows],
            self.weights[rows],
            self.patches[rows],
            self.own[rows],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Optical state of the elements; row i of every array is the same element."""

    elements: Elements
    areas: FloatArray  # (n,) without the buried share [m²]
    reflectance: FloatArray  # (n, b) diffuse and glossy
    emitted: FloatArray  # (n, b) mean over all directions [lm/m²]
    material: IntArray  # (n,) row of the scene's materials
    lamp: IntArray  # (n,) row of the scene's luminaires
    web: NDArray[np.bool_]  # (n,) whether it emits by a photometric web
    emission: Emission | None = None  # of lamps that are not even

    @classmethod
    def of(cls, scene: SceneData, elements: Elements, bands: int) -> Surfaces:
        where = (elements.patch_index, elements.side)
        material, lamp = scene.material_index[where], scene.luminaire_index[where]
        rho = np.zeros((len(elements), bands))
        for row, m in enumerate(scene.materials):
            rho[material == row] = m.scattered_in(bands)
        emitted = np.zeros_like(rho)
        for row, luminaire in enumerate(scene.luminaires):
            emitted[lamp == row] = luminaire.exitance_lm_m2 * lamp_color(luminaire, bands)
        emission = None
        if any(luminaire.profile is not None for luminaire in scene.luminaires):
            from .emission import Emission

            emission = Emission.of(scene, elements, lamp, bands)
        if emission is not None:
            emitted[emission.element] = emission.mean[:, None] * emission.color
        rho[material == BLACK] = 0.0
        areas = np.where(elements.buried, 0.0, elements.weights).sum(axis=1)
        webs = [row for row, luminaire in enumerate(scene.luminaires) if luminaire.web is not None]
        return cls(elements, areas, rho, emitted, material, lamp, np.isin(lamp, webs), emission)

    @property
    def uneven(self) -> NDArray[np.bool_]:
        """Which elements (n,) are of lamps whose exitance varies over them."""
        out = np.zeros(len(self.areas), dtype=bool)
        if self.emission is not None:
            out[self.emission.element] = True
        return out

    @property
    def diffuse(self) -> FloatArray:
        """Exitance (n, b) emitted alike in all directions; webs are none of it. [lm/m²]"""
        return np.where(self.web[:, None], 0.0, self.emitted)

    def diffuse_at(self, unknowns: Unknowns) -> FloatArray:
        """The same at unknowns (N, b), where it is not even on the elements."""
        if self.emission is None:
            return self.diffuse[unknowns.element]
        return self.emission.at(unknowns, self.diffuse)

    @property
    def diffuse_at_corners(self) -> FloatArray:
        """The same at the corners (n, 4, b) of the elements, as `Emission.corners` has them."""
        if self.emission is None:
            return np.repeat(self.diffuse[:, None], 4, axis=1)
        return self.emission.corners(self.elements, self.diffuse)

    def emitted_by(self, scene: SceneData, group: str) -> FloatArray:
        """Exitance (n, b) that one light group emits alike in all directions. [lm/m²]"""
        of_group = np.array([*(lamp.group == group for lamp in scene.luminaires), False])
        return np.where(of_group[self.lamp][:, None], self.diffuse, 0.0)  # −1 is the last


def reflectances(scene: SceneData) -> FloatArray:
    """Luminous reflectance (p, 2), mirrors apart, of both sides of every patch."""
    out = np.zeros(scene.material_index.shape)
    for row, m in enumerate(scene.materials):
        out[scene.material_index == row] = m.luminous_reflectance
    return out
