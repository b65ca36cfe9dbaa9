"""Rows of form factors that stay as they are though something has moved, and what that may cost.

From most places a chair is a small thing: what moving it does to the light there is bounded by what
is seen of it times the exitance of what is brightest before, in and behind it, see
`kernels.change_bounds`. Rows stay as long as all of them together change the light at the sensors
by no more than a small share of the accuracy asked for, the least worth first. By how much they may
is bounded again with the light that was found, and stated: see `kept_error`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .moved import moved_patches, places_of
from .row_finder import Ask
from .stand import History, Stand
from .topology import writable

if TYPE_CHECKING:
    from .kernels.change_bounds import Newcomers

#: Share of the accuracy asked for by which rows that stay may change the mean light of the sensors
#: on its first way to them, each set of rows; and that by which rows of sensors may change theirs.
#: What is reflected on counts some twice as much, and sensors beside what has moved get more of it:
#: within `kept_error.AT_MOST`.
CHOSEN, CHOSEN_AT_SENSORS = 0.03, 0.03


#: Tells which rows (m,) may stay, given what bounds (m,) there are of what they have wrong. [lx]
Choose = Callable[["Worth", FloatArray], NDArray[np.bool_]]


@dataclass(frozen=True, slots=True, eq=False)
class Worth:
    """What light on n elements matters for the sensors, as a run before has found it.

    Attributes
    ----------
    light : (n,) array
        Exitance of the elements. [lm/m²]
    weights : (n,) array
        What sensors get in all of a lux more on each. [lm]
    allowed : float
        What they may get more or less by rows that stay. [lm]
    most : float
        What any receiver on surfaces may. [lx]
    sensors : dict of (m,) arrays
        What those of each grid may. [lx]
    """

    light: FloatArray
    weights: FloatArray
    allowed: float
    most: float
    sensors: dict[str, FloatArray]

    @classmethod
    def of(
        cls,
        light: FloatArray,
        importance: FloatArray,
        reflectance: FloatArray,
        areas: FloatArray,
        at_sensors: dict[str, FloatArray],
        accuracy: float,
    ) -> Worth:
        """That of elements (n,) of ``importance`` per area, see `iterated.weights_at`.

        ``at_sensors`` is the light (m,) at those of each grid. [lx]
        """
        total = float((importance * areas) @ light)
        mean = total / max(float(importance @ areas), 1e-300)
        weights = reflectance * areas * importance
        may = {name: CHOSEN_AT_SENSORS * accuracy * lux for name, lux in at_sensors.items()}
        return cls(light, weights, CHOSEN * accuracy * total, accuracy * mean, may)

    def at_sensors(self, name: str, bounds: FloatArray) -> NDArray[np.bool_]:
        """Which rows (m,) of a grid's sensors may stay, by their ``bounds`` (m,). [lx]"""
        may = self.sensors.get(name, np.zeros(0))
        return np.asarray(bounds <= may) if len(may) == len(bounds) else np.zeros(len(bounds), bool)

    def on_elements(self, own: IntArray, bounds: FloatArray) -> NDArray[np.bool_]:
        """Which rows (m,) of receivers on elements ``own`` (m,) may stay, by theirs. [lx]"""
        shares = np.bincount(own, minlength=len(self.weights))[own]
        worth = self.weights[own] / shares * np.where(bounds <= self.most, bounds, 0.0)
        worth = np.where(bounds <= self.most, worth, np.inf)
        order = np.argsort(worth, kind="stable")
        out = np.zeros(len(own), dtype=bool)
        out[order] = np.cumsum(worth[order]) <= self.allowed
        return out


def bounds_of_change(
    rows: Rows,
    history: History,
    asked: Ask,
    stand: Stand,
    light: FloatArray,
    which: NDArray[np.bool_],
    of: IntArray,
) -> FloatArray:
    """By how much (m,) the light of receivers may be off with ``rows`` as they are. [lx]

    Parameters
    ----------
    rows, history : Rows, History
        The rows of m receivers, and how surfaces stood when they were found.
    asked : Ask
        The receivers, and the elements as they stand now.
    stand : Stand
        The same.
    light : (n,) array
        Exitance of the elements. [lm/m²]
    which : (m,) bool array
        Rows that are asked about; of others 0 is told.
    of : (p,) int array
        Part of each patch.
    """
    from .kernels.change_bounds import bound_changes

    bounds, receivers = np.zeros(len(which)), asked.receivers
    lifts = np.zeros(len(which)) if asked.lifts is None else asked.lifts
    outside = rows.outside[:, 1] + rows.outside[:, 2]
    part = asked.sources.patch
    for k in np.unique(history.since[which]):
        old = history.stands[k]
        dirty = moved_patches(old.nets, stand.nets)
        if not dirty.any():
            continue
        bound_changes(
            writable(receivers.nodes),
            writable(receivers.normals),
            writable(lifts),
            which & (history.since == k),
            rows.factors,
            outside,
            writable(light),
            old.seen,
            writable(dirty[part], np.bool_),
            _newcomers(asked.sources, dirty[part]),
            places_of(old.nets, stand.nets, dirty, of),
            bounds,
        )
    return bounds


def _newcomers(sources: Sources, rows: NDArray[np.bool_]) -> Newcomers:
    """Elements that have moved, as the kernel wants them."""
    from .kernels.change_bounds import Newcomers

    reach, size, turn = sources.mean_reach[:3, rows]
    vectors = sources.mean_area[:, rows].T
    return Newcomers(
        writable(sources.mean_point[:, rows].T + sources.edge_origin),
        # Where normals turn by a hemisphere there is no mean direction: ``size`` is infinite.
        writable(vectors / np.maximum(size, 1e-300)[:, None]),
        np.linalg.norm(sources.area_normal[:, rows], axis=0).sum(axis=1),
        writable(reach),
        writable(np.where(np.isfinite(size), turn, 1.0)),
    )
