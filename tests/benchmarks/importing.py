"""What the import makes of a folder of STEP files, and how fast.

    python tests/benchmarks/importing.py FOLDER [-o import.json] [--tolerance 1e-4] [--angle 1]
                                                [--studs 26]

Each file is converted in a process of its own. The table gives per file: faces; those that are
exact, approximated, failed, or off in area; CPU seconds of reading, of untrimming and of the checks
(areas, and the CAD kernel's own) apart; faces a second without and with reading (equal parts count
once); the slowest face, converted again by itself, and the peak of memory; the largest deviation
relative to the part and angle of a normal [deg]; the worst area error of exact (=) and of
approximated (~) faces; patches, the largest aspect (mean length along u over that along v, or its
inverse) and smallest ratio of Jacobians inside a patch; how many times faster the file is read from
the cache; and sides on an edge of the file that no other side of the part equals, of all. Faces
that fail or miss a tolerance are named. Below it: patches a face by kind of surface, and of trimmed
faces (no rectangle in (u, v)) beside the least number that four-sided patches can do with
(`least_patches`) and 5 + 5 a hole.

``--studs N`` adds a plate with N x N studs, 3 N² + 6 faces: memory and time of a large part.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.model import Model, PatchSet
from patchlight.solver.model.bezier import surface_points

SUFFIXES = (".step", ".stp")
#: The part that is made here, which is left out of the sums.
OWN = "studs.step"
#: Inner points of a patch at which its shape is judged: collapsed sides are left out.
INNER = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
#: A side is matched by one whose ends and inner points agree to this share of the part's size.
SAME_SIDE = 1e-9


def shapes(patches: PatchSet) -> tuple[np.ndarray, np.ndarray]:
    """Aspect (p,) and ratio (p,) of the smallest to the largest Jacobian of each patch."""
    u, v = (g.ravel() for g in np.meshgrid(INNER, INNER, indexing="ij"))
    _, su, sv = surface_points(patches.control_points, u, v)
    along = np.linalg.norm(su, axis=2).mean(axis=1) / np.linalg.norm(sv, axis=2).mean(axis=1)
    jacobian = np.linalg.norm(np.cross(su, sv), axis=2)
    return np.maximum(along, 1.0 / along), jacobian.min(axis=1) / jacobian.max(axis=1)


def open_sides(patches: PatchSet) -> tuple[int, int]:
    """Sides on an edge of the file that no other side of the part equals, and all of them."""
    t = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
    zero, one = np.zeros(4), np.ones(4)
    ways = ((t, zero), (one, t), (t, one), (zero, t))
    points = np.stack([patches.evaluate(u, v) for u, v in ways], axis=1)
    on = patches.edge_index >= 0
    loose = total = 0
    for part in np.unique(patches.part_index):
        rows = patches.part_index == part
        size = float(np.linalg.norm(np.ptp(points[rows].reshape(-1, 3), axis=0)))
        sides = points[rows][on[rows]]
        sides = sides[np.ptp(sides, axis=1).max(axis=1) > SAME_SIDE * size]
        if not len(sides):
            continue
        # Both directions of a side have the same key; keys are compared after rounding twice.
        key = np.concatenate([sides[:, [0, 3]].mean(axis=1), sides[:, [1, 2]].mean(axis=1)], axis=1)
        matched = np.zeros(len(sides), dtype=bool)
        for shift in (0.0, 0.5):
            cells = np.floor(key / (100.0 * SAME_SIDE * size) + shift).astype(np.int64)
            _, group, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
            matched |= count[group.ravel()] > 1
        loose += int((~matched).sum())
        total += len(sides)
    return loose, total


def by_kind(model: Model) -> dict[str, dict[str, float]]:
    """Faces, failed ones, and median, mean and largest number of patches of each kind."""
    found: dict[str, list[int]] = defaultdict(list)
    for face in model.faces:
        found[face.kind].append(face.patches)
    return {
        kind: {
            "faces": len(n),
            "failed": n.count(0),
            "median": float(np.median(n)),
            "mean": float(np.mean(n)),
            "most": max(n),
        }
        for kind, n in found.items()
    }


def least_patches(sides: int, holes: int) -> int:
    """Patches that a region needs at least, with so many sides on its boundary.

    With P patches, B sides on the boundary, I lines inside and V corners inside, Euler's formula
    says (B + V) − (B + I) + P = 1 − holes, and four sides a patch, some perhaps collapsed, say
    4 P >= B + 2 I. So P >= B / 2 − 1 + holes + V: it needs whole sides that meet whole sides.
    """
    return max(1, math.ceil(0.5 * sides - 1.0) + holes)


def trimmed(
    batches: Sequence[tuple[Any, ...]], found: Sequence[Any]
) -> dict[str, list[tuple[int, int, int]]]:
    """By kind: patches of each trimmed face that was converted, the least it needs, its holes.

    Sides are what the conversion itself starts from: lines, quarters of a turn, cubics of splines.
    """
    from patchlight.importers.convert import ERRORS
    from patchlight.importers.curved_domain import curved_domain
    from patchlight.importers.planar_domain import planar_domain
    from patchlight.importers.rectangle import rectangle
    from patchlight.importers.surfaces import Plane

    out: dict[str, list[tuple[int, int, int]]] = defaultdict(list)
    for (raws, tolerance, *_), faces in zip(batches, found, strict=True):
        for raw, face in zip(raws, faces, strict=True):
            if not len(face.nets):
                continue
            try:
                plane = isinstance(raw.surface, Plane)
                domain = (planar_domain if plane else curved_domain)(raw, raw.surface)
            except ERRORS:
                continue
            margin = min(1e-6 * domain.size, 0.1 * tolerance)
            if plane and all(len(region) == 1 == len(domain.regions) for region in domain.regions):
                (loop,) = domain.regions[0]
                turns = [a.directions[1] @ b.directions[0] for a, b in itertools.pairwise(loop)]
                if len(loop) == 4 and all(a.straight for a in loop) and max(map(abs, turns)) < 1e-6:
                    continue
            elif not plane and rectangle(domain, margin) is not None:
                continue
            least = sum(
                least_patches(sum(map(len, region)), len(region) - 1) for region in domain.regions
            )
            holes = sum(len(region) - 1 for region in domain.regions)
            out[face.kind].append((len(face.nets), least, holes))
    return dict(out)


def alone(convert: Any, faces: Sequence[Any], *options: Any) -> float:
    """CPU seconds of the slowest of some faces when each is converted by itself."""
    slowest = 0.0
    with np.errstate(all="ignore"):
        for face in faces:
            start = time.process_time()
            convert([face], *options)
            slowest = max(slowest, time.process_time() - start)
    return slowest


def again(path: Path, model: Model) -> float:
    """CPU seconds of reading a file whose model is in the cache."""
    from patchlight.importers import read_step, step, stored

    with tempfile.TemporaryDirectory() as folder:
        os.environ["PATCHLIGHT_CACHE_DIR"] = folder
        step._run = lambda *_: stored.from_model(model)
        read_step(path)
        start = time.process_time()
        read_step(path)
        return time.process_time() - start


def studs(n: int, path: Path) -> None:
    """Write a plate with n x n studs with a chamfer: 3 n² + 6 faces, one with n² holes."""
    import cadquery as cq

    at = [(10.0 * i, 10.0 * k) for i in range(n) for k in range(n)]
    plate = cq.Workplane().box(10.0 * n, 10.0 * n, 4.0, centered=False).translate((-5, -5, -4))
    one = cq.Workplane().circle(3.0).extrude(6.0).faces(">Z").chamfer(1.0).val()
    both = plate.val().fuse(*(one.moved(cq.Location(cq.Vector(x, y, 0))) for x, y in at))
    cq.exporters.export(cq.Workplane(both), str(path))


def missed(model: Model, size: dict[int, float], tolerance: float, angle_deg: float) -> list[str]:
    """Faces that were converted but are off by more than was asked for."""
    out = []
    for f in model.faces:
        off = {
            "deviation": (f.deviation_m / size.get(f.part, math.inf), tolerance),
            "normal [deg]": (f.angle_deg, angle_deg),
            "area": (f.area_error, 1e-6 if f.exact else 1e-4),
        }
        over = [f"{name} {value:.3g}" for name, (value, most) in off.items() if value > most]
        if over and not f.failed:
            path = model.parts[f.part].path
            out.append(f"{path} #{f.number} ({f.kind}): {', '.join(over)}; {f.reason}")
    return out


def measured(path: Path, tolerance: float, angle_deg: float) -> dict[str, Any]:
    """Everything about one file, converted in this process."""
    from patchlight.importers import assemble, child

    time.perf_counter = time.process_time  # the certificate's clock: other processes do not count
    batches: list[tuple[Any, ...]] = []
    answers: list[Any] = []
    convert = assemble.convert_faces

    def kept(*arguments: Any) -> Any:
        batches.append(arguments)
        answers.append(convert(*arguments))
        return answers[-1]

    assemble.convert_faces = kept
    start = time.process_time()
    model, _ = child.read(
        {
            "path": str(path), "scale": 1.0, "unit": None, "tolerance": tolerance,
            "angle_deg": angle_deg, "heal": True, "sha256": "", "check_areas": True,
            "cache": False, "notes": [],
        }
    )  # fmt: skip
    spent = time.process_time() - start
    slowest = max(alone(convert, *batch) for batch in batches)
    c = model.certificate
    size: dict[int, float] = {}
    corners = model.patches.control_points[..., :3] / model.patches.control_points[..., 3:]
    for part in np.unique(model.patches.part_index).tolist():
        own = corners[model.patches.part_index == part].reshape(-1, 3)
        size[part] = float(np.linalg.norm(np.ptp(own, axis=0)))
    good = [f for f in model.faces if not f.failed]
    aspect, ratio = shapes(model.patches)
    loose, sides = open_sides(model.patches)

    def worst_area(exact: bool) -> float:
        return max((f.area_error for f in good if f.exact == exact), default=0.0)

    first = {f.part for f in model.faces if model.parts[f.part].instance_of == f.part}
    distinct = sum(f.part in first for f in model.faces)
    untrimming = c.seconds - c.reading_seconds
    return {
        "faces": c.faces_total,
        "distinct": distinct,
        "exact": c.faces_exact,
        "approximated": c.faces_approximated,
        "failed": c.faces_failed,
        "missed": missed(model, size, tolerance, angle_deg),
        "again_s": again(path, model),
        "normals_left_out": c.normals_left_out,
        "unchecked": sum(not np.isfinite(f.area_error) for f in good),
        "off": sum(f.area_error > (1e-6 if f.exact else 1e-4) for f in good),
        "reading_s": c.reading_seconds,
        "untrimming_s": untrimming,
        "area_s": c.area_seconds,
        "rate": distinct / max(untrimming, 1e-9),
        "rate_with_reading": distinct / max(c.seconds, 1e-9),
        "slowest_face_s": slowest,
        "cpu_s": spent,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "deviation": max((f.deviation_m / size[f.part] for f in good), default=0.0),
        "angle_deg": c.max_angle_deg,
        "gap": max((f.gap_m / size[f.part] for f in good), default=0.0),
        "area_error_exact": worst_area(True),
        "area_error_approximated": worst_area(False),
        "patches": len(model.patches),
        "kinds": by_kind(model),
        "trimmed": trimmed(batches, answers),
        "aspect": float(aspect.max()),
        "aspect_median": float(np.median(aspect)),
        "jacobian_ratio": float(ratio.min()),
        "jacobian_ratio_median": float(np.median(ratio)),
        "open_sides": loose,
        "sides": sides,
        "reasons": sorted(
            {f"{model.parts[f.part].path} #{f.number} ({f.kind}): {f.reason}" for f in c.failures}
        ),
        "notes": list(c.notes),
    }


def in_child(path: Path, tolerance: float, angle_deg: float, limit: float) -> dict[str, Any]:
    """`measured` in a process of its own; a crash or a timeout is an entry like any other."""
    command = [
        sys.executable, __file__, str(path), "--one",
        "--tolerance", str(tolerance), "--angle", str(angle_deg),
    ]  # fmt: skip
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=limit, check=False, env=environment
        )
    except subprocess.TimeoutExpired:
        return {"error": f"not done within {limit:g} s"}
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        return {"error": lines[-1] if lines else f"exit code {done.returncode}"}
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def line(name: str, r: dict[str, Any]) -> str:
    """One row of the table."""
    if "error" in r:
        return f"{name[:26]:26s} {r['error']}"
    return (
        f"{name[:26]:26s} {r['faces']:5d} {r['exact']:5d} {r['approximated']:5d} {r['failed']:4d} "
        f"{r['off']:3d} {r['reading_s']:6.2f} {r['untrimming_s']:6.2f} {r['area_s']:6.2f} "
        f"{r['rate']:5.0f} {r['rate_with_reading']:5.0f} {r['slowest_face_s']:6.2f} "
        f"{r['memory_mb']:5.0f} {r['deviation']:7.0e} {r['angle_deg']:6.2f} "
        f"{r['area_error_exact']:6.0e} {r['area_error_approximated']:6.0e} {r['patches']:6d} "
        f"{r['aspect']:7.0f} {r['jacobian_ratio']:7.0e} "
        f"{(r['reading_s'] + r['untrimming_s'] + r['area_s']) / r['again_s']:5.0f} "
        f"{r['open_sides']:5d}/{r['sides']}"
    )


HEAD = (
    f"{'file':26s} {'faces':>5s} {'exact':>5s} {'appr.':>5s} {'fail':>4s} {'off':>3s} "
    f"{'read':>6s} {'untrim':>6s} {'area':>6s} {'f/s':>5s} {'+read':>5s} {'worst':>6s} {'MB':>5s} "
    f"{'dev':>7s} {'angle':>6s} {'area=':>6s} {'area~':>6s} {'patch':>6s} {'aspect':>7s} "
    f"{'jac':>7s} {'cache':>5s} open sides"
)


def totals(found: dict[str, dict[str, Any]]) -> list[str]:
    """Sums over all files, and patches a face by kind."""
    good = [r for r in found.values() if "error" not in r]
    if not good:
        return ["no file could be read"]
    distinct = sum(r["distinct"] for r in good)
    untrimming = sum(r["untrimming_s"] for r in good)
    reading = sum(r["reading_s"] for r in good)
    out = [
        f"{len(found)} files, {len(found) - len(good)} not read; "
        f"{sum(r['faces'] for r in good)} faces, {sum(r['exact'] for r in good)} exact, "
        f"{sum(r['failed'] for r in good)} failed, {sum(r['off'] for r in good)} off in area; "
        f"{distinct / untrimming:.0f} faces/s, {distinct / (untrimming + reading):.0f} with reading"
    ]
    kinds: dict[str, list[dict[str, float]]] = defaultdict(list)
    for r in good:
        for kind, one in r["kinds"].items():
            kinds[kind].append(one)
    for kind, ones in sorted(kinds.items()):
        faces = sum(o["faces"] for o in ones)
        mean = sum(o["faces"] * o["mean"] for o in ones) / faces
        failed = sum(o["failed"] for o in ones)
        out.append(
            f"  {kind:12s} {faces:5.0f} faces, {failed:3.0f} failed, patches a face: mean "
            f"{mean:6.1f}, most {max(o['most'] for o in ones):5.0f}"
        )
    cut: dict[str, list[tuple[int, int, int]]] = defaultdict(list)
    for r in good:
        for kind, pairs in r["trimmed"].items():
            cut[kind] += pairs
    for kind, pairs in sorted(cut.items()):
        patches, least, holes = np.array(pairs).T
        out.append(
            f"  {kind:12s} {len(pairs):5d} trimmed, patches a face: median "
            f"{np.median(patches):4.1f} (least possible {np.median(least):4.1f}), mean "
            f"{patches.mean():6.1f} "
            f"({least.mean():.1f}), with no more than that {(patches <= least).mean():.0%}, "
            f"than 5 + 5 a hole {(patches <= 5 + 5 * holes).mean():.0%}"
        )
    return out


def main(arguments: list[str] | None = None) -> int:
    """Print the table; 0 when every file could be read."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("folder", type=Path, help="folder of STEP files, or one file")
    parser.add_argument("-o", "--output", type=Path, help="write everything as JSON")
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--angle", type=float, default=1.0, help="[deg]")
    parser.add_argument("--studs", type=int, default=0, help="studs a side of a plate of our own")
    parser.add_argument("--limit", type=float, default=600.0, help="elapsed seconds a file")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        print(json.dumps(measured(options.folder, options.tolerance, options.angle)))
        return 0
    files = [options.folder]
    if options.folder.is_dir():
        files = sorted(p for p in options.folder.rglob("*") if p.suffix.lower() in SUFFIXES)
    if not files:
        parser.error(f"{options.folder}: no STEP file")
    found: dict[str, dict[str, Any]] = {}
    print(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        if options.studs:
            files.append(Path(folder) / OWN)
            # In a process of its own: children count the memory of the one they come from.
            made = (options.studs, files[-1])
            maker = multiprocessing.get_context("spawn").Process(target=studs, args=made)
            maker.start()
            maker.join()
        for path in files:
            found[path.name] = in_child(path, options.tolerance, options.angle, options.limit)
            print(line(path.name, found[path.name]), flush=True)
            for what in ("reasons", "missed"):
                for reason in found[path.name].get(what, []):
                    print(f"    {'failed' if what == 'reasons' else 'off'}: {reason}")
    print("\n".join(totals({n: r for n, r in found.items() if n != OWN})))
    if options.output:
        options.output.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return int(any("error" in r for r in found.values()))


if __name__ == "__main__":
    raise SystemExit(main())
