"""What a CAD source holds: shapes with their path, placement and looks, one entry per part."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_COMPSOLID, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Iterator
from patchlight.solver.model.arrays import FloatArray

Color = tuple[float, float, float]


@dataclass(slots=True)
class Looks:
    """Name, linear colour, layer and material of a shape, where given."""

    name: str | None = None
    color: Color | None = None
    layer: str | None = None
    material: str | None = None

    def over(self, other: Looks) -> Looks:
        """These looks, completed by those of ``other``."""
        return Looks(
            self.name or other.name,
            self.color or other.color,
            self.layer or other.layer,
            self.material or other.material,
        )


@dataclass(slots=True)
class Occurrence:
    """One shape of the source placed in the model."""

    path: tuple[str, ...]
    shape: Any
    placement: FloatArray
    looks: Looks
    #: Looks of sub-shapes: (shape, looks) of solids and faces.
    inner: list[tuple[Any, Looks]] = field(default_factory=list)


@dataclass(slots=True)
class Body:
    """A solid, open shell or loose face without its location, and where it stands."""

    path: str
    kind: str
    shape: Any
    placement: FloatArray
    looks: Looks
    inner: list[tuple[Any, Looks]]


def matrix(location: Any) -> FloatArray:
    """(4, 4) matrix of a location of the CAD kernel."""
    trsf = location.Transformation()
    out = np.eye(4)
    for i in range(3):
        out[i] = [trsf.Value(i + 1, j + 1) for j in range(4)]
    return out


def numbered(names: list[str]) -> list[str]:
    """Names with ``:1 :2`` appended where siblings repeat."""
    count = Counter(names)
    seen: Counter[str] = Counter()
    out = []
    for name in names:
        seen[name] += 1
        out.append(f"{name}:{seen[name]}" if count[name] > 1 else name)
    return out


def segment(name: str) -> str:
    """A name as one path segment."""
    return name.strip().replace("/", "%2F")


def _pieces(shape: Any, placement: FloatArray) -> list[tuple[str, Any, Any, FloatArray]]:
    """(kind, shape without location, shape as it is, placement) of solids, shells, loose faces."""
    out: list[tuple[str, Any, Any, FloatArray]] = []
    stack = [(shape, placement)]
    while stack:
        item, at = stack.pop()
        kind = item.ShapeType()
        here = at @ matrix(item.Location())
        bare = item.Located(TopLoc_Location())
        if kind in (TopAbs_COMPOUND, TopAbs_COMPSOLID):
            children = []
            iterator = TopoDS_Iterator(bare)
            while iterator.More():
                children.append((iterator.Value(), here))
                iterator.Next()
            stack.extend(children[::-1])
        elif kind == TopAbs_SOLID:
            out.append(("solid", bare, item, here))
        elif kind == TopAbs_SHELL and BRep_Tool.IsClosed_s(bare):
            # CadQuery's shell() is written like this: a closed surface, hence the bound of a solid.
            out.append(("solid", bare, item, here))
        elif kind in (TopAbs_SHELL, TopAbs_FACE):
            out.append(("sheet", bare, item, here))
    return out


def bodies(occurrences: list[Occurrence]) -> list[Body]:
    """Every solid and sheet of the occurrences with its final path.

    Unnamed solids of one product are numbered ``Window#1``; named ones get a segment of their own.
    """
    out: list[Body] = []
    for o in occurrences:
        pieces = _pieces(o.shape, o.placement)
        names: list[str | None] = []
        looks = []
        for _, bare, _, _ in pieces:
            own = next(
                (x for s, x in o.inner if s.IsPartner(bare) and not s.IsSame(o.shape)), Looks()
            )
            names.append(own.name)
            looks.append(replace(own.over(o.looks), name=own.name or o.looks.name))
        given = numbered([n or "" for n in names])
        for k, (kind, bare, _, at) in enumerate(pieces):
            path = o.path
            if len(pieces) > 1:
                if names[k]:
                    path = (*path, segment(given[k]))
                else:
                    path = (*path[:-1], f"{path[-1]}#{k + 1}")
            out.append(Body("/".join(path), kind, bare, at, looks[k], o.inner))
    final = numbered([b.path for b in out])
    for body, unique in zip(out, final, strict=True):
        body.path = unique
    return out
