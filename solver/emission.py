"""Lamps whose exitance varies over their surface.

On every element of such a lamp the exitance is a polynomial through its values at 4 x 4 Gauss
nodes, of degree 3 in u and in v. What a receiver gets of the element is its mean exitance times the
form factor, and Σ_k (M_k − M̄) F_k besides: the form factor spread over the nodes, as it is for
reflected light by `kernels.spread`. All of a lamp together is scaled so that its flux is what was
asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .edges import EDGE_NODES
from .errors import InputError
from .kernels.rows import Sources
from .kernels.spread import Basis, spread_rows
from .light_colors import lamp_color
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.bezier import gauss_rule
from .model.elements import Elements
from .model.scene import SceneData
from .profile_shape import NODES, Shape, between, varies
from .some_sources import some_sources
from .surfaces import Receivers
from .topology import writable
from .unknowns import Unknowns, composite, lagrange, reach
from .walls import walls_under

#: Gauss points a direction in the parts of near elements.
PART_NODES = 6
#: Rows whose factors are spread at a time.
BLOCK = 512


@dataclass(frozen=True, slots=True, eq=False)
class Emission:
    """Exitance of the elements of uneven lamps; row i of every array is the same of c elements.

    Attributes
    ----------
    element : (c,) int array
        Rows of the mesh, in order.
    lamp : (c,) int array
        Rows of the scene's luminaires.
    mean : (c,) array
        Mean exitance. [lm/m²]
    values : (c, k) array
        Exitance at the nodes, in order of u, then v. [lm/m²]
    missed : (c,) array
        Mean of what the polynomials miss. [lm/m²]
    color : (c, b) array
        Of the light, of luminance 1.
    span : (c,) array
        Change over the element. [lm/m²]
    basis : Basis
        The polynomials.
    scale : dict
        Exitance for a profile of 1, by luminaire. [lm/m²]
    """

    element: IntArray
    lamp: IntArray
    mean: FloatArray
    values: FloatArray
    missed: FloatArray
    color: FloatArray
    span: FloatArray
    basis: Basis
    scale: dict[int, float]

    @classmethod
    def of(
        cls, scene: SceneData, elements: Elements, lamp: IntArray, bands: int
    ) -> Emission | None:
        """That on a mesh whose elements belong to luminaires ``lamp`` (n,); None without any."""
        rows = [k for k, one in enumerate(scene.luminaires) if one.profile is not None]
        element = np.flatnonzero(np.isin(lamp, rows)) if rows else np.empty(0, dtype=np.int64)
        if not len(element):
            return None
        shape = Shape.of(scene, elements.take(element), lamp[element])
        kept = varies(shape, lamp[element])
        if not kept.any():
            return None
        element, shape = element[kept], shape.take(kept)
        own, lamp = elements.take(element), lamp[element]
        scale = {}
        for row in np.unique(lamp):
            one, here = scene.luminaires[row], lamp == row
            flux = float(shape.mean[here] @ own.areas[here])
            if not flux > 0.0:
                raise InputError(f"emitter of {one.part}: its profile is 0 everywhere")
            scale[int(row)] = one.flux_lm / flux
        return cls._of(scene, shape, element, lamp, bands, scale)

    @classmethod
    def _of(
        cls,
        scene: SceneData,
        shape: Shape,
        element: IntArray,
        lamp: IntArray,
        bands: int,
        scale: dict[int, float],
    ) -> Emission:
        level = np.array([scale[int(row)] for row in lamp])
        color = np.array([lamp_color(scene.luminaires[row], bands) for row in lamp])
        return cls(
            element=element,
            lamp=lamp,
            mean=shape.mean * level,
            values=shape.values * level[:, None],
            missed=shape.missed * level,
            color=color,
            span=shape.span * level,
            basis=_basis(shape.points, shape.vectors),
            scale=scale,
        )

    def of_pieces(self, scene: SceneData, pieces: Elements, lamp: IntArray) -> Emission:
        """That on pieces of the elements, of luminaires ``lamp``, with the flux there is."""
        shape = Shape.of(scene, pieces, lamp)
        own, bands = np.arange(len(pieces)), self.color.shape[1]
        return type(self)._of(scene, shape, own, lamp, bands, self.scale)

    def light(
        self, factors: MatrixArray, receivers: Receivers, sources: Sources, eps: float
    ) -> FloatArray:
        """Exitance (m, c) that m receivers see of the elements by which it differs from the means.

        Times the form factors, it is light. [lm/m²]

        Parameters
        ----------
        factors : (m, c) array
            Form factors of the elements.
        receivers : Receivers
            Of the rows.
        sources : Sources
            The elements of the whole mesh.
        eps : float
            Error of the moments, relative to the form factor of their element.
        """
        own = some_sources(sources, self.element)
        order = len(self.basis.rule)
        far, near = (1.0 + reach(eps, q) / math.sqrt(2.0) for q in (order, PART_NODES))
        m, c = factors.shape
        out = np.zeros((m, c))
        off = (self.values - self.mean[:, None]).reshape(-1)
        block = np.empty((min(m, BLOCK), c * order**2), dtype=np.float32)
        # A form factor of 1 leaves the shares of the nodes.
        ones = np.where(factors > 0.0, np.float32(1.0), np.float32(0.0))
        for first in range(0, m, BLOCK):
            some = slice(first, min(first + BLOCK, m))
            part = block[: some.stop - first]
            for node in range(receivers.nodes.shape[1]):
                share = receivers.weights[some, node]
                if not share.any():
                    continue
                x, n = receivers.nodes[some, node], receivers.normals[some, node]
                walls = walls_under(x[:, None], n[:, None], share[:, None], sources.wall_spheres)
                spread_rows(
                    writable(x),
                    writable(n),
                    walls,
                    ones[some],
                    own,
                    self.basis,
                    far,
                    far,
                    near,
                    part,
                )
                seen = (part * off).reshape(len(part), c, order**2).sum(axis=2)
                out[some] += share[:, None] * seen
        return out

    def at(self, unknowns: Unknowns, means: FloatArray) -> FloatArray:
        """Exitance (N, b) at unknowns, with that of even elements by their ``means`` (n, b).

        The means over the elements stay what they are.
        """
        out = means[unknowns.element]
        if unknowns.basis is None:
            return out
        rule, start = unknowns.basis.rule, unknowns.basis.start
        for pieces in (1, 2):
            here = np.flatnonzero(unknowns.basis.pieces[self.element] == pieces)
            if not len(here):
                continue
            one = lagrange(self.basis.rule, 1, composite(len(rule), pieces)[0])
            both = np.einsum("ga,hb->ghab", one, one).reshape(-1, self.values.shape[1])
            rows = start[self.element[here]][:, None] + np.arange(len(both))
            found = np.maximum(self.values[here] @ both.T, 0.0)
            area = unknowns.areas[rows]
            mean = (found * area).sum(axis=1) / area.sum(axis=1)
            found *= (self.mean[here] / np.where(mean > 0.0, mean, 1.0))[:, None]
            out[rows] = found[:, :, None] * self.color[here, None, :]
        return out

    def corners(self, elements: Elements, means: FloatArray) -> FloatArray:
        """Exitance (n, 4, b) at the corners of all elements, others being even as ``means`` (n, b).

        Corners are those of the boxes, (u0, v0), (u1, v0), (u1, v1), (u0, v1).
        """
        out = np.repeat(means[:, None], 4, axis=1)
        one = lagrange(self.basis.rule, 1, np.array([0.0, 1.0]))
        both = np.einsum("ga,hb->ghab", one, one).reshape(4, -1)
        found = np.maximum(self.values @ both.T, 0.0)
        # Nets on the − side run against u of the patch.
        for side, order in ((0, (0, 2, 3, 1)), (1, (2, 0, 1, 3))):
            here = elements.side[self.element] == side
            rows = self.element[here]
            out[rows] = found[here][:, order, None] * self.color[here, None, :]
        return out


def _basis(points: FloatArray, vectors: FloatArray) -> Basis:
    """Polynomials through the nodes (c, k, 3) of elements."""
    c, k = points.shape[:2]
    size = np.linalg.norm(vectors, axis=2)
    gauss, weight = gauss_rule(PART_NODES)
    at = np.zeros((2, EDGE_NODES**2, 4 * k))
    at[0, :, :k] = between(EDGE_NODES)
    return Basis(
        start=np.arange(0, (c + 1) * k, k, dtype=np.int64),
        pieces=np.ones(c, dtype=np.int64),
        rule=writable(gauss_rule(NODES)[0]),
        points=writable(points.reshape(-1, 3)),
        vectors=writable(vectors.reshape(-1, 3)),
        share=writable((size / size.sum(axis=1, keepdims=True)).ravel()),
        at=at,
        gauss=writable(gauss),
        weight=writable(weight),
    )
