"""What a mesh too large to be compared with a coarser one has in the wrong place: a sample of it.

Elements are drawn in proportion to the light that they reflect, and the light on them is found at
more places than the mesh knew. What of it would be sent on from the wrong place, or is lost or
made, is about the relative error of all that has been reflected, as in `refinement`.
"""

from __future__ import annotations

import numpy as np

from .budget import Budget
from .field import Field, FieldSolver
from .model.arrays import FloatArray, IntArray
from .model.result import luminous
from .refinement import LOST
from .surfaces import Receivers
from .unknowns import Unknowns

#: Elements that are drawn, and places a direction on each.
DRAWN, LOOK = 256, 3


def drawn_by_flux(flux: FloatArray, count: int) -> tuple[IntArray, FloatArray]:
    """Rows (k,) drawn at even steps of the running sum of ``flux`` (n,), and times each was."""
    total = float(flux.sum())
    if total <= 0.0:
        return np.empty(0, dtype=np.int64), np.empty(0)
    steps = (np.arange(count) + 0.5) / count * total
    place = np.searchsorted(np.cumsum(flux), steps, side="right")
    rows, times = np.unique(np.minimum(place, len(flux) - 1), return_counts=True)
    return rows, times.astype(np.float64)


def sampled_misplaced(solver: FieldSolver, budget: Budget, field: Field) -> float:
    """Share of the reflected light that the elements of ``field`` have in the wrong place."""
    surfaces = field.surfaces
    elements = surfaces.elements
    known = field.unknowns.mean(field.arriving.luminous())
    whole = ~elements.buried.any(axis=1)
    flux = np.where(whole, luminous(surfaces.reflectance) * known * surfaces.areas, 0.0)
    flux[len(field.sources.nets) :] = 0.0  # panes
    rows, times = drawn_by_flux(flux, DRAWN)
    if not len(rows):
        return 0.0
    dense = Receivers.with_nodes(elements, rows, LOOK)
    k, share, single = LOOK**2, dense.weights, dense.singly
    areas = share.ravel() * elements.areas[single.own]
    places = Unknowns(single.own, areas, single, None, len(elements))
    light = solver.light_at(places, budget, field)[0].luminous().reshape(-1, k)
    mean = np.einsum("nk,nk->n", light, share)
    off = np.einsum("nk,nk->n", np.abs(light - mean[:, None]), share)
    moved = off * np.minimum(1.0, np.sqrt(elements.areas[rows]) / budget.distance)
    wrong = moved + LOST * np.abs(mean - known[rows])
    # Each stands for as much reflected light as every other.
    return float((times * wrong / known[rows]).sum() / times.sum())
