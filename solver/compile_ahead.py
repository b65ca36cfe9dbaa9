"""Processes that compile kernels ahead of a first run.

Numba compiles one function after the other in a process, whatever the number of cores. So as soon
as a process knows that it will need kernels that are not on the disk, it starts others that compile
those nearly every run needs, while it imports libraries, reads models and compiles itself. All
share the folder of compiled kernels: what one is compiling, others wait for and load. If a process
fails, the others do its work.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import platform
import re
import subprocess
import sys
import threading
from importlib import metadata
from pathlib import Path

from .cache_locks import locks_of
from .cores import usable_cores
from .errors import InputError
from .memory import available_bytes
from .numba_cache import KERNELS, TESTED_VERSIONS, is_compiling_off, source_key, use_cache_folder

#: Environment variable: how many processes compile ahead; 0: none.
VARIABLE = "PATCHLIGHT_COMPILE_PROCESSES"
#: More do not help: one kernel takes half the time, and two processes beside it do the rest.
MOST_PROCESSES = 2
#: Processes that a user may ask for.
LIMIT = 64
#: Memory of a process that compiles, and of the run beside it. [B]
PROCESS_BYTES, RUN_BYTES = 1_000_000_000, 2_000_000_000
#: Kernels that nearly every run needs, and the types of their arguments.
LIST = KERNELS / "ahead.txt"
#: Time in which a process that is told to end does so; then it is killed. [s]
_ENDING_S = 0.5
#: Folders that this process has looked at, and whether kernels were in them then.
_LOOKED_AT: dict[Path, bool] = {}


def compile_ahead() -> tuple[Path, bool]:
    """Start processes that compile kernels, once, where that helps.

    It does not where they are compiled already, where nothing can be kept on the disk, on one core,
    with little memory, and where Python cannot be started as a program of its own.

    Returns
    -------
    folder : Path
        Where compiled kernels are kept.
    warm : bool
        Whether there were any when this was first called; see `use_cache_folder`.

    Raises
    ------
    InputError
        If the environment variable `VARIABLE` is no number of processes.
    """
    asked = asked_processes()
    folder, warm = use_cache_folder()
    if folder not in _LOOKED_AT:
        _LOOKED_AT[folder] = warm
        if asked != 0 and _can_help(folder):
            for number in range(_sensible_processes() if asked is None else asked):
                _start(number, folder)
    return folder, _LOOKED_AT[folder]


def _can_help(folder: Path) -> bool:
    """Whether there is something to compile, and another process can."""
    if is_compiling_off() or done_mark(folder).exists():
        return False
    if numba_version()[:2] not in TESTED_VERSIONS:
        return False  # what is listed and kept are then kernels that call each other, one by one
    is_program = bool(sys.executable) and not getattr(sys, "frozen", False)
    return is_program and locks_of(folder) is not None


def asked_processes() -> int | None:
    """How many processes the user asks for; None where that is left to the program."""
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return None
    if not (text.isascii() and text.isdigit()):
        raise InputError(f"{VARIABLE} = {text!r}: must be a whole number from 0 to {LIMIT}")
    if int(text) > LIMIT:
        raise InputError(f"{VARIABLE} = {text}: must be a whole number from 0 to {LIMIT}")
    return int(text)


def numba_version() -> tuple[int, ...]:
    """Version of Numba, which need not be imported for it."""
    return tuple(int(n) for n in re.findall(r"\d+", metadata.version("numba")))


def done_mark(folder: Path) -> Path:
    """File whose presence says that all in `LIST` is compiled, by this version of everything.

    That is what Numba finds it by: path and time of the sources, and the kind of CPU.
    """
    digest = hashlib.sha256(LIST.read_bytes())
    times = [path.stat().st_mtime_ns for path in sorted(KERNELS.rglob("*.py"))]
    for text in (source_key(), sys.version, metadata.version("numba"), KERNELS, times, _cpu()):
        digest.update(f"{text}\0".encode())
    return folder / f"ahead-{digest.hexdigest()[:16]}"


def _cpu() -> str:
    """What tells kinds of CPU apart that machine code is made for."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        return platform.processor()
    told = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(told)}))


def _sensible_processes() -> int:
    free = available_bytes()
    room = MOST_PROCESSES if free is None else (free - RUN_BYTES) // PROCESS_BYTES
    return max(0, min(MOST_PROCESSES, usable_cores() - 1, room))


def _start(number: int, folder: Path) -> None:
    """Start one process; nothing happens where that fails."""
    command = [sys.executable, "-P", "-m", "patchlight.solver.kernels", str(number)]
    try:
        process = subprocess.Popen(
            command,
            env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
            stdin=subprocess.PIPE,  # closed when this process ends, however it does: a sign to end
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return
    # Whoever waits for it takes the process from the system's table as soon as it has ended.
    threading.Thread(target=process.wait, daemon=True).start()
    atexit.register(_end, process)


def _end(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(OSError):
        if process.stdin is not None:
            process.stdin.close()
    try:
        process.wait(_ENDING_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
