"""Where exceptions of the CAD kernel are told from ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from patchlight.solver.errors import GeometryError


@contextmanager
def asking_the_kernel() -> Iterator[None]:
    """Turn exceptions of the CAD kernel into `GeometryError`; let those of ours pass.

    They have no common base class, but all are defined in its own package.
    """
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "OCP":
            raise
        raise GeometryError(f"the CAD kernel failed: {type(error).__name__} {error}") from error
