"""STEP files read in a child process, so that a crash of the CAD kernel is one clear error."""

from __future__ import annotations

import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.memory import available_bytes
from patchlight.solver.model import Model

from . import kept, stored

#: Geometry of triangles in AP242 files.
TESSELLATED = (b"TESSELLATED_", b"TRIANGULATED_FACE")
#: What the CAD kernel and Python say when memory ends.
OUT_OF_MEMORY = ("bad_alloc", "OutOfMemory", "MemoryError", "allocate memory", "Memory allocation")


def read_step(
    path: str | Path,
    *,
    scale: float = 1.0,
    unit: str | None = None,
    tolerance: float = 1e-4,
    angle_deg: float = 1.0,
    heal: bool = True,
    timeout_s: float = 300.0,
    memory_gb: float | None = None,
    check_areas: bool = True,
    cache: bool = True,
) -> Model:
    """Read a STEP file (AP203, AP214, AP242) into rational bicubic patches.

    Parameters
    ----------
    path : str or Path
        The file; its stem becomes the name of the model.
    scale : float
        Factor on all lengths, after the unit.
    unit : str, optional
        Length unit of the numbers in the file, instead of the one it declares: mm, cm, m, in, ft.
    tolerance : float
        Largest deviation of an approximated face, relative to the size of its part; the area of
        each face is kept within 1e-4 besides.
    angle_deg : float
        Largest deviation of a normal on approximated faces. [deg]
    heal : bool
        Let the CAD kernel repair parts of which a face cannot be converted.
    timeout_s : float
        Limit for reading and converting. [s]
    memory_gb : float, optional
        Limit for the memory of the process that does it, what is free when not given; kept where
        the system can see to that (Linux). [GB]
    check_areas : bool
        Compare the area of each face with an integral over its surface and boundary alone; without
        it `Face.area_error` is NaN.
    cache : bool
        Take the model from the cache if the content of the file, the options and the converter are
        those of an earlier time; the certificate says so. It lies in the user's cache folder, or
        in that of the environment variable PATCHLIGHT_CACHE_DIR.

    Returns
    -------
    Model
        Lengths in metres, in the axes of the file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    InputError
        If it is no usable STEP file, or the CAD kernel crashed or ran out of time or memory
        on it.
    """
    file = Path(path)
    check_options(scale, tolerance, angle_deg, timeout_s)
    if memory_gb is not None and not 0.0 < memory_gb < math.inf:
        raise InputError(f"memory_gb = {memory_gb}: must be above 0 and finite")
    text = checked_content(file)
    options = {
        "scale": scale, "unit": unit, "tolerance": tolerance, "angle_deg": angle_deg,
        "heal": heal, "check_areas": check_areas, "cache": cache,
    }  # fmt: skip
    # The name of the file names what has no name in it. What other files hold that it refers to
    # (ISO 10303-21 external references) is not in the key; their parts are kept by themselves.
    is_whole = cache and b"DOCUMENT_FILE" not in text
    name = kept.key(text, {**options, "stem": file.stem}) if is_whole else ""
    if is_whole:
        model = kept.model(name, str(file))
        if model is not None:
            return model
    request = {
        **options, "path": str(file), "sha256": hashlib.sha256(text).hexdigest(),
        "notes": _remarks(text),
        "memory": available_bytes() if memory_gb is None else int(1e9 * memory_gb),
        "asked_memory": memory_gb is not None,
    }  # fmt: skip
    contents = _run(request, timeout_s)
    if is_whole:
        kept.put(name, contents)
    return stored.to_model(contents)


def check_options(scale: float, tolerance: float, angle_deg: float, timeout_s: float) -> None:
    for name, value, low, high in (
        ("scale", scale, 0.0, math.inf),
        ("tolerance", tolerance, 1e-8, 0.1),
        ("angle_deg", angle_deg, 1e-3, 45.0),
        ("timeout_s", timeout_s, 0.0, math.inf),
    ):
        if not (math.isfinite(value) and low <= value <= high and value > 0.0):
            bounds = f"lie between {low:g} and {high:g}" if low > 0.0 else "be above 0 and finite"
            raise InputError(f"{name} = {value}: must {bounds}")


def checked_content(file: Path) -> bytes:
    """Content of a STEP file, after the checks that need no CAD kernel."""
    if not file.exists():
        raise MissingFileError(f"{file}: no such file")
    if file.is_dir():
        raise InputError(f"{file}: is a folder, not a STEP file")
    try:
        text = file.read_bytes()
    except OSError as error:
        raise MissingFileError(f"{file}: cannot be read ({error.strerror})") from error
    if not text.strip():
        raise InputError(f"{file}: the file is empty")
    if b"ISO-10303-21" not in text[:4096]:
        raise InputError(f"{file}: not a STEP file (it does not start with ISO-10303-21)")
    if b"END-ISO-10303-21" not in text[-4096:]:
        raise InputError(f"{file}: the STEP file is truncated (END-ISO-10303-21 is missing)")
    if b"_FACE" not in text.replace(b"TRIANGULATED_FACE", b"") and any(
        word in text for word in TESSELLATED
    ):
        raise InputError(f"{file}: holds tessellated geometry only, no exact surfaces")
    return text


def _remarks(text: bytes) -> list[str]:
    """What is said of the content of a file besides what becomes of its faces."""
    if any(word in text for word in TESSELLATED):
        return ["the file also holds tessellated geometry, which is ignored"]
    return []


def _run(request: dict[str, Any], timeout_s: float) -> stored.Contents:
    path = request["path"]
    with tempfile.TemporaryDirectory(prefix="patchlight-") as folder:
        ask, answer = Path(folder) / "request.json", Path(folder) / "result.npz"
        ask.write_text(json.dumps(request), encoding="utf-8")
        command = [sys.executable, "-m", "patchlight.importers.child", str(ask), str(answer)]
        # Threads of a linear algebra library only get in each other's way on small arrays.
        env = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command, timeout=timeout_s, capture_output=True, check=False, env=env
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"{path}: not read within {timeout_s:g} s (timeout_s)") from None
        if not answer.exists():
            raise InputError(f"{path}: {_cause(done, request)}")
        contents = stored.read(answer)
    head = contents[0]
    if "out_of_memory" in head:
        raise InputError(f"{path}: {_too_little(request)}")
    if "error" in head:
        message = head["error"]
        raise InputError(message if message.startswith(path) else f"{path}: {message}")
    return contents


def _cause(done: subprocess.CompletedProcess[bytes], request: dict[str, Any]) -> str:
    text = done.stderr.decode(errors="replace").strip()
    # Windows has no such signal, and no process that ends by one.
    killed = -getattr(signal, "SIGKILL", 9)
    if any(word in text for word in OUT_OF_MEMORY) or done.returncode == killed:
        return _too_little(request)
    if done.returncode < 0:
        limited = ""
        if request["asked_memory"]:
            limited = f", perhaps for want of memory: {request['memory'] / 1e9:.3g} GB (memory_gb)"
        return f"the CAD kernel crashed on this file (signal {-done.returncode}){limited}"
    lines = text.splitlines()
    return f"reading failed: {lines[-1] if lines else f'exit code {done.returncode}'}"


def _too_little(request: dict[str, Any]) -> str:
    memory = request["memory"]
    if memory is None:
        return "reading takes more memory than there is"
    which = "memory_gb" if request["asked_memory"] else "what is free; memory_gb sets another limit"
    return f"reading takes more memory than {memory / 1e9:.3g} GB ({which})"
