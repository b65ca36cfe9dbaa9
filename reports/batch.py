"""Summary of a batch: one row a file, links to the reports, failures in sight."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from . import formats
from .files import make_folder, write_text
from .metrics import QUANTITIES
from .report import environment
from .run_files import SCHEMA_VERSION, csv_text, tool_version

#: Statuses of an item that needs no second look.
GOOD = ("ok", "done", "cached")
#: Ending of the columns of stated errors.
ERROR = "_error"
_COLUMNS = ("file", "status", "reason", "seconds", "faces", "patches", "report")


def write_batch_summary(items: Iterable[Mapping[str, Any]], folder: str | Path) -> dict[str, Path]:
    """Write ``summary.csv`` and ``summary.html`` into ``folder``.

    Parameters
    ----------
    items : iterable of mappings
        ``file``, ``status``, ``reason``, ``seconds``, ``report`` (path relative to ``folder``, or
        None), ``faces``, ``patches``, ``accuracy_reached``, ``warnings`` (texts), ``metrics``
        (numbers by name; a number, or a mapping of numbers by grid) and ``errors``, what these may
        be off by. Keys that are missing are shown as empty.
    folder : path
        Made when missing.

    Returns
    -------
    dict of Path
        The two files by name.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    out = make_folder(folder)
    rows = [_row(item) for item in items]
    twice = {n for n, count in Counter(Path(r["file"]).name for r in rows).items() if count > 1}
    names = list(dict.fromkeys(name for row in rows for name in row["metrics"]))
    table = [
        [
            SCHEMA_VERSION,
            *(_cell(row[c]) for c in _COLUMNS),
            _cell(row["accuracy_reached"]),
            " | ".join(row["warnings"]),
            *(_cell(row[kind].get(n)) for n in names for kind in ("metrics", "errors")),
        ]
        for row in rows
    ]
    html = (
        environment()
        .get_template("batch.html")
        .render(
            rows=[_shown(row, names, twice) for row in rows],
            names=[_heading(name) for name in names],
            with_report=sum(row["kind"] != "fail" for row in rows),
            bad=[row for row in rows if row["kind"] == "fail"],
            unsure=[row for row in rows if row["kind"] == "open"],
            total=len(rows),
            seconds=sum(row["seconds"] or 0.0 for row in rows),
            version=tool_version(),
            written=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        )
    )
    both = [name for n in names for name in (n, f"{n}{ERROR}")]
    columns = ["schema_version", *_COLUMNS, "accuracy_reached", "warnings", *both]
    return {
        "summary.csv": write_text(out / "summary.csv", csv_text(columns, table)),
        "summary.html": write_text(out / "summary.html", str(html)),
    }


def _row(item: Mapping[str, Any]) -> dict[str, Any]:
    status = str(item.get("status") or "unknown")
    file, reason = str(item.get("file") or ""), str(item.get("reason") or "")
    return {
        "file": file,
        "status": status,
        # With a report but something to say is neither good nor lost.
        "kind": "pass" if status.lower() in GOOD else "open" if item.get("report") else "fail",
        # Messages name their file; the table has it already.
        "reason": reason.removeprefix(f"{file}: "),
        "seconds": item.get("seconds"),
        "faces": item.get("faces"),
        "patches": item.get("patches"),
        "report": None if item.get("report") is None else str(item["report"]),
        "accuracy_reached": item.get("accuracy_reached"),
        "warnings": [str(text) for text in item.get("warnings") or ()],
        "metrics": dict(_flat(item.get("metrics") or {})),
        "errors": dict(_flat(item.get("errors") or {})),
    }


def _flat(metrics: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Nested metrics as ``grid.metric``."""
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _cell(value: Any) -> Any:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return value


def _shown(row: dict[str, Any], names: Sequence[str], twice: Collection[str]) -> dict[str, Any]:
    """Texts of a row for the page; names that occur ``twice`` are shown with their folder."""
    report, path = row["report"], Path(row["file"])
    shown = f"{path.parent.name}/{path.name}" if path.name in twice else path.name
    return row | {
        "shown": shown or row["file"],
        "seconds": formats.seconds(row["seconds"]),
        "faces": formats.MISSING if row["faces"] is None else formats.count(row["faces"]),
        "patches": formats.MISSING if row["patches"] is None else formats.count(row["patches"]),
        # Relative addresses: percent-encoded, and never taken for a scheme.
        "href": "" if not report else "./" + quote(report.replace(os.sep, "/").removeprefix("./")),
        "reached": formats.percent(row["accuracy_reached"]),
        "values": [_value(row["metrics"].get(name), row["errors"].get(name)) for name in names],
    }


def _value(value: Any, error: float | None) -> str:
    if value is None:
        return formats.MISSING
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return formats.with_error(float(value), error, digits=3)
    return str(value)


def _heading(name: str) -> dict[str, str]:
    grid, _, metric = name.rpartition(".")
    unit = QUANTITIES.get(metric, ("", ""))[1]
    return {"grid": grid, "metric": metric, "unit": "" if unit == "1" else unit}
