"""What the control groups of the process allow it, as those of a container do; versions 2 and 1."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path


def control_groups(root: Path, controller: str) -> Iterator[tuple[int, Path]]:
    """Version and folder of each group over the process, its own first.

    Parameters
    ----------
    root : Path
        Root of the file system.
    controller : str
        ``"memory"`` or ``"cpu"``.
    """
    for line in read_text(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        if not controllers:
            version, mount = 2, root / "sys/fs/cgroup"
        elif controller in controllers.split(","):
            version, mount = 1, root / "sys/fs/cgroup" / controller
        else:
            continue
        # In a container the group at the path may not be there, but the last of those above is.
        steps = [step for step in path.split("/") if step and step != ".."]
        for depth in range(len(steps), -1, -1):
            yield version, mount.joinpath(*steps[:depth])


def read_text(path: Path) -> str:
    """A file of the system; empty where there is none."""
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
