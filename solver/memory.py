"""Whether the matrices of a run fit into the memory that is free, and in which form."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .control_groups import control_groups, read_text
from .errors import InputError, OutOfMemoryError

#: Bytes that a pair of receiver and element takes at the worst moment, while rows are corrected:
#: factors (4) and variances (4), a quarter of both once more for rows that are found anew (2), and
#: what is in between for some rows at a time (less than 1 with 2500 elements, measured).
PAIR_BYTES = 11
#: Bytes that a pair takes besides in scenes with mirrors, for what they show and its variance, and
#: in scenes with panes, whose rows are put together anew.
MIRROR_BYTES, PANE_BYTES = 8, 8
#: Bytes of a pair once it is known: factors, and the variances of sampled ones.
ROW_BYTES = 8
#: The same where factors are of double precision.
DOUBLE_BYTES = 12
#: Bytes of a pair of the matrix that stays while the sensors are done.
KEPT_BYTES = 4
#: Unknowns up to which factors are kept in single precision; above, or where memory does not hold
#: them so, they are packed.
DENSE_UNKNOWNS = 16_000
#: The same of light that varies over elements: four a whole element.
VARYING_UNKNOWNS = 24_000
#: Bytes of a packed pair at most, and of the rows that are found at a time before they are packed:
#: arrays of up to 32 MB each are made in the same memory again and again, while fresh memory costs
#: more time than to fill it.
PACKED_BYTES, BLOCK_BYTES = 2, 80_000_000
#: Bytes that each unknown takes while the packed system is solved: directions of GMRES, geometry.
UNKNOWN_BYTES = 10_000
#: Pairs below which nothing is asked: looking costs as much as some form factors.
SMALL_MATRIX = 1_000_000
GB = 1e9
#: Limits that callers have set for the whole process by `limited`, one in another: the least holds.
#: [B]
_LIMITS: list[int] = []
#: Limit, use and what of it only caches files, of a control group of each version.
_GROUP_FILES = {
    2: ("memory.max", "memory.current", "inactive_file"),
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}


def varying_bytes(basis: str, more: int = 0) -> int:
    """Bytes that a pair of elements takes at the worst moment where light varies over elements.

    Rows from q nodes (8 q), the factors of their q² pairs (4 q²), and some of the rows anew (2 q);
    in scenes where a pair of receiver and element takes ``more``, that from each node.
    """
    q = 9 if basis == "biquadratic" else 4
    return (10 + more) * q + 4 * q**2


def more_bytes(*, mirrors: bool, panes: bool) -> int:
    """What a pair of receiver and element takes besides in some scenes. [B]"""
    return (MIRROR_BYTES if mirrors else 0) + (PANE_BYTES if panes else 0)


def needed_bytes(elements: int, largest_grid: int = 0, more: int = 0) -> int:
    """Memory that a mesh takes at the worst moment, packed matrices apart. [B]

    Parameters
    ----------
    elements : int
        Elements of the mesh, all of which see one another.
    largest_grid : int
        Sensors of the largest grid; they are done after the elements, while the matrix stays.
    more : int
        Bytes of a pair besides, by `more_bytes`.
    """
    pair = PAIR_BYTES + more
    sensors = pair * elements * largest_grid
    if elements > DENSE_UNKNOWNS and not more:
        return BLOCK_BYTES + UNKNOWN_BYTES * elements + sensors
    return max(pair * elements**2, sensors + KEPT_BYTES * elements**2)


def is_packed(unknowns: int, elements: int) -> bool:
    """Whether factors are packed: there are many, or memory does not hold them else."""
    varying = unknowns > elements
    if unknowns > (VARYING_UNKNOWNS if varying else DENSE_UNKNOWNS):
        return True
    need = PAIR_BYTES * unknowns * elements + (KEPT_BYTES * unknowns**2 if varying else 0)
    return not has_room(need)


def packed_room(columns: int) -> int | None:
    """Memory that packed factors may take, what else is needed left free. [B]"""
    free = available_bytes()
    return None if free is None else max(0, free - BLOCK_BYTES - UNKNOWN_BYTES * columns)


def check_memory(
    elements: int,
    largest_grid: int = 0,
    *,
    least_elements: int = 0,
    accuracy: float | None = None,
    more: int = 0,
) -> None:
    """Raise `OutOfMemoryError` where a mesh cannot fit, neither whole nor packed.

    Parameters
    ----------
    elements, largest_grid : int
        As in `needed_bytes`.
    least_elements : int
        Elements that the scene has at any accuracy, one a patch and side.
    accuracy : float, optional
        What the mesh follows from, for the advice.
    more : int
        As in `needed_bytes`; what has mirrors or panes is not packed.
    """
    need = needed_bytes(elements, largest_grid, more)
    if need < PAIR_BYTES * SMALL_MATRIX:
        return
    free = available_bytes()
    if free is None or (need <= free and (more or elements <= DENSE_UNKNOWNS)):
        return
    sensors = (PAIR_BYTES + more) * elements * largest_grid
    rest, packed = BLOCK_BYTES + UNKNOWN_BYTES * elements + sensors, PACKED_BYTES * elements**2
    on_disk = free_on_disk()
    if more:  # nothing is packed
        rest, packed, on_disk = need, 0, 0
    if rest <= free and packed <= free - rest + on_disk:
        return
    advice = []
    if rest - sensors <= free and packed <= free - rest + sensors + on_disk:
        advice.append(f"use fewer sensors than {largest_grid} in a grid")
    if accuracy is not None and least_elements < elements:
        advice.append(f"ask for less accuracy, a larger number than {accuracy:g}")
    if least_elements:
        advice.append("leave out parts that do not matter for the light, to have fewer patches")
    how, what = "" if more else ", packed", "; or ".join(advice) or "use fewer elements"
    raise OutOfMemoryError(
        f"{elements} elements need {(rest + packed) / GB:.1f} GB of memory for their form "
        f"factors{how}, but only {free / GB:.1f} GB are free, and {on_disk / GB:.1f} GB for "
        f"temporary files in {tempfile.gettempdir()}; {what}"
    )


def free_on_disk() -> int:
    """Room for temporary files, with a tenth left. [B]"""
    return int(0.9 * shutil.disk_usage(tempfile.gettempdir()).free)


def check_matrix(rows: int, columns: int, *, pair_bytes: int = DOUBLE_BYTES) -> None:
    """Raise `OutOfMemoryError` where form factors of ``rows`` by ``columns`` cannot fit."""
    if rows * columns < SMALL_MATRIX:
        return
    free, need = available_bytes(), pair_bytes * rows * columns
    if free is not None and need > free:
        raise OutOfMemoryError(
            f"{rows} x {columns} form factors need {need / GB:.1f} GB of memory, but only "
            f"{free / GB:.1f} GB are free; ask for fewer points or elements at a time"
        )


def check_bytes(need: int, what: str) -> None:
    """Raise `OutOfMemoryError` where ``what`` cannot have the memory that it needs. [B]"""
    free = available_bytes()
    if free is not None and need > free:
        raise OutOfMemoryError(
            f"{what} needs {need / GB:.1f} GB of memory, but only {free / GB:.1f} GB are free"
        )


def has_room(need: int) -> bool:
    """Whether so much memory is free; what is small is taken to be. [B]"""
    if need < PAIR_BYTES * SMALL_MATRIX:
        return True
    free = available_bytes()
    return free is None or need <= free


def fits(elements: int, largest_grid: int = 0, more: int = 0) -> bool:
    """Whether a mesh can be made; see `needed_bytes`."""
    return has_room(needed_bytes(elements, largest_grid, more))


def available_bytes(root: Path = Path("/")) -> int | None:
    """Memory that can still be had [B]; None when the system does not tell.

    The least of what the machine has free, what the control groups of the process, if any, still
    allow, and what all limits by `limited` leave; memory that only caches files counts as free.
    """
    limits = [free for free in (_machine(root), *_groups(root)) if free is not None]
    limits += [most - used_bytes(root) for most in _LIMITS]
    return max(0, min(limits)) if limits else None


def check_limit(memory_gb: float | None) -> None:
    """Raise `InputError` for a limit of memory that is given and no positive number. [GB]"""
    number = isinstance(memory_gb, (int, float)) and not isinstance(memory_gb, bool)
    if memory_gb is not None and not (number and 0.0 < memory_gb < math.inf):
        raise InputError(f"memory_gb = {memory_gb!r}: must be above 0 and finite")


@contextmanager
def limited(memory_gb: float | None) -> Iterator[None]:
    """Take no more memory than this for the process meanwhile; what is free when None. [GB]

    All that asks how much there is, is told so: matrices are packed, less is kept for later runs,
    and what does not fit is refused.

    Raises
    ------
    InputError
        If it is no positive number.
    """
    check_limit(memory_gb)
    if memory_gb is None:
        yield
        return
    _LIMITS.append(int(memory_gb * GB))
    try:
        yield
    finally:
        _LIMITS.pop()


def used_bytes(root: Path = Path("/")) -> int:
    """Memory that the process has now, 0 where the system does not tell. [B]"""
    words = read_text(root / "proc/self/statm").split()
    return int(words[1]) * os.sysconf("SC_PAGE_SIZE") if len(words) > 1 else 0


def _machine(root: Path) -> int | None:
    for line in read_text(root / "proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # neither is there on every system
        return None


def _groups(root: Path) -> Iterator[int | None]:
    """What each control group over the process still allows."""
    for version, folder in control_groups(root, "memory"):
        limit_name, used_name, cached_name = _GROUP_FILES[version]
        limit, used = (read_text(folder / name).strip() for name in (limit_name, used_name))
        if not (limit.isdigit() and used.isdigit()):  # "max" or no such group
            continue
        text = read_text(folder / "memory.stat")
        stat = dict(line.split(" ", 1) for line in text.splitlines())
        yield int(limit) - int(used) + int(stat.get(cached_name, 0))
