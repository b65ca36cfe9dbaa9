"""Converted parts in the cache: each shape under a hash of its content."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from OCP.BinTools import BinTools, BinTools_FormatVersion

from . import kept
from .convert import FacePatches
from .edge_kinds import EdgeFacts
from .stored import DAMAGED

if TYPE_CHECKING:
    from .assemble import Converted, Options

#: Seconds of a conversion above which it is kept; below, looking it up saves nothing.
WORTH_S = 0.05
#: What of a face is a number or text.
FIELDS = (
    "kind", "exact", "deviation", "angle_deg", "gap", "area", "area_error", "free_edge", "left_out",
    "reason",
)  # fmt: skip


def key(shape: Any, kind: str, options: Options) -> str:
    """Key of a shape's content, without triangles that a viewer may have left on it."""
    stream = io.BytesIO()
    BinTools.Write_s(
        shape, stream, False, False, BinTools_FormatVersion.BinTools_FormatVersion_CURRENT
    )
    chosen = {
        "kind": kind, "tolerance": options.tolerance, "angle_deg": options.angle_deg,
        "heal": options.heal, "check_areas": options.check_areas,
    }  # fmt: skip
    return kept.key(stream.getvalue(), chosen)


def put(name: str, part: Converted) -> None:
    """Keep a part."""
    head = {
        "faces": [[getattr(f, k) for k in FIELDS] for f in part.faces],
        "size": part.size,
        "kind": part.kind,
        "seconds": part.seconds,
        "area_seconds": part.area_seconds,
        "notes": part.notes,
    }
    arrays = {
        "count": np.array([len(f.nets) for f in part.faces], dtype=np.int64),
        "nets": np.concatenate([f.nets for f in part.faces]),
        "edges": np.concatenate([f.edges for f in part.faces]),
        "edge_kind": part.edges.kind,
        "edge_angle_deg": part.edges.angle_deg,
        "edge_faces": part.edges.faces,
    }
    kept.put(name, (head, arrays))


def get(name: str) -> dict[str, Any] | None:
    """Fields of the part of a key, without its shapes; None where there is none."""
    found = kept.get(name)
    if found is None:
        return None
    head, arrays = found
    try:
        cuts = np.cumsum(arrays["count"])[:-1]
        faces = [
            FacePatches(nets=nets, edges=edges, **dict(zip(FIELDS, row, strict=True)))
            for row, nets, edges in zip(
                head.pop("faces"), np.split(arrays["nets"], cuts), np.split(arrays["edges"], cuts),
                strict=True,
            )
        ]  # fmt: skip
        edges = EdgeFacts(*(arrays[f"edge_{k}"] for k in ("kind", "angle_deg", "faces")))
        return {**head, "faces": faces, "edges": edges}
    except DAMAGED:
        kept.drop(name)
        return None
