"""Seconds and memory of halls of 3000 to 60 000 elements.

    python tests/benchmarks/large.py -o FOLDER [--desks 2 4 6 ...] [--accuracy 0.01]
    python tests/benchmarks/large.py -o FOLDER --plot

solves each hall in a process of its own, so that its memory is seen, and adds the figures to
``large.json``; then ``large.png`` is drawn of all that is there. Compiled kernels are loaded before
the clock starts: a hall of one desk is solved first.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from large_room import large_room
from patchlight.solver.simulation import solve
from report import machine

#: Desks a side: some 3000 elements at 1 % for the first three, which are refined, 64 000 for the
#: last.
DESKS = (2, 4, 6, 9, 13, 18, 26)
TICKS = (1000, 2000, 4000, 8000, 16_000, 32_000, 64_000)
#: Stages that are shown, those of the radiosity method itself.
SHOWN = ("form factors", "radiosity")


class Talk:
    """Tells on stderr, twice a minute at most, how far a run has come."""

    def __init__(self) -> None:
        self.start = self.last = time.perf_counter()

    def __call__(self, stage: str, done: int, total: int) -> None:
        now = time.perf_counter()
        if now - self.last > 30.0:
            self.last = now
            print(f"{now - self.start:6.0f} s: {stage} {done} of {total}", file=sys.stderr)


def measure(side: int, accuracy: float) -> dict[str, Any]:
    """Solve one hall; seconds, bytes, and what of the light is known."""
    solve(large_room(1), accuracy=0.4)
    peak_before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    scene = large_room(side)
    wall, cpu = time.perf_counter(), time.process_time()
    result = solve(scene, accuracy=accuracy, progress=Talk())
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    grid, counters = result.sensors["plane"], result.counters
    n = counters["elements"]
    packed = counters.get("packed_bytes")
    return {
        "side": side,
        "accuracy": accuracy,
        "elements": n,
        "patches": counters["patches"],
        "nodes": counters["nodes"],
        "seconds": wall,
        "cpu_seconds": cpu,
        "stages": dict(result.stages),
        "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "bytes_before": peak_before,
        "matrix_bytes": 4 * counters["unknowns"] ** 2 if packed is None else packed,
        "packed": packed is not None,
        "bytes_on_disk": counters.get("bytes_on_disk", 0),
        "matrix_products": counters["matrix_products"],
        "spectral_radius": result.settings["spectral_radius"],
        "unknowns": counters["unknowns"],
        "converged": result.converged,
        "ledger_residual": result.balance.residual_fraction,
        "mean_lx": float(grid.illuminance_lx.mean()),
        "median_stated_error": float(np.median(grid.error_lx / grid.illuminance_lx)),
        "illuminance_lx": grid.illuminance_lx.tolist(),
    }


def alone(side: int, accuracy: float) -> dict[str, Any]:
    """The same in a process that does nothing else."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(measure, (side, accuracy))


def plot(records: list[dict[str, Any]], path: Path) -> None:
    """Seconds and bytes over the number of elements, both logarithmic, with lines of slope 2."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    records = sorted(records, key=lambda r: r["elements"])
    n = np.array([r["elements"] for r in records], dtype=float)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5.6), layout="constrained")
    for name, values, style in (
        ("all, wall", [r["seconds"] for r in records], "o-"),
        ("all, CPU", [r["cpu_seconds"] for r in records], "s--"),
        *((f"{s}, wall", [r["stages"][s] for r in records], ".-") for s in SHOWN),
    ):
        left.loglog(n, values, style, label=name)
    left.axhline(1200.0, color="0.6", lw=0.8)
    left.annotate("20 min", (n[0], 1200.0), va="bottom", fontsize=8, color="0.4")
    left.set(xlabel="elements", ylabel="time [s]")
    gb = 1e9
    right.loglog(n, [r["peak_bytes"] / gb for r in records], "o-", label="process, at most")
    right.loglog(n, [r["matrix_bytes"] / gb for r in records], "s-", label="matrix as kept")
    right.loglog(n, 11 * n**2 / gb, ":", color="0.5", label="whole rows while found, 11 B a pair")
    right.loglog(n, 2 * n**2 / gb, "--", color="0.5", label="packed, nothing hidden, 2 B a pair")
    right.axhline(16.0, color="0.6", lw=0.8)
    right.annotate("16 GB", (n[0], 16.0), va="bottom", fontsize=8, color="0.4")
    right.set(xlabel="elements", ylabel="memory [GB]")
    top = float(records[-1]["seconds"])
    left.loglog(n, top * (n / n[-1]) ** 2, ":", color="0.5", label="slope 2")
    for axes in (left, right):
        axes.set_xticks(TICKS, [f"{e:,}".replace(",", " ") for e in TICKS], fontsize=8)
        axes.minorticks_off()
        axes.grid(True, which="major", color="0.9")
        axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)
    figure.suptitle(f"Open-plan hall, accuracy {records[-1]['accuracy']:g}, two cores")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--desks", type=int, nargs="+", default=DESKS, help="along one side")
    parser.add_argument("--accuracy", type=float, default=0.01)
    parser.add_argument("--plot", action="store_true", help="only draw what is there")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "large.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"runs": []}
    for side in () if options.plot else options.desks:
        record = alone(side, options.accuracy)
        known["machine"] = machine()
        known["runs"] = [r for r in known["runs"] if r["side"] != record["side"]] + [record]
        path.write_text(json.dumps(known, indent=2), encoding="utf-8")
        print(
            f"{record['elements']:6d} elements, {record['nodes']:6d} nodes: "
            f"{record['seconds']:7.1f} s, CPU {record['cpu_seconds']:7.1f} s, "
            f"{record['peak_bytes'] / 1e9:.2f} GB, matrix {record['matrix_bytes'] / 1e9:.2f} GB, "
            f"stated error {record['median_stated_error']:.2%}",
            flush=True,
        )
    if known["runs"]:
        plot(known["runs"], options.output / "large.png")


if __name__ == "__main__":
    main()
