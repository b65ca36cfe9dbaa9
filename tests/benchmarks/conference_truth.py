"""Rows of form factors far finer than any run needs them, and the errors of runs against them."""

from __future__ import annotations

import dataclasses
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import Elements, SceneData
from patchlight.solver.model.arrays import FloatArray, IntArray

#: Relative accuracy of unoccluded factors, and form factor below which a partly hidden cell is
#: sampled.
EPS, CELL_EPS = 1e-7, 1e-7
#: Width of proved brackets, relative to the unoccluded factor, and the cells a pair may take.
STRICT, STRICT_CELLS = 1e-3, 20_000
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
    sources = make_sources(elements, nets, np.full(len(elements), CELL_EPS))
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
        "cpu_s": time.process_time() - start,
        "row_sums": np.percentile(rows.factors.sum(axis=1), [0, 5, 50, 95, 100]).tolist(),
        "counters": rows.counters,
    }
    low = high = np.zeros((0, len(elements)))
    if job.strict:
        low, high, seconds = _brackets(job, sources, receivers.take(np.arange(job.strict)), blockers)
        record |= {"strict_rows": job.strict, "strict_cpu_s": seconds}
    return Truth(record, rows.factors, rows.variances, low, high)
