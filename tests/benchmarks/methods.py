"""Error against CPU time of the ways to solve a scene, on cases of known truth.

    python tests/benchmarks/methods.py -o FOLDER [--case C3 C3_surf D2] [--way nn93 bilinear ...]
                                                 [--accuracy 0.2 0.1 ...] [--repeats 3]

Ways are the method of 1993 and the default method with constant, bilinear and biquadratic light on
elements. Prints a table, and writes ``methods.json`` and ``methods.png``. Warm, as in `run.py`.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
from case import Case
from cases import CASES
from measure import errors
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.simulation import solve
from report import machine
from tools.ours import scene_data

WAYS: dict[str, dict[str, str]] = {
    "nn93": {"method": "nn93"},
    "constant": {"basis": "constant"},
    "bilinear": {"basis": "bilinear"},
    "biquadratic": {"basis": "biquadratic"},
}
ACCURACIES = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
CHOSEN = ("C3", "C3_surf", "D2")


def measure(case: Case, truth: FloatArray, way: str, accuracy: float, repeats: int) -> dict:
    """One way at one accuracy: error, what it states, and median CPU seconds."""
    scene, seconds = scene_data(case), []
    for _ in range(repeats):
        start = time.process_time()
        result = solve(scene, accuracy=accuracy, **WAYS[way])
        seconds.append(time.process_time() - start)
    grid = result.sensors["sensors"]
    rms, largest, _ = errors(grid.illuminance_lx, truth)
    off = np.abs(grid.illuminance_lx - truth)
    return {
        "case": case.name,
        "way": way,
        "accuracy": accuracy,
        "elements": len(result.elements),
        "cpu_s": statistics.median(seconds),
        "rms": rms,
        "max": largest,
        "stated": float(np.median(grid.error_lx / truth)),
        "covered": float((off <= grid.error_lx).mean()),
        "ledger": result.balance.residual_fraction,
    }


def plot(records: list[dict[str, Any]], path: Path) -> None:
    """Error over CPU seconds, a panel a case."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(r["case"] for r in records))
    figure, panels = plt.subplots(
        1, len(names), figsize=(4.6 * len(names), 4.4), layout="constrained", squeeze=False
    )
    for name, axes in zip(names, panels[0], strict=True):
        for way in WAYS:
            own = [r for r in records if r["case"] == name and r["way"] == way]
            if own:
                own.sort(key=lambda r: r["accuracy"], reverse=True)
                axes.loglog([r["cpu_s"] for r in own], [r["rms"] for r in own], "o-", label=way)
        axes.set(title=name, xlabel="CPU seconds", ylabel="rms of the relative error")
        axes.grid(True, which="major", color="0.9")
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--case", nargs="+", default=CHOSEN)
    parser.add_argument("--way", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--accuracy", type=float, nargs="+", default=ACCURACIES)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    records: list[dict[str, Any]] = []
    print("| case | way | accuracy | elements | CPU s | rms | max | stated | covered | ledger |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for case in CASES:
        if case.name not in options.case:
            continue
        truth = case.truth()
        for way in options.way:
            solve(scene_data(case), accuracy=0.4, **WAYS[way])  # kernels, warm
            for accuracy in options.accuracy:
                r = measure(case, truth, way, accuracy, options.repeats)
                records.append(r)
                print(
                    f"| {r['case']} | {way} | {accuracy:g} | {r['elements']} | {r['cpu_s']:.2f} "
                    f"| {r['rms']:.1e} | {r['max']:.1e} | {r['stated']:.1e} "
                    f"| {r['covered']:.0%} | {r['ledger']:.1e} |",
                    flush=True,
                )
    told = {"machine": machine(), "runs": records}
    (options.output / "methods.json").write_text(json.dumps(told, indent=2), encoding="utf-8")
    plot(records, options.output / "methods.png")


if __name__ == "__main__":
    main()
