"""Light of photometric webs: the mean luminance at which a receiver sees an emitting element.

A lamp shines from its true surface. In direction d every point of it that faces d has the luminance
L(d) = I(d) / A(d), with I the intensity of the web and A the area of all emitting faces projected
on d. From afar the lamp then is its web, and near by the light comes from where it is emitted.
What an element gives to a receiver is its visible form factor times π times the mean of L over it,
weighted as the form factor is. The mean is found by Gauss quadrature with quartering, until it
neither changes nor spans more of the web than four of its steps.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import lean, parallel

#: Directions of the table of projected areas, along γ and along C: 2.5 degrees apart.
TABLE_GAMMA, TABLE_C = 73, 145
#: Points on each element known beforehand: 2 x 2 on the whole, then 2 x 2 on each quarter of it.
WHOLE, SAMPLES = 4, 20
#: Elements that appear smaller than this are one cell. [rad]
POINT_LIKE = 0.002
#: Columns of what is found: ∫ L cosθ cosθ' / r² dA, ∫ cosθ cosθ' / r² dA, least and largest L.
LIGHT, VIEW, LEAST, MOST = range(4)
_GAUSS = 0.5 - 0.5 / math.sqrt(3.0)
_TINY = 1e-9


class WebTables(NamedTuple):
    """One lamp.

    Attributes
    ----------
    axes : (3, 3) array
        Directions of C0, C90 and the nadir.
    c, gamma : (k,), (g,) array
        As `Photometry`. [rad]
    candela : (k, g) array
        Intensities, scaled to the flux of the lamp. [cd]
    flat : (a, 4) array
        Unit normals and areas of the flat emitting faces. [m²]
    curved : (TABLE_C, TABLE_GAMMA) array
        Projected area of the others by direction, or without rows. [m²]
    area : float
        Of all. [m²]
    """

    axes: np.ndarray
    c: np.ndarray
    gamma: np.ndarray
    candela: np.ndarray
    flat: np.ndarray
    curved: np.ndarray
    area: float


@lean
def _interval(grid, value):
    """Interval of an ascending grid that holds ``value``."""
    low, high = 0, grid.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if grid[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@lean
def _bilinear(table, i, j, x, y):
    low = table[i, j] * (1.0 - y) + table[i, j + 1] * y
    high = table[i + 1, j] * (1.0 - y) + table[i + 1, j + 1] * y
    return low * (1.0 - x) + high * x


@lean
def luminance(web, x, y, z):
    """Luminance of the lamp in the unit direction (x, y, z) that its light takes. [cd/m²]"""
    a = web.axes
    p = a[0, 0] * x + a[0, 1] * y + a[0, 2] * z
    q = a[1, 0] * x + a[1, 1] * y + a[1, 2] * z
    r = a[2, 0] * x + a[2, 1] * y + a[2, 2] * z
    gamma = math.atan2(math.sqrt(p * p + q * q), r)
    if gamma < web.gamma[0] or gamma > web.gamma[-1]:
        return 0.0
    c = math.atan2(q, p)
    if c < 0.0:
        c += 2.0 * math.pi
    i, j = _interval(web.c, c), _interval(web.gamma, gamma)
    s = (c - web.c[i]) / (web.c[i + 1] - web.c[i])
    t = (gamma - web.gamma[j]) / (web.gamma[j + 1] - web.gamma[j])
    intensity = _bilinear(web.candela, i, j, min(s, 1.0), t)
    area = 0.0
    for k in range(web.flat.shape[0]):
        cosine = web.flat[k, 0] * x + web.flat[k, 1] * y + web.flat[k, 2] * z
        if cosine > 0.0:
            area += web.flat[k, 3] * cosine
    if web.curved.shape[0]:
        s = c * ((TABLE_C - 1) / (2.0 * math.pi))
        t = gamma * ((TABLE_GAMMA - 1) / math.pi)
        i, j = min(int(s), TABLE_C - 2), min(int(t), TABLE_GAMMA - 2)
        area += _bilinear(web.curved, i, j, s - i, t - j)
    return intensity / area if area > _TINY * web.area else 0.0


@parallel
def luminances(web, directions, out):
    """Fill ``out (m,)`` with the luminance in unit directions (m, 3). [cd/m²]"""
    for k in nb.prange(directions.shape[0]):
        out[k] = luminance(web, directions[k, 0], directions[k, 1], directions[k, 2])


@lean
def _add_sample(web, x, n, point, area, found):
    """Add what a piece of the lamp, its area vector being ``area (3,)``, gives to a receiver."""
    a, b, c = point[0] - x[0], point[1] - x[1], point[2] - x[2]
    here = a * n[0] + b * n[1] + c * n[2]
    there = -(a * area[0] + b * area[1] + c * area[2])
    if here <= 0.0 or there <= 0.0:
        return
    square = a * a + b * b + c * c
    length = math.sqrt(square)
    view = here * there / (square * square)
    level = luminance(web, -a / length, -b / length, -c / length)
    found[LIGHT] += level * view
    found[VIEW] += view
    found[LEAST] = min(found[LEAST], level)
    found[MOST] = max(found[MOST], level)


@lean
def _bernstein(t, b, d):
    s = 1.0 - t
    b[0], b[1], b[2], b[3] = s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t
    d[0], d[1] = -3.0 * s * s, 3.0 * s * (s - 2.0 * t)
    d[2], d[3] = 3.0 * t * (2.0 * s - t), 3.0 * t * t


@lean
def _surface(net, u, v, share, scratch, point, area):
    """Point of a net and its area vector ∂u × ∂v times ``share``."""
    b, db, c, dc = scratch[0], scratch[1], scratch[2], scratch[3]
    h, hu, hv = scratch[4], scratch[5], scratch[6]
    _bernstein(u, b, db)
    _bernstein(v, c, dc)
    for k in range(4):
        h[k] = hu[k] = hv[k] = 0.0
        for i in range(4):
            for j in range(4):
                x = net[i, j, k]
                h[k] += b[i] * c[j] * x
                hu[k] += db[i] * c[j] * x
                hv[k] += b[i] * dc[j] * x
    for k in range(3):
        point[k] = h[k] / h[3]
        hu[k] = (hu[k] - hu[3] * point[k]) / h[3]
        hv[k] = (hv[k] - hv[3] * point[k]) / h[3]
    area[0] = share * (hu[1] * hv[2] - hu[2] * hv[1])
    area[1] = share * (hu[2] * hv[0] - hu[0] * hv[2])
    area[2] = share * (hu[0] * hv[1] - hu[1] * hv[0])


@lean
def _clear(found):
    found[LIGHT] = found[VIEW] = found[MOST] = 0.0
    found[LEAST] = math.inf


@lean
def _join(found, other):
    found[LIGHT] += other[LIGHT]
    found[VIEW] += other[VIEW]
    found[LEAST] = min(found[LEAST], other[LEAST])
    found[MOST] = max(found[MOST], other[MOST])


@lean
def _quarter(web, x, n, net, u, v, size, scratch, point, area, found):
    """What the square of parameters at (u, v) gives, by 2 x 2 Gauss points."""
    _clear(found)
    for i in range(2):
        for j in range(2):
            a = u + size * (_GAUSS if i == 0 else 1.0 - _GAUSS)
            b = v + size * (_GAUSS if j == 0 else 1.0 - _GAUSS)
            _surface(net, a, b, 0.25 * size * size, scratch, point, area)
            _add_sample(web, x, n, point, area, found)


@lean
def _refined(
    web, x, n, net, radius, first, angle, tolerance, levels, stack, scratch, point, area, parts,
    found,
):  # fmt: skip
    """What an element gives, cell by cell; ``first (4, 4)`` is what its quarters seem to give.

    A cell is done when it appears smaller than ``angle`` and its quarters do not change the mean
    luminance of the element by more than ``tolerance`` of it. How much of the cell is seen counts
    only where its luminance is another one: form factors are known otherwise.
    """
    light = view = 0.0
    for k in range(4):
        light += first[k, LIGHT]
        view += first[k, VIEW]
    mean = light / view if view > 0.0 else 0.0
    top = 0
    for k in range(4):
        stack[top, 0], stack[top, 1], stack[top, 2] = 0.5 * (k // 2), 0.5 * (k % 2), 1.0
        stack[top, 3], stack[top, 4] = first[k, LIGHT], first[k, VIEW]
        top += 1
    while top > 0:
        top -= 1
        u, v, level = stack[top, 0], stack[top, 1], stack[top, 2]
        was_light, was_view = stack[top, 3], stack[top, 4]
        size = 0.5**level
        half = 0.5 * size
        _surface(net, u + half, v + half, 1.0, scratch, point, area)
        a, b, c = point[0] - x[0], point[1] - x[1], point[2] - x[2]
        wide = 2.0 * radius * size
        small = wide <= angle * (math.sqrt(a * a + b * b + c * c) - 0.5 * wide)
        now_light = now_view = 0.0
        for k in range(4):
            _quarter(
                web, x, n, net, u + half * (k // 2), v + half * (k % 2), half, scratch, point,
                area, parts[k],
            )  # fmt: skip
            now_light += parts[k, LIGHT]
            now_view += parts[k, VIEW]
        change = now_light - was_light - mean * (now_view - was_view)
        if (small and abs(change) <= tolerance * light) or level >= levels:
            for k in range(4):
                _join(found, parts[k])
            continue
        for k in range(4):
            stack[top, 0], stack[top, 1] = u + half * (k // 2), v + half * (k % 2)
            stack[top, 2] = level + 1.0
            stack[top, 3], stack[top, 4] = parts[k, LIGHT], parts[k, VIEW]
            top += 1


@parallel
def web_rows(
    nodes, normals, weights, wanted, web, nets, spheres, points, areas, angle, tolerance, levels,
    chunks, out,
):  # fmt: skip
    """What the k elements of one lamp give to m receivers with q nodes each, without hiding.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    weights : (m, q) array
        Share of each node.
    wanted : (m, k) bool array
        Pairs to do.
    web : WebTables
        The lamp.
    nets, spheres : (k, 4, 4, 4), (k, 4) array
        Its elements and their bounding spheres.
    points, areas : (k, SAMPLES, 3) array
        Points on them and their area vectors.
    angle : float
        Largest angular size of a cell. [rad]
    tolerance : float
        Relative accuracy of each element's mean luminance.
    levels : int
        How often an element is quartered at most.
    chunks : int
        How many threads to spread the receivers over.
    out : (m, k, 4) array
        Receives the columns `LIGHT` … `MOST`.
    """
    count = nodes.shape[0]
    size = (count + chunks - 1) // chunks
    for chunk in nb.prange(chunks):
        stack, scratch = np.empty((3 * levels + 8, 5)), np.empty((7, 4))
        point, area, parts, first = np.empty(3), np.empty(3), np.empty((4, 4)), np.empty((4, 4))
        whole, node = np.empty(4), np.empty(4)
        for i in range(chunk * size, min(count, (chunk + 1) * size)):
            for j in range(nets.shape[0]):
                _clear(out[i, j])
                if not wanted[i, j]:
                    continue
                for q in range(nodes.shape[1]):
                    weight = weights[i, q]
                    if weight == 0.0:
                        continue
                    x, n = nodes[i, q], normals[i, q]
                    a, b, c = spheres[j, 0] - x[0], spheres[j, 1] - x[1], spheres[j, 2] - x[2]
                    wide = 2.0 * spheres[j, 3]
                    away = math.sqrt(a * a + b * b + c * c) - 0.5 * wide
                    _clear(whole)
                    for s in range(WHOLE):
                        _add_sample(web, x, n, points[j, s], areas[j, s], whole)
                    if wide <= POINT_LIKE * away:
                        _clear(node)
                        _join(node, whole)
                    else:
                        light = view = 0.0
                        for k in range(4):
                            _clear(first[k])
                            for s in range(4):
                                at = WHOLE + 4 * k + s
                                _add_sample(web, x, n, points[j, at], areas[j, at], first[k])
                            light += first[k, LIGHT]
                            view += first[k, VIEW]
                        _clear(node)
                        mean = light / view if view > 0.0 else 0.0
                        change = light - whole[LIGHT] - mean * (view - whole[VIEW])
                        if wide <= angle * away and abs(change) <= tolerance * light:
                            for k in range(4):
                                _join(node, first[k])
                        else:
                            _refined(
                                web, x, n, nets[j], spheres[j, 3], first, angle, tolerance, levels,
                                stack, scratch, point, area, parts, node,
                            )  # fmt: skip
                    node[LIGHT] *= weight
                    node[VIEW] *= weight
                    _join(out[i, j], node)
