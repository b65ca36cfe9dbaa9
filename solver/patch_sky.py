"""Patches of a measured sky by direction, and what they add up to; see `model.patch_sky`."""

from __future__ import annotations

import math

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.patch_sky import ROW_COUNTS, ROW_ENDS_DEG, PatchSky, patch_weights


def patch_numbers(directions: FloatArray) -> IntArray:
    """Patch (...) of unit directions (..., 3); below the horizon those that touch it."""
    altitude = np.degrees(np.arcsin(np.clip(directions[..., 2], 0.0, 1.0)))
    row = np.minimum((altitude / (ROW_ENDS_DEG[1] - ROW_ENDS_DEG[0])).astype(int), 7)
    counts = np.array(ROW_COUNTS)
    below = np.cumsum(counts) - counts
    turn = np.arctan2(directions[..., 0], directions[..., 1]) / (2.0 * math.pi) * counts[row]
    return np.asarray(below[row] + np.floor(turn + 0.5).astype(int) % counts[row])


def patch_illuminance(sky: PatchSky) -> float:
    """Horizontal illuminance of the luminances as they are measured. [lx]"""
    return float(patch_weights() @ np.array(sky.luminance_cd_m2))
