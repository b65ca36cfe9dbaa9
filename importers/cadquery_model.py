"""CadQuery objects as models, in this process."""

from __future__ import annotations

import hashlib
import io
import time
import weakref
from typing import Any

import numpy as np
from OCP.BinTools import BinTools
from patchlight.solver.errors import GeometryError, InputError
from patchlight.solver.model import Model
from patchlight.solver.model.arrays import FloatArray

from .assemble import Options, assemble
from .occurrences import Looks, Occurrence, bodies, matrix, numbered, segment
from .step import check_options
from .units import unit_metres

#: CAD faces of each part of models made here, for `cad_face`; forgotten with the model.
SHAPES: dict[int, list[list[Any]]] = {}


def from_cadquery(
    obj: Any,
    *,
    unit: str = "mm",
    tolerance: float = 1e-4,
    angle_deg: float = 1.0,
    name: str | None = None,
    check_areas: bool = True,
    cache: bool = True,
) -> Model:
    """Convert a CadQuery Workplane, Shape or Assembly to a model.

    Options are those of `read_step`; ``unit`` is that of the numbers in CadQuery, ``name`` that of
    the model in a scene.
    """
    import cadquery as cq

    started = time.perf_counter()
    check_options(1.0, tolerance, angle_deg, 1.0)
    metres = unit_metres(unit)
    if isinstance(obj, cq.Assembly):
        label = name or obj.name or "model"
        found: list[Occurrence] = []
        _walk(obj, (), np.eye(4), Looks(), found, label)
    elif isinstance(obj, cq.Workplane | cq.Shape):
        label = name or "model"
        shapes = obj.vals() if isinstance(obj, cq.Workplane) else [obj]
        solid = [s for s in shapes if isinstance(s, cq.Shape) and s.Faces()]
        names = [segment(label)] * len(solid)
        if len(names) > 1:
            names = [f"{n}#{k}" for k, n in enumerate(names, 1)]
        found = [
            Occurrence((n,), s.wrapped, np.eye(4), Looks())
            for n, s in zip(names, solid, strict=True)
        ]
    else:
        raise InputError(
            f"from_cadquery: {type(obj).__name__}: expected a Workplane, Shape or Assembly"
        )
    if not found:
        raise InputError(f"from_cadquery: {label!r} holds no face")
    try:
        model, shapes_of = assemble(
            bodies(found), name=label, metres=metres,
            options=Options(tolerance, angle_deg, True, check_areas, cache), source="cadquery",
            sha256=_digest(found), unit=unit, started=started, read=started,
        )  # fmt: skip
    except GeometryError as error:
        raise GeometryError(f"{label}: {error}") from None
    return remember(model, shapes_of)


def remember(model: Model, shapes: list[list[Any]]) -> Model:
    """Keep the CAD faces of a model as long as its patches live."""
    key = id(model.patches.control_points)
    SHAPES[key] = shapes
    weakref.finalize(model.patches.control_points, SHAPES.pop, key, None)
    return model


def _digest(found: list[Occurrence]) -> str:
    h = hashlib.sha256()
    for o in found:
        stream = io.BytesIO()
        BinTools.Write_s(o.shape, stream)
        h.update(repr((o.path, o.looks)).encode())
        h.update(o.placement.tobytes())
        h.update(stream.getvalue())
    return h.hexdigest()


def _walk(
    node: Any,
    path: tuple[str, ...],
    placement: FloatArray,
    looks: Looks,
    found: list[Occurrence],
    root: str,
) -> None:
    import cadquery as cq

    placement = placement @ matrix(node.loc.wrapped)
    own = Looks(node.name if path else None)
    if node.color is not None:
        rgb = node.color.wrapped.GetRGB()  # the kernel holds linear components
        own.color = (rgb.Red(), rgb.Green(), rgb.Blue())
    looks = own.over(Looks(None, looks.color, looks.layer, looks.material))
    thing = node.obj
    if thing is not None:
        shapes = thing.vals() if isinstance(thing, cq.Workplane) else [thing]
        solid = [s for s in shapes if isinstance(s, cq.Shape) and s.Faces()]
        here = path or (segment(root),)
        if node.children:
            here = (*here, f"{here[-1]}_part")
        for k, s in enumerate(solid, 1):
            p = here if len(solid) == 1 else (*here[:-1], f"{here[-1]}#{k}")
            found.append(Occurrence(p, s.wrapped, placement, looks))
    names = numbered([segment(c.name) for c in node.children])
    for child, name in zip(node.children, names, strict=True):
        _walk(child, (*path, name), placement, looks, found, root)
