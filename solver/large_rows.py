"""Rows of form factors of large meshes: found, closed and packed block by block."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows, products
from .memory import BLOCK_BYTES, GB, PACKED_BYTES, PAIR_BYTES, packed_room
from .model.arrays import FloatArray, IntArray, MatrixArray
from .packed import GroupedVariances, PackedMatrix
from .row_finder import Ask, RowFinder
from .shared_rows import shared_rows
from .stages import Stages
from .surfaces import Surfaces
from .unknowns import Unknowns

LOG = logging.getLogger(__name__)

#: Rows that are found at a time at least.
LEAST_ROWS = 64
#: Groups of elements whose variances are kept apart, at most.
GROUPS = 256
#: Form factor of sky and ground above which the meridians of a row see out.
OUTSIDE = 1e-6
#: How far receivers of shared rows may be apart, against the aimed size of elements.
SHARED = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class PackedRows(Rows):
    """Rows of which single factors are known to 2⁻¹², and variances by groups of elements.

    The factors are those of the ``unknowns``, of which an element may have several.
    """

    grouped: GroupedVariances = field(kw_only=True)
    unknowns: Unknowns = field(kw_only=True)

    def gather(self, light: FloatArray) -> FloatArray:
        return products(self.factors, light[self.unknowns.element])

    def of_elements(self, some: IntArray) -> MatrixArray:
        own, first = np.unique(self.unknowns.element, return_index=True)
        out = np.zeros((len(some), self.unknowns.elements), dtype=np.float32)
        out[:, own] = np.add.reduceat(cast(Any, self.factors).take(some), first, axis=1)
        return out

    def variance_of(self, light: FloatArray) -> FloatArray:
        return self.grouped.of(light)


def find_packed(
    finder: RowFinder,
    asked: Ask,
    surfaces: Surfaces,
    unknowns: Unknowns,
    sees_out: Callable[[Rows, NDArray[np.bool_]], bool],
    tell: Callable[[int, int], None] | None = None,
) -> tuple[PackedRows, bool, FloatArray]:
    """Rows from all unknowns to all, closed and packed.

    Whether light can leave the scene is known when all rows are. Blocks before the first that shows
    it were closed as if it could not: those of them whose meridians met nothing somewhere are found
    once more.

    Parameters
    ----------
    finder : RowFinder
        Of the scene.
    asked : Ask
        All rows.
    surfaces : Surfaces
        Optical state of the elements.
    unknowns : Unknowns
        What their light is made of, N in number; neighbours may share a row.
    sees_out : callable
        Whether rows, some of them lit, show that light can leave.
    tell : callable, optional
        Called as ``tell(rows_done, rows_total)``.

    Returns
    -------
    rows : PackedRows
        What was found.
    out : bool
        Whether light can leave.
    row_sums : (N,) array
        Sums of the rows before any correction.
    """
    n, m = len(asked.sources.nets), len(unknowns)
    room = packed_room(m)
    LOG.info(
        "form factors of %d x %d unknowns are packed: at most %.1f GB, of which %s of memory",
        *(m, m, PACKED_BYTES * m * m / GB),
        "any number" if room is None else f"{room / GB:.1f} GB",
    )
    matrix = PackedMatrix(m, room=room)
    solids = finder.blockers.solid[asked.receivers.patches]
    budget = asked.budget
    leader = shared_rows(asked.receivers, solids, SHARED * budget.size if budget.is_large else 0.0)
    variances = _variances(surfaces)
    sums, row_sums, outside = np.zeros((m, 2)), np.zeros(m), np.zeros((m, 5))
    own = copy.copy(finder)
    own.stages = Stages()  # warnings of all blocks make one
    size = max(LEAST_ROWS, int(BLOCK_BYTES / (PAIR_BYTES * max(n, m / 2))))
    blocks = [slice(start, min(start + size, m)) for start in range(0, m, size)]
    lit, out = unknowns.areas > 0.0, False
    early: list[int] = []
    shared = 0

    def find(k: int) -> None:
        nonlocal out, shared
        some = blocks[k]
        found, row = np.unique(leader[some], return_inverse=True)
        shared += len(row) - len(found)
        part = asked.some(found)
        rows = own.rows(part)
        out = out or sees_out(rows, lit[found])
        if not out and (rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE).any():
            early.append(k)
        row_sums[some] = own.close(rows, 1.0, part, outside=out)[row]
        spread = unknowns.factors(rows, part.receivers, part.sources, budget.moments)
        _lift_negative(spread, unknowns)
        if len(found) < len(row):
            spread, rows = spread[row], rows.take(row)
        if k < matrix.blocks:
            matrix.replace(k, spread)
        else:
            matrix.append(spread)
        variances.put(some.start, rows.variances)
        sums[some], outside[some] = rows.sums, rows.outside

    for k, some in enumerate(blocks):
        find(k)
        if tell is not None:
            tell(some.stop, m)
    if out:
        for k in list(early):
            find(k)
        own.stages.count({"rows_found_twice": sum(len(range(m)[blocks[k]]) for k in early)})
    finder.stages.count(own.stages.counters)
    finder.stages.count({"rows_shared": shared})
    finder.stages.count({"packed_bytes": matrix.nbytes, "bytes_on_disk": matrix.bytes_on_disk})
    warnings = own.stages.warnings
    if warnings:
        more = f" (and likewise in {len(warnings) - 1} other blocks)" if len(warnings) > 1 else ""
        finder.stages.warnings.append(warnings[0] + more)
    known = cast(Any, matrix), cast(Any, variances)  # they are asked for entries, as arrays are
    rows = PackedRows(*known, {}, outside, sums, grouped=variances, unknowns=unknowns)
    return rows, out, row_sums


def _variances(surfaces: Surfaces) -> GroupedVariances:
    """Groups of elements that are likely to be as bright as each other, by lamp and material."""
    keys = np.stack([surfaces.lamp, surfaces.material], axis=1)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel().astype(np.int64) % GROUPS
    return GroupedVariances(group, int(group.max(initial=0)) + 1, np.flatnonzero(surfaces.web))


def _lift_negative(factors: MatrixArray, unknowns: Unknowns) -> None:
    """Make the factors (k, N) of nodes at least 0, in place; those of whole elements stay.

    Close to an element its light is extrapolated from the nodes, and those on its far side count
    against it. Packed factors have no sign: there the nearer nodes stand for all.
    """
    if unknowns.basis is None:
        return
    row, column = np.nonzero(factors < 0.0)
    if not len(row):
        return
    pairs = np.unique(np.stack([row, unknowns.element[column]]), axis=1)
    row, element = pairs[0][:, None], pairs[1]
    start = unknowns.basis.start
    count = int((start[element + 1] - start[element]).max())
    at = start[element][:, None] + np.arange(count)
    own = at < start[element + 1][:, None]
    at = np.where(own, at, 0)
    values = np.where(own, factors[row, at], 0.0).astype(np.float64)
    positive = np.maximum(values, 0.0)
    total, kept = values.sum(axis=1), positive.sum(axis=1)
    scale = np.maximum(total, 0.0) / np.where(kept > 0.0, kept, 1.0)
    where = np.nonzero(own)
    rows = np.broadcast_to(row, at.shape)[where]
    factors[rows, at[where]] = (positive * scale[:, None])[where]
