"""Output files: written beside their place, then renamed, so that no half-written file is seen."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path

from patchlight.solver.errors import OutputError

#: Longest file name stem; leaves room for suffixes within the 255 bytes of common file systems.
MAX_STEM = 80
_UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe"}
)
_RESERVED = {"con", "prn", "aux", "nul", *(f"com{i}" for i in range(1, 10))}


def safe_name(name: str) -> str:
    """File name stem of ``name``: ASCII letters, digits, ``.``, ``_`` and ``-`` only.

    Umlauts are spelled out, other accents dropped, everything else becomes ``_``; leading dots go,
    so that no name leaves its folder or hides. A name without any usable character gets its hash.
    """
    text = unicodedata.normalize("NFC", name).translate(_UMLAUTS)
    text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9._-]+", "_", text)
    text = re.sub(r"\.{2,}", ".", text).strip("._-")
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    if not text:
        return digest
    if text.lower() in _RESERVED:
        text = f"{text}_"
    return text if len(text) <= MAX_STEM else f"{text[: MAX_STEM - 9]}_{digest}"


def safe_names(
    names: Iterable[str], *, endings: Iterable[str] = ("",), reserved: Iterable[str] = ()
) -> dict[str, str]:
    """`safe_name` of each name, made unique without regard to case by ``-2``, ``-3``, …

    With several ``endings`` a file of each is written for every name, and none of them may be that
    of another name or ``reserved``.
    """
    endings = tuple(endings)
    taken: set[str] = {name.lower() for name in reserved}
    stems: dict[str, str] = {}
    for name in names:
        stem = base = safe_name(name)
        count = 1
        while any((stem + ending).lower() in taken for ending in endings):
            count += 1
            stem = f"{base}-{count}"
        taken.update((stem + ending).lower() for ending in endings)
        stems[name] = stem
    return stems


def make_folder(folder: str | Path) -> Path:
    """Create ``folder`` with its parents; `OutputError` when that is not possible."""
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"output folder {path}: {error.strerror or error}") from error
    return path


def write_atomic(path: Path, write: Callable[[Path], None]) -> Path:
    """Call ``write`` with a temporary path in the folder of ``path``, then rename it.

    A run killed in between leaves the old file or none, never half a file.

    Raises
    ------
    OutputError
        If the file cannot be written (permissions, full disk, a folder of that name).
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    try:
        make_folder(path.parent)
        write(temporary)
        os.replace(temporary, path)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True) if _exists(temporary) else None
    return path


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False


def write_text(path: Path, text: str) -> Path:
    """Write UTF-8 text atomically."""
    return write_atomic(path, lambda p: _write_bytes(p, text.encode("utf-8")))


def write_bytes(path: Path, data: bytes) -> Path:
    """Write bytes atomically."""
    return write_atomic(path, lambda p: _write_bytes(p, data))


def _write_bytes(path: Path, data: bytes) -> None:
    with open(path, "wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())  # a full disk shows here, before the old file is replaced
