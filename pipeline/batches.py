"""Many files, each in a process of its own: nothing is lost when one of them fails."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed, wait
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from patchlight.solver.errors import InputError, MissingFileError, PatchlightError
from patchlight.solver.numba_cache import use_cache_folder

from .output import file_hash, prepare_output
from .runs import STEP_SUFFIXES

#: Kept in each finished subfolder, so that a batch that was cut short goes on where it stood.
RECORD = "batch-item.json"


@dataclass(slots=True)
class BatchItem:
    """What became of one file.

    Attributes
    ----------
    name : str
        Name of its subfolder.
    path, output : str
        Input file and output folder.
    status : str
        "ok", "requirement failed", "not converged", "failed", "timed out" or "waiting".
    exit_code : int or None
        Of its process; negative for a signal.
    seconds : float
        Wall-clock time.
    message : str
        One line why it failed; empty otherwise.
    faces, patches : int or None
        Size of the model.
    metrics : dict of dict
        Values by grid and metric.
    """

    name: str
    path: str
    output: str
    status: str = "waiting"
    exit_code: int | None = None
    seconds: float = 0.0
    message: str = ""
    faces: int | None = None
    patches: int | None = None
    metrics: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the file has a report that can be relied on."""
        return self.status == "ok"


def batch(
    paths: Iterable[str | Path],
    out: str | Path,
    *,
    jobs: int | None = None,
    scene: str | Path | None = None,
    timeout_s: float = 3600.0,
) -> list[BatchItem]:
    """Simulate files and folders of STEP files, each in a worker process.

    Parameters
    ----------
    paths : paths
        STEP files, scene files, or folders of STEP files.
    out : path
        Gets one subfolder a file, and summary.csv and summary.html, rewritten after each file.
        Files that were finished there with the same contents and settings are kept.
    jobs : int, optional
        Files at a time; the number of cores when not given.
    scene : path, optional
        Scene file whose first model every STEP file replaces in turn; defaults without it.
    timeout_s : float
        Longest time for one file. [s]

    Returns
    -------
    list of BatchItem
        In the order of the files.
    """
    return run_batch(
        [Path(p) for p in paths],
        Path(out),
        jobs=jobs,
        scene=None if scene is None else Path(scene),
        timeout_s=timeout_s,
    )


def run_batch(
    paths: Iterable[Path],
    out: Path,
    *,
    jobs: int | None = None,
    scene: Path | None = None,
    timeout_s: float = 3600.0,
    accuracy: float | None = None,
    force: bool = False,
    check: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> list[BatchItem]:
    """`batch` with the options of the command line; ``say`` gets a line a finished file."""
    files = batch_files(paths)
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}: must be at least 1")
    if not timeout_s > 0.0:
        raise InputError(f"timeout = {timeout_s}: must be positive")
    if scene is not None and not scene.is_file():
        raise MissingFileError(f"{scene}: no such file")
    prepare_output(out, (), force=True)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    workers = min(jobs or cores or 1, len(files))
    threads = max(1, (cores or 1) // workers)
    options = ["--threads", str(threads), "--force", "--json"]
    settings: dict[str, Any] = {"accuracy": accuracy, "check": check}
    if accuracy is not None:
        options += ["--accuracy", repr(accuracy)]
    if check:
        options.append("--check")
    if scene is not None:
        settings["scene"] = file_hash(scene)
    items = [BatchItem(name, str(path), str(out / name)) for name, path in _names(files).items()]
    workers_alive = _Workers(timeout_s)

    def work(item: BatchItem) -> BatchItem:
        path = Path(item.path)
        key = {**settings, **_identity(path)}
        if not force and _kept(item, key):
            return item
        template = [] if scene is None or path.suffix.lower() == ".toml" else ["--scene", scene]
        command = [sys.executable, "-m", "patchlight.pipeline.cli", "run", path, "-o", item.output]
        workers_alive.run(item, [str(c) for c in (*command, *options, *template)])
        _remember(item, key)
        return item

    pool = ThreadPoolExecutor(workers)
    try:
        futures = [pool.submit(work, item) for item in items[:1]]
        _, warm = use_cache_folder()
        if not warm:
            # Else every worker would compile the same kernels at the same time.
            wait(futures)
        futures += [pool.submit(work, item) for item in items[1:]]
        for future in as_completed(futures):
            item = future.result()
            text = f": {item.message}" if item.message else ""
            say(f"{item.path}: {item.status} ({item.seconds:.0f} s){text}")
            _write_summary(items, out)
    except BaseException:
        workers_alive.stop()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return items


def batch_files(paths: Iterable[Path]) -> list[Path]:
    """All files that ``paths`` mean; folders give their STEP files, sorted."""
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in STEP_SUFFIXES)
            if not inside:
                raise InputError(f"{path}: the folder holds no STEP files")
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise MissingFileError(f"{path}: no such file or folder")
    if not found:
        raise InputError("batch: give STEP files, scene files or a folder")
    return list(dict.fromkeys(found))


def _names(files: list[Path]) -> dict[str, Path]:
    """Name of each file's subfolder, unique without regard to case."""
    names: dict[str, Path] = {}
    for path in files:
        name, count = path.stem, 1
        while name.lower() in (n.lower() for n in names):
            count += 1
            name = f"{path.stem}-{count}"
        names[name] = path
    return names


class _Workers:
    """Processes that are running, so that an interrupt takes them along."""

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
                item.status, item.message = "failed", "interrupted"
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
            out, err = process.communicate(timeout=self.timeout_s)
            _judge(item, process.returncode, out, err)
        except subprocess.TimeoutExpired:
            _end(process)
            process.communicate()
            item.status = "timed out"
            item.message = f"not finished within {self.timeout_s:g} s"
        finally:
            with self._lock:
                self._running.discard(process)
            item.seconds = time.perf_counter() - began

    def stop(self) -> None:
        """End all workers."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                _end(process)


def _end(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _judge(item: BatchItem, code: int, out: str, err: str) -> None:
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
        except (ValueError, KeyError, TypeError):
            item.status = "failed"
        else:
            if code == 1:
                item.status = "requirement failed"
    if item.status == "ok":
        return
    if code < 0:
        item.message = f"the process was ended by {signal.Signals(-code).name}"
    elif code == 2:
        # The message may go on below its first line, as that of a scene file does.
        start = max((k for k, s in enumerate(said) if s.startswith("patchlight: ")), default=0)
        item.message = "; ".join(said[start:]).removeprefix("patchlight: ")
    elif item.status == "requirement failed":
        item.message = "a requirement failed"
    else:
        item.message = said[-1] if said else f"exit code {code}"


def _identity(path: Path) -> dict[str, Any]:
    """What the result of a file depends on besides the settings."""
    from .doctoring import version

    try:
        found: dict[str, Any] = {"sha256": file_hash(path), "version": version("patchlight")}
        if path.suffix.lower() == ".toml":
            from .scene_file import read_scene_file

            models = read_scene_file(path).model
            found["models"] = [file_hash(path.parent / table.file) for table in models]
        return found
    except (OSError, PatchlightError):
        return {"sha256": None}  # the worker will say what is wrong


def _kept(item: BatchItem, key: dict[str, Any]) -> bool:
    """Take over the record of an earlier batch if it is of the same file and settings."""
    try:
        record = json.loads((Path(item.output) / RECORD).read_text(encoding="utf-8"))
        if record["key"] != key or record["item"]["status"] != "ok":
            return False
        for name in ("status", "exit_code", "seconds", "faces", "patches", "metrics"):
            setattr(item, name, record["item"][name])
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return (Path(item.output) / "run.json").is_file()


def _remember(item: BatchItem, key: dict[str, Any]) -> None:
    folder = Path(item.output)
    if not folder.is_dir():
        return
    temporary = folder / f".{RECORD}.part"
    with contextlib.suppress(OSError):  # a full disk fails the file's own report already
        temporary.write_text(json.dumps({"key": key, "item": asdict(item)}), encoding="utf-8")
        temporary.replace(folder / RECORD)


def _write_summary(items: list[BatchItem], out: Path) -> None:
    from patchlight.reports import write_batch_summary

    rows = []
    for item in items:
        report = Path(item.output) / "report.html"
        rows.append(
            {
                "file": item.path,
                "status": item.status,
                "reason": item.message,
                "seconds": item.seconds,
                "faces": item.faces,
                "patches": item.patches,
                "report": f"{item.name}/{report.name}" if report.is_file() else None,
                "metrics": item.metrics,
            }
        )
    write_batch_summary(rows, out)
