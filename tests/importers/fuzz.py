"""Reads many STEP files, each in a fork of this process that has the CAD kernel loaded.

``python fuzz.py FOLDER`` reads every ``*.step`` there as `read_step` does in its own process, and
prints one line of JSON for each: name, how the process ended, what it said, and how many patches
came of it.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

import numpy as np
from patchlight.importers import child, stored

#: CPU seconds and bytes that a file may take; on a busy machine twice that of the clock.
SECONDS, BYTES = 120, 2_000_000_000


def read(path: Path) -> int:
    """In a fork: read one file as the reading process does."""
    # Both end the process by a signal.
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
    signal.alarm(2 * SECONDS)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(os.open(path.with_suffix(".err"), os.O_WRONLY | os.O_CREAT), 2)
    ask = path.with_suffix(".json")
    request = {
        "path": str(path), "scale": 1.0, "unit": None, "tolerance": 1e-3, "angle_deg": 2.0,
        "heal": True, "check_areas": True, "cache": False, "notes": [], "sha256": "",
        "memory": BYTES,
    }  # fmt: skip
    ask.write_text(json.dumps(request))
    return child.main([str(ask), str(path.with_suffix(".npz"))])


def outcome(path: Path) -> dict[str, object]:
    """Read one file in a fork and tell what became of it."""
    start = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            code = read(path)
        except BaseException as error:
            Path(path.with_suffix(".err")).write_text(f"{type(error).__name__}: {error}")
        finally:
            os._exit(code)
    _, status = os.waitpid(pid, 0)
    out: dict[str, object] = {"name": path.name, "code": os.waitstatus_to_exitcode(status)}
    out["seconds"] = time.perf_counter() - start
    answer = path.with_suffix(".npz")
    if answer.exists():
        head, arrays = stored.read(answer)
        out["error"] = head.get("error")
        if "control_points" in arrays:
            model = stored.to_model((head, arrays))
            out["patches"] = len(model.patches)
            out["finite"] = bool(np.isfinite(model.patches.control_points).all())
            out["failed"] = model.certificate.faces_failed
    else:
        said = path.with_suffix(".err")
        out["said"] = said.read_text(errors="replace")[-300:] if said.exists() else ""
    return out


if __name__ == "__main__":
    import patchlight.importers.assemble
    import patchlight.importers.xcaf  # noqa: F401  loaded once, before the forks

    for file in sorted(Path(sys.argv[1]).glob("*.step")):
        print(json.dumps(outcome(file)), flush=True)
