"""What each B-rep edge of a part is: smooth or sharp between two faces, free, or more than that.

Normals are those of the surfaces under the faces, not of patches: an edge is the same thing however
its faces are converted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model import EDGE_KINDS
from patchlight.solver.model.arrays import FloatArray, IntArray

from .compare import BoolArray, cross, length
from .extract import Edge, EdgeUse, RawFace
from .free_edges import Lone, lone_edges
from .surfaces import Plane, Surface
from .together import SurfaceBatch, points_of

UNKNOWN, SMOOTH, SHARP, FREE, NON_MANIFOLD, DEGENERATE = range(len(EDGE_KINDS))
#: Shares of an edge at which normals are compared: not its ends, where surfaces have poles.
PLACES = np.linspace(0.02, 0.98, 9)
#: A normal shorter than this share of the longest one along an edge has no direction.
NO_NORMAL = 1e-8


@dataclass(slots=True)
class EdgeFacts:
    """Kinds (e,), angles (e,) [deg] and faces (e, 2) of the edges of a part, −1 for no face."""

    kind: IntArray
    angle_deg: FloatArray
    faces: IntArray

    def of_faces_from(self, first: int) -> EdgeFacts:
        """The same, with faces counted from ``first``."""
        faces = np.where(self.faces >= 0, self.faces + first, -1)
        return EdgeFacts(self.kind, self.angle_deg, faces)


def edge_facts(
    raws: Sequence[RawFace], count: int, tolerance: float, angle_deg: float
) -> tuple[EdgeFacts, list[float]]:
    """Facts of the ``count`` edges of a part, and the length of free edges of each of its faces.

    Parameters
    ----------
    tolerance : float
        Edges of faces that were never sewn together are one where they are nearer. [file units]
    angle_deg : float
        Two faces meet smoothly when their normals differ by no more anywhere along the edge:
        patches may be off by as much, so that a smaller crease is not to be told from none.

    Returns
    -------
    EdgeFacts, list of float
        Lengths in file units.
    """
    uses = _Uses.of(raws)
    times = np.bincount(uses.edge, minlength=count)
    facts = EdgeFacts(
        np.where(times > 2, NON_MANIFOLD, UNKNOWN), np.full(count, np.nan), np.full((count, 2), -1)
    )
    order = np.argsort(uses.edge, kind="stable")
    first = np.searchsorted(uses.edge[order], np.arange(count))
    for k in (0, 1):
        some = np.flatnonzero(times > k)
        facts.faces[some, k] = uses.face[order[first[some] + k]]
    facts.kind[uses.edge[uses.pole]] = DEGENERATE
    facts.faces[uses.edge[uses.pole]] = -1
    pairs = np.flatnonzero((times == 2) & (facts.kind != DEGENERATE))
    a, b = order[first[pairs]], order[first[pairs] + 1]
    places = np.broadcast_to(PLACES, (len(a), len(PLACES)))
    same = uses.reversed[a] == uses.reversed[b]
    facts.angle_deg[pairs] = _angles(uses, a, places, b, places, same)
    used = np.flatnonzero(times)
    used = used[uses.in_space[order[first[used]]]]
    rows, several = (order[first[some]] for some in (used[times[used] == 1], used[times[used] > 1]))
    own, shared = ([uses.uses[k].edge for k in some.tolist()] for some in (rows, several))
    lone = lone_edges(own, shared, tolerance)
    _met(uses, rows, several, lone, facts)
    known = np.isfinite(facts.angle_deg) & (facts.kind == UNKNOWN)
    facts.kind[known] = np.where(facts.angle_deg[known] <= angle_deg, SMOOTH, SHARP)
    free = np.zeros(len(raws))
    np.add.at(free, uses.face[rows], lone.free)
    return facts, free.tolist()


def _met(uses: _Uses, rows: IntArray, several: IntArray, lone: Lone, facts: EdgeFacts) -> None:
    """Facts of the edges that one face alone uses, which are the ``rows`` of the uses.

    Edges that ``several`` sides of faces share, of which these are the first uses, are non-manifold
    where others lie on them.
    """
    edge = uses.edge[rows]
    free, many = lone.free > 0.0, lone.others > 1
    facts.kind[edge[many]] = NON_MANIFOLD
    facts.kind[edge[free]] = FREE
    rows = np.append(rows, several)
    over = uses.edge[rows[lone.other[lone.other >= len(edge)]]]
    facts.kind[over] = NON_MANIFOLD
    facts.angle_deg[over] = np.nan
    # Of several others that lie on an edge the first one is named.
    facts.faces[edge[lone.edge[::-1]], 1] = uses.face[rows[lone.other[::-1]]]
    some = ~(free | many)[lone.edge]
    a, b = rows[lone.edge[some]], rows[lone.other[some]]
    at, on = lone.at[some], lone.on[some]
    # Edges of their own may run along each other or against.
    along = np.array(
        [
            _direction(uses.uses[i].edge, s) @ _direction(uses.uses[j].edge, t) > 0.0
            for i, j, s, t in zip(a.tolist(), b.tolist(), at[:, 1], on[:, 1], strict=True)
        ],
        dtype=bool,
    )
    same = (uses.reversed[a] == uses.reversed[b]) == along
    angle = _angles(uses, a, at, b, on, same)
    np.fmax.at(facts.angle_deg, uses.edge[a], angle)


def _direction(edge: Edge, share: float) -> FloatArray:
    assert edge.curve is not None
    return edge.curve.slope(np.array([edge.start + share * (edge.end - edge.start)]))[0]


@dataclass(slots=True)
class _Uses:
    """Uses (n,) of edges by faces: edge and face of each, its sense against the face's +normal,
    whether it is a pole, and whether it has a curve in space."""

    uses: list[EdgeUse]
    raws: Sequence[RawFace]
    edge: IntArray
    face: IntArray
    reversed: IntArray
    pole: BoolArray
    in_space: BoolArray

    @classmethod
    def of(cls, raws: Sequence[RawFace]) -> _Uses:
        found = [(i, u) for i, r in enumerate(raws) for loop in r.loops for u in loop]
        table = np.array(
            [(u.edge.index, i, u.reversed ^ raws[i].reversed, u.edge.degenerate) for i, u in found],
            dtype=np.int64,
        ).reshape(-1, 4)
        in_space = np.array([u.edge.curve is not None for _, u in found], dtype=bool)
        edge, face, turned, pole = table.T
        return cls([u for _, u in found], raws, edge, face, turned, pole > 0, in_space)

    def normals(self, rows: IntArray, shares: FloatArray) -> FloatArray:
        """Unit +normals (m, k, 3) of the faces of uses (m,) at shares (m, k) of their edges.

        NaN where there is none, or none can be found.
        """
        try:
            return self._normals(rows, shares)
        except GeometryError:
            if len(rows) == 1:
                return np.full((1, shares.shape[1], 3), np.nan)
            half = len(rows) // 2
            parts = ((rows[:half], shares[:half]), (rows[half:], shares[half:]))
            return np.concatenate([self.normals(*part) for part in parts])

    def _normals(self, rows: IntArray, shares: FloatArray) -> FloatArray:
        out = np.full((*shares.shape, 3), np.nan)
        surfaces: list[Surface] = []
        number: dict[int, int] = {}
        curved, which, flat = [], [], []
        for k, (row, i) in enumerate(zip(rows.tolist(), self.face[rows].tolist(), strict=True)):
            surface = self.raws[i].surface
            if isinstance(surface, Plane):
                flat.append((k, *surface.frame[1], *surface.frame[2]))
            elif surface is not None and self.uses[row].curve is not None:
                if i not in number:
                    number[i] = len(surfaces)
                    surfaces.append(surface)
                curved.append(k)
                which.append(number[i])
        if flat:
            planes = np.array(flat)
            out[planes[:, 0].astype(int)] = cross(planes[:, 1:4], planes[:, 4:])[:, None]
        if curved:
            uv = _places([self.uses[rows[k]] for k in curved], shares[curved])
            _, pu, pv = SurfaceBatch(surfaces).evaluate(np.array(which), uv[..., 0], uv[..., 1])
            n = cross(pu, pv)
            size = length(n)[..., None]
            out[curved] = np.where(
                size > NO_NORMAL * size.max(axis=1, keepdims=True), n / size, np.nan
            )
        turned = np.array([self.raws[i].reversed for i in self.face[rows].tolist()], dtype=bool)
        out[turned] *= -1.0
        return out


def _places(uses: Sequence[EdgeUse], shares: FloatArray) -> FloatArray:
    """(u, v) (m, k, 2) of uses of edges at shares (m, k)."""
    ends = np.array([(u.start, u.end) for u in uses])
    curves = [u.curve for u in uses if u.curve is not None]
    return points_of(curves, ends[:, :1] + np.diff(ends) * shares, 2)


def _angles(
    uses: _Uses, a: IntArray, at: FloatArray, b: IntArray, on: FloatArray, same: BoolArray
) -> FloatArray:
    """Largest angles (m,) [deg] between the normals of uses a and b (m,) at shares of their edges.

    Two faces of one sheet run along their edge in opposite senses; where they do it in the ``same``
    one (m,), one of them is turned over. NaN where no normal is known.
    """
    if not len(a):
        return np.zeros(0)
    n, m = uses.normals(a, at), uses.normals(b, on)
    m = np.where(same[:, None, None], -m, m)
    angle = np.arctan2(length(cross(n, m)), (n * m).sum(axis=2))
    known = np.isfinite(angle)
    return np.where(known.any(axis=1), np.degrees(np.where(known, angle, 0.0).max(axis=1)), np.nan)
