"""Uneven lamps seen in flat mirrors: parts of them, from the image of the receiver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .budget import Budget
from .emission import Emission
from .exchange import make_sources
from .hidden_parts import partly_hidden
from .images import Window
from .mirrors import Through
from .model.arrays import FloatArray
from .model.scene import SceneData
from .uneven import FINE


def light_through(
    scene: SceneData,
    emission: Emission,
    window: Window,
    seen: Through,
    plain: FloatArray,
    budget: Budget,
) -> tuple[FloatArray, FloatArray]:
    """Light (k, b) of uneven lamps that are ``seen`` through a window [lx], and its variance (k,).

    Parameters
    ----------
    emission : Emission
        Of the lamps.
    plain : (k, l) array
        Form factors of the parts with nothing in the way. What hides one, or the outline of the
        mirror, hides of it what it does: half of the most that this may change is taken for a
        standard deviation.
    """
    parts, before = seen.parts, window.pieces
    # Profiles are told on the patches of the scene, of which the window has parts.
    low, high = before.boxes[parts.patch_index, ::2], before.boxes[parts.patch_index, 1::2]
    boxes = np.empty_like(parts.boxes)
    for end in (0, 1):
        boxes[:, end::2] = low + (high - low) * parts.boxes[:, end::2]
    own = replace(parts, patch_index=before.patch[parts.patch_index], boxes=boxes)
    row = np.searchsorted(emission.element, seen.owner)
    there = emission.of_pieces(scene, own, emission.lamp[row])
    factors = np.asarray(seen.factors, dtype=np.float64)
    sources = make_sources(parts, window.near.nets, np.ones(len(parts)))
    level = there.mean + there.light(factors, seen.images, sources, FINE * budget.moments)
    wrong = partly_hidden(factors, plain) * there.span
    variance = (seen.variances * level**2).sum(axis=1) + 0.25 * (wrong**2).sum(axis=1)
    return (factors * level) @ emission.color[row], variance
