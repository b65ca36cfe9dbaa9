"""Many files, each in a process of its own: nothing is lost when one of them fails."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from patchlight.solver.cores import usable_cores
from patchlight.solver.errors import InputError, MissingFileError, PatchlightWarning
from patchlight.solver.numba_cache import use_cache_folder

from .batch_items import BatchItem, identity, recall, remember
from .output import prepare_output
from .runs import STEP_SUFFIXES
from .workers import Workers, termination_interrupts


@dataclass(slots=True)
class BatchDone:
    """A finished batch.

    Attributes
    ----------
    items : list of BatchItem
        In the order of the files.
    summary_problem : str
        Why the summary on the disk is not the last one; empty otherwise.
    """

    items: list[BatchItem]
    summary_problem: str = ""


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
    done = run_batch(
        [Path(p) for p in paths],
        Path(out),
        jobs=jobs,
        scene=None if scene is None else Path(scene),
        timeout_s=timeout_s,
    )
    if done.summary_problem:
        warnings.warn(done.summary_problem, PatchlightWarning, stacklevel=2)
    return done.items


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
    cache: bool = True,
    say: Callable[[str], None] = lambda text: None,
) -> BatchDone:
    """`batch` with the options of the command line; ``say`` gets a line a finished file.

    An interrupt leaves a summary in which the files that were not done say so.
    """
    files = batch_files(paths)
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}: must be at least 1")
    if not timeout_s > 0.0:
        raise InputError(f"timeout = {timeout_s}: must be positive")
    if scene is not None and not scene.is_file():
        raise MissingFileError(f"{scene}: no such file")
    prepare_output(out, (), force=True)
    cores = usable_cores()
    workers = min(jobs or cores, len(files))
    threads = max(1, cores // workers)
    options = ["--threads", str(threads), "--force", "--json"]
    settings: dict[str, Any] = {"accuracy": accuracy, "check": check}
    if accuracy is not None:
        options += ["--accuracy", repr(accuracy)]
    if check:
        options.append("--check")
    if not cache:
        options.append("--no-cache")
    if scene is not None:
        settings["scene"] = identity(scene, first_model=1)  # each file takes the first one's place
    items = [BatchItem(name, str(path), str(out / name)) for name, path in _names(files).items()]
    alive = Workers(timeout_s)

    def work(item: BatchItem) -> BatchItem:
        try:
            path = Path(item.path)
            key = {**settings, **identity(path)}
            if not force and recall(item, key):
                return item
            template = [] if scene is None or path.suffix.lower() == ".toml" else ["--scene", scene]
            command = [sys.executable, "-m", "patchlight.pipeline.cli", "run", path]
            alive.run(item, [str(c) for c in (*command, "-o", item.output, *options, *template)])
            remember(item, key)
        except Exception as error:  # whatever happens to one file must not end the others
            if item.status == "waiting":
                item.fail(_one_line(error))
        return item

    with termination_interrupts():
        return BatchDone(items, _run_all(items, work, workers, alive, out, say))


def _run_all(
    items: list[BatchItem],
    work: Callable[[BatchItem], BatchItem],
    workers: int,
    alive: Workers,
    out: Path,
    say: Callable[[str], None],
) -> str:
    """Do all items and keep the summary up to date; why its last state is not there, if so."""
    problem = ""
    pool = ThreadPoolExecutor(workers)
    try:
        futures = []
        for item in items:
            futures.append(pool.submit(work, item))
            if not use_cache_folder()[1]:
                # Else all would hold their models in memory while they wait for the same kernels.
                wait(futures)
        for future in as_completed(futures):
            item = future.result()
            text = f": {item.message}" if item.message else ""
            say(f"{item.path}: {item.status} ({item.seconds:.0f} s){text}")
            problem = _write_summary(items, out)
    except BaseException:
        alive.stop()
        try:
            pool.shutdown(wait=True, cancel_futures=True)
        finally:
            for item in items:
                if item.status == "waiting":
                    item.interrupt()
            _write_summary(items, out)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return problem


def _one_line(error: Exception) -> str:
    """What went wrong beside the computation itself, such as starting its process."""
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return f"could not be run ({place}{error.strerror})"
    return f"could not be run ({type(error).__name__}: {' '.join(str(error).split())})"


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


def _write_summary(items: list[BatchItem], out: Path) -> str:
    """Write the summary of all items; why that could not be done, or an empty text."""
    from patchlight.reports import write_batch_summary

    rows = [
        {
            "file": item.path,
            "status": item.status,
            "reason": item.message,
            "seconds": item.seconds,
            "faces": item.faces,
            "patches": item.patches,
            "report": item.report,
            "metrics": item.metrics,
            "errors": item.errors,
            "accuracy_reached": item.accuracy_reached,
            "warnings": item.warnings,
        }
        for item in items
    ]
    try:
        write_batch_summary(rows, out)
    except OSError as error:  # a full disk: the files that still run may yet say what they found
        return f"the summary is not complete: {error}"
    return ""
