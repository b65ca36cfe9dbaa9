"""Cells of the (u, v) domain lifted to rational bicubic patches.

A planar cell is the homogeneous Coons patch of its four rational cubic sides, which is exact. On a
curved surface the points S(map(s, t)) times a weight are interpolated at 4 × 4 Chebyshev–Lobatto
nodes; with the weights of circular arcs this reproduces cylinders, cones, spheres and tori, and
everything else is halved until position and normal are within the tolerance.

References
----------
.. [1] G. Farin, "Curves and Surfaces for CAGD", 5th ed., Morgan Kaufmann, 2002, ch. 13, 16 and 22.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, split_matrix

from . import nurbs
from .cells import Cell
from .chains import LOBATTO, TO_CONTROL
from .joints import mended
from .sides import Sides
from .surfaces import Surface

BoolArray = NDArray[np.bool_]
#: Parameters at which a patch is compared with the surface; every other one is a node.
CHECK = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
_NODE = np.array([0, 2, 4, 6])
_BETWEEN = np.array([1, 3, 5])
_BASIS = bernstein(CHECK)
_SLOPE = bernstein_derivative(CHECK)
#: Derivatives and integral over [0, 1] of the polynomials of degree 6 through values at `CHECK`.
_POWERS = CHECK[:, None] ** np.arange(7)
_DERIVATIVE = (
    np.concatenate([np.zeros((7, 1)), _POWERS[:, :6] * np.arange(1, 7)], axis=1)
) @ np.linalg.inv(_POWERS)
_INTEGRAL = (1.0 / np.arange(1, 8)) @ np.linalg.inv(_POWERS)
DEEPEST = 9
#: Boxes of one level above which halving ends.
MOST_BOXES = 1000
#: Rounds in which long sides are cut because short ones cannot follow them.
MENDING = 6


@dataclass(slots=True)
class Lifted:
    """Patches (n, 4, 4, 4) of a face with what was measured on them.

    ``area`` is that of the surface under the patches and ``area_error`` the relative difference,
    both at the check points.
    """

    nets: FloatArray
    edges: IntArray
    deviation: float
    angle_deg: float
    gap: float
    converged: bool
    area: float
    area_error: float


@dataclass(slots=True)
class Boxes:
    """Parts of cells: row of the cell, (s0, s1, t0, t1), and their patches when made."""

    cell: IntArray
    box: FloatArray

    def on_border(self) -> BoolArray:
        """Mask (n, 4) of boxes whose side v=0, u=1, v=1, u=0 lies on that of the cell."""
        s0, s1, t0, t1 = self.box.T
        return np.stack([t0 == 0.0, s1 == 1.0, t1 == 1.0, s0 == 0.0], axis=1)

    def take(self, rows: IntArray) -> Boxes:
        """Some of the boxes."""
        return Boxes(self.cell[rows], self.box[rows])

    def with_(self, other: Boxes) -> Boxes:
        """These boxes and the others."""
        return Boxes(np.append(self.cell, other.cell), np.concatenate([self.box, other.box]))


@dataclass(slots=True)
class _Job:
    """What all boxes of a face have in common; whether the surface moves to meet its edges."""

    surface: Surface
    sides: Sides
    moves: bool
    tolerance: float
    angle_deg: float
    area_limit: float
    eager: bool


def planar_net(cell: Cell) -> FloatArray:
    """Homogeneous Coons net (4, 4, 4) of a planar cell. [1, sec. 22.1]"""
    rows: list[FloatArray] = []
    for k, arc in enumerate(cell.sides):
        if arc is None:
            before = cell.sides[k - 1]
            assert before is not None and before.net is not None
            rows.append(np.broadcast_to(before.net[3], (4, 4)))
        else:
            assert arc.net is not None
            rows.append(arc.net)
    c, right, d, left = rows[0], rows[1], rows[2][::-1], rows[3][::-1]
    t = (np.arange(4) / 3.0)[None, :, None]
    s = (np.arange(4) / 3.0)[:, None, None]
    ruled = (1 - t) * c[:, None] + t * d[:, None] + (1 - s) * left[None] + s * right[None]
    corner = (1 - s) * ((1 - t) * c[0] + t * d[0]) + s * ((1 - t) * c[3] + t * d[3])
    net = np.asarray(ruled - corner)
    net[:, 0], net[:, 3], net[0], net[3] = c, d, left, right
    return net


def lifted(
    surface: Surface,
    cells: list[Cell],
    tolerance: float,
    angle_deg: float,
    snap: float,
    area_limit: float = np.inf,
    *,
    eager: bool = False,
) -> Lifted:
    """Patches of the cells, halved until within ``tolerance`` [file units] and ``angle_deg``.

    Boundaries are the rational cubics of the edges wherever these are nearer than ``snap``. Each
    patch keeps its own area within ``area_limit`` relative as well. Boxes that must be cut for
    their boundary are cut the other way at once when ``eager``, else when they are found wanting.
    """
    if not cells:
        raise GeometryError("no cell")
    sides = Sides(cells)
    gaps, moves = sides.measure_gaps(surface, snap)
    moves &= bool(gaps[sides.on_edge].max(initial=0.0) > 1e-3 * tolerance)
    job = _Job(surface, sides, moves, tolerance, angle_deg, area_limit, eager)
    boxes = Boxes(np.arange(len(cells)), np.tile([0.0, 1.0, 0.0, 1.0], (len(cells), 1)))
    leaves, every, error, converged = _refined(job, boxes)
    for round_ in range(MENDING + 1):
        pure = every.copy()
        follows = mended(every, leaves.cell, leaves.box, sides.arcs)
        if not follows:
            break
        changed = np.array(sorted(follows))
        again = _level(job, leaves.take(changed), every[changed])
        bad = changed[~again.kept & (error[changed, 1] <= angle_deg)]
        if not len(bad) or not converged or round_ == MENDING or len(every) > MOST_BOXES:
            error = error.copy()
            error[changed] = again.errors
            converged &= bool(again.kept.all())
            break
        # Too far for a small patch to go: the long side beside it is cut instead.
        how = np.zeros(len(every), dtype=np.int64)
        for i in bad.tolist():
            for owner, side in follows[i]:
                how[owner] |= 1 + side % 2
        cut = how > 0
        middle = 0.5 * (leaves.box[:, ::2] + leaves.box[:, 1::2])
        finer, nets, errors, fine = _refined(job, _cut(leaves, how, middle, cut))
        converged &= fine
        keep = np.flatnonzero(~cut)
        leaves = leaves.take(keep).with_(finer)
        every = np.concatenate([pure[keep], nets])
        error = np.concatenate([error[keep], errors])
    names = np.where(leaves.on_border(), sides.names[leaves.cell], -1)
    area = float(error[:, 2].sum())
    return Lifted(
        every, names, float(error[:, 0].max()), float(error[:, 1].max()),
        float(gaps.max()), converged, area, abs(float(error[:, 3].sum())) / max(area, 1e-300),
    )  # fmt: skip


def _refined(job: _Job, boxes: Boxes) -> tuple[Boxes, FloatArray, FloatArray, bool]:
    """Boxes cut until each is good, their patches and errors, and whether all are."""
    leaves, nets, errors, converged = [], [], [], True
    for depth in range(DEEPEST + 1):
        level = _level(job, boxes)
        # A kink or cusp of the surface keeps its angle at any size: where the position is far
        # inside the tolerance, halving on is of no use.
        last = depth == DEEPEST or len(boxes.cell) > MOST_BOXES
        hopeless = level.whole & (level.errors[:, 0] <= 0.1 * job.tolerance) & (depth >= 4)
        done = np.logical_or(level.kept, hopeless) | last
        converged &= bool(level.kept[done].all())
        nets.append(level.nets[done])
        errors.append(level.errors[done])
        leaves.append(boxes.take(np.flatnonzero(done)))
        if done.all():
            break
        boxes = _cut(boxes, level.split, level.cuts, ~done)
    every = Boxes(np.concatenate([b.cell for b in leaves]), np.concatenate([b.box for b in leaves]))
    return every, np.concatenate(nets), np.concatenate(errors), converged


def _cut(boxes: Boxes, split: IntArray, cuts: FloatArray, which: BoolArray) -> Boxes:
    """Boxes cut in s (1), in t (2) or in both (3) at ``cuts`` (n, 2)."""
    cells, out = [], []
    rows = np.flatnonzero(which)
    for c, (s0, s1, t0, t1), how, (s, t) in zip(
        boxes.cell[rows].tolist(),
        boxes.box[rows].tolist(),
        split[rows].tolist(),
        cuts[rows].tolist(),
        strict=True,
    ):
        ss = [s0, s, s1] if how & 1 else [s0, s1]
        tt = [t0, t, t1] if how & 2 else [t0, t1]
        for a, b in zip(ss[:-1], ss[1:], strict=True):
            for d, e in zip(tt[:-1], tt[1:], strict=True):
                cells.append(c)
                out.append((a, b, d, e))
    return Boxes(np.array(cells), np.array(out))


@dataclass(slots=True)
class _Level:
    """Patches of boxes; ``errors``: distance, angle [deg], area and its error; how to go on.

    ``whole`` are boxes whose boundary on an edge is one cubic; ``cuts`` (n, 2) is where to cut,
    ``over`` the directions in which the tolerance is missed.
    """

    nets: FloatArray
    errors: FloatArray
    split: IntArray
    kept: BoolArray
    whole: BoolArray
    cuts: FloatArray
    over: IntArray


def _level(job: _Job, boxes: Boxes, made: FloatArray | None = None) -> _Level:
    """Patches of boxes, or those already ``made``, compared with the surface."""
    sides, box, cell = job.sides, boxes.box, boxes.cell
    s = box[:, :1] + (box[:, 1:2] - box[:, :1]) * CHECK
    t = box[:, 2:3] + (box[:, 3:] - box[:, 2:3]) * CHECK
    uv = sides.coons(cell, s, t)
    p, pu, pv = job.surface.evaluate(uv[..., 0], uv[..., 1])
    p = p.copy()
    if job.moves:
        p += sides.shifts(job.surface, cell, s, t)
    ms, mt = split_matrix(box[:, 0], box[:, 1]), split_matrix(box[:, 2], box[:, 3])
    w = ms @ sides.weights[cell] @ mt.swapaxes(1, 2)
    # Boundary rows are parts of the edges' own cubics, the same for both faces of an edge.
    on = boxes.on_border() & sides.on_edge[cell]
    rows = []
    # Where boxes are cut in s and in t; a boundary of several cubics is cut where they meet.
    cuts = 0.5 * (box[:, ::2] + box[:, 1::2])
    across = np.zeros(len(box), dtype=np.int64)
    for k, m in enumerate((ms, mt, ms, mt)):
        some = np.flatnonzero(on[:, k])
        axis = k % 2
        net, cut = sides.rows(cell[some], k, box[some, 2 * axis], box[some, 2 * axis + 1], m[some])
        several = np.isfinite(cut)
        across[some[several]] |= 1 + axis
        cuts[some[several], axis] = cut[several]
        some, net = some[~several], net[~several]
        rows.append((some, net))
        h = np.einsum("ai,nij->naj", _BASIS, net)
        p[_side(some, k, 6)] = h[..., :3] / h[..., 3:]
    at_nodes = bernstein(LOBATTO)
    weight = np.einsum("ai,bj,nij->nab", at_nodes, at_nodes, w, optimize=True)
    h = np.empty((len(box), 4, 4, 4))
    h[..., :3] = p[:, _NODE][:, :, _NODE] * weight[..., None]
    h[..., 3] = weight
    nets = np.einsum("ia,jb,nabk->nijk", TO_CONTROL, TO_CONTROL, h, optimize=True)
    nets[..., 3] = w
    for k, (some, net) in enumerate(rows):
        # The weights of a row agree with those of the patch to rounding; its own keep its bits.
        nets[_side(some, k, 3)] = net
    _collapse(nets, sides, boxes)
    if made is not None:
        nets = made
    out = _measured(nets, p, pu, pv, job.tolerance, job.angle_deg, job.area_limit, job.moves)
    out.cuts = cuts
    out.whole = across == 0
    out.split = np.where(out.whole, out.split, across | (out.over if job.eager else 0))
    out.kept &= out.whole
    return out


def _side(some: IntArray, k: int, last: int) -> tuple:
    """Index of side ``k`` of the arrays ``some``, run in the direction of +s or +t."""
    everything = slice(None)
    return (
        (some, everything, 0), (some, last), (some, everything, last), (some, 0)
    )[k]  # fmt: skip


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angles between unit vectors (..., 3). [deg]"""
    chord = np.linalg.norm(a - b, axis=-1)
    return np.asarray(2.0 * np.degrees(np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))))


def _measured(
    nets: FloatArray,
    p: FloatArray,
    pu: FloatArray,
    pv: FloatArray,
    tolerance: float,
    angle_deg: float,
    area_limit: float,
    moved: bool,
) -> _Level:
    """Patches compared with the points and tangents of the surface at `CHECK`."""
    q = np.einsum("ai,bj,nijk->nabk", _BASIS, _BASIS, nets, optimize=True)
    qs = np.einsum("ai,bj,nijk->nabk", _SLOPE, _BASIS, nets, optimize=True)
    qt = np.einsum("ai,bj,nijk->nabk", _BASIS, _SLOPE, nets, optimize=True)
    x = q[..., :3] / q[..., 3:]
    xs = (qs[..., :3] - qs[..., 3:] * x) / q[..., 3:]
    xt = (qt[..., :3] - qt[..., 3:] * x) / q[..., 3:]
    n_patch, n_face = np.cross(xs, xt), np.cross(pu, pv)
    a, b = np.linalg.norm(n_patch, axis=-1), np.linalg.norm(n_face, axis=-1)
    a_max = a.max(axis=(1, 2), keepdims=True)
    scale = float((np.linalg.norm(pu, axis=-1) * np.linalg.norm(pv, axis=-1)).max())
    ok = (a > 1e-3 * a_max) & (b > 1e-6 * scale)
    n_face = n_face / np.where(b > 0.0, b, 1.0)[..., None]
    n_patch = n_patch / np.where(a > 0.0, a, 1.0)[..., None]
    off = x - p
    distance = np.where(ok, np.abs(np.einsum("nabk,nabk->nab", off, n_face)), 0.0)
    # On the border and where no normal is reliable the distance itself counts; along the border
    # sliding on the curve is harmless.
    for row, tangent in (
        (np.s_[:, :, 0], xs), (np.s_[:, :, 6], xs), (np.s_[:, 0, :], xt), (np.s_[:, 6, :], xt),
    ):  # fmt: skip
        d, o = tangent[row], off[row]
        length = np.linalg.norm(d, axis=-1, keepdims=True)
        d = d / np.where(length > 0.0, length, 1.0)
        o = o - np.einsum("nak,nak->na", o, d)[..., None] * d
        distance[row] = np.linalg.norm(o, axis=-1)
    angle = np.where(ok, _angles(n_patch, n_face), 0.0)
    ps = np.einsum("ca,nabk->ncbk", _DERIVATIVE, p)
    pt = np.einsum("cb,nabk->nack", _DERIVATIVE, p)
    normal = np.cross(ps, pt)
    wanted = np.linalg.norm(normal, axis=-1)
    # Where the surface was moved to its edges no halving brings its own normal back.
    bent = angle
    if moved:
        normal = normal / np.where(wanted > 0.0, wanted, 1.0)[..., None]
        bent = np.where(ok & (wanted > 0.0), np.minimum(angle, _angles(n_patch, normal)), 0.0)
    measure = np.maximum(distance / tolerance, bent / angle_deg)
    area = np.einsum("a,nab,b->n", _INTEGRAL, wanted, _INTEGRAL)
    excess = np.einsum("a,nab,b->n", _INTEGRAL, a - wanted, _INTEGRAL)
    in_s = measure[:, _BETWEEN][:, :, _NODE].max(axis=(1, 2))
    in_t = measure[:, _NODE][:, :, _BETWEEN].max(axis=(1, 2))
    split = np.where(in_s > 4.0 * in_t, 1, np.where(in_t > 4.0 * in_s, 2, 3))
    over = (in_s > 1.0).astype(np.int64) + 2 * (in_t > 1.0)
    errors = np.stack([distance.max(axis=(1, 2)), angle.max(axis=(1, 2)), area, excess], axis=1)
    extent = np.ptp(x.reshape(len(nets), -1, 3), axis=1).max(axis=1)
    kept = measure.max(axis=(1, 2)) <= 1.0
    if np.isfinite(area_limit):
        kept &= np.abs(excess) <= area_limit * np.abs(area)
    kept |= (errors[:, 0] <= tolerance) & (extent < 10.0 * tolerance)
    whole = np.ones(len(nets), dtype=bool)
    return _Level(nets, errors, split, kept, whole, np.empty((0, 2)), over)


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


def spline_nets(surface_pieces: FloatArray, u_cuts: list, v_cuts: list) -> FloatArray:
    """Exact bicubic nets of Bézier pieces of degree <= 3 restricted to local boxes.

    ``u_cuts`` and ``v_cuts`` list (piece, local start, local end).
    """
    out = []
    for i, a, b in u_cuts:
        for j, c, d in v_cuts:
            part = nurbs.restricted(surface_pieces[i, j], a, b)
            part = np.swapaxes(nurbs.restricted(np.swapaxes(part, 0, 1), c, d), 0, 1)
            up, vp = nurbs.elevation(part.shape[0] - 1), nurbs.elevation(part.shape[1] - 1)
            net = np.einsum("ai,bj,ijk->abk", up, vp, part)
            out.append(net / net[..., 3].max())
    return np.array(out)
