"""Where the boxes of cells are cut: at the same places on both sides of every line inside a face.

Neighbours that are cut at different places of their common line have sides of which none is a part
of the other, and no cubic is the same on both. So a place where one cell must be cut, a knot of its
surface or a joint of the cubics on its border, is one of its neighbour as well, and of the
neighbour's neighbour across the opposite side.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

from . import nurbs
from .arcs import Arc, Chord
from .together import rows_of

Key = tuple[float, ...]
#: A cell and the direction in which it is cut: 0 for s, 1 for t.
Way = tuple[int, int]
#: Places closer than this are one.
SAME = 1e-9


def line_of(face: int, arc: Chord) -> tuple[Key, bool]:
    """What is the same for both cells beside a chord of a face, and whether it runs backwards."""
    p, q = tuple(arc.p.tolist()), tuple(arc.q.tolist())
    return ((face, *p, *q), False) if p <= q else ((face, *q, *p), True)


class Cuts:
    """Places where boxes of cells are cut rather than in their middle.

    Parameters
    ----------
    own : dict
        By (cell, direction): the places strictly inside [0, 1] where that cell should be cut.
    face : (n,) int array
        Number of the face of each cell.
    arcs : list
        The four sides of each cell, run in the direction of +s or +t.
    """

    def __init__(
        self, own: dict[Way, list[FloatArray]], face: IntArray, arcs: list[list[Arc | None]]
    ) -> None:
        found = _spread(own, _neighbours(face, arcs)) if own else {}
        #: By direction: the cells that have places, and these.
        self._cells: list[IntArray] = []
        self._places: list[list[FloatArray]] = []
        for k in (0, 1):
            cells = sorted(c for c, way in found if way == k)
            self._cells.append(np.array(cells, dtype=np.int64))
            self._places.append([found[c, k] for c in cells])

    def middles(self, cell: IntArray, box: FloatArray) -> FloatArray:
        """Where in s and in t (n, 2) to cut boxes (n, 4): at the place next to their middle."""
        out = 0.5 * (box[:, ::2] + box[:, 1::2])
        for k, (cells, places) in enumerate(zip(self._cells, self._places, strict=True)):
            for i, rows in rows_of(cell, cells):
                low, high = box[rows, 2 * k], box[rows, 2 * k + 1]
                out[rows, k] = nurbs.middles(low, high, places[i])
        return out


def _neighbours(face: IntArray, arcs: list[list[Arc | None]]) -> dict[Way, list[tuple[Way, bool]]]:
    """Cells along a common chord, and whether that runs backwards in the other one."""
    lines: dict[Key, list[tuple[Way, bool]]] = defaultdict(list)
    for c, (f, row) in enumerate(zip(face.tolist(), arcs, strict=True)):
        for k, arc in enumerate(row):
            if isinstance(arc, Chord) and arc.net is None:
                line, backwards = line_of(f, arc)
                lines[line].append(((c, k % 2), backwards))
    out: dict[Way, list[tuple[Way, bool]]] = defaultdict(list)
    for uses in lines.values():
        if len(uses) == 2:
            (a, first), (b, second) = uses
            out[a].append((b, first != second))
            out[b].append((a, first != second))
    return out


def _spread(
    own: dict[Way, list[FloatArray]], neighbours: dict[Way, list[tuple[Way, bool]]]
) -> dict[Way, FloatArray]:
    """Places of all cells of a strip, whose lines run across it, given to each one of them."""
    out: dict[Way, FloatArray] = {}
    for start in own:
        if start in out:
            continue
        strip: dict[Way, bool] = {start: False}
        queue = [start]
        for way in queue:
            for other, turned in neighbours.get(way, ()):
                if other not in strip:
                    strip[other] = strip[way] != turned
                    queue.append(other)
        places = np.concatenate(
            [1.0 - x if strip[way] else x for way in queue for x in own.get(way, ())]
        )
        places = np.sort(places)
        places = places[np.diff(places, prepend=-1.0) > SAME]
        for way, backwards in strip.items():
            out[way] = 1.0 - places[::-1] if backwards else places
    return out
