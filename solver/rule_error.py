"""What the rules for unoccluded form factors leave in the light at sensors, measured on some.

Their accuracy is what is asked for at worst: straight edges are integrated exactly, and of curved
ones near a sensor the rules may leave more. Some rows are found once more with many more digits, as
if nothing hid anything; the difference, as far as each element is in sight, is the error. That of
the others is taken to be as much; where most of it comes of few elements, like a lamp, these are
looked at from all sensors, and only what the rest leaves is taken from the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .edges import EDGE_NODES
from .exchange import ROUNDING, Rows, form_factor_matrix, products
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, IntArray, MatrixArray
from .model.bezier import area_points
from .renewed import renewed_unoccluded
from .reuse import Kept
from .row_finder import Ask
from .some_sources import some_sources
from .topology import writable

#: Pairs that are looked at, and sensors at least and at most: by 40 of them the share of `COVERED`
#: is known to 4 %.
PAIRS, SENSORS, MOST_SENSORS = 50_000, 8, 40
#: Pairs of all sensors and the elements that most of the error comes of, at most, and no more than
#: were looked at before: they are found in some milliseconds.
PAIRS_BY_SIGHT = 5_000
#: Share of the usual error that may come of the other elements then.
REST = 0.1
#: Error against the accuracy asked for below which it does not matter how well it is known.
LITTLE = 3e-4
#: Accuracy of what rows are compared with, against theirs.
FINER = 1.0 / 30.0
#: Points a direction in elements that are compared with: sums over points take as many at every
#: accuracy, so that those over the same points would agree, whatever they miss.
FINER_NODES = EDGE_NODES + 2
#: Error of unoccluded factors against the accuracy that their rules are chosen for, where it is not
#: measured: beside a lamp 2.6 times as much was found.
OF_RULES = 3.0
#: What is stated against what was measured: what is compared with has errors of its own.
OF_MEASURED = 1.2
#: Share of the sensors looked at whose error is not above that stated for the others.
COVERED = 0.95


def rule_error(
    rows: Rows,
    asked: Ask,
    blockers: Blockers,
    eps: float,
    sent: FloatArray,
    kept: Kept,
    *,
    trace: bool,
) -> tuple[FloatArray, FloatArray]:
    """Error (m,) of light by straight form factors, and that light (m,). [lx]

    Parameters
    ----------
    rows : Rows
        Of m sensors.
    asked : Ask
        What they were asked for.
    blockers : Blockers
        The patches of the scene.
    eps : float
        Accuracy of unoccluded factors in them.
    sent : (n,) array
        Exitance of the elements, without what rows do not tell; panes may follow. [lm/m²]
    kept : Kept
        Has what was found for the same rows before.
    trace : bool
        Whether anything can hide anything: else the rows are unoccluded themselves.
    """
    m, n = len(rows.factors), len(asked.sources.nets)
    factors, sent = rows.factors[:, :n], sent[:n]  # of panes nothing is known here
    light = products(np.ascontiguousarray(factors), sent)
    if not light.any():
        return light, light
    count = min(m, max(SENSORS, min(MOST_SENSORS, PAIRS // n)))
    some = np.unique(np.linspace(0, m - 1, count).round().astype(np.int64))
    few = asked.taken(some)

    def look() -> tuple[MatrixArray, MatrixArray]:
        if trace:
            return _kept_unoccluded(few, blockers, eps, kept)
        return factors[some], _unoccluded(_finer(few), blockers, FINER * eps)

    off = _off(factors[some], *kept.of_rows("rules", rows, (eps,), look), sent)
    lit = light[some] > 0.0
    if not lit.any():
        return ROUNDING * light, light
    relative = off[lit] / light[some][lit, None]
    most, little = min(PAIRS_BY_SIGHT, off.size) // m, LITTLE * asked.budget.accuracy
    which, usual = _by_sight(relative, most, little)
    out = usual * light
    if len(which):

        def look_at_all() -> tuple[MatrixArray, MatrixArray]:
            every = replace(asked, sources=some_sources(asked.sources, which))
            finer = _unoccluded(_finer(every), blockers, FINER * eps)
            return _unoccluded(every, blockers, eps) if trace else factors[:, which], finer

        pairs = kept.of_rows("rules by sight", rows, (eps, which), look_at_all)
        out += np.abs(_off(factors[:, which], *pairs, sent[which]).sum(axis=1))
    out[some] = np.abs(off.sum(axis=1))
    return OF_MEASURED * out + ROUNDING * light, light


def _off(
    factors: MatrixArray, found: MatrixArray, finer: MatrixArray, sent: FloatArray
) -> FloatArray:
    """What is wrong of the light (k, n) of each element, as far as it is in sight. [lx]"""
    in_sight = np.minimum(factors, found) / np.where(found > 0.0, found, 1.0)
    return np.asarray((found - finer) * in_sight * sent)


def _by_sight(relative: FloatArray, most: int, little: float) -> tuple[IntArray, float]:
    """Elements of which all sensors are to be looked at, and the usual error by the others.

    No more than it takes for what is left to be little of the errors (k, n) of the sensors looked
    at, and none where it takes more than ``most`` or the error is ``little`` anyway.
    """

    def usual(errors: FloatArray) -> float:
        off = np.abs(errors.sum(axis=1))
        return float(np.quantile(off, COVERED, method="higher"))

    every = usual(relative)
    if every <= little:
        return np.empty(0, dtype=np.int64), every
    order = np.argsort(-np.abs(relative).sum(axis=0), kind="stable")
    count = 1
    while count <= most:
        rest = usual(relative[:, np.sort(order[count:])])
        if rest <= REST * every:
            return np.sort(order[:count]), rest
        count *= 2
    return order[:0], every


def _finer(ask: Ask) -> Ask:
    """The same of sources that are summed over more points."""
    sources = ask.sources
    points, areas = area_points(sources.nets, FINER_NODES)
    more = sources._replace(
        area_point=writable((points - sources.edge_origin).transpose(2, 0, 1)),
        area_normal=writable(areas.transpose(2, 0, 1)),
    )
    return replace(ask, sources=more)


def _unoccluded(ask: Ask, blockers: Blockers, eps: float) -> MatrixArray:
    """Form factors (k, n) of accuracy ``eps`` as if nothing hid anything."""
    return form_factor_matrix(
        ask.receivers.nodes,
        ask.receivers.normals,
        ask.receivers.weights,
        ask.receivers.patches,
        ask.sources,
        blockers,
        eps=eps,
        trace=False,
    ).factors


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """Unoccluded factors ``found`` and ``finer`` (k, n) among elements of a run before.

    Attributes
    ----------
    nets : (n, 4, 4, 4) array
        Of the elements.
    of : (2, n) array
        What else their rules depend on.
    """

    nets: FloatArray
    of: FloatArray
    found: MatrixArray
    finer: MatrixArray


def _kept_unoccluded(
    ask: Ask, blockers: Blockers, eps: float, kept: Kept
) -> tuple[MatrixArray, MatrixArray]:
    """As `_unoccluded` with ``eps``, and finer; of elements that stand as in a run before nothing
    is found."""
    sources = ask.sources
    key = ask.receivers, sources.patch, sources.azimuths, eps
    before: _Known | None = kept.of_parts("rules", key)
    both = (ask, eps), (_finer(ask), FINER * eps)
    of = np.stack([sources.dim, sources.point_from])
    # Without meridians edges are integrated for all elements of a patch at once.
    scanned = len(sources.azimuths) > 0
    if before is None or not scanned or before.nets.shape != sources.nets.shape:
        found, finer = (_unoccluded(asked, blockers, accuracy) for asked, accuracy in both)
    else:
        found, finer = before.found.copy(), before.finer.copy()
        moved = (before.nets != sources.nets).any(axis=(1, 2, 3)) | (before.of != of).any(axis=0)
        for factors, (asked, accuracy) in zip((found, finer), both, strict=True):
            renewed_unoccluded(factors, asked, moved, blockers, accuracy)
    kept.keep_of_parts("rules", key, _Known(sources.nets, of, found, finer))
    return found, finer
