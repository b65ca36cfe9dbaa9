"""Silhouettes of regions: patches that lie on one quadric and go on smoothly into each other.

The silhouette of a quadric is its section with the receiver's polar plane (`quadric`). Of an
ellipsoid that is an ellipse; of a cone or cylinder it is a pair of lines through its vertex, which
may be at infinity. A region shows what lies between the points where the section crosses the
region's boundary: whether the section enters or leaves the region there follows from the direction
of the boundary. No patch need be looked at but those on the boundary, and the seams between patches
leave no trace.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .contour import cubic, sign_breaks

#: Kinds of regions: done patch by patch, on an ellipsoid, on a cone or cylinder.
PATCHES, ROUND, RULED = 0, 1, 2
#: Section and boundary that cross at less than this angle, or sides of a line that differ by less.
_TANGENT = 1e-9
#: Values along a boundary below this share of their terms: it runs in the section.
_ALONG = 1e-13
#: Largest part of an ellipse in one arc. [rad]
_ARC = 0.5 * math.pi + 1e-9


class Regions(NamedTuple):
    """Regions, sorted by sheet, and their patches.

    Attributes
    ----------
    of : (p,) int array
        Region of each patch.
    start : (s + 1,) int array
        First region of each sheet.
    first : (r + 1,) int array
        First of each region's patches in ``patch``.
    patch : (p,) int array
    kind : (r,) int array
        `PATCHES`, `ROUND`, `RULED`.
    bounded : (r,) bool array
        Whether it ends anywhere: else it is a whole ellipsoid.
    spheres : (s, 4) array
        Centre and radius of a sphere about each sheet. [m]
    convex : (s,) bool array
        Sheets that are closed convex bodies: their outlines do not cross themselves.
    quadric : (r, 5, 4) array
        As in `quadric.polar_plane`: one for all patches of a region, so that what it cuts out of
        them fits together.
    center : (r, 4) array
        Centre of an ellipsoid, vertex of a cone or direction of a cylinder, in the coordinates of
        ``quadric``, homogeneous.
    """

    of: np.ndarray
    start: np.ndarray
    first: np.ndarray
    patch: np.ndarray
    kind: np.ndarray
    bounded: np.ndarray
    spheres: np.ndarray
    convex: np.ndarray
    quadric: np.ndarray
    center: np.ndarray


class Cuts(NamedTuple):
    """Points where silhouettes cross the boundaries of their regions, of one sheet."""

    count: np.ndarray  # (1,)
    region: np.ndarray  # (k,)
    point: np.ndarray  # (k, 3) relative to the receiver
    inward: np.ndarray  # (k, 3) along the boundary's left
    place: np.ndarray  # (k,) scratch: where on the section
    enters: np.ndarray  # (k,) scratch: whether the section enters the region there
    listed: np.ndarray  # (k,) scratch


@kernel
def make_cuts(patches):
    """Room for those of sheets with so many patches."""
    room = 8 * patches + 8
    return Cuts(
        np.zeros(1, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty((room, 3)),
        np.empty((room, 3)),
        np.empty(room),
        np.empty(room, dtype=np.bool_),
        np.empty(room, dtype=np.int64),
    )


@lean
def cut_boundary(region, c, w, polar, quadric, x, breaks, cuts):
    """Add the points of a boundary edge at which the side seen changes; False where not known.

    Parameters
    ----------
    region : int
        Region it bounds.
    c, w : (4, 3) and (4,) arrays
        The edge as control vectors relative to the receiver, the region on its left, and their
        weights.
    polar : (4,) array
        From `quadric.polar_plane`.
    quadric : (5, 4) array
        Of the region.
    x : (3,) array
        Receiver.
    breaks : (8,) array
        Scratch.
    cuts : Cuts
        Receives the points.
    """
    g0, g1, g2, g3, size = side_along(c, w, polar)
    if max(max(abs(g0), abs(g1)), max(abs(g2), abs(g3))) <= _ALONG * size:
        return False
    starts, ends = g0 > 0.0, g3 > 0.0
    parts = sign_breaks(g0, g1, g2, g3, breaks)
    number = parts - 2
    if (number % 2 == 1) != (starts != ends):
        # It changes at an end, to rounding: here, or at the end of the next edge, by the same sign.
        at = 1.0 if abs(g3) < abs(g0) else 0.0
        breaks[number + 1] = at
        number += 1
    if cuts.count[0] + number > cuts.region.shape[0]:
        return False
    for m in range(1, number + 1):
        t = breaks[m]
        r = 1.0 - t
        e0, e1, e2 = 3.0 * r * r, 6.0 * t * r, 3.0 * t * t
        weight = cubic(w[0], w[1], w[2], w[3], t)
        slope = e0 * (w[1] - w[0]) + e1 * (w[2] - w[1]) + e2 * (w[3] - w[2])
        k = cuts.count[0]
        px = cubic(c[0, 0], c[1, 0], c[2, 0], c[3, 0], t) / weight
        py = cubic(c[0, 1], c[1, 1], c[2, 1], c[3, 1], t) / weight
        pz = cubic(c[0, 2], c[1, 2], c[2, 2], c[3, 2], t) / weight
        tx = e0 * (c[1, 0] - c[0, 0]) + e1 * (c[2, 0] - c[1, 0]) + e2 * (c[3, 0] - c[2, 0])
        ty = e0 * (c[1, 1] - c[0, 1]) + e1 * (c[2, 1] - c[1, 1]) + e2 * (c[3, 1] - c[2, 1])
        tz = e0 * (c[1, 2] - c[0, 2]) + e1 * (c[2, 2] - c[1, 2]) + e2 * (c[3, 2] - c[2, 2])
        tx, ty, tz = tx - px * slope, ty - py * slope, tz - pz * slope
        cuts.point[k, 0], cuts.point[k, 1], cuts.point[k, 2] = px, py, pz
        nx, ny, nz = _normal_at(quadric, x, px, py, pz)
        cuts.inward[k, 0] = ny * tz - nz * ty
        cuts.inward[k, 1] = nz * tx - nx * tz
        cuts.inward[k, 2] = nx * ty - ny * tx
        cuts.region[k] = region
        cuts.count[0] += 1
    return True


@lean
def side_along(c, w, polar):
    """Side seen along a cubic edge ``c`` (4, 3) with weights ``w``: coefficients, size of terms."""
    a0 = polar[0] * c[0, 0] + polar[1] * c[0, 1] + polar[2] * c[0, 2]
    a1 = polar[0] * c[1, 0] + polar[1] * c[1, 1] + polar[2] * c[1, 2]
    a2 = polar[0] * c[2, 0] + polar[1] * c[2, 1] + polar[2] * c[2, 2]
    a3 = polar[0] * c[3, 0] + polar[1] * c[3, 1] + polar[2] * c[3, 2]
    b0, b1, b2, b3 = polar[3] * w[0], polar[3] * w[1], polar[3] * w[2], polar[3] * w[3]
    size = max(max(abs(a0) + abs(b0), abs(a1) + abs(b1)), max(abs(a2) + abs(b2), abs(a3) + abs(b3)))
    return a0 + b0, a1 + b1, a2 + b2, a3 + b3, size


@lean
def _normal_at(quadric, x, px, py, pz):
    """Gradient of the quadric at a point relative to the receiver: along the +normal."""
    scale = quadric[4, 3]
    a = (px + x[0] - quadric[4, 0]) * scale
    b = (py + x[1] - quadric[4, 1]) * scale
    c = (pz + x[2] - quadric[4, 2]) * scale
    return (
        quadric[0, 0] * a + quadric[0, 1] * b + quadric[0, 2] * c + quadric[0, 3],
        quadric[1, 0] * a + quadric[1, 1] * b + quadric[1, 2] * c + quadric[1, 3],
        quadric[2, 0] * a + quadric[2, 1] * b + quadric[2, 2] * c + quadric[2, 3],
    )


@lean
def _sort_places(cuts, number):
    """Order the first ``number`` listed cuts by their places."""
    for k in range(1, number):
        m = cuts.listed[k]
        i = k
        while i > 0 and cuts.place[cuts.listed[i - 1]] > cuts.place[m]:
            cuts.listed[i] = cuts.listed[i - 1]
            i -= 1
        cuts.listed[i] = m


@lean
def _times(a, v, out):
    """Product of the upper left 3 x 3 of ``a`` and ``v``."""
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]


@lean
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@lean
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@lean
def _add_arcs(low, high, quadric, middle, axes, x, curves, count):
    """Add the arcs of an ellipse between two angles; returns how many there are, −1 for no room."""
    pieces = int(math.ceil((high - low) / _ARC))
    if count + pieces > curves.shape[0]:
        return -1
    half = 0.5 * (high - low) / pieces
    inner, scale = math.cos(half), quadric[4, 3]
    for p in range(pieces):
        a = low + 2.0 * half * p
        b = high if p == pieces - 1 else a + 2.0 * half
        m = a + half
        ca, sa, cb, sb, cm, sm = (
            math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(m), math.sin(m),
        )  # fmt: skip
        w = (1.0 + 2.0 * inner) / 3.0
        for k in range(3):
            first = middle[k] + ca * axes[0, k] + sa * axes[1, k]
            last = middle[k] + cb * axes[0, k] + sb * axes[1, k]
            between = inner * middle[k] + cm * axes[0, k] + sm * axes[1, k]
            move = quadric[4, k] - x[k]
            curves[count, 0, k] = first / scale + move
            curves[count, 1, k] = (first + 2.0 * between) / (3.0 * scale) + move * w
            curves[count, 2, k] = (last + 2.0 * between) / (3.0 * scale) + move * w
            curves[count, 3, k] = last / scale + move
        count += 1
    return count


@lean
def round_arcs(region, inside, quadric, center, x, cuts, work, curves, count):
    """Add the silhouette of an ellipsoidal region, counter-clockwise as the receiver sees it.

    With yᵀ A y = k relative to the centre, the polar plane of X is Xᵀ A y = k. Its section is
    λ X + cos θ e₁ + sin θ e₂ with λ = k / XᵀAX, where X, e₁, and e₂ are conjugate:
    e₁ᵀ A X = e₂ᵀ A X = e₁ᵀ A e₂ = 0, e₁ᵀ A e₁ = e₂ᵀ A e₂ = k (1 − λ).

    Parameters
    ----------
    inside : bool
        Whether the whole section is in the region if its boundary does not cut it.
    quadric, center
        Rows of `Regions`.
    work : (9, 4) array
        Scratch.
    curves : (k, 4, 3) array
        Receives the arcs, from row ``count`` on.

    Returns
    -------
    int
        Number of curves, −1 where they are not known.
    """
    scale = quadric[4, 3]
    away, steep, axes, far, z = work[0], work[1], work[2:4], work[4], work[5]
    sign = 1.0 if quadric[0, 0] > 0.0 else -1.0
    for i in range(3):
        away[i] = (x[i] - quadric[4, i]) * scale - center[i]
    _times(quadric, away, steep)
    _times(quadric, center, far)
    square = sign * _dot(away, steep)
    k = sign * (_dot(center, far) - quadric[3, 3])
    if square <= k:
        return count  # from within there is none
    share = k / square
    c = 0
    if abs(steep[1]) < abs(steep[c]):
        c = 1
    if abs(steep[2]) < abs(steep[c]):
        c = 2
    for i in range(3):
        axes[0, i] = (1.0 if i == c else 0.0) - sign * steep[c] / square * away[i]
    _times(quadric, axes[0], far)
    _cross(steep, far, axes[1])
    for e in range(2):
        _times(quadric, axes[e], far)
        length = math.sqrt(k * (1.0 - share) / (sign * _dot(axes[e], far)))
        for i in range(3):
            axes[e, i] *= length
    _cross(axes[0], axes[1], far)
    if _dot(far, away) < 0.0:
        for i in range(3):
            axes[1, i] = -axes[1, i]
    number = 0
    for m in range(cuts.count[0]):
        if cuts.region[m] != region:
            continue
        for i in range(3):
            z[i] = (cuts.point[m, i] + x[i] - quadric[4, i]) * scale - center[i] - share * away[i]
        _times(quadric, z, far)
        angle = math.atan2(sign * _dot(far, axes[1]), sign * _dot(far, axes[0]))
        along = size = 0.0
        for i in range(3):
            t = math.cos(angle) * axes[1, i] - math.sin(angle) * axes[0, i]
            along += t * cuts.inward[m, i]
            size += t * t
        if abs(along) <= _TANGENT * math.sqrt(size * _dot(cuts.inward[m], cuts.inward[m])):
            return -1
        cuts.place[m], cuts.enters[m], cuts.listed[number] = angle, along > 0.0, m
        number += 1
    for i in range(3):
        z[i] = center[i] + share * away[i]
    if number == 0:
        return _add_arcs(0.0, 2.0 * math.pi, quadric, z, axes, x, curves, count) if inside else -1
    _sort_places(cuts, number)
    for m in range(number):
        this, after = cuts.listed[m], cuts.listed[(m + 1) % number]
        if cuts.enters[this] == cuts.enters[after]:
            return -1
        if cuts.enters[this]:
            end = cuts.place[after] + (2.0 * math.pi if m == number - 1 else 0.0)
            count = _add_arcs(cuts.place[this], end, quadric, z, axes, x, curves, count)
            if count < 0:
                return -1
    return count


@lean
def ruled_lines(region, quadric, center, polar, x, cuts, work, curves, count):
    """Add the silhouette of a region on a cone or cylinder: parts of lines through its vertex.

    One runs towards the vertex and one away from it, both with the front on their left.
    Parameters and result as of `round_arcs`; ``polar`` (4,) is that of the region.
    """
    scale = quadric[4, 3]
    vertex, d, normal, left, t = work[0], work[1], work[2], work[3], work[4]
    for i in range(3):
        # Relative to the receiver, or a direction.
        vertex[i] = center[i]
        if center[3] != 0.0:
            vertex[i] = center[i] / scale + quadric[4, i] - x[i]
    for way in range(2):
        number = 0
        for m in range(cuts.count[0]):
            if cuts.region[m] != region:
                continue
            for i in range(3):
                d[i] = vertex[i] - cuts.point[m, i] if center[3] != 0.0 else vertex[i]
            normal[0], normal[1], normal[2] = _normal_at(
                quadric, x, cuts.point[m, 0], cuts.point[m, 1], cuts.point[m, 2]
            )
            _cross(normal, d, left)
            rise = polar[0] * left[0] + polar[1] * left[1] + polar[2] * left[2]
            if rise * rise <= _TANGENT**2 * _dot(polar, polar) * _dot(left, left):
                return -1
            if (rise > 0.0) != (way == 0):
                continue
            sign = 1.0 if way == 0 else -1.0
            length = math.sqrt(_dot(d, d))
            along = sign * _dot(d, cuts.inward[m])
            if abs(along) <= _TANGENT * length * math.sqrt(_dot(cuts.inward[m], cuts.inward[m])):
                return -1
            # Along a line through a vertex the distance from it tells the place.
            if center[3] != 0.0:
                cuts.place[m] = -sign * length
            else:
                cuts.place[m] = sign * _dot(d, cuts.point[m]) / length
            cuts.enters[m], cuts.listed[number] = along > 0.0, m
            number += 1
        _sort_places(cuts, number)
        m = 0
        while m < number:
            this = cuts.listed[m]
            for i in range(3):
                t[i] = vertex[i]
            if cuts.enters[this]:
                ends_there = m + 1 == number
                if ends_there and (center[3] == 0.0 or way == 1):
                    return -1
                if not ends_there:
                    if cuts.enters[cuts.listed[m + 1]]:
                        return -1
                    for i in range(3):
                        t[i] = cuts.point[cuts.listed[m + 1], i]
                count = _add_line(cuts.point[this], t, curves, count)
                m += 2
            else:
                if m > 0 or center[3] == 0.0 or way == 0:
                    return -1
                count = _add_line(t, cuts.point[this], curves, count)
                m += 1
            if count < 0:
                return -1
    return count


@lean
def _add_line(a, b, curves, count):
    if count >= curves.shape[0]:
        return -1
    for i in range(4):
        for k in range(3):
            curves[count, i, k] = a[k] + (b[k] - a[k]) * (i / 3.0)
    return count + 1
