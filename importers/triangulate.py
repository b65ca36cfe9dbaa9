"""Constrained Delaunay triangulation of polygons with holes: ear clipping and Lawson's flips."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

Triangle = tuple[int, int, int]
#: An edge between two vertices, the lower number first.
Pair = tuple[int, int]
#: Angles by which points are turned before ear clipping, in this order [rad].
TURNS = (0.5, 1.7, 2.9)
#: Share of the polygon's area below which a triangle is as good as flat.
FLAT = 1e-8


def signed_area(points: FloatArray) -> float:
    """Signed area of a closed polygon (n, 2), counter-clockwise positive."""
    x, y = points[:, 0], points[:, 1]
    last = x[-1] * y[0] - y[-1] * x[0]
    return 0.5 * float(x[:-1] @ y[1:] - y[:-1] @ x[1:] + last)


def overlapping(
    low: FloatArray, high: FloatArray, other_low: FloatArray, other_high: FloatArray
) -> tuple[IntArray, IntArray]:
    """Pairs (i, j) of boxes (n, 2) and other boxes (m, 2) that overlap, by a sweep along x.

    Boxes whose left end lies in the width of the other one are found by bisection, in both senses.
    """
    pairs = []
    for swap in (False, True):
        a_low, a_high, b_low = (other_low, other_high, low) if swap else (low, high, other_low)
        order = np.argsort(b_low[:, 0], kind="stable")
        left = b_low[order, 0]
        first = np.searchsorted(left, a_low[:, 0], side="right" if swap else "left")
        count = np.maximum(np.searchsorted(left, a_high[:, 0], side="right") - first, 0)
        i = np.repeat(np.arange(len(a_low)), count)
        start = np.cumsum(count) - count
        j = order[np.arange(len(i)) - np.repeat(start - first, count)]
        pairs.append((j, i) if swap else (i, j))
    i, j = (np.concatenate(k) for k in zip(*pairs, strict=True))
    keep = (low[i, 1] <= other_high[j, 1]) & (other_low[j, 1] <= high[i, 1])
    return i[keep], j[keep]


def crossings(p: FloatArray, q: FloatArray) -> FloatArray:
    """Mask (n,) of segments p[i]–q[i] that properly cross another one of them."""
    hit = np.zeros(len(p), dtype=bool)
    low, high = np.minimum(p, q), np.maximum(p, q)
    d = q - p
    i, j = overlapping(low, high, low, high)
    keep = i < j
    i, j = i[keep], j[keep]

    def side(k: IntArray, point: FloatArray) -> FloatArray:
        e = point - p[k]
        return np.asarray(d[k, 0] * e[:, 1] - d[k, 1] * e[:, 0])

    scale = 1e-12 * (np.abs(d[i]).sum(1) + np.abs(d[j]).sum(1)) ** 2
    s1, s2, s3, s4 = side(i, p[j]), side(i, q[j]), side(j, p[i]), side(j, q[i])
    cross = (
        (np.minimum(s1, s2) < -scale)
        & (np.maximum(s1, s2) > scale)
        & (np.minimum(s3, s4) < -scale)
        & (np.maximum(s3, s4) > scale)
    )
    hit[i[cross]] = True
    hit[j[cross]] = True
    return hit


def inside(polygon: FloatArray, points: FloatArray) -> FloatArray:
    """Mask of ``points`` (m, 2) strictly inside a closed polygon (n, 2), by crossing number."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    y = points[:, 1, None]
    spans = (a[None, :, 1] > y) != (b[None, :, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a[None, :, 0] + (y - a[None, :, 1]) / (b - a)[None, :, 1] * (b - a)[None, :, 0]
    return np.asarray((spans & (points[:, 0, None] < x)).sum(1) % 2 == 1)


def nudged(points: FloatArray, loops: int = 3) -> FloatArray:
    """Points (n, 2) of so many loops, each displaced by a tiny fixed step of its own."""
    # Squares: steps linear in the number would leave rows of a grid of holes on one line.
    k = np.arange(len(points)) ** (2 if loops > 2 else 1)
    size = float(np.ptp(points, axis=0).max())
    step = np.stack([np.modf(0.6180339887 * k)[0], np.modf(0.7548776662 * k)[0]], axis=1) - 0.5
    return np.asarray(points + 1e-7 * size * step)


def border_of(loops: list[list[int]]) -> set[Pair]:
    """Edges of loops of numbered vertices."""
    pairs = (pair for loop in loops for pair in zip(loop, [*loop[1:], loop[0]], strict=True))
    return {(a, b) if a < b else (b, a) for a, b in pairs}


def clipped(moved: FloatArray, loops: list[list[int]]) -> list[Triangle] | None:
    """Triangles between the vertices that ``loops`` number, by ear clipping; None when it fails.

    Ear clipping drops collinear vertices, so that points ``moved`` a little are asked for; flips
    remove the flat triangles that it leaves.
    """
    import mapbox_earcut

    flat = np.array([k for loop in loops for k in loop])
    ends = np.cumsum([len(loop) for loop in loops]).astype(np.uint32)
    # Holes are joined along lines of sight to the left, which rows of equal holes share: points
    # are turned, and turned again when vertices were lost.
    for turn in TURNS:
        c, s = math.cos(turn), math.sin(turn)
        turned = moved[flat] @ np.array([[c, s], [-s, c]])
        found = np.asarray(mapbox_earcut.triangulate_float64(turned, ends), dtype=np.int64)
        index = flat[found].reshape(-1, 3)
        if len(index) == len(flat) - 2 + 2 * (len(loops) - 1):
            break
    else:
        return None
    over = areas(moved, index) < 0
    index[over] = index[over][:, ::-1]
    return [(a, b, c) for a, b, c in index.tolist()]


def settled(
    points: FloatArray, triangles: list[Triangle], loops: list[list[int]]
) -> list[Triangle] | None:
    """Triangles of the points as they are, from those of displaced ones; None if they are wrong.

    Rows of equal holes have many vertices on one line: among displaced points no triangle is flat,
    and no flip is held up by one that is. The result is accepted only if the areas of its triangles
    (n − 2 + 2h of them) sum to the polygon's: positive triangles alone prove nothing, they may
    overlap.
    """
    total = sum(signed_area(points[loop]) for loop in loops)
    index = np.array(triangles)
    area = areas(points, index)
    if area.min() <= FLAT * total:
        some = index[area <= FLAT * total].tolist()
        start = [(t[k - 1], t[k]) for t in some for k in range(3)]
        triangles = flipped(points, triangles, border_of(loops), start)
        area = areas(points, np.array(triangles))
    if area.min() <= -1e-12 * total or abs(area.sum() - total) > 1e-9 * abs(total):
        return None
    if np.abs(area).sum() - total > 1e-9 * abs(total):
        return None
    return triangles


def areas(points: FloatArray, index: IntArray) -> FloatArray:
    """Signed areas (n,) of triangles (n, 3)."""
    a, b, c = (points[index[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def inner_edges(triangles: IntArray) -> IntArray:
    """Edges (6, m) between two of some triangles (n, 3): ends a, b, the third corners c and d, and
    the triangles a b c and b a d."""
    a, b, c = (np.roll(triangles, -k, axis=1).ravel() for k in range(3))
    count = int(triangles.max(initial=0)) + 1
    key = a * count + b
    order = np.argsort(key)
    ordered = key[order]
    at = np.minimum(np.searchsorted(ordered, b * count + a), len(key) - 1)
    e = np.flatnonzero((ordered[at] == b * count + a) & (a < b))
    m = order[at[e]]
    return np.array([a[e], b[e], c[e], c[m], e // 3, m // 3])


def flipped(
    points: FloatArray,
    triangles: list[Triangle],
    fixed: set[Pair],
    start: Iterable[Pair] | None = None,
) -> list[Triangle]:
    """Triangles after Lawson's flips: each inner edge locally Delaunay.

    Edges in ``fixed`` stay. The first ones looked at are those in ``start``, else all.
    """
    if start is None:
        a, b, c, d, *_ = inner_edges(np.array(triangles))
        wrong = _not_delaunay(points[a], points[b], points[c], points[d])
        start = zip(a[wrong].tolist(), b[wrong].tolist(), strict=True)
    stack = [(a, b) if a < b else (b, a) for a, b in start]
    stack = [e for e in stack if e not in fixed]
    tri = list(triangles)
    if not stack:
        return tri
    xy = points.tolist()
    owner: dict[Pair, int] = {}
    for k, (a, b, c) in enumerate(tri):
        owner[a, b] = owner[b, c] = owner[c, a] = k
    budget = 40 * len(tri) + 100
    while stack and budget:
        budget -= 1
        a, b = stack.pop()
        k, m = owner.get((a, b), -1), owner.get((b, a), -1)
        if k < 0 or m < 0:
            continue
        c, d = sum(tri[k]) - a - b, sum(tri[m]) - a - b
        if not _should_flip(xy[a], xy[b], xy[c], xy[d]):
            continue
        # Triangles (a b c) and (b a d) become (a d c) and (d b c).
        tri[k], tri[m] = (a, d, c), (d, b, c)
        del owner[a, b], owner[b, a]
        owner[a, d] = owner[d, c] = owner[c, a] = k
        owner[d, b] = owner[b, c] = owner[c, d] = m
        for e, f in ((a, d), (d, b), (b, c), (c, a)):
            key = (e, f) if e < f else (f, e)
            if key not in fixed:
                stack.append(key)
    return tri


def _not_delaunay(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """`_should_flip` of many edges (n, 2)."""

    def cross(o: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
        e, f = p - o, q - o
        return np.asarray(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])

    def cot(o: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
        dot = ((p - o) * (q - o)).sum(axis=1)
        return np.asarray(dot / np.maximum(np.abs(cross(o, p, q)), 1e-300))

    t1, t2 = cross(a, d, c), cross(d, b, c)
    size = cross(a, b, c) - cross(a, b, d)
    inside = (t1 > 0.0) & (t2 > 0.0) & (np.minimum(t1, t2) > 1e-9 * np.abs(size))
    return np.asarray(inside & (cot(c, a, b) + cot(d, b, a) < -1e-9))


def _should_flip(a: list[float], b: list[float], c: list[float], d: list[float]) -> bool:
    """Whether the diagonal c–d is strictly inside a d b c and its angles are better."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = a, b, c, d
    t1 = (dx - ax) * (cy - ay) - (dy - ay) * (cx - ax)
    t2 = (bx - dx) * (cy - dy) - (by - dy) * (cx - dx)
    if t1 <= 0.0 or t2 <= 0.0:
        return False
    abc = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    abd = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    if min(t1, t2) <= 1e-9 * abs(abc - abd):
        return False
    # Opposite angles above 180 degrees in total: the sum of their cotangents is negative.
    at_c = (ax - cx) * (bx - cx) + (ay - cy) * (by - cy)
    at_d = (ax - dx) * (bx - dx) + (ay - dy) * (by - dy)
    return at_c / max(abs(abc), 1e-300) + at_d / max(abs(abd), 1e-300) < -1e-9
