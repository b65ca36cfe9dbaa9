"""Cells cut where direct light changes.

An element sends light on as if it came evenly from all of it. What of the reflected light is then
in the wrong place, ρ ∫ |E − Ē| dA, matters as far as it is moved against the distance to what it
falls on: by h/d of it where d is large, and wholly in a gap that is narrower than the element.
Light that changes gradually is left to the size of the mesh; what stands out is cut, until what is
misplaced in all is the share that the accuracy allows. Each cut is put where it leaves the least
variance on both sides, as in regression trees [1]: so that it finds the edge of a shadow, or of the
gap over a lamp, instead of closing in on it by halves.

References
----------
.. [1] L. Breiman, J. Friedman, R. Olshen and C. Stone, "Classification and Regression Trees",
   Wadsworth, 1984, section 8.4.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .direct_light import DirectLight
from .mesh import Cells
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.patches import PatchSet

#: Points a direction at which a cell's light is looked at, and between which it is cut.
LOOK, CUT = 4, 8
#: Rounds of cutting: an edge is found to a 4096th of a cell by four.
ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Reflected direct light of cells; row i of every array is the same cell.

    Attributes
    ----------
    misplaced : (n,) array
        Flux in the wrong place, weighted by how far. [lm]
    beside_lamps : (n,) array
        The same, as if nothing but lamps were near. [lm]
    flux : (n,) array
        All of it. [lm]
    """

    misplaced: FloatArray
    beside_lamps: FloatArray
    flux: FloatArray

    def __len__(self) -> int:
        return len(self.flux)

    def take(self, rows: IntArray) -> Judged:
        """Some of them."""
        return Judged(self.misplaced[rows], self.beside_lamps[rows], self.flux[rows])

    def joined(self, others: Judged) -> Judged:
        """These, then ``others``."""
        pairs = ((getattr(self, f.name), getattr(others, f.name)) for f in fields(self))
        return Judged(*(np.append(*pair) for pair in pairs))


class Refiner:
    """Cuts cells of one scene.

    Parameters
    ----------
    patches : PatchSet
        The surfaces.
    reflectance : (p, 2) array
        Diffuse reflectance of both sides.
    light : DirectLight
        What falls on them.
    distance : float
        Distance to what their light falls on, where no lamp is nearer. [m]
    """

    def __init__(
        self, patches: PatchSet, reflectance: FloatArray, light: DirectLight, distance: float
    ) -> None:
        self.patches, self.reflectance = patches, reflectance
        self.light, self.distance = light, distance

    def refine(self, cells: Cells, allowed: float, most: int) -> tuple[Cells, float]:
        """Cut ``cells`` until the share ``allowed`` of the reflected light is misplaced.

        No more than ``most`` cells are made. Returns them, and the share of the light that is still
        misplaced beside lamps: of a gap's light, which no mesh of another size shows as a change.
        """
        judged = self._judge(cells)
        total = float(judged.flux.sum())
        for _ in range(ROUNDS):
            misplaced = judged.misplaced
            order = np.argsort(-misplaced, kind="stable")
            # The fewest cells without which the rest is good enough.
            rest = np.cumsum(misplaced[order][::-1])[::-1]
            count = int(np.searchsorted(-rest, -allowed * total))
            count = min(count, most - len(cells))
            if count <= 0:
                break
            chosen = np.sort(order[:count])
            halves = self._cut(cells.take(chosen))
            kept = np.setdiff1d(np.arange(len(cells)), chosen)
            judged = judged.take(kept).joined(self._judge(halves))
            cells, order = cells.take(kept).joined(halves)
            judged = judged.take(order)
        return cells, float(judged.beside_lamps.sum()) / total if total > 0.0 else 0.0

    def _judge(self, cells: Cells) -> Judged:
        points, normals, areas, lengths = _points(self.patches, cells, LOOK)
        light, nearness = self._light(points, normals, cells.patch)
        total = areas.sum(axis=1)
        mean = np.einsum("nk,nk->n", light, areas) / total
        off = np.einsum("nk,nk->n", np.abs(light - mean[:, None]), areas)
        near = np.einsum("nk,nk->n", nearness, areas) / total
        rho, length = self.reflectance[cells.patch, cells.side], lengths.max(axis=1)
        moved = [np.minimum(1.0, length * n) for n in (near + 1.0 / self.distance, near)]
        return Judged(rho * off * moved[0], rho * off * moved[1], rho * mean * total)

    def _cut(self, cells: Cells) -> Cells:
        """Both parts of every cell, one after the other."""
        points, normals, areas, _ = _points(self.patches, cells, CUT)
        light, _ = self._light(points, normals, cells.patch)
        axis, place = best_cut(light.reshape(-1, CUT, CUT), areas.reshape(-1, CUT, CUT))
        rows, boxes = np.arange(len(cells)), np.repeat(cells.boxes[:, None], 2, axis=1)
        low, high = cells.boxes[rows, 2 * axis], cells.boxes[rows, 2 * axis + 1]
        middle = low + (high - low) * (place / CUT)
        boxes[rows, 0, 2 * axis + 1] = boxes[rows, 1, 2 * axis] = middle
        patch, side = np.repeat(cells.patch, 2), np.repeat(cells.side, 2)
        return Cells(patch, side, boxes.reshape(-1, 4))

    def _light(
        self, points: FloatArray, normals: FloatArray, patch: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Illuminance and nearness (n, k) at points (n, k, 3)."""
        n, k = points.shape[:2]
        found = self.light.at(points.reshape(-1, 3), normals.reshape(-1, 3), np.repeat(patch, k))
        light, nearness = (values.reshape(n, k) for values in found)
        return light, nearness


def best_cut(light: FloatArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Where to cut cells in two so that the variance left in both parts is least.

    Parameters
    ----------
    light, areas : (n, k, k) array
        Illuminance [lx] of, and area [m²] about, points in the middles of k x k equal boxes.

    Returns
    -------
    axis, place : (n,) int arrays
        0 for a cut across u, 1 across v, and how many boxes lie before it, 1 … k − 1. Light that
        is even all over is halved.
    """
    k = light.shape[1]
    gains = []
    for across in (2, 1):
        flux, area = (a.sum(axis=across).cumsum(axis=1) for a in (light * areas, areas))
        after = flux[:, -1:] - flux[:, :-1], area[:, -1:] - area[:, :-1]
        before = flux[:, :-1], area[:, :-1]
        # Boxes at a side collapsed to a point may have no area, and then no light.
        gains.append(sum(f**2 / np.maximum(a, 1e-300) for f, a in (before, after)))
    gain = np.stack(gains, axis=1)
    # Rounding must not choose between cuts that are as good: the middlemost is taken.
    gain *= 1.0 - 1e-9 * np.abs(np.arange(1, k) / k - 0.5)
    axis, place = np.divmod(np.argmax(gain.reshape(len(gain), -1), axis=1), k - 1)
    return axis, place + 1


def _points(
    patches: PatchSet, cells: Cells, k: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Middles (n, k², 3) of k x k equal boxes of cells, normals, areas, and lengths (n, 2)."""
    t = (np.arange(k) + 0.5) / k
    s = [g.ravel() for g in np.meshgrid(t, t, indexing="ij")]
    low, step = cells.boxes[:, ::2], np.diff(cells.boxes.reshape(-1, 2, 2), axis=2)[:, :, 0]
    u, v = (low[:, axis, None] + step[:, axis, None] * s[axis] for axis in (0, 1))
    points, su, sv = surface_points(patches.control_points[cells.patch], u, v)
    normals = np.cross(su, sv)
    size = np.linalg.norm(normals, axis=2)
    normals /= np.maximum(size, 1e-300)[:, :, None]
    normals[cells.side == 1] *= -1.0
    run = np.stack([np.linalg.norm(d, axis=2).mean(axis=1) for d in (su, sv)], axis=1)
    return points, normals, size * step.prod(axis=1)[:, None] / k**2, run * step
