"""What is seen of elements of uneven lamps that something hides in part.

A form factor tells how much is seen, not which part of the element, and the parts of an uneven lamp
are not alike. Such elements are quartered for the sensors that see a part of them: the pieces are
seen, or hidden, or lie under the edge of what hides them and are quartered again. Each time, twice
as many pieces lie under the edge, of a quarter of the size and half the change of exitance each:
what is not known falls to a quarter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .emission import Emission
from .exchange import form_factor_matrix, make_sources
from .kernels.pyramid import Blockers
from .mesh import Boxes, elements_on
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.elements import Elements
from .model.scene import SceneData
from .row_finder import Ask

#: Share of a form factor by which it must differ from that of the whole to be hidden in part.
WHOLE = 1e-4
#: Light that may stay unknown at a sensor, for each unit of accuracy, and of the mean of all where
#: there is less.
LEFT, FLOOR = 0.25, 0.01
#: Times an element is quartered at most, sensors at a time, and pairs that are traced at most.
LEVELS, SENSORS, MOST = 6, 24, 3_000_000


def partly_hidden(factors: FloatArray, plain: MatrixArray) -> FloatArray:
    """Form factors (m, c) that may be those of any part of elements: 0 of whole and of hidden ones.

    P s (1 − s), s being the share that is seen of ``plain``, the factor of the whole element.
    """
    share = np.clip(factors / np.where(plain > 0.0, plain, np.inf), 0.0, 1.0)
    share[share > 1.0 - WHOLE] = 1.0
    return np.asarray(plain * share * (1.0 - share), dtype=np.float64)


@dataclass(slots=True, eq=False)
class _Leaves:
    """Pieces that sensors see; row k of every array is one of them.

    ``pair`` counts sensors and elements together; ``light`` is the factor times the exitance, and
    ``wrong`` what may be wrong of it.
    """

    pair: IntArray
    boxes: Boxes
    factor: FloatArray
    light: FloatArray
    wrong: FloatArray

    def take(self, rows: IntArray) -> _Leaves:
        return _Leaves(
            self.pair[rows],
            self.boxes.take(rows),
            self.factor[rows],
            self.light[rows],
            self.wrong[rows],
        )


class HiddenParts:
    """Finds them for the receivers of one ``asked``, by pyramids.

    ``elements`` (c,) are those of ``emission``; ``eps`` is the accuracy of unhidden factors.
    """

    def __init__(
        self,
        scene: SceneData,
        blockers: Blockers,
        emission: Emission,
        elements: Elements,
        asked: Ask,
        eps: float,
    ) -> None:
        self.scene, self.blockers, self.emission, self.asked = scene, blockers, emission, asked
        self.boxes = Boxes(elements.patch_index, elements.side, elements.boxes)
        self.eps, self.traced = eps, 0

    def put_right(self, off: FloatArray, wrong: FloatArray, light: FloatArray) -> FloatArray:
        """Put ``off`` (m, c) right, the exitance seen less its mean; what is left unknown (m,).

        Parameters
        ----------
        off : (m, c) array
            Changed in place. [lm/m²]
        wrong : (m, c) array
            Light that may be wrong. [lx]
        light : (m,) array
            Of all these lamps. [lx]
        """
        left = np.sqrt((wrong**2).sum(axis=1))
        allowed = np.maximum(light, FLOOR * light.mean()) * LEFT * self.asked.budget.accuracy
        found = np.flatnonzero(left > allowed)
        for first in range(0, len(found), SENSORS):
            rows = found[first : first + SENSORS]
            left[rows] = self._some(rows, off, wrong, allowed[rows])
        return left

    def _some(
        self, rows: IntArray, off: FloatArray, wrong: FloatArray, allowed: FloatArray
    ) -> FloatArray:
        """The same for some receivers."""
        c = off.shape[1]
        sensor, element = np.nonzero(wrong[rows] > 0.0)
        leaves = _Leaves(
            sensor * c + element,
            self.boxes.take(element),
            np.zeros(len(sensor)),
            np.zeros(len(sensor)),
            wrong[rows][sensor, element],
        )
        done = [leaves.take(np.empty(0, dtype=np.int64))]
        for _ in range(LEVELS):
            if not len(leaves.pair) or self.traced > MOST:
                break
            leaves = self._quartered(rows, leaves, c)
            left = self._left([*done, leaves], len(rows), c)
            more = (leaves.wrong > 0.0) & (left > allowed)[leaves.pair // c]
            done.append(leaves.take(np.flatnonzero(~more)))
            leaves = leaves.take(np.flatnonzero(more))
        done.append(leaves)
        pairs = np.unique(np.concatenate([part.pair for part in done]))
        size = len(rows) * c
        light, factor = np.zeros((2, size))
        for part in done:
            np.add.at(light, part.pair, part.light)
            np.add.at(factor, part.pair, part.factor)
        pairs = pairs[factor[pairs] > 0.0]
        i, j = np.divmod(pairs, c)
        off[rows[i], j] = light[pairs] / factor[pairs] - self.emission.mean[j]
        return self._left(done, len(rows), c)

    def _left(self, parts: list[_Leaves], m: int, c: int) -> FloatArray:
        """What is unknown of the light (m,): errors of pieces have either sign."""
        square = np.zeros(m)
        for part in parts:
            np.add.at(square, part.pair // c, part.wrong**2)
        return np.sqrt(square)

    def _quartered(self, rows: IntArray, leaves: _Leaves, c: int) -> _Leaves:
        """Four pieces for each leaf."""
        boxes = leaves.boxes
        keys = np.column_stack([boxes.patch, boxes.side, boxes.ends])
        unique, place = np.unique(keys, axis=0, return_inverse=True)
        whole = Boxes(unique[:, 0].astype(np.int64), unique[:, 1].astype(np.int64), unique[:, 2:])
        pieces = whole
        for axis in (0, 1):
            pieces = pieces.halved(np.full(len(pieces), axis))
        order = np.lexsort((pieces.ends[:, 2], pieces.ends[:, 0], pieces.side, pieces.patch))
        at = np.argsort(order)
        sorted_ = pieces.take(order)
        seen = self._seen(rows, sorted_)
        column = at[4 * place.ravel()[:, None] + np.arange(4)].ravel()
        sensor = np.repeat(leaves.pair // c, 4)
        factor, light, wrong = (values[sensor, column] for values in seen)
        return _Leaves(np.repeat(leaves.pair, 4), sorted_.take(column), factor, light, wrong)

    def _seen(self, rows: IntArray, pieces: Boxes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Form factors (m, k) of pieces, their light, and what may be wrong of it."""
        scene, asked = self.scene, self.asked
        receivers, nets = asked.receivers.take(rows), scene.patches.control_points
        elements = elements_on(scene.patches, pieces, nodes=1)
        emission = self.emission.of_pieces(
            scene, elements, scene.luminaire_index[pieces.patch, pieces.side]
        )
        self.traced += len(rows) * len(pieces)
        at = (receivers.nodes, receivers.normals, receivers.weights, receivers.patches)
        sources = make_sources(elements, nets, np.ones(len(pieces)))
        plain = form_factor_matrix(*at, sources, self.blockers, eps=self.eps, trace=False).factors
        # A piece is small: what is sampled of it is a share of itself.
        cells = asked.budget.lamp_cell_eps * float(plain.sum(axis=1).max(initial=0.0))
        sources = sources._replace(cell_eps=np.full(len(pieces), max(cells, 1e-12)))
        factors = form_factor_matrix(*at, sources, self.blockers, eps=self.eps, trace=True).factors
        factors = np.asarray(factors, dtype=np.float64)
        level = emission.mean + emission.light(factors, receivers, sources, self.eps)
        return factors, factors * level, partly_hidden(factors, plain) * emission.span
