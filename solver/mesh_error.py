"""The error that a mesh leaves in indirect light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .exchange import products
from .incident import Gathered
from .iterated import Finer
from .model.arrays import FloatArray, MatrixArray
from .model.elements import Elements

if TYPE_CHECKING:
    from .solved_field import Field

#: What light next to edges may still have wrong against how it changed on halved elements: an error
#: that falls with the power p of their size leaves 1 / (2^p − 1) of the change. What light lacks
#: there grows with a broken power of the distance, about 0.6.
NEAR = 2.0
#: The same of how the change varies over each element, where what it has wrong adds up at random:
#: 95 % of the sensors of every reference scene need as much.
OF_VARIED = 0.8
#: Error of indirect light against the share of all light that is lacking or too much: it is not
#: spread like the rest. Where most is lacking, in rooms with lamps close to the ceiling, sensors
#: were off by 0.2 to 1.1 of it.
OF_LACKING = 1.2
#: The same where light is the same all over each element, so that also hidden parts shine: below a
#: lamp that shines up and down 30 cm from a ceiling 1.4 in the mean, for one in six more than 2.4.
OF_LACKING_EVEN = 2.4
#: Most of all light against that which is indirect: where less is reflected, what the ledger has
#: wrong is direct light.
MOST_DIRECT = 5.0
#: Pairs of receiver and element at a time.
PAIRS = 1_000_000
#: Columns of random signs by which sums of squares are told, to about a sixth.
SIGNS = 16


@dataclass(frozen=True, slots=True)
class MeshError:
    """Error of indirect light by the mesh.

    Attributes
    ----------
    lacking : float
        Share of the indirect light that comes of flux that the ledger lacks or has too much of, or
        that was put where it may not belong.
    unseen : float
        By how much more light is wrong than the iterated gather changed: for elements that it left
        out, by their worth against that of those it looked at.
    """

    lacking: float
    unseen: float

    @classmethod
    def of_finer(cls, finer: Finer, residual: float, unseen: float) -> MeshError:
        """That of ``finer`` light, of whose flux the ledger has the share ``residual`` wrong.

        Flux that is made or lost in the middle of the scene is reflected as all other is: of all
        light on the elements it makes that share, and a larger one of what is indirect.
        """
        areas, arriving = finer.unknowns.areas, finer.arriving
        indirect = float(arriving.luminous("indirect") @ areas)
        more = float(arriving.luminous() @ areas) / indirect if indirect > 0.0 else 0.0
        more = min(more, MOST_DIRECT)
        of = OF_LACKING_EVEN if finer.unknowns.basis is None else OF_LACKING
        return cls(of * (residual + finer.put_right) * more, unseen)

    def of(self, light: Gathered, doubt: FloatArray) -> FloatArray:
        """Error (m,) of the indirect ``light``, of which ``doubt`` (m,) is known. [lx]"""
        indirect = light.luminous("indirect")
        return np.asarray(doubt * (1.0 + self.unseen) + self.lacking * indirect)


def doubt_at(
    points: FloatArray,
    factors: MatrixArray,
    elements: Elements,
    finer: Finer,
    change: FloatArray,
    far: float,
) -> FloatArray:
    """How far indirect light at points may be wrong by the mesh. [lx]

    What the iterated gather changed tells of what is left: little far from the elements, more than
    it where they fill half of what is seen and are near. And each element may have more wrong than
    shows: what the light is off on all of it, and, as light that is only in another place on it
    counts with the second power of half its width over its distance, how that varies; and what
    rays leave open of the light of lamps on it.

    Parameters
    ----------
    points : (m, 3) array
        Where the light is gathered. [m]
    factors : (m, n) array
        Form factors of the elements there.
    elements : Elements
        The elements.
    finer : Finer
        Light on their halves.
    change : (m,) array
        Change of the indirect light there. [lx]
    far : float
        Error against it, far from the elements.
    """
    middles, areas = elements.nodes.mean(axis=1), elements.areas
    out = np.empty(len(points))
    step = max(1, PAIRS // max(len(areas), 1))
    for first in range(0, len(points), step):
        some = slice(first, first + step)
        seen = np.asarray(factors[some], dtype=np.float64)
        away = np.zeros(seen.shape)
        for axis in range(3):
            away += np.square(points[some, axis, None] - middles[:, axis])
        near = np.square(np.minimum(1.0, 0.25 * areas / np.maximum(away, 1e-300)))
        nearness = np.minimum(1.0, 2.0 * np.einsum("mn,mn->m", seen, near))
        found = (far + (NEAR - far) * nearness) * change[some]
        np.square(seen, out=seen)
        varied = seen @ (finer.moved**2 + finer.sampled_sent**2) + (seen * near) @ finer.spread**2
        out[some] = np.hypot(found, OF_VARIED * np.sqrt(varied))
    return out


def doubt_on(field: Field, finer: Finer) -> FloatArray:
    """The same (n,) for the mean over each element of ``field``, wherever light is wrong. [lx]"""
    wrong = np.sqrt(finer.moved**2 + finer.spread**2 + finer.sampled_sent**2)
    if not wrong.any():
        return finer.shift
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (len(wrong), SIGNS))
    columns = (wrong[:, None] * signs)[field.unknowns.element]
    found = field.unknowns.mean(products(field.system.factors, columns))
    return np.asarray(finer.shift + OF_VARIED * np.sqrt(np.mean(found**2, axis=1)))
