"""Light paths over mirrors: exact rays from mirror to mirror until they end on something else."""

import math
from typing import NamedTuple

import numpy as np

from .bvh import trace_ray
from .compiled import lean
from .ray_patch import MISS

#: Mirrors on one path, and the share of the light beyond which it is not followed.
MOST_MIRRORS, LEAST_SHARE = 64, 1e-5
#: How a path ends: out of the scene, on a surface, or nowhere, since it was followed long enough.
AWAY, LANDED, LOST = 0, 1, 2


class Tree(NamedTuple):
    """Patches for rays: the arrays of `raycast.RayCaster`."""

    bounds: np.ndarray
    links: np.ndarray
    piece_patch: np.ndarray
    piece_box: np.ndarray
    nets: np.ndarray
    kinds: np.ndarray


class Sides(NamedTuple):
    """Elements and mirrors by patch side 2 p + side.

    Attributes
    ----------
    start : (2p + 1,) int array
        First entry of each side in ``order``.
    order : (n,) int array
        Elements, side by side.
    boxes : (n, 4) array
        Parameter box of each element.
    mirror : (2p,) array
        Share that each side mirrors.
    """

    start: np.ndarray
    order: np.ndarray
    boxes: np.ndarray
    mirror: np.ndarray


class Walk(NamedTuple):
    """What one thread works in; `make_walk` makes it."""

    ray: np.ndarray
    place: np.ndarray
    stack: np.ndarray
    work: np.ndarray


@lean
def frame_at(net, u, v, place):
    """Point and unit +normal of a net at (u, v) into ``place`` (6,); returns |P_u × P_v|.

    On collapsed edges the normal, and the area, are those a little inside.
    """
    for _ in range(3):
        s, t = 1.0 - u, 1.0 - v
        h0 = h1 = h2 = h3 = a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = 0.0
        for i in range(4):
            if i == 0:
                p, dp = s * s * s, -3.0 * s * s
            elif i == 1:
                p, dp = 3.0 * s * s * u, 3.0 * s * (s - 2.0 * u)
            elif i == 2:
                p, dp = 3.0 * s * u * u, 3.0 * u * (2.0 * s - u)
            else:
                p, dp = u * u * u, 3.0 * u * u
            for j in range(4):
                if j == 0:
                    q, dq = t * t * t, -3.0 * t * t
                elif j == 1:
                    q, dq = 3.0 * t * t * v, 3.0 * t * (t - 2.0 * v)
                elif j == 2:
                    q, dq = 3.0 * t * v * v, 3.0 * v * (2.0 * t - v)
                else:
                    q, dq = v * v * v, 3.0 * v * v
                x, y, z, w = net[i, j, 0], net[i, j, 1], net[i, j, 2], net[i, j, 3]
                c = p * q
                h0, h1, h2, h3 = h0 + c * x, h1 + c * y, h2 + c * z, h3 + c * w
                c = dp * q
                a0, a1, a2, a3 = a0 + c * x, a1 + c * y, a2 + c * z, a3 + c * w
                c = p * dq
                b0, b1, b2, b3 = b0 + c * x, b1 + c * y, b2 + c * z, b3 + c * w
        h0, h1, h2 = h0 / h3, h1 / h3, h2 / h3
        a0, a1, a2 = (a0 - a3 * h0) / h3, (a1 - a3 * h1) / h3, (a2 - a3 * h2) / h3
        b0, b1, b2 = (b0 - b3 * h0) / h3, (b1 - b3 * h1) / h3, (b2 - b3 * h2) / h3
        x, y, z = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        area = math.sqrt(x * x + y * y + z * z)
        if area > 0.0 and area * area > 1e-18 * (a0 * a0 + a1 * a1 + a2 * a2) * (
            b0 * b0 + b1 * b1 + b2 * b2
        ):
            break
        u += 1e-4 * (0.5 - u)
        v += 1e-4 * (0.5 - v)
    inverse = 1.0 / max(area, 1e-300)
    place[0], place[1], place[2] = h0, h1, h2
    place[3], place[4], place[5] = x * inverse, y * inverse, z * inverse
    return area


@lean
def mirrored(ray, place):
    """Turn the ray's direction as the surface at ``place`` does, and start it there."""
    d = ray[3] * place[3] + ray[4] * place[4] + ray[5] * place[5]
    for k in range(3):
        ray[k] = place[k]
        ray[3 + k] -= 2.0 * d * place[3 + k]


@lean
def element_at(sides, row, u, v):
    """Element of patch side ``row`` that holds (u, v), −1 if there is none."""
    for k in range(sides.start[row], sides.start[row + 1]):
        e = sides.order[k]
        box = sides.boxes[e]
        if u >= box[0] and u <= box[1] and v >= box[2] and v <= box[3]:
            return e
    return -1


@lean
def next_hit(tree, walk, near):
    """First hit of the walk's ray beyond ``near``: (patch side or −1, u, v); it comes to ``place``.

    The ray's direction is of unit length; ``near`` keeps it from the surface it starts on. [m]
    """
    ray = walk.ray
    facing_filter = tree.kinds.shape[0] * 0  # not literals: they would compile the callees anew
    find_any = facing_filter != 0
    found, patch, _, u, v, facing = trace_ray(
        tree.bounds, tree.links, tree.piece_patch, tree.piece_box, tree.nets, tree.kinds,
        ray[0], ray[1], ray[2], ray[3], ray[4], ray[5], near, 1e300,
        facing_filter, find_any, walk.stack, walk.work,
    )  # fmt: skip
    if found == MISS:
        return -1, 0.0, 0.0
    frame_at(tree.nets[patch], u, v, walk.place)
    side = 1 if facing < 0 else 0
    if side == 1:
        for k in range(3):
            walk.place[3 + k] = -walk.place[3 + k]
    return 2 * patch + side, u, v
