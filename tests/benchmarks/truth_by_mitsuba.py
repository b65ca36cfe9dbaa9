"""Truths of cases of which no closed form is known: long runs of Mitsuba, beside Patchlight.

    python tests/benchmarks/truth_by_mitsuba.py {F,G} [--accuracy A] [--samples S] [--runs R]
                                                      [--write]

prints how far both are from one another, the noise of one and what the other states. Samples of
different runs are independent, so that their spread tells the noise of the mean. ``--write`` keeps
what Mitsuba found of F. Of G, whose sensors need more samples than there is time for, it keeps what
Patchlight found: Mitsuba then tells that nothing is wrong with it on average.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from case import Case, MitsubaSetting
from cases import f_conference, g_pendant
from patchlight.solver.model.arrays import FloatArray

#: Cases, and the longest path: surfaces send half of the light on in F, and 0.63 in G, so that 2e-5
#: and 1e-8 of it are left out.
CASES = {"F": (f_conference, 16), "G": (g_pendant, 40)}

#: Accuracy of what is kept of G.
FINE = 0.0015
#: Accuracy of another basis that it is compared with.
OTHER = 0.004


def by_mitsuba(case: Case, samples: int, runs: int, depth: int) -> FloatArray:
    """Irradiance (runs, n) by independent runs. [W/m²]"""
    from tools.mitsuba import MitsubaTool

    tool = MitsubaTool()
    tool.version()
    settings = [MitsubaSetting(samples, depth, "mis", seed) for seed in range(runs)]
    tool.prepare(case, settings[0])
    found = [tool.run(case, setting) for setting in settings]
    print(f"mitsuba: {sum(run.cpu_s for run in found):.0f} CPU s", flush=True)
    return np.array([run.irradiance for run in found])


def by_patchlight(
    case: Case, accuracy: float, basis: str = "bilinear"
) -> tuple[FloatArray, FloatArray]:
    """Irradiance (n,) and its stated error. [W/m²]"""
    from patchlight.pipeline import simulate
    from tools.ours import scene_data

    start = time.process_time()
    result = simulate(scene_data(case), accuracy=accuracy, basis=basis, cache=False)
    found = result.sensors["sensors"]
    print(f"patchlight: {time.process_time() - start:.0f} CPU s", flush=True)
    return found.illuminance_lx, found.error_lx


def compare(theirs: FloatArray, ours: FloatArray, stated: FloatArray) -> str:
    """Runs (r, n) of Mitsuba, ours (n,) and its stated error, relative to the mean of the runs."""
    truth = theirs.mean(axis=0)
    lit = truth > 1e-3 * truth.max()
    noise = theirs.std(axis=0, ddof=1)[lit] / np.sqrt(len(theirs)) / truth[lit]
    of_all = theirs[:, lit].mean(axis=1)
    mean_noise = of_all.std(ddof=1) / np.sqrt(len(theirs)) / of_all.mean()
    lines = [f"{lit.sum()} of {len(lit)} sensors are lit"]
    for name, values in (
        ("patchlight / mitsuba − 1", ours[lit] / truth[lit] - 1.0),
        ("noise of mitsuba", noise),
        ("stated by patchlight", stated[lit] / truth[lit]),
    ):
        rms, most = np.sqrt(np.mean(values**2)), np.abs(values).max()
        lines.append(f"{name}: rms {rms:.2e}, mean {values.mean():+.2e}, largest {most:.2e}")
    mean = ours[lit].mean() / truth[lit].mean() - 1.0
    lines.append(f"mean of all sensors: {mean:+.2e}, noise of mitsuba {mean_noise:.2e}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Find the truth and compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("case", choices=CASES)
    parser.add_argument("--accuracy", type=float, default=0.05)
    parser.add_argument("--samples", type=int, default=4096)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args(arguments)
    module, depth = CASES[options.case]
    if options.write and module is g_pendant and options.accuracy > FINE:
        parser.error(f"--accuracy {options.accuracy:g}: what is kept of G takes {FINE:g} or less")
    theirs = by_mitsuba(module.CASE, options.samples, options.runs, depth)
    ours, stated = by_patchlight(module.CASE, options.accuracy)
    print(compare(theirs, ours, stated))
    if module is g_pendant:
        other, _ = by_patchlight(module.CASE, OTHER, "biquadratic")
        off = other / ours - 1.0
        print(f"biquadratic light at {OTHER:g}: rms {np.sqrt(np.mean(off**2)):.2e}")
    if options.write:
        kept = ours if module is g_pendant else theirs.mean(axis=0)
        np.save(module.TRUTH, kept.astype(np.float32))
    return 0


if __name__ == "__main__":
    sys.exit(main())
