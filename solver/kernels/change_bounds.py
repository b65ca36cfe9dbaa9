"""How much light at receivers may be wrong where form factors are left as they were before a move.

Light changes along the lines of sight that meet what has moved, at its old place or its new one,
and along no others. How many of the first there are, the old form factors say; those of the second
kind are no more than what is seen of the moved elements with nothing in the way, nor than what was
seen where they stand now. Along each the exitance changes from that of one element in the way to
that of another: by no more than the largest of those that lie before, in or behind the places.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from .compiled import lean, parallel
from .shafts import find_near, is_before, meets_parts


class Newcomers(NamedTuple):
    """Elements that have moved, as they stand now; row k of every array is one of them.

    Attributes
    ----------
    points, vectors : (k, 3) array
        Mean points [m] and unit vectors along their vector areas.
    areas, reaches : (k,) array
        Areas [m²], and largest distances from the mean points. [m]
    turns : (k,) array
        Sine of the largest angle between normals and the vector area; 0 where flat.
    """

    points: np.ndarray
    vectors: np.ndarray
    areas: np.ndarray
    reaches: np.ndarray
    turns: np.ndarray


@lean
def view_at_most(x, y, z, normal, new):
    """Upper bound of the unoccluded form factor of all newcomers together; at most 1."""
    total = 0.0
    for k in range(new.areas.shape[0]):
        rx, ry, rz = new.points[k, 0] - x, new.points[k, 1] - y, new.points[k, 2] - z
        reach, turn = new.reaches[k], new.turns[k]
        up = normal[0] * rx + normal[1] * ry + normal[2] * rz + reach
        if up <= 0.0:
            continue
        distance = math.sqrt(rx * rx + ry * ry + rz * rz)
        facing = -(new.vectors[k, 0] * rx + new.vectors[k, 1] * ry + new.vectors[k, 2] * rz)
        if turn > 0.0:
            facing += turn * (distance + reach) + reach
        if facing <= 0.0:
            continue
        nearest = distance - reach
        if nearest <= 0.0:
            return 1.0
        cosines = min(up / nearest, 1.0) * min(facing / nearest, 1.0)
        total += cosines * new.areas[k] / (math.pi * nearest * nearest)
    return min(total, 1.0)


@parallel
def bound_changes(
    nodes, normals, lifts, asked, factors, outside, light, seen, moved, new, places, bounds
):
    """Bound by how much the light of receivers may be off with the form factors as they are.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    lifts : (m,) array
        By how much the places are larger for each receiver. [m]
    asked : (m,) bool array
        Receivers that are asked about.
    factors : (m, n) array
        Form factors as they were.
    outside : (m,) array
        The same of sky and ground, where there is no light.
    light : (n,) array
        Exitance of the elements. [lm/m²]
    seen : Seen
        The elements as they stood.
    moved : (n,) bool array
        Elements that have moved.
    new : Newcomers
        These, as they stand now.
    places : Places
        All that has moved: the last of them where it is, others where it was.
    bounds : (m,) array
        Receives the bounds of those that are asked about. [lx]
    """
    n = factors.shape[1]
    brightest = 0.0
    for j in range(n):
        brightest = max(brightest, light[j] if moved[j] else 0.0)
    for i in nb.prange(nodes.shape[0]):
        if not asked[i]:
            continue
        near, old = np.empty(n, dtype=np.bool_), 0.0
        for j in range(n):
            old += factors[i, j] if moved[j] else 0.0
        high, view = brightest, 0.0
        for q in range(nodes.shape[1]):
            x, y, z, normal = nodes[i, q, 0], nodes[i, q, 1], nodes[i, q, 2], normals[i, q]
            for w in range(places.wholes.shape[0]):
                if not is_before(x, y, z, normal, places.wholes[w], lifts[i]):
                    continue
                find_near(x, y, z, places.wholes[w], lifts[i], seen.spheres, near)
                through, most = outside[i], 0.0
                if w == places.wholes.shape[0] - 1:
                    most = view_at_most(x, y, z, normal, new)
                for j in range(n):
                    # What is neither brighter nor tells more is not asked about.
                    asks = near[j] and (light[j] > high or (through < most and factors[i, j] > 0.0))
                    if asks and meets_parts(x, y, z, normal, lifts[i], seen, j, places, w):
                        high = max(high, light[j])
                        through += factors[i, j]
                view = max(view, min(most, through))
        change = old + view
        bounds[i] = change * high if change > 0.0 else 0.0
