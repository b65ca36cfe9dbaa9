"""The tools compared; each measures one setting of one case.

A tool has a ``name``; ``version()``, which raises `Missing` when it is not there; and
``run(case, setting)``, which returns the irradiance at the sensors and the CPU seconds of all
threads. Whatever happens once in a process (imports, compiled kernels, scene files) is left out of
those seconds and counted in ``prepare(case, setting)``.
"""

from __future__ import annotations

from typing import NamedTuple

from patchlight.solver.model.arrays import FloatArray


class Missing(Exception):
    """A tool is not installed, or does not work here; the text says what is missing."""


class Run(NamedTuple):
    """Irradiance (n,) [W/m²] and CPU seconds."""

    irradiance: FloatArray
    cpu_s: float
