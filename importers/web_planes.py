"""From the half-planes that a photometric file stores to all around the lamp."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

#: Angles closer than this are one. [deg]
SAME_DEG = 1e-6
#: Negative readings down to this share of the largest are noise about zero.
NOISE = 1e-2
#: Intensity, against the largest, at which a web may end elsewhere than at 0, 90 or 180 degrees.
DARK = 1e-2


def reflected_c0(c: FloatArray) -> FloatArray:
    """C in the mirror of the plane C0–C180. [deg]"""
    return np.asarray(np.mod(360.0 - c, 360.0))


def reflected_c90(c: FloatArray) -> FloatArray:
    """C in the mirror of the plane C90–C270. [deg]"""
    return np.asarray(np.mod(180.0 - c, 360.0))


Mirror = Callable[[FloatArray], FloatArray]


def all_around(
    c_deg: FloatArray, table: FloatArray, mirrors: tuple[Mirror, ...]
) -> tuple[FloatArray, FloatArray]:
    """Half-planes from 0 to 360, the last repeating the first, and their intensities.

    Parameters
    ----------
    c_deg : (k,) array
        Stored half-planes; a single one stands for all. [deg]
    table : (k, g) array
        Their intensities.
    mirrors : tuple
        Planes of symmetry.
    """
    if len(c_deg) == 1:
        return np.array([0.0, 360.0]), np.repeat(table, 2, axis=0)
    c, values = np.mod(c_deg, 360.0), table
    for mirror in mirrors:
        c, values = np.concatenate([c, mirror(c)]), np.concatenate([values, values])
    c = np.where(c > 360.0 - SAME_DEG, 0.0, c)
    order = np.argsort(c, kind="stable")
    c, values = c[order], values[order]
    kept = np.concatenate([[True], np.diff(c) > SAME_DEG])
    c, values = c[kept], values[kept]
    if c[0] > SAME_DEG:
        # Between the last and the first half-plane, over 360 degrees.
        share = (360.0 - c[-1]) / (360.0 - c[-1] + c[0])
        first = (1.0 - share) * values[-1] + share * values[0]
        c, values = np.concatenate([[0.0], c]), np.concatenate([first[None], values])
    c[0] = 0.0
    return np.append(c, 360.0), np.concatenate([values, values[:1]])


def check_ascending(angles: list[float], where: str, what: str, high: float) -> FloatArray:
    """The angles as an array; `InputError` unless they ascend within 0 … ``high``. [deg]"""
    array = np.asarray(angles, dtype=np.float64)
    bad = np.flatnonzero((array < 0.0) | (array > high))
    if bad.size:
        k = int(bad[0])
        raise InputError(f"{where}: {what} {k + 1} = {array[k]:g}: must lie in 0 … {high:g}")
    bad = np.flatnonzero(np.diff(array) <= SAME_DEG)
    if bad.size:
        k = int(bad[0]) + 1
        raise InputError(
            f"{where}: {what} {k + 1} = {array[k]:g} follows {array[k - 1]:g}: they must ascend"
        )
    return array


def checked_table(table: FloatArray, gamma: FloatArray, where: str) -> tuple[FloatArray, list[str]]:
    """Intensities (k, g) without noise below zero, and what to tell of it.

    Raises
    ------
    InputError
        If they are negative beyond noise, all zero, or end in the light.
    """
    top, low = float(table.max()), float(table.min())
    if not top > 0.0:
        raise InputError(f"{where}: no intensity is above zero: the lamp gives no light")
    if low < -NOISE * top:
        k, g = (int(i) for i in np.argwhere(table == low)[0])
        raise InputError(
            f"{where}: intensity {g + 1} of half-plane {k + 1} = {low:g}: must not be negative"
        )
    for end, at in ((0, "begin"), (-1, "end")):
        if min(abs(gamma[end] - ok) for ok in (0.0, 90.0, 180.0)) > SAME_DEG:
            left = float(table[:, end].max())
            if left > DARK * top:
                raise InputError(
                    f"{where}: the vertical angles {at} at {gamma[end]:g} degrees, where there "
                    f"still are {left:g} of at most {top:g}; they must {at} at 0, 90 or 180"
                )
    if low < 0.0:
        count = int((table < 0.0).sum())
        return np.maximum(table, 0.0), [
            f"{count} intensities below zero, down to {low:g}, were taken as 0"
        ]
    return table, []
