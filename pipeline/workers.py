"""Processes of a batch, one a file, and what their end means."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator

from .batch_items import BatchItem

#: The operating system cannot wait longer at a time. [s]
_LONGEST_S = 2.0e6


class Workers:
    """Processes that are running, so that an interrupt takes them along.

    Parameters
    ----------
    timeout_s : float
        Longest time for one file. [s]
    """

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self._running: set[subprocess.Popen[str]] = set()
        self._lock = threading.Lock()
        self._stopped = False

    def run(self, item: BatchItem, command: list[str]) -> None:
        """Run one file and write down what became of it."""
        began = time.perf_counter()
        with self._lock:
            if self._stopped:
                item.interrupt()
                return
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,  # its own children end with it
            )
            self._running.add(process)
        try:
            out, err = process.communicate(timeout=min(self.timeout_s, _LONGEST_S))
            if self._stopped and process.returncode < 0:
                item.interrupt()
            else:
                judge(item, process.returncode, out, err)
        except subprocess.TimeoutExpired:
            _end(process)
            process.communicate()
            item.status = "timed out"
            item.message = f"not finished within {self.timeout_s:g} s"
        finally:
            if process.poll() is None:
                _end(process)
                process.wait()
            with self._lock:
                self._running.discard(process)
            item.seconds = time.perf_counter() - began

    def stop(self) -> None:
        """End all workers."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                _end(process)


@contextlib.contextmanager
def termination_interrupts() -> Iterator[None]:
    """Take the end that a scheduler or a shutdown asks for (SIGTERM) as an interrupt.

    Else the process would be gone at once and its workers would run on without it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # handlers can be set in the main thread only
        return

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def judge(item: BatchItem, code: int, out: str, err: str) -> None:
    """Status from the exit code; the last line of the talk says why."""
    item.exit_code = code
    said = [line.strip() for line in err.splitlines() if line.strip()]
    item.status = {0: "ok", 1: "failed", 3: "not converged"}.get(code, "failed")
    if code in (0, 1, 3):
        try:
            printed = json.loads(out)
            item.faces, item.patches = int(printed["faces"]), int(printed["patches"])
            for row in printed["metrics"]:
                item.metrics.setdefault(row["sensor_id"], {})[row["id"]] = row["value"]
                if row.get("uncertainty") is not None:
                    item.errors.setdefault(row["sensor_id"], {})[row["id"]] = row["uncertainty"]
            item.accuracy_reached = printed.get("accuracy_reached")
            item.warnings = [str(text) for text in printed.get("warnings", [])]
        except (ValueError, KeyError, TypeError):
            item.status = "failed"
        else:
            if code == 1:
                item.status = "requirement failed"
    if item.status == "ok":
        return
    if code < 0:
        item.message = f"the process was ended by {_signal_name(-code)}"
    elif code == 2:
        # The message may go on below its first line, as that of a scene file does.
        start = max((k for k, s in enumerate(said) if s.startswith("patchlight: ")), default=0)
        item.message = "; ".join(said[start:]).removeprefix("patchlight: ")
    elif item.status == "requirement failed":
        item.message = "a requirement failed"
    else:
        item.message = said[-1].removeprefix("warning: ") if said else f"exit code {code}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # real-time signals have no names of their own
        return f"signal {number}"
