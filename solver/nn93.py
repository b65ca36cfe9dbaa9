"""The method of Nishita and Nakamae 1993 as published, and the discs it was compared with.

References
----------
.. [1] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993.
.. [2] J. R. Wallace, K. A. Elmquist, E. A. Haines, "A Ray Tracing Algorithm for Progressive
   Radiosity", Computer Graphics (SIGGRAPH) 23(3), 1989.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .model.arrays import FloatArray, frozen
from .model.bezier import tangents
from .model.form_factors import FormFactors
from .model.patches import PatchSet


def nn93_form_factors(
    points: FloatArray,
    normals: FloatArray,
    sources: PatchSet,
    blockers: PatchSet | None = None,
    *,
    accuracy: float = 1e-4,
    visibility: str = "auto",
) -> FormFactors:
    """Form factors (m, n) by polygons and pyramid tracing [1, sec. 4.2].

    ``high`` is the band bound of eq. 5, which no form factor exceeds, ``low`` is 0: the paper
    states no other. Sub-elements are quartered until their bound is below the square root of
    ``accuracy`` of the element's, 1/1000 at least.
    """
    from .kernels.nn93 import nn93_rows
    from .prepared import distinct_nets
    from .topology import writable

    others = np.empty((0, 4, 4, 4)) if blockers is None else blockers.control_points
    nets, place = distinct_nets(sources.control_points, others)
    m, n = len(points), len(sources)
    shares, bounds = np.zeros((m, n, 4)), np.zeros((m, n))
    if bounds.size:
        nn93_rows(
            writable(points),
            writable(normals),
            np.full(m, -1),
            np.zeros(m, dtype=bool),
            np.zeros(m),
            writable(sources.control_points),
            place,
            writable(nets),
            np.full(len(nets), visibility != "none"),
            max(math.sqrt(accuracy), 1e-3),
            0.0,
            shares,
            bounds,
        )
    value = shares.sum(axis=2)
    high = np.minimum(np.maximum(bounds, value), 1.0)
    return FormFactors(np.minimum(value, high), np.zeros_like(value), high, False)


def corners(patches: PatchSet) -> tuple[FloatArray, FloatArray]:
    """Corners (p, 4, 3) [m] and unit +normals there, where the paper evaluates radiance [1, 4.2].

    A corner on the edge of another patch has no one value: it depends on the direction from which
    the corner is approached. The default method has its nodes inside the elements.
    """
    u, v = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    at = np.empty((len(patches), 4, 3))
    normals = np.empty_like(at)
    for k, net in enumerate(patches.control_points):
        at[k], _, _ = tangents(net, u, v)
        # A little inwards: a collapsed side has no normal.
        _, su, sv = tangents(net, u + 1e-6 * (0.5 - u), v + 1e-6 * (0.5 - v))
        n = np.cross(su, sv)
        normals[k] = n / np.linalg.norm(n, axis=1, keepdims=True)
    return at, normals


def disc_form_factors(
    points: ArrayLike, normals: ArrayLike, sources: PatchSet, *, divisions: int = 3
) -> FloatArray:
    """Form factors (m, n) with each of divisions² sub-elements taken for a disc [2, eq. 7].

    A disc of area A at distance r gives A cosθ cosθ' / (π r² + A); hiding is ignored.
    """
    x, n = np.atleast_2d(frozen(points)), np.atleast_2d(frozen(normals))
    t = (np.arange(divisions) + 0.5) / divisions
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    out = np.empty((len(x), len(sources)))
    for j, net in enumerate(sources.control_points):
        at, su, sv = tangents(net, u, v)
        m = np.cross(su, sv)
        size = np.linalg.norm(m, axis=1)
        area = size / divisions**2
        r = at[None] - x[:, None]
        r2 = np.maximum((r * r).sum(axis=2), 1e-300)
        here = np.maximum(np.einsum("ikc,ic->ik", r, np.broadcast_to(n, x.shape)), 0.0)
        there = np.maximum(-np.einsum("ikc,kc->ik", r, m / size[:, None]), 0.0)
        out[:, j] = (area * here * there / (r2 * (math.pi * r2 + area))).sum(axis=1)
    return out
