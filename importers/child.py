"""The process that reads one STEP file: ``python -m patchlight.importers.child REQUEST RESULT``.

The CAD kernel may crash, hang or take all memory on an unknown file; here it takes nobody down
with it.
"""

from __future__ import annotations

import json
import re
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
    from .units import unit_metres
    from .xcaf import read_document

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
            request["tolerance"], request["angle_deg"], request["heal"],
            request["check_areas"], request["cache"],
        ),
        source=request["path"],
        sha256=request["sha256"],
        unit=unit,
        started=started,
        read=read_at,
        notes=request["notes"],
    )  # fmt: skip


def limit_memory(size: int) -> None:
    """Let this process take ``size`` bytes at most, where the system can see to that.

    Raises
    ------
    MemoryError
        If it has them already: the CAD kernel, left without any, crashes as often as it says so.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    # Data, not address space: libraries reserve far more of the latter than they use.
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    if most != resource.RLIM_INFINITY:
        size = min(size, most)
    if data_bytes() >= size:
        raise MemoryError
    resource.setrlimit(resource.RLIMIT_DATA, (size, most))


def data_bytes() -> int:
    """What the limit counts of this process, as Linux tells; 0 elsewhere. [B]"""
    try:
        text = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0
    found = re.search(r"^VmData:\s+(\d+) kB", text, re.MULTILINE)
    return 1024 * int(found[1]) if found else 0


def main(argv: list[str]) -> int:
    """Read the request, write the model or the error; the parent reports it."""
    from . import stored

    request, answer = json.loads(Path(argv[0]).read_text(encoding="utf-8")), Path(argv[1])
    try:
        if request["memory"] is not None:
            # Modules that find no memory while they load fail with errors of any kind.
            from . import assemble, occurrences, xcaf  # noqa: F401

            limit_memory(request["memory"])
        model, _ = read(request)
        stored.write(answer, *stored.from_model(model))
    except PatchlightError as error:
        stored.write(answer, {"error": str(error)}, {})
    except MemoryError:
        stored.write(answer, {"out_of_memory": True}, {})
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
