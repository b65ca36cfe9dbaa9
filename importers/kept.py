"""Conversions kept on disk under a hash of all that they are made of.

Entries are found by the content of the file or shape, the options, and the sources of the
converter, so that an old one is never taken for a new one; one that cannot be read is dropped and
made again. A cache that cannot be written costs time and nothing else.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import platformdirs
from patchlight.solver import model as model_package
from patchlight.solver.model import Model

from . import stored
from .stored import DAMAGED, Contents

#: Bytes that all entries may take together; those not asked for longest go first.
LIMIT = 1_000_000_000
#: Names the folder instead of the user's cache folder.
VARIABLE = "PATCHLIGHT_CACHE_DIR"
#: Names of entries, and of what is being written or was left when a process was killed.
_OWN = re.compile(r"[0-9a-f]{64}(\.npz|.*\.part)")
#: Writing an entry takes less. [s]
_WRITING_S = 3600.0


def folder() -> Path:
    """Where entries lie; it need not exist."""
    given = os.environ.get(VARIABLE)
    base = Path(given) if given else platformdirs.user_cache_path("patchlight", appauthor=False)
    return base / "models"


@functools.cache
def converter() -> str:
    """Hash of the sources that turn a shape into patches, and the version of the CAD kernel."""
    digest = hashlib.sha256()
    for home in (Path(__file__).parent, Path(str(model_package.__file__)).parent):
        for path in sorted(home.glob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    for name in ("cadquery-ocp", "numpy"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            digest.update(f"{name} {metadata.version(name)}".encode())
    return digest.hexdigest()


def key(content: bytes, options: dict[str, Any]) -> str:
    """Key of a content (of a file or shape) converted with ``options``."""
    digest = hashlib.sha256(converter().encode())
    digest.update(json.dumps(options, sort_keys=True).encode() + b"\0")
    digest.update(content)
    return digest.hexdigest()


def get(name: str) -> Contents | None:
    """The entry of a key; None where there is none, or none that can be read."""
    path = folder() / f"{name}.npz"
    try:
        found = stored.read(path)
    except (FileNotFoundError, PermissionError, MemoryError):
        return None  # out of reach now, which says nothing of the entry
    except DAMAGED:
        drop(name)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # what was asked for last is given up last
    return found


def model(name: str, source: str) -> Model | None:
    """The model of a key, as read from ``source``; its certificate tells where it comes from."""
    found = get(name)
    if found is None:
        return None
    head, arrays = found
    try:
        note = f"taken from the cache: {head['seconds']:.3g} s to read and convert at first"
        head = {**head, "source": source, "notes": [*head["notes"], note]}
        return stored.to_model((head, arrays))
    except DAMAGED:
        drop(name)
        return None


def put(name: str, contents: Contents) -> None:
    """Keep an entry where the folder can be written; give up the oldest ones for it."""
    with contextlib.suppress(OSError):
        home = folder()
        home.mkdir(parents=True, exist_ok=True)
        stored.write(home / f"{name}.npz", *contents)
        _prune(home)


def drop(name: str) -> None:
    """Forget the entry of a key."""
    with contextlib.suppress(OSError):
        (folder() / f"{name}.npz").unlink(missing_ok=True)


def _prune(home: Path) -> None:
    entries = []
    for path in home.iterdir():
        if not _OWN.fullmatch(path.name):
            continue  # the folder may be one that the user named, with files of his own
        with contextlib.suppress(OSError):  # another process may drop it meanwhile
            status = path.stat()
            if path.suffix == ".part" and time.time() - status.st_mtime < _WRITING_S:
                continue
            entries.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries):
        if total <= LIMIT:
            return
        with contextlib.suppress(OSError):
            path.unlink()
            total -= size
