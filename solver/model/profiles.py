"""How the exitance of a lamp varies over its surface: by a function of points, or by tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .arrays import FloatArray, IntArray, frozen

#: Relative exitance (m,) at points (m, 3) in coordinates of the part. [m]
ProfileFunction = Callable[[FloatArray], ArrayLike]
#: Nested tuples of a table (k, l), or of one for each patch (p, k, l).
ProfileTable = tuple[Any, ...]


def checked_profile(value: object) -> ProfileFunction | ProfileTable:
    """What `Emitter.profile` keeps of ``value``: a function, or tables (k, l) or (p, k, l).

    Four numbers are the values at the corners (u, v) = (0, 0), (1, 0), (1, 1), (0, 1).

    Raises
    ------
    InputError
        For other shapes, and for values that are negative, not finite, or all 0.
    """
    if callable(value):
        return value
    try:
        table = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        table = np.empty(0)
    if table.shape == (4,):
        table = table[[[0, 3], [1, 2]]]
    if table.ndim not in (2, 3) or min(table.shape[-2:]) < 2 or len(table) == 0:
        raise InputError(
            f"Emitter.profile: shape {table.shape}: expected a function of points, 4 corner "
            "values, a table (k, l) over (u, v) with k, l >= 2, or a table for each patch"
        )
    _check_values("Emitter.profile", table)
    for k, one in enumerate(table if table.ndim == 3 else table[None]):
        if table.ndim == 2 and not one.any():
            raise InputError(f"Emitter.profile: all values of table {k} are 0")
    return _tuples(table)


def _tuples(table: FloatArray) -> ProfileTable:
    if table.ndim == 1:
        return tuple(float(x) for x in table)
    return tuple(_tuples(row) for row in table)


def _check_values(name: str, values: FloatArray, points: FloatArray | None = None) -> None:
    bad = ~(np.isfinite(values) & (values >= 0.0))
    if bad.any():
        where = tuple(int(k) for k in np.argwhere(bad)[0])
        place = str(list(where))
        if points is not None:
            place = " at ({:.6g}, {:.6g}, {:.6g}) m".format(*points[where[0]])
        raise InputError(f"{name}{place} = {values[where]}: must be a finite number >= 0")


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Exitance over the emitting patches of one lamp, up to a factor.

    Attributes
    ----------
    part : str
        Path of the lamp, for messages.
    function : callable, optional
        Of points (m, 3) in coordinates of the part [m].
    to_part : (4, 4) array
        From coordinates of the scene to those of the part.
    patches : (p,) int array
        Patches of the scene that ``tables`` are for, in order.
    tables : (p, k, l) array
        Values at equal steps of u and v, from 0 to 1 each; bilinear between them.
    """

    part: str
    function: ProfileFunction | None
    to_part: FloatArray
    patches: IntArray
    tables: FloatArray

    @classmethod
    def of(
        cls,
        given: ProfileFunction | ProfileTable,
        *,
        part: str,
        placement: FloatArray,
        patches: IntArray,
    ) -> Profile:
        """The profile of a lamp whose part has a ``placement`` (4, 4) and emits by ``patches``.

        Raises
        ------
        InputError
            If there are tables for another number of patches.
        """
        to_part = frozen(np.linalg.inv(placement))
        if callable(given):
            return cls(part, given, to_part, patches, np.zeros((0, 2, 2)))
        tables = np.asarray(given)
        if tables.ndim == 2:
            tables = np.broadcast_to(tables, (len(patches), *tables.shape))
        if len(tables) != len(patches):
            raise InputError(
                f"emitter of {part}: profile has {len(tables)} tables, but the part emits by "
                f"{len(patches)} patches"
            )
        return cls(part, None, to_part, frozen(np.sort(patches), np.int64), frozen(tables))

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of the tables along u and v; one of a function."""
        return (1, 1) if self.function else (self.tables.shape[1] - 1, self.tables.shape[2] - 1)

    @property
    def kind(self) -> str:
        """A few words for reports."""
        if self.function is not None:
            name = getattr(self.function, "__name__", "")
            return "by a function" + (f" {name}" if name.isidentifier() else "")
        k, m = self.tables.shape[1:]
        return "by corner values" if (k, m) == (2, 2) else f"by a table of {k} x {m}"

    def at(self, points: FloatArray, patch: IntArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Values (m,) at points (m, 3) of the scene, on patches (m,) at parameters u, v (m,).

        Raises
        ------
        InputError
            If the function returns another number of values, or one that is negative or not
            finite.
        """
        if self.function is None:
            return self._in_tables(patch, u, v)
        own = points @ self.to_part[:3, :3].T + self.to_part[:3, 3]
        name = f"emitter of {self.part}: profile"
        try:
            values = np.array(self.function(own), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{name}: {error}") from error
        if values.ndim == 0:
            values = np.full(len(own), float(values))
        if values.shape != (len(own),):
            raise InputError(
                f"{name}: {len(own)} points gave values of shape {values.shape}, not ({len(own)},)"
            )
        _check_values(name, values, own)
        return values

    def _in_tables(self, patch: IntArray, u: FloatArray, v: FloatArray) -> FloatArray:
        table = self.tables[np.searchsorted(self.patches, patch)]
        rows, out = np.arange(len(table)), np.zeros(len(table))
        places = []
        for t, cells in zip((u, v), self.cells, strict=True):
            cell = np.clip((t * cells).astype(np.int64), 0, cells - 1)
            places.append((cell, t * cells - cell))
        (i, s), (j, r) = places
        for a, share_u in ((i, 1.0 - s), (i + 1, s)):
            for b, share_v in ((j, 1.0 - r), (j + 1, r)):
                out += share_u * share_v * table[rows, a, b]
        return out
