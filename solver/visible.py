"""Partly hidden form factors by the contour of what is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .quadrics import may_lie_on
from .surfaces import Receivers

if TYPE_CHECKING:
    from .kernels.pieces import Surfaces
    from .kernels.pyramid import Blockers
    from .kernels.rows import Sources

#: Coefficients of one quadric fitted to two of its patches, of size 1, differ by this at most.
_ALIKE = 1e-10
#: Openings narrower than this against a patch may be missed, and its factor be off by as much.
FINEST = 1e-8
#: Accuracy of the contour against that asked for.
_SHARE = 0.1


def visible_factors(
    receivers: Receivers,
    sources: Sources,
    blockers: Blockers,
    quadrics: FloatArray,
    plain: FloatArray,
    accuracy: float,
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Form factors (m, n), which of them were found, and which are left to other methods.

    The others have nothing in the way, or nothing to be seen.

    Parameters
    ----------
    receivers, sources, blockers
        As in `strict.strict_form_factors`.
    quadrics : (p, 5, 4) array
        Of the surfaces, from `fit_quadrics`.
    plain : (m, n) array
        Factors without hiding.
    accuracy : float
        Error allowed relative to these.
    """
    from .kernels.visible_contour import LEFT, SOLVED, contour_rows
    from .topology import writable

    x = receivers.nodes[:, 0]
    values = np.array(plain)
    status = np.zeros(plain.shape, dtype=np.int64)
    contour_rows(
        writable(x),
        writable(receivers.normals[:, 0] * receivers.weights),
        writable(receivers.patches, np.int64),
        writable(sources.group[:, 2], np.int64),
        sources.nets,
        sources.flags,
        sources.spheres,
        writable(plain),
        _SHARE * accuracy,
        blockers,
        _surfaces(blockers, quadrics),
        writable(quadrics),
        sources.quadrics,
        values,
        status,
    )
    left = (status == LEFT) | (_lie_on(x, receivers.patches, sources) & (plain > 0.0))
    return values, (status == SOLVED) & ~left, left


def _lie_on(x: FloatArray, on: IntArray, sources: Sources) -> NDArray[np.bool_]:
    """Which points (m, n) lie on a source, or on its edge: what they see of it is not so exact."""
    out = np.asarray(on[:, None] == sources.group[:, 2][None], dtype=bool)
    for j, quadric in enumerate(sources.quadrics):
        if quadric.any():
            out[:, j] |= may_lie_on(x, sources.spheres[j], quadric)
    return out


def _surfaces(blockers: Blockers, quadrics: FloatArray) -> Surfaces:
    """What `kernels.outlines` needs; tangent planes of those neither flat nor quadrics only."""
    from .kernels.outlines import SMOOTH
    from .strict import see_through
    from .topology import PLANAR

    surfaces = see_through(blockers, (blockers.flags & PLANAR == 0) & (quadrics[:, 4, 3] == 0.0))
    beyond = surfaces.neighbors
    beyond[..., 2] = np.where(_goes_on(quadrics, beyond), SMOOTH, beyond[..., 2])
    return surfaces


def _goes_on(quadrics: FloatArray, beyond: IntArray) -> NDArray[np.bool_]:
    """Whether the patch over each side (p, 4) lies on the same quadric, and faces the same way."""
    other = np.maximum(beyond[..., 0], 0)
    mine, theirs = quadrics[:, None], quadrics[other]
    # Both in the coordinates of the first.
    move = np.zeros((*other.shape, 4, 4))
    ratio = theirs[..., 4, 3] / np.where(mine[..., 4, 3] > 0.0, mine[..., 4, 3], 1.0)
    move[..., [0, 1, 2], [0, 1, 2]] = ratio[..., None]
    move[..., :3, 3] = (mine[..., 4, :3] - theirs[..., 4, :3]) * theirs[..., 4, 3:]
    move[..., 3, 3] = 1.0
    same = move.swapaxes(-1, -2) @ theirs[..., :4, :] @ move
    a, b = (
        q / np.maximum(np.abs(q).max(axis=(-1, -2), keepdims=True), 1e-300)
        for q in (np.broadcast_to(mine[..., :4, :], same.shape), same)
    )
    alike = np.abs(a - beyond[..., 3, None, None] * b).max(axis=(-1, -2)) <= _ALIKE
    known = (mine[..., 4, 3] > 0.0) & (theirs[..., 4, 3] > 0.0)
    return np.asarray((beyond[..., 0] >= 0) & known & alike)
