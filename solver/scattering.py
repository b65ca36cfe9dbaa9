"""Diffusing panels: light on one side of a pane that leaves the other alike in all directions.

The one place where the two sides of a pane are coupled: B_i = ρ_i E_i + Σ_j S_ij E_j, with S_ij =
t_j w_ij A_j / A_i, where t_j is the share of the light on element j that is scattered and w_ij that
of it which leaves by element i: Σ_i w_ij = 1, so that no flux is lost however both sides are cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .glass import GlassLaw
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .model.scene import SceneData
from .raycast import RayCaster

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Points a direction on each element, whose light goes to the element opposite to them.
POINTS = 4


class Scattering:
    """What elements scatter through panes.

    Parameters
    ----------
    scene : SceneData
        The scene.
    elements : Elements
        n elements.
    areas : (n,) array
        Areas that take part in the exchange. [m²]

    Attributes
    ----------
    share : (n,) array
        Share of the light on each element that leaves on the other side.
    """

    def __init__(self, scene: SceneData, elements: Elements, areas: FloatArray) -> None:
        laws = [GlassLaw.of(glazing) for glazing in scene.glazings]
        shares = [law.diffuse * law.diffuse_transmittance if law.diffuse else 0.0 for law in laws]
        self.share = np.array([*shares, 0.0])[scene.glass_index[elements.patch_index]]
        self._matrix: csr_matrix | None = None
        own = np.flatnonzero((self.share > 0.0) & (areas > 0.0))
        if not len(own):
            return
        from scipy.sparse import csr_matrix

        # Points of the elements, and which of them the light on each leaves by.
        source, target, weight = _opposite(scene, elements, own)
        some = (target >= 0) & (areas[target] > 0.0)
        source, target, weight = source[some], target[some], weight[some]
        total = np.bincount(source, weight, len(areas))
        # Where nothing is opposite, as at the edges of a plate, nothing is scattered.
        self.share = np.where(total > 0.0, self.share, 0.0)
        flux = self.share[source] * areas[source] * weight / total[source]
        n = len(areas)
        self._matrix = csr_matrix((flux / areas[target], (target, source)), shape=(n, n))

    @property
    def any(self) -> bool:
        """Whether anything is scattered."""
        return self._matrix is not None

    def sent(self, irradiance: FloatArray, *, back: bool = False) -> FloatArray:
        """Exitance (n, ...) by what falls on the other sides, ``irradiance`` (n, ...). [lm/m²]

        ``back`` is for the transposed system.
        """
        if self._matrix is None:
            return np.zeros_like(irradiance)
        return np.asarray((self._matrix.T if back else self._matrix) @ irradiance)


def _opposite(
    scene: SceneData, elements: Elements, own: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Element, element opposite to it (−1 for none) and area of points on elements ``own``."""
    t = (np.arange(POINTS) + 0.5) / POINTS
    s = [g.ravel() for g in np.meshgrid(t, t, indexing="ij")]
    low = elements.boxes[own, ::2]
    step = elements.boxes[own, 1::2] - low
    u, v = (low[:, axis, None] + step[:, axis, None] * s[axis] for axis in (0, 1))
    patch, side = elements.patch_index[own], elements.side[own]
    points, su, sv = surface_points(scene.patches.control_points[patch], u, v)
    normals = np.cross(su, sv)
    size = np.linalg.norm(normals, axis=2)
    weight = (size * step.prod(axis=1)[:, None]).ravel()
    # A sheet: the same place of the same patch, seen from behind.
    many = len(s[0])
    at_patch, at_side = np.repeat(patch, many), 1 - np.repeat(side, many)
    at_u, at_v = u.ravel().copy(), v.ravel().copy()
    solid = np.array([glazing.solid for glazing in scene.glazings])[scene.glass_index[patch]]
    if solid.any():
        rows = np.flatnonzero(np.repeat(solid, many))
        inward = -(normals / np.maximum(size, 1e-300)[..., None]).reshape(-1, 3)[rows]
        for part in np.unique(scene.patches.part_index[patch[solid]]):
            here = np.flatnonzero(scene.patches.part_index[at_patch[rows]] == part)
            faces = np.flatnonzero(scene.patches.part_index == part)
            body = scene.patches.take(faces)
            bounds = body.bounds()
            lift = 1e-9 * float(np.linalg.norm(bounds[1] - bounds[0]))
            some = rows[here]
            hits = RayCaster(body).first_hit(
                points.reshape(-1, 3)[some], inward[here], t_min=lift, facing=-1
            )
            at_patch[some] = np.where(hits.patch >= 0, faces[hits.patch], -1)
            at_side[some], at_u[some], at_v[some] = 0, hits.u, hits.v
    return np.repeat(own, many), _holding(elements, at_patch, at_side, at_u, at_v), weight


def _holding(
    elements: Elements, patch: IntArray, side: IntArray, u: FloatArray, v: FloatArray
) -> IntArray:
    """Element that holds each place (m,), −1 for none; elements are sorted by patch and side."""
    keys, wanted = elements.patch_index * 2 + elements.side, patch * 2 + side
    out = np.full(len(patch), -1)
    for key in np.unique(wanted[patch >= 0]):
        first, last = np.searchsorted(keys, [key, key + 1])
        rows = np.flatnonzero(wanted == key)
        box = elements.boxes[first:last]
        x, y = u[rows, None], v[rows, None]
        inside = (box[:, 0] <= x) & (x <= box[:, 1]) & (box[:, 2] <= y) & (y <= box[:, 3])
        out[rows] = np.where(inside.any(axis=1), first + inside.argmax(axis=1), -1)
    return out
