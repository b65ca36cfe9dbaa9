"""The demo office through Patchlight and through Radiance, compared at every sensor.

    python tests/benchmarks/demo_radiance.py [--output FOLDER] [--accuracy 0.02] [--quick]

needs ``pip install "patchlight[peers]"``. Radiance gets the patches of the frozen scene as fine
polygons and the same materials, lamps, sky and ground; first it has to meet closed forms. Light
groups are traced one by one, direct light apart from reflected light:

* direct light of lamps: a deterministic sum over finely cut sources;
* direct light of sky and ground: ambient rays that meet a glowing dome;
* all light: paths without interpolation that end by Russian roulette, repeated with new random
  numbers; reflected light is this minus the direct light traced in the same way.

Both are fed luminance, so no luminous efficacy takes part. Means are weighted with the areas of
the sensors. Exit status: 0 when the means of all light differ by at most 2 %, 1 when they differ
by more, 2 when Radiance fails a closed form.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from patchlight.pipeline import load_scene, simulate
from patchlight.pipeline.demo import write_demo
from patchlight.solver.model import SceneData, Sensors
from patchlight.solver.model.arrays import FloatArray
from patchlight.solver.model.result import luminous
from radiance_checks import run_checks
from radiance_run import Radiance, Traced, direct, indirect
from radiance_scene import Fineness, dome_as_glow, surfaces

#: Largest difference of the means of all light that passes.
BOUND = 0.02


@dataclasses.dataclass(frozen=True, slots=True)
class Effort:
    """How hard Radiance works: ambient divisions and repeats."""

    dome_direct: int
    dome_total: int
    lamp_total: int
    repeats: int
    fineness: Fineness

    @classmethod
    def of(cls, quick: bool) -> Effort:
        """Noise of the means about 0.1 % of all light, or 0.5 % when ``quick``."""
        if quick:
            return cls(4096, 512, 32, 3, Fineness(8, 8, 3))
        return cls(32768, 4096, 256, 6, Fineness())


@dataclasses.dataclass(frozen=True, slots=True)
class Estimate:
    """Illuminance (n,) [lx], standard deviation of its mean over the grid [lx], CPU seconds."""

    illuminance: FloatArray
    noise: float
    cpu_s: float


def _estimate(traced: Traced, weights: FloatArray, minus: Estimate | None = None) -> Estimate:
    values = luminous(traced.irradiance)
    means = values @ weights
    noise = float(means.std(ddof=1)) / len(means) ** 0.5 if len(means) > 1 else 0.0
    mean = values.mean(axis=0)
    if minus is None:
        return Estimate(mean, noise, traced.cpu_s)
    return Estimate(mean - minus.illuminance, float(np.hypot(noise, minus.noise)), traced.cpu_s)


def trace_radiance(
    radiance: Radiance, scene: SceneData, grid: Sensors, effort: Effort, *, at_once: int = 2
) -> dict[str, Estimate]:
    """Radiance's estimate of each component, named as in `SensorResult.components`."""
    weights = grid.area_m2 / grid.area_m2.sum()
    coarse = dataclasses.replace(effort.fineness, lamp=6, flat_lamp=2)

    def lamps(group: str) -> dict[str, Estimate]:
        fine = radiance.octree(
            f"{group}_fine", surfaces(scene, lit=group, fineness=effort.fineness)
        )
        # Each hit sends shadow rays to every piece of the lamps: fewer will do for reflections.
        few = radiance.octree(f"{group}_few", surfaces(scene, lit=group, fineness=coarse))
        at = (grid.points, grid.normals)
        first = _estimate(radiance.trace(fine, *at, direct(0.01)), weights)
        same = _estimate(radiance.trace(few, *at, direct(0.2)), weights)
        traced = radiance.trace(few, *at, indirect(effort.lamp_total, 0.2), repeats=effort.repeats)
        return {f"{group}.direct": first, f"{group}.indirect": _estimate(traced, weights, same)}

    def dome(group: str) -> dict[str, Estimate]:
        octree = radiance.octree(
            group, surfaces(scene, lit=None, fineness=effort.fineness), dome_as_glow(scene, group)
        )
        at = (grid.points, grid.normals)
        options = direct(ab=1, ad=effort.dome_direct)
        first = _estimate(radiance.trace(octree, *at, options, repeats=effort.repeats), weights)
        traced = radiance.trace(octree, *at, indirect(effort.dome_total), repeats=effort.repeats)
        return {f"{group}.direct": first, f"{group}.indirect": _estimate(traced, weights, first)}

    with ThreadPoolExecutor(at_once) as pool:
        jobs = [
            pool.submit(dome if group in ("sky", "ground") else lamps, group)
            for group in scene.groups
        ]
        return {name: value for job in jobs for name, value in job.result().items()}


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """One line of the comparison; differences are Patchlight minus Radiance."""

    name: str
    patchlight_lx: float
    radiance_lx: float
    radiance_noise_lx: float
    difference_percent: float
    rms_lx: float
    max_lx: float


def compare(
    ours: dict[str, FloatArray], theirs: dict[str, Estimate], weights: FloatArray
) -> list[Row]:
    """Components, then light groups, then all light."""
    groups = list(dict.fromkeys(name.rsplit(".", 1)[0] for name in theirs))
    members = {name: [name] for name in theirs}
    members |= {g: [n for n in theirs if n.rsplit(".", 1)[0] == g] for g in groups}
    members["all light"] = list(theirs)
    rows = []
    for name, parts in members.items():
        p = np.sum([ours[part] for part in parts], axis=0)
        r = np.sum([theirs[part].illuminance for part in parts], axis=0)
        # Direct plus indirect is the total as traced: the noise of the former cancels, so that
        # adding squares overstates it.
        noise = float(np.sqrt(sum(theirs[part].noise ** 2 for part in parts)))
        mean_p, mean_r = float(p @ weights), float(r @ weights)
        percent = 100.0 * (mean_p / mean_r - 1.0) if mean_r > 0.0 else 0.0
        difference = p - r
        rms, largest = float(np.sqrt(difference**2 @ weights)), float(np.abs(difference).max())
        rows.append(Row(name, mean_p, mean_r, noise, percent, rms, largest))
    return rows


def table(rows: list[Row]) -> str:
    """Rows as text."""
    lines = ["                 Patchlight   Radiance ± noise    diff.     rms     max"]
    lines.append("                         lx         lx     lx        %      lx      lx")
    for r in rows:
        lines.append(
            f"{r.name:16s} {r.patchlight_lx:10.2f} {r.radiance_lx:10.2f} {r.radiance_noise_lx:6.2f}"
            f" {r.difference_percent:8.2f} {r.rms_lx:7.2f} {r.max_lx:7.2f}"
        )
    return "\n".join(lines)


def plot(path: Path, ours: dict[str, FloatArray], theirs: dict[str, Estimate]) -> None:
    """Scatter of every component, and the relative difference of all light at each sensor."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    total_p = np.sum([ours[name] for name in theirs], axis=0)
    total_r = np.sum([e.illuminance for e in theirs.values()], axis=0)
    for name, estimate in theirs.items():
        if estimate.illuminance.max() > 0.0:
            left.plot(estimate.illuminance, ours[name], ".", ms=4, label=name)
    left.plot(total_r, total_p, "k+", label="all light")
    ends = [0.5 * max(float(total_r.min()) * 0.05, 1.0), 1.1 * float(total_r.max())]
    left.plot(ends, ends, color="0.6", lw=0.8, zorder=0)
    left.set(xscale="log", yscale="log", xlabel="Radiance [lx]", ylabel="Patchlight [lx]")
    left.legend(fontsize="small")
    right.axhline(0.0, color="0.6", lw=0.8)
    right.plot(100.0 * (total_p / total_r - 1.0), "k.")
    right.set(xlabel="sensor", ylabel="Patchlight over Radiance, all light [%]")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison; see the module's text."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--output", type=Path, help="folder for JSON, plot and Radiance's files")
    parser.add_argument("--accuracy", type=float, default=0.02, help="default: %(default)g")
    parser.add_argument("--quick", action="store_true", help="coarser Radiance settings")
    options = parser.parse_args(arguments)
    keep = None if options.output else tempfile.TemporaryDirectory(prefix="demo-radiance-")
    folder = options.output or Path(keep.name)  # type: ignore[union-attr]
    folder.mkdir(parents=True, exist_ok=True)

    radiance = Radiance(folder / "radiance")
    print(f"{radiance.version}: closed forms", flush=True)
    checks = run_checks(radiance, quick=options.quick)
    for c in checks:
        mark = "ok" if c.passed else "FAILED"
        print(
            f"  {c.name:24s} {c.value:12.6g} of {c.truth:12.6g} lx: {100 * c.error:+.3f} % "
            f"± {100 * c.noise / c.truth:.3f} %  {mark}"
        )
    if not all(c.passed for c in checks):
        return 2

    scene = load_scene(write_demo("office", folder)).freeze()
    scene = dataclasses.replace(scene, cameras=())
    (grid,) = scene.sensors
    if not options.quick:
        simulate(scene, accuracy=0.5)  # compiles the kernels
    cpu, wall = time.process_time(), time.perf_counter()
    result = simulate(scene, accuracy=options.accuracy, cache=False)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    ours = dict(result.sensors[grid.name].components)

    effort = Effort.of(options.quick)
    theirs = trace_radiance(radiance, scene, grid, effort)
    theirs_cpu = sum(e.cpu_s for e in theirs.values())
    weights = grid.area_m2 / grid.area_m2.sum()
    rows = compare(ours, theirs, weights)
    print(table(rows))
    stated = float(result.sensors[grid.name].error_lx @ weights)
    print(
        f"Patchlight: accuracy {options.accuracy:g}, {len(result.elements)} elements, "
        f"error stated {stated:.1f} lx, {cpu:.1f} s CPU, {wall:.1f} s wall, "
        f"compilation {'included' if options.quick else 'apart'}; "
        f"{len(scene.patches)} patches, {len(grid)} sensors"
    )
    print(f"Radiance: {theirs_cpu:.1f} s CPU")
    report = {
        "radiance": radiance.version,
        "accuracy": options.accuracy,
        "quick": options.quick,
        "processors": os.cpu_count(),
        "patchlight_cpu_s": cpu,
        "compilation_included": options.quick,
        "patchlight_wall_s": wall,
        "patchlight_error_lx": stated,
        "radiance_cpu_s": theirs_cpu,
        "effort": dataclasses.asdict(effort),
        "checks": [dataclasses.asdict(c) | {"error": c.error} for c in checks],
        "rows": [dataclasses.asdict(row) for row in rows],
        "sensors": {
            "points_m": grid.points.tolist(),
            "patchlight_lx": {name: ours[name].tolist() for name in theirs},
            "radiance_lx": {name: e.illuminance.tolist() for name, e in theirs.items()},
        },
    }
    (folder / "demo_radiance.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    plot(folder / "demo_radiance.png", ours, theirs)
    if options.output:
        print(f"{folder / 'demo_radiance.json'}, {folder / 'demo_radiance.png'}")
    return 0 if abs(rows[-1].difference_percent) <= 100.0 * BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
