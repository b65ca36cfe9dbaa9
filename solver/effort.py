"""What may be asked of a run: its accuracy, and threads."""

from __future__ import annotations

import math
from numbers import Integral, Real

from .errors import InputError

#: Least and largest accuracy.
FINEST, COARSEST = 1e-6, 0.5


def check_effort(accuracy: float | None, threads: int | None) -> None:
    """Raise `InputError` unless accuracy and number of threads can be meant; None is fine."""
    if accuracy is not None and not (
        isinstance(accuracy, Real)
        and not isinstance(accuracy, bool)
        and math.isfinite(accuracy)
        and FINEST <= accuracy <= COARSEST
    ):
        raise InputError(
            f"accuracy = {accuracy!r}: must be a number from {FINEST:g} to {COARSEST:g}"
        )
    if threads is not None and not (
        isinstance(threads, Integral) and not isinstance(threads, bool) and threads >= 1
    ):
        raise InputError(f"threads = {threads!r}: must be a whole number, at least 1")
