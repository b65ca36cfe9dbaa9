"""Light of lamps that the nodes of the elements missed, or took for more than it is.

A lamp close to a surface lights some of it so unevenly that the nodes there make little of the flux
that arrives. How much flux a lamp sends to the scene is known besides, from the form factors of its
own elements. The difference is given to the elements where light was found to vary otherwise than
between the nodes of whole elements, in proportion to how much: there it may have been lost.
"""

from __future__ import annotations

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.result import luminous

#: Share of the flux that is not looked for: by as much the rows of the lamps may be off.
LEAST = 1e-3
#: Most of that variation that is given: what is missing beyond is not missing there.
MOST = 1.0

#: Light that the nodes of pieces found against what is told, below which it says nothing.
ENOUGH = 0.3


def put_right(
    found: FloatArray,
    told: FloatArray,
    areas: FloatArray,
    pieces: IntArray,
    flux: FloatArray,
    eps: float,
) -> tuple[FloatArray, float]:
    """Direct light of some lamps with the flux that they send.

    Parameters
    ----------
    found : (N, b) array
        Their light on the unknowns. [lx]
    told : (N, b) array
        The same by the nodes of whole elements.
    areas : (N,) array
        What the unknowns stand for. [m²]
    pieces : (c, q) int array
        Unknowns of each of the elements that were looked at more closely.
    flux : (b,) array
        What the lamps send to the scene. [lm]
    eps : float
        Accuracy of form factors: a smaller share of the flux is not missed.

    Returns
    -------
    light : (N, b) array
        ``found``, and a constant on each of these elements. [lx]
    share : float
        Of the flux, that has been added.
    """
    total = float(luminous(flux))
    if total <= 0.0:
        return found, 0.0
    missing = total - float(luminous(found) @ areas)
    missing = np.sign(missing) * max(abs(missing) - max(eps, LEAST) * total, 0.0)
    parts = areas[pieces]
    off = (luminous(found) - luminous(told))[pieces]
    varies = np.sqrt(np.average(off**2, axis=1, weights=parts))
    there = float(varies @ parts.sum(axis=1))
    if missing == 0.0 or there <= 0.0:
        return found, 0.0
    share = float(np.clip(missing / there, -MOST, MOST))
    light = found.copy()
    light[pieces] += share * varies[:, None, None] * (flux / total)
    return light, share * there / total


def as_much(found: FloatArray, told: FloatArray, areas: FloatArray, pieces: IntArray) -> FloatArray:
    """Light ``found`` on unknowns, with as much on each of some elements as is ``told``.

    Where nodes of whole elements do not tell how much there is, those of their pieces hardly do:
    only how it varies over them is taken from these.

    Parameters
    ----------
    found, told, areas, pieces
        As in `put_right`.
    """
    light, parts = found.copy(), areas[pieces][:, :, None]
    size = parts.sum(axis=1, keepdims=True)
    there, right = ((v[pieces] * parts).sum(axis=1, keepdims=True) / size for v in (found, told))
    enough = there > ENOUGH * right
    factor = right / np.where(enough, there, 1.0)
    light[pieces] = np.where(enough, found[pieces] * factor, right)
    return light
