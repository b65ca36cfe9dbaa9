"""Errors a user can act on; each names the file, part or key, the value and the bound."""

from __future__ import annotations


class PatchlightError(Exception):
    """Base of every error raised on purpose; the command line prints it as one line."""


class InputError(PatchlightError, ValueError):
    """A value, key, pattern or file content that cannot be used."""


class MissingFileError(PatchlightError, FileNotFoundError):
    """A file that is not there or cannot be read."""

    def __str__(self) -> str:  # OSError would print an errno tuple
        return str(self.args[0]) if self.args else ""


class OutputError(PatchlightError, OSError):
    """A folder or file that cannot be written."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class GeometryError(PatchlightError, ValueError):
    """Geometry that is empty, not finite, or of a kind that cannot carry light."""


class NumericsError(PatchlightError, ArithmeticError):
    """A computation that gave no finite or no unique answer."""


class ConvergenceError(PatchlightError, RuntimeError):
    """The accuracy asked for was not reached; the message says what was."""


class OutOfMemoryError(PatchlightError, MemoryError):
    """A computation that needs more memory than is free; it was not begun."""


class MissingLibraryError(PatchlightError, ImportError):
    """A system library or optional package that this step needs is not installed."""


class PatchlightWarning(UserWarning):
    """Something a user should look at although a result exists."""
