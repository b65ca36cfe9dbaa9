"""Means of the sun's direct light over parts of elements, where the edge of a sun patch crosses.

An element takes light at its nodes for light all over it: at the edge of a sun patch that is wrong
by as much as a node stands for. There each unknown gets the mean over the part of the element that
it stands for, a part of the weight of its node, so that the light that elements get adds up to what
falls on them. It is told by rays from points spread evenly over the part to places spread evenly
over the disc.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .beams import LIFT, STEPS
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .model.sky import Sun, direction
from .open_sky import OpenSky
from .sun_spots import spots
from .unknowns import Unknowns, composite

#: Points a part at which it is looked whether an edge crosses it, and from which the mean is told:
#: the edge is found to an eighth of the part, and errors of parts along it have either sign.
LOOKS, POINTS = 32, 64
#: Points of a part on which there is a spot of the sun (`sun_spots`) that no more than this share
#: of the light at other points tells of, which is that of one of them.
SPOT_POINTS, SPOT = 2048, 0.04
#: Points told of at a time: some 60 MB.
AT_A_TIME = 200_000
#: Difference of light at the node and at the points that is none, relative.
_SAME = 1e-2


def put_sun_means(
    light: FloatArray, variance: FloatArray, sun: Sun, color: FloatArray, elements: Elements,
    unknowns: Unknowns, sky: OpenSky,
) -> NDArray[np.bool_]:  # fmt: skip
    """Put means into ``light`` (N, b) at the unknowns, in place; returns at which (N,).

    Parameters
    ----------
    light : (N, b) array
        Illuminance by ``sun`` at the unknowns. [lx]
    variance : (N,) array
        Of their light; that of means is added. [lx²]
    color : (b,) array
        Colour of the sun, of luminance 1.
    elements : Elements
        Of the mesh.
    unknowns : Unknowns
        Those of its elements, or of some of them more finely.
    sky : OpenSky
        Tells what is open, and what panes keep back.
    """
    rows, parts = _parts(elements, unknowns)
    toward = np.array(direction(sun.altitude_deg, sun.azimuth_deg))
    at_node = light[rows].max(axis=1) / color.max()
    nodes = unknowns.receivers.normals[rows, 0] @ toward
    free = sun.normal_illuminance_lx * np.maximum(nodes, 0.0)
    lit, most, differs = _mean(elements, unknowns.element[rows], parts, LOOKS, sun, sky)
    # As far as it is lit, behind panes by what they leave, or not, all over.
    left = free * lit / np.where(most > 0.0, most, 1.0)
    even = (differs <= _SAME * lit) & (np.abs(at_node - left) <= _SAME * left)
    even |= (lit <= _SAME * most) & (at_node <= _SAME * free)
    spot = np.zeros(len(rows), dtype=bool)
    dark = lit <= SPOT * most
    if sky.has_obstacles and dark.any():
        spot = dark & _with_spots(elements, unknowns.element[rows], parts, toward, sky)
    even &= ~spot
    for some, points in (
        (np.flatnonzero(~even & ~spot), POINTS),
        (np.flatnonzero(spot), SPOT_POINTS),
    ):
        if not len(some):
            continue
        found, whole, _ = _mean(
            elements, unknowns.element[rows[some]], parts[some], points, sun, sky
        )
        light[rows[some]] = found[:, None] * color
        variance[rows[some]] += (_deviation(points) * whole) ** 2
    told = np.zeros(len(light), dtype=bool)
    told[rows[~even]] = True
    return told


def _deviation(points: int) -> float:
    """Standard deviation of the share of a part that so many points tell.

    Evenly spread ones err by N^(−3/4) or so, half of that as edges cross parts anywhere.
    """
    return 0.5 * float(points) ** -0.75


def _with_spots(
    elements: Elements, element: IntArray, parts: FloatArray, toward: FloatArray, sky: OpenSky
) -> NDArray[np.bool_]:
    """Parts (k,) of elements that the sun falls on close beside a border of something."""
    found, at = spots(elements, toward, sky)
    out = np.zeros(len(parts), dtype=bool)
    order = np.argsort(element, kind="stable")
    keys = element[order]
    first, last = (np.searchsorted(keys, found, side=end) for end in ("left", "right"))
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        own = order[first[some] + k]
        u, v = at[some].T
        u0, u1, v0, v1 = parts[own].T
        out[own[(u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)]] = True
    return out


def _parts(elements: Elements, unknowns: Unknowns) -> tuple[IntArray, FloatArray]:
    """Unknowns (k,) of elements that get light all over, and the part (k, 4) that each stands for.

    Parts are u0, u1, v0, v1 of the net of the element.
    """
    count = np.bincount(unknowns.element, minlength=len(elements))
    first = np.searchsorted(unknowns.element, np.arange(len(elements)))
    rank = np.arange(len(unknowns.element)) - first[unknowns.element]
    whole = ~elements.buried.any(axis=1)
    order = unknowns.order
    rows, parts = [np.empty(0, dtype=np.int64)], [np.empty((0, 4))]
    for n in np.unique(count[whole]).tolist():
        side = math.isqrt(n)
        if n == 0 or side * side != n or (side > 1 and side % order):
            continue
        weight = np.full(side, 1.0 / side)
        if side > 1:
            weight = composite(order, side // order)[1]
        ends = np.append(0.0, np.cumsum(weight))
        ends[-1] = 1.0
        own = np.flatnonzero((whole & (count == n))[unknowns.element])
        u, v = rank[own] // side, rank[own] % side
        rows.append(own)
        parts.append(np.stack([ends[u], ends[u + 1], ends[v], ends[v + 1]], axis=1))
    found = np.concatenate(rows)
    back = np.argsort(found, kind="stable")
    return found[back], np.concatenate(parts)[back]


def _mean(
    elements: Elements, element: IntArray, parts: FloatArray, points: int, sun: Sun, sky: OpenSky
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean illuminance (k,) of parts by the sun, and what it is with nothing in the way. [lx]

    Also by how much it differs from one that has the same share of that all over, on average. Some
    parts are told of at a time, with the same numbers however many.
    """
    out = np.zeros((3, len(parts)))
    step = max(1, AT_A_TIME // points)
    for start in range(0, len(parts), step):
        some = slice(start, start + step)
        out[:, some] = _some_means(elements, element[some], parts[some], points, start, sun, sky)
    return out[0], out[1], out[2]


def _some_means(
    elements: Elements, element: IntArray, parts: FloatArray, points: int, first: int, sun: Sun,
    sky: OpenSky,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """The same of parts of which there are ``first`` before."""
    turn = first * points + np.arange(len(parts) * points).reshape(len(parts), points)
    a, b = (np.mod(0.5 + turn * step, 1.0) for step in STEPS)
    u = parts[:, :1] + a * (parts[:, 1:2] - parts[:, :1])
    v = parts[:, 2:3] + b * (parts[:, 3:] - parts[:, 2:3])
    where, su, sv = surface_points(elements.nets[element], u, v)
    vectors = np.cross(su, sv)
    size = np.linalg.norm(vectors, axis=2)
    normals = vectors / np.where(size > 0.0, size, 1.0)[..., None]
    share = size / np.maximum(size.sum(axis=1), 1e-300)[:, None]
    lift = LIFT * float(np.ptp(elements.nodes.reshape(-1, 3), axis=0).max(initial=0.0))
    where = where + lift * normals
    # Places on the disc, of equal area each, in another order than the points.
    radius = math.tan(math.radians(sun.angular_radius_arcmin / 60.0))
    far = radius * np.sqrt(np.mod(0.5 + turn * 0.618033988749895, 1.0))
    around = 2.0 * math.pi * np.mod(turn * 0.414213562373095, 1.0)
    toward = np.array(direction(sun.altitude_deg, sun.azimuth_deg))
    e1 = np.cross(toward, np.eye(3)[int(np.argmin(np.abs(toward)))])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(toward, e1)
    d = toward + (far * np.cos(around))[..., None] * e1 + (far * np.sin(around))[..., None] * e2
    cosine = np.maximum(normals @ toward, 0.0) * share
    seen = (cosine > 0.0) & (d[..., 2] > 0.0)
    keep = np.zeros(cosine.shape)
    keep[seen] = sky.is_open(where[seen], d[seen])
    lit = keep > 0.0
    keep[lit] = sky.share(where[lit], d[lit])
    level = sun.normal_illuminance_lx
    lit, most = (cosine * keep).sum(axis=1), cosine.sum(axis=1)
    share = lit / np.where(most > 0.0, most, 1.0)
    differs = (cosine * np.abs(keep - share[:, None])).sum(axis=1)
    return level * lit, level * most, level * differs
