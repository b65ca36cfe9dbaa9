"""Unoccluded form factors a second: shared curved edges against the method of 1993.

Elements of a wavy sheet, receivers above it at one to eight of their diameters, every element seen
wholly from its front. Each way takes the coarsest setting whose root mean square error is at most
1e-4; all run on one core, compiled beforehand. "nn93" is ``method="nn93"`` of the public function,
"polygon" its polygon alone, with as few chords an edge as the error allows and no sub-elements.

    python tests/benchmarks/bulk_rate.py [-o rate.json]
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
from patchlight.solver.exchange import form_factor_matrix, make_sources
from patchlight.solver.kernels.contour import shift_net
from patchlight.solver.kernels.nn93 import polygon_factor
from patchlight.solver.kernels.threads import set_threads
from patchlight.solver.mesh import make_elements
from patchlight.solver.model import PatchSet
from patchlight.solver.nn93 import nn93_form_factors
from patchlight.solver.topology import make_blockers

ERROR = 1e-4
#: Elements a side of the sheet, and receivers.
SIDE, RECEIVERS = 30, 300
CHORDS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
ACCURACIES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
NN93_ACCURACIES = (1e-1, 1e-2, 1e-3, 1e-4)


@nb.njit(error_model="numpy")
def _polygons(points, normals, nets, chords, out):
    s = np.empty((4, 4, 4))
    for i in range(points.shape[0]):
        for j in range(nets.shape[0]):
            shift_net(nets[j], points[i], s)
            out[i, j] = polygon_factor(s, normals[i], chords)


def sheet() -> PatchSet:
    """Wavy sheet of 4 x 4 m that faces up, in bicubic patches of 1 m."""
    rng = np.random.default_rng(5)
    nets = []
    t = np.arange(4) / 3.0
    for i in range(4):
        for j in range(4):
            net = np.ones((4, 4, 4))
            net[..., 0], net[..., 1] = i + t[:, None], j + t[None, :]
            net[..., 2] = 0.06 * rng.standard_normal((4, 4))
            nets.append(net)
    return PatchSet(np.array(nets))


def measure(side: int = SIDE, receivers: int = RECEIVERS) -> dict[str, Any]:
    """Rates [pairs/s] and errors of both methods at the coarsest setting within `ERROR`."""
    set_threads(1)
    patches = sheet()
    n = len(patches)
    cuts = np.full((n, 2), max(side // 4, 1), dtype=np.int64)
    elements = make_elements(patches, np.zeros(n, bool), cuts)
    blockers = make_blockers(patches, np.zeros(n, bool), np.zeros(n, np.int64))
    sources = make_sources(elements, patches.control_points, np.ones(len(elements)))
    rng = np.random.default_rng(1)
    size = float(np.sqrt(2.0) / cuts[0, 0])
    x = np.column_stack(
        [rng.uniform(0.5, 3.5, (receivers, 2)), rng.uniform(1.0, 8.0, receivers) * size + 0.2]
    )
    normal = rng.standard_normal((receivers, 3)) * 0.3 - [0.0, 0.0, 1.0]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)

    def ours(eps: float) -> np.ndarray:
        return form_factor_matrix(
            x[:, None], normal[:, None], np.ones((receivers, 1)), np.full(receivers, -1), sources,
            blockers, eps=eps, trace=False,
        ).factors  # fmt: skip

    def polygons(chords: int) -> np.ndarray:
        out = np.empty((receivers, len(elements)))
        _polygons(x, normal, np.ascontiguousarray(elements.nets), chords, out)
        return out

    def nn93(accuracy: float) -> np.ndarray:
        sources = PatchSet(elements.nets)
        return nn93_form_factors(x, normal, sources, accuracy=accuracy, visibility="none").value

    truth = ours(1e-10)
    # Wholly seen from the front: contour and surface then mean the same.
    front = np.abs(polygons(128) - truth) <= 1e-3 * np.abs(truth)
    near = np.linalg.norm(x[:, None] - elements.nets[None, :, 1, 1, :3], axis=2) >= size
    # Neither is near its horizon, where there is next to nothing to be relative to.
    middle = PatchSet(elements.nets)
    way = middle.evaluate(0.5, 0.5)[None] - x[:, None]
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    here = np.einsum("ijk,ik->ij", way, normal)
    there = -np.einsum("ijk,jk->ij", way, middle.normals(0.5, 0.5))
    good = front & near & (here > 0.3) & (there > 0.3)

    def first(method: Any, settings: Any) -> dict[str, float]:
        for setting in settings:
            error = method(setting)[good] / truth[good] - 1.0
            rms = float(np.sqrt(np.mean(error**2)))
            if rms <= ERROR:
                times: list[float] = []
                while len(times) < 5 and sum(times) < 10.0:
                    start = time.process_time()
                    method(setting)
                    times.append(time.process_time() - start)
                rate = truth.size / float(np.median(times))
                return {"setting": setting, "rms": rms, "pairs_per_s": rate}
        raise SystemExit(f"no setting reaches {ERROR:g}")

    found: dict[str, Any] = {
        "edges": first(ours, ACCURACIES),
        "nn93": first(nn93, NN93_ACCURACIES),
        "polygon": first(polygons, CHORDS),
        "pairs": int(truth.size),
        "compared": float(good.mean()),
    }
    for name in ("nn93", "polygon"):
        found[name]["ratio"] = found["edges"]["pairs_per_s"] / found[name]["pairs_per_s"]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    options = parser.parse_args()
    found = measure()
    for name in ("edges", "nn93", "polygon"):
        one = found[name]
        ratio = f", 1/{one['ratio']:.0f} of edges" if "ratio" in one else ""
        print(
            f"{name:8} setting {one['setting']:<6g} rms {one['rms']:.1e}  "
            f"{one['pairs_per_s']:.3g} pairs/s{ratio}"
        )
    print(f"{found['compared']:.0%} of {found['pairs']} pairs compared")
    if options.output:
        options.output.write_text(json.dumps(found, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
