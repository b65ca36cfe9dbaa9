"""Rows of form factors of large meshes: found, closed and packed block by block."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .memory import BLOCK_BYTES, GB, PACKED_BYTES, PAIR_BYTES, packed_room
from .model.arrays import FloatArray
from .packed import GroupedVariances, PackedMatrix
from .row_finder import Ask, RowFinder
from .stages import Stages
from .surfaces import Surfaces

LOG = logging.getLogger(__name__)

#: Rows that are found at a time at least.
LEAST_ROWS = 64
#: Groups of elements whose variances are kept apart, at most.
GROUPS = 256
#: Form factor of sky and ground above which the meridians of a row see out.
OUTSIDE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class PackedRows(Rows):
    """Rows of which single factors are known to 2⁻¹², and variances by groups of elements."""

    grouped: GroupedVariances = field(kw_only=True)

    def variance_of(self, light: FloatArray) -> FloatArray:
        return self.grouped.of(light)


def find_packed(
    finder: RowFinder,
    asked: Ask,
    surfaces: Surfaces,
    sees_out: Callable[[Rows, NDArray[np.bool_]], bool],
    tell: Callable[[int, int], None] | None = None,
) -> tuple[PackedRows, bool, FloatArray]:
    """Rows from all elements to all, closed and packed.

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
    row_sums : (n,) array
        Sums of the rows before any correction.
    """
    n, m = len(asked.sources.nets), len(asked.receivers.nodes)
    room = packed_room(n)
    LOG.info(
        "form factors of %d x %d elements are packed: at most %.1f GB, of which %s of memory",
        *(m, n, PACKED_BYTES * m * n / GB),
        "any number" if room is None else f"{room / GB:.1f} GB",
    )
    matrix = PackedMatrix(n, room=room)
    variances = _variances(surfaces)
    sums, row_sums, outside = np.zeros((m, 2)), np.zeros(m), np.zeros((m, 5))
    own = copy.copy(finder)
    own.stages = Stages()  # warnings of all blocks make one
    size = max(LEAST_ROWS, int(BLOCK_BYTES / (PAIR_BYTES * n)))
    blocks = [slice(start, min(start + size, m)) for start in range(0, m, size)]
    lit, out = surfaces.areas > 0.0, False
    early: list[int] = []

    def find(k: int) -> None:
        nonlocal out
        some = blocks[k]
        part = asked.block(some)
        rows = own.rows(part)
        out = out or sees_out(rows, lit[some])
        if not out and (rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE).any():
            early.append(k)
        row_sums[some] = own.close(rows, 1.0, part, outside=out)
        if k < matrix.blocks:
            matrix.replace(k, rows.factors)
        else:
            matrix.append(rows.factors)
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
    finder.stages.count({"packed_bytes": matrix.nbytes, "bytes_on_disk": matrix.bytes_on_disk})
    warnings = own.stages.warnings
    if warnings:
        more = f" (and likewise in {len(warnings) - 1} other blocks)" if len(warnings) > 1 else ""
        finder.stages.warnings.append(warnings[0] + more)
    known = cast(Any, matrix), cast(Any, variances)  # they are asked for entries, as arrays are
    return PackedRows(*known, {}, outside, sums, grouped=variances), out, row_sums


def _variances(surfaces: Surfaces) -> GroupedVariances:
    """Groups of elements that are likely to be as bright as each other, by lamp and material."""
    keys = np.stack([surfaces.lamp, surfaces.material], axis=1)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel().astype(np.int64) % GROUPS
    return GroupedVariances(group, int(group.max(initial=0)) + 1, np.flatnonzero(surfaces.web))
