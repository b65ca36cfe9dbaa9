"""Form factors after parts have moved: only those of pairs between which the change may be.

A form factor stays when no line of sight from its receiver to its element can meet what moved, at
its old place or its new one: when that lies behind the receiver, or behind the element where it is
flat, or misses the hull of both. What has moved itself is found anew, and what it sees.
"""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True, eq=False)
class Changed:
    """What of some rows must be found anew.

    Attributes
    ----------
    again : (m,) bool array
        Rows of which anything must.
    pairs : (m, n) bool array
        Form factors that must.
    """

    again: NDArray[np.bool_]
    pairs: NDArray[np.bool_]


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
    planes : (n, 4) array
        Of the flat ones among them, as in `kernels.shafts.find_touched`.
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
    found: tuple[object, ...]
    tone: FloatArray

    @classmethod
    def of(
        cls, nets: FloatArray, asked: Ask, found: tuple[object, ...], tone: FloatArray
    ) -> Arrangement:
        sources = asked.sources
        return cls(
            nets=nets,
            receivers=asked.receivers,
            lifts=asked.lifts,
            sources=sources.nets,
            patch=sources.patch,
            spheres=sources.spheres,
            cell_eps=sources.cell_eps,
            dim=sources.dim,
            planes=_planes(sources),
            found=found,
            tone=tone,
        )

    @property
    def rows(self) -> Rows:
        """What was found."""
        rows = self.found[0]
        assert isinstance(rows, Rows)
        return rows

    def changed(self, patches: PatchSet, asked: Ask) -> Changed | None:
        """Which pairs must be found anew among ``patches``; None where nothing is known of them."""
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
        again = whole.copy()
        from .kernels.shafts import find_touched_pairs

        find_touched_pairs(
            writable(new.nodes),
            writable(new.normals),
            writable(lifts),
            rows.factors,
            writable(self.spheres),
            writable(self.planes),
            *balls_about(self.nets, nets, dirty, patches.part_index),
            rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE,
            pairs,
            again,
        )
        return Changed(again, pairs)


def moved_patches(old: FloatArray, new: FloatArray) -> NDArray[np.bool_]:
    """Which of patches (p, 4, 4, 4) are elsewhere, or have another shape."""
    return np.asarray((old != new).any(axis=(1, 2, 3)))


def balls_about(
    old: FloatArray, new: FloatArray, dirty: NDArray[np.bool_], part: IntArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Balls about patches at their old and their new places, and balls about those of each part.

    Returns those (h, 4) of the parts, first and end (h, 2) of the others in each, and these (b, 4).
    """
    hulls, ranges, balls, end = [], [], [], 0
    for nets in (old, new):
        for one in np.unique(part[dirty]):
            own = bounding_spheres(np.ascontiguousarray(nets[dirty & (part == one)]))
            low = (own[:, :3] - own[:, 3:]).min(axis=0)
            high = (own[:, :3] + own[:, 3:]).max(axis=0)
            middle = 0.5 * (low + high)
            reach = (np.linalg.norm(own[:, :3] - middle, axis=1) + own[:, 3]).max()
            hulls.append((*middle, reach))
            ranges.append((end, end + len(own)))
            balls.append(own)
            end += len(own)
    return (
        np.array(hulls).reshape(-1, 4),
        np.array(ranges, dtype=np.int64).reshape(-1, 2),
        np.concatenate([*balls, np.zeros((0, 4))]),
    )


def rows_in_new_light(
    scene: SceneData, before: FloatArray, patch: IntArray, points: FloatArray, normals: FloatArray
) -> IntArray:
    """Rows of points (n, k, 3) on patches (n,) on which direct light of lamps may have changed.

    Parts stood elsewhere: ``before`` (p, 4, 4, 4) are the control nets as they were.
    """
    from .kernels.shafts import find_touched

    nets = scene.patches.control_points
    dirty = moved_patches(before, nets)
    lit = (scene.luminaire_index >= 0).any(axis=1)
    n, lamps = len(patch), int(lit.sum())
    if (dirty & lit).any():
        return np.arange(n)
    planes = np.zeros((lamps, 4))
    planes[:, 3] = -np.inf
    touched = dirty[patch]
    find_touched(
        writable(points),
        writable(normals),
        np.ones((n, lamps), dtype=np.float32),
        bounding_spheres(np.ascontiguousarray(nets[lit])),
        planes,
        balls_about(before, nets, dirty, scene.patches.part_index)[0],
        np.zeros(n, dtype=bool),
        touched,
    )
    return np.flatnonzero(touched)


def _planes(sources: Sources) -> FloatArray:
    """Normal and offset (n, 4) of flat elements, (0, 0, 0, −∞) of others."""
    planes = np.zeros((len(sources.nets), 4))
    planes[:, 3] = -np.inf
    flat = np.flatnonzero(sources.flags & PLANAR)
    half = np.array([0.5])
    at, su, sv = (a[:, 0] for a in surface_points(sources.nets[flat], half, half))
    normal = np.cross(su, sv)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    planes[flat, :3], planes[flat, 3] = normal, np.einsum("nk,nk->n", normal, at)
    return planes
