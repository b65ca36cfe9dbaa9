"""Profiles of uneven lamps on elements: values at nodes, means, and what polynomials miss."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .model.bezier import gauss_rule, surface_points
from .model.elements import Elements
from .model.scene import SceneData
from .unknowns import lagrange

#: Nodes a direction of the polynomials on each element, and by which the means are found and what
#: the polynomials miss.
NODES, LOOK_NODES = 4, 7
#: Change of a profile, relative to it, that is taken for rounding.
EVEN = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """Profiles on c elements, in their own units.

    Attributes
    ----------
    points, vectors : (c, k, 3) arrays
        Nodes [m] and the area vectors they stand for [m²].
    values : (c, k) array
        Profile at the nodes.
    mean, missed, least, span : (c,) arrays
        Mean, mean of what the polynomials miss, smallest value, and the largest less that.
    """

    points: FloatArray
    vectors: FloatArray
    values: FloatArray
    mean: FloatArray
    missed: FloatArray
    least: FloatArray
    span: FloatArray

    @classmethod
    def of(cls, scene: SceneData, elements: Elements, lamp: IntArray) -> Shape:
        """Those of luminaires ``lamp`` (c,)."""
        points, vectors, values = sampled(scene, elements, lamp, gauss_rule(NODES))
        _, fine, looked = sampled(scene, elements, lamp, gauss_rule(LOOK_NODES))
        area, weight = np.linalg.norm(fine, axis=2), np.linalg.norm(vectors, axis=2)
        mean = (looked * area).sum(axis=1) / area.sum(axis=1)
        told = ((values * weight).sum(axis=1) / weight.sum(axis=1))[:, None]
        # Where the profile jumps, the polynomials take the mean from more nodes than their own.
        scale = mean[:, None] / np.where(told > 0.0, told, 1.0)
        values = np.where(told > 0.0, values * scale, mean[:, None])
        off = np.abs(looked - values @ between(LOOK_NODES).T)
        missed = (off * area).sum(axis=1) / area.sum(axis=1)
        least, span = looked.min(axis=1), np.ptp(looked, axis=1)
        return cls(points, vectors, values, mean, missed, least, span)

    def take(self, rows: NDArray[np.bool_]) -> Shape:
        """Those on some of the elements."""
        return Shape(*(getattr(self, f.name)[rows] for f in fields(self)))


def varies(shape: Shape, lamp: IntArray) -> NDArray[np.bool_]:
    """Which elements (c,) are of lamps whose profile is not the same all over, beyond rounding."""
    least, most = np.full((2, int(lamp.max()) + 1), [[np.inf], [0.0]])
    np.minimum.at(least, lamp, shape.least)
    np.maximum.at(most, lamp, shape.least + shape.span)
    return np.asarray(~(most - least <= EVEN * most) | (most == 0.0))[lamp]


def sampled(
    scene: SceneData, elements: Elements, lamp: IntArray, rule: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Profiles of luminaires ``lamp`` (c,) at the nodes of a ``rule`` along u and v of elements.

    Returns
    -------
    points, vectors : (c, k, 3) arrays
        Nodes, in order of u, then v [m], and the area vectors they stand for [m²].
    values : (c, k) array
        Profile there.
    """
    t, weight = rule
    s, r = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    points, su, sv = surface_points(elements.nets, s, r)
    vectors = np.cross(su, sv) * np.outer(weight, weight).ravel()[:, None]
    low, step = elements.boxes[:, ::2], elements.boxes[:, 1::2] - elements.boxes[:, ::2]
    along = np.where(elements.side[:, None] == 1, 1.0 - s, s)
    u = low[:, :1] + step[:, :1] * along
    v = low[:, 1:] + step[:, 1:] * r
    patch = np.repeat(elements.patch_index[:, None], len(s), axis=1)
    values = np.zeros(patch.shape)
    for row in np.unique(lamp):
        profile, here = scene.luminaires[row].profile, lamp == row
        assert profile is not None
        found = profile.at(
            points[here].reshape(-1, 3), patch[here].ravel(), u[here].ravel(), v[here].ravel()
        )
        values[here] = found.reshape(-1, len(s))
    return points, vectors, values


def between(order: int) -> FloatArray:
    """Polynomials (order², k) of an element at the nodes of another rule."""
    one = lagrange(gauss_rule(NODES)[0], 1, gauss_rule(order)[0])
    return np.einsum("ga,hb->ghab", one, one).reshape(order**2, -1)
