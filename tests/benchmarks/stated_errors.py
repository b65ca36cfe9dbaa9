"""Whether stated errors hold, and how much too large they are: every case of known truth.

    python tests/benchmarks/stated_errors.py [--case C3 ...] [--accuracy 0.1 ...] [-o FILE.json]

prints a line for each case and accuracy. ``covered`` is the share of the sensors whose true error
is within the stated one, ``needed`` what the stated ones had to be multiplied with to cover 95 %,
``stated/true`` the median of their quotient, ``rms true`` and ``rms stated`` the relative errors.
All that is unknown about a truth is granted to the true error in ``covered`` and ``needed``.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from measure import FLOOR
from patchlight.solver.model.arrays import FloatArray
from references import REFERENCES, Reference

#: Accuracies that are looked at when none are asked for.
ACCURACIES = (0.3, 0.1, 0.03, 0.01)
#: Share of the sensors that the stated error has to hold at.
SHARE = 0.95
#: True errors below this are taken for it: form factors are stored in single precision.
LEAST = 1e-7


@dataclass(frozen=True)
class Coverage:
    """Stated against true errors of one case at one accuracy; errors relative to the truth.

    Attributes
    ----------
    points : int
        Sensors that are judged: those with more than 1e-3 of the largest true value.
    covered : float
        Share of them whose true error is within the stated one.
    needed : float
        Factor to the stated errors by which 95 % would be covered.
    stated_to_true : float
        Median of the quotient of both.
    rms_true, rms_stated : float
        Root mean square.
    converged : bool
        Whether the run says that it is as accurate as asked.
    cpu_s : float
        Process time of the run, compiled kernels being loaded. [s]
    """

    case: str
    accuracy: float
    points: int
    covered: float
    needed: float
    stated_to_true: float
    rms_true: float
    rms_stated: float
    converged: bool
    cpu_s: float

    def __str__(self) -> str:
        return (
            f"{self.case:14s} {self.accuracy:8g} {self.points:6d} {100 * self.covered:8.1f} "
            f"{self.needed:8.3f} {self.stated_to_true:11.3g} {self.rms_true:9.1e} "
            f"{self.rms_stated:10.1e} {'yes' if self.converged else 'no':>9s} {self.cpu_s:6.1f}"
        )


HEADER = (
    f"{'case':14s} {'accuracy':>8s} {'points':>6s} {'covered%':>8s} {'needed':>8s} "
    f"{'stated/true':>11s} {'rms true':>9s} {'rms stated':>10s} {'converged':>9s} {'CPU s':>6s}"
)


def cover(case: Reference, accuracy: float, truth: FloatArray) -> Coverage:
    """Solve a case and compare what is stated with what is true; ``truth`` (n,) is its own."""
    from patchlight.pipeline import simulate

    scene = case.scene()
    simulate(scene, accuracy=0.5)  # loads what is compiled, or compiles
    start = time.process_time()
    result = simulate(scene, accuracy=accuracy, cache=False)
    seconds = time.process_time() - start
    found = result.sensors["sensors"]
    return Coverage(
        case=case.name,
        accuracy=accuracy,
        converged=result.converged,
        cpu_s=seconds,
        **compared(found.illuminance_lx, found.error_lx, truth, case.doubt),
    )


def compared(
    values: FloatArray, stated: FloatArray, truth: FloatArray, doubt: float
) -> dict[str, Any]:
    """The figures of `Coverage` for values (n,), stated errors and truth off by ``doubt``."""
    judged = truth > FLOOR * truth.max()
    true = np.abs(values[judged] / truth[judged] - 1.0)
    relative = stated[judged] / truth[judged]
    granted = np.maximum(true - doubt, 0.0)
    needed = np.quantile(granted / np.maximum(relative, 1e-300), SHARE, method="higher")
    return {
        "points": int(judged.sum()),
        "covered": float((granted <= relative).mean()),
        "needed": float(needed),
        "stated_to_true": float(np.median(relative / np.maximum(true, LEAST))),
        "rms_true": float(np.sqrt(np.mean(true**2))),
        "rms_stated": float(np.sqrt(np.mean(relative**2))),
    }


def pooled(rows: Sequence[Coverage]) -> str:
    """All sensors of all cases together, and the median of the cases' medians."""
    points = sum(row.points for row in rows)
    share = sum(row.points * row.covered for row in rows) / points
    over = float(np.median([row.stated_to_true for row in rows]))
    return f"{points} sensors: {100 * share:.1f} % covered; stated/true of the runs: {over:.3g}"


def main(arguments: list[str] | None = None) -> int:
    """Print the table; exit status 2 for a name that is none."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--case", nargs="+", help="names, or how names begin; all when not given")
    parser.add_argument("--accuracy", nargs="+", type=float, default=ACCURACIES)
    parser.add_argument("--reflecting", action="store_true", help="only cases that reflect light")
    parser.add_argument("-o", "--output", type=Path, help="also write all figures as JSON")
    options = parser.parse_args(arguments)
    cases = [c for c in REFERENCES if not options.case or c.name.startswith(tuple(options.case))]
    if not cases:
        names = ", ".join(c.name for c in REFERENCES)
        print(f"no case is called {' or '.join(options.case)}; there are {names}", file=sys.stderr)
        return 2
    # Threads that wait for the next loop would otherwise spin, and count as CPU time under load.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    print(HEADER, flush=True)
    rows: list[Coverage] = []
    for case in cases:
        if options.reflecting and not case.reflects:
            continue
        truth = case.truth()
        for accuracy in options.accuracy:
            rows.append(cover(case, accuracy, truth))
            print(rows[-1], flush=True)
    for accuracy in options.accuracy:
        print(f"accuracy {accuracy:g}, {pooled([r for r in rows if r.accuracy == accuracy])}")
    if options.output:
        text = json.dumps([asdict(row) for row in rows], indent=1)
        options.output.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
