"""Cells in (u, v) of many curved faces lifted to rational bicubic patches at once.

The points S(map(s, t)) times a weight are interpolated at 4 × 4 Chebyshev–Lobatto nodes; with the
weights of circular arcs this reproduces cylinders, cones, spheres and tori, and everything else is
halved until position and normal are within the tolerance.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 13, 16 and 22.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from patchlight.solver.errors import GeometryError
from patchlight.solver.model import bezier
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, split_matrix

from .boxes import Boxes, Leaves, all_leaves
from .cells import Cell
from .chains import LOBATTO, TO_CONTROL
from .compare import CHECK, NODE, Asked, BoolArray, compared, cross
from .joints import mended
from .sides import Sides
from .surfaces import Surface
from .together import SurfaceBatch, rows_of

_BASIS = bernstein(CHECK)
#: From control points to values at the 4 x 4 nodes, and back.
_AT_NODES = np.kron(bernstein(LOBATTO), bernstein(LOBATTO))
_TO_CONTROL = np.kron(TO_CONTROL, TO_CONTROL)
DEEPEST = 9
#: Boxes of one level of a face above which halving ends, or so many for each of its cells: a face
#: with hundreds of holes has thousands of cells before any is halved.
MOST_BOXES = 1000
MOST_OF_CELL = 4
#: Boxes done at a time: of fewer the calls cost more, and the arrays of more leave the cache.
_CACHED_BOXES = 256
#: Halving is of use where it leaves at most this share of the angle; it is given up after so many
#: halvings in vain.
STUCK = 0.8
IN_VAIN = 3
#: Share of the largest Jacobian of a cell up to which a cusp, where two of its sides leave a corner
#: in one direction, has no normal: there is next to no area.
LEAST = 1e-3
#: Rounds in which long sides are cut because short ones cannot follow them.
MENDING = 6


@dataclass(slots=True)
class Task:
    """Cells of a face to be lifted within ``tolerance`` [file units] and ``angle_deg``.

    Boundaries are the rational cubics of the edges wherever these are nearer than ``snap``. Each
    patch keeps its own area within ``area_limit`` relative as well. Boxes that must be cut for
    their boundary are cut the other way at once when ``eager``, else when they are found wanting.
    """

    surface: Surface
    cells: list[Cell]
    tolerance: float
    angle_deg: float
    snap: float
    area_limit: float = np.inf
    eager: bool = False


@dataclass(slots=True)
class Lifted:
    """Patches (n, 4, 4, 4) of a face with their areas (n,) and what was measured on them.

    ``area`` is that of the surface under the patches and ``area_error`` the relative difference,
    both at the check points; ``left_out`` is at how many of these normals do not count.
    """

    nets: FloatArray
    edges: IntArray
    areas: FloatArray
    deviation: float
    angle_deg: float
    gap: float
    converged: bool
    area: float
    area_error: float
    left_out: int


@dataclass(slots=True)
class _Job:
    """All faces of a batch: sides of their cells, what is asked of each face, which ones move, and
    above how many boxes halving ends.

    ``widest`` (cells,) is the largest Jacobian of each cell so far."""

    sides: Sides
    asked: Asked
    moved: BoolArray
    eager: BoolArray
    most: IntArray
    widest: FloatArray

    @classmethod
    def of(cls, tasks: Sequence[Task]) -> tuple[_Job, FloatArray]:
        """The job of some tasks, and the gaps (cells, 4) along edges."""
        if not all(task.cells for task in tasks):
            raise GeometryError("no cell")
        face = np.repeat(np.arange(len(tasks)), [len(task.cells) for task in tasks])
        sides = Sides(
            [c for task in tasks for c in task.cells],
            face,
            SurfaceBatch([t.surface for t in tasks]),
        )
        angle = np.array([t.angle_deg for t in tasks])
        snap = np.array([t.snap for t in tasks])
        gaps, moves = sides.measure_gaps(snap[face], np.radians(angle)[face])
        tolerance = np.array([t.tolerance for t in tasks])
        moved = np.zeros(len(tasks), dtype=bool)
        np.logical_or.at(moved, face, moves > 1e-3 * tolerance[face])
        scale = [next(a for a in t.cells[0].sides if a is not None).scale.prod() for t in tasks]
        asked = Asked(
            tolerance, angle,
            np.array([t.area_limit for t in tasks]), np.array(scale),
            np.zeros(len(tasks)), np.zeros(len(tasks)),
        )  # fmt: skip
        most = np.maximum(MOST_BOXES, MOST_OF_CELL * np.bincount(face))
        eager = np.array([t.eager for t in tasks])
        return cls(sides, asked, moved, eager, most, np.zeros(len(face))), gaps

    def faces(self, boxes: Boxes) -> IntArray:
        """Face of each box."""
        return self.sides.face[boxes.cell]

    def asked_of(self, boxes: Boxes) -> Asked:
        """What is asked of the patch of each box."""
        out = self.asked.take(self.faces(boxes))
        leans = np.degrees(self.sides.leans[boxes.cell])
        out.leans_deg = np.where(self.moved[self.faces(boxes)], leans, 0.0)
        out.least = LEAST * self.widest[boxes.cell] * boxes.area
        return out


def lifted(tasks: Sequence[Task]) -> list[Lifted]:
    """Patches of the cells of some faces, halved until within the tolerances of each face."""
    job, gaps = _Job.of(tasks)
    count = len(tasks)
    n = len(job.sides.face)
    boxes = Boxes.of(np.arange(n), np.tile([0.0, 1.0, 0.0, 1.0], (n, 1)))
    converged = np.ones(count, dtype=bool)
    leaves = _without_joints(job, _refined(job, boxes, converged), converged)
    names = job.sides.edges(leaves.boxes)
    gap = np.zeros(count)
    np.maximum.at(gap, job.sides.face, gaps.max(axis=1))
    areas = bezier.areas(leaves.nets)
    out = []
    for i, rows in rows_of(job.faces(leaves.boxes), np.arange(count)):
        e = leaves.errors[rows]
        area = float(e[:, 2].sum())
        out.append(
            Lifted(
                leaves.nets[rows], names[rows], areas[rows], float(e[:, 0].max()),
                float(e[:, 1].max()), float(gap[i]), bool(converged[i]), area,
                abs(float(e[:, 3].sum())) / max(area, 1e-300), int(e[:, 4].sum()),
            )
        )  # fmt: skip
    return out


def _without_joints(job: _Job, leaves: Leaves, converged: BoolArray) -> Leaves:
    """Leaves after long sides inside a face have met their short neighbours.

    ``converged`` (faces,) is brought up to date in place.
    """
    count = len(converged)
    # Faces with whole cells alone have no long sides beside short ones.
    uncut = (leaves.boxes.box == [0.0, 1.0, 0.0, 1.0]).all(axis=1)
    open_ = np.zeros(count, dtype=bool)
    open_[job.faces(leaves.boxes)[~uncut]] = True
    for round_ in range(MENDING + 1):
        boxes = leaves.boxes
        face = job.faces(boxes)
        pure = leaves.nets.copy()
        follows = mended(
            leaves.nets, np.flatnonzero(open_[face]), face, boxes.cell, boxes.box, job.sides.arcs
        )
        if not follows:
            break
        changed = np.array(sorted(follows), dtype=np.int64)
        again = leaves.take(changed)
        found = compared(again.nets, again.points, again.normals, job.asked_of(again.boxes))
        # Those that missed the angle before no cut of a neighbour can mend.
        limit = job.asked.angle_deg[face[changed]]
        bad = ~found.kept & (again.errors[:, 1] <= limit)
        open_[:] = False
        open_[face[changed[bad]]] = round_ < MENDING
        open_ &= np.bincount(face, minlength=count) <= job.most
        final = ~open_[face[changed]]
        leaves.errors[changed[final]] = found.errors[final]
        np.logical_and.at(converged, face[changed[final]], found.kept[final])
        # Too far for a small patch to go: the long side beside it is cut instead.
        how = np.zeros(len(pure), dtype=np.int64)
        for i in changed[bad & ~final].tolist():
            for owner, side in follows[i]:
                how[owner] |= 1 + side % 2
        cut = how > 0
        if not cut.any():
            break
        redo = np.flatnonzero(open_[face])
        leaves.nets[redo] = pure[redo]
        middle = job.sides.cuts.middles(boxes.cell, boxes.box)
        finer = Boxes.of(boxes.cell[cut], boxes.box[cut]).cut(how[cut], middle[cut])
        leaves = all_leaves([leaves.take(~cut), _refined(job, finer, converged)])
    return leaves


def _refined(job: _Job, boxes: Boxes, converged: BoolArray) -> Leaves:
    """Boxes cut until each is good; ``converged`` (faces,) where all are."""
    out = []
    for depth in range(DEEPEST + 1):
        level = _level(job, boxes)
        face = job.faces(boxes)
        # A kink or cusp of the surface keeps its angle at any size: where the position is far
        # inside the tolerance and halving does not help, going on is of no use.
        errors = level.leaves.errors
        boxes.vain = np.where(errors[:, 1] > STUCK * boxes.before, boxes.vain + 1, 0)
        boxes.before = errors[:, 1]
        last = (depth == DEEPEST) | (np.bincount(face)[face] > job.most[face])
        hopeless = level.whole & (errors[:, 0] <= 0.1 * job.asked.tolerance[face])
        done = level.kept | (hopeless & (boxes.vain >= IN_VAIN)) | last
        np.logical_and.at(converged, face[done], level.kept[done])
        level.leaves.boxes = boxes
        out.append(level.leaves.take(done))
        if done.all():
            break
        boxes = boxes.take(~done).cut(level.split[~done], level.cuts[~done])
    return all_leaves(out)


@dataclass(slots=True)
class _Level:
    """Patches of boxes, and how to go on.

    ``whole`` are boxes whose boundary on an edge is one cubic; ``cuts`` (n, 2) is where to cut.
    """

    leaves: Leaves
    split: IntArray
    kept: BoolArray
    whole: BoolArray
    cuts: FloatArray


def _level(job: _Job, boxes: Boxes) -> _Level:
    """Patches of boxes, compared with the surface."""
    n = len(boxes.cell)
    blocks = [
        _block(job, boxes.take(slice(k, k + _CACHED_BOXES))) for k in range(0, n, _CACHED_BOXES)
    ]
    if len(blocks) == 1:
        return blocks[0]
    arrays = (np.concatenate([getattr(b, name) for b in blocks]) for name in _Level.__slots__[1:])
    return _Level(all_leaves([b.leaves for b in blocks]), *arrays)


def _block(job: _Job, boxes: Boxes) -> _Level:
    sides, box, cell = job.sides, boxes.box, boxes.cell
    face = sides.face[cell]
    s = box[:, :1] + (box[:, 1:2] - box[:, :1]) * CHECK
    t = box[:, 2:3] + (box[:, 3:] - box[:, 2:3]) * CHECK
    uv = sides.coons(cell, s, t)
    p, pu, pv = sides.surfaces.evaluate(face, uv[..., 0], uv[..., 1])
    normals = cross(pu, pv)
    moved = job.moved[face]
    if moved.any():
        p[moved] += sides.shifts(cell[moved], s[moved], t[moved])
    ms, mt = split_matrix(box[:, 0], box[:, 1]), split_matrix(box[:, 2], box[:, 3])
    w = ms @ sides.weights[cell] @ mt.swapaxes(1, 2)
    # Boundary rows are parts of the edges' own cubics, the same for both faces of an edge.
    on = boxes.on_border() & sides.on_edge[cell]
    rows = []
    across = np.zeros(len(box), dtype=np.int64)
    for k, m in enumerate((ms, mt, ms, mt)):
        some = np.flatnonzero(on[:, k])
        axis = k % 2
        net, several = sides.rows(
            cell[some], k, box[some, 2 * axis], box[some, 2 * axis + 1], m[some]
        )
        across[some[several]] |= 1 + axis
        some, net = some[~several], net[~several]
        rows.append((some, net))
        h = _BASIS @ net
        p[_side(some, k, 6)] = h[..., :3] / h[..., 3:]
    n = len(box)
    weight = w.reshape(n, 16) @ _AT_NODES.T
    h = np.empty((n, 16, 4))
    h[..., :3] = p[:, NODE][:, :, NODE].reshape(n, 16, 3) * weight[..., None]
    h[..., 3] = weight
    nets = (_TO_CONTROL @ h).reshape(n, 4, 4, 4)
    nets[..., 3] = w
    for k, (some, net) in enumerate(rows):
        # The weights of a row agree with those of the patch to rounding; its own keep its bits.
        nets[_side(some, k, 3)] = net
    _collapse(nets, sides, boxes)
    found = compared(nets, p, normals, job.asked_of(boxes))
    np.maximum.at(job.widest, cell, found.jacobian / boxes.area)
    whole = across == 0
    split = np.where(whole, found.split, across | np.where(job.eager[face], found.over, 0))
    leaves = Leaves(boxes, nets, found.errors, p, normals)
    return _Level(leaves, split, found.kept & whole, whole, sides.cuts.middles(cell, box))


def _side(some: IntArray, k: int, last: int) -> tuple:
    """Index of side ``k`` of the arrays ``some``, run in the direction of +s or +t."""
    everything = slice(None)
    return (
        (some, everything, 0), (some, last), (some, everything, last), (some, 0)
    )[k]  # fmt: skip


def _collapse(nets: FloatArray, sides: Sides, boxes: Boxes) -> None:
    """Make the points of a collapsed side the same bits."""
    on = boxes.on_border() & sides.collapsed[boxes.cell]
    for k in range(4):
        some = np.flatnonzero(on[:, k])
        if len(some):
            row = nets[_side(some, k, 3)]
            point = row[:, :1, :3] / row[:, :1, 3:]
            row[..., :3] = point * row[..., 3:]
            nets[_side(some, k, 3)] = row
