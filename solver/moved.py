"""Form factors after parts have moved: only those of pairs between which the change may be.

A form factor stays when no line of sight from its receiver to its element can meet what moved, at
its old place or its new one: when that lies behind the receiver, or behind the element where it is
flat, or misses the hull of both. What has moved itself is found anew, and what it sees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .exchange import OUTSIDE, Rows
from .kernels.nets import PLANAR
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .model.patches import PatchSet
from .model.scene import SceneData
from .row_finder import Ask
from .surfaces import Receivers
from .topology import bounding_spheres, writable

if TYPE_CHECKING:
    from .kernels.shafts import Places


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """What of some rows must be found anew.

    Attributes
    ----------
    again : (m,) bool array
        Rows of which anything must.
    pairs : (m, n) bool array
        Form factors that must.
    places : (b, 4) array
        Balls about the parts that have moved, where they were and where they are. [m]
    whole : (m,) bool array
        Rows in which what is seen of sky and ground must be found, too.
    """

    again: NDArray[np.bool_]
    pairs: NDArray[np.bool_]
    places: FloatArray
    whole: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """Rows that were found among surfaces, to be compared with others of the same parts.

    Attributes
    ----------
    nets : (p, 4, 4, 4) array
        Control nets of the patches.
    receivers : Receivers
        Of the m rows.
    lifts : (m,) array or None
        As in `Ask`.
    sources, patch : (n, 4, 4, 4) and (n,) array
        Nets of the elements, and the patches they are of.
    spheres, cell_eps, dim : (n, 4), (n,) and (n,) array
        Of the elements, as in `Sources`.
    planes, corners : (n, 4) and (n, 4, 3) array
        Of the flat ones among them, as in `kernels.shafts.Seen`.
    found : tuple
        The rows, and what was told with them.
    tone : (10,) or (0,) array
        Of the sky they were found under.
    """

    nets: FloatArray
    receivers: Receivers
    lifts: FloatArray | None
    sources: FloatArray
    patch: IntArray
    spheres: FloatArray
    cell_eps: FloatArray
    dim: FloatArray
    planes: FloatArray
    corners: FloatArray
    found: tuple[object, ...]
    tone: FloatArray

    @classmethod
    def of(
        cls, nets: FloatArray, asked: Ask, found: tuple[object, ...], tone: FloatArray
    ) -> Arrangement:
        sources = asked.sources
        planes, corners = _planes(sources)
        return cls(
            nets=nets,
            receivers=asked.receivers,
            lifts=asked.lifts,
            sources=sources.nets,
            patch=sources.patch,
            spheres=sources.spheres,
            cell_eps=sources.cell_eps,
            dim=sources.dim,
            planes=planes,
            corners=corners,
            found=found,
            tone=tone,
        )

    @property
    def rows(self) -> Rows:
        """What was found."""
        rows = self.found[0]
        assert isinstance(rows, Rows)
        return rows

    def changed(self, patches: PatchSet, asked: Ask, *, sees_out: bool) -> Changed | None:
        """Which pairs must be found anew among ``patches``; None where nothing is known of them.

        Unless light ``sees_out`` of the scene, what rows know of sky and ground is rounding.
        """
        new, old, rows, sources = asked.receivers, self.receivers, self.rows, asked.sources
        nets = patches.control_points
        same = (
            nets.shape == self.nets.shape
            and new.nodes.shape == old.nodes.shape
            and np.array_equal(new.own, old.own)
            and np.array_equal(new.patches, old.patches)
            and np.array_equal(self.cell_eps, sources.cell_eps)
            and np.array_equal(self.dim, sources.dim)
            and np.array_equal(self.patch, sources.patch)
        )
        if not same:
            return None
        dirty = moved_patches(self.nets, nets)
        stood = ~dirty[self.patch]
        if not np.array_equal(self.sources[stood], sources.nets[stood]):
            return None  # as many elements, but others
        whole = (
            (new.nodes != old.nodes).any(axis=(1, 2))
            | (new.normals != old.normals).any(axis=(1, 2))
            | (new.weights != old.weights).any(axis=1)
        )
        lifts = np.zeros(len(whole)) if asked.lifts is None else asked.lifts
        if self.lifts is not None and asked.lifts is not None:
            whole |= self.lifts != asked.lifts
        pairs = np.zeros(rows.factors.shape, dtype=bool)
        pairs[whole] = True
        pairs[:, dirty[sources.patch]] = True
        again, open_rows = whole.copy(), np.zeros(len(whole), dtype=bool)
        if sees_out:
            open_rows = rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE
        from .kernels.shafts import Seen, find_touched_pairs

        places = places_of(self.nets, nets, dirty, patches.part_index)
        find_touched_pairs(
            writable(new.nodes),
            writable(new.normals),
            writable(lifts),
            rows.factors,
            Seen(writable(self.spheres.T), writable(self.planes), writable(self.corners)),
            places,
            open_rows,
            pairs,
            again,
        )
        return Changed(again, pairs, places.parts, sees_out & (whole | open_rows))


def moved_patches(old: FloatArray, new: FloatArray) -> NDArray[np.bool_]:
    """Which of patches (p, 4, 4, 4) are elsewhere, or have another shape."""
    return np.asarray((old != new).any(axis=(1, 2, 3)))


def places_of(old: FloatArray, new: FloatArray, dirty: NDArray[np.bool_], part: IntArray) -> Places:
    """Balls about ``dirty`` (p,) patches of control nets ``old`` and ``new`` (p, 4, 4, 4)."""
    from .kernels.shafts import Places

    parts: list[FloatArray] = []
    whole_ends, part_ends = [0], [0]
    patches, wholes = [np.zeros((0, 4))], []
    for nets in (old, new):
        for one in np.unique(part[dirty]):
            patches.append(bounding_spheres(np.ascontiguousarray(nets[dirty & (part == one)])))
            parts.append(_ball_about(patches[-1]))
            part_ends.append(part_ends[-1] + len(patches[-1]))
        if len(parts) > whole_ends[-1]:
            wholes.append(_ball_about(np.array(parts[whole_ends[-1] :])))
            whole_ends.append(len(parts))
    return Places(
        np.array(wholes).reshape(-1, 4),
        _ranges(whole_ends),
        np.array(parts).reshape(-1, 4),
        _ranges(part_ends),
        np.concatenate(patches),
    )


def _ball_about(balls: FloatArray) -> FloatArray:
    """A ball (4,) about some (b, 4)."""
    low = (balls[:, :3] - balls[:, 3:]).min(axis=0)
    high = (balls[:, :3] + balls[:, 3:]).max(axis=0)
    middle = 0.5 * (low + high)
    reach = (np.linalg.norm(balls[:, :3] - middle, axis=1) + balls[:, 3]).max()
    return np.array([*middle, reach * (1.0 + 1e-12)])


def _ranges(ends: list[int]) -> IntArray:
    """First and end (k, 2) of what follows one another with these ``ends``, the first being 0."""
    return np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int64)


def points_in_new_light(
    scene: SceneData, before: FloatArray, patch: IntArray, points: FloatArray, normals: FloatArray
) -> NDArray[np.bool_]:
    """At which points (n, k, 3) on patches (n,) direct light of lamps may have changed: (n, k).

    Parts stood elsewhere: ``before`` (p, 4, 4, 4) are the control nets as they were.
    """
    from .kernels.shafts import Seen, find_touched_points

    nets = scene.patches.control_points
    dirty = moved_patches(before, nets)
    lit = (scene.luminaire_index >= 0).any(axis=1)
    touched = np.repeat(dirty[patch], points.shape[1])
    if (dirty & lit).any():
        return np.ones(points.shape[:2], dtype=bool)
    lamps = int(lit.sum())
    planes = np.zeros((lamps, 4))
    planes[:, 3] = -np.inf
    spheres = bounding_spheres(np.ascontiguousarray(nets[lit]))
    find_touched_points(
        writable(points.reshape(-1, 3)),
        writable(normals.reshape(-1, 3)),
        Seen(writable(spheres.T), planes, np.zeros((lamps, 4, 3))),
        places_of(before, nets, dirty, scene.patches.part_index),
        touched,
    )
    return touched.reshape(points.shape[:2])


def _planes(sources: Sources) -> tuple[FloatArray, FloatArray]:
    """Planes and corners of elements, as in `kernels.shafts.Seen`."""
    planes, corners = np.zeros((len(sources.nets), 4)), np.zeros((len(sources.nets), 4, 3))
    planes[:, 3] = -np.inf
    flat = np.flatnonzero(sources.flags & PLANAR)
    half = np.array([0.5])
    nets = sources.nets[flat]
    at, su, sv = (a[:, 0] for a in surface_points(nets, half, half))
    normal = np.cross(su, sv)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    planes[flat, :3], planes[flat, 3] = normal, np.einsum("nk,nk->n", normal, at)
    hull = nets[..., :3] / nets[..., 3:]
    own = hull[:, [0, 3, 3, 0], [0, 0, 3, 3]]
    sides = np.roll(own, -1, axis=1) - own
    inward = np.cross(normal[:, None], sides)
    depth = np.einsum("nsk,nijsk->nijs", inward, hull[:, :, :, None] - own[:, None, None])
    size = np.linalg.norm(sides, axis=2).max(axis=1, initial=0.0)
    within = depth.min(axis=(1, 2, 3)) >= -1e-9 * size**2
    corners[flat[within]] = own[within]
    return planes, corners
