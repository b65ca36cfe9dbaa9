"""Blockers after parts have moved: what the others are is known."""

from __future__ import annotations

import numpy as np

from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, IntArray
from .model.patches import PatchSet
from .reuse import Kept
from .topology import adjacency, edge_points, make_blockers, size_of


def kept_blockers(
    kept: Kept, patches: PatchSet, closed: IntArray, solid: IntArray, one_sided: IntArray
) -> Blockers:
    """As `make_blockers`; of solids that stand where they stood in a run before nothing is made."""

    def make() -> Blockers:
        before = kept.of_parts("blockers", ())
        known = None if before is None else _renewed(before, patches, closed, solid, one_sided)
        return known or make_blockers(patches, closed, solid, one_sided=one_sided)

    found = kept.find("blockers", (), make)
    kept.keep_of_parts("blockers", (), found)
    return found


def _renewed(
    before: Blockers, patches: PatchSet, closed: IntArray, solid: IntArray, one_sided: IntArray
) -> Blockers | None:
    """Blockers ``before`` with the solids that have moved; None where all are to be made.

    Neighbours are looked for as far apart as the whole scene is large.
    """
    nets, old = patches.control_points, before.nets
    if old.shape != nets.shape or _size(old) != _size(nets):
        return None
    moved = np.unique(solid[(old != nets).any(axis=(1, 2, 3))])
    rows = np.flatnonzero(np.isin(solid, moved))
    if not len(rows):
        return before
    own, names = patches.take(rows), solid[rows]
    beside = adjacency(own.control_points, names, extent=_size(nets))
    part = make_blockers(own, closed[rows], names, beside, one_sided=one_sided[rows])
    adjacent = np.where(part.adjacent >= 0, rows[part.adjacent], -1)
    every = {name: array.copy() for name, array in before._asdict().items()}
    for name in ("nets", "kinds", "cones", "flags", "spheres"):
        every[name][rows] = getattr(part, name)
    every["adjacent"][rows] = adjacent
    for name in ("bulging", "hollow"):
        every[name][moved] = getattr(part, name)[moved]
    return Blockers(**every)


def _size(nets: FloatArray) -> float:
    return size_of(edge_points(nets))
