"""Light of partly hidden elements, by where they are hidden; see `kernels.half_hidden`."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .direct_light import LIFT, REACHED
from .exchange import Rows
from .kernels.half_hidden import Sights, add_half_hidden, count_pairs
from .kernels.paths import Tree
from .kernels.rows import Sources
from .model.arrays import FloatArray
from .model.scene import SceneData
from .raycast import RayCaster
from .reuse import Kept
from .surfaces import Receivers
from .topology import writable
from .unknowns import BLOCK, Unknowns
from .walls import walls_under

#: Share that is hidden of an element below which no rays are asked for, for each unit of the error
#: of moments, and at most.
LITTLE, LITTLE_AT_MOST = 5.0, 0.05
#: Pairs that are kept for later runs: so many, or as large a share of all that there are. They take
#: 12 bytes each, form factors 4.
KEPT, KEPT_SHARE = 2_000_000, 0.1
#: Share of the error of moments, of all light that a receiver gets, below which it does not matter
#: where an element is hidden.
SMALL = 0.1


class HalfHidden:
    """Where the elements of one scene are hidden from receivers that see them in part.

    Parameters
    ----------
    scene : SceneData
        The scene.
    kept : Kept
        What runs before this one have found, and its counters.
    """

    def __init__(self, scene: SceneData, kept: Kept) -> None:
        self.scene, self.kept = scene, kept
        low, high = scene.patches.bounds()
        self._lift = LIFT * float(np.linalg.norm(high - low))

    @cached_property
    def _tree(self) -> Tree:
        patches = self.scene.without_panes.patches
        return Tree(*self.kept.find("rays", (), lambda: RayCaster(patches).arrays))

    def add(
        self,
        out: FloatArray,
        unknowns: Unknowns,
        rows: Rows,
        receivers: Receivers,
        sources: Sources,
        eps: float,
        light: FloatArray,
    ) -> None:
        """Add to ``out`` (m, b) what receivers get more, or less, of ``light`` (N, b).

        Parameters
        ----------
        eps : float
            Error of the share of each node in the form factor of an element, as in
            `Unknowns.gather`.
        """
        basis = unknowns.basis
        if basis is None or not len(out):
            return
        apart = np.abs(light - unknowns.mean(light)[unknowns.element]).sum(axis=1)
        off = np.zeros(unknowns.elements)
        np.maximum.at(off, unknowns.element, apart)
        least = SMALL * eps * np.abs(out).sum(axis=1)
        which = np.flatnonzero(off > least.min())
        if not len(which):
            return
        at = receivers.nodes, receivers.normals, receivers.weights
        walls, light = walls_under(*at, sources.wall_spheres), writable(light)
        counters = np.zeros((len(out), 2), dtype=np.int64)
        known, parts, pairs = self.kept.sights(rows), [], 0
        most = (
            max(KEPT, int(KEPT_SHARE * len(out) * unknowns.elements))
            if self.kept.keeps(rows)
            else 0
        )
        for first in range(0, len(out), BLOCK):
            some = slice(first, min(first + BLOCK, len(out)))
            factors = rows.of_elements(np.arange(some.start, some.stop))
            before = _part(known, some)
            count = np.zeros(len(factors), dtype=np.int64)
            count_pairs(factors, which, off[which], least[some], before, count)
            found = _empty(count)
            add_half_hidden(
                writable(receivers.nodes[some, 0]),
                writable(receivers.normals[some, 0]),
                walls[some],
                factors,
                sources,
                basis,
                which,
                off[which],
                least[some],
                min(LITTLE * eps, LITTLE_AT_MOST),
                not self.scene.glazings,
                self._tree,
                self._lift,
                REACHED,
                light,
                before,
                found,
                out[some],
                counters[some],
            )
            pairs += len(found.element)
            if pairs <= most:
                parts.append(found)
        if pairs <= most:
            self.kept.keep_sights(rows, parts)
        hidden, asked = counters.sum(axis=0)
        self.kept.stages.count({"pairs_half_hidden": int(hidden), "pairs_sighted": int(asked)})


def _empty(count: NDArray[np.int64]) -> Sights:
    """Room for ``count`` (m,) pairs of each receiver."""
    k = int(count.sum())
    start = np.concatenate([[0], np.cumsum(count)])
    return Sights(start, np.empty(k, dtype=np.int32), np.empty(k, dtype=np.int64))


def _part(known: Sights | None, some: slice) -> Sights:
    """What is known of ``some`` receivers."""
    if known is None:
        return _empty(np.zeros(some.stop - some.start, dtype=np.int64))
    start = known.start[some.start : some.stop + 1]
    pairs = slice(start[0], start[-1])
    return Sights(start - start[0], known.element[pairs], known.seen[pairs])
