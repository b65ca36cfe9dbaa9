"""What this machine can render: off-screen OpenGL for VTK, Pango for WeasyPrint."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.util


def _loads(*names: str) -> str | None:
    """First of the shared libraries that loads."""
    for name in names:
        candidates = [name, ctypes.util.find_library(name.removeprefix("lib").split(".so")[0])]
        for candidate in candidates:
            if candidate:
                try:
                    ctypes.CDLL(candidate)
                except OSError:
                    continue
                return name
    return None


def window_classes() -> list[str]:
    """VTK's off-screen window classes whose system library loads, best first."""
    found = []
    if _loads("libEGL.so.1"):
        found.append("vtkEGLRenderWindow")
    if _loads("libOSMesa.so.8", "libOSMesa.so"):
        found.append("vtkOSOpenGLRenderWindow")
    return found


def rendering_status() -> tuple[bool, str]:
    """Whether VTK can draw off screen here, and why or how. Loads neither VTK nor PyVista."""
    if importlib.util.find_spec("pyvista") is None:
        return False, "pyvista is not installed; stills are drawn by the built-in rasteriser"
    classes = window_classes()
    if not classes:
        return False, (
            "neither libEGL nor libOSMesa is installed (Debian: libegl1 or libosmesa6); "
            "stills are drawn by the built-in rasteriser"
        )
    names = {"vtkEGLRenderWindow": "EGL", "vtkOSOpenGLRenderWindow": "OSMesa"}
    return True, f"off-screen rendering with {' or '.join(names[c] for c in classes)}"


def pdf_status() -> tuple[bool, str]:
    """Whether ``report.pdf`` can be written here, and what is missing. Does not load WeasyPrint."""
    if importlib.util.find_spec("weasyprint") is None:
        return False, "WeasyPrint is not installed: pip install 'patchlight[pdf]'"
    missing = [
        name
        for name in ("libpango-1.0.so.0", "libpangoft2-1.0.so.0", "libharfbuzz.so.0")
        if not _loads(name)
    ]
    if missing:
        return False, (
            f"WeasyPrint needs {', '.join(missing)} "
            "(Debian: libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz0b)"
        )
    return True, "PDF with WeasyPrint"
