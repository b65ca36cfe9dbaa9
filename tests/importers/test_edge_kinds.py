"""Edges between two faces are smooth or sharp, others free, non-manifold or a point."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.GCE2d import GCE2d_MakeSegment
from OCP.Geom import Geom_CylindricalSurface
from OCP.gp import gp_Ax3, gp_Pnt2d
from OCP.TopoDS import TopoDS_Shell
from patchlight.importers import from_cadquery, inspection, kept, read_step
from patchlight.pipeline.inspecting import inspection_text
from patchlight.solver.errors import InputError
from patchlight.solver.model import EDGE_KINDS, CadEdges, PatchSet

BOX = cq.Workplane().box(1, 2, 3)
CONE = cq.Workplane().add(cq.Solid.makeCone(1, 0, 2))


def kinds(model):
    return model.certificate.edges


def converted(shape, **options):
    return from_cadquery(shape, unit="m", cache=False, **options)


def shell_of(*faces):
    """Faces side by side in a shell, whatever edges they have."""
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face.wrapped)
    return cq.Shell(shell)


def sewn(*faces):
    """Faces in a shell that share their common edges."""
    return shell_of(*faces[0].fuse(*faces[1:]).Faces())


def tile(x0, x1, y0, y1, slope_deg=0.0):
    """A rectangle that rises along x from x = 0 on."""
    z = math.tan(math.radians(slope_deg))
    corners = [(x0, y0, z * x0), (x1, y0, z * x1), (x1, y1, z * x1), (x0, y1, z * x0)]
    return cq.Face.makeFromWires(cq.Wire.makePolygon([cq.Vector(*c) for c in corners], close=True))


@pytest.mark.parametrize(
    ("shape", "wanted"),
    [
        (BOX, {"sharp": 12}),
        # Four rounds along z: eight lines where they begin, and rims of eight lines and arcs.
        (BOX.edges("|Z").fillet(0.2), {"smooth": 8, "sharp": 16}),
        # Rounded all over, with a pole of a sphere at each corner.
        (BOX.edges().fillet(0.2), {"smooth": 48, "degenerate": 8}),
        (cq.Workplane().circle(1).extrude(2), {"smooth": 1, "sharp": 2}),
        (CONE, {"smooth": 1, "sharp": 1, "degenerate": 1}),
        (cq.Workplane().sphere(1), {"smooth": 1, "degenerate": 2}),
        (cq.Workplane().add(cq.Solid.makeTorus(2, 0.5)), {"smooth": 2}),
        # The box has four walls, floor and lid, and a hole through both: a seam and two rims.
        (BOX.faces(">Z").workplane().hole(0.5), {"smooth": 1, "sharp": 14}),
        (shell_of(*BOX.faces("not >Z").vals()), {"sharp": 8, "free": 4}),
        (BOX.faces(">Z").val(), {"free": 4}),
    ],
)
def test_kinds_of_edges(shape, wanted):
    model = converted(shape)
    assert kinds(model) == wanted
    assert len(model.edges) == sum(wanted.values())


def test_angles_faces_and_sides_of_patches():
    edges = converted(CONE).edges
    (rim,) = edges.rows("sharp")
    # The wall leans inwards by atan(1/2) from the vertical, the floor looks down.
    assert edges.angle_deg[rim] == pytest.approx(90.0 + math.degrees(math.atan(0.5)), abs=1e-9)
    assert set(edges.faces[rim]) == {0, 1}
    (seam,) = edges.rows("smooth")
    assert edges.faces[seam][0] == edges.faces[seam][1]
    (apex,) = edges.rows("degenerate")
    assert np.isnan(edges.angle_deg[apex])
    model = converted(BOX)
    for e, (a, b) in enumerate(model.edges.faces):
        on = (model.patches.edge_index == e).any(axis=1)
        assert set(model.patches.face_index[on]) == {a, b}


@pytest.mark.parametrize(("slope", "wanted"), [(0.5, "smooth"), (0.99, "smooth"), (1.01, "sharp")])
def test_a_crease_counts_from_the_angle_that_normals_may_be_off(slope, wanted):
    pair = sewn(tile(-1, 0, 0, 1), tile(0, 1, 0, 1, slope))
    model = converted(pair)
    assert kinds(model) == {wanted: 1, "free": 6}
    (e,) = model.edges.rows(wanted)
    assert model.edges.angle_deg[e] == pytest.approx(slope, abs=1e-9)
    assert kinds(converted(pair, angle_deg=2.0)) == {"smooth": 1, "free": 6}


def test_a_knife_edge_is_sharp():
    fold = shell_of(tile(0, 1, 0, 1), tile(0, 2, 0, 1))
    found = converted(fold)
    # The small one lies on the large one along three sides, where they face the other way.
    assert len(found.edges.rows("sharp")) == 4
    assert found.edges.angle_deg[np.isfinite(found.edges.angle_deg)] == pytest.approx(180.0)


@pytest.mark.parametrize("slope", [0.0, 30.0])
def test_faces_that_were_never_sewn_together_meet_as_others_do(slope):
    model = converted(shell_of(tile(-1, 0, 0, 1), tile(0, 1, 0, 1, slope)))
    wanted = "sharp" if slope else "smooth"
    assert kinds(model) == {wanted: 2, "free": 6}
    for e in model.edges.rows(wanted):
        assert model.edges.angle_deg[e] == pytest.approx(slope, abs=1e-9)
        assert set(model.edges.faces[e]) == {0, 1}
    # Turned over, one of them runs the other way along the line they share.
    back = tile(0, 1, 0, 1, slope)
    turned = cq.Face(back.wrapped.Reversed())
    assert kinds(converted(shell_of(tile(-1, 0, 0, 1), turned))) == {wanted: 2, "free": 6}


def test_one_long_edge_beside_two_short_ones_is_not_free():
    model = converted(shell_of(tile(-1, 0, 0, 3), tile(0, 1, 0, 1), tile(0, 1, 1, 3)))
    # Along x = 0 three edges, along y = 1 two.
    assert kinds(model) == {"smooth": 5, "free": 7}
    assert model.certificate.free_edge_m == pytest.approx(3.0 + 2.0 + 2.0 + 3.0, rel=1e-12)
    # A gap of 1 between them: that stretch is free, and so is the edge.
    model = converted(shell_of(tile(-1, 0, 0, 3), tile(0, 1, 0, 1), tile(0, 1, 2, 3)))
    assert kinds(model) == {"smooth": 2, "free": 10}
    assert model.faces[0].free_edge_m == pytest.approx(3.0 + 2.0 + 1.0, rel=1e-12)


def test_arcs_of_another_division_close_up():
    # A disc of one edge in a ring whose hole is three.
    disc = cq.Workplane().circle(1).extrude(1).faces(">Z").val()
    at = [0.3, 1.9, 4.0, 0.3 + 2.0 * math.pi]
    arcs = []
    for a, b in zip(at[:-1], at[1:], strict=True):
        three = [cq.Vector(math.cos(t), math.sin(t), 1.0) for t in (a, 0.5 * (a + b), b)]
        arcs.append(cq.Edge.makeThreePointArc(*three))
    square = cq.Wire.makePolygon(
        [cq.Vector(x, y, 1.0) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))], close=True
    )
    ring = cq.Face.makeFromWires(square, [cq.Wire.assembleEdges(arcs)])
    model = converted(shell_of(cq.Face(disc.copy().wrapped), ring))
    assert kinds(model) == {"smooth": 4, "free": 4}
    assert model.certificate.free_edge_m == pytest.approx(16.0, rel=1e-12)


def test_three_faces_at_one_edge_are_non_manifold():
    fan = tile(-1, 0, 0, 1), tile(0, 1, 0, 1), tile(0, 1, 0, 1, 45.0)
    assert kinds(converted(sewn(*fan))) == {"free": 9, "non-manifold": 1}
    assert kinds(converted(shell_of(*fan))) == {"free": 9, "non-manifold": 3}


@pytest.mark.parametrize("other", [tile(0, 1, 0, 1, 45.0), tile(0, 2, 0.2, 0.7, 45.0)])
def test_an_unsewn_face_on_a_sewn_edge_is_not_free_there(other):
    pair = sewn(tile(-1, 0, 0, 1), tile(0, 1, 0, 1, 1.5)).Faces()
    assert kinds(converted(shell_of(*pair))) == {"sharp": 1, "free": 6}
    model = converted(shell_of(*pair, other))
    assert kinds(model) == {"free": 9, "non-manifold": 2}
    shared, own = model.edges.rows("non-manifold")
    assert set(model.edges.faces[shared]) == {0, 1}
    assert model.edges.faces[own].tolist() == [2, 0]
    assert np.isnan(model.edges.angle_deg[[shared, own]]).all()
    # A little farther off than the tolerance it is free, and the sewn edge is what it was.
    model = converted(shell_of(*pair, other.translate(cq.Vector(0, 0, 1e-3))))
    assert kinds(model) == {"sharp": 1, "free": 10}


def test_of_several_unsewn_faces_at_an_edge_the_first_one_is_named():
    fan = tile(-1, 0, 0, 1), tile(0, 1, 0, 1), tile(0, 1, 0, 1, 45.0)
    edges = converted(shell_of(*fan)).edges
    met = edges.faces[edges.rows("non-manifold")]
    assert met.tolist() == [[0, 1], [1, 0], [2, 0]]


def test_moved_and_repeated_parts_keep_their_edges():
    part = BOX.edges("|Z").fillet(0.2)
    two = cq.Assembly()
    two.add(part, name="a")
    two.add(part, name="b", loc=cq.Location((5, 1, 2), (1, 1, 0), 40))
    model = from_cadquery(two, unit="m", cache=False)
    assert model.certificate.part_edges == ({"smooth": 8, "sharp": 16},) * 2
    a, b = (np.flatnonzero(model.edges.part == k) for k in (0, 1))
    assert np.array_equal(model.edges.kind[a], model.edges.kind[b])
    assert np.array_equal(model.edges.faces[a] + 10, model.edges.faces[b])
    assert np.array_equal(model.edges.rows("smooth", part=1), model.edges.rows("smooth")[8:])
    # Sides of patches lie on edges of their own part.
    on = model.patches.edge_index >= 0
    rows, _ = np.nonzero(on)
    part_of = model.edges.part[model.patches.edge_index[on]]
    assert np.array_equal(part_of, model.patches.part_index[rows])


def test_edges_go_through_files_and_caches(tmp_path, monkeypatch):
    monkeypatch.setenv(kept.VARIABLE, str(tmp_path / "cache"))
    holes = [(x, y) for x in range(-40, 41, 20) for y in range(-40, 41, 20)]
    plate = cq.Workplane().box(100, 100, 5).faces(">Z").workplane().pushPoints(holes).hole(8)
    path = tmp_path / "plate.step"
    cq.exporters.export(plate, str(path))
    direct = from_cadquery(plate, cache=False)
    again = [from_cadquery(plate), from_cadquery(plate), read_step(path), read_step(path)]
    assert "taken from the cache" in again[1].certificate.notes[-1]
    assert "taken from the cache" in again[3].certificate.notes[-1]
    for model in again:
        assert kinds(model) == kinds(direct) == {"smooth": 25, "sharp": 62}
        assert model.certificate.part_edges == direct.certificate.part_edges
    for name in ("kind", "part", "faces", "angle_deg"):
        wanted = getattr(again[0].edges, name)
        assert np.array_equal(getattr(again[1].edges, name), wanted, equal_nan=True)


def test_inspection_counts_edges_of_each_part():
    model = converted(CONE)
    listed = inspection(model)["certificate"]
    assert listed["edges"] == {"smooth": 1, "sharp": 1, "degenerate": 1}
    assert listed["part_edges"] == [{"part": model.parts[0].path, **listed["edges"]}]
    assert "edges: 1 smooth, 1 sharp, 1 degenerate" in inspection_text(model)


def test_edges_without_a_curve_in_space_are_no_poles():
    # A piece of a cylinder whose edges are lines in (u, v) alone.
    wall, corners = Geom_CylindricalSurface(gp_Ax3(), 1.0), [(0, 0), (1, 0), (1, 2), (0, 2)]
    wire = BRepBuilderAPI_MakeWire()
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        line = GCE2d_MakeSegment(gp_Pnt2d(*a), gp_Pnt2d(*b)).Value()
        wire.Add(BRepBuilderAPI_MakeEdge(line, wall).Edge())
    face = cq.Face(BRepBuilderAPI_MakeFace(wall, wire.Wire()).Face())
    model = converted(face)
    assert kinds(model) == {"unknown": 4}
    assert model.edges.faces.tolist() == [[0, -1]] * 4
    assert model.faces[0].area_m2 == pytest.approx(2.0, rel=1e-12)


def test_unknown_kinds_are_named():
    with pytest.raises(InputError, match="'round'.*smooth, sharp"):
        CadEdges.none().rows("round")
    assert [len(CadEdges.none().rows(k)) for k in EDGE_KINDS] == [0] * len(EDGE_KINDS)
    assert len(PatchSet.box((1, 1, 1)).edge_index) == 6
