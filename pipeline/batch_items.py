"""One file of a batch: what became of it, and its record for a batch that goes on later."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from patchlight.solver.errors import PatchlightError

from .output import file_hash

#: Kept in each finished subfolder, so that a batch that was cut short goes on where it stood.
RECORD = "batch-item.json"
#: What of it is taken over.
KEPT = (
    "status", "exit_code", "seconds", "faces", "patches", "metrics", "errors", "accuracy_reached",
    "warnings",
)  # fmt: skip
#: Statuses of files that have a report of this batch.
REPORTED = ("ok", "requirement failed", "not converged")


@dataclass(slots=True)
class BatchItem:
    """What became of one file.

    Attributes
    ----------
    name : str
        Name of its subfolder.
    path, output : str
        Input file and output folder.
    status : str
        "ok", "requirement failed", "not converged", "failed", "timed out", "interrupted" or
        "waiting".
    exit_code : int or None
        Of its process; negative for a signal.
    seconds : float
        Wall-clock time.
    message : str
        One line why it failed; empty otherwise.
    faces, patches : int or None
        Size of the model.
    metrics, errors : dict of dict
        Values by grid and metric, and what each may be off by where that is stated.
    accuracy_reached : float or None
        Relative error stated of 95 % of the sensors, that of the worst grid.
    warnings : list of str
        Of the run.
    """

    name: str
    path: str
    output: str
    status: str = "waiting"
    exit_code: int | None = None
    seconds: float = 0.0
    message: str = ""
    faces: int | None = None
    patches: int | None = None
    metrics: dict[str, dict[str, float]] = field(default_factory=dict)
    errors: dict[str, dict[str, float]] = field(default_factory=dict)
    accuracy_reached: float | None = None
    warnings: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether the file has a report that can be relied on."""
        return self.status == "ok"

    @property
    def report(self) -> str | None:
        """Its report relative to the batch's folder; None when this batch made none."""
        if self.status not in REPORTED:
            return None  # one that lies there is of an earlier run
        with contextlib.suppress(OSError):
            if (Path(self.output) / "report.html").is_file():
                return f"{self.name}/report.html"
        return None

    def fail(self, message: str) -> None:
        """Write down that there will be no report, and why."""
        self.status, self.message = "failed", message

    def interrupt(self) -> None:
        """Write down that the batch was ended before this file was done."""
        self.status, self.message = "interrupted", "the batch was ended before this file was done"


def identity(path: Path, *, first_model: int = 0) -> dict[str, Any]:
    """What the result of a file depends on besides the settings; a scene file with its files."""
    from .doctoring import version

    try:
        found: dict[str, Any] = {"sha256": file_hash(path), "version": version("patchlight")}
        if path.suffix.lower() == ".toml":
            from .scene_file import photometry_files, read_scene_file

            file = read_scene_file(path)
            models = file.model[first_model:]
            found["models"] = [file_hash(path.parent / table.file) for table in models]
            webs = photometry_files(file, path.parent)
            if webs:
                found["photometry"] = [file_hash(web) for web in webs]
        return found
    except (OSError, PatchlightError):
        return {"sha256": None}  # the worker will say what is wrong


def recall(item: BatchItem, key: dict[str, Any]) -> bool:
    """Take over the record of an earlier batch if it is of the same file and settings."""
    try:
        record = json.loads((Path(item.output) / RECORD).read_text(encoding="utf-8"))
        if record["key"] != key or record["item"]["status"] != "ok":
            return False
        if not (Path(item.output) / "run.json").is_file():
            return False
        kept = {name: record["item"][name] for name in KEPT}
    except (OSError, ValueError, KeyError, TypeError):
        return False
    for name, value in kept.items():
        setattr(item, name, value)
    return True


def remember(item: BatchItem, key: dict[str, Any]) -> None:
    """Keep the outcome beside its report; without a place for it the file is done again later."""
    folder = Path(item.output)
    temporary = folder / f".{RECORD}.part"
    with contextlib.suppress(OSError):
        if folder.is_dir():
            temporary.write_text(json.dumps({"key": key, "item": asdict(item)}), encoding="utf-8")
            temporary.replace(folder / RECORD)
