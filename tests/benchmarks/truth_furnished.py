"""The truth of case F: a long run of Mitsuba, and how well a fine one of Patchlight agrees.

    python tests/benchmarks/truth_furnished.py [--accuracy A] [--samples S] [--runs R] [--write]

prints how far both are from one another, the noise of one and what the other states. ``--write``
puts what Mitsuba found into ``cases/f_conference.npy``: no closed form is known of a furnished
room. Samples of different runs are independent, so that their spread tells the noise of the mean.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from case import MitsubaSetting
from cases.f_conference import CASE, TRUTH
from patchlight.solver.model.arrays import FloatArray

#: Longest path: surfaces send half of their light on, so that 2e-5 of it is left out.
DEPTH = 16


def by_mitsuba(samples: int, runs: int) -> FloatArray:
    """Irradiance (runs, n) by independent runs. [W/m²]"""
    from tools.mitsuba import MitsubaTool

    tool = MitsubaTool()
    tool.version()
    settings = [MitsubaSetting(samples, DEPTH, "mis", seed) for seed in range(runs)]
    tool.prepare(CASE, settings[0])
    found = [tool.run(CASE, setting) for setting in settings]
    print(f"mitsuba: {sum(run.cpu_s for run in found):.0f} CPU s", flush=True)
    return np.array([run.irradiance for run in found])


def by_patchlight(accuracy: float) -> tuple[FloatArray, FloatArray]:
    """Irradiance (n,) and its stated error. [W/m²]"""
    from patchlight.pipeline import simulate
    from tools.ours import scene_data

    start = time.process_time()
    result = simulate(scene_data(CASE), accuracy=accuracy, cache=False)
    found = result.sensors["sensors"]
    print(f"patchlight: {time.process_time() - start:.0f} CPU s", flush=True)
    return found.illuminance_lx, found.error_lx


def compare(theirs: FloatArray, ours: FloatArray, stated: FloatArray) -> str:
    """Runs (r, n) of Mitsuba, ours (n,) and its stated error, relative to the mean of the runs."""
    truth = theirs.mean(axis=0)
    lit = truth > 1e-3 * truth.max()
    noise = theirs.std(axis=0, ddof=1)[lit] / np.sqrt(len(theirs)) / truth[lit]
    lines = [f"{lit.sum()} of {len(lit)} sensors are lit"]
    for name, values in (
        ("patchlight / mitsuba − 1", ours[lit] / truth[lit] - 1.0),
        ("noise of mitsuba", noise),
        ("stated by patchlight", stated[lit] / truth[lit]),
    ):
        rms, most = np.sqrt(np.mean(values**2)), np.abs(values).max()
        lines.append(f"{name}: rms {rms:.2e}, mean {values.mean():+.2e}, largest {most:.2e}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Find the truth and compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--accuracy", type=float, default=0.05)
    parser.add_argument("--samples", type=int, default=4096)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args(arguments)
    theirs = by_mitsuba(options.samples, options.runs)
    print(compare(theirs, *by_patchlight(options.accuracy)))
    if options.write:
        np.save(TRUTH, theirs.mean(axis=0).astype(np.float32))
    return 0


if __name__ == "__main__":
    sys.exit(main())
