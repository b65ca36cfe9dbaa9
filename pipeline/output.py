"""The output folder: checked before the long computation, never mixed with another run's."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterable
from pathlib import Path

from patchlight.solver.errors import OutputError


def prepare_output(
    folder: Path, inputs: Iterable[Path], *, force: bool = False, own: tuple[str, ...] = ()
) -> None:
    """Create ``folder`` and try to write into it.

    Parameters
    ----------
    inputs : paths
        Models of the run. A folder that holds a run of other files, or files that no run wrote, is
        refused unless ``force``; the same files may have changed since.
    own : tuple of str
        Names in the folder that belong to this run.

    Raises
    ------
    OutputError
        If the folder cannot be created or written, or is refused.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".patchlight-"):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from None
    if force:
        return
    found = [p.name for p in folder.iterdir() if not p.name.startswith(".") and p.name not in own]
    if not found:
        return
    before = _inputs_of(folder)
    if before is None:
        raise OutputError(
            f"{folder}: holds files that are no run ({found[0]}); choose another folder or --force"
        )
    now = {p.resolve() for p in inputs}
    if {Path(name).resolve() for name in before} == now:
        return
    if set(before.values()) == {file_hash(p) for p in now if p.is_file()}:
        return
    names = ", ".join(sorted(Path(name).name for name in before)) or "none"
    raise OutputError(
        f"{folder}: holds a run of other inputs ({names}); choose another folder or --force"
    )


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _inputs_of(folder: Path) -> dict[str, str] | None:
    """Hashes of the inputs of the run in ``folder``; None when there is no run."""
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        return {str(item["path"]): str(item["sha256"]) for item in record["inputs"]}
    except (OSError, ValueError, KeyError, TypeError):
        return None
