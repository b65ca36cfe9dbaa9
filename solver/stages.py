"""Times, counters and reasons collected while a simulation runs."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

LOG = logging.getLogger(__name__)

Progress = Callable[[str, int, int], None]


class Stages:
    """What a run did, what it skipped and why.

    Parameters
    ----------
    progress : callable, optional
        Called as ``progress(stage, done, total)``.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self.seconds: dict[str, float] = {}
        self.skipped: dict[str, str] = {}
        self.counters: dict[str, int] = {}
        self.figures: dict[str, float] = {}
        self.warnings: list[str] = []

    @contextmanager
    def run(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Time one stage; yields a callable ``(done, total)`` for its progress."""
        start = time.perf_counter()

        def tell(done: int, total: int) -> None:
            if self._progress is not None:
                self._progress(name, done, total)

        tell(0, 1)
        yield tell
        seconds = time.perf_counter() - start
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        LOG.info("%s: %.2f s", name, seconds)

    def count(self, counters: Mapping[str, int]) -> None:
        """Add ``counters`` to those of the run."""
        for name, value in counters.items():
            self.counters[name] = self.counters.get(name, 0) + value
