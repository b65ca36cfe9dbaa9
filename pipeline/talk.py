"""What the command line says on stderr: stages, warnings and progress."""

from __future__ import annotations

import json
import sys
import time
from datetime import UTC, datetime
from typing import Any, TextIO


class Talk:
    """Voice of one run.

    A progress bar on a terminal; otherwise one line a stage when ``verbose``. Everything said is
    kept in ``records`` for the run's log.

    Parameters
    ----------
    verbose : bool
        Stage lines where there is no terminal.
    stream : TextIO, optional
        Where to talk; stderr.
    """

    def __init__(self, *, verbose: bool = False, stream: TextIO | None = None) -> None:
        self.verbose = verbose
        self.stream = stream or sys.stderr
        self.records: list[dict[str, Any]] = []
        self._tty = self.stream.isatty()
        self._bars: Any = None
        self._tasks: dict[str, Any] = {}
        self._stage = ""
        self._began = time.perf_counter()

    def __enter__(self) -> Talk:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def note(self, text: str) -> None:
        """Say something worth reading."""
        self._record("info", text)
        self._print(text)

    def detail(self, text: str) -> None:
        """Say something only with ``verbose``."""
        self._record("debug", text)
        if self.verbose:
            self._print(text)

    def warn(self, text: str) -> None:
        """Say something that needs attention."""
        self._record("warning", text)
        self._print(f"warning: {text}")

    def progress(self, stage: str, done: int, total: int) -> None:
        """Progress callback of the importers, the solver and the reports."""
        if stage != self._stage:
            self._stage = stage
            self._record("stage", stage)
            if not self._tty and self.verbose:
                seconds = time.perf_counter() - self._began
                self._print(f"[{seconds:6.1f} s] {stage}")
        if self._tty:
            self._draw(stage, done, total)

    def _draw(self, stage: str, done: int, total: int) -> None:
        if self._bars is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self._bars = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f}%"),
                TimeElapsedColumn(),
                console=Console(file=self.stream),
                transient=True,
            )
            self._bars.start()
        if stage not in self._tasks:
            for task in self._tasks.values():  # a new stage ends those before it
                self._bars.update(task, visible=False)
            self._tasks[stage] = self._bars.add_task(stage, total=max(1, total))
        self._bars.update(self._tasks[stage], completed=done, total=max(1, total), visible=True)

    def log_text(self) -> str:
        """All that was said, one JSON object a line."""
        lines = ({"schema_version": 1, **record} for record in self.records)
        return "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)

    def stop(self) -> None:
        """Take the progress bar away."""
        if self._bars is not None:
            self._bars.stop()
            self._bars, self._tasks = None, {}

    def _print(self, text: str) -> None:
        if self._bars is not None:
            self._bars.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=self.stream, flush=True)

    def _record(self, level: str, text: str) -> None:
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        self.records.append({"time": now, "level": level, "message": text})
