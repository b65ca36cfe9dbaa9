"""Constrained Delaunay triangulation of polygons with holes: ear clipping and Lawson's flips."""

from __future__ import annotations

import math

import numpy as np
from patchlight.solver.model.arrays import FloatArray, IntArray

#: Angles by which points are turned before ear clipping, in this order [rad].
TURNS = (0.5, 1.7, 2.9)
#: Share of the polygon's area below which a triangle is as good as flat.
FLAT = 1e-8


def signed_area(points: FloatArray) -> float:
    """Signed area of a closed polygon (n, 2), counter-clockwise positive."""
    x, y = points[:, 0], points[:, 1]
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


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


def triangulate(loops: list[FloatArray]) -> list[tuple[int, int, int]] | None:
    """Counter-clockwise triangles of vertex numbers, loop after loop; None when it fails.

    The result is accepted only with n − 2 + 2h triangles whose areas sum to the polygon's:
    positive triangles alone prove nothing, they may overlap.
    """
    import mapbox_earcut

    points = np.concatenate(loops)
    ends = np.cumsum([len(p) for p in loops]).astype(np.uint32)
    # Ear clipping drops collinear vertices; a tiny fixed displacement keeps them, and the flips
    # remove the flat triangles it leaves.
    k = np.arange(len(points))
    size = float(np.ptp(points, axis=0).max())
    nudge = np.stack([np.modf(0.6180339887 * k)[0], np.modf(0.7548776662 * k)[0]], axis=1) - 0.5
    nudged = points + 1e-7 * size * nudge
    # Holes are joined along lines of sight to the left, which rows of equal holes share: points
    # are turned, and turned again when vertices were lost.
    for turn in TURNS:
        c, s = math.cos(turn), math.sin(turn)
        flat = mapbox_earcut.triangulate_float64(nudged @ np.array([[c, s], [-s, c]]), ends)
        index = np.asarray(flat, dtype=np.int64).reshape(-1, 3)
        if len(index) == len(points) - 2 + 2 * (len(loops) - 1):
            break
    else:
        return None
    turned = areas(nudged, index) < 0
    index[turned] = index[turned][:, ::-1]
    # Rows of equal holes have many vertices on one line: among the displaced points no triangle is
    # flat, and no swap is held up by one that is.
    out = flipped(nudged, [(a, b, c) for a, b, c in index.tolist()], loops)
    area = areas(points, np.array(out))
    total = sum(signed_area(p) for p in loops)
    if area.min() <= FLAT * total:
        out = flipped(points, out, loops)
        area = areas(points, np.array(out))
    if area.min() <= -1e-12 * total or abs(area.sum() - total) > 1e-9 * abs(total):
        return None
    if np.abs(area).sum() - total > 1e-9 * abs(total):
        return None
    return out


def areas(points: FloatArray, index: IntArray) -> FloatArray:
    """Signed areas (n,) of triangles (n, 3)."""
    a, b, c = (points[index[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def flipped(
    points: FloatArray, triangles: list[tuple[int, int, int]], loops: list[FloatArray]
) -> list[tuple[int, int, int]]:
    """Triangles after Lawson's flips: each inner edge locally Delaunay."""
    xy = points.tolist()
    fixed = set()
    base = 0
    for loop in loops:
        n = len(loop)
        for k in range(n):
            a, b = base + k, base + (k + 1) % n
            fixed.add((a, b) if a < b else (b, a))
        base += n
    owner: dict[tuple[int, int], int] = {}
    tri = list(triangles)
    for k, (a, b, c) in enumerate(tri):
        owner[a, b], owner[b, c], owner[c, a] = k, k, k
    stack = [e for e in owner if e[0] < e[1] and e not in fixed]
    budget = 40 * len(tri) + 100
    while stack and budget:
        budget -= 1
        a, b = stack.pop()
        if (a, b) not in owner or (b, a) not in owner:
            continue
        k, m = owner[a, b], owner[b, a]
        c = next(x for x in tri[k] if x not in (a, b))
        d = next(x for x in tri[m] if x not in (a, b))
        if not _should_flip(xy[a], xy[b], xy[c], xy[d]):
            continue
        # Triangles (a b c) and (b a d) become (a d c) and (d b c).
        tri[k], tri[m] = (a, d, c), (d, b, c)
        for e in ((a, b), (b, a)):
            del owner[e]
        owner[a, d], owner[d, c], owner[c, a] = k, k, k
        owner[d, b], owner[b, c], owner[c, d] = m, m, m
        for e in ((a, d), (d, b), (b, c), (c, a)):
            key = e if e[0] < e[1] else (e[1], e[0])
            if key not in fixed:
                stack.append(key)
    return tri


def _cross(o: list[float], a: list[float], b: list[float]) -> float:
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def _should_flip(a: list[float], b: list[float], c: list[float], d: list[float]) -> bool:
    """Whether the diagonal c–d is strictly inside a d b c and its angles are better."""
    t1, t2 = _cross(a, d, c), _cross(d, b, c)
    if t1 <= 0.0 or t2 <= 0.0:
        return False
    size = _cross(a, b, c) - _cross(a, b, d)
    if min(t1, t2) <= 1e-9 * abs(size):
        return False

    def cot(o: list[float], p: list[float], q: list[float]) -> float:
        dot = (p[0] - o[0]) * (q[0] - o[0]) + (p[1] - o[1]) * (q[1] - o[1])
        return dot / max(abs(_cross(o, p, q)), 1e-300)

    # Opposite angles above 180 degrees in total: the sum of their cotangents is negative.
    return cot(c, a, b) + cot(d, b, a) < -1e-9
