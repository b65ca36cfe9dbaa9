"""Partly hidden form factors by the contour of what is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from .kernels.pieces import Surfaces
    from .kernels.pyramid import Blockers
    from .kernels.rows import Sources

#: Accuracy of the contour against that asked for.
_SHARE = 0.1


def visible_factors(
    x: FloatArray,
    n: FloatArray,
    share: FloatArray,
    on: IntArray,
    sources: Sources,
    blockers: Blockers,
    plain: FloatArray,
    accuracy: float,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Form factors (m, n) and which of them (m, n) are left to other methods.

    Parameters
    ----------
    x, n : (m, 3) array
        Points [m] and unit normals.
    share : (m, 1) array
        0 for points that get no light.
    on : (m,) int array
        Surface each point lies on, −1 for none.
    sources, blockers
        Sources and all distinct surfaces; ``sources.group[:, 2]`` names the surface of each.
    plain : (m, n) array
        Factors without hiding.
    accuracy : float
        Error allowed relative to these.
    """
    from .kernels.visible_contour import LEFT, contour_rows
    from .quadrics import fit_quadrics
    from .topology import writable

    quadrics = fit_quadrics(blockers.nets)
    values = np.array(plain)
    status = np.zeros(plain.shape, dtype=np.int64)
    contour_rows(
        writable(x),
        writable(n * share),
        writable(on, np.int64),
        writable(sources.group[:, 2], np.int64),
        sources.nets,
        sources.flags,
        sources.spheres,
        writable(plain),
        _SHARE * accuracy,
        blockers,
        _surfaces(blockers, quadrics),
        quadrics,
        sources.quadrics,
        values,
        status,
    )
    return values, status == LEFT


def _surfaces(blockers: Blockers, quadrics: FloatArray) -> Surfaces:
    """What `kernels.outlines` needs; tangent planes of those neither flat nor quadrics only."""
    from .kernels.pieces import Surfaces
    from .strict import neighbors, tangent_planes
    from .topology import PLANAR, writable

    count = len(blockers.nets)
    tangents, centers = np.zeros((count, 9, 9, 4)), np.zeros((count, 3))
    bent = (blockers.flags & PLANAR == 0) & (quadrics[:, 4, 3] == 0.0)
    if bent.any():
        tangents[bent], centers[bent] = tangent_planes(blockers.nets[bent])
    return Surfaces(
        nets=blockers.nets,
        kinds=blockers.kinds,
        tangents=tangents,
        centers=centers,
        neighbors=neighbors(blockers.nets, blockers.adjacent),
        sheet=writable(blockers.solid, np.int64),
        flags=blockers.flags,
    )
