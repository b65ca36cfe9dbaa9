"""Uneven lamps in parts that are nearly even, for lobes: these take each part at its mean."""

from __future__ import annotations

import numpy as np

from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.scene import SceneData
from .surfaces import Surfaces

#: Change of exitance over a part, against the largest of the lamp, and parts of an element a
#: direction at most. Lobes wider than a part see less than the square of that.
EVEN, MOST = 0.1, 8


def shining_pieces(scene: SceneData, surfaces: Surfaces) -> tuple[IntArray, FloatArray, FloatArray]:
    """Lamps in parts: their elements (k,), levels (k,) against the element's mean, and nets.

    Elements of even lamps are one part each, of level 1.
    """
    elements, emission = surfaces.elements, surfaces.emission
    lamps = np.flatnonzero(surfaces.emitted.any(axis=1))
    if emission is None:
        return lamps, np.ones(len(lamps)), elements.nets[lamps]
    even = lamps[~np.isin(lamps, emission.element)]
    brightest = np.zeros(len(scene.luminaires))
    np.maximum.at(brightest, emission.lamp, emission.mean)
    parts = np.ceil(emission.span / (EVEN * np.maximum(brightest[emission.lamp], 1e-300)))
    sides = np.clip(parts, 1, MOST).astype(np.int64)
    row = np.repeat(np.arange(len(sides)), sides**2)
    place = np.arange(len(row)) - np.repeat(np.cumsum(sides**2) - sides**2, sides**2)
    i, j = np.divmod(place, sides[row])
    owner = emission.element[row]
    u0, u1, v0, v1 = elements.boxes[owner].T
    du, dv = (u1 - u0) / sides[row], (v1 - v0) / sides[row]
    ends = np.stack([u0 + i * du, u0 + (i + 1) * du, v0 + j * dv, v0 + (j + 1) * dv], axis=1)
    boxes = Boxes(elements.patch_index[owner], elements.side[owner], ends)
    pieces = elements_on(scene.patches, boxes, nodes=1)
    found = emission.of_pieces(scene, pieces, emission.lamp[row])
    levels = found.mean / np.maximum(emission.mean[row], 1e-300)
    return (
        np.concatenate([even, owner]),
        np.concatenate([np.ones(len(even)), levels]),
        np.concatenate([elements.nets[even], pieces.nets]),
    )
