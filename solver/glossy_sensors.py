"""Highlights at sensors: what glossy surfaces send them by the lobe instead of evenly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .budget import Budget
from .model.arrays import FloatArray, IntArray
from .model.bezier import bernstein, bernstein_derivative
from .model.result import luminous
from .model.views import Sensors
from .panes import shares_through
from .raycast import RayCaster
from .second_pass import SecondPass
from .unknowns import lagrange

if TYPE_CHECKING:
    from .incident import Gathered
    from .iterated import Finer

#: Form factor of a glossy element that does not matter.
_LEAST = 1e-7
#: Cells for a form factor of 1: for broad lobes, and more for each unit of the exponent, so that a
#: highlight is not between them; most a direction on one element.
_CELLS, _SHARP, _MOST_CELLS = 100.0, 0.5, 12
#: Light of a cell's own deviation, against what the accuracy allows, from which it is cut in four;
#: how often, and how many cells there are at most.
_CUT, _LEVELS, _MOST = 0.5, 6, 200_000
#: Deviation of the mean over a cell's Gauss points against that of the points: measured on floors.
_DEVIATION = 0.1
#: Accuracy of lamps in a lobe against that asked for, and rays a direction for all else.
_LAMPS, _RAYS = 1.0, 2
#: Two Gauss points on [0, 1].
_AT = np.array([0.21132486540518713, 0.7886751345948129])
#: Values a group and a band of points evaluated at a time: 5 MB in each of a few arrays.
_VALUES = 600_000


@dataclass(eq=False)
class Cells:
    """Parts of glossy elements as sensors see them; row i of every array is the same cell.

    Attributes
    ----------
    sensor, element : (k,) int array
        Who sees what.
    boxes : (k, 4) array
        Parameter box on the element's patch.
    factor : (k,) array
        Form factor of the cell.
    """

    sensor: IntArray
    element: IntArray
    boxes: FloatArray
    factor: FloatArray

    def __len__(self) -> int:
        return len(self.sensor)

    def take(self, rows: IntArray) -> Cells:
        """Some of them."""
        return Cells(self.sensor[rows], self.element[rows], self.boxes[rows], self.factor[rows])

    @staticmethod
    def joined(parts: list[Cells]) -> Cells:
        """All of some together."""
        names = ("sensor", "element", "boxes", "factor")
        return Cells(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def quartered(self) -> Cells:
        """Each cut in four, whose factors are not yet those of the quarters but those of all."""
        u0, u1, v0, v1 = self.boxes.T
        u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        parts = [(u0, u, v0, v), (u, u1, v0, v), (u0, u, v, v1), (u, u1, v, v1)]
        boxes = np.stack([np.stack(part, axis=1) for part in parts], axis=1)
        return Cells(
            np.repeat(self.sensor, 4),
            np.repeat(self.element, 4),
            boxes.reshape(-1, 4),
            np.repeat(self.factor, 4),
        )


class SensorLobes:
    """Highlights at the sensors of one solved scene.

    Parameters
    ----------
    second : SecondPass
        Of the scene.
    finer : Finer
        The solution that sensors gather.
    budget : Budget
        Tolerances.
    """

    def __init__(self, second: SecondPass, finer: Finer, budget: Budget) -> None:
        self.second, self.budget = second, budget
        self.elements = elements = second.surfaces.elements
        where = (elements.patch_index, elements.side)
        self.specular = second.sides.specular[where]
        self.exponent = second.sides.exponent[where]
        self.glossy = np.flatnonzero(self.specular.any(axis=1))
        # What is taken away is what sensors were given: of the light that is sent, not of that
        # which arrives where it was looked at.
        unknowns, rho = finer.unknowns, second.surfaces.reflectance
        sent = np.stack([finer.sent[g] for g in second.groups], axis=1)
        self._arriving = sent / np.where(rho > 0.0, rho, 1.0)[unknowns.element, None, :]
        self._mean = unknowns.mean(self._arriving)
        self._first = np.searchsorted(unknowns.element, np.arange(len(elements)))
        basis = unknowns.basis
        self._rule = np.zeros(1) if basis is None else basis.rule
        none = np.zeros(len(elements), np.int64)
        #: Pieces a direction between whose nodes light varies; 0 where it is even.
        self._pieces = none if basis is None else basis.pieces
        self.caster = RayCaster(second.scene.without_panes.patches)

    def change(
        self, grid: Sensors, seen: FloatArray, gathered: Gathered
    ) -> tuple[FloatArray, FloatArray, int]:
        """What lobes change at m sensors (m, g, b) [lx], its variance (m,), and points looked at.

        ``seen`` (m, k) are the form factors of the glossy elements.
        """
        groups, bands = self.second.groups, self.second.bands
        out, variance = np.zeros((len(grid), len(groups), bands)), np.zeros(len(grid))
        tolerance = _CUT * self.budget.accuracy * np.maximum(gathered.luminous(), 1e-300)
        cells, parents = self._begin(seen)
        count = 0
        for level in range(_LEVELS + 1):
            count += 4 * len(cells)
            uneven: list[Cells] = []
            left = 0 if level == _LEVELS else _MOST // 4
            for rows in self._blocks(parents):
                own = cells.take(rows)
                value, deviation, share = self._evaluate(own, grid)
                # What was known of the whole is parted as the quarters show it.
                whole = parents[rows] - parents[rows[0]]
                total = np.bincount(whole, share)[whole]
                own.factor = own.factor * np.where(
                    total > 0.0, share / np.maximum(total, 1e-300), 0
                )
                error = np.pi * own.factor * deviation
                cut = error > tolerance[own.sensor]
                if int(cut.sum()) > left:
                    cut[:] = False
                left -= int(cut.sum())
                done = ~cut
                light = np.pi * own.factor[done, None, None] * value[done]
                np.add.at(out, own.sensor[done], light)
                np.add.at(variance, own.sensor[done], (_DEVIATION * error[done]) ** 2)
                uneven.append(own.take(np.flatnonzero(cut)))
            if not sum(map(len, uneven)):
                break
            cells = Cells.joined(uneven).quartered()
            parents = np.repeat(np.arange(len(cells) // 4), 4)
        return out, variance, count

    def _blocks(self, parents: IntArray) -> Iterator[IntArray]:
        """Rows of cells that are done at a time, with all of a parent together.

        Fewer where there are more values a point: groups times bands.
        """
        values = len(self.second.groups) * self.second.bands
        size = max(_VALUES // (4 * values), 1)
        start = 0
        while start < len(parents):
            # To the end of the parent in which the block is full.
            last = parents[min(start + size, len(parents)) - 1]
            end = int(np.searchsorted(parents, last, side="right"))
            yield np.arange(start, end)
            start = end

    def _irradiance(self, element: IntArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Illuminance (k, g, b) at places (k,) on elements, or its mean where nodes lack. [lx]"""
        out = self._mean[element]
        u0, u1, v0, v1 = self.elements.boxes[element].T
        u, v = (u - u0) / (u1 - u0), (v - v0) / (v1 - v0)
        # Nets of − sides run the other way along u.
        u = np.where(self.elements.side[element] == 1, 1.0 - u, u)
        for pieces in np.unique(self._pieces[self._pieces > 0]):
            some = np.flatnonzero(self._pieces[element] == pieces)
            if not len(some):
                continue
            along_u, along_v = (lagrange(self._rule, int(pieces), t[some]) for t in (u, v))
            shares = (along_u[:, :, None] * along_v[:, None, :]).reshape(len(some), -1)
            rows = self._first[element[some]][:, None] + np.arange(shares.shape[1])
            out[some] = np.einsum("kq,kqgb->kgb", shares, self._arriving[rows])
        return out

    def _begin(self, seen: FloatArray) -> tuple[Cells, IntArray]:
        """Cells to begin with, and the row of sensor and element that each belongs to."""
        sensor, column = np.nonzero(seen > _LEAST)
        element, factor = self.glossy[column], seen[sensor, column]
        wanted = np.sqrt(factor * (_CELLS + _SHARP * self.exponent[element]))
        sides = np.clip(np.ceil(wanted), 1, _MOST_CELLS).astype(np.int64)
        repeat = sides**2
        parents = np.repeat(np.arange(len(sensor)), repeat)
        place = np.arange(len(parents)) - np.repeat(np.cumsum(repeat) - repeat, repeat)
        i, j = np.divmod(place, sides[parents])
        u0, u1, v0, v1 = self.elements.boxes[element[parents]].T
        k = sides[parents]
        boxes = np.stack(
            [
                u0 + (u1 - u0) * i / k,
                u0 + (u1 - u0) * (i + 1) / k,
                v0 + (v1 - v0) * j / k,
                v0 + (v1 - v0) * (j + 1) / k,
            ],
            axis=1,
        )
        return Cells(sensor[parents], element[parents], boxes, factor[parents]), parents

    def _evaluate(self, cells: Cells, grid: Sensors) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Change of radiance (k, g, b), its luminous deviation (k,), and geometric shares (k,)."""
        light, weight = self._points(cells, grid)
        total = weight.sum(axis=1)
        part = weight / np.where(total > 0.0, total, 1.0)[:, None]
        mean = np.einsum("kq,kqgb->kgb", part, light)
        bright = luminous(light.sum(axis=2))
        middle = luminous(mean.sum(axis=1))
        spread = (part * (bright - middle[:, None]) ** 2).sum(axis=1)
        return mean, np.sqrt(spread), total

    def _points(self, cells: Cells, grid: Sensors) -> tuple[FloatArray, FloatArray]:
        """Change of radiance (k, 4, g, b) at four points a cell, and their weights (k, 4)."""
        second, elements = self.second, self.elements
        u0, u1, v0, v1 = cells.boxes.T
        u = u0[:, None] + (u1 - u0)[:, None] * _AT[[0, 0, 1, 1]]
        v = v0[:, None] + (v1 - v0)[:, None] * _AT[[0, 1, 0, 1]]
        patch = elements.patch_index[cells.element]
        nets = second.scene.patches.control_points[patch]
        at, su, sv = points_of(nets, u, v)
        normal = np.cross(su, sv)
        size = np.linalg.norm(normal, axis=2)
        area = size * ((u1 - u0) * (v1 - v0))[:, None]
        normal /= np.where(size > 0.0, size, 1.0)[..., None]
        normal[elements.side[cells.element] == 1] *= -1.0
        away = grid.points[cells.sensor][:, None] - at
        distance = np.linalg.norm(away, axis=2)
        away /= np.maximum(distance, 1e-300)[..., None]
        there = np.einsum("kqc,kqc->kq", away, normal)
        here = -np.einsum("kqc,kc->kq", away, grid.normals[cells.sensor])
        weight = area * np.maximum(there, 0.0) * np.maximum(here, 0.0)
        weight /= np.maximum(distance, 1e-300) ** 2
        if second.trace:
            rows = np.nonzero(weight > 0.0)
            hidden = self.caster.any_hit(
                at[rows], away[rows], t_min=second.near, t_max=distance[rows] - second.near
            )
            weight[rows[0][hidden], rows[1][hidden]] = 0.0
        if len(second.panes.nets):
            rows = np.nonzero(weight > 0.0)
            far = distance[rows] - second.near
            weight[rows] *= shares_through(
                second.panes, at[rows], away[rows], t_min=second.near, t_max=far
            )[0]
        light = np.zeros((*weight.shape, len(second.groups), second.bands))
        rows = np.nonzero(weight > 0.0)
        element = cells.element[rows[0]]
        before = self._irradiance(element, u[rows], v[rows]) / np.pi
        found, albedo = second.lobes(
            at[rows], normal[rows], away[rows], self.exponent[element],
            np.abs(luminous(before.sum(axis=1))),
            accuracy=_LAMPS * self.budget.accuracy, rays=_RAYS, by_group=True,
        )  # fmt: skip
        change = self.specular[element][:, None, :] * (found - albedo[:, None, None] * before)
        light[rows] = change
        return light, weight


def points_of(
    nets: FloatArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points and derivatives (k, q, 3) of nets (k, 4, 4, 4), each at its own parameters (k, q)."""
    bu, bv = bernstein(u), bernstein(v)
    h = np.einsum("kqi,kqj,kijc->kqc", bu, bv, nets, optimize=True)
    hu = np.einsum("kqi,kqj,kijc->kqc", bernstein_derivative(u), bv, nets, optimize=True)
    hv = np.einsum("kqi,kqj,kijc->kqc", bu, bernstein_derivative(v), nets, optimize=True)
    w = h[..., 3:]
    at = h[..., :3] / w
    return at, (hu[..., :3] - hu[..., 3:] * at) / w, (hv[..., :3] - hv[..., 3:] * at) / w
