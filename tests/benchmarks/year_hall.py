"""Memory and time of an hourly year in a hall of 10 000 elements with 500 sensors.

    python tests/benchmarks/year_hall.py -o FOLDER [--desks 11] [--sensors 500] [--memory 4]

solves the hall of `large_room`, with a band of windows in one wall, through a year of 8760 hours in
a process of its own, writes annual.nc to the folder, and its figures to ``year_hall.json``.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from large_room import CELL, HEIGHT, large_room
from patchlight.pipeline.year import simulate_year
from patchlight.reports.year_metrics import year_rows
from patchlight.solver.budget import Budget
from patchlight.solver.daylit import even_scene
from patchlight.solver.model import PatchSet, SceneData, Sensors, Site, Weather
from patchlight.solver.model.arrays import frozen
from report import machine

#: Sill and head of the windows, and how far they stay from the other walls. [m]
SILL, HEAD, MARGIN = 0.9, 2.8, 0.2


def year_hall(side: int, sensors: int) -> SceneData:
    """The hall with windows in its south wall, lamps dark, sensors 1.25 m above the floor."""
    data, half = large_room(side), 0.5 * CELL * side
    middles = data.patches.evaluate(0.5, 0.5)
    wall = (data.patches.part_index == 0) & np.isclose(middles[:, 1], -half)
    keep = np.flatnonzero(~wall)
    x0, x1 = -half + MARGIN, half - MARGIN
    strips = [(-half, half, 0.0, SILL), (-half, half, HEAD, HEIGHT)]
    strips += [(-half, x0, SILL, HEAD), (x1, half, SILL, HEAD)]
    corners = [
        [(b, -half, c), (a, -half, c), (a, -half, d), (b, -half, d)] for a, b, c, d in strips
    ]
    frame = PatchSet.from_bilinear(np.array(corners, dtype=float))
    rest = data.taken(keep)
    count = len(rest.patches) + len(strips)
    nets = np.concatenate([rest.patches.control_points, frame.control_points])
    parts = np.concatenate([rest.patches.part_index, np.zeros(len(strips), dtype=np.int64)])
    material = np.concatenate([rest.material_index, np.zeros((len(strips), 2), dtype=np.int64)])
    rng = np.random.default_rng(11)
    points = np.column_stack(
        [rng.uniform(-0.48, 0.48, (sensors, 2)) * 2.0 * half, np.full(sensors, 1.25)]
    )
    return dataclasses.replace(
        rest,
        patches=PatchSet(nets, np.arange(count), parts),
        two_sided=np.zeros(count, bool),
        closed=parts != 0,
        material_index=material,
        luminaire_index=np.full((count, 2), -1),
        luminaires=(),
        glass_index=np.full(count, -1),
        faces=tuple(dataclasses.replace(data.faces[0], part=int(p), number=k + 1)
                    for k, p in enumerate(parts)),
        sensors=(Sensors("plane", points, np.array([0.0, 0.0, 1.0])),),
    )  # fmt: skip


def weather() -> Weather:
    """A year made up: clear and overcast days by turns at 50 N."""
    starts = np.datetime64("2001-01-01T00:00", "m") + 60 * np.arange(8760)
    hour, day = np.arange(8760) % 24, np.arange(8760) // 24
    up = np.maximum(np.sin(np.pi * (hour - 5.5) / 13.0), 0.0) * ((hour > 5) & (hour < 19))
    clear = day % 3 != 0
    return Weather(
        site=Site(50.0, 8.0),
        place="nowhere",
        utc_offset_h=1.0,
        step_minutes=60,
        starts=frozen(starts, "datetime64[m]"),
        direct_normal_w_m2=frozen(np.where(clear, 700.0 * np.sqrt(up), 0.0)),
        diffuse_horizontal_w_m2=frozen(np.where(clear, 100.0, 250.0) * up),
        direct_normal_lx=None,
        diffuse_horizontal_lx=None,
        dew_point_c=frozen(np.full(8760, np.nan)),
        albedo=frozen(np.full(8760, 0.2)),
        source="made up",
        sha256="",
    )


def peak_bytes() -> int:
    """Most memory that the process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def measure(side: int, sensors: int, accuracy: float, memory_gb: float, out: str) -> dict[str, Any]:
    """A year of one hall: seconds, bytes, and what of its light is known."""
    scene, path = year_hall(side, sensors), Path(out) / "annual.nc"
    began, last = time.perf_counter(), [0.0, ""]

    def tell(stage: str, done: int, total: int) -> None:
        now = time.perf_counter() - began
        if stage != last[1] or now - last[0] > 60.0:
            last[:] = [now, stage]
            gb = peak_bytes() / 1e9
            print(f"{now:6.0f} s, {gb:.2f} GB: {stage} {done} of {total}", file=sys.stderr)

    before = peak_bytes()
    cpu = time.process_time()
    year = simulate_year(
        scene, weather(), accuracy=accuracy, out=path, memory_gb=memory_gb, progress=tell
    )
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    solved = peak_bytes()
    with year:
        attrs = {
            key: year.attrs[key] for key in ("memory_bytes", "sun_indirect_error", "converged")
        }
        rows = {row["quantity"]: row["value"] for row in year_rows(year)}
        mean = float(np.mean([year["illuminance"][k].values.mean() for k in range(0, sensors, 25)]))
    return {
        "side": side,
        "sensors": sensors,
        "accuracy": accuracy,
        "memory_limit_gb": memory_gb,
        "patches": len(scene.patches),
        "elements": Budget.of(even_scene(scene), accuracy).elements,
        "seconds": seconds,
        "cpu_seconds": cpu,
        "bytes_before": before,
        "peak_bytes": solved,
        "peak_bytes_with_metrics": peak_bytes(),
        "file_bytes": path.stat().st_size,
        "told_bytes": int(attrs["memory_bytes"]),
        "sun_indirect_error": float(attrs["sun_indirect_error"]),
        "converged": bool(attrs["converged"]),
        "mean_lx": mean,
        "sDA300_50_pct": rows["sDA300_50_pct"],
        "DA300_mean_pct": rows["DA300_mean_pct"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--desks", type=int, default=11, help="along one side, default %(default)s")
    parser.add_argument("--sensors", type=int, default=500)
    parser.add_argument("--accuracy", type=float, default=0.02)
    parser.add_argument("--memory", type=float, default=4.0, help="most memory [GB]")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    asked = (options.desks, options.sensors, options.accuracy, options.memory, str(options.output))
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        record = pool.apply(measure, asked)
    text = json.dumps({"machine": machine(), "run": record}, indent=2)
    (options.output / "year_hall.json").write_text(text, encoding="utf-8")
    print(
        f"{record['elements']} elements, {record['sensors']} sensors: {record['seconds']:.0f} s, "
        f"CPU {record['cpu_seconds']:.0f} s, {record['peak_bytes'] / 1e9:.2f} GB "
        f"(told {record['told_bytes'] / 1e9:.2f}), DA300 {record['DA300_mean_pct']:.1f} %"
    )


if __name__ == "__main__":
    main()
