"""OpenEXR files with absolute luminance and geometry layers.

The attribute ``whiteLuminance`` is the luminance of RGB (1, 1, 1) in cd/m² (OpenEXR standard
attributes), so absolute values carry 1.0. All float channels are 32 bit: the sun overflows halves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from patchlight.solver.errors import MissingLibraryError, OutputError
from patchlight.solver.model import CameraImage

from .files import write_atomic

#: Rec. 709 / sRGB primaries and D65 as x, y of red, green, blue, white. [IEC 61966-2-1]
CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
#: ``id.part`` where a ray leaves the scene.
NO_PART = np.uint32(0xFFFFFFFF)


def channels(image: CameraImage) -> dict[str, Any]:
    """Channels of the file by name: RGB [cd/m²] and the layers."""
    single = np.float32
    part = np.asarray(image.part_index)
    ids = np.where(part < 0, int(NO_PART), part).astype(np.uint32)
    layers = {
        "R": image.rgb[..., 0],
        "G": image.rgb[..., 1],
        "B": image.rgb[..., 2],
        "illuminance.Y": image.illuminance_lx,
        "depth.Z": image.depth_m,
        "normal.X": image.normals[..., 0],
        "normal.Y": image.normals[..., 1],
        "normal.Z": image.normals[..., 2],
    }
    arrays: dict[str, Any] = {
        name: np.ascontiguousarray(values, dtype=single) for name, values in layers.items()
    }
    arrays["id.part"] = np.ascontiguousarray(ids)
    return arrays


def write_exr(image: CameraImage, path: Path, *, comments: str = "", software: str = "") -> Path:
    """Write ``image`` with RGB in cd/m² and the layers illuminance, depth, normal and id.

    Raises
    ------
    OutputError, MissingLibraryError
        If the file cannot be written, or OpenEXR is not installed.
    """
    try:
        import OpenEXR
    except ImportError as error:
        raise MissingLibraryError(f"OpenEXR images need the package OpenEXR: {error}") from error
    camera = image.camera
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": CHROMATICITIES,
        "whiteLuminance": 1.0,
        "software": software,
        "comments": comments,
        "view": (
            f"{camera.projection} eye {camera.eye} target {camera.target} up {camera.up} "
            f"fov_deg {camera.fov_deg:g}"
        ),
        "units": (
            "RGB cd/m2; illuminance.Y lx; depth.Z m; NaN where a ray leaves the scene; "
            "id.part row of the part in patches.npz, 4294967295 none"
        ),
    }
    data = channels(image)

    def write(temporary: Path) -> None:
        try:
            OpenEXR.File(header, data).write(str(temporary))
        except (RuntimeError, ValueError) as error:  # the library's errors of stream and disk
            raise OutputError(f"cannot write {path}: {error}") from error

    return write_atomic(path, write)
