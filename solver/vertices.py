"""Corners of elements as unknowns: one value where elements of a smooth surface meet.

Elements share a corner where they lie side by side on a surface of one material, over the borders
of patches and faces as well, but not over a crease: there each side has a value of its own. Light
at a corner is looked at from a little inside one of its elements. On the edge of another surface
there is no light at a point, only a limit that depends on where one comes from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .kernels.nets import CONVEX, PLANAR
from .model.arrays import FloatArray, IntArray
from .model.bezier import gauss_rule, surface_points
from .model.elements import Elements
from .model.scene import SceneData
from .topology import shape_flags, writable

#: Parameters of the corners of a net; those of elements on − sides run against u of their patch.
U, V = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
#: How far inside its element a corner is looked at, relative to the element.
INSET = 1e-4
#: Corners closer than this, relative to the size of the scene, are in one place.
_WELD = 1e-7
#: Normals that differ by less belong to one smooth surface. [cos]
_SMOOTH = math.cos(math.radians(2.0))
#: Distance within which a curved surface hides nothing of itself, relative to its size.
_NEAR = 2.0**-9


@dataclass(frozen=True, slots=True, eq=False)
class Vertices:
    """N places where corners of n elements are; row k of every array is one of them.

    Attributes
    ----------
    of : (n, 4) int array
        Vertex at each corner of each element, in the order of `U` and `V`.
    element : (N,) int array
        An element that has it as a corner.
    points, normals : (N, 3) arrays
        Where light is looked at [m], and unit normals.
    on : (N,) int array
        Patch.
    blind : (N,) bool array
        Whether that patch lies below the vertex' horizon.
    near : (N,) array
        Distance within which nothing of the patch is seen. [m]
    """

    of: IntArray
    element: IntArray
    points: FloatArray
    normals: FloatArray
    on: IntArray
    blind: IntArray
    near: FloatArray

    @classmethod
    def of_elements(cls, scene: SceneData, elements: Elements) -> Vertices:
        n = len(elements)
        places, _ = _at(elements, 0.0)
        points, normals = _at(elements, INSET)
        where = (np.repeat(elements.patch_index, 4), np.repeat(elements.side, 4))
        low, high = scene.patches.bounds()
        step = _WELD * max(float(np.linalg.norm(high - low)), 1e-300)
        cells = np.floor((places - low) / step + 0.5).astype(np.int64)
        keys = np.concatenate([cells, scene.material_index[where][:, None]], axis=1)
        group = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
        of = _smooth(group, normals)
        first = np.unique(of, return_index=True)[1]
        on, side = where[0][first], where[1][first]
        flags = shape_flags(writable(scene.patches.control_points))[on]
        blind = (flags & PLANAR != 0) | ((flags & CONVEX != 0) & (side == 0))
        spans = np.ptp(scene.patches.control_points[..., :3].reshape(-1, 16, 3), axis=1)
        near = _NEAR * np.linalg.norm(spans, axis=1)[on]
        return cls(of.reshape(n, 4), first // 4, points[first], normals[first], on, blind, near)

    def __len__(self) -> int:
        return len(self.element)

    def added(self, shares: FloatArray) -> FloatArray:
        """Form factors (m, N) of the vertices, by shares (m, n, 4) of the corners."""
        ids = self.of.ravel()
        order = np.argsort(ids, kind="stable")
        start = np.searchsorted(ids[order], np.arange(len(self)))
        flat = shares.reshape(len(shares), -1)[:, order]
        return np.asarray(np.add.reduceat(flat, start, axis=1))


def between_corners(order: int) -> FloatArray:
    """Shares (order², 4) of the corners in the values at Gauss nodes, in order of u, then v."""
    t = gauss_rule(order)[0]
    s, r = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    return np.stack([(1 - s) * (1 - r), s * (1 - r), s * r, (1 - s) * r], axis=1)


def _at(elements: Elements, inset: float) -> tuple[FloatArray, FloatArray]:
    """Points and unit normals (4 n, 3), ``inset`` inside the corners."""
    u, v = U + inset * (1.0 - 2.0 * U), V + inset * (1.0 - 2.0 * V)
    points, su, sv = surface_points(elements.nets, u, v)
    normals = np.cross(su, sv)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals /= np.where(length > 0.0, length, 1.0)
    return points.reshape(-1, 3), normals.reshape(-1, 3)


def _smooth(group: IntArray, normals: FloatArray) -> IntArray:
    """Numbers (k,) of corners whose ``group`` and, nearly, normals are the same."""
    out = np.full(len(group), -1)
    left = np.arange(len(group))
    count = 0
    while len(left):
        _, first, which = np.unique(group[left], return_index=True, return_inverse=True)
        leader = left[first][which.reshape(-1)]
        alike = (normals[left] * normals[leader]).sum(axis=1) >= _SMOOTH
        alike |= leader == left  # also without a normal
        out[left[alike]] = count + which.reshape(-1)[alike]
        count += len(first)
        left = left[~alike]
    return np.asarray(np.unique(out, return_inverse=True)[1].reshape(-1))
