"""VTK PolyData files (.vtp) of the evaluated elements, written without VTK.

Format: VTK XML PolyData, inline base64, zlib blocks with 64-bit headers ("VTK File Formats",
Kitware, "XML File Formats").
"""

from __future__ import annotations

import base64
import struct
import zlib
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from patchlight.solver.model import Result
from patchlight.solver.model.result import luminous

from .files import write_text
from .run_files import SCHEMA_VERSION
from .surface_mesh import display_mesh

_TYPES = {"float32": "Float32", "float64": "Float64", "int64": "Int64", "int32": "Int32"}
_BLOCK = 1 << 20


def write_vtp(result: Result, path: Path) -> Path:
    """Quads on the curved elements with illuminance at points and everything else at cells."""
    mesh = display_mesh(result)
    n, k = len(mesh.points), mesh.steps
    quads = mesh.quads().reshape(-1, 4)
    rows = np.repeat(mesh.element, k * k)
    patch = result.elements.patch_index[rows] if n else np.zeros(0, dtype=np.int64)
    cells: dict[str, Any] = {
        "E_element_lx": result.illuminance_lx[rows],
        "error_lx": result.element_error_lx[rows],
        "M_lm_m2": luminous(result.exitance)[rows],
        "element": rows,
        "part": result.scene.patches.part_index[patch],
        "face": result.scene.patches.face_index[patch],
        "side": result.elements.side[rows],
    }
    for name, values in result.components.items():
        cells[f"E_{name}_lx"] = luminous(values)[rows]
    text = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">',
        "<PolyData>",
        "<FieldData>",
        _array("schema_version", np.array([SCHEMA_VERSION]), tuples=1),
        "</FieldData>",
        f'<Piece NumberOfPoints="{n * (k + 1) ** 2}" NumberOfVerts="0" NumberOfLines="0" '
        f'NumberOfStrips="0" NumberOfPolys="{len(quads)}">',
        '<PointData Scalars="E_lx">',
        _array("E_lx", mesh.values.ravel().astype(np.float32)),
        "</PointData>",
        "<CellData>",
        *(_array(name, _narrow(values)) for name, values in cells.items()),
        "</CellData>",
        "<Points>",
        _array("Points", mesh.points.reshape(-1, 3), components=3),
        "</Points>",
        "<Polys>",
        _array("connectivity", quads.ravel()),
        _array("offsets", 4 * np.arange(1, len(quads) + 1)),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        "</VTKFile>",
    ]
    return write_text(path, "\n".join(text) + "\n")


def _narrow(values: Any) -> np.ndarray:
    array = np.asarray(values)
    return array.astype(np.float32 if array.dtype.kind == "f" else np.int32)


def _array(name: str, values: np.ndarray, *, components: int = 1, tuples: int | None = None) -> str:
    kind = _TYPES[values.dtype.name]
    extra = f' NumberOfTuples="{tuples}"' if tuples is not None else ""
    size = f' NumberOfComponents="{components}"' if components > 1 else ""
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)}{size}{extra} format="binary">'
        f"{_encoded(values)}</DataArray>"
    )


def _encoded(values: np.ndarray) -> str:
    """Header [blocks, block size, last block size, compressed sizes] and blocks, both base64."""
    raw = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    blocks = [raw[i : i + _BLOCK] for i in range(0, len(raw), _BLOCK)]
    packed = [zlib.compress(block, 6) for block in blocks]
    last = len(raw) % _BLOCK
    header = struct.pack(f"<{3 + len(packed)}Q", len(packed), _BLOCK, last, *map(len, packed))
    if not packed:
        header = struct.pack("<3Q", 0, 0, 0)
    return base64.b64encode(header).decode() + base64.b64encode(b"".join(packed)).decode()
