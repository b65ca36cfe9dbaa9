"""The (u, v) domain of a face: regions of boundary loops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray

from .arcs import Arc
from .triangulate import inside, signed_area

Loop = list[Arc]


@dataclass(slots=True)
class Domain:
    """Regions of a face (outer loop first in each) with the maker of their chords."""

    regions: list[list[Loop]]
    chord: Callable[[FloatArray, FloatArray], Arc]
    scale: FloatArray
    size: float
    exact: bool
    gap: float

    @property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (2,) in (u, v)."""
        every = np.concatenate([a.outline for r in self.regions for loop in r for a in loop])
        return every.min(axis=0) / self.scale, every.max(axis=0) / self.scale


def outline(loop: Loop) -> FloatArray:
    """Closed polygon (n, 2) of a loop in scaled coordinates."""
    return np.concatenate([a.outline[:-1] for a in loop])


def regions_of(loops: list[Loop]) -> list[list[Loop]]:
    """Loops grouped: each counter-clockwise loop with the clockwise ones inside it."""
    if not loops:
        raise GeometryError("the face has no boundary of any length")
    borders = [outline(loop) for loop in loops]
    areas = np.array([signed_area(border) for border in borders])
    biggest = int(np.argmax(np.abs(areas)))
    extent = float(np.ptp(borders[biggest], axis=0).max())
    if areas[biggest] == 0.0 or abs(areas[biggest]) < 1e-14 * extent**2:
        raise GeometryError("the boundary encloses no area")
    if areas[biggest] < 0.0:
        loops = [[a.reversed() for a in loop[::-1]] for loop in loops]
        areas = -areas
    keep = np.abs(areas) > 1e-12 * areas[biggest]
    outer = [k for k in np.argsort(-areas) if areas[k] > 0.0 and keep[k]]
    if len(outer) > 1:
        # A second loop of the same sense inside the outer one is a hole drawn the wrong way round.
        border = outline(loops[biggest])
        for k in list(outer[1:]):
            if inside(border, outline(loops[k])[:1])[0]:
                loops[k] = [a.reversed() for a in loops[k][::-1]]
                areas[k] = -areas[k]
                outer.remove(k)
    regions = {int(k): [loops[k]] for k in outer}
    for k in range(len(loops)):
        if areas[k] >= 0.0 or not keep[k]:
            continue
        point = outline(loops[k])[:1]
        home = biggest
        if len(outer) > 1:
            home = next(
                (int(m) for m in outer[::-1] if inside(outline(loops[m]), point)[0]), biggest
            )
        regions[home].append(loops[k])
    return list(regions.values())
