"""Product structure of a STEP file: names, colours, layers and placements of its shapes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TColStd import TColStd_HSequenceOfExtendedString, TColStd_SequenceOfAsciiString
from OCP.TDataStd import TDataStd_Name, TDataStd_TreeNode
from OCP.TDF import TDF_Label, TDF_LabelSequence
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.XCAFDoc import (
    XCAFDoc,
    XCAFDoc_ColorCurv,
    XCAFDoc_ColorGen,
    XCAFDoc_ColorSurf,
    XCAFDoc_ColorTool,
    XCAFDoc_DocumentTool,
    XCAFDoc_Material,
    XCAFDoc_ShapeTool,
)
from patchlight.solver.errors import InputError
from patchlight.solver.model.arrays import FloatArray

from .occurrences import Looks, Occurrence, matrix, numbered, segment

#: Names that the CAD kernel gives to products without one when it writes a file.
AUTOMATIC = re.compile(r"Open CASCADE STEP translator \d[\d.]*( \d[\d.]*)?")


def read_document(path: str) -> tuple[list[Occurrence], str]:
    """Occurrences of a STEP file in millimetres, and the length unit it declares.

    Raises
    ------
    InputError
        If the file cannot be read or holds no shape.
    """
    document = TDocStd_Document(TCollection_ExtendedString("patchlight"))
    reader = STEPCAFControl_Reader()
    reader.SetColorMode(True)
    reader.SetNameMode(True)
    reader.SetLayerMode(True)
    reader.SetMatMode(True)
    if reader.ReadFile(path) != IFSelect_RetDone:
        raise InputError(f"{path}: the CAD kernel cannot read this STEP file")
    lengths, angles, solid_angles = (TColStd_SequenceOfAsciiString() for _ in range(3))
    reader.ChangeReader().FileUnits(lengths, angles, solid_angles)
    unit = lengths.Value(1).ToCString().lower() if lengths.Length() else "mm"
    if not reader.Transfer(document):
        raise InputError(f"{path}: the STEP file holds no shape that can be transferred")
    return _Tree(document, Path(path).stem).occurrences(), unit


class _Tree:
    """Walks the labels of a document."""

    def __init__(self, document: Any, stem: str) -> None:
        self.stem = stem
        main = document.Main()
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        self.layers = XCAFDoc_DocumentTool.LayerTool_s(main)
        self.found: list[Occurrence] = []
        self._inner: dict[str, list[tuple[Any, Looks]]] = {}

    def occurrences(self) -> list[Occurrence]:
        free = TDF_LabelSequence()
        self.shapes.GetFreeShapes(free)
        roots = [free.Value(i) for i in range(1, free.Length() + 1)]
        # Annotations come as roots of their own, without faces.
        roots = [r for r in roots if _has_faces(XCAFDoc_ShapeTool.GetShape_s(r))]
        if len(roots) == 1 and XCAFDoc_ShapeTool.IsAssembly_s(roots[0]):
            # The path starts below the root of the file.
            location = XCAFDoc_ShapeTool.GetShape_s(roots[0]).Location()
            self._children(roots[0], (), matrix(location), self._looks(roots[0]))
        else:
            names = numbered([self._name(r) or self.stem for r in roots])
            for label, name in zip(roots, names, strict=True):
                self._node(label, (segment(name),), np.eye(4), Looks())
        return self.found

    def _children(
        self, label: Any, path: tuple[str, ...], placement: FloatArray, looks: Looks
    ) -> None:
        sequence = TDF_LabelSequence()
        XCAFDoc_ShapeTool.GetComponents_s(label, sequence)
        items = [sequence.Value(i) for i in range(1, sequence.Length() + 1)]
        names = [self._instance_name(i) for i in items]
        if len(items) == 1 and path and names[0] == f"{path[-1]}_part":
            # CadQuery writes a part with children or a colour as an assembly of one.
            self._node(items[0], path, placement, looks)
            return
        for item, name in zip(items, numbered(names), strict=True):
            self._node(item, (*path, segment(name)), placement, looks)

    def _node(self, label: Any, path: tuple[str, ...], placement: FloatArray, looks: Looks) -> None:
        looks = self._looks(label).over(looks)
        target = label
        if XCAFDoc_ShapeTool.IsReference_s(label):
            placement = placement @ matrix(XCAFDoc_ShapeTool.GetLocation_s(label))
            target = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(label, target)
            # The colour of an instance wins over that of its product.
            looks = (
                looks.over(self._looks(target))
                if self._own_color(label)
                else (self._looks(target).over(looks))
            )
        if XCAFDoc_ShapeTool.IsAssembly_s(target):
            self._children(target, path, placement, looks)
            return
        shape = XCAFDoc_ShapeTool.GetShape_s(target)
        if shape is None or shape.IsNull():
            return
        self.found.append(Occurrence(path, shape, placement, looks, self._sub_shapes(target)))

    def _sub_shapes(self, label: Any) -> list[tuple[Any, Looks]]:
        key = self._entry(label)
        if key not in self._inner:
            sequence = TDF_LabelSequence()
            XCAFDoc_ShapeTool.GetSubShapes_s(label, sequence)
            out = []
            for i in range(1, sequence.Length() + 1):
                sub = sequence.Value(i)
                looks = self._looks(sub)
                if looks.name or looks.color or looks.layer:
                    out.append((XCAFDoc_ShapeTool.GetShape_s(sub), looks))
            self._inner[key] = out
        return self._inner[key]

    @staticmethod
    def _entry(label: Any) -> str:
        tags = []
        while not label.IsRoot():
            tags.append(str(label.Tag()))
            label = label.Father()
        return ":".join(tags)

    @staticmethod
    def _name(label: Any) -> str | None:
        # FindAttribute crashes the process on a label without a name: ask first.
        if not label.IsAttribute(TDataStd_Name.GetID_s()):
            return None
        attribute = TDataStd_Name()
        if not label.FindAttribute(TDataStd_Name.GetID_s(), attribute):
            return None
        text = attribute.Get().ToExtString().strip()
        # The kernel names unnamed sub-shapes after their type, and unnamed products after itself.
        if text in ("", "SOLID", "SHELL", "COMPOUND", "FACE", "COMPSOLID"):
            return None
        return None if AUTOMATIC.fullmatch(text) else text

    def _instance_name(self, label: Any) -> str:
        target = TDF_Label()
        product = None
        if XCAFDoc_ShapeTool.GetReferredShape_s(label, target):
            product = self._name(target)
        own = self._name(label)
        automatic = own is None or re.fullmatch(r"(NAUO\d*|=>.*|\d+)", own)
        if product and (automatic or own is None or own.startswith(product)):
            return product
        return (None if automatic else own) or product or self.stem

    @staticmethod
    def _own_color(label: Any) -> bool:
        color = Quantity_Color()
        return bool(XCAFDoc_ColorTool.GetColor_s(label, XCAFDoc_ColorSurf, color)) or bool(
            XCAFDoc_ColorTool.GetColor_s(label, XCAFDoc_ColorGen, color)
        )

    def _looks(self, label: Any) -> Looks:
        out = Looks(self._name(label))
        color = Quantity_Color()
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen, XCAFDoc_ColorCurv):
            if XCAFDoc_ColorTool.GetColor_s(label, kind, color):
                out.color = (color.Red(), color.Green(), color.Blue())  # linear RGB
                break
        names = TColStd_HSequenceOfExtendedString()
        if self.layers.GetLayers(label, names) and names.Length():
            out.layer = names.Value(1).ToExtString()
        out.material = _material(label)
        return out


def _has_faces(shape: Any) -> bool:
    return shape is not None and not shape.IsNull() and TopExp_Explorer(shape, TopAbs_FACE).More()


def _material(label: Any) -> str | None:
    guid = XCAFDoc.MaterialRefGUID_s()
    if not label.IsAttribute(guid):
        return None
    node = TDataStd_TreeNode()
    if not label.FindAttribute(guid, node) or not node.HasFather():
        return None
    home = node.Father().Label()
    if not home.IsAttribute(XCAFDoc_Material.GetID_s()):
        return None
    material = XCAFDoc_Material()
    if not home.FindAttribute(XCAFDoc_Material.GetID_s(), material):
        return None
    name = material.GetName()
    return name.ToCString() if name is not None else None
