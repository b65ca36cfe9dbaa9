"""How many cores the process may use, and how it waits on them."""

from __future__ import annotations

import os
from pathlib import Path

from .control_groups import control_groups, read_text


def usable_cores(root: Path = Path("/")) -> int:
    """Cores that the process may run on, at least 1.

    The least of those the system lets it run on and of the time that its control groups, if any,
    allow, in whole cores.
    """
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    for version, folder in control_groups(root, "cpu"):
        if version == 2:
            words = read_text(folder / "cpu.max").split()
        else:
            names = ("cpu.cfs_quota_us", "cpu.cfs_period_us")
            words = [read_text(folder / name).strip() for name in names]
        if len(words) == 2 and all(word.isdigit() for word in words):  # not "max", and not "-1"
            cores = min(cores, int(words[0]) // max(1, int(words[1])))
    return max(1, cores)


def let_threads_sleep() -> None:
    """Let threads of OpenMP sleep where they wait for others, unless the user has it otherwise.

    They would turn round and round for milliseconds after each parallel kernel, which takes cores
    from other processes: two runs beside each other took twice the time. To be called before the
    first parallel kernel runs.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
