"""Lines and numbers of a text file, each known by its line."""

from __future__ import annotations

import math
import re
from pathlib import Path

from patchlight.solver.errors import InputError, MissingFileError

#: Larger files are no photometry: 721 half-planes of 721 angles take less than 4 MB.
MAX_BYTES = 32_000_000


def read_text(path: Path, most: int = MAX_BYTES) -> tuple[str, bytes]:
    """Text of a file of ``most`` bytes in UTF-8 or, failing that, Windows-1252, and its bytes.

    Raises
    ------
    MissingFileError
        If it is not there or cannot be read.
    InputError
        If it is too large, or no text.
    """
    try:
        with path.open("rb") as file:
            raw = file.read(most + 1)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from None
    if len(raw) > most:
        raise InputError(f"{path}: larger than {most} bytes: no file of this kind is")
    if b"\0" in raw:
        raise InputError(f"{path}: byte {raw.index(0)} is 0: this is no text file")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", errors="replace")
    # Editors of the eighties end a file with Ctrl-Z.
    return text.rstrip("\x1a\r\n\t "), raw


class Numbers:
    """Numbers in successive lines, taken one after the other.

    Parameters
    ----------
    path : Path
        For messages.
    lines : list of str
        All lines of the file.
    start : int
        Line to begin at, counted from 0.
    between : str
        Regular expression of what parts numbers.
    comma : bool
        Whether a comma is the decimal sign.
    """

    def __init__(
        self, path: Path, lines: list[str], start: int, *, between: str, comma: bool = False
    ) -> None:
        self.path = path
        self._words = [
            (number + 1, word)
            for number in range(start, len(lines))
            for word in re.split(between, lines[number])
            if word
        ]
        self._next = 0
        self._last_line = len(lines)
        self._comma = comma

    def take(self, what: str, *, low: float = -math.inf, high: float = math.inf) -> float:
        """The next number, within bounds."""
        if self._next >= len(self._words):
            raise InputError(
                f"{self.path}, line {self._last_line}: the file ends where {what} should come"
            )
        line, word = self._words[self._next]
        self._next += 1
        return number_in(word, f"{self.path}, line {line}", what, low, high, comma=self._comma)

    def count(self, what: str, *, low: int, high: int) -> int:
        """The next number, which must be whole."""
        value = self.take(what, low=low, high=high)
        if value != int(value):
            line = self._words[self._next - 1][0]
            raise InputError(f"{self.path}, line {line}: {what} = {value:g}: must be whole")
        return int(value)

    def many(self, count: int, what: str, *, low: float = -math.inf) -> list[float]:
        """The next ``count`` numbers."""
        return [self.take(f"{what} {k + 1} of {count}", low=low) for k in range(count)]

    def end(self) -> None:
        """Raise `InputError` where something is left."""
        if self._next < len(self._words):
            line, word = self._words[self._next]
            left = len(self._words) - self._next
            raise InputError(
                f"{self.path}, line {line}: {left} more values than the file says it has, from "
                f"{word[:20]!r}"
            )


def number_in(
    word: str,
    where: str,
    what: str,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    comma: bool = False,
) -> float:
    """``word`` as a finite number within bounds; ``where`` and ``what`` name it in errors."""
    text = word.strip()
    try:
        value = float(text.replace(",", ".") if comma else text)
    except ValueError:
        raise InputError(f"{where}: {what} = {text[:40]!r}: must be a number") from None
    if not (math.isfinite(value) and low <= value <= high):
        bound = f"must lie between {low:g} and {high:g}"
        if high == math.inf:
            bound = f"must be at least {low:g}" if low > -math.inf else "must be finite"
        raise InputError(f"{where}: {what} = {text[:40]}: {bound}")
    return value
