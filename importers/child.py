"""The process that reads one STEP file: ``python -m patchlight.importers.child REQUEST RESULT``.

The CAD kernel may crash or hang on an unknown file; here it takes nobody down with it.
"""

from __future__ import annotations

import json
import pickle
import sys
import time
from pathlib import Path
from typing import Any

from patchlight.solver.errors import PatchlightError
from patchlight.solver.model import Model


def read(request: dict[str, Any]) -> tuple[Model, list[list[Any]]]:
    """Model of a STEP file and the CAD faces of its parts."""
    from .assemble import Options, assemble
    from .occurrences import bodies
    from .xcaf import read_document, unit_metres

    started = time.perf_counter()
    occurrences, declared = read_document(request["path"])
    read_at = time.perf_counter()
    unit = request["unit"] or declared
    # The kernel has turned the declared unit into millimetres.
    metres = 1e-3 * request["scale"]
    if request["unit"]:
        metres *= unit_metres(request["unit"]) / unit_metres(declared)
    return assemble(
        bodies(occurrences),
        name=Path(request["path"]).stem,
        metres=metres,
        options=Options(
            request["tolerance"], request["angle_deg"], request["heal"], request["check_areas"]
        ),
        source=request["path"],
        sha256=request["sha256"],
        unit=unit,
        started=started,
        read=read_at,
        warnings=[],
    )


def pack(model: Model) -> dict[str, Any]:
    """A model as plain arrays and tuples, for another process."""
    p = model.patches
    return {
        "name": model.name,
        "parts": [
            (q.path, q.kind, q.color, q.layer, q.material, q.placement, q.instance_of)
            for q in model.parts
        ],
        "faces": [
            (
                f.part, f.number, f.kind, f.exact, f.patches, f.deviation_m, f.angle_deg,
                f.area_m2, f.area_error, f.gap_m, f.reason, f.name, f.color,
            )
            for f in model.faces
        ],
        "patches": (p.control_points, p.face_index, p.part_index, p.edge_index),
        "seconds": model.certificate.seconds,
        "reading_seconds": model.certificate.reading_seconds,
        "area_seconds": model.certificate.area_seconds,
        "notes": model.certificate.notes,
        "source": model.source,
        "sha256": model.sha256,
        "unit": model.unit,
        "warnings": model.warnings,
    }  # fmt: skip


def main(argv: list[str]) -> int:
    """Read the request, write the pickled result or error; the parent reports it."""
    request = json.loads(Path(argv[0]).read_text(encoding="utf-8"))
    try:
        model, _ = read(request)
        result: dict[str, Any] = pack(model)
    except PatchlightError as error:
        result = {"error": str(error)}
    Path(argv[1]).write_bytes(pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
