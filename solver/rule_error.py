"""What the rules for unoccluded form factors leave in the light at sensors, measured on some.

Their accuracy is what is asked for at worst: straight edges are integrated exactly, and of curved
ones near a sensor the rules may leave more. Some rows are found once more with many more digits, as
if nothing hid anything; the difference, as far as each element is in sight, is the error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .edges import EDGE_NODES
from .exchange import ROUNDING, Rows, form_factor_matrix, products
from .kernels.pyramid import Blockers
from .model.arrays import FloatArray, MatrixArray
from .model.bezier import area_points
from .renewed import renewed_unoccluded
from .reuse import Kept
from .row_finder import Ask
from .topology import writable

#: Pairs that are looked at, and sensors at least and at most: by 40 of them the share of `COVERED`
#: is known to 4 %.
PAIRS, SENSORS, MOST_SENSORS = 50_000, 8, 40
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

    found, finer = kept.of_rows("rules", rows, (eps,), look)
    in_sight = np.minimum(factors[some], found) / np.where(found > 0.0, found, 1.0)
    off = np.abs(((found - finer) * in_sight) @ sent)
    lit = light[some] > 0.0
    relative = off[lit] / light[some][lit]
    usual = np.quantile(relative, COVERED, method="higher") if lit.any() else 0.0
    out = usual * light
    out[some] = off
    return OF_MEASURED * out + ROUNDING * light, light


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
