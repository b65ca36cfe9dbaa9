"""What this machine can do."""

from __future__ import annotations

import os
import platform
from importlib import metadata

LIBRARIES = ("cadquery", "cadquery-ocp", "numpy", "numba", "scipy", "pyvista", "vtk", "OpenEXR")


def doctor_lines() -> list[str]:
    """One line a finding; loads no heavy library."""
    from patchlight.reports import pdf_status, rendering_status
    from patchlight.solver.cores import usable_cores
    from patchlight.solver.numba_cache import is_compiling_off, use_cache_folder

    lines = [f"patchlight {version('patchlight')}, Python {platform.python_version()}"]
    lines.append("libraries: " + ", ".join(f"{name} {version(name)}" for name in LIBRARIES))
    lines.append(f"threads: {usable_cores()} of {os.cpu_count()} cores usable")
    for what, (can, why) in (("pictures", rendering_status()), ("PDF", pdf_status())):
        lines.append(f"{what}: {'yes' if can else 'no'}, {why}")
    folder, warm = use_cache_folder()
    state = "filled" if warm else "empty, the first run compiles (once)"
    if is_compiling_off():
        lines.append("compiled kernels: none, NUMBA_DISABLE_JIT is set; runs are very slow")
    else:
        lines.append(f"compiled kernels: {folder} ({state})")
    return lines


def version(name: str) -> str:
    """Version of an installed distribution, or "missing"."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "missing"
