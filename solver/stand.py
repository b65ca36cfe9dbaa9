"""How the surfaces of a scene stood when rows of form factors were found among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .kernels.nets import PLANAR
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .topology import writable

if TYPE_CHECKING:
    from .kernels.shafts import Seen


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """Surfaces, and the n elements on them.

    Attributes
    ----------
    nets : (p, 4, 4, 4) array
        Control nets of the patches.
    sources : (n, 4, 4, 4) array
        Nets of the elements.
    spheres : (n, 4) array
        About the elements, as in `Sources`.
    planes, corners : (n, 4) and (n, 4, 3) array
        Of the flat ones among them, as in `kernels.shafts.Seen`.
    """

    nets: FloatArray
    sources: FloatArray
    spheres: FloatArray
    planes: FloatArray
    corners: FloatArray

    @property
    def seen(self) -> Seen:
        """The elements as the kernels see them."""
        from .kernels.shafts import Seen

        return Seen(writable(self.spheres.T), writable(self.planes), writable(self.corners))

    @classmethod
    def of(cls, nets: FloatArray, sources: Sources) -> Stand:
        return cls(nets, sources.nets, sources.spheres, *_planes(sources))


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """How surfaces stood when each of m rows was found.

    Attributes
    ----------
    stands : tuple of Stand
        The last is as they stand now.
    since : (m,) int array
        Row of these for each: others than the last were found before something has moved.
    """

    stands: tuple[Stand, ...]
    since: IntArray

    @classmethod
    def new(cls, stand: Stand, rows: int) -> History:
        """Of rows that have just been found."""
        return cls((stand,), np.zeros(rows, dtype=np.int64))

    @property
    def is_old(self) -> bool:
        """Whether any rows were found before something has moved."""
        return bool((self.since < len(self.stands) - 1).any())

    def moved_on(self, stand: Stand, since: IntArray) -> History:
        """The same with one more ``stand``, rows being ``since`` (m,) then, without unused ones."""
        stands = (*self.stands, stand)
        used = np.unique(np.append(since, len(self.stands)))
        return History(tuple(stands[k] for k in used), np.searchsorted(used, since))


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
