"""Errors collected, so that everything wrong is said at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from patchlight.solver.errors import InputError, PatchlightError


class Problems:
    """What is wrong with one thing.

    Parameters
    ----------
    where : str
        File that all of it is about, named once; empty when there is none.
    """

    def __init__(self, where: str = "") -> None:
        self.where = where
        self.lines: list[str] = []
        self._errors: list[PatchlightError] = []

    @contextmanager
    def under(self, key: str = "") -> Iterator[None]:
        """Keep an error of the block, named by ``key``, and go on after it."""
        try:
            yield
        except PatchlightError as error:
            before = len(self.lines)
            self.add([f"{key}: {error}" if key else str(error)])
            if len(self.lines) > before:
                self._errors.append(error)

    def add(self, lines: Iterable[str]) -> None:
        """Keep problems that were found otherwise; the same one counts once."""
        self.lines += [line for line in dict.fromkeys(lines) if line not in self.lines]

    def raise_any(self) -> None:
        """Raise all that was kept as one error; a single one as it was."""
        if not self.lines:
            return
        if not self.where and len(self.lines) == len(self._errors) == 1:
            raise self._errors[0]
        head = f"{self.where}: " if self.where else ""
        if len(self.lines) == 1:
            raise InputError(head + self.lines[0])
        many = f"{head}{len(self.lines)} problems"
        raise InputError("\n".join([many, *(f"  {line}" for line in self.lines)]))
