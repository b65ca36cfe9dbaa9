"""Rows of form factors far finer than any run needs them, and the errors of runs against them."""

from __future__ import annotations

import dataclasses
import hashlib
import pickle
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import Elements, SceneData
from patchlight.solver.model.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from patchlight.solver.kernels.pyramid import Blockers
    from patchlight.solver.kernels.rows import Sources
    from patchlight.solver.surfaces import Receivers

#: Relative accuracy of unoccluded factors, and form factors below which a partly hidden cell is
#: sampled: of any element, and of lamps.
EPS, CELL_EPS, LAMP_CELL_EPS = 1e-7, 3e-6, 3e-7
#: Width of proved brackets, relative to the unoccluded factor, and the cells a pair may take.
STRICT, STRICT_CELLS = 1e-2, 2_000
#: Rows see lamps when these send them more than this share of what they send the mean row.
SEES_LAMPS = 1e-2


@dataclasses.dataclass(frozen=True, slots=True)
class Sample:
    """Rows drawn from a mesh."""

    divisions: IntArray
    nodes: int
    rows: IntArray

    @classmethod
    def draw(cls, scene: SceneData, divisions: IntArray, nodes: int, count: int) -> Sample:
        """``count`` rows, each as likely as any other, by a fixed seed."""
        elements = make_elements(scene.patches, scene.two_sided, divisions, nodes=nodes)
        drawn = np.random.default_rng(93).choice(len(elements), count, replace=False)
        return cls(divisions, nodes, np.sort(drawn))

    def elements(self, scene: SceneData) -> Elements:
        """All elements of the mesh."""
        return make_elements(scene.patches, scene.two_sided, self.divisions, nodes=self.nodes)


@dataclasses.dataclass(frozen=True, slots=True)
class TruthJob:
    """What truth is asked for: of the first ``strict`` rows brackets besides."""

    scene: Path
    sample: Sample
    strict: int
    threads: int


@dataclasses.dataclass(frozen=True, slots=True)
class Truth:
    """Factors and variances (rows, n) of pyramid tracing, brackets of the first rows."""

    record: dict[str, Any]
    factors: FloatArray
    variances: FloatArray
    low: FloatArray
    high: FloatArray


def kept_truth(job: TruthJob) -> Truth:
    """`find_truth`, or what it found for the same rows of the same mesh before."""
    asked = pickle.dumps((EPS, CELL_EPS, LAMP_CELL_EPS))
    if job.strict:
        asked += pickle.dumps((STRICT, STRICT_CELLS, job.strict))
    scene = pickle.loads(job.scene.read_bytes())
    for array in (
        scene.patches.control_points,
        scene.luminaire_index,
        job.sample.divisions,
        job.sample.rows,
    ):
        asked += np.ascontiguousarray(array).tobytes()
    key = hashlib.sha256(asked + bytes([job.sample.nodes])).hexdigest()
    file = job.scene.with_name(f"truth-{key[:16]}.pickle")
    if not file.is_file():
        file.write_bytes(pickle.dumps(find_truth(job)))
    return pickle.loads(file.read_bytes())


def find_truth(job: TruthJob) -> Truth:
    """Trace every pair of the sampled rows by pyramids."""
    from patchlight.solver.exchange import form_factor_matrix, make_sources
    from patchlight.solver.kernels.threads import set_threads
    from patchlight.solver.surfaces import Receivers
    from patchlight.solver.topology import make_blockers

    scene = pickle.loads(job.scene.read_bytes())
    set_threads(job.threads)
    elements = job.sample.elements(scene)
    nets, parts = scene.patches.control_points, scene.patches.part_index
    blockers = make_blockers(scene.patches, scene.closed, parts)
    lamp = scene.luminaire_index[elements.patch_index, elements.side] >= 0
    sources = make_sources(elements, nets, np.where(lamp, LAMP_CELL_EPS, CELL_EPS))
    receivers = Receivers.of_elements(elements).take(job.sample.rows)
    start = time.process_time()
    rows = form_factor_matrix(
        receivers.nodes,
        receivers.normals,
        receivers.weights,
        receivers.patches,
        sources,
        blockers,
        eps=EPS,
        own=receivers.own,
        levels=14,
    )
    record = {
        "how": "pyramid tracing of all pairs",
        "eps": EPS,
        "cell_eps": CELL_EPS,
        "lamp_cell_eps": LAMP_CELL_EPS,
        "cpu_s": time.process_time() - start,
        "row_sums": np.percentile(rows.factors.sum(axis=1), [0, 5, 50, 95, 100]).tolist(),
        "counters": rows.counters,
    }
    low = high = np.zeros((0, len(elements)))
    if job.strict:
        few = receivers.take(np.arange(job.strict))
        start = time.process_time()
        low, high = _brackets(few, sources, blockers)
        record |= {"strict_rows": job.strict, "strict_cpu_s": time.process_time() - start}
    return Truth(record, rows.factors, rows.variances, low, high)


def _brackets(
    receivers: Receivers, sources: Sources, blockers: Blockers
) -> tuple[FloatArray, FloatArray]:
    """Proved brackets (rows, n) of the factors from the nodes of some elements."""
    from patchlight.solver.exchange import form_factor_matrix
    from patchlight.solver.strict import strict_form_factors
    from patchlight.solver.surfaces import Receivers

    m, q = receivers.weights.shape
    nodes, normals = receivers.nodes.reshape(-1, 3), receivers.normals.reshape(-1, 3)
    on = np.repeat(receivers.patches, q)
    points = Receivers.of_points(nodes, normals, np.ones(m * q), on)
    rows = np.arange(len(sources.nets))
    single = sources._replace(group=np.stack([rows, rows + 1, sources.patch], axis=1))
    plain = form_factor_matrix(
        points.nodes, points.normals, points.weights, on, sources, blockers, eps=EPS, trace=False
    )
    found = strict_form_factors(points, single, blockers, plain, STRICT, most_cells=STRICT_CELLS)
    low, high = (
        np.einsum("mq,mqn->mn", receivers.weights, side.reshape(m, q, -1))
        for side in (found.low, found.high)
    )
    return low, high


def row_errors(
    truth: Truth, factors: FloatArray, exitance: FloatArray, emitted: FloatArray
) -> dict[str, Any]:
    """Relative errors of the light that rows gather, all of it and that of the lamps alone.

    Parameters
    ----------
    truth : Truth
        Of the same rows.
    factors : (rows, n) array
        What is judged.
    exitance, emitted : (n,) array
        Luminous exitance of all elements, and the part of it that lamps emit. [lm/m²]
    """
    true, lamps = truth.factors @ exitance, truth.factors @ emitted
    error = np.abs(factors @ exitance - true) / true
    sees = lamps > SEES_LAMPS * lamps.mean()
    lamps_error = np.abs(factors[sees] @ emitted - lamps[sees]) / lamps[sees]
    # What the truth itself leaves open.
    deviation = np.sqrt(truth.variances @ exitance**2) / true
    lamps_deviation = np.sqrt(truth.variances[sees] @ emitted**2) / lamps[sees]
    return {
        "row_error": _spread(error),
        "lamps_error": _spread(lamps_error) | {"rows": int(sees.sum())},
        "truth_deviation": _spread(deviation),
        "truth_lamps_deviation": _spread(lamps_deviation),
    }


def strict_check(truth: Truth, exitance: FloatArray) -> dict[str, Any]:
    """How traced rows lie in their proved brackets, relative to the light they gather."""
    m = len(truth.low)
    low, high = truth.low @ exitance, truth.high @ exitance
    value = truth.factors[:m] @ exitance
    return {
        "rows": m,
        "half_width": _spread(0.5 * (high - low) / value),
        "beyond": _spread(np.maximum(np.maximum(low - value, value - high), 0.0) / value),
        "from_middle": _spread(np.abs(value - 0.5 * (low + high)) / value),
    }


def _spread(values: FloatArray) -> dict[str, float]:
    """Median, 95th percentile and largest of some magnitudes."""
    median, p95, largest = np.percentile(values, [50, 95, 100])
    return {"median": float(median), "p95": float(p95), "max": float(largest)}
