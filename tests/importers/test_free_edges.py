"""Edges at which a face ends and no other begins: told by part, face and length."""

from __future__ import annotations

import math

import cadquery as cq
import pytest
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid
from patchlight.importers import from_cadquery, inspection
from patchlight.pipeline.inspecting import inspection_text

BOX = cq.Workplane().box(1, 2, 3)
CYLINDER = cq.Workplane().circle(1).extrude(2)


def solid_of(faces):
    """What a file calls a solid, of faces as they are."""
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face.wrapped)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return cq.Solid(solid)


def free(shape):
    model = from_cadquery(shape, unit="m", cache=False)
    return model, [f.free_edge_m for f in model.faces]


@pytest.mark.parametrize("shape", [BOX, CYLINDER, cq.Workplane().sphere(1)])
def test_closed_solids_have_none(shape):
    model, found = free(shape)
    assert found == [0.0] * len(found)
    assert model.certificate.free_edge_m == 0.0
    assert "free edges" not in inspection_text(model)


def test_all_edges_of_a_loose_face_are_free():
    _, found = free(cq.Workplane().rect(2, 3).extrude(1).faces(">Z").val())
    assert found == [pytest.approx(10.0, rel=1e-12)]
    _, found = free(cq.Workplane().circle(2).extrude(1).faces(">Z").val())
    assert found == [pytest.approx(4.0 * math.pi, rel=1e-9)]


def test_an_open_tube_is_free_at_its_ends_and_not_at_its_seam():
    wall = next(f for f in CYLINDER.faces().vals() if f.geomType() == "CYLINDER")
    _, found = free(wall)
    assert found == [pytest.approx(4.0 * math.pi, rel=1e-9)]


def test_a_solid_without_a_face_names_its_neighbours_and_the_length():
    faces = BOX.faces("not >Z").vals()
    model, found = free(solid_of(faces))
    assert sorted(found) == pytest.approx([0.0, 1.0, 1.0, 2.0, 2.0], rel=1e-12)
    first = next(k for k, x in enumerate(found) if x)
    warning = next(w for w in model.warnings if "no closed solid" in w)
    assert "4 of its faces have free edges, 6 m in all" in warning
    assert f"the first #{first + 1} (plane" in warning
    assert model.parts[0].path in warning
    assert not any("not closed" in note for note in model.certificate.notes)  # once is enough
    text = inspection_text(model)
    assert "free edges, where no other face begins: 6 m" in text
    listed = inspection(model)["certificate"]
    assert listed["free_edge_m"] == pytest.approx(6.0)
    assert [f["free_edge_m"] for f in listed["faces"]] == pytest.approx(found)


def test_faces_that_were_never_sewn_together_close_up():
    # Each face has edges of its own, which lie on those of its neighbours.
    apart = [cq.Face(f.copy().wrapped) for f in BOX.faces().vals()]
    model, found = free(solid_of(apart))
    assert found == [0.0] * 6
    assert not any("free edges" in w for w in model.warnings)
    moved = [*apart[:5], apart[5].translate(cq.Vector(0.01, 0.0, 0.0))]
    assert sum(free(solid_of(moved))[1]) > 0.0


def test_a_lid_that_is_off_by_less_than_the_tolerance_closes_the_box():
    # Tolerance 1e-4 of the size, 3.7e-4 m: the lid is off by more than 1e-6 of an edge.
    apart = [cq.Face(f.copy().wrapped) for f in BOX.faces().vals()]
    top = max(range(6), key=lambda k: apart[k].Center().z)
    apart[top] = apart[top].translate(cq.Vector(1e-4, 0.0, 0.0))
    model, found = free(solid_of(apart))
    assert found == [0.0] * 6
    assert model.certificate.edges == {"sharp": 24}


def test_edges_shorter_than_the_tolerance_are_free():
    # A corner cut off at 45 degrees, and a step: 4 mm where 7 mm are one place.
    for corner in (
        [(50, 0), (50, 49.997), (49.997, 50)],
        [(50, 0), (50, 49), (49.996, 49), (49.996, 50)],
    ):
        around = [cq.Vector(x, y, 0) for x, y in [(0, 0), *corner, (0, 50)]]
        model, (found,) = free(cq.Face.makeFromWires(cq.Wire.makePolygon(around, close=True)))
        lengths = [(b - a).Length for a, b in zip(around, [*around[1:], around[0]], strict=True)]
        assert model.certificate.edges == {"free": len(around)}
        assert found == pytest.approx(sum(lengths), rel=1e-12)
