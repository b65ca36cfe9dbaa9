"""What a fresh install costs: the demo with no compiled kernels, then with them.

    python tests/benchmarks/first_run.py [--demo office] [--limit 900]

runs ``patchlight demo`` twice in processes of its own, with an empty folder for compiled kernels
and then with what the first run left in it, and prints CPU and elapsed seconds of both. Their
difference is the time of compiling. CPU seconds are those of all processes and threads.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple


class Spent(NamedTuple):
    """Seconds of one run."""

    cpu_s: float
    elapsed_s: float


def run(command: list[str], cache: Path, limit: float) -> Spent:
    """Run a command to its end with compiled kernels in ``cache``; raises if it fails."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "OMP_WAIT_POLICY": "passive"}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=environment, check=True, timeout=limit, stdout=sys.stderr)
    after, end = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(cpu, end - start)


def first_and_second(command: list[str], folder: Path, limit: float) -> tuple[Spent, Spent]:
    """The same command with an empty cache, and again; ``{}`` in it is an empty folder."""
    spent = []
    for name in ("first", "second"):
        out = folder / name
        filled = [word.replace("{}", str(out)) for word in command]
        spent.append(run(filled, folder / "kernels", limit))
    return spent[0], spent[1]


def main(arguments: list[str] | None = None) -> int:
    """Print what both runs take."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--demo", default="office", help="which demo, default %(default)s")
    parser.add_argument("--limit", type=float, default=900.0, help="elapsed seconds of one run")
    options = parser.parse_args(arguments)
    command = [sys.executable, "-m", "patchlight.pipeline.cli", "demo", options.demo, "-o", "{}"]
    with tempfile.TemporaryDirectory() as folder:
        first, second = first_and_second(command, Path(folder), options.limit)
    print(f"{'':10s} {'CPU s':>8s} {'elapsed s':>10s}")
    for name, one in (("fresh", first), ("warm", second)):
        print(f"{name:10s} {one.cpu_s:8.1f} {one.elapsed_s:10.1f}")
    compiling = Spent(first.cpu_s - second.cpu_s, first.elapsed_s - second.elapsed_s)
    print(f"{'compiling':10s} {compiling.cpu_s:8.1f} {compiling.elapsed_s:10.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
