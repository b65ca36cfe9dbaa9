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
        return Tree(*RayCaster(self.scene.without_panes.patches).arrays)

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
            Accuracy of the light, relative.
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
        counters, parts = np.zeros((len(out), 2), dtype=np.int64), []
        known = self.kept.sights(rows)
        for first in range(0, len(out), BLOCK):
            some = slice(first, min(first + BLOCK, len(out)))
            factors = np.asarray(rows.factors[np.arange(some.start, some.stop)])
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
                self._tree,
                self._lift,
                REACHED,
                light,
                before,
                found,
                out[some],
                counters[some],
            )
            parts.append(found)
        self.kept.keep_sights(rows, _joined(parts))
        pairs, asked = counters.sum(axis=0)
        self.kept.stages.count({"pairs_half_hidden": int(pairs), "pairs_sighted": int(asked)})


def _empty(count: NDArray[np.int64]) -> Sights:
    """Room for ``count`` (m,) pairs of each receiver."""
    k = int(count.sum())
    start = np.concatenate([[0], np.cumsum(count)])
    return Sights(start, np.empty(k, dtype=np.int32), np.empty(k), np.empty(k, np.int32))


def _part(known: Sights | None, some: slice) -> Sights:
    """What is known of ``some`` receivers."""
    if known is None:
        return _empty(np.zeros(some.stop - some.start, dtype=np.int64))
    start = known.start[some.start : some.stop + 1]
    pairs = slice(start[0], start[-1])
    return Sights(start - start[0], *(values[pairs] for values in known[1:]))


def _joined(parts: list[Sights]) -> Sights:
    """Of the receivers of all ``parts``, one after the other."""
    count = np.concatenate([np.diff(part.start) for part in parts])
    start = np.concatenate([[0], np.cumsum(count)])
    element, whole, seen = (np.concatenate(values) for values in list(zip(*parts, strict=True))[1:])
    return Sights(start, element, whole, seen)
