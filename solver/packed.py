"""Matrices of form factors that are too large to be kept as they are: packed, block by block.

Of each factor 16 bits are kept, rounded to 2⁻¹², and every row a scale that gives it back its sum:
what rounding adds to single factors cancels in the light that whole rows gather. Factors of what
is hidden, and below 2⁻²⁹ of the largest in their row, are nothing and take no room where they are
more than half of a block. Blocks that memory does not hold lie in a file without a name.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .kernels import packed as kernels
from .model.arrays import FloatArray, IntArray, MatrixArray
from .topology import writable

#: Relative rounding of packed factors.
PACKED_ROUNDING = 2.0**-12
#: Share of factors above which a block keeps all of them: a place takes as much as a factor.
SPARSE_BELOW = 0.5
#: Numbers of products that are found at a time: light of more groups than that is passed in turn.
_COLUMNS = 64


@dataclass(frozen=True, slots=True, eq=False)
class _Full:
    """Rows with codes (m, n) of all their factors."""

    codes: MatrixArray
    scales: FloatArray

    def multiply(self, light: FloatArray, columns: FloatArray, out: FloatArray) -> None:
        kernels.multiply_full(self.codes, self.scales, columns, out)

    def add(self, values: FloatArray, out: FloatArray) -> None:
        scaled, sums = writable((values * self.scales[:, None]).T), writable(out.T)
        kernels.add_full(self.codes, scaled, sums)
        out[:] = sums.T

    def unpack(self, rows: IntArray, n: int) -> MatrixArray:
        out = np.empty((len(rows), n), dtype=np.float32)
        kernels.unpack_full(np.ascontiguousarray(self.codes[rows]), self.scales[rows], out)
        return out

    @property
    def nbytes(self) -> int:
        return int(self.codes.nbytes + self.scales.nbytes)


@dataclass(frozen=True, slots=True, eq=False)
class _Sparse:
    """Rows with places and codes of those that are not 0; row i begins at ``start`` (m + 1,)."""

    start: IntArray
    columns: MatrixArray
    codes: MatrixArray
    scales: FloatArray

    def multiply(self, light: FloatArray, columns: FloatArray, out: FloatArray) -> None:
        kernels.multiply_some(self.start, self.columns, self.codes, self.scales, light, out)

    def add(self, values: FloatArray, out: FloatArray) -> None:
        scaled = values * self.scales[:, None]
        kernels.add_some(self.start, self.columns, self.codes, scaled, out)

    def unpack(self, rows: IntArray, n: int) -> MatrixArray:
        out = np.empty((len(rows), n), dtype=np.float32)
        counts = self.start[rows + 1] - self.start[rows]
        start = np.concatenate([[0], np.cumsum(counts)])
        within = np.arange(int(start[-1])) - np.repeat(start[:-1], counts)
        place = np.repeat(self.start[rows], counts) + within
        columns, codes = self.columns[place], self.codes[place]
        kernels.unpack_some(start, columns, codes, self.scales[rows], out)
        return out

    @property
    def nbytes(self) -> int:
        arrays = (self.start, self.columns, self.codes, self.scales)
        return int(sum(array.nbytes for array in arrays))


class PackedMatrix:
    """Form factors (m, n) of which no more than a block is ever unpacked.

    Parameters
    ----------
    columns : int
        Elements n that are seen.
    room : int, optional
        Memory that it may take; what is added beyond goes to a temporary file, which is gone with
        the matrix. [B]
    """

    def __init__(self, columns: int, *, room: int | None = None) -> None:
        self._n = columns
        self._blocks: list[_Full | _Sparse] = []
        self._first = [0]
        self._room, self._held = room, 0
        self._file: IO[bytes] | None = None
        self._end = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._first[-1], self._n

    def __len__(self) -> int:
        return self._first[-1]

    @property
    def blocks(self) -> int:
        """How many there are."""
        return len(self._blocks)

    @property
    def bytes_on_disk(self) -> int:
        """How much of it lies in a file. [B]"""
        return self._end

    @property
    def nbytes(self) -> int:
        """Room that the blocks take. [B]"""
        return sum(block.nbytes for block in self._blocks)

    def append(self, factors: MatrixArray) -> None:
        """Pack more rows (k, n)."""
        scales, counts = np.empty(len(factors)), np.empty(len(factors), dtype=np.int64)
        kernels.count_codes(factors, scales, counts)
        if counts.sum() > SPARSE_BELOW * factors.size:
            full = np.empty(factors.shape, dtype=np.uint16)
            kernels.pack_full(factors, scales, full)
            self._blocks.append(_Full(self._kept(full), scales))
        else:
            start = np.concatenate([[0], np.cumsum(counts)])
            wide = np.uint16 if self._n <= 2**16 else np.uint32
            columns, codes = (np.empty(int(start[-1]), dtype=kind) for kind in (wide, np.uint16))
            kernels.pack_some(factors, scales, start, columns, codes)
            block = _Sparse(start, self._kept(columns), self._kept(codes), scales)
            self._blocks.append(block)
        self._first.append(self._first[-1] + len(factors))

    def replace(self, block: int, factors: MatrixArray) -> None:
        """Pack the rows of the ``block``-th call of `append` anew."""
        kept, first = self._blocks, self._first
        self._blocks, self._first = [], [0]
        self.append(factors)
        kept[block] = self._blocks[0]
        self._blocks, self._first = kept, first

    def _kept(self, array: NDArray[Any]) -> NDArray[Any]:
        """The array, or its copy in the file."""
        if self._room is None or self._held + array.nbytes <= self._room or not array.size:
            self._held += array.nbytes
            return array
        if self._file is None:
            self._file = tempfile.TemporaryFile(prefix="patchlight-")
        # Pages are mapped whole.
        offset = -(-self._end // 65536) * 65536
        self._file.truncate(offset + array.nbytes)
        kept = np.memmap(self._file, array.dtype, "r+", offset, array.shape)
        kept[...] = array
        kept.flush()
        self._end = offset + array.nbytes
        return kept.view(np.ndarray)

    def products(self, light: FloatArray) -> FloatArray:
        """Product (m, ...) with ``light`` (n, ...); one pass over the blocks for 64 columns."""
        flat = light.reshape(self._n, math.prod(light.shape[1:]))
        out = np.empty((len(self), flat.shape[1]))
        for some in _some(flat.shape[1]):
            rows = writable(flat[:, some])
            columns = writable(rows.T)
            for first, block in zip(self._first, self._blocks, strict=False):
                part = np.empty((len(block.scales), rows.shape[1]))
                block.multiply(rows, columns, part)
                out[first : first + len(part), some] = part
        return out.reshape(len(self), *light.shape[1:])

    def transposed_products(self, values: FloatArray) -> FloatArray:
        """Product (n, ...) of the transposed matrix with ``values`` (m, ...)."""
        flat = values.reshape(len(self), math.prod(values.shape[1:]))
        out = np.zeros((self._n, flat.shape[1]))
        for some in _some(flat.shape[1]):
            part = np.zeros((self._n, some.stop - some.start))
            for first, block in zip(self._first, self._blocks, strict=False):
                block.add(writable(flat[first : first + len(block.scales), some]), part)
            out[:, some] = part
        return out.reshape(self._n, *values.shape[1:])

    def take(self, rows: IntArray) -> MatrixArray:
        """Some rows (k, n) of single precision."""
        out = np.empty((len(rows), self._n), dtype=np.float32)
        block = np.searchsorted(self._first, rows, side="right") - 1
        for b in np.unique(block):
            own = np.flatnonzero(block == b)
            out[own] = self._blocks[b].unpack(rows[own] - self._first[b], self._n)
        return out

    def __getitem__(self, key: tuple[Any, Any]) -> MatrixArray:
        """Entries of all or some rows (an array) and some columns (an array)."""
        rows, columns = (np.arange(n)[k].ravel() for n, k in zip(self.shape, key, strict=True))
        out = np.empty((len(rows), len(columns)), dtype=np.float32)
        step = max(1, 4_000_000 // max(self._n, 1))
        for start in range(0, len(rows), step):
            some = rows[start : start + step]
            out[start : start + step] = self.take(some)[:, columns]
        return out


def _some(count: int) -> Iterator[slice]:
    for start in range(0, count, _COLUMNS):
        yield slice(start, min(start + _COLUMNS, count))


@dataclass(frozen=True, slots=True, eq=False)
class GroupedVariances:
    """Variances (m, n) of which sums over groups of like elements are kept, and a few columns.

    Parameters
    ----------
    group : (n,) int array
        Group of every element.
    groups : int
        How many there are.
    kept : (w,) int array
        Sorted columns that are kept as they are.
    """

    group: IntArray
    groups: int
    kept: IntArray
    _sums: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    _columns: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    _totals: dict[int, FloatArray] = field(default_factory=dict)

    def put(self, first: int, variances: NDArray[np.float32]) -> None:
        """Take rows in that begin with the ``first``-th, or once more in place of the old."""
        sums = np.empty((len(variances), self.groups))
        kernels.sum_groups(variances, self.group, sums)
        self._sums[first] = sums.astype(np.float32)
        self._columns[first] = variances[:, self.kept].copy()
        self._totals[first] = variances.sum(axis=0, dtype=np.float64)

    def of(self, light: FloatArray) -> FloatArray:
        """Variance (m,) of what is gathered of ``light`` (n,).

        Groups are taken for as bright as they are on average, each element with the sum of its
        variances: over all receivers together nothing is lost.
        """
        weights = np.asarray(sum(self._totals.values()))
        total = np.bincount(self.group, weights, self.groups)
        bright = np.bincount(self.group, weights * light**2, self.groups)
        mean = bright / np.where(total > 0.0, total, 1.0)
        return np.concatenate([self._sums[first] @ mean for first in sorted(self._sums)])

    def __getitem__(self, key: tuple[Any, Any]) -> NDArray[np.float32]:
        """Entries of all or some rows (an array) and some of the ``kept`` columns (an array)."""
        columns = np.concatenate([self._columns[first] for first in sorted(self._columns)])
        rows = np.arange(len(columns))[key[0]].ravel()
        return columns[np.ix_(rows, np.searchsorted(self.kept, np.ravel(key[1])))]
