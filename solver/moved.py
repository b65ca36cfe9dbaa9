"""Form factors after parts have moved: only those of receivers that may see the change.

A row stays when no line of sight from its receiver can meet what moved, at its old place or its new
one: when that lies behind the receiver, or misses the shafts from it to all that it sees. What a
row saw too little of to be sampled it does not know of; that is within the error it states. All
other rows are found anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .exchange import Rows
from .kernels.nets import PLANAR
from .kernels.rows import Sources
from .model.arrays import FloatArray, IntArray
from .model.bezier import surface_points
from .row_finder import Ask
from .surfaces import Receivers
from .topology import bounding_spheres, writable

#: Form factor of sky and ground above which a receiver sees out.
OUTSIDE = 1e-6


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

    def touched(self, nets: FloatArray, asked: Ask) -> NDArray[np.bool_] | None:
        """Which rows (m,) must be found anew among ``nets``; None where all of them must."""
        new, old, rows = asked.receivers, self.receivers, self.rows
        same = (
            nets.shape == self.nets.shape
            and new.nodes.shape == old.nodes.shape
            and np.array_equal(new.own, old.own)
            and np.array_equal(new.patches, old.patches)
            and np.array_equal(self.cell_eps, asked.sources.cell_eps)
            and np.array_equal(self.dim, asked.sources.dim)
        )
        if not same:
            return None
        touched = (
            (new.nodes != old.nodes).any(axis=(1, 2))
            | (new.normals != old.normals).any(axis=(1, 2))
            | (new.weights != old.weights).any(axis=1)
        )
        if self.lifts is not None and asked.lifts is not None:
            touched |= self.lifts != asked.lifts
        dirty = (nets != self.nets).any(axis=(1, 2, 3))
        balls = bounding_spheres(np.concatenate([self.nets[dirty], nets[dirty]]))
        from .kernels.shafts import find_touched

        find_touched(
            writable(new.nodes),
            writable(new.normals),
            rows.factors,
            writable(self.spheres),
            writable(self.planes),
            writable(balls),
            rows.outside[:, 1] + rows.outside[:, 2] > OUTSIDE,
            touched,
        )
        return touched


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


def with_rows(old: Rows, new: Rows, at: IntArray) -> Rows:
    """A copy of ``old`` with the rows ``new`` in some places, and the counters of these."""
    out = Rows(
        old.factors.copy(), old.variances.copy(), new.counters, old.outside.copy(), old.sums.copy()
    )
    out.put(at, new)
    return out
