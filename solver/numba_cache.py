"""Where compiled kernels are kept: keyed by all kernel sources, in a folder that can be written.

Numba drops a cached kernel only when the kernel's own file changes, so an edited helper in another
file, or an upgrade, would run old machine code. One folder per hash of all sources cures both.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from pathlib import Path

KERNELS = Path(__file__).parent / "kernels"
#: Versions of Numba, (major, minor), that `kernels.parts` and `kernels.shared_cache` were tested
#: with. Both build on its inner classes. One is added when all tests of the solver pass with it.
TESTED_VERSIONS = ((0, 68),)


def source_key() -> str:
    """Hash of all kernel sources."""
    digest = hashlib.sha256()
    for path in sorted(KERNELS.rglob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def use_cache_folder() -> tuple[Path, bool]:
    """Point Numba's disk cache to a folder of this version of the kernels.

    Importing a kernel calls it. A folder that the user has given, in NUMBA_CACHE_DIR or to Numba
    itself, is kept.

    Returns
    -------
    folder : Path
        The folder.
    warm : bool
        Whether kernels compiled earlier are in it, or none are ever compiled (`is_compiling_off`);
        otherwise compiling comes first.
    """
    numba = sys.modules.get("numba")  # imported before: it has read the environment already
    given = os.environ.get("NUMBA_CACHE_DIR") or (numba.config.CACHE_DIR if numba else "")
    folder = Path(given) if given else _first_writable(f"numba-{source_key()}")
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if numba is not None:
        numba.config.CACHE_DIR = str(folder)
    filled = folder.is_dir() and next(folder.rglob("*.nbi"), None) is not None
    return folder, filled or is_compiling_off()


def is_compiling_off() -> bool:
    """Whether kernels run as plain Python: NUMBA_DISABLE_JIT is set, to another number than 0."""
    numba = sys.modules.get("numba")  # imported before: it has read the environment already
    if numba is not None:
        return bool(numba.config.DISABLE_JIT)
    try:
        return int(os.environ.get("NUMBA_DISABLE_JIT", "0")) != 0
    except ValueError:  # Numba warns of it, and compiles
        return False


def _first_writable(name: str) -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache"
    user = Path(base) / "patchlight"
    for parent in (KERNELS / "__pycache__", user, Path(tempfile.gettempdir()) / "patchlight"):
        folder = parent / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="patchlight-numba-"))
