"""From one value an element to a continuous function: values at element corners.

Elements carry means; pictures need something smooth in between. A corner inside a face gets the
area-weighted mean of the elements around it. On the rim of a face that mean lies half an element
inside, so the rim is extrapolated: an element's mean is about that of two opposite corners, hence
2 · mean − opposite corner, averaged over the elements at the rim corner. Both are exact for
functions linear in the parameters on even meshes. Corners that hang on the edge of a larger
neighbour are interpolated along that edge, so that no step shows there.

Where elements about a corner differ by more than `JUMP`, there is an edge of shadow between them,
as beside plates that hang close to a wall: there bright and dark ones each have a corner of their
own, as on the rim of a face. A mean of both would darken what is lit, an element wide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .model.arrays import FloatArray, IntArray
from .model.bezier import bernstein
from .model.elements import Elements
from .model.scene import SceneData

Hanging = tuple[IntArray, IntArray, IntArray, FloatArray]
#: Corners closer than this, relative to the scene's size, are one.
_WELD = 1e-7
#: Ratio of light on elements that share a corner from which on there is an edge between them, and
#: the share of the mean of all light below which it is none. Elements are cut where the light of
#: lamps varies: next to each other it differs by less unless something hides it.
JUMP, NOTHING = 3.0, 0.01
#: Columns of a box (u0, u1, v0, v1) at corners (u0, v0), (u1, v0), (u1, v1), (u0, v1).
_U, _V = (0, 1, 1, 0), (2, 2, 3, 3)
#: Places on an edge where smaller neighbours may have a corner.
_SHARES = (0.25, 0.5, 0.75)


def corner_values(scene: SceneData, elements: Elements, values: FloatArray) -> FloatArray:
    """Values (n, 4, c) at the corners of each element's box from element means (n, c).

    Corners are in the order (u0, v0), (u1, v0), (u1, v1), (u0, v1). Patches of one face with the
    same material share corners; other patches do not. Values are means over the part of an element
    that is not buried; wholly buried elements count for nothing.
    """
    n = len(elements)
    if n == 0:
        return np.zeros((0, 4, values.shape[1]))
    u, v = elements.boxes[:, _U], elements.boxes[:, _V]
    # Light that never reaches the part under another solid must not darken what is beside it.
    free = np.where(elements.buried, 0.0, elements.weights).sum(axis=1)
    vertex, hanging = _parted(*_welded(scene, elements, u, v), values.sum(axis=1), free)
    count = int(vertex.max()) + 1
    means = np.repeat(values[:, None, :], 4, axis=1)
    areas = np.repeat(free[:, None], 4, axis=1)
    result, _ = _averaged(means, areas, vertex, count)
    rim = _rim(vertex[free > 0.0], hanging, count)
    inner = result.copy()
    open_rim = rim.copy()
    # Opposite corners first, then the neighbours along the edges; strips one element wide keep
    # their means.
    for turns in ((2,), (1, 3)):
        other = np.stack([vertex[:, [(k + t) % 4 for k in range(4)]] for t in turns])
        usable = np.where(rim[other], 0.0, areas)
        at_corner = np.broadcast_to(vertex, other.shape)
        guess, found = _averaged(2.0 * means - inner[other], usable, at_corner, count)
        take = open_rim & found
        result[take] = np.maximum(guess[take], 0.0)
        open_rim &= ~found
    rows, first, second, share = hanging
    for _ in range(8):  # an edge may end in corners that hang themselves
        result[rows] = (1.0 - share[:, None]) * result[first] + share[:, None] * result[second]
    return np.ascontiguousarray(result[vertex])


def _averaged(
    at_corners: FloatArray, weight: FloatArray, vertex: IntArray, count: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Weighted means (count, c) of corner values (..., 4, c), and which vertices have weight."""
    flat, ids, w = at_corners.reshape(vertex.size, -1), vertex.ravel(), weight.ravel()
    total = np.bincount(ids, w, count)
    columns = [np.bincount(ids, w * c, count) for c in flat.T]
    return np.stack(columns, axis=-1) / np.maximum(total, 1e-300)[:, None], total > 0.0


def _parted(
    vertex: IntArray, hanging: Hanging, light: FloatArray, free: FloatArray
) -> tuple[IntArray, Hanging]:
    """Vertices (n, 4) and those hanging, two for one where an edge of shadow runs through it.

    Parameters
    ----------
    vertex, hanging : (n, 4) int array, tuple
        As `_welded` has them.
    light : (n,) array
        By which bright elements are told from dark ones.
    free : (n,) array
        Area of each that is not buried; elements without any are not looked at.
    """
    ids, count = vertex.ravel(), int(vertex.max()) + 1
    own, counts = np.repeat(light, 4), np.repeat(free > 0.0, 4)
    most, least = np.zeros(count), np.full(count, np.inf)
    np.maximum.at(most, ids[counts], own[counts])
    np.minimum.at(least, ids[counts], own[counts])
    least = np.minimum(least, most)
    mean = float(light @ free) / max(float(free.sum()), 1e-300)
    jump = (most > JUMP * least) & (most > NOTHING * mean)
    # Between bright and dark in the middle of their ratio; nothing is as dark as a hundredth.
    between = np.sqrt(most * np.maximum(least, NOTHING * most))
    dark = jump[ids] & (own < between[ids])
    other = np.full(count, -1)
    split = np.unique(ids[dark])
    other[split] = count + np.arange(len(split))
    parted = np.where(dark, other[ids], ids)
    middle, first, second, share = hanging
    # Each of the two hangs on the edge beside it if that is lit alike.
    rows = np.arange(len(middle))
    some = rows[other[middle] >= 0]
    hung = np.concatenate([middle, other[middle[some]]])
    rows = np.concatenate([rows, some])
    size = np.bincount(parted, counts * np.repeat(free, 4), count + len(split))
    sums = np.bincount(parted, counts * np.repeat(free, 4) * own, count + len(split))
    level = sums[hung] / np.maximum(size[hung], 1e-300)
    beside = light[first[rows] // 4]
    low, high = np.minimum(level, beside), np.maximum(level, beside)
    alike = (high <= JUMP * low) | (high <= NOTHING * mean)
    rows, hung = rows[alike], hung[alike]
    ends = parted[first[rows]], parted[second[rows]]
    return parted.reshape(-1, 4), (hung, *ends, share[rows])


def _welded(
    scene: SceneData, elements: Elements, u: FloatArray, v: FloatArray
) -> tuple[IntArray, Hanging]:
    """Vertices at the corners (n, 4), one for a place, face, side and material; and those hanging.

    Hanging are vertices at a quarter, half or three quarters of another element's edge: they come
    as (vertex, row of the edge's first corner, row of its second, share along the edge), rows being
    those of the corners of all elements, four each.
    """
    patches, p, side = scene.patches, elements.patch_index, elements.side
    low, high = patches.bounds()
    step = _WELD * max(float(np.linalg.norm(high - low)), 1e-300)
    owner = np.stack([patches.face_index[p], side, scene.material_index[p, side]], axis=-1)
    owner = np.unique(owner, axis=0, return_inverse=True)[1].reshape(-1)
    nets = patches.control_points[p]

    def keys_at(u: FloatArray, v: FloatArray) -> IntArray:
        h = np.einsum("nci,ncj,nijk->nck", bernstein(u), bernstein(v), nets, optimize=True)
        place = np.floor((h[..., :3] / h[..., 3:] - low) / step + 0.5).astype(np.int64)
        owners = np.repeat(owner[:, None, None], u.shape[1], axis=1)
        return np.concatenate([place, owners], axis=-1).reshape(-1, 4)

    count = 4 * len(elements)
    keys = [keys_at(u, v)]
    following = (1, 2, 3, 0)
    for share in _SHARES:
        keys.append(
            keys_at(
                (1.0 - share) * u + share * u[:, following],
                (1.0 - share) * v + share * v[:, following],
            )
        )
    places = np.unique(np.concatenate(keys), axis=0, return_inverse=True)[1].reshape(-1)
    # Places that are no corner of any element are dropped from the numbering.
    rank = np.full(int(places.max()) + 1, -1)
    corners = np.unique(places[:count])
    rank[corners] = np.arange(len(corners))
    number = rank[places].reshape(-1, count)
    first = np.arange(count)
    second = first.reshape(-1, 4)[:, following].ravel()
    hits = [
        (number[k + 1], first, second, np.full(count, share)) for k, share in enumerate(_SHARES)
    ]
    middle, first, second, shares = (np.concatenate(parts) for parts in zip(*hits, strict=True))
    corner = number[0]
    real = (middle >= 0) & (middle != corner[first]) & (middle != corner[second])
    middle, rows = np.unique(middle[real], return_index=True)
    hanging = (middle, first[real][rows], second[real][rows], shares[real][rows])
    return number[0].reshape(-1, 4), hanging


def _rim(vertex: IntArray, hanging: Hanging, count: int) -> IntArray:
    """Whether each vertex lies on an edge that only one element has: (count,) bool."""
    edges = np.stack([vertex, vertex[:, (1, 2, 3, 0)]], axis=-1).reshape(-1, 2)
    edges = np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)  # collapsed edges have no length
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    hangs = np.zeros(count, dtype=bool)
    hangs[hanging[0]] = True
    parents = np.sort(np.stack([hanging[1], hanging[2]], axis=-1), axis=1)
    code = edges[:, 0] * count + edges[:, 1]
    shared = np.isin(code, parents[:, 0] * count + parents[:, 1])
    alone = edges[(uses == 1) & ~shared & ~hangs[edges].any(axis=1)]
    rim = np.zeros(count, dtype=bool)
    rim[alone.ravel()] = True
    return rim
