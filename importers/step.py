"""STEP files read in a child process, so that a crash of the CAD kernel is one clear error."""

from __future__ import annotations

import hashlib
import json
import math
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from patchlight.solver.errors import InputError, MissingFileError
from patchlight.solver.model import Certificate, Face, Model, Part, PatchSet


def read_step(
    path: str | Path,
    *,
    scale: float = 1.0,
    unit: str | None = None,
    tolerance: float = 1e-4,
    angle_deg: float = 1.0,
    heal: bool = True,
    timeout_s: float = 300.0,
    check_areas: bool = True,
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
    check_areas : bool
        Compare the area of each face with an integral over its surface and boundary alone; without
        it `Face.area_error` is NaN.

    Returns
    -------
    Model
        Lengths in metres, in the axes of the file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    InputError
        If it is no usable STEP file, or the CAD kernel crashed or ran out of time on it.
    """
    file = Path(path)
    _check_options(scale, tolerance, angle_deg, timeout_s)
    text = checked_content(file)
    request = {
        "path": str(file), "scale": scale, "unit": unit, "tolerance": tolerance,
        "angle_deg": angle_deg, "heal": heal, "check_areas": check_areas,
        "sha256": hashlib.sha256(text).hexdigest(),
    }  # fmt: skip
    return unpack(_run(request, timeout_s))


def _check_options(scale: float, tolerance: float, angle_deg: float, timeout_s: float) -> None:
    for name, value, low, high in (
        ("scale", scale, 0.0, math.inf),
        ("tolerance", tolerance, 1e-8, 0.1),
        ("angle_deg", angle_deg, 1e-3, 45.0),
        ("timeout_s", timeout_s, 0.0, math.inf),
    ):
        if not (math.isfinite(value) and low <= value <= high and value > 0.0):
            raise InputError(f"{name} = {value}: must lie between {low:g} and {high:g}")


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
    if b"_FACE" not in text and b"TESSELLATED" in text:
        raise InputError(f"{file}: holds tessellated geometry only, no exact surfaces")
    return text


def _run(request: dict[str, Any], timeout_s: float) -> dict[str, Any]:
    path = request["path"]
    with tempfile.TemporaryDirectory(prefix="patchlight-") as folder:
        ask, answer = Path(folder) / "request.json", Path(folder) / "result.pickle"
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
            raise InputError(f"{path}: {_cause(done)}")
        result = pickle.loads(answer.read_bytes())
    if "error" in result:
        message = result["error"]
        raise InputError(message if message.startswith(path) else f"{path}: {message}")
    return result


def _cause(done: subprocess.CompletedProcess[bytes]) -> str:
    if done.returncode < 0:
        return f"the CAD kernel crashed on this file (signal {-done.returncode})"
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return f"reading failed: {lines[-1] if lines else f'exit code {done.returncode}'}"


def unpack(data: dict[str, Any]) -> Model:
    """Model from what `child.pack` wrote."""
    parts = tuple(Part(*row) for row in data["parts"])
    faces = tuple(Face(*row) for row in data["faces"])
    certificate = Certificate(
        faces, tuple(p.path for p in parts), data["seconds"], tuple(data["notes"]),
        data["reading_seconds"], data["area_seconds"],
    )  # fmt: skip
    return Model(
        data["name"], parts, faces, PatchSet(*data["patches"]), certificate,
        data["source"], data["sha256"], data["unit"], tuple(data["warnings"]),
    )  # fmt: skip
