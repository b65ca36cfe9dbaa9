"""Importers: STEP and CadQuery models as exact patches, photometric files, weather files,
measured skies.

Importing this loads no CAD kernel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from patchlight.solver.lazy import lazy_attributes

if TYPE_CHECKING:
    from .cadquery_model import from_cadquery
    from .describe import inspection
    from .patch_sky import read_patch_sky
    from .photometry import read_photometry
    from .selection import cad_face, select_faces
    from .step import read_step
    from .weather import read_weather

__all__ = [
    "cad_face",
    "from_cadquery",
    "inspection",
    "read_patch_sky",
    "read_photometry",
    "read_step",
    "read_weather",
    "select_faces",
]

_HOME = {
    "cad_face": ".selection",
    "from_cadquery": ".cadquery_model",
    "inspection": ".describe",
    "read_patch_sky": ".patch_sky",
    "read_photometry": ".photometry",
    "read_step": ".step",
    "read_weather": ".weather",
    "select_faces": ".selection",
}


__getattr__ = lazy_attributes(__name__, _HOME)
