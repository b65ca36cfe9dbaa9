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
from patchlight.solver.errors import GeometryError
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.model.bezier import bernstein, bernstein_derivative, split_matrix

from . import nurbs
from .arcs import Arc, NetArc
from .cells import Cell
from .chains import LOBATTO, TO_CONTROL
from .surfaces import Surface

#: Parameters at which a patch is compared with the surface; every other one is a node.
CHECK = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
_NODE = np.array([0, 2, 4, 6])
_BETWEEN = np.array([1, 3, 5])
_BASIS = bernstein(CHECK)
_SLOPE = bernstein_derivative(CHECK)
DEEPEST = 7


@dataclass(slots=True)
class Lifted:
    """Patches (n, 4, 4, 4) of a face with what was measured on them."""

    nets: FloatArray
    edges: IntArray
    deviation: float
    angle_deg: float
    gap: float
    converged: bool


def planar_net(cell: Cell) -> FloatArray:
    """Homogeneous Coons net (4, 4, 4) of a planar cell. [1, sec. 22.1]"""
    rows: list[FloatArray] = []
    for k, arc in enumerate(cell.sides):
        if arc is None:
            before = cell.sides[k - 1]
            after = cell.sides[(k + 1) % 4]
            point = before.net[3] if isinstance(before, NetArc) else after.net[0]  # type: ignore[union-attr]
            rows.append(np.broadcast_to(point, (4, 4)))
        else:
            assert isinstance(arc, NetArc)
            rows.append(arc.net)
    c, right, d, left = rows[0], rows[1], rows[2][::-1], rows[3][::-1]
    t = (np.arange(4) / 3.0)[None, :, None]
    s = (np.arange(4) / 3.0)[:, None, None]
    ruled = (1 - t) * c[:, None] + t * d[:, None] + (1 - s) * left[None] + s * right[None]
    corner = (1 - s) * ((1 - t) * c[0] + t * d[0]) + s * ((1 - t) * c[3] + t * d[3])
    net = np.asarray(ruled - corner)
    net[:, 0], net[:, 3], net[0], net[3] = c, d, left, right
    return net


def cell_weights(cell: Cell) -> FloatArray:
    """Weights (4, 4) blended from the sides; a product of arcs when opposite sides agree."""
    one = np.ones(4)
    w = [one if a is None else a.weights for a in cell.sides]
    # A collapsed side takes part in the blend with the weights of the side opposite to it.
    for k in range(4):
        if cell.sides[k] is None and cell.sides[(k + 2) % 4] is not None:
            w[k] = w[(k + 2) % 4][::-1]
    c, right, d, left = w[0], w[1], w[2][::-1], w[3][::-1]
    f = np.arange(4) / 3.0
    along = (1 - f)[None, :] * c[:, None] + f[None, :] * d[:, None]
    across = (1 - f)[:, None] * left[None, :] + f[:, None] * right[None, :]
    return np.asarray(along * across)


def _side(cell: Cell, k: int, s: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """(u, v) and, on an edge, space points of side k, run in the direction of +u or +v."""
    arc = cell.sides[k]
    if arc is None:
        before, after = cell.sides[k - 1], cell.sides[(k + 1) % 4]
        end = np.array([1.0])
        point = before.at(end) if before is not None else after.at(1.0 - end)  # type: ignore[union-attr]
        return np.broadcast_to(point[0], (*s.shape, 2)), None
    run = s if k < 2 else 1.0 - s
    return arc.at(run), arc.space(run)


def coons(cell: Cell, s: FloatArray, t: FloatArray) -> tuple[FloatArray, list]:
    """(u, v) of boxes: ``s`` (n, a), ``t`` (n, b) -> (n, a, b, 2), and the sides' space points."""
    c, x0 = _side(cell, 0, s)
    d, x1 = _side(cell, 2, s)
    right, y1 = _side(cell, 1, t)
    left, y0 = _side(cell, 3, t)
    ends = np.array([0.0, 1.0])
    cc, dd = _side(cell, 0, ends)[0], _side(cell, 2, ends)[0]
    s_, t_ = s[:, :, None, None], t[:, None, :, None]
    m = (1 - t_) * c[:, :, None] + t_ * d[:, :, None]
    m = m + (1 - s_) * left[:, None] + s_ * right[:, None]
    m = m - (1 - s_) * ((1 - t_) * cc[0] + t_ * dd[0]) - s_ * ((1 - t_) * cc[1] + t_ * dd[1])
    return np.asarray(m), [x0, y1, x1, y0]


def lifted(
    surface: Surface, cells: list[Cell], tolerance: float, angle_deg: float, snap: float
) -> Lifted:
    """Patches of the cells, halved until within ``tolerance`` [file units] and ``angle_deg``.

    Boundary points are moved onto the edge in space when they are nearer to it than ``snap``.
    """
    nets, edges = [], []
    worst, worst_angle, gap, converged = 0.0, 0.0, 0.0, True
    for cell in cells:
        base = cell_weights(cell)
        names = np.array(cell.edges)
        boxes = np.array([[0.0, 1.0, 0.0, 1.0]])
        for depth in range(DEEPEST + 1):
            n, e, g, split, kept = _level(surface, cell, base, boxes, tolerance, angle_deg, snap)
            # A kink or cusp of the surface keeps its angle at any size: where the position is far
            # inside the tolerance, halving on is of no use.
            last = depth == DEEPEST or len(boxes) > 1000
            hopeless = np.logical_and(e[:, 0] <= 0.1 * tolerance, depth >= 4)
            done = np.logical_or(kept, hopeless) | last
            converged &= bool(kept[done].all())
            nets.append(n[done])
            if done.any():
                worst = max(worst, float(e[done, 0].max()))
                worst_angle = max(worst_angle, float(e[done, 1].max()))
                gap = max(gap, float(g[done].max()))
            b = boxes[done]
            on = np.stack([b[:, 2] == 0.0, b[:, 1] == 1.0, b[:, 3] == 1.0, b[:, 0] == 0.0], axis=1)
            edges.append(np.where(on, names, -1))
            if done.all():
                break
            boxes = _halved(boxes[~done], split[~done])
    if not nets:
        raise GeometryError("no cell")
    return Lifted(np.concatenate(nets), np.concatenate(edges), worst, worst_angle, gap, converged)


def _halved(boxes: FloatArray, split: FloatArray) -> FloatArray:
    """Boxes cut in s (1), in t (2) or in both (3)."""
    out = []
    for (s0, s1, t0, t1), how in zip(boxes.tolist(), split.tolist(), strict=True):
        ss = [s0, 0.5 * (s0 + s1), s1] if how & 1 else [s0, s1]
        tt = [t0, 0.5 * (t0 + t1), t1] if how & 2 else [t0, t1]
        for a, b in zip(ss[:-1], ss[1:], strict=True):
            for c, d in zip(tt[:-1], tt[1:], strict=True):
                out.append((a, b, c, d))
    return np.array(out)


def _level(
    surface: Surface,
    cell: Cell,
    base: FloatArray,
    boxes: FloatArray,
    tolerance: float,
    angle_deg: float,
    snap: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Nets, (deviation, angle), gaps, split direction and acceptance of each box."""
    s = boxes[:, :1] + (boxes[:, 1:2] - boxes[:, :1]) * CHECK
    t = boxes[:, 2:3] + (boxes[:, 3:] - boxes[:, 2:3]) * CHECK
    uv, sides = coons(cell, s, t)
    p, pu, pv = surface.evaluate(uv[..., 0], uv[..., 1])
    gap = np.zeros(len(boxes))
    p = p.copy()
    for k, x in enumerate(sides):
        if x is None:
            continue
        on = boxes[:, (2, 1, 3, 0)[k]] == (0.0, 1.0, 1.0, 0.0)[k]
        row = (np.s_[:, :, 0], np.s_[:, 6, :], np.s_[:, :, 6], np.s_[:, 0, :])[k]
        shift = np.where(on[:, None, None], x - p[row], 0.0)
        distance = np.linalg.norm(shift, axis=-1).max(axis=1)
        gap = np.maximum(gap, distance)
        shift[distance > snap] = 0.0
        p[row] += shift
    w = np.empty((len(boxes), 4, 4))
    for b, (s0, s1, t0, t1) in enumerate(boxes.tolist()):
        w[b] = (
            base
            if s1 - s0 == 1.0 == t1 - t0
            else (split_matrix(s0, s1) @ base @ split_matrix(t0, t1).T)
        )
    at_nodes = bernstein(LOBATTO)
    weight = np.einsum("ai,bj,nij->nab", at_nodes, at_nodes, w)
    h = np.empty((len(boxes), 4, 4, 4))
    h[..., :3] = p[:, _NODE][:, :, _NODE] * weight[..., None]
    h[..., 3] = weight
    nets = np.einsum("ia,jb,nabk->nijk", TO_CONTROL, TO_CONTROL, h)
    nets[..., 3] = w
    _collapse(nets, cell, boxes)

    q = np.einsum("ai,bj,nijk->nabk", _BASIS, _BASIS, nets)
    qs = np.einsum("ai,bj,nijk->nabk", _SLOPE, _BASIS, nets)
    qt = np.einsum("ai,bj,nijk->nabk", _BASIS, _SLOPE, nets)
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
    chord = np.linalg.norm(n_patch - n_face, axis=-1)
    angle = np.where(ok, 2.0 * np.degrees(np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))), 0.0)
    measure = np.maximum(distance / tolerance, angle / angle_deg)
    in_s = measure[:, _BETWEEN][:, :, _NODE].max(axis=(1, 2))
    in_t = measure[:, _NODE][:, :, _BETWEEN].max(axis=(1, 2))
    split = np.where(in_s > 4.0 * in_t, 1, np.where(in_t > 4.0 * in_s, 2, 3))
    errors = np.stack([distance.max(axis=(1, 2)), angle.max(axis=(1, 2))], axis=1)
    extent = np.ptp(x.reshape(len(boxes), -1, 3), axis=1).max(axis=1)
    kept = (measure.max(axis=(1, 2)) <= 1.0) | (
        (errors[:, 0] <= tolerance) & (extent < 10.0 * tolerance)
    )
    return nets, errors, gap, split, kept


def _collapse(nets: FloatArray, cell: Cell, boxes: FloatArray) -> None:
    """Make the points of a collapsed side the same bits."""
    for k, column in enumerate((2, 1, 3, 0)):
        if cell.sides[k] is not None:
            continue
        on = boxes[:, column] == (0.0, 1.0, 1.0, 0.0)[k]
        row = (np.s_[on, :, 0], np.s_[on, 3, :], np.s_[on, :, 3], np.s_[on, 0, :])[k]
        side = nets[row]
        point = side[:, :1, :3] / side[:, :1, 3:]
        side[..., :3] = point * side[..., 3:]
        nets[row] = side


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


def boundary_of(cells: list[Cell]) -> list[Arc]:
    """All sides of cells that lie on an edge."""
    return [a for c in cells for a in c.sides if a is not None and a.edge >= 0]
