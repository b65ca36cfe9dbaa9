"""Surfaces as one receiver sees them, quartered lazily into pieces, and their shadow edges.

The side of a piece that is seen follows from the sign of G(u, v) = −det(H, H_u, H_v), the height
of the receiver over the tangent plane at (u, v). G is linear in the receiver, so its Bernstein
coefficients (degree 8 x 8) are those of the tangent planes, computed once a patch, times the
receiver; by the convex hull property a piece whose coefficients have one sign has no silhouette.
"""

import math
from typing import NamedTuple

import numpy as np

from .compiled import kernel, lean
from .nets import extremes
from .piece_cuts import end_value, lay_out, restrict

#: How a surface is seen: not at all (below the horizon or edge-on), + side, − side, both.
NONE, FRONT, BACK, MIXED = 0, 1, 2, 3
#: Neighbour of a free edge, and of a side collapsed to a point, which casts no shadow.
FREE, COLLAPSED = -1, -2


class Surfaces(NamedTuple):
    """All surfaces that hide light; row p of every array is the same patch.

    Attributes
    ----------
    nets : (p, 4, 4, 4) array
        Homogeneous control nets. [m]
    kinds : (p,) int array
        `ray_patch.classify_patches`.
    tangents : (p, 9, 9, 4) array
        Bernstein coefficients of the tangent planes, about ``centers``.
    centers : (p, 3) array
        Origins of the tangent planes. [m]
    neighbors : (p, 4, 4) int array
        For each side: patch beyond it (or `FREE`, `COLLAPSED`), its side, 1 when its parameter
        runs the other way, and ±1 for the same or the opposite orientation.
    sheet : (p,) int array
        Connected sheet the patch belongs to.
    flags : (p,) int array
        `nets.PLANAR`, `CONVEX`, `CONCAVE`.
    """

    nets: np.ndarray
    kinds: np.ndarray
    tangents: np.ndarray
    centers: np.ndarray
    neighbors: np.ndarray
    sheet: np.ndarray
    flags: np.ndarray


class Pieces(NamedTuple):
    """Pool of pieces of one receiver; the first rows are the patches themselves."""

    nets: np.ndarray  # (k, 4, 4, 4) relative to the receiver
    heights: np.ndarray  # (k, 9, 9) coefficients of G
    state: np.ndarray  # (k,)
    patch: np.ndarray  # (k,)
    box: np.ndarray  # (k, 4)
    child: np.ndarray  # (k,) first of four children, −1 where there are none
    slack: np.ndarray  # (patches,) rounding of G
    used: np.ndarray  # (1,)


@kernel
def make_pieces(patches, capacity):
    """Empty pool for so many patches and ``capacity`` pieces of them."""
    k = patches + capacity
    return Pieces(
        np.empty((k, 4, 4, 4)),
        np.empty((k, 9, 9)),
        np.zeros(k, dtype=np.int64),
        np.empty(k, dtype=np.int64),
        np.empty((k, 4)),
        np.empty(k, dtype=np.int64),
        np.empty(patches),
        np.zeros(1, dtype=np.int64),
    )


@lean
def forget_pieces(pieces):
    """Keep the patches only: the next source needs other pieces."""
    pieces.used[0] = pieces.slack.shape[0]
    for b in range(pieces.slack.shape[0]):
        pieces.child[b] = -1


@lean
def side_seen(g, slack, skip):
    """`FRONT`, `BACK` or `MIXED` from coefficients (9, 9) beyond ``slack``.

    The row of a side that is collapsed to a point is 0 and says nothing: bit k of ``skip`` leaves
    out side k.
    """
    i0, i1 = (1 if skip & 8 else 0), (8 if skip & 2 else 9)
    j0, j1 = (1 if skip & 1 else 0), (8 if skip & 4 else 9)
    low, high = 1e300, -1e300
    for i in range(i0, i1):
        for j in range(j0, j1):
            low, high = min(low, g[i, j]), max(high, g[i, j])
    if low > slack:
        return FRONT
    if high < -slack:
        return BACK
    return MIXED


@lean
def _skip(neighbors, box):
    """Bits of the sides of a box that lie on collapsed sides of its patch."""
    skip = 0
    if neighbors[0, 0] == COLLAPSED and box[2] == 0.0:
        skip += 1
    if neighbors[1, 0] == COLLAPSED and box[1] == 1.0:
        skip += 2
    if neighbors[2, 0] == COLLAPSED and box[3] == 1.0:
        skip += 4
    if neighbors[3, 0] == COLLAPSED and box[0] == 0.0:
        skip += 8
    return skip


@lean
def see_tangents(tangents, center, x, g):
    """Write heights (9, 9) of ``x`` over tangent planes (9, 9, 4) to ``g``; return the rounding."""
    dx, dy, dz = x[0] - center[0], x[1] - center[1], x[2] - center[2]
    scale = 0.0
    for i in range(9):
        for j in range(9):
            t = tangents[i, j]
            g[i, j] = t[0] * dx + t[1] * dy + t[2] * dz + t[3]
            scale = max(scale, abs(t[0] * dx) + abs(t[1] * dy) + abs(t[2] * dz) + abs(t[3]))
    return 1e-12 * scale


@lean
def see_surfaces(surfaces, x, n, rounding, pieces):
    """Put all patches into the pool as receiver ``x`` with normal ``n`` sees them."""
    count = surfaces.nets.shape[0]
    pieces.used[0] = count
    for b in range(count):
        pieces.patch[b], pieces.child[b] = b, -1
        box = pieces.box[b]
        box[0], box[1], box[2], box[3] = 0.0, 1.0, 0.0, 1.0
        high = -1e300
        for i in range(4):
            for j in range(4):
                w = surfaces.nets[b, i, j, 3]
                pieces.nets[b, i, j, 3] = w
                up = 0.0
                for k in range(3):
                    d = surfaces.nets[b, i, j, k] - x[k] * w
                    pieces.nets[b, i, j, k] = d
                    up += n[k] * d
                high = max(high, up)
        pieces.slack[b] = see_tangents(
            surfaces.tangents[b], surfaces.centers[b], x, pieces.heights[b]
        )
        low_g, high_g = extremes(pieces.heights[b])
        if high <= rounding or (high_g <= pieces.slack[b] and low_g >= -pieces.slack[b]):
            pieces.state[b] = NONE
        else:
            skip = _skip(surfaces.neighbors[b], box)
            # A patch that is edge-on somewhere but never turns has no silhouette inside; along its
            # sides the neighbours tell. Between pieces of one patch nothing would tell: there the
            # sign has to be clear.
            pieces.state[b] = side_seen(pieces.heights[b], -pieces.slack[b], skip)


@kernel
def quarter(pieces, surfaces, i):
    """First of the four children of piece ``i``, made when asked for; −1 when the pool is full."""
    if pieces.child[i] >= 0:
        return pieces.child[i]
    first = pieces.used[0]
    if first + 4 > pieces.nets.shape[0]:
        return -1
    parts, work = np.empty((4, 4)), np.empty(9)
    box = pieces.box[i]
    patch = pieces.patch[i]
    mixed = pieces.state[i] == MIXED
    first_end, second_end, along_u = lay_out(
        pieces.nets[i], pieces.heights[i], pieces.slack[patch], mixed, parts
    )
    for k in range(4):
        own = pieces.box[first + k]
        for m in range(4):
            a, b = (box[0], box[1]) if m < 2 else (box[2], box[3])
            t = parts[k, m]
            own[m] = a if t <= 0.0 else b if t >= 1.0 else a + t * (b - a)
        if not (own[0] < own[1] and own[2] < own[3]):
            return -1
    for k in range(4):
        c = first + k
        pieces.patch[c], pieces.child[c] = patch, -1
        pieces.state[c] = pieces.state[i]
        net, g = pieces.nets[c], pieces.heights[c]
        for m in range(4):
            for n in range(4):
                for d in range(4):
                    net[m, n, d] = pieces.nets[i, m, n, d]
        for d in range(4):
            restrict(net[:, :, d], parts[k, 0], parts[k, 1], True, work)
            restrict(net[:, :, d], parts[k, 2], parts[k, 3], False, work)
        if mixed:
            for m in range(9):
                for n in range(9):
                    g[m, n] = pieces.heights[i, m, n]
            restrict(g, parts[k, 0], parts[k, 1], True, work)
            restrict(g, parts[k, 2], parts[k, 3], False, work)
            skip = _skip(surfaces.neighbors[patch], pieces.box[c])
            pieces.state[c] = side_seen(g, pieces.slack[patch], skip)
            away = first_end if k == 0 else second_end if k == 1 else -1
            if away >= 0:
                value = end_value(g, along_u, away)
                if abs(value) > pieces.slack[patch]:
                    pieces.state[c] = FRONT if value > 0.0 else BACK
    pieces.used[0] = first + 4
    pieces.child[i] = first
    return first


@kernel
def _neighbor_side(pieces, neighbors, patch, side, a, b):
    """Side from which ``patch`` is seen along [a, b] of one of its boundary sides."""
    if pieces.state[patch] != MIXED:
        return pieces.state[patch]
    g = np.empty(9)
    for k in range(9):
        if side == 0:
            g[k] = pieces.heights[patch, k, 0]
        elif side == 1:
            g[k] = pieces.heights[patch, 8, k]
        elif side == 2:
            g[k] = pieces.heights[patch, k, 8]
        else:
            g[k] = pieces.heights[patch, 0, k]
    # Two-sided de Casteljau: the part left of b, then the part of that right of a.
    for step in range(1, 9):
        for k in range(8, step - 1, -1):
            g[k] = (1.0 - b) * g[k - 1] + b * g[k]
    t = a / b if b > 0.0 else 0.0
    for step in range(1, 9):
        for k in range(9 - step):
            g[k] = (1.0 - t) * g[k] + t * g[k + 1]
    # At an end that is a side collapsed to a point G is 0 and says nothing.
    before, after = (3, 1) if side == 0 or side == 2 else (0, 2)
    k0 = 1 if a == 0.0 and neighbors[patch, before, 0] == COLLAPSED else 0
    k1 = 8 if b == 1.0 and neighbors[patch, after, 0] == COLLAPSED else 9
    low, high = 1e300, -1e300
    for k in range(k0, k1):
        low, high = min(low, g[k]), max(high, g[k])
    if low > pieces.slack[patch]:
        return FRONT
    if high < -pieces.slack[patch]:
        return BACK
    return MIXED


@lean
def casts_shadow_edge(pieces, surfaces, i, side):
    """Whether ``side`` of piece ``i`` may end its sheet as seen from the receiver: 0, 1 or 2.

    It does not inside a patch, nor where the neighbour continues seen from the same side; 2 says
    that a part of it may.
    """
    box = pieces.box[i]
    patch = pieces.patch[i]
    if side == 0:
        if box[2] > 0.0:
            return 0
        a, b = box[0], box[1]
    elif side == 1:
        if box[1] < 1.0:
            return 0
        a, b = box[2], box[3]
    elif side == 2:
        if box[3] < 1.0:
            return 0
        a, b = box[0], box[1]
    else:
        if box[0] > 0.0:
            return 0
        a, b = box[2], box[3]
    beyond = surfaces.neighbors[patch, side]
    if beyond[0] == COLLAPSED:
        return 0
    if beyond[0] < 0:
        return 1
    if beyond[2] == 1:
        a, b = 1.0 - b, 1.0 - a
    seen = _neighbor_side(pieces, surfaces.neighbors, beyond[0], beyond[1], a, b)
    if seen == MIXED:
        return 2
    if seen == NONE:
        return 1
    same = seen == pieces.state[i]
    return 1 if same == (beyond[3] < 0) else 0


@lean
def angular_size(s):
    """Radius of the control points about their middle, over its distance (of order; capped)."""
    cx = cy = cz = 0.0
    for i in (0, 3):
        for j in (0, 3):
            w = s[i, j, 3]
            cx += 0.25 * s[i, j, 0] / w
            cy += 0.25 * s[i, j, 1] / w
            cz += 0.25 * s[i, j, 2] / w
    radius = 0.0
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            d = math.sqrt(
                (s[i, j, 0] / w - cx) ** 2 + (s[i, j, 1] / w - cy) ** 2 + (s[i, j, 2] / w - cz) ** 2
            )
            radius = max(radius, d)
    distance = math.sqrt(cx * cx + cy * cy + cz * cz)
    return radius / max(distance, 1e-3 * radius + 1e-300)
