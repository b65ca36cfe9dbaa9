"""Rows of form factors among surfaces of which some have moved: what changes is found anew."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .arrangement import Changed
from .edges import near_ratio
from .exchange import COUNTERS, LEVELS, PAIRS_PER_BLOCK, ROWS_PER_BLOCK, Rows
from .kernels.pyramid import Blockers
from .kernels.threads import count_threads
from .model.arrays import MatrixArray
from .model.scene import SceneData
from .model.sky import CIESky
from .row_finder import Ask
from .skies import sky_tone
from .topology import writable
from .walls import walls_under


def renewed_rows(
    rows: Rows,
    asked: Ask,
    changed: Changed,
    scene: SceneData,
    blockers: Blockers,
    *,
    eps: float,
    tell: Callable[[int, int], None] | None = None,
) -> Rows:
    """A copy of rows with the pairs that have ``changed`` found anew, along the same meridians.

    Parameters
    ----------
    rows : Rows
        Among the surfaces as they were, of single precision.
    asked : Ask
        What they are asked for now, by meridians.
    changed : Changed
        What of them is to be found.
    scene, blockers
        As they are now.
    eps : float
        Relative accuracy of unoccluded factors.
    tell : callable, optional
        Called as ``tell(rows_done, rows_total)``.
    """
    from .kernels.renewed import renew_rows

    factors, variances = rows.factors.copy(), rows.variances.copy()
    outside, sums, receivers = rows.outside.copy(), rows.sums.copy(), asked.receivers
    m, n = factors.shape
    counters = np.zeros((m, len(COUNTERS)), dtype=np.int64)
    sky = CIESky(5, zenith_luminance_cd_m2=1.0) if scene.sky is None else scene.sky
    lifts = np.zeros(m) if asked.lifts is None else asked.lifts
    at = receivers.nodes, receivers.normals, receivers.weights
    walls = walls_under(*at, asked.sources.wall_spheres)
    block = max(ROWS_PER_BLOCK, PAIRS_PER_BLOCK // max(n, 1))
    for start in range(0, m, block):
        some = slice(start, min(start + block, m))
        renew_rows(
            writable(receivers.nodes[some]),
            writable(receivers.normals[some]),
            writable(receivers.weights[some]),
            writable(receivers.patches[some], np.int64),
            writable(receivers.own[some], np.int64),
            walls[some],
            writable(lifts[some]),
            asked.first + start,
            asked.sources,
            blockers,
            near_ratio(eps),
            eps,
            LEVELS,
            sky_tone(sky),
            count_threads(),
            changed.again[some],
            changed.pairs[some],
            changed.places,
            changed.whole[some],
            factors[some],
            variances[some],
            outside[some],
            sums[some],
            counters[some],
        )
        if tell is not None:
            tell(some.stop, m)
    total = counters.sum(axis=0)
    return Rows(factors, variances, {k: int(total[c]) for k, c in COUNTERS.items()}, outside, sums)


def renewed_unoccluded(
    factors: MatrixArray, asked: Ask, changed: NDArray[np.bool_], blockers: Blockers, eps: float
) -> None:
    """Find unoccluded form factors (m, n) of ``changed`` (n,) elements anew, in place."""
    from .kernels.renewed import renew_unoccluded

    receivers = asked.receivers
    at = receivers.nodes, receivers.normals, receivers.weights
    renew_unoccluded(
        *(writable(array) for array in at),
        writable(receivers.patches, np.int64),
        writable(receivers.own, np.int64),
        walls_under(*at, asked.sources.wall_spheres),
        asked.sources,
        blockers,
        near_ratio(eps),
        eps,
        writable(changed, np.bool_),
        factors,
    )
