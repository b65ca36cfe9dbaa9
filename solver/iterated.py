"""One more gather on halved elements: better values, and what they tell of the error.

A solution B of the discrete system is put into the equation it stands for once more, at the nodes
of 2 x 2 pieces of the elements: B' = ρ (E_direct + K B), Sloan's iteration [1], which converges
faster than B and shows light that the coarser nodes missed. The residual r = B' − B there changes
the light elsewhere by C, (I − ρ K) C = ρ K r, which is solved with the matrix there is. Sensors
gather from B + r + C; by how much that differs from what they get of B alone tells of the error;
see `mesh_error`.

Where the rows of all pieces would cost more than those of the mesh, elements whose light varies
most, times their importance for the sensors, are done.

References
----------
.. [1] I. H. Sloan, "Improvement by iteration for compact operator equations", Mathematics of
   Computation 30 (1976), 758–764.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .exchange import products
from .incident import Gathered
from .lamp_flux import as_much, put_right
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.result import luminous
from .unknowns import Unknowns

if TYPE_CHECKING:
    from .solved_field import Field

#: Light that varies in an element by this share of its mean is taken for the least variation: the
#: nodes may miss what lies between them.
LEAST = 0.05
#: Worth of light that is absorbed, which counts in the flux ledger alone, against what is sent on.
ABSORBED = 0.1
#: What elements chosen for the present light may be worth, against those of a run before it.
AS_GOOD = 1.15
#: Importance of light anywhere for what the sensors get, against the mean of what they see.
ANYWHERE = 0.3

Gather = Callable[[Unknowns], tuple[Gathered, FloatArray]]


@dataclass(frozen=True, slots=True, eq=False)
class Finer:
    """A solved field with its light known on halved elements; N unknowns, n elements.

    Attributes
    ----------
    unknowns : Unknowns
        Of the whole elements, and of the pieces of those that were halved.
    arriving : Gathered
        Light on the unknowns.
    sent : dict of (N, b) arrays
        Reflected exitance by light group. [lm/m²]
    kept : (N,) array
        Share of what each sends that meets the scene again.
    change : (N, b) array
        What of it, all groups together, is not in the solution of the mesh. [lm/m²]
    moved, spread : (n,) array
        Mean of the change over each element, and how it varies about it: root mean square. [lm/m²]
    shift : (n,) array
        Change of the mean illuminance of the elements. [lx]
    residual : (n, 2) array
        Flux of |r| of each element times its importance, parted by how r varies along u and v.
    halved : (c,) int array
        Elements that were halved.
    unseen : float
        What was not looked at, against what was: the change is that much larger.
    sampled : (n,) array
        Standard deviation of direct light that is told by rays. [lx]
    sampled_sent : (n,) array
        What of it is reflected. [lm/m²]
    put_right : float
        Largest share of the light of a group of lamps that the nodes had missed, or added.
    weights : (n,) array
        Importance of the elements for the sensors, per area; see `weights_at`.
    """

    unknowns: Unknowns
    arriving: Gathered
    sent: dict[str, FloatArray]
    kept: FloatArray
    change: FloatArray
    moved: FloatArray
    spread: FloatArray
    shift: FloatArray
    residual: FloatArray
    halved: IntArray
    unseen: float
    sampled: FloatArray
    sampled_sent: FloatArray
    put_right: float
    weights: FloatArray

    @property
    def light(self) -> Gathered:
        """Light on the elements: means over them."""
        mean, arriving = self.unknowns.mean, self.arriving
        components = {name: mean(values) for name, values in arriving.components.items()}
        variance = self.unknowns.mean_variance(arriving.deviation**2)
        sun = None if arriving.sun is None else mean(arriving.sun)
        return Gathered(components, np.sqrt(variance), sun)

    @property
    def reflected(self) -> FloatArray:
        """Mean reflected exitance (n, b) of the elements, of all groups. [lm/m²]"""
        nothing = np.zeros_like(self.change)
        return self.unknowns.mean(np.asarray(sum(self.sent.values(), nothing)))


def weights_at(seen: list[MatrixArray], areas: FloatArray) -> FloatArray:
    """Importance (n,) of light from elements for sensors that see them by ``seen`` [(m, n), …].

    Straight or by way of mirrors, each with factors of its own. Relative to the mean, per area;
    1 everywhere without sensors.
    """
    total = np.zeros(len(areas))
    for factors in seen:
        total += products(np.ascontiguousarray(factors.T), np.ones((factors.shape[0], 1)))[:, 0]
    if not total.any():
        return np.ones(len(areas))
    weight = total / np.where(areas > 0.0, areas, np.inf)
    return np.asarray(weight / np.average(weight, weights=areas) + ANYWHERE)


def finer_light(
    field: Field,
    weights: FloatArray,
    gather: Gather,
    lamps: tuple[dict[str, FloatArray], float],
    count: tuple[int, float],
    before: IntArray | None = None,
) -> Finer:
    """The light of ``field`` on halved elements.

    Parameters
    ----------
    field : Field
        A solved mesh.
    weights : (n,) array
        Importance of the elements.
    gather : callable
        Light on unknowns, by the field's own, and the sums (k,) of their rows.
    lamps : tuple of dict of (b,) arrays and float
        What lamps send to the scene, by light group, where that is known [lm], and the accuracy of
        form factors.
    count : tuple of int and float
        Rows that may be found, and what may be left out though there are some, against the rest.
    before : (c,) int array, optional
        Elements halved in a run before this one: they are again unless others matter more.
    """
    chosen, unseen = _chosen(field, weights, count, before)
    if not len(chosen):
        # Nothing is known of how light varies over elements: by as little as is taken elsewhere.
        least = LEAST * field.unknowns.mean(luminous(field.all_sent))
        return replace(as_it_is(field), spread=least, weights=weights)
    rho, unknowns = field.surfaces.reflectance, field.unknowns
    fine = unknowns.halved(field.surfaces.elements, chosen)
    lift = Lift.of(unknowns, fine, chosen)
    some = lift.new.ravel()
    arriving, sums = gather(fine.take(some))
    told = {name: lift(values) for name, values in field.arriving.components.items()}
    components = {name: values.copy() for name, values in told.items()}
    for name, values in arriving.components.items():
        components[name][some] = values
    sun = None
    if field.arriving.sun is not None and arriving.sun is not None:
        sun = lift(field.arriving.sun)
        sun[some] = arriving.sun
    if field.deviation is not None:
        averaged = lift.new[~np.isnan(field.deviation[chosen])]
        for name in (f"{group}.direct" for group in field.averaged):
            components[name] = as_much(components[name], told[name], fine.areas, averaged)
    shares, (flux, eps) = [0.0], lamps
    for group, sent_on in flux.items():
        name = f"{group}.direct"
        components[name], share = put_right(
            components[name], told[name], fine.areas, lift.new, sent_on, eps
        )
        shares.append(abs(share))
    lifted = {group: lift(values) for group, values in field.sent.items()}
    sent = {group: values.copy() for group, values in lifted.items()}
    rest = {}
    for group, values in sent.items():
        found = components[f"{group}.direct"][some] + components[f"{group}.indirect"][some]
        values[some] = rho[fine.element[some]] * found
        onto = lift.projected(values - lifted[group], fine.areas)
        rest[group] = products(field.system.factors, onto)
    for group, more in field.system.solve(rest).items():
        sent[group] += lift(more)
        moved = rest[group] + products(field.system.factors, more)
        components[f"{group}.indirect"] += lift(moved)
    change = np.asarray(sum(sent[group] - lifted[group] for group in sent))
    shift = np.asarray(sum(components[name] - told[name] for name in components))
    variance = lift(field.arriving.deviation**2)
    variance[some] = arriving.deviation**2
    kept = lift(field.kept)
    kept[some] = sums
    altered = luminous(change)
    moved = fine.mean(altered)
    return Finer(
        unknowns=fine,
        arriving=Gathered(components, np.sqrt(variance), sun),
        sent=sent,
        kept=kept,
        change=change,
        moved=moved,
        spread=fine.spread(altered),
        shift=np.abs(fine.mean(luminous(shift))),
        residual=_residual(altered, fine, lift, chosen) * weights[:, None],
        halved=chosen,
        unseen=unseen,
        **_sampled(field),
        put_right=max(shares),
        weights=weights,
    )


def as_it_is(field: Field) -> Finer:
    """The light of a field as its mesh has it."""
    n = len(field.surfaces.areas)
    zero = np.zeros(n)
    return Finer(
        unknowns=field.unknowns,
        arriving=field.arriving,
        sent=field.sent,
        kept=field.kept,
        change=np.zeros_like(field.all_sent),
        moved=zero,
        spread=zero,
        shift=zero,
        residual=np.zeros((n, 2)),
        halved=np.empty(0, dtype=np.int64),
        unseen=0.0,
        **_sampled(field),
        put_right=0.0,
        weights=np.ones(n),
    )


def _sampled(field: Field) -> dict[str, FloatArray]:
    """What of direct light is told by rays only, and sent on."""
    rho = field.surfaces.reflectance.max(axis=1)
    return {"sampled": field.sampled, "sampled_sent": rho * field.sampled}


def _chosen(
    field: Field, weights: FloatArray, count: tuple[int, float], before: IntArray | None = None
) -> tuple[IntArray, float]:
    """Elements to halve, and how much of what may matter is in others, against what is in them."""
    unknowns, surfaces = field.unknowns, field.surfaces
    sent, arriving = luminous(field.all_sent), field.arriving.luminous()
    worth = np.zeros(len(weights))
    for values, matter in ((sent, weights), (arriving, ABSORBED)):
        level = unknowns.mean(values)
        worth += (unknowns.spread(values) + LEAST * level) * surfaces.areas * matter
    whole = ~unknowns.can_halve(surfaces.elements)
    whole[len(field.sources.nets) :] = True  # panes
    if field.system.scattering is not None:
        whole |= field.system.scattering.share > 0.0  # known by whole elements
    # Where parts have moved, others may be buried.
    before = None if before is None else before[~whole[before]]
    order = np.argsort(-worth, kind="stable")
    order = order[(worth > 0.0)[order] & ~whole[order]]
    total = float(worth.sum())
    rows, left_out = count
    enough = np.searchsorted(np.cumsum(worth[order]), total / (1.0 + left_out)) + 1
    chosen = np.sort(order[: min(rows // unknowns.halves_of, int(enough))])
    if before is not None and worth[chosen].sum() <= AS_GOOD * worth[before].sum():
        chosen = before
    seen = float(worth[chosen].sum())
    # What cannot be halved is left out like what there is no room for.
    return chosen, max(total - seen, 0.0) / seen if seen > 0.0 else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Lift:
    """From the unknowns of elements to those of their pieces.

    Attributes
    ----------
    old, new : (c, q) and (c, Q) int arrays
        Unknowns of the halved elements before and after.
    was, same : (k,) int arrays
        The other unknowns before and after.
    between : (Q, q) array
        Values at the nodes of the pieces by those at the nodes of the element.
    """

    old: IntArray
    new: IntArray
    was: IntArray
    same: IntArray
    between: FloatArray

    @classmethod
    def of(cls, unknowns: Unknowns, fine: Unknowns, chosen: IntArray) -> Lift:
        old, new = unknowns.of_elements(chosen), fine.of_elements(chosen)
        was, same = np.ones(len(unknowns), dtype=bool), np.ones(len(fine), dtype=bool)
        was[old] = same[new] = False
        rest = np.flatnonzero(was), np.flatnonzero(same)
        return cls(old, new, *rest, unknowns.between_halves())

    def __call__(self, values: FloatArray) -> FloatArray:
        """Values (N, …) of the unknowns at the finer ones."""
        count = self.new.size + len(self.same)
        out = np.empty((count, *values.shape[1:]))
        out[self.same] = values[self.was]
        out[self.new] = np.einsum("Qq,cq...->cQ...", self.between, values[self.old])
        return out

    def projected(self, values: FloatArray, areas: FloatArray) -> FloatArray:
        """Values (N, b) whose interpolation is nearest to ``values`` at the finer unknowns."""
        out = np.zeros((self.old.size + len(self.was), values.shape[1]))
        out[self.was] = values[self.same]
        weighted = self.between * areas[self.new][:, :, None]
        normal = np.einsum("cQq,Qr->cqr", weighted, self.between)
        moments = np.einsum("cQq,cQb->cqb", weighted, values[self.new])
        out[self.old] = np.linalg.solve(normal, moments)
        return out


def _residual(change: FloatArray, fine: Unknowns, lift: Lift, chosen: IntArray) -> FloatArray:
    """Flux (n, 2) by which the light varies otherwise than told, along u and along v. [lm]"""
    side = int(np.sqrt(lift.new.shape[1]))
    shape = (len(chosen), side, side)
    values, areas = change[lift.new].reshape(shape), fine.areas[lift.new].reshape(shape)
    out = np.zeros((fine.elements, 2))
    for axis in (0, 1):
        mean = np.average(values, axis=2 - axis, weights=areas)
        out[chosen, axis] = (np.abs(mean) * areas.sum(axis=2 - axis)).sum(axis=1)
    total = (np.abs(values) * areas).sum(axis=(1, 2))
    both = np.maximum(out[chosen].sum(axis=1), 1e-300)
    out[chosen] *= (total / both)[:, None]
    return out
