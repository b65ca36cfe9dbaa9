"""Glossy reflection by Phong's lobe: radiance of a point, from sources alone.

References
----------
.. [1] B. T. Phong, "Illumination for Computer Generated Pictures", Communications of the ACM
   18(6), 1975; R. R. Lewis, "Making Shaders More Physically Plausible", Computer Graphics Forum
   13(2), 1994, for the factor (n + 2) / (2π) that keeps the balance of energy.
.. [2] T. Nishita, E. Nakamae, "A New Radiosity Approach Using Area Sampling for Parametric
   Patches", 1993, eq. 15 and 16.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .model.arrays import FloatArray, check_finite, check_shape, frozen
from .model.bezier import area_points, areas, gauss_rule
from .model.optics import MAX_EXPONENT
from .model.patches import PatchSet

if TYPE_CHECKING:
    from .kernels.glossy import Beyond, Shining
    from .kernels.panes import Panes
    from .kernels.paths import Sides, Tree

#: Luminance that does not matter, against the brightest source, where there is nothing else.
_DARK = 1e-3
#: Distance within which rays do not hit what they start on, against the size of the scene.
NEAR = 1e-7


def specular_radiance(
    points: ArrayLike,
    normals: ArrayLike,
    views: ArrayLike,
    sources: PatchSet,
    luminance: ArrayLike,
    *,
    specular: float = 1.0,
    exponent: float = 50.0,
    blockers: PatchSet | None = None,
    accuracy: float = 1e-3,
    method: str = "default",
) -> FloatArray:
    """Luminance that glossy points send to a viewer by way of Phong's lobe.

    L = r_s (n + 2)/(2π) ∫ L_i cosⁿα cosθ dω over what is seen of the sources [1]; with
    ``method="nn93"`` r_s (n + 1)/(2π) ∫ L_i cosⁿα dω [2, eq. 15, 16], which has no cosine θ at the
    receiver. α is the angle to the mirrored view.

    Parameters
    ----------
    points, normals : (m, 3) array
        Points [m] and normals of the glossy surface.
    views : (m, 3) array
        Directions to the viewer.
    sources : PatchSet
        n patches that shine from their + side and hide one another.
    luminance : float or (n,) array
        Of the sources. [cd/m²]
    specular, exponent : float
        Glossy reflectance r_s and sharpness n.
    blockers : PatchSet, optional
        What hides the sources besides, from both sides.
    accuracy : float
        Relative accuracy: cells of the sources are quartered until they are small against the lobe,
        or give less than this share of a thousandth of the brightest source's luminance.
    method : {"default", "nn93"}
        The lobe.

    Returns
    -------
    (m,) array
        Luminance towards the viewer. [cd/m²]

    Raises
    ------
    InputError
        For arrays of wrong shape, and values out of range.
    """
    from .kernels.glossy import Beyond, Lobe
    from .kernels.paths import Sides, Tree
    from .panes import no_panes
    from .raycast import RayCaster

    x = np.atleast_2d(frozen(points))
    check_shape("points", x, (None, 3))
    n = _directions("normals", normals, len(x))
    view = _directions("views", views, len(x))
    if method not in ("default", "nn93"):
        raise InputError(f"method = {method!r}: default or nn93")
    if not 0.0 <= specular <= 1.0:
        raise InputError(f"specular = {specular}: must lie between 0 and 1")
    if not 1.0 <= exponent <= MAX_EXPONENT:
        raise InputError(f"exponent = {exponent}: must lie between 1 and {MAX_EXPONENT:g}")
    if not 1e-12 <= accuracy <= 0.5:
        raise InputError(f"accuracy = {accuracy}: must lie between 1e-12 and 0.5")
    level = np.asarray(luminance, dtype=np.float64)
    if level.ndim == 0:
        level = np.broadcast_to(level, len(sources))
    check_shape("luminance", level, (len(sources),))
    check_finite("luminance", level)
    every = sources if blockers is None else PatchSet.concatenated(sources, blockers)
    points_of = every.control_points[..., :3] / every.control_points[..., 3:]
    size = float(np.linalg.norm(np.ptp(np.concatenate([points_of.reshape(-1, 3), x]), axis=0)))
    nets = sources.control_points
    none = np.zeros((0, 1))
    lobe = Lobe(method == "default", True, float(accuracy), 0, 0, NEAR * size)
    shining = shining_of(nets, level[:, None], level)
    dark = np.full(5, 2.0)
    beyond = Beyond(np.empty(0), np.zeros(1), np.zeros(1), dark, np.zeros(1))
    sides = Sides(np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros((0, 4)), np.zeros(0))
    exponents = np.full(len(x), float(exponent))
    floors = np.full(len(x), _DARK * float(level.max(initial=0.0)))
    light = radiance(
        x, n, view, exponents, floors, lobe, shining, none, none, beyond,
        Tree(*RayCaster(every).arrays), no_panes(), sides,
    )  # fmt: skip
    return np.asarray(specular * light[:, 0])


def _directions(name: str, values: ArrayLike, count: int) -> FloatArray:
    out = np.asarray(values, dtype=np.float64)
    if out.shape == (3,):
        out = np.broadcast_to(out, (count, 3))
    check_shape(name, out, (count, 3))
    check_finite(name, out)
    length = np.linalg.norm(out, axis=1)
    if (length == 0.0).any():
        raise InputError(f"{name}: row {int(np.argmin(length))} is zero")
    return np.asarray(out / length[:, None])


def shining_of(nets: FloatArray, luminance: FloatArray, brightness: FloatArray) -> Shining:
    """Lamps (k, 4, 4, 4) of luminance (k, c) and brightness (k,) for the kernels. [cd/m²]"""
    from .kernels.glossy import Shining
    from .topology import bounding_spheres, writable

    if not len(nets):
        return Shining(
            np.zeros((0, 4, 4, 4)), np.zeros((0, 4)), np.zeros(0), writable(luminance), np.zeros(0)
        )
    _, vectors = area_points(nets, 3)
    rough = np.linalg.norm(vectors, axis=2).sum(axis=1)
    scales = areas(nets) / np.where(rough > 0.0, rough, 1.0)
    return Shining(
        writable(nets),
        bounding_spheres(nets),
        writable(scales),
        writable(luminance),
        writable(brightness),
    )


def radiance(
    points: FloatArray,
    normals: FloatArray,
    views: FloatArray,
    exponents: FloatArray,
    floors: FloatArray,
    lobe: object,
    shining: Shining,
    light: FloatArray,
    emitted: FloatArray,
    beyond: Beyond,
    tree: Tree,
    panes: Panes,
    sides: Sides,
) -> FloatArray:
    """Radiance (m, c) for a glossy reflectance of 1, and in column c the albedo of the lobe.

    Parameters are those of `kernels.glossy.lobe_light`, but ``views`` (m, 3) are the directions to
    the viewer. Points seen from behind send nothing.
    """
    from .kernels.glossy import lobe_light
    from .topology import writable

    cosine = (views * normals).sum(axis=1)
    axes = 2.0 * cosine[:, None] * normals - views
    nodes, weights = gauss_rule(ALBEDO_ORDER)
    out = np.zeros((len(points), light.shape[1] + 1))
    front = np.flatnonzero(cosine > 0.0)
    some = np.zeros((len(front), out.shape[1]))
    lobe_light(
        writable(points[front]), writable(normals[front]), writable(axes[front]),
        writable(exponents[front]), writable(floors[front]), lobe,
        np.ascontiguousarray(np.stack([nodes, weights], axis=1)), shining, writable(light),
        writable(emitted), beyond, tree, panes, sides, some,
    )  # fmt: skip
    out[front] = some
    return out


#: Nodes of the integral over a lobe.
ALBEDO_ORDER = 16
