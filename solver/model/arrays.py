"""Normalised arrays: one dtype, C-contiguous, read-only, so that each kernel compiles once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

FloatArray = NDArray[np.float64]
#: Of single or double precision.
MatrixArray = NDArray[Any]
IntArray = NDArray[np.int64]


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """Return ``values`` as a read-only C-contiguous array of ``dtype`` (copied if writable)."""
    array = np.asarray(values, dtype=dtype)
    if array.flags.writeable or not array.flags.c_contiguous:
        array = np.array(array, dtype=dtype, order="C")
        array.flags.writeable = False
    return array


def check_shape(name: str, array: NDArray[Any], shape: tuple[int | None, ...]) -> None:
    """Raise `InputError` unless ``array`` has ``shape`` (None matches any length)."""
    ok = array.ndim == len(shape) and all(
        wanted is None or wanted == found for wanted, found in zip(shape, array.shape, strict=False)
    )
    if not ok:
        text = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name}: expected shape {text}, got {array.shape}")


def check_finite(name: str, array: NDArray[Any]) -> None:
    """Raise `InputError` naming the first entry of ``array`` that is not finite."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = list(where) if where else ""
        raise InputError(f"{name}{place} = {array[where]}: must be finite")


def unit_vector(name: str, vector: ArrayLike) -> FloatArray:
    """Return ``vector`` (3,) scaled to length 1; `InputError` when it has no direction."""
    array = np.asarray(vector, dtype=np.float64)
    check_shape(name, array, (3,))
    check_finite(name, array)
    length = float(np.linalg.norm(array))
    if length == 0.0:
        raise InputError(f"{name} = (0, 0, 0): a direction must not be zero")
    return np.asarray(array / length)


def unique_rows(rows: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distinct rows of an array (n, k), sorted, and the place (n,) of each among them.

    As `numpy.unique` with ``axis=0``, several times as fast.
    """
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    begins = np.ones(len(rows), dtype=bool)
    (ordered[1:] != ordered[:-1]).any(axis=1, out=begins[1:])
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = np.cumsum(begins) - 1
    return ordered[begins], place
