"""Form factors of elements spread over the unknowns that they carry.

Light that leaves an element varies over it: between the values B_k at its inset nodes it is
interpolated by the Lagrange polynomials φ_k through them. What a receiver gets of the element is
Σ_k B_k ∫ φ_k K V dA with K = cosθ_r cosθ_s / (π r²). The sum of these moments is the form factor,
which is known exactly; how it divides among the nodes is taken from the unoccluded kernel: from the
nodes themselves where the element is far away, from 4 x 4 Gauss points where it is nearer, and from
4 x 4 points in each of its parts, halved until they are small against their distance, where it is
near.

The order of the rules follows from the nearest pole of the kernel: Gauss' rule with q nodes on an
interval of length h leaves about ρ^(−2q) with ρ = t + √(1 + t²), t = 2 d / h, of a function with a
pole at distance d [1].

References
----------
.. [1] L. N. Trefethen, "Approximation Theory and Approximation Practice", SIAM, 2013, theorem 19.3.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import lean, parallel
from .contour import shift_net
from .nets import facing_at, weight_at

#: How often an element is halved at most, and parts that wait for it.
DEPTH, ROOM = 14, 32


class Basis(NamedTuple):
    """Nodes that carry the unknowns; those of one element follow one another.

    Attributes
    ----------
    start : (n + 1,) int array
        First unknown of each element.
    pieces : (n,) int array
        Equal pieces along u and v on each of which light is interpolated: 1, or 2 where it is known
        more finely; 0 for elements without all of their nodes, each of which then stands for its
        share of the area.
    rule : (k,) array
        Abscissae of the nodes along u and v in a piece, 0 … 1; nodes are in order of u, then v.
    points, vectors : (N, 3) array
        Nodes [m], and the area vectors they stand for [m²].
    share : (N,) array
        Share of each in the area of its element.
    at : (2, g, 4 k²) array
        Polynomials of one piece (k² of them) and of 2 x 2 at the Gauss points of
        `edges.Edges.area_point`.
    gauss, weight : (g',) arrays
        Gauss' rule along u and v in the parts of near elements.
    """

    start: np.ndarray
    pieces: np.ndarray
    rule: np.ndarray
    points: np.ndarray
    vectors: np.ndarray
    share: np.ndarray
    at: np.ndarray
    gauss: np.ndarray
    weight: np.ndarray


@lean
def exchange(x, n, px, py, pz, ax, ay, az):
    """Form factor of a small area vector at a point, without 1/π; 0 where it is not seen."""
    rx, ry, rz = px - x[0], py - x[1], pz - x[2]
    up = n[0] * rx + n[1] * ry + n[2] * rz
    towards = -(ax * rx + ay * ry + az * rz)
    square = rx * rx + ry * ry + rz * rz
    if up <= 0.0 or towards <= 0.0 or square <= 1e-100:
        return 0.0
    return up * towards / (square * square)


@lean
def _lagrange(rule, pieces, t, values):
    """Polynomials through the abscissae ``rule`` of the piece that holds ``t``; returns which."""
    piece = min(int(t * pieces), pieces - 1)
    local = t * pieces - piece
    for a in range(rule.shape[0]):
        value = 1.0
        for b in range(rule.shape[0]):
            if b != a:
                value *= (local - rule[b]) / (rule[a] - rule[b])
        values[a] = value
    return piece


@lean
def _from_nodes(x, n, first, last, basis, moments):
    """Moments from the nodes alone."""
    for k in range(first, last):
        p, a = basis.points[k], basis.vectors[k]
        moments[k - first] = exchange(x, n, p[0], p[1], p[2], a[0], a[1], a[2])


@lean
def point_exchange(x, n, j, g, sources):
    """`exchange` with what Gauss point ``g`` of element ``j`` stands for."""
    origin = sources.edge_origin
    return exchange(
        x,
        n,
        sources.area_point[0, j, g] + origin[0],
        sources.area_point[1, j, g] + origin[1],
        sources.area_point[2, j, g] + origin[2],
        sources.area_normal[0, j, g],
        sources.area_normal[1, j, g],
        sources.area_normal[2, j, g],
    )


@lean
def _from_points(x, n, j, sources, at, count, moments):
    """Moments from the Gauss points of the element."""
    for k in range(count):
        moments[k] = 0.0
    for g in range(at.shape[0]):
        value = point_exchange(x, n, j, g, sources)
        if value > 0.0:
            for k in range(count):
                moments[k] += at[g, k] * value


@lean
def _distance(s, u, v, h):
    """Distance of the point at (u, v) of a shifted net, which is left in ``h``."""
    ru, rv = 1.0 - u, 1.0 - v
    b = (ru * ru * ru, 3.0 * u * ru * ru, 3.0 * u * u * ru, u * u * u)
    c = (rv * rv * rv, 3.0 * v * rv * rv, 3.0 * v * v * rv, v * v * v)
    h[0] = h[1] = h[2] = 0.0
    for i in range(4):
        for j in range(4):
            weight = b[i] * c[j]
            h[0] += weight * s[i, j, 0]
            h[1] += weight * s[i, j, 1]
            h[2] += weight * s[i, j, 2]
    w = weight_at(s, u, v)
    h[0] /= w
    h[1] /= w
    h[2] /= w
    return math.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)


@lean
def _apart(a, b):
    """Distance of two points."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@lean
def _from_parts(s, n, near, pieces, basis, work, moments):
    """Moments from the parts of a shifted net, each small against its distance.

    A part that is halved `DEPTH` times is taken as it is: it then is a 16 384th of the element.
    """
    k = basis.rule.shape[0]
    along = k * pieces
    h, hu, hv, other = work.h, work.hu, work.hv, work.other
    for m in range(along * along):
        moments[m] = 0.0
    stack, left = work.stack, pieces * pieces
    for m in range(left):
        a, b = m // pieces, m % pieces
        stack[m, 0], stack[m, 1] = a / pieces, (a + 1) / pieces
        stack[m, 2], stack[m, 3], stack[m, 4] = b / pieces, (b + 1) / pieces, 0.0
    while left > 0:
        left -= 1
        u0, u1, v0, v1 = stack[left, 0], stack[left, 1], stack[left, 2], stack[left, 3]
        depth = stack[left, 4]
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        away = _distance(s, um, vm, h)
        _distance(s, u0, vm, hu)
        _distance(s, u1, vm, other)
        along_u = _apart(hu, other)
        _distance(s, um, v0, hu)
        _distance(s, um, v1, other)
        along_v = _apart(hu, other)
        reach = 0.5 * math.sqrt(along_u * along_u + along_v * along_v)
        if away < near * reach and depth < DEPTH and left + 2 <= ROOM:
            for half in range(2):
                part = stack[left + half]
                part[0], part[1], part[2], part[3], part[4] = u0, u1, v0, v1, depth + 1.0
                if along_u >= along_v:
                    part[1 - half] = um
                else:
                    part[3 - half] = vm
            left += 2
            continue
        for a in range(basis.gauss.shape[0]):
            u = u0 + (u1 - u0) * basis.gauss[a]
            first = k * _lagrange(basis.rule, pieces, u, work.at_u)
            for b in range(basis.gauss.shape[0]):
                v = v0 + (v1 - v0) * basis.gauss[b]
                # H = w (P − x) and G = −det(H, H_u, H_v): the weights of the net cancel.
                facing = facing_at(s, u, v, h, hu, hv)
                up = n[0] * h[0] + n[1] * h[1] + n[2] * h[2]
                square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
                if facing <= 0.0 or up <= 0.0 or square <= 1e-100:
                    continue
                value = up * facing / (square * square)
                value *= basis.weight[a] * basis.weight[b] * (u1 - u0) * (v1 - v0)
                second = k * _lagrange(basis.rule, pieces, v, work.at_v)
                for p in range(k):
                    row = (first + p) * along + second
                    for q in range(k):
                        moments[row + q] += work.at_u[p] * work.at_v[q] * value


class Work(NamedTuple):
    """Scratch of one row."""

    h: np.ndarray
    hu: np.ndarray
    hv: np.ndarray
    other: np.ndarray
    at_u: np.ndarray
    at_v: np.ndarray
    stack: np.ndarray


@parallel
def spread_rows(points, normals, walls, factors, sources, basis, far, middle, near, out):
    """Spread form factors (m, n) from points over the unknowns of the elements.

    Parameters
    ----------
    points, normals : (m, 3) array
        Receivers [m] and unit normals.
    walls : (m,) int array
        Row of ``sources.wall_spheres`` on whose inner side each lies, −1 elsewhere: from there all
        of the wall is seen by its area, see `walls`.
    factors : (m, n) array
        Form factors of the elements.
    sources : Sources
        The elements.
    basis : Basis
        Their unknowns.
    far, middle, near : float
        Distance over radius from which nodes, and Gauss points, tell enough of an element, and from
        which they do of its parts.
    out : (m, N) array
        Receives those of the unknowns; they sum to those of their elements.
    """
    k = basis.rule.shape[0]
    for i in nb.prange(factors.shape[0]):
        x, n, moments, s = points[i], normals[i], np.empty(4 * k * k), np.empty((4, 4, 4))
        work = Work(
            np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(k), np.empty(k),
            np.empty((ROOM, 5)),
        )  # fmt: skip
        for j in range(factors.shape[1]):
            factor = factors[i, j]
            first, last = basis.start[j], basis.start[j + 1]
            count = last - first
            if count <= 1 or factor == 0.0:
                for c in range(first, last):
                    out[i, c] = factor
                continue
            if walls[i] >= 0 and sources.wall[j] == walls[i]:
                for c in range(first, last):
                    out[i, c] = factor * basis.share[c]
                continue
            sphere = sources.spheres[j]
            square = (x[0] - sphere[0]) ** 2 + (x[1] - sphere[1]) ** 2 + (x[2] - sphere[2]) ** 2
            radius2 = sphere[3] * sphere[3]
            pieces = basis.pieces[j]
            if pieces == 0 or square >= far * far * radius2:
                _from_nodes(x, n, first, last, basis, moments)
            elif square >= middle * middle * radius2:
                _from_points(x, n, j, sources, basis.at[pieces - 1], count, moments)
            else:
                shift_net(sources.nets[j], x, s)
                _from_parts(s, n, near, pieces, basis, work, moments)
            total = 0.0
            for c in range(count):
                total += moments[c]
            if total > 0.0:
                for c in range(count):
                    out[i, first + c] = factor * moments[c] / total
                continue
            # Nothing of it is above the horizon where it was looked at: by the areas.
            for c in range(first, last):
                out[i, c] = factor * basis.share[c]
