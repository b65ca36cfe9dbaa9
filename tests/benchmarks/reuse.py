"""What a change costs after a first run: seconds, and shares of the time of a full run.

    python tests/benchmarks/reuse.py -o FOLDER [--accuracy 0.1] [--demo conference] [--webs]

solves a demo room, then paints, dims and relights it anew, and moves a chair, each time with what
earlier runs have kept; and solves the same without, to compare. Prints a table and writes
``reuse.json``. Pictures are left out. With ``--webs`` all lamps shine by a photometric web.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.pipeline import load_scene
from patchlight.pipeline.demo import write_demo
from patchlight.solver import store
from patchlight.solver.model import (
    CIESky,
    Material,
    PatchSet,
    Photometry,
    Result,
    SceneData,
    Web,
)
from patchlight.solver.simulation import solve
from report import machine

#: Counters that are shown.
SHOWN = ("pairs_scanned", "pairs_traced", "pairs_reused", "rows_reused")
#: Memory that is written to before each run. [B]
TOUCHED = 2**31


def painted(scene: SceneData) -> SceneData:
    """The first material reflects a fifth less."""
    first, *others = scene.materials
    paint = Material(0.8 * np.asarray(first.reflectance), name=first.name)
    return dataclasses.replace(scene, materials=(paint, *others))


def dimmed(scene: SceneData) -> SceneData:
    """The first lamp is dimmed to a half."""
    first, *others = scene.luminaires
    lamp = dataclasses.replace(first, flux_lm=0.5 * first.flux_lm)
    return dataclasses.replace(scene, luminaires=(lamp, *others))


def under_another_sky(scene: SceneData) -> SceneData:
    """A clear sky."""
    return dataclasses.replace(scene, sky=CIESky(12, sun_altitude_deg=40.0, sun_azimuth_deg=160.0))


def with_chair_moved(scene: SceneData, part: str = "chair:3") -> SceneData:
    """One chair stands 36 cm farther away."""
    named = np.array([part in p.path.split("/") for p in scene.parts])
    patches, offset = scene.patches, np.eye(4)
    offset[:3, 3] = 0.1, -0.35, 0.0
    own, nets = named[patches.part_index], patches.control_points.copy()
    nets[own] = nets[own] @ offset.T
    moved = PatchSet(nets, patches.face_index, patches.part_index, patches.edge_index)
    return dataclasses.replace(scene, patches=moved)


def with_webs(scene: SceneData) -> SceneData:
    """All lamps shine downwards, with intensities of cos³ γ."""
    gamma = np.arange(0.0, 91.0, 5.0)
    row = np.maximum(np.cos(np.radians(gamma)), 0.0) ** 3
    web = Web.aimed(Photometry([0.0, 360.0], gamma, [row, row]), (0, 0, -1), (1, 0, 0))
    lamps = (dataclasses.replace(lamp, web=web, profile=None) for lamp in scene.luminaires)
    return dataclasses.replace(scene, luminaires=tuple(lamps))


CHANGES: dict[str, Callable[[SceneData], SceneData]] = {
    "nothing": lambda scene: scene,
    "paint": painted,
    "one lamp dimmed": dimmed,
    "another sky": under_another_sky,
    "one chair moved": with_chair_moved,
}


def touch_memory() -> None:
    """Write to as much memory as a run may want, and give it back.

    Where the host of a virtual machine takes free memory back, the first use of each page costs
    twenty times what writing to it does: no run should pay what another one does not.
    """
    np.ones(TOUCHED // 8)


def timed(scene: SceneData, accuracy: float, *, cache: bool) -> tuple[Result, dict[str, Any]]:
    """A run, its wall-clock and CPU seconds, and what of its counters is shown."""
    touch_memory()
    wall, cpu = time.perf_counter(), time.process_time()
    result = solve(scene, accuracy=accuracy, cache=cache)
    seconds = {"seconds": time.perf_counter() - wall, "cpu_seconds": time.process_time() - cpu}
    counters = {name: result.counters.get(name, 0) for name in SHOWN}
    return result, {**seconds, **counters, "elements": result.counters["elements"]}


def difference(one: Result, other: Result) -> float:
    """Largest difference at the sensors against the error that ``one`` states."""
    return max(
        float(np.max(np.abs(g.illuminance_lx - other.sensors[n].illuminance_lx) / g.error_lx))
        for n, g in one.sensors.items()
    )


def measure(scene: SceneData, accuracy: float) -> dict[str, dict[str, Any]]:
    """Every change after a first run of the scene as it is, and without one."""
    for made in (under_another_sky(scene), scene, with_chair_moved(scene)):
        solve(made, accuracy=0.5, cache=True)  # loads compiled kernels
    out = {}
    for name, change in CHANGES.items():
        store.forget()
        solve(scene, accuracy=accuracy, cache=True)
        changed = change(scene)
        result, record = timed(changed, accuracy, cache=True)
        own, full = timed(changed, accuracy, cache=False)
        record["full"] = full
        record["share"] = record["cpu_seconds"] / full["cpu_seconds"]
        record["difference_in_errors"] = difference(result, own)
        out[name] = record
        print(
            f"{name:18}{full['seconds']:8.2f} s{record['seconds']:8.2f} s{record['share']:8.0%} CPU"
            f"{record['difference_in_errors']:8.3f}"
        )
    store.forget()
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--accuracy", type=float, default=0.1)
    parser.add_argument("--demo", default="conference", choices=("conference", "office"))
    parser.add_argument("--webs", action="store_true", help="lamps shine by photometric webs")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = load_scene(write_demo(options.demo, Path(folder))).freeze()
    scene = dataclasses.replace(scene, cameras=())
    scene = with_webs(scene) if options.webs else scene
    print(f"{'change':18}{'full':>10}{'again':>10}{'share':>12}{'difference / error':>20}")
    found = measure(scene, options.accuracy)
    options.out.mkdir(parents=True, exist_ok=True)
    of = {"demo": options.demo, "webs": options.webs, "accuracy": options.accuracy}
    data = {"machine": machine()} | of | found
    (options.out / "reuse.json").write_text(json.dumps(data, indent=1))


if __name__ == "__main__":
    main()
