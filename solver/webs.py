"""Direct light of lamps with photometric webs, from their true surfaces.

What an element of such a lamp gives to a receiver is its visible form factor, which is known, times
π times the mean luminance at which the receiver sees it (`kernels.webs`). Where an element is
partly hidden, the mean over what is seen may be another one: by at most the span of its luminances.
That is stated as an error, and where it matters the elements are cut finer and traced again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows, form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .kernels.webs import LEAST, LIGHT, MOST, VIEW, WebTables, luminances, web_rows
from .mesh import make_elements
from .model.arrays import FloatArray, IntArray
from .model.elements import Elements
from .model.scene import SceneData
from .surfaces import Receivers
from .topology import bounding_spheres, writable
from .web_light import WebLight, WebPieces, WebViews
from .web_shape import WebShape, web_directions

#: Cells of the quadrature over a lamp span at most that many steps of its web, which their points
#: are a quarter of, and this much. [rad]
_STEPS, _NARROW, _WIDE = 4.0, 0.05, 0.5
#: Relative accuracy of mean luminances against that of the simulation, and how much less will do
#: where many nodes are averaged.
_SHARE, _COARSE = 0.03, 10.0
#: How often an element is quartered for its mean luminance.
LEVELS = 8
#: Pieces of a lamp beyond which it is not cut finer.
_MOST_PIECES = 4096
#: `kernels.rows.how_to_see` asks a twentieth of the digits of the hemisphere; and what is enough.
_DIGITS, _LEAST_EPS = 20.0, 1e-11
#: Change of the intensity between neighbouring angles, against the largest, that makes a web sharp.
_SHARP = 0.1
#: Light below this share of the receivers' mean needs no accuracy of its own.
_FLOOR = 0.01


#: Tables by photometry, flux, turn and shape: see `WebLamp`.
Known = dict[tuple[object, ...], tuple[WebTables, FloatArray, FloatArray]]


class WebLamp:
    """A lamp with a photometric web.

    Parameters
    ----------
    scene : SceneData
        The scene.
    row : int
        Row of its luminaires.
    accuracy : float
        Relative accuracy of the simulation.
    known : dict, optional
        Tables of other lamps, which copies of a lamp share; added to.
    """

    def __init__(
        self,
        scene: SceneData,
        row: int,
        accuracy: float,
        known: Known | None = None,
    ) -> None:
        self.scene, self.row = scene, row
        self.luminaire = scene.luminaires[row]
        if self.luminaire.web is None:
            raise TypeError(f"{self.luminaire.part}: a lamp without a web")
        self.web = self.luminaire.web
        self.patches, self.sides = np.nonzero(scene.luminaire_index == row)
        self.shape = WebShape.of(scene.patches.take(self.patches), self.sides == 1)
        known = {} if known is None else known
        key = (id(self.web.photometry), self.luminaire.flux_lm, *self._shape_key())
        if key not in known:
            known[key] = self._tables()
        self.tables, self.towards, self.sent = known[key]
        self.step, self.sharp = _finest(self.tables)
        self._angle = min(max(_STEPS * self.step, _NARROW), _WIDE)
        self._tolerance = min(max(_SHARE * accuracy, 1e-6), 1e-3)

    def _shape_key(self) -> tuple[bytes, ...]:
        """The same for copies of a lamp that are turned alike, wherever they are."""
        directions = self.web.axes, self.shape.flat[:, :3], self.shape.facets[:, :3]
        areas = np.concatenate([self.shape.flat[:, 3], self.shape.facets[:, 3]]) / self.shape.area
        return tuple((np.round(a, 9) + 0.0).tobytes() for a in (*directions, areas)) + (
            f"{self.shape.area:.9g}".encode(),
        )

    def _tables(self) -> tuple[WebTables, FloatArray, FloatArray]:
        """For the kernels, scaled to the lamp's flux; directions (k, 3) and their shares of it."""
        photometry = self.web.photometry
        tables = WebTables(
            axes=writable(self.web.axes),
            c=np.radians(photometry.c_deg),
            gamma=np.radians(photometry.gamma_deg),
            candela=writable(photometry.candela),
            flat=writable(self.shape.flat),
            curved=writable(self.shape.curved_table(self.web)),
            area=self.shape.area,
        )
        towards, solid, _ = web_directions(self.web, self.shape)
        level = np.empty(len(towards))
        luminances(tables, writable(towards), level)
        sent = level * solid * self.shape.projected(towards)
        scale = self.luminaire.flux_lm / float(sent.sum())
        return tables._replace(candela=tables.candela * scale), towards, sent / sent.sum()

    def luminance(self, directions: FloatArray) -> FloatArray:
        """Luminance (m,) of the lamp in unit directions (m, 3) that its light takes. [cd/m²]"""
        out = np.empty(len(directions))
        luminances(self.tables, writable(directions), out)
        return out

    def views(
        self,
        receivers: Receivers,
        elements: Elements,
        wanted: NDArray[np.bool_],
        plain: NDArray[np.floating],
        *,
        coarse: bool = False,
        levels: int = LEVELS,
    ) -> WebViews:
        """How m receivers see those of the lamp's k elements that are ``wanted`` (m, k).

        ``plain`` is kept with it; ``coarse`` is for receivers whose nodes and neighbours average
        the error, and ``levels`` is how often an element is quartered at most.
        """
        from .kernels.threads import count_threads

        pieces = WebPieces.of(elements.nets)
        found = np.empty((*wanted.shape, 4))
        web_rows(
            writable(receivers.nodes),
            writable(receivers.normals),
            writable(receivers.weights),
            wanted,
            self.tables,
            writable(pieces.nets),
            writable(pieces.spheres),
            writable(pieces.points),
            writable(pieces.areas),
            self._angle * (2.0 if coarse else 1.0),
            self._tolerance * (_COARSE if coarse else 1.0),
            levels,
            count_threads(),
            found,
        )
        view, flux = found[..., VIEW], self.luminaire.flux_lm
        known = view > 0.0
        level = np.where(known, math.pi * found[..., LIGHT] / np.where(known, view, 1.0), 0.0)
        span = np.where(known, found[..., MOST] - np.where(known, found[..., LEAST], 0.0), 0.0)
        return WebViews(level / flux, span / flux, plain)

    def traced(
        self,
        receivers: Receivers,
        blockers: Blockers,
        counts: IntArray,
        *,
        eps: float,
        cell_eps: float,
        count: Callable[[dict[str, int]], None],
    ) -> WebLight:
        """Light by form factors of its own: every pair that something may hide goes by pyramids.

        Parameters
        ----------
        receivers : Receivers
            m receivers.
        blockers : Blockers
            All patches.
        counts : (p, 2) int array
            Pieces of each patch of the scene along u and v.
        eps, cell_eps : float
            As in `exchange.form_factor_matrix` and `exchange.make_sources`.
        count : callable
            Receives counters.
        """
        elements = self.elements(counts)
        rows = self._rows(receivers, elements, blockers, eps, cell_eps)
        count({"web_rows_traced": len(rows.factors), **rows.counters})
        plain = self._rows(receivers, elements, blockers, eps, cell_eps, trace=False).factors
        views = self.views(receivers, elements, rows.factors > 0.0, plain)
        return views.light(self.luminaire.flux_lm, rows.factors, rows.variances, plain)

    def plain_factors(
        self, receivers: Receivers, elements: Elements, blockers: Blockers, *, eps: float
    ) -> NDArray[np.floating]:
        """Form factors (m, k) of its elements if nothing were in the way."""
        return self._rows(receivers, elements, blockers, eps, 1.0, trace=False).factors

    def _rows(
        self,
        receivers: Receivers,
        elements: Elements,
        blockers: Blockers,
        eps: float,
        cell_eps: float,
        *,
        trace: bool = True,
    ) -> Rows:
        nets = self.scene.patches.control_points
        # Digits are asked relative to the hemisphere, since what is small is thought weak. Here it
        # is all the light there is: what counts is the lamp as it appears from most receivers.
        center = bounding_spheres(elements.nets)[:, :3].mean(axis=0)
        away = float(np.median(np.linalg.norm(receivers.nodes[:, 0] - center, axis=1)))
        appears = min(1.0, self.shape.area / (4.0 * math.pi * max(away, 1e-300) ** 2))
        eps *= min(1.0, _DIGITS * appears)
        cell_eps *= appears
        return form_factor_matrix(
            receivers.nodes,
            receivers.normals,
            receivers.weights,
            receivers.patches,
            make_sources(elements, nets, np.full(len(elements), cell_eps)),
            blockers,
            eps=max(eps, _LEAST_EPS),
            trace=trace,
        )

    def refined(
        self,
        receivers: Receivers,
        light: WebLight,
        blockers: Blockers,
        counts: IntArray,
        *,
        accuracy: float,
        cuts: int,
        eps: float,
        cell_eps: float,
        count: Callable[[dict[str, int]], None],
    ) -> WebLight:
        """The light with pieces cut in four up to ``cuts`` times where partly hidden ones matter.

        ``light`` is what was found with ``counts``; a standard deviation of ``accuracy``, relative
        to the light, may stay. The rest is as in `traced`.
        """
        for cut in range(1, cuts + 1):
            floor = _FLOOR * float(light.illuminance.mean())
            found = np.flatnonzero(light.partly > accuracy * np.maximum(light.illuminance, floor))
            finer = np.asarray(counts) * 2**cut
            if not len(found) or int(finer[self.patches].prod(axis=1).sum()) > _MOST_PIECES:
                break
            better = self.traced(
                receivers.take(found), blockers, finer, eps=eps, cell_eps=cell_eps, count=count
            )
            light = light.put(found, better)
        return light

    def elements(self, counts: IntArray) -> Elements:
        """Its emitting sides, the patches of the scene being cut into ``counts`` (p, 2) pieces."""
        patches = np.unique(self.patches)
        own = make_elements(
            self.scene.patches.take(patches),
            self.scene.two_sided[patches],
            np.asarray(counts)[patches],
            nodes=1,
        )
        index = patches[own.patch_index]
        kept = np.flatnonzero(self.scene.luminaire_index[index, own.side] == self.row)
        return replace(own.take(kept), patch_index=index[kept])


def _finest(tables: WebTables) -> tuple[float, bool]:
    """Least step in γ over which the intensity changes, and whether it changes by much. [rad]"""
    peak = float(tables.candela.max())
    change = np.abs(np.diff(tables.candela, axis=1)).max(axis=0) / peak
    steps = np.diff(tables.gamma)
    around = float(np.abs(np.diff(tables.candela, axis=0)).max()) / peak
    bends = change >= 0.5 * change.max()
    return float(steps[bends].min()), bool(max(change.max(), around) > _SHARP)
