"""Partly hidden form factors by the contour of what is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .prepared import Prepared
from .quadrics import may_lie_on
from .surfaces import Receivers

if TYPE_CHECKING:
    from .kernels.pieces import Surfaces
    from .kernels.rows import Sources

#: Openings narrower than this against a patch may be missed, and its factor be off by as much.
FINEST = 1e-8
#: Accuracy of the contour against that asked for.
_SHARE = 0.1


def visible_factors(
    receivers: Receivers, prepared: Prepared, plain: FloatArray, accuracy: float
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Form factors (m, n), which of them were found, and which are left to other methods.

    The others have nothing in the way, or nothing to be seen.

    Parameters
    ----------
    receivers : Receivers
        As in `strict.strict_form_factors`.
    prepared : Prepared
        What gives and hides light.
    plain : (m, n) array
        Factors without hiding.
    accuracy : float
        Error allowed relative to these.
    """
    from .kernels.visible_contour import LEFT, SOLVED, contour_rows
    from .topology import writable

    sources, (surfaces, regions) = prepared.sources, prepared.outlines
    x = receivers.nodes[:, 0]
    values = np.array(plain)
    status = np.zeros(plain.shape, dtype=np.int64)
    contour_rows(
        writable(x),
        writable(receivers.normals[:, 0] * receivers.weights),
        writable(receivers.patches, np.int64),
        _askew(receivers, surfaces),
        writable(sources.group[:, 2], np.int64),
        sources.nets,
        sources.flags,
        sources.spheres,
        writable(plain),
        _SHARE * accuracy,
        prepared.surfaces,
        surfaces,
        regions,
        sources.quadrics,
        values,
        status,
    )
    left = (status == LEFT) | (_lie_on(x, receivers.patches, sources) & (plain > 0.0))
    return values, (status == SOLVED) & ~left, left


def _askew(receivers: Receivers, surfaces: Surfaces) -> NDArray[np.bool_]:
    """Which receivers (m,) on curved surfaces do not look along the normal there."""
    from .kernels.brackets import ASKEW
    from .strict import touched
    from .topology import PLANAR

    if (receivers.patches < 0).all():
        return np.zeros(len(receivers.patches), dtype=bool)
    x, n = receivers.nodes[:, 0], receivers.normals[:, 0]
    rows, views = touched(x, n, receivers.patches, surfaces)
    curved = (rows >= 0) & (surfaces.flags[rows] & PLANAR == 0)
    return np.asarray((curved & (views == ASKEW)).any(axis=1))


def _lie_on(x: FloatArray, on: IntArray, sources: Sources) -> NDArray[np.bool_]:
    """Which points (m, n) lie on a source, or on its edge: what they see of it is not so exact."""
    out = np.asarray(on[:, None] == sources.group[:, 2][None], dtype=bool)
    for j, quadric in enumerate(sources.quadrics):
        if quadric.any():
            out[:, j] |= may_lie_on(x, sources.spheres[j], quadric)
    return out
