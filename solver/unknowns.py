"""The unknowns of the radiosity system: the exitance at the inset nodes of the elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .edges import EDGE_NODES
from .exchange import Rows, products
from .kernels.rows import Sources
from .kernels.spread import Basis, spread_rows
from .kernels.threads import threads_for
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.bezier import gauss_rule, surface_points
from .model.elements import Elements
from .surfaces import Receivers
from .topology import writable
from .walls import walls_under

#: Rows at a time whose factors are spread only to gather light with them.
BLOCK = 512
#: Light that varies over an element by this share of what the shares of its nodes may be off is
#: taken for even: what receivers get is then off by less than a tenth of what it may be.
EVEN = 0.1
#: Gauss points a direction in the parts of near elements.
PART_NODES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Values that the exitance of n elements is made of; row k of every array is one of N.

    Elements have one unknown at each node that is not buried, or a single one for all of them.

    Attributes
    ----------
    element : (N,) int array
        Element each belongs to, in order.
    areas : (N,) array
        Area each stands for, without what is buried. [m²]
    receivers : Receivers
        Where the light is looked at that each sends back.
    basis : Basis or None
        How light varies between the nodes; None where it is constant on every element.
    elements : int
        How many elements there are.
    order : int
        Gauss nodes a direction in each piece of an element that has more than one.
    """

    element: IntArray
    areas: FloatArray
    receivers: Receivers
    basis: Basis | None
    elements: int
    order: int = 1
    _shares: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        total = self.sums(self.areas)[self.element]
        # Of each in the area of its element.
        object.__setattr__(self, "_shares", self.areas / np.where(total > 0.0, total, 1.0))

    @classmethod
    def of(cls, elements: Elements, basis: str) -> Unknowns:
        """Those of a basis: ``"constant"``, ``"bilinear"`` or ``"biquadratic"``."""
        return cls.constant(elements) if basis == "constant" else cls.at_nodes(elements)

    @classmethod
    def constant(cls, elements: Elements) -> Unknowns:
        """One value an element; what falls on it is averaged over its nodes."""
        areas = np.where(elements.buried, 0.0, elements.weights).sum(axis=1)
        n = len(elements)
        return cls(np.arange(n), areas, Receivers.of_elements(elements), None, n)

    @classmethod
    def at_nodes(cls, elements: Elements) -> Unknowns:
        """One value a node that can get light: bilinear between 2 x 2, biquadratic for 3 x 3."""
        open_ = (elements.weights > 0.0) & ~elements.buried
        element, node = np.nonzero(open_)
        order = math.isqrt(elements.weights.shape[1])
        return cls._on(
            elements,
            element,
            elements.nodes[element, node],
            elements.normals[element, node],
            elements.weights[element, node],
            np.where(open_.all(axis=1), 1, 0),
            order,
        )

    def can_halve(self, elements: Elements) -> NDArray[np.bool_]:
        """Which elements (n,) have light everywhere, and nodes enough to tell how it varies."""
        return np.asarray((elements.weights > 0.0).all(axis=1) & ~elements.buried.any(axis=1))

    @property
    def _pieces(self) -> tuple[int, int]:
        """Nodes a direction in each piece of a halved element, and pieces."""
        return (2, 1) if self.basis is None else (len(self.basis.rule), 2)

    @property
    def halves_of(self) -> int:
        """Unknowns of a halved element."""
        order, pieces = self._pieces
        return (order * pieces) ** 2

    def between_halves(self) -> FloatArray:
        """Values (Q, q) at the unknowns of a halved element by those of the whole one."""
        order, pieces = self._pieces
        rule = np.zeros(1) if self.basis is None else self.basis.rule
        one = lagrange(rule, 1, composite(order, pieces)[0])
        return np.einsum("ga,hb->ghab", one, one).reshape(self.halves_of, len(rule) ** 2)

    def halved(self, elements: Elements, chosen: IntArray) -> Unknowns:
        """The same, more finely on the ``chosen`` elements: see `can_halve`.

        Elements with one value get one at each of 2 x 2 nodes, others 2 x 2 pieces like the whole.
        Their unknowns follow one another in the order of u, then v.
        """
        order, pieces = self._pieces
        rule, weight = composite(order, pieces)
        u, v = (g.ravel() for g in np.meshgrid(rule, rule, indexing="ij"))
        points, su, sv = surface_points(elements.nets[chosen], u, v)
        normals = np.cross(su, sv)
        length = np.linalg.norm(normals, axis=2)
        areas = length * np.outer(weight, weight).ravel()
        areas *= (elements.areas[chosen] / areas.sum(axis=1))[:, None]
        normals /= np.where(length > 0.0, length, 1.0)[:, :, None]
        parts = (
            np.zeros(len(elements), np.int64) if self.basis is None else self.basis.pieces.copy()
        )
        parts[chosen] = pieces
        kept = np.flatnonzero(~np.isin(self.element, chosen))
        element = np.append(self.element[kept], np.repeat(chosen, len(u)))
        row = np.argsort(element, kind="stable")
        old = self.receivers
        return self._on(
            elements,
            element[row],
            np.concatenate([old.nodes[kept, 0], points.reshape(-1, 3)])[row],
            np.concatenate([old.normals[kept, 0], normals.reshape(-1, 3)])[row],
            np.append(self.areas[kept], areas.ravel())[row],
            parts,
            order,
        )

    def take(self, rows: IntArray) -> Unknowns:
        """Some of them, to gather light at."""
        element, areas = self.element[rows], self.areas[rows]
        return Unknowns(element, areas, self.receivers.take(rows), None, self.elements, self.order)

    @classmethod
    def _on(
        cls,
        elements: Elements,
        element: IntArray,
        points: FloatArray,
        normals: FloatArray,
        areas: FloatArray,
        pieces: IntArray,
        order: int,
    ) -> Unknowns:
        count = np.bincount(element, minlength=len(elements))
        rule, (gauss, weight) = gauss_rule(order)[0], gauss_rule(PART_NODES)
        at = np.zeros((2, EDGE_NODES**2, 4 * order**2))
        for piece in (1, 2):
            one = lagrange(rule, piece, gauss_rule(EDGE_NODES)[0])
            both = np.einsum("ga,hb->ghab", one, one)
            at[piece - 1, :, : (piece * order) ** 2] = both.reshape(EDGE_NODES**2, -1)
        basis = Basis(
            start=np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
            pieces=writable(pieces, np.int64),
            rule=writable(rule),
            points=writable(points),
            vectors=writable(normals * areas[:, None]),
            share=areas / np.bincount(element, weights=areas, minlength=len(elements))[element],
            at=at,
            gauss=writable(gauss),
            weight=writable(weight),
        )
        share = np.ones((len(points), 1))
        patches = elements.patch_index[element]
        receivers = Receivers(points[:, None], normals[:, None], share, patches, element)
        return cls(element, areas, receivers, basis, len(elements), order)

    def __len__(self) -> int:
        return len(self.areas)

    def of_elements(self, elements: IntArray) -> IntArray:
        """Rows (c, q) of elements that have q unknowns each."""
        first = np.searchsorted(self.element, elements)
        last = np.searchsorted(self.element, elements, side="right")
        return np.asarray(first[:, None] + np.arange(int((last - first)[0])))

    def mean(self, values: FloatArray) -> FloatArray:
        """Means (n, ...) of ``values`` (N, ...) over the elements; 0 where all is buried."""
        if values.ndim == 1:
            return self.sums(self._shares * values)
        flat = values.reshape(len(self), math.prod(values.shape[1:]))
        sums = [self.sums(self._shares * column) for column in flat.T]
        return np.stack(sums, axis=1).reshape(self.elements, *values.shape[1:])

    def spread(self, values: FloatArray) -> FloatArray:
        """By how much ``values`` (N,) differ from their means over the elements: (n,), rms."""
        return np.sqrt(np.maximum(self.mean(values**2) - self.mean(values) ** 2, 0.0))

    def of_whole(self, factors: MatrixArray, rows: IntArray) -> FloatArray:
        """Form factors (k, n) between elements, from some ``rows`` (k,), by those (N, N) of all."""
        share, out = self._shares, np.zeros((len(rows), self.elements))
        for k, row in enumerate(rows):
            own = np.flatnonzero(self.element == row)
            mean = share[own] @ np.asarray(factors[own], dtype=np.float64)
            out[k] = np.bincount(self.element, weights=mean, minlength=self.elements)
        return out

    def evenly(self, factors: MatrixArray) -> MatrixArray:
        """Form factors (m, N) that see elements evenly, given those (m, n) of the elements."""
        return np.asarray(factors[:, self.element] * self._shares.astype(factors.dtype))

    def add_evenly(self, factors: MatrixArray, more: MatrixArray) -> None:
        """Add to form factors (m, N), in place, ``more`` (m, n) of evenly seen elements."""
        for first in range(0, len(factors), BLOCK):
            some = slice(first, first + BLOCK)
            factors[some] += self.evenly(more[some])

    def mean_variance(self, values: FloatArray) -> FloatArray:
        """Variances (n,) of the means, for independent variances ``values`` (N,)."""
        return self.sums(self._shares**2 * values)

    def sums(self, values: FloatArray) -> FloatArray:
        """Sums (n,) of ``values`` (N,) over the elements."""
        sums = np.bincount(self.element, weights=values, minlength=self.elements)
        return np.asarray(sums, dtype=np.float64)

    def factors(
        self, rows: Rows, receivers: Receivers, sources: Sources, eps: float
    ) -> MatrixArray:
        """Form factors (m, N) of the unknowns, given those (m, n) of the elements.

        Parameters
        ----------
        rows : Rows
            From receivers of one node each.
        receivers : Receivers
            Of the rows.
        sources : Sources
            The elements.
        eps : float
            Error of the moments, relative to the form factor of their element.
        """
        if self.basis is None:
            return rows.factors
        out = np.empty((len(rows.factors), len(self)), dtype=rows.factors.dtype)
        self._spread(rows.factors, receivers, sources, eps, out)
        return out

    def gather(
        self,
        rows: Rows,
        receivers: Receivers,
        sources: Sources,
        eps: float,
        light: FloatArray,
        even: NDArray[np.bool_] | None = None,
        known: Callable[[], MatrixArray] | None = None,
    ) -> FloatArray:
        """Light (m, b) that receivers get when the unknowns are ``light`` (N, b).

        Elements that are ``even`` (n,) send the mean of it: their factors are not spread. ``known``
        finds those of the unknowns where they are kept, asked for only if some are needed.
        """
        if self.basis is None:
            return products(rows.factors, light)
        m = len(rows.factors)
        even = np.zeros(self.elements, dtype=bool) if even is None else even
        means = self.mean(light) * even[:, None]
        out = products(rows.factors, means) if even.any() else np.zeros((m, light.shape[1]))
        if even.all():
            return out
        uneven = np.where(even[self.element, None], 0.0, light)
        factors = None if known is None else known()
        block = np.empty((min(m, BLOCK), len(self)), dtype=rows.factors.dtype)
        for first in range(0, m, BLOCK):
            some = np.arange(first, min(first + BLOCK, m))
            if factors is not None:
                part = factors[some]
            else:
                part = block[: len(some)]
                left = np.where(even, rows.factors.dtype.type(0), rows.factors[some])
                self._spread(left, receivers.take(some), sources, eps, part)
            out[some] += products(part, uneven)
        return out

    def even(self, light: FloatArray, eps: float) -> NDArray[np.bool_]:
        """Elements (n,) over which no column of ``light`` (N, b) differs from its mean.

        But for `EVEN` of the error ``eps`` that the shares of nodes may have, of the mean of the
        brightest column over all elements.
        """
        level = float((np.abs(light) * self.areas[:, None]).sum(axis=0).max(initial=0.0))
        off = np.abs(light - self.mean(light)[self.element]).max(axis=1, initial=0.0)
        uneven = off * float(self.areas.sum()) > EVEN * eps * level
        return np.asarray(np.bincount(self.element[uneven], minlength=self.elements) == 0)

    def _spread(
        self,
        factors: MatrixArray,
        receivers: Receivers,
        sources: Sources,
        eps: float,
        out: MatrixArray,
    ) -> None:
        assert self.basis is not None and receivers.nodes.shape[1] == 1
        # The radius of a square is its side over √2; the nearest point is a radius nearer.
        order = len(self.basis.rule)
        at = receivers.nodes, receivers.normals, receivers.weights
        far, middle = (1.0 + reach(eps, q) / math.sqrt(2.0) for q in (order, EDGE_NODES))
        with threads_for(factors.size):
            spread_rows(
                writable(receivers.nodes[:, 0]),
                writable(receivers.normals[:, 0]),
                walls_under(*at, sources.wall_spheres),
                factors,
                sources,
                self.basis,
                far,
                middle,
                middle,
                out,
            )


def reach(eps: float, order: int) -> float:
    """Twice the distance over the length from which Gauss' rule leaves ``eps`` of a kernel."""
    rho = eps ** (-0.5 / order)
    return 0.5 * (rho - 1.0 / rho)


def composite(order: int, pieces: int) -> tuple[FloatArray, FloatArray]:
    """Abscissae and weights (order pieces,) of Gauss' rule on equal pieces of 0 … 1."""
    rule, weight = gauss_rule(order)
    nodes = np.concatenate([(k + rule) / pieces for k in range(pieces)])
    return nodes, np.tile(weight / pieces, pieces)


def lagrange(rule: FloatArray, pieces: int, t: FloatArray) -> FloatArray:
    """Polynomials (len(t), pieces len(rule)) through ``rule`` on each of equal pieces of 0 … 1."""
    k = len(rule)
    piece = np.minimum((t * pieces).astype(int), pieces - 1)
    local = t * pieces - piece
    out = np.zeros((len(t), pieces * k))
    for a in range(k):
        value = np.ones(len(t))
        for b in range(k):
            if b != a:
                value *= (local - rule[b]) / (rule[a] - rule[b])
        out[np.arange(len(t)), piece * k + a] = value
    return out
