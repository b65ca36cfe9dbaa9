"""Errors against the truth, medians of CPU seconds, and the CPU seconds an error costs."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

import numpy as np
from case import Case
from patchlight.solver.model.arrays import FloatArray

#: Sensors below this share of the largest true value are not judged.
FLOOR = 1e-3
#: Runs longer than this are not repeated. [CPU s]
LONG = 5.0


@dataclass(frozen=True)
class Point:
    """One setting of one tool in one case.

    Attributes
    ----------
    cpu_s : float
        Median over the runs. [s]
    runs_s : tuple of float
        All runs. [s]
    rms, largest, mean : float
        Of value over truth less 1: root mean square, largest magnitude, mean.
    """

    tool: str
    setting: str
    cpu_s: float
    runs_s: tuple[float, ...]
    rms: float
    largest: float
    mean: float


def errors(values: FloatArray, truth: FloatArray) -> tuple[float, float, float]:
    """Root mean square, largest magnitude and mean of the relative error."""
    judged = truth > FLOOR * truth.max()
    relative = values[judged] / truth[judged] - 1.0
    # A sensor without a number counts as wholly wrong instead of vanishing.
    relative = np.where(np.isfinite(relative), relative, 1.0)
    return (
        float(np.sqrt(np.mean(relative**2))),
        float(np.abs(relative).max()),
        float(relative.mean()),
    )


def measure(tool, case: Case, setting, truth: FloatArray, repeats: int) -> tuple[Point, float]:
    """A point, and the CPU seconds of getting ready for it."""
    ready = tool.prepare(case, setting)
    runs = [tool.run(case, setting)]
    while len(runs) < repeats and runs[0].cpu_s < LONG:
        runs.append(tool.run(case, setting))
    seconds = tuple(run.cpu_s for run in runs)
    found = errors(runs[0].irradiance, truth)
    return Point(tool.name, str(setting), statistics.median(seconds), seconds, *found), ready


def worth_trying(points: list[Point], limit: float) -> bool:
    """Whether the next setting may stay below the limit if seconds keep growing as they did."""
    if not points:
        return True
    growth = points[-1].cpu_s / points[-2].cpu_s if len(points) > 1 else 4.0
    return points[-1].cpu_s * min(max(growth, 1.0), 4.0) <= limit


def cost(points: list[Point], target: float) -> tuple[float, str] | None:
    """CPU seconds to a root mean square error, and how they are known.

    ``"measured"`` between two points, on the line through their logarithms; ``"at most"`` when the
    cheapest point is already good enough; ``"extrapolated"`` from the best point with error
    ∝ CPU^(−1/2), the law of random sampling. None when nothing was measured.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda p: p.cpu_s):
        if not front or point.rms < front[-1].rms:
            front.append(point)
    if not front:
        return None
    for k, point in enumerate(front):
        if point.rms <= target:
            if k == 0 or point.rms == 0.0:
                return point.cpu_s, "at most"
            a, b = front[k - 1], point
            share = np.log(a.rms / target) / np.log(a.rms / b.rms)
            return float(a.cpu_s * (b.cpu_s / a.cpu_s) ** share), "measured"
    best = front[-1]
    return float(best.cpu_s * (best.rms / target) ** 2), "extrapolated"
