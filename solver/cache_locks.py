"""Locks between the processes that share a folder of compiled kernels.

Each lock is one byte of a single file. The operating system frees it when the process that holds it
ends, however that ends, so no stale lock stays behind.
"""

from __future__ import annotations

import functools
import hashlib
import os
from pathlib import Path

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]


class CacheLocks:
    """Locks of one folder, each known by a name.

    They hold between processes, not between threads of one. There is one object a folder, which
    `locks_of` gives: with the first file that is closed, a process loses its locks on it.

    Parameters
    ----------
    folder : Path
        Where their file is made; OSError where that, or locking it, is impossible.
    """

    def __init__(self, folder: Path) -> None:
        if fcntl is None:
            raise OSError("no locks on files here")
        folder.mkdir(parents=True, exist_ok=True)
        self._file = os.open(folder / "locks", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            self.take("probe")
            self.free("probe")
        except OSError:  # some network file systems know no locks
            os.close(self._file)
            raise

    def take(self, name: str) -> bool:
        """Hold a lock, also if this process held it before; False while another process does."""
        try:
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _byte(name))
        except (BlockingIOError, PermissionError):  # POSIX leaves open which of both it is
            return False
        return True

    def free(self, name: str) -> None:
        """Let others have a lock."""
        fcntl.lockf(self._file, fcntl.LOCK_UN, 1, _byte(name))


@functools.cache
def locks_of(folder: Path) -> CacheLocks | None:
    """The locks of a folder; None where it cannot have any, as a folder that cannot be written."""
    try:
        return CacheLocks(folder)
    except OSError:
        return None


def _byte(name: str) -> int:
    """Place of a lock in the file, which stays empty: a system allows 2⁶³ bytes and more."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:7], "big")
