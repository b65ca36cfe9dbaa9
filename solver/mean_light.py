"""Direct light of the lamps averaged over elements, from many points of each.

The nodes of an element are few: of the shadows of furniture that repeats at even distances they may
meet too many, or too few, on all elements alike. Here light is found in each of 6 x 6 equal parts
of an element, or 2 x 2 of a small one, at places that differ from element to element, each with one
ray to another place on every patch of the lamps, or on some for all where they are faint: so the
pairs of places are spread over element and lamp together, half shadows come out right on average,
and what is left differs from element to element. What is wrong with the mean of an element is wrong
with all that it sends on; how light varies over it is left to the nodes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .direct_light import LIFT, REACHED
from .exchange import form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .light_colors import lamp_color
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .model.scene import SceneData
from .raycast import RayCaster
from .surfaces import Surfaces
from .unknowns import Unknowns

#: Points a direction in each element, and in small ones, and places a direction on each patch of a
#: lamp.
LOOK, LOOK_SMALL, PLACES = 6, 2, 4
#: Relative accuracy of unoccluded form factors.
EPS = 1e-3
#: Pairs of point and lamp at a time: some 150 MB.
PAIRS = 2_000_000
#: Patches of lamps from which on looking would cost as much as the form factors.
MOST_LAMPS = 2000
#: Share of a point's light below which only some patches of lamps are asked about, for the others,
#: too: so that each that is stands for this share. Far lamps are hidden more than near ones, and in
#: large halls most of them are faint.
FAINT = 5e-3
#: Light of the nodes against what is found from many points, below which it is taken for even.
LEAST = 0.3
#: Steps of the sequence that places points in their parts, and on the lamps, and chooses these:
#: powers of 1/φ, φ⁶ = φ + 1.
STEPS = tuple(1.1347241384015194**-k for k in range(1, 6))


def by_rays(scene: SceneData) -> bool:
    """Whether the light of lamps is told by rays: it goes straight, and they shine evenly."""
    even = all(lamp.web is None and lamp.profile is None for lamp in scene.luminaires)
    return even and not scene.glazings and int((scene.luminaire_index >= 0).sum()) <= MOST_LAMPS


class MeanLight:
    """Light of all lamps, averaged over elements.

    Parameters
    ----------
    scene : SceneData
        Geometry, and lamps that shine evenly.
    blockers : Blockers
        Its patches as obstacles.
    """

    def __init__(self, scene: SceneData, blockers: Blockers) -> None:
        self.scene, self.blockers = scene, blockers
        patch, side = np.nonzero(scene.luminaire_index >= 0)
        whole = np.tile((0.0, 1.0, 0.0, 1.0), (len(patch), 1))
        lamps = elements_on(scene.patches, Boxes(patch, side, whole))
        self._places, su, sv = surface_points(lamps.nets, *_middles(PLACES))
        self._vectors = np.cross(su, sv)  # of as much area as a whole patch has
        self.lamp = scene.luminaire_index[patch, side]
        self._exitance = np.array([one.exitance_lm_m2 for one in scene.luminaires])[self.lamp]
        nets = scene.patches.control_points
        self._sources = make_sources(lamps, nets, np.full(len(lamps), EPS))
        self._caster = RayCaster(scene.patches)
        low, high = scene.patches.bounds()
        self._lift = LIFT * float(np.linalg.norm(high - low))

    def put(
        self,
        direct: dict[str, FloatArray],
        surfaces: Surfaces,
        unknowns: Unknowns,
        least: float,
    ) -> FloatArray:
        """Scale ``direct`` irradiance (N, b) by light group to its means over the elements. [lx]

        Those of less area than ``least`` [m²] are looked at in fewer points, and those that are
        covered in part at their open nodes alone: they are left as they are. Returns the standard
        deviation (n,) of the means, of all groups together [lx]; NaN where nothing was put.
        """
        elements = surfaces.elements
        out = np.full(len(elements), np.nan)
        open_ = ~elements.buried.any(axis=1)
        several = (elements.weights > 0.0).sum(axis=1) > 1
        large = several | (elements.areas >= least)
        for some, look in ((several, LOOK), (~several & large, LOOK), (~large, LOOK_SMALL)):
            rows = np.flatnonzero(some & open_)
            if len(rows):
                out[rows] = self._put(direct, surfaces, unknowns, rows, look)
        return out

    def _put(
        self,
        direct: dict[str, FloatArray],
        surfaces: Surfaces,
        unknowns: Unknowns,
        rows: IntArray,
        look: int,
    ) -> FloatArray:
        by_lamp, deviation = self.on(surfaces.elements, rows, look)
        own, bands = unknowns.of_elements(rows), surfaces.emitted.shape[1]
        found = {
            group: np.zeros((len(rows), bands))
            for group in dict.fromkeys(lamp.group for lamp in self.scene.luminaires)
        }
        for k, lamp in enumerate(self.scene.luminaires):
            found[lamp.group] += by_lamp[:, k, None] * lamp_color(lamp, bands)
        # Of a faint group less than nothing may have been found, and of others as much too much.
        least = np.zeros((len(rows), bands))
        total = np.maximum(sum(found.values(), least), 0.0)
        more = sum((np.maximum(new, 0.0) for new in found.values()), least)
        share = np.where(more > 0.0, total / np.where(more > 0.0, more, 1.0), 0.0)
        for group, new in found.items():
            new = np.maximum(new, 0.0) * share
            old, values = unknowns.mean(direct[group])[rows], direct[group][own]
            told = old > LEAST * new
            factor = new / np.where(told, old, 1.0)
            direct[group][own] = np.where(told[:, None], values * factor[:, None], new[:, None])
        return deviation

    def on(
        self, elements: Elements, rows: IntArray, look: int = LOOK
    ) -> tuple[FloatArray, FloatArray]:
        """Mean illuminance (k, lamps) of some elements by each luminaire. [lx]

        That of a faint one may be less than 0; all of them together are as much as arrives. Also
        the standard deviation (k,) of that, as it varies between neighbouring points: an upper
        bound of what is left of it by places spread so evenly. [lx]
        """
        count, points_each = len(self.scene.luminaires), look**2
        out, deviation = np.zeros((len(rows), count)), np.zeros(len(rows))
        chunk = max(1, PAIRS // (len(self.lamp) * points_each))
        for start in range(0, len(rows), chunk):
            some = rows[start : start + chunk]
            # Even distances would meet too much or too little of what repeats as they do.
            off = [t - 0.5 for t in _spread(points_each, some)]
            u, v = (t + shift / look for t, shift in zip(_middles(look), off[:2], strict=True))
            points, su, sv = surface_points(elements.nets[some], u, v)
            normals = np.cross(su, sv)
            size = np.linalg.norm(normals, axis=2)
            normals /= np.where(size > 0.0, size, 1.0)[..., None]
            patches = np.repeat(elements.patch_index[some], points_each)
            flat = points.reshape(-1, 3), normals.reshape(-1, 3)
            light = self._at(*flat, patches, some).reshape(len(some), points_each, -1)
            mean = np.einsum("kp,kpl->lk", size / size.sum(axis=1)[:, None], light)
            np.add.at(out[start : start + chunk].T, self.lamp, mean)
            grid = light.sum(axis=2).reshape(-1, look, look)
            steps = [np.mean(np.diff(grid, axis=axis) ** 2, axis=(1, 2)) for axis in (1, 2)]
            deviation[start : start + chunk] = np.sqrt(0.25 * (steps[0] + steps[1]) / points_each)
        return out, deviation

    def _at(
        self, points: FloatArray, normals: FloatArray, patches: IntArray, elements: IntArray
    ) -> FloatArray:
        """Illuminance (m, l) by each patch of the lamps, one ray to each or to some. [lx]"""
        factors = form_factor_matrix(
            points[:, None],
            normals[:, None],
            np.ones((len(points), 1)),
            patches,
            self._sources,
            self.blockers,
            eps=EPS,
            trace=False,
        ).factors
        light = factors * self._exitance
        spread = _spread(len(points) // len(elements), elements)
        chance = light / np.maximum(FAINT * light.sum(axis=1, keepdims=True), 1e-300)
        row, lamp = np.nonzero(_chosen(np.minimum(chance, 1.0, out=chance), spread[4].ravel()))
        u, v = (np.floor(PLACES * t).ravel() for t in spread[2:4])
        place = (u * PLACES + v).astype(np.int64)
        place, facing = place[row], normals[row]
        start = points[row] + self._lift * facing
        way = self._places[lamp, place] - start
        hidden = self._caster.any_hit(start, way, t_max=REACHED)
        # A place stands for what light comes from there: more from near ones.
        cosines = np.einsum("kx,kx->k", facing, way)
        cosines *= np.einsum("kx,kx->k", self._vectors[lamp, place], -way)
        share = np.maximum(cosines, 0.0) / (np.pi * np.einsum("kx,kx->k", way, way) ** 2)
        # Where it is asked about one lamp in ten, one that is hidden tells of ten.
        share /= chance[row, lamp]
        light[row, lamp] -= np.where(hidden, share * self._exitance[lamp], 0.0)
        return light


def _middles(k: int) -> tuple[FloatArray, FloatArray]:
    """Parameters (k²,) of the middles of k x k equal parts."""
    t = (np.arange(k) + 0.5) / k
    u, v = (g.ravel() for g in np.meshgrid(t, t, indexing="ij"))
    return u, v


def _chosen(chance: FloatArray, start: FloatArray) -> NDArray[np.bool_]:
    """Which of (m, l) to take, each with its ``chance``: evenly along rows, from ``start`` (m,)."""
    ends = np.cumsum(chance, axis=1) + start[:, None]
    return np.asarray((chance >= 1.0) | (np.floor(ends) > np.floor(ends - chance)))


def _spread(count: int, elements: IntArray) -> list[FloatArray]:
    """Five numbers (k, count) in 0 … 1 for the points of elements, evenly spread over all."""
    turn = np.arange(count) + np.sqrt(2.0) * elements[:, None]
    return [np.mod(turn * step, 1.0) for step in STEPS]
