"""Flat mirrors as windows: what is seen in one is the scene itself, from the receiver's image.

The path from a receiver x over a flat mirror to a lamp is straight when it is seen from the image
x' of x behind the mirror's plane. Behind the plane it may be met by the image of the scene, before
it by the scene; in the plane it must pass the mirror's outline. A frame around the outline hides
all else from finite distances; of light from infinity, what the outline would hide is what comes
through it. So the form factors, and the pyramids, of a scene without mirrors serve here, and are as
exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray
from .model.bezier import sub_net
from .model.elements import Elements
from .model.patches import PatchSet
from .surfaces import Receivers

if TYPE_CHECKING:
    from .kernels.pyramid import Blockers

#: Distance from the plane that is none, against the size of the scene.
TOUCH = 1e-9
#: Radius of a sphere that lies below every horizon: kernels skip what it is about. [m]
NOWHERE = -1e300
#: How often a patch that the plane cuts askew, or an outline that is not star-shaped, is quartered.
_CUTS, _SPLITS = 3, 3


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane with mirrors in it, its normal (3,) on their side: normal · x = offset. [m]"""

    normal: FloatArray
    offset: float

    def height(self, points: FloatArray) -> FloatArray:
        """Distance of points (..., 3) from the plane, on the side of the mirrors. [m]"""
        return np.asarray(points @ self.normal - self.offset)

    def image(self, points: FloatArray) -> FloatArray:
        """Images of points (..., 3). [m]"""
        return np.asarray(points - 2.0 * self.height(points)[..., None] * self.normal)

    def turned(self, vectors: FloatArray) -> FloatArray:
        """Images of vectors (..., 3)."""
        return np.asarray(vectors - 2.0 * (vectors @ self.normal)[..., None] * self.normal)

    def image_net(self, nets: FloatArray) -> FloatArray:
        """Images of nets (..., 4, 4, 4); +normals stay on the same side of the material."""
        out = np.array(nets)
        height = nets[..., :3] @ self.normal - self.offset * nets[..., 3]
        out[..., :3] -= 2.0 * height[..., None] * self.normal
        return np.ascontiguousarray(out[..., ::-1, :, :])


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Parts of patches before a plane: patch (k,), parameter box (k, 4) and net (k, 4, 4, 4)."""

    patch: IntArray
    boxes: FloatArray
    nets: FloatArray


def pieces_before(nets: FloatArray, plane: Plane, touch: float) -> Pieces:
    """What of patches (p, 4, 4, 4) lies before a plane, farther than ``touch`` [m].

    A patch that the plane cuts along a parameter line is cut exactly; one that it cuts askew in
    eighths, of which those count whose middle is before it.
    """
    patch, boxes, out = [], [], []
    whole = (0.0, 1.0, 0.0, 1.0)
    for p, net in enumerate(nets):
        stack = [(whole, 0)]
        while stack:
            box, level = stack.pop()
            own = net if box == whole else sub_net(net, *box)
            height = own[..., :3] @ plane.normal - plane.offset * own[..., 3]
            limit = touch * own[..., 3]
            if (height <= limit).all():
                continue
            if not (height >= -limit).all():
                if level == 0 and (cut := _line_of(height)) is not None:
                    u0, u1, v0, v1 = box
                    axis, t = cut
                    parts = (
                        [(u0, t, v0, v1), (t, u1, v0, v1)]
                        if axis == 0
                        else [(u0, u1, v0, t), (u0, u1, t, v1)]
                    )
                    stack += [(part, _CUTS) for part in parts]
                    continue
                if level < _CUTS:
                    u, v = 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3])
                    stack += [
                        ((a, b, c, d), level + 1)
                        for a, b in ((box[0], u), (u, box[1]))
                        for c, d in ((box[2], v), (v, box[3]))
                    ]
                    continue
                weight = np.array([1.0, 3.0, 3.0, 1.0])
                if weight @ height @ weight <= 0.0:
                    continue
            patch.append(p)
            boxes.append(box)
            out.append(own)
    return Pieces(
        np.array(patch, dtype=np.int64),
        np.array(boxes).reshape(-1, 4),
        np.array(out).reshape(-1, 4, 4, 4),
    )


def _line_of(height: FloatArray) -> tuple[int, float] | None:
    """Parameter line along which heights (4, 4) vanish: its direction and place, if it is one."""
    small = 1e-12 * float(np.abs(height).max())
    for axis in (0, 1):
        line = height if axis == 0 else height.T
        if np.ptp(line, axis=1).max() > small:
            continue
        c = line[:, 0]
        if np.sum(np.diff(np.sign(c[np.abs(c) > small])) != 0.0) != 1:
            return None
        low, high, rising = 0.0, 1.0, c[np.abs(c) > small][0] < 0.0
        for _ in range(60):
            t = 0.5 * (low + high)
            s = 1.0 - t
            value = s**3 * c[0] + 3 * s * s * t * c[1] + 3 * s * t * t * c[2] + t**3 * c[3]
            if (value < 0.0) == rising:
                low = t
            else:
                high = t
        return axis, 0.5 * (low + high)
    return None


def windows(net: FloatArray, plane: Plane) -> list[FloatArray] | None:
    """Parts of a flat net (4, 4, 4) with star-shaped outlines; none if its outline is too wild."""
    todo, out = [(net, 0)], []
    while todo:
        own, level = todo.pop()
        if _is_star(own, plane):
            out.append(own)
        elif level == _SPLITS:
            return None
        else:
            todo += [
                (sub_net(own, a, a + 0.5, b, b + 0.5), level + 1)
                for a in (0, 0.5)
                for b in (0, 0.5)
            ]
    return out


def _outline(net: FloatArray) -> FloatArray:
    """Edges (4, 4, 4) of a net, one after the other."""
    return np.stack([net[:, 0], net[3, :], net[::-1, 3], net[0, ::-1]])


def _center(net: FloatArray) -> FloatArray:
    weight = np.array([1.0, 3.0, 3.0, 1.0])
    h = np.einsum("i,j,ijk->k", weight, weight, net)
    return np.asarray(h[:3] / h[3])


def _is_star(net: FloatArray, plane: Plane) -> bool:
    """Whether every ray from the middle leaves a flat net once, as its control polygon tells."""
    edges = _outline(net)
    arms = edges[..., :3] / edges[..., 3:] - _center(net)
    turn = np.cross(arms[:, :-1], arms[:, 1:]) @ plane.normal
    size = np.abs(arms).max() ** 2
    return bool((turn > -1e-12 * size).all() or (turn < 1e-12 * size).all())


def frame_around(net: FloatArray, radius: float) -> FloatArray:
    """Patches (≤ 4, 4, 4, 4) in the plane of a flat net, from its outline out to ``radius`` [m]."""
    center, out = _center(net), []
    edges = _outline(net)
    points = edges[..., :3] / edges[..., 3:]
    # A cubic may come nearer to the middle than its control points.
    t = np.linspace(0.0, 1.0, 17)[:, None]
    b = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    dense = np.einsum("ti,eik->etk", b, edges)
    away = np.linalg.norm(dense[..., :3] / dense[..., 3:] - center, axis=-1)
    reach = np.linalg.norm(points - center, axis=-1).max()
    factor = 2.0 * (radius + reach) / max(float(away.min()), 1e-6 * reach)
    for edge, line in zip(edges, points, strict=True):
        if np.abs(line - line[0]).max() <= 1e-12 * reach:
            continue  # a corner
        far = edge.copy()
        far[:, :3] = (center + factor * (line - center)) * edge[:, 3:]
        share = np.linspace(0.0, 1.0, 4)[:, None, None]
        out.append((1.0 - share) * edge[None] + share * far[None])
    return np.array(out)


@dataclass(eq=False)
class Window:
    """One mirror outline, and all that light through it may meet.

    Attributes
    ----------
    plane : Plane
        Of the mirror.
    net : (4, 4, 4) array
        Its outline.
    share : float
        Share of the light that it mirrors.
    patch, side : int
        Patch side that it belongs to.
    nets : (p, 4, 4, 4) array
        Patches of the scene.
    closed, solid : (p,) array
        As in `topology.make_blockers`.
    pieces : Pieces
        What of them lies before the plane.
    trace : bool
        Whether they hide anything; the frame always does.
    """

    plane: Plane
    net: FloatArray
    share: float
    patch: int
    side: int
    nets: FloatArray
    closed: IntArray
    solid: IntArray
    pieces: Pieces
    trace: bool = True

    @property
    def count(self) -> int:
        """Patches before the plane."""
        return len(self.pieces.patch)

    @cached_property
    def near(self) -> Blockers:
        """What hides things of the scene: patches before the plane, their images, and a frame."""
        points = (self.nets[..., :3] / self.nets[..., 3:]).reshape(-1, 3)
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        return self._blockers(frame_around(self.net, size))

    @cached_property
    def open(self) -> Blockers | None:
        """What hides light from infinity, were there nothing in the plane; None for nothing."""
        return self._blockers(self.net[None][:0]) if self.count and self.trace else None

    @cached_property
    def shut(self) -> Blockers:
        """The same with the outline hiding what is behind it."""
        return self._blockers(self.net[None])

    def _blockers(self, more: FloatArray) -> Blockers:
        """Patches before the plane, their images, and ``more`` (k, 4, 4, 4) in it."""
        from .topology import adjacency, make_blockers

        pieces, plane = self.pieces, self.plane
        own, closed = self.solid[pieces.patch], self.closed[pieces.patch]
        # What the plane cuts and its image are one body, others and their images are two.
        points = self.nets[..., :3] / self.nets[..., 3:]
        low = plane.height(points).reshape(len(self.nets), -1).min(axis=1)
        crossing = np.unique(self.solid[low < -TOUCH * float(np.ptp(points))])
        images = np.where(np.isin(own, crossing), own, own + int(self.solid.max()) + 1)
        core = np.concatenate([pieces.nets, plane.image_net(pieces.nets)])
        solid = np.concatenate([own, images])
        beside = adjacency(core, solid)
        around = adjacency(more, np.zeros(len(more), np.int64), relative=1e-9)
        around[around >= 0] += len(core)
        blockers = make_blockers(
            PatchSet(np.concatenate([core, more])),
            np.concatenate([closed, closed, np.zeros(len(more), bool)]),
            np.concatenate([solid, np.full(len(more), int(solid.max(initial=0)) + 1)]),
            np.concatenate([beside, around]),
        )
        if self.trace:
            return blockers
        spheres = blockers.spheres.copy()
        spheres[: len(core), 3] = NOWHERE
        return blockers._replace(spheres=spheres)

    def lamps(
        self, elements: Elements, rows: IntArray, kind: IntArray
    ) -> tuple[Elements, IntArray]:
        """Lamps before the plane, in one piece for each patch of `near`, and an element of each.

        Parameters
        ----------
        elements : Elements
            Of the scene.
        rows : (k,) int array
            Those that are lamps.
        kind : (k,) int array
            Equal numbers for lamps of equal light: patches on which all elements are of one kind
            are taken whole.
        """
        key = 2 * elements.patch_index[rows] + elements.side[rows]
        first: dict[int, int] = {}
        uneven = set()
        for row, own, light in zip(rows.tolist(), key.tolist(), kind.tolist(), strict=True):
            if own in first and kind[np.searchsorted(rows, first[own])] != light:
                uneven.add(own)
            first.setdefault(own, row)
        whole = np.array([own not in uneven for own in key.tolist()], dtype=bool)
        single = np.unique([first[own] for own in key[whole].tolist()]).astype(np.int64)
        boxes = elements.boxes.copy()
        boxes[single] = (0.0, 1.0, 0.0, 1.0)
        return self._parts(elements, boxes, np.sort(np.concatenate([single, rows[~whole]])))

    def _parts(
        self, elements: Elements, ends: FloatArray, rows: IntArray
    ) -> tuple[Elements, IntArray]:
        """What of the boxes ``ends`` (n, 4) of some elements lies before the plane, and whose."""
        boxes, owner = [], []
        for k in range(self.count):
            u0, u1, v0, v1 = self.pieces.boxes[k]
            for row in rows[elements.patch_index[rows] == self.pieces.patch[k]]:
                a, b, c, d = ends[row]
                part = (max(a, u0), min(b, u1), max(c, v0), min(d, v1))
                if part[0] < part[1] and part[2] < part[3]:
                    lu, lv = u1 - u0, v1 - v0
                    u = (part[0] - u0) / lu, (part[1] - u0) / lu
                    v = (part[2] - v0) / lv, (part[3] - v0) / lv
                    boxes.append((k, elements.side[row], *u, *v))
                    owner.append(row)
        if not boxes:
            return elements.take(np.zeros(0, np.int64)), np.zeros(0, np.int64)
        table = np.array(boxes, dtype=np.float64)
        order = np.lexsort((table[:, 4], table[:, 2], table[:, 1], table[:, 0]))
        table = table[order]
        parts = Boxes(table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2:])
        return elements_on(PatchSet(self.near.nets), parts, nodes=1), np.array(owner)[order]

    def shows(self, points: FloatArray, toward: FloatArray, angle: float) -> NDArray[np.bool_]:
        """Whether the outline may show points (..., 3) what is far off within ``angle`` of a line.

        ``points`` are images of receivers, ``toward`` (3,) is of unit length. [rad]
        """
        steep = float(toward @ self.plane.normal)
        if steep <= 0.0:
            return np.zeros(points.shape[:-1], dtype=bool)
        way = -self.plane.height(points) / steep
        middle = _center(self.net)
        reach = np.linalg.norm(self.net[..., :3] / self.net[..., 3:] - middle, axis=-1).max()
        off = np.linalg.norm(points + way[..., None] * toward - middle, axis=-1)
        return np.asarray((way > 0.0) & (off <= 1.01 * reach + 2.0 * way * angle / steep))

    def image_of(self, receivers: Receivers) -> Receivers:
        """Images of receivers before the plane; what is behind it gets no share."""
        nodes = receivers.nodes
        before = self.plane.height(nodes) > 0.0
        places = np.full(len(self.nets), -1)
        single = np.bincount(self.pieces.patch, minlength=len(self.nets))[self.pieces.patch] == 1
        places[self.pieces.patch[single]] = self.count + np.flatnonzero(single)
        return replace(
            receivers,
            nodes=self.plane.image(nodes),
            normals=self.plane.turned(receivers.normals),
            weights=np.where(before, receivers.weights, 0.0),
            patches=np.where(receivers.patches >= 0, places[receivers.patches], -1),
            own=np.full(len(nodes), -1),
        )
