"""What `inspect` prints: the part tree and the certificate as plain data."""

from __future__ import annotations

import math
from typing import Any

from patchlight.solver.model import Model


def _number(value: float) -> float | None:
    """A float that JSON can hold."""
    return float(value) if math.isfinite(value) else None


def hex_color(color: tuple[float, float, float] | None) -> str | None:
    """``#rrggbb`` (sRGB) of a linear colour. [IEC 61966-2-1]"""
    if color is None:
        return None
    out = []
    for c in color:
        c = min(max(c, 0.0), 1.0)
        s = 12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055
        out.append(f"{round(255 * s):02x}")
    return "#" + "".join(out)


def inspection(model: Model) -> dict[str, Any]:
    """Parts, faces and certificate of a model as JSON-serialisable data.

    Lengths in m, areas in m², angles in degrees; ``None`` stands for "not checked".
    """
    c = model.certificate
    counts: list[dict[str, int]] = [{} for _ in model.parts]
    area = [0.0] * len(model.parts)
    patches = [0] * len(model.parts)
    for f in model.faces:
        counts[f.part][f.kind] = counts[f.part].get(f.kind, 0) + 1
        area[f.part] += f.area_m2
        patches[f.part] += f.patches
    parts = [
        {
            "path": p.path,
            "name": p.name,
            "kind": p.kind,
            "color": hex_color(p.color),
            "layer": p.layer,
            "material": p.material,
            "placement": p.placement.tolist(),
            "instance_of": p.instance_of,
            "faces": sum(counts[i].values()),
            "face_kinds": counts[i],
            "patches": patches[i],
            "area_m2": area[i],
        }
        for i, p in enumerate(model.parts)
    ]
    faces = [
        {
            "part": model.parts[f.part].path,
            "number": f.number,
            "kind": f.kind,
            "exact": f.exact,
            "patches": f.patches,
            "deviation_m": _number(f.deviation_m),
            "angle_deg": _number(f.angle_deg),
            "area_m2": _number(f.area_m2),
            "area_error": _number(f.area_error),
            "gap_m": _number(f.gap_m),
            "free_edge_m": _number(f.free_edge_m),
            "normals_left_out": f.normals_left_out,
            "reason": f.reason,
            "name": f.name,
            "color": hex_color(f.color),
        }
        for f in model.faces
    ]
    return {
        "name": model.name,
        "source": model.source,
        "sha256": model.sha256,
        "unit": model.unit,
        "warnings": list(model.warnings),
        "parts": parts,
        "certificate": {
            "faces_total": c.faces_total,
            "faces_exact": c.faces_exact,
            "faces_approximated": c.faces_approximated,
            "faces_failed": c.faces_failed,
            "max_deviation_m": c.max_deviation_m,
            "max_angle_deg": c.max_angle_deg,
            "max_area_error": c.max_area_error,
            "max_gap_m": c.max_gap_m,
            "free_edge_m": c.free_edge_m,
            "normals_left_out": c.normals_left_out,
            "edges": c.edges,
            "part_edges": [
                {"part": path, **counts}
                for path, counts in zip(c.part_paths, c.part_edges, strict=True)
            ],
            "patches": c.patches,
            "seconds": c.seconds,
            "notes": list(c.notes),
            "faces": faces,
        },
    }
