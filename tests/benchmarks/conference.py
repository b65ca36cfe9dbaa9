"""The conference room at the size of Nishita & Nakamae's: error of the rows against time.

    python tests/benchmarks/conference.py -o FOLDER [--accuracy 0.1 0.05 ...] [--nodes 1 2]
                                          [--rows 100] [--strict 0]

meshes the demo conference room to about 7520 elements, as many as in Fig. 8 (d) of Nishita &
Nakamae 1993, finds all form factors and solves the radiosity, each setting in a process of its own.
Then rows drawn at random are compared with what a far finer tracing finds: the error of a row is
that of the light it gathers, Σ F_ij B_j, with B from the finest setting. Writes ``conference.json``
and ``conference.png`` and prints a table.

Wall and CPU seconds hold everything from exact patches to exitance; kernels are compiled before.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import pickle
import resource
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from conference_truth import Sample, TruthJob, kept_truth, row_errors, strict_check
from patchlight.solver.budget import Budget
from patchlight.solver.mesh import divisions
from patchlight.solver.model import PatchSet, SceneData
from patchlight.solver.model.arrays import FloatArray, IntArray
from patchlight.solver.stages import Stages
from report import machine

#: Elements of the published scene.
ELEMENTS = 7520
ACCURACIES = (0.1, 0.05, 0.02, 0.01)
#: What is wanted: median error of the rows and wall seconds on two cores.
WANTED = ((1e-3, 10.0), (3e-3, 4.0))


@dataclasses.dataclass(frozen=True, slots=True)
class Job:
    """One setting: what `Budget` makes of ``accuracy``, on a given mesh."""

    scene: Path
    accuracy: float
    nodes: int
    divisions: IntArray
    rows: IntArray
    threads: int


@dataclasses.dataclass(frozen=True, slots=True)
class Solved:
    """What a setting took, and the light and the sampled rows it found."""

    record: dict[str, Any]
    factors: FloatArray  # (rows, n)
    exitance: FloatArray  # (n,) luminous
    emitted: FloatArray  # (n,) luminous


class Clock(Stages):
    """Stages that measure CPU time and memory too."""

    def __init__(self) -> None:
        super().__init__()
        self.cpu_seconds: dict[str, float] = {}

    @contextmanager
    def run(self, name: str) -> Iterator[Any]:
        start = time.process_time()
        with super().run(name) as tell:
            yield tell
        self.cpu_seconds[name] = self.cpu_seconds.get(name, 0.0) + time.process_time() - start


def mesh_to(patches: PatchSet, elements: int) -> IntArray:
    """Divisions (p, 2) of the patches that give nearly as many elements as asked for."""
    low, high, best = 1e-3, 10.0, np.ones((len(patches), 2), dtype=np.int64)
    for _ in range(30):
        size = (low * high) ** 0.5
        counts = divisions(patches, size)
        total = int(counts.prod(axis=1).sum())
        if abs(total - elements) < abs(int(best.prod(axis=1).sum()) - elements):
            best = counts
        low, high = (size, high) if total > elements else (low, size)
    return best


def budget_on(scene: SceneData, accuracy: float, counts: IntArray, nodes: int) -> Budget:
    """The tolerances of ``accuracy`` on a mesh that does not follow from it."""
    total = int(counts.prod(axis=1).sum())
    # Size 0: no element is so small that it gets fewer nodes than the others. None is added.
    mesh = {"divisions": counts, "elements": total, "most_elements": total, "size": 0.0}
    return dataclasses.replace(Budget.of(scene, accuracy, "constant"), nodes=nodes, **mesh)


def solve(job: Job) -> Solved:
    """Solve once, in a process that does nothing else."""
    from patchlight.solver.field import FieldSolver
    from patchlight.solver.kernels.threads import set_threads
    from patchlight.solver.model.result import luminous
    from patchlight.solver.topology import make_blockers

    scene = pickle.loads(job.scene.read_bytes())
    set_threads(job.threads)

    def run(budget: Budget) -> tuple[Any, Clock]:
        clock = Clock()
        with clock.run("geometry"):
            blockers = make_blockers(scene.patches, scene.closed, scene.patches.part_index)
        solver = FieldSolver(scene, blockers, trace=True, stages=clock)
        return solver.solve(budget, solver.mesher.boxes(budget)[0]), clock

    budget = budget_on(scene, job.accuracy, job.divisions, job.nodes)
    run(budget_on(scene, 0.5, np.ones_like(job.divisions), job.nodes))  # loads and compiles
    load = os.getloadavg()[0]
    field, clock = run(budget)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    timed = [name for name in clock.seconds if name != "geometry"]
    record = {
        "accuracy": job.accuracy,
        "elements": len(field.surfaces.elements),
        "nodes_per_element": job.nodes**2,
        "settings": {k: v for k, v in budget.settings.items() if k != "element_size_m"},
        "wall_s": sum(clock.seconds[name] for name in timed),
        "cpu_s": sum(clock.cpu_seconds[name] for name in timed),
        "stages_wall_s": clock.seconds,
        "stages_cpu_s": clock.cpu_seconds,
        "peak_memory_gb": usage.ru_maxrss * 1024 / 1e9,
        "load_before": load,
        "counters": clock.counters,
        "row_sums": np.percentile(field.row_sums, [0, 5, 50, 95, 100]).tolist(),
    }
    emitted = luminous(field.surfaces.emitted)
    lit = emitted + luminous(field.unknowns.mean(field.all_sent))
    return Solved(record, field.system.factors[job.rows], lit, emitted)


def alone(call: Any, job: Any) -> Any:
    """``call(job)`` in a fresh process, whose memory is its own."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(call, job).result()


def table(records: list[dict[str, Any]]) -> str:
    """What was measured, as Markdown."""
    lines = [
        "| nodes | accuracy | wall s | CPU s | matrix | solve | memory GB | row median | p95 "
        "| lamps median | p95 |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in records:
        wall, row, lamps = r["stages_wall_s"], r["row_error"], r["lamps_error"]
        lines.append(
            f"| {r['nodes_per_element']} | {r['accuracy']:g} "
            f"| {r['wall_s']:.1f} | {r['cpu_s']:.1f} "
            f"| {wall['form factors']:.1f} | {wall['radiosity']:.1f} | {r['peak_memory_gb']:.2f} "
            f"| {row['median']:.1e} | {row['p95']:.1e} "
            f"| {lamps['median']:.1e} | {lamps['p95']:.1e} |"
        )
    return "\n".join(lines)


def plot(path: Path, records: list[dict[str, Any]]) -> None:
    """Errors of the rows over wall seconds, both logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6.0, 4.2), layout="constrained")
    for nodes, style in zip(sorted({r["nodes_per_element"] for r in records}), "-:", strict=False):
        own = sorted(
            (r for r in records if r["nodes_per_element"] == nodes), key=lambda r: r["wall_s"]
        )
        seconds = [r["wall_s"] for r in own]
        for what, part, color in (
            ("row_error", "median", "#c2410c"),
            ("row_error", "p95", "#f59e0b"),
            ("lamps_error", "median", "#1d4ed8"),
        ):
            label = f"{what.replace('_error', '')} {part}, {nodes} node{'s' * (nodes > 1)}"
            errors = [max(r[what][part], 1e-16) for r in own]
            axis.plot(seconds, errors, "o" + style, color=color, ms=4, label=label)
    for error, seconds in WANTED:
        axis.plot([seconds], [error], "k+", ms=10)
        axis.annotate("wanted, median", (seconds, error), (6, -3), textcoords="offset points")
    axis.set(xscale="log", yscale="log", xlabel="wall time [s]", ylabel="relative error of a row")
    axis.legend(fontsize="x-small")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> int:
    """Run all settings; see the module's text."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--accuracy", type=float, nargs="+", default=ACCURACIES)
    parser.add_argument("--nodes", type=int, nargs="+", default=(1,), help="a direction")
    parser.add_argument("--rows", type=int, default=100, help="rows compared; fewer of more nodes")
    parser.add_argument("--strict", type=int, default=0, help="rows that get proved brackets")
    parser.add_argument("--elements", type=int, default=ELEMENTS)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the results")
    options = parser.parse_args(arguments)
    # Threads that wait for the next loop would otherwise spin, and count as CPU time under load.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    options.output.mkdir(parents=True, exist_ok=True)
    scene_file = options.output / "conference.pickle"
    scene = alone(write_scene, scene_file)
    counts = mesh_to(scene.patches, options.elements)
    total = int(counts.prod(axis=1).sum())
    print(f"{len(scene.patches)} patches, {total} elements", flush=True)
    records: list[dict[str, Any]] = []
    truths: list[dict[str, Any]] = []
    for nodes in options.nodes:
        sample = Sample.draw(scene, counts, nodes, max(options.rows // nodes**2, 1))
        job = TruthJob(scene_file, sample, options.strict, options.threads)
        truth = alone(kept_truth, job)
        truths.append(truth.record)
        print(f"truth of {len(sample.rows)} rows: {truth.record}", flush=True)
        found = []
        for accuracy in sorted(options.accuracy, reverse=True):
            job = Job(scene_file, accuracy, nodes, counts, sample.rows, options.threads)
            solved = alone(solve, job)
            found.append(solved)
            r = solved.record
            print(f"{nodes} x {nodes} nodes, {accuracy:g}: {r['wall_s']:.1f} s", flush=True)
        best = found[-1]
        if options.strict:
            truths[-1] |= {"strict": strict_check(truth, best.exitance)}
        for solved in found:
            errors = row_errors(truth, solved.factors, best.exitance, best.emitted)
            records.append(solved.record | errors)
        data = {"machine": machine(), "patches": len(scene.patches), "elements": total}
        data |= {"truth": truths, "runs": records}
        (options.output / "conference.json").write_text(json.dumps(data, indent=1), "utf-8")
    plot(options.output / "conference.png", records)
    print(table(records))
    return 0


def write_scene(file: Path) -> SceneData:
    """Build the demo and keep its frozen scene, so that no run holds the CAD kernel in memory."""
    from patchlight.pipeline import load_scene
    from patchlight.pipeline.demo import write_demo

    scene = load_scene(write_demo("conference", file.parent)).freeze()
    file.write_bytes(pickle.dumps(scene))
    return scene


if __name__ == "__main__":
    sys.exit(main())
