"""Boxes cut where direct light changes.

An element sends light on as if it varied bilinearly between its nodes. What of the reflected light
is then in the wrong place, ρ ∫ |E − E'| dA, matters as far as it is moved against the distance to
what it falls on: by h/d of it where d is large, and wholly in a gap that is narrower than the
element. What the few nodes of the element make of its mean is wrong besides.
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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .mesh import Boxes
from .model.arrays import FloatArray, IntArray
from .model.bezier import gauss_rule, surface_points
from .model.patches import PatchSet
from .unknowns import lagrange

if TYPE_CHECKING:
    from .kept_light import KeptLight

#: Gauss points a direction at which the light in a box is looked at: what lies within a fourteenth
#: of it from its sides is not seen.
LOOK = gauss_rule(4)
#: The nodes of an element, and light at the points by that at the nodes.
NODES = gauss_rule(2)
_ALONG = lagrange(NODES[0], 1, LOOK[0])
BETWEEN = np.einsum("ga,hb->ghab", _ALONG, _ALONG).reshape(len(LOOK[0]) ** 2, -1)
#: One of the points that boxes are looked at, well inside of them.
_INSIDE = 5
#: Equal parts a direction between which a box is cut.
CUT = 8
#: Weight of light that the nodes add or lose against light in the wrong place: it is wrong for all
#: that is lit from there, and at a reflectance of a half what comes of it is twice as much.
LOST = 2.0
#: Share of all light that is placed better than what is taken for badly placed.
OTHERS = 0.95
#: Rounds of cutting: two find an edge to a 64th of a box.
ROUNDS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """Light of the lamps in n boxes, at the points of `LOOK` and at those of `NODES`.

    Attributes
    ----------
    light, told : (n, 16) and (n, 4) array
        Illuminance at both. [lx]
    nearness : (n, 16) array
        Of the lamps, see `DirectLight.at`. [1/m]
    areas, shares : (n, 16) and (n, 4) array
        Area about each point. [m²]
    lengths : (n, 2) array
        Lengths of the boxes. [m]
    stays : (n,) array
        Share of what they reflect that meets anything.
    """

    light: FloatArray
    told: FloatArray
    nearness: FloatArray
    areas: FloatArray
    shares: FloatArray
    lengths: FloatArray
    stays: FloatArray

    def _parts(self) -> tuple[FloatArray, ...]:
        return (
            self.light, self.told, self.nearness, self.areas, self.shares, self.lengths, self.stays,
        )  # fmt: skip

    def take(self, rows: IntArray) -> Looked:
        """That in some of the boxes."""
        return Looked(*(part[rows] for part in self._parts()))

    def joined(self, others: Looked) -> Looked:
        """That in these boxes and then in others."""
        pairs = zip(self._parts(), others._parts(), strict=True)
        return Looked(*(np.concatenate(pair) for pair in pairs))


class Refiner:
    """Cuts the boxes of one scene.

    Parameters
    ----------
    patches : PatchSet
        The surfaces.
    reflectance : (p, 2) array
        Diffuse reflectance of both sides.
    light : KeptLight
        What falls on them.
    distance : float
        Distance to what their light falls on, where no lamp is nearer. [m]
    """

    def __init__(
        self, patches: PatchSet, reflectance: FloatArray, light: KeptLight, distance: float
    ) -> None:
        self.patches, self.reflectance = patches, reflectance
        self.light, self.distance = light, distance
        #: Light in the boxes that were made last.
        self.looked: Looked | None = None

    def refine(self, boxes: Boxes, allowed: float, most: int) -> tuple[Boxes, float]:
        """Cut ``boxes`` until the share ``allowed`` of the reflected light is misplaced.

        No more than ``most`` boxes are made. Returns them and the share that is left, which is
        about the relative error of light that has been reflected.
        """
        looked = self._look(boxes)
        wrong, flux = self._judge(boxes, looked)
        total = float(flux.sum())
        for _ in range(ROUNDS):
            order = np.argsort(-wrong, kind="stable")
            # The fewest boxes without which the rest is good enough.
            rest = np.cumsum(wrong[order][::-1])[::-1]
            count = int(np.searchsorted(-rest, -allowed * total))
            count = min(count, most - len(boxes))
            if count <= 0:
                break
            chosen = np.sort(order[:count])
            halves = self._cut(boxes.take(chosen))
            kept = np.setdiff1d(np.arange(len(boxes)), chosen)
            more = self._look(halves)
            wrong = np.append(wrong[kept], self._judge(halves, more)[0])
            boxes, order = boxes.take(kept).joined(halves)
            wrong, looked = wrong[order], looked.take(kept).joined(more).take(order)
        self.looked = looked
        return boxes, float(wrong.sum()) / total if total > 0.0 else 0.0

    def again(self, boxes: Boxes, looked: Looked) -> float:
        """Share of the reflected light misplaced on ``boxes`` that were looked at before."""
        wrong, flux = self._judge(boxes, looked)
        self.looked, total = looked, float(flux.sum())
        return float(wrong.sum()) / total if total > 0.0 else 0.0

    def at_most(self, boxes: Boxes, looked: Looked, touched: NDArray[np.bool_]) -> float:
        """Share of the reflected light misplaced on ``boxes`` that were ``looked`` at before.

        What falls on those that are ``touched`` (n,) is not known any more: it is taken for worse
        placed than the share `OTHERS` of all light is.
        """
        wrong, flux = self._judge(boxes, looked)
        total, share = float(flux.sum()), wrong / np.maximum(flux, 1e-300)
        if total <= 0.0:
            return 0.0
        order = np.argsort(share, kind="stable")
        worst = share[order][np.searchsorted(np.cumsum(flux[order]), OTHERS * total)]
        self.looked = looked
        return float(wrong[~touched].sum() + worst * flux[touched].sum()) / total

    def renewed(self, boxes: Boxes, looked: Looked, touched: NDArray[np.bool_]) -> Looked:
        """What was ``looked`` at on ``boxes``, once more at the ``touched`` (n, 20) of `places`."""
        whole = np.asarray(touched.all(axis=1))
        rows, left = np.flatnonzero(whole), np.flatnonzero(~whole)
        if len(rows):
            order = np.argsort(np.concatenate([left, rows]))
            looked = looked.take(left).joined(self._look(boxes.take(rows))).take(order)
        row, point = np.nonzero(touched & ~whole[:, None])
        if not len(row):
            return looked
        points, normals = (a[row, point] for a in self.places(boxes))
        found, near = self.light.at(points, normals, boxes.patch[row])
        k = looked.light.shape[1]
        light = np.concatenate([looked.light, looked.told], axis=1)
        nearness = looked.nearness.copy()
        light[row, point] = found
        inside = point < k
        nearness[row[inside], point[inside]] = near[inside]
        return replace(looked, light=light[:, :k], told=light[:, k:], nearness=nearness)

    def relit(self, boxes: Boxes, looked: Looked, before: FloatArray) -> Looked:
        """What was ``looked`` at on ``boxes`` when lamps had exitances ``before`` (k,). [lm/m²]"""
        points, normals = self.places(boxes)
        n, k = points.shape[:2]
        patch = np.repeat(boxes.patch, k)
        flat = points.reshape(-1, 3), normals.reshape(-1, 3)
        usual, more = self.light.change(*flat, patch, before)
        light = usual * np.concatenate([looked.light, looked.told], axis=1) + more.reshape(n, k)
        inside = looked.light.shape[1]
        # What is found without most lamps may be off by rounding where all light is theirs.
        light = np.maximum(light, 0.0)
        return replace(looked, light=light[:, :inside], told=light[:, inside:])

    def places(self, boxes: Boxes) -> tuple[FloatArray, FloatArray]:
        """Points (n, k, 3) at which boxes are looked at, and their normals."""
        found = [points_in(self.patches, boxes, *rule)[:2] for rule in (LOOK, NODES)]
        points, normals = (
            np.concatenate([a.reshape(len(boxes), -1, 3) for a in both], axis=1)
            for both in zip(*found, strict=True)
        )
        return points, normals

    def _look(self, boxes: Boxes) -> Looked:
        """Light of the lamps in boxes."""
        found = [points_in(self.patches, boxes, *rule) for rule in (LOOK, NODES)]
        points, normals, areas = (
            np.concatenate(both, axis=1) for both in list(zip(*found, strict=True))[:3]
        )
        light, nearness = self._at(boxes, points, normals)
        k = found[0][2].shape[1]
        stays = self.light.stays(points[:, _INSIDE], normals[:, _INSIDE])
        return Looked(
            light[:, :k], light[:, k:], nearness[:, :k], areas[:, :k], areas[:, k:], found[0][3],
            stays,
        )  # fmt: skip

    def _judge(self, boxes: Boxes, looked: Looked) -> tuple[FloatArray, FloatArray]:
        """Reflected direct light (n,) that boxes have wrong, by how far, and all of it. [lm]

        What leaves the scene does not count, as from sunny walls outdoors.
        """
        light, told, nearness = looked.light, looked.told, looked.nearness
        areas, shares, lengths = looked.areas, looked.shares, looked.lengths
        total = areas.sum(axis=1)
        mean = np.einsum("nk,nk->n", light, areas) / total
        lost = np.abs(np.einsum("nk,nk->n", told, shares) / shares.sum(axis=1) - mean) * total
        off = np.einsum("nk,nk->n", np.abs(light - told @ BETWEEN.T), areas)
        near = 1.0 / self.distance + np.einsum("nk,nk->n", nearness, areas) / total
        moved = off * np.minimum(1.0, lengths.max(axis=1) * near)
        rho = self.reflectance[boxes.patch, boxes.side] * looked.stays
        return rho * (moved + LOST * lost), rho * mean * total

    def _cut(self, boxes: Boxes) -> Boxes:
        """Both parts of every box, one after the other."""
        points, normals, areas, _ = points_in(self.patches, boxes, *equal_parts(CUT))
        light = self._at(boxes, points, normals)[0]
        axis, place = best_cut(light.reshape(-1, CUT, CUT), areas.reshape(-1, CUT, CUT))
        return boxes.cut(axis, place / CUT)

    def _at(
        self, boxes: Boxes, points: FloatArray, normals: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Illuminance and nearness (n, k) at k points (n, k, 3) of each box."""
        k = points.shape[1]
        patch = np.repeat(boxes.patch, k)
        found = self.light.at(points.reshape(-1, 3), normals.reshape(-1, 3), patch)
        light, nearness = (values.reshape(-1, k) for values in found)
        return light, nearness


def best_cut(light: FloatArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Where to cut boxes in two so that the variance left in both parts is least.

    Parameters
    ----------
    light, areas : (n, k, k) array
        Illuminance [lx] of, and area [m²] about, the middles of k x k equal parts.

    Returns
    -------
    axis, place : (n,) int arrays
        0 for a cut across u, 1 across v, and how many parts lie before it, 1 … k − 1. Light that
        is even all over is halved.
    """
    k = light.shape[1]
    gains = []
    for across in (2, 1):
        flux, area = (a.sum(axis=across).cumsum(axis=1) for a in (light * areas, areas))
        after = flux[:, -1:] - flux[:, :-1], area[:, -1:] - area[:, :-1]
        before = flux[:, :-1], area[:, :-1]
        # Parts at a side collapsed to a point may have no area, and then no light.
        gains.append(sum(f**2 / np.maximum(a, 1e-300) for f, a in (before, after)))
    gain = np.stack(gains, axis=1)
    # Rounding must not choose between cuts that are as good: the middlemost is taken, across u.
    gain *= 1.0 - 1e-9 * np.abs(np.arange(1, k) / k - 0.5)
    gain[:, 1] *= 1.0 - 1e-10
    axis, place = np.divmod(np.argmax(gain.reshape(len(gain), -1), axis=1), k - 1)
    return axis, place + 1


def equal_parts(k: int) -> tuple[FloatArray, FloatArray]:
    """Middles and weights (k,) of equal parts."""
    return (np.arange(k) + 0.5) / k, np.full(k, 1.0 / k)


def points_in(
    patches: PatchSet, boxes: Boxes, t: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Points (n, k², 3) of a rule (k,) in boxes, normals, areas, and lengths (n, 2)."""
    s = [g.ravel() for g in np.meshgrid(t, t, indexing="ij")]
    share = np.outer(weight, weight).ravel()
    low, step = boxes.ends[:, ::2], boxes.ends[:, 1::2] - boxes.ends[:, ::2]
    u, v = (low[:, axis, None] + step[:, axis, None] * s[axis] for axis in (0, 1))
    points, su, sv = surface_points(patches.control_points[boxes.patch], u, v)
    normals = np.cross(su, sv)
    size = np.linalg.norm(normals, axis=2)
    normals /= np.maximum(size, 1e-300)[:, :, None]
    normals[boxes.side == 1] *= -1.0
    run = np.stack([np.linalg.norm(d, axis=2).mean(axis=1) for d in (su, sv)], axis=1)
    return points, normals, size * share * step.prod(axis=1)[:, None], run * step
