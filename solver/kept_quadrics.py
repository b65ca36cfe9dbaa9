"""Quadrics that patches lie on: of patches that stand where they stood they are known."""

from __future__ import annotations

import numpy as np

from .kernels.nets import PLANAR
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray
from .moved import moved_patches
from .quadrics import fit_quadrics
from .reuse import Kept


def kept_quadrics(kept: Kept, blockers: Blockers) -> FloatArray:
    """Quadrics (p, 5, 4) of all patches, as `fit_quadrics` fits them; of flat ones none."""
    nets = blockers.nets
    before: tuple[FloatArray, FloatArray] | None = kept.of_parts("quadrics", ())
    if before is None:
        out, new = np.zeros((len(nets), 5, 4)), np.ones(len(nets), dtype=bool)
    else:
        new = moved_patches(before[0], nets)
        if not new.any():
            return before[1]
        out = before[1].copy()
    curved = blockers.flags & PLANAR == 0
    out[new & ~curved] = 0.0
    rows = np.flatnonzero(new & curved)
    out[rows] = fit_quadrics(nets[rows])
    kept.keep_of_parts("quadrics", (), (nets, out))
    return out
