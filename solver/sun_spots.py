"""Elements on which the sun falls through openings too small to be found from the elements.

Sun that comes through an opening passes by the border of a patch. So rays go from points close
beside all borders away from the sun: where one meets an element to which the middle of the sun's
disc is open, there is a spot, however small. Openings of which the disc's middle is nowhere seen,
such as slits askew in thick walls, are not found so.
"""

from __future__ import annotations

import numpy as np

from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.elements import Elements
from .open_sky import OpenSky

#: Points along each border of a patch, and their distance from it, against the size of the scene:
#: narrower openings are none.
ALONG, BESIDE = 4, 1e-4
#: Distance of lit points before their surface, against the size of the scene.
LIFT = 1e-7


def spots(elements: Elements, toward: FloatArray, sky: OpenSky) -> tuple[IntArray, FloatArray]:
    """Elements (k,) that the sun falls on close beside a border, and where: u, v (k, 2) in them.

    Parameters
    ----------
    elements : Elements
        Of the mesh.
    toward : (3,) array
        Unit vector to the sun.
    sky : OpenSky
        Tells what is open.
    """
    beside = _beside_borders(sky)
    found = sky.first_hit(beside, np.broadcast_to(-toward, beside.shape))
    hit = np.flatnonzero(found.patch >= 0)
    points = beside[hit] - found.t[hit, None] * toward
    # The sun comes from the side that the ray meets.
    points = points + LIFT * sky.size * toward
    hit = hit[sky.is_open(points, np.broadcast_to(toward, points.shape))]
    patch, side = found.patch[hit], np.where(found.facing[hit] < 0, 1, 0)
    u, v = found.u[hit], found.v[hit]
    order = np.argsort(2 * elements.patch_index + elements.side, kind="stable")
    keys = (2 * elements.patch_index + elements.side)[order]
    first, last = (np.searchsorted(keys, 2 * patch + side, side=end) for end in ("left", "right"))
    rays = np.repeat(np.arange(len(hit)), last - first)
    own = order[_ranges(first, last)]
    u0, u1, v0, v1 = elements.boxes[own].T
    at = np.stack([(u[rays] - u0) / (u1 - u0), (v[rays] - v0) / (v1 - v0)], axis=1)
    inside = ((at >= 0.0) & (at <= 1.0)).all(axis=1)
    own, at = own[inside], at[inside]
    # The nets of elements on the − side run the other way along u.
    at[:, 0] = np.where(elements.side[own] == 1, 1.0 - at[:, 0], at[:, 0])
    return own, at


def _beside_borders(sky: OpenSky) -> FloatArray:
    """Points (k, 3) that lie a little beyond the borders of the patches, in line with these."""
    t = (np.arange(ALONG) + 0.5) / ALONG
    zero, one = np.zeros(ALONG), np.ones(ALONG)
    u, v = np.concatenate([zero, one, t, t]), np.concatenate([t, t, zero, one])
    points, su, sv = surface_points(sky.blockers.nets, u, v)
    along = np.where((np.arange(4 * ALONG) < 2 * ALONG)[:, None], sv, su)
    across = np.where((np.arange(4 * ALONG) < 2 * ALONG)[:, None], su, sv)
    length = (along**2).sum(axis=2, keepdims=True)
    across = across - along * (across * along).sum(axis=2, keepdims=True) / np.where(
        length > 0.0, length, 1.0
    )
    size = np.linalg.norm(across, axis=2, keepdims=True)
    outward = np.repeat([-1.0, 1.0, -1.0, 1.0], ALONG)[:, None] * across
    fine = (size > 0.0) & (length > 0.0)
    outward = np.where(fine, outward / np.where(fine, size, 1.0), 0.0)
    return np.asarray((points + BESIDE * sky.size * outward)[fine[..., 0]])


def _ranges(first: IntArray, last: IntArray) -> IntArray:
    """first[0] … last[0] − 1, first[1] … last[1] − 1, …"""
    count = last - first
    start = np.repeat(first - np.concatenate([[0], np.cumsum(count)[:-1]]), count)
    return np.asarray(start + np.arange(int(count.sum())))
