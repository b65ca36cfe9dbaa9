"""How far the boundary of a curved face lies off its edges in space, and how it is brought there.

Files hold curves in (u, v) that leave their edge (polygons, other parameters), and patches of both
faces must end at the edge. Many faces are looked at in one go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from .compare import length
from .extract import EdgeUse, RawFace
from .projected import projected
from .together import SurfaceBatch, points_of

#: Shares of an edge at which it is compared with its curve in (u, v).
PLACES = np.linspace(0.0, 1.0, 9)


@dataclass(slots=True)
class Measure:
    """Asks for the distances (k,) between a face and its edges, those with a curve in space."""

    raw: RawFace


@dataclass(slots=True)
class Follow:
    """Asks for better curves in (u, v) where the distances ``off`` (k,) are above ``limit``."""

    raw: RawFace
    off: FloatArray
    limit: float


def _both(raw: RawFace) -> list[EdgeUse]:
    """Uses of edges with a curve in (u, v) and one in space."""
    every = (use for uses in raw.loops for use in uses)
    return [u for u in every if u.curve is not None and u.edge.curve is not None]


def measured(asked: Sequence[Measure]) -> list[FloatArray]:
    """Distances (k,) of each face from its edges; notes `EdgeUse.places` on the way."""
    raws = [ask.raw for ask in asked]
    _sample([u for raw in raws for uses in raw.loops for u in uses if u.curve is not None])
    own = [_both(raw) for raw in raws]
    count = [len(uses) for uses in own]
    batch = SurfaceBatch([raw.surface for raw in raws if raw.surface is not None])
    off = _distances(
        [u for uses in own for u in uses], batch, np.repeat(np.arange(len(own)), count)
    )
    return np.split(off, np.cumsum(count)[:-1])


def followed(asked: Sequence[Follow]) -> list[FloatArray]:
    """Distances (k,) after curves that leave their edge were replaced by projections of it.

    A projection that is not much nearer is not taken.
    """
    out = [ask.off.copy() for ask in asked]
    rows = [(i, k) for i, ask in enumerate(asked) for k in np.flatnonzero(ask.off > ask.limit)]
    own = [_both(ask.raw) for ask in asked]
    rows = [(i, k) for i, k in rows if own[i][k].end != own[i][k].start]
    if not rows:
        return out
    uses = [own[i][k] for i, k in rows]
    which = np.array([i for i, _ in rows])
    batch = SurfaceBatch([ask.raw.surface for ask in asked if ask.raw.surface is not None])
    before = [(use.curve, use.places) for use in uses]
    limits = np.array([ask.limit for ask in asked])
    better = projected(uses, batch, which, 0.1 * limits[which])
    for use, curve in zip(uses, better, strict=True):
        use.curve = curve
    _sample(uses)
    now = _distances(uses, batch, which)
    for use, (i, k), distance, kept in zip(uses, rows, now.tolist(), before, strict=True):
        if distance < 0.5 * out[i][k]:
            out[i][k] = distance
        else:
            use.curve, use.places = kept
    return out


def _sample(uses: list[EdgeUse]) -> None:
    """Note the points (9, 2) in (u, v) of uses at `PLACES`."""
    ends = np.array([(u.start, u.end) for u in uses]).reshape(-1, 2)
    curves = [u.curve for u in uses if u.curve is not None]
    points = points_of(curves, ends[:, :1] + np.diff(ends) * PLACES, 2)
    for use, own in zip(uses, points, strict=True):
        use.places = own


def _distances(uses: list[EdgeUse], batch: SurfaceBatch, which: IntArray) -> FloatArray:
    """Largest distances (m,) between uses on the surfaces ``which`` (m,) and their edges."""
    if not uses:
        return np.zeros(0)
    ends = np.array([(u.edge.start, u.edge.end) for u in uses])
    curves = [u.edge.curve for u in uses if u.edge.curve is not None]
    x = points_of(curves, ends[:, :1] + np.diff(ends) * PLACES, 3)
    uv = np.array([u.places for u in uses])
    return np.asarray(length(batch.points(which, uv[..., 0], uv[..., 1]) - x).max(axis=1))
