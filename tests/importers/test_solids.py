"""Areas, volumes and closedness of CadQuery solids against closed forms and the CAD kernel."""

from __future__ import annotations

import math
from pathlib import Path

import cadquery as cq
import matplotlib
import numpy as np
import pytest
from patchlight.importers import assemble, from_cadquery
from patchlight.importers.moments import volume_and_vector


def measured(shape):
    """Model, area [mm²], volume [mm³] and relative vector area of a shape in mm."""
    model = from_cadquery(shape)
    volume, vector, area = volume_and_vector(model.patches.control_points)
    return model, area * 1e6, volume * 1e9, float(np.linalg.norm(vector)) / area


def plate():
    return cq.Workplane().box(4, 4, 1).faces(">Z").workplane().hole(2)


ELEMENTARY = {
    "box": (cq.Workplane().box(1, 2, 3), 22.0, 6.0, 6),
    "cylinder": (cq.Workplane().cylinder(2, 1), 6 * math.pi, 2 * math.pi, 14),
    "sphere": (cq.Workplane().sphere(1), 4 * math.pi, 4 / 3 * math.pi, 8),
    "cone": (
        cq.Workplane(cq.Solid.makeCone(1, 0, 2)),
        math.pi * (1 + math.sqrt(5)),
        2 / 3 * math.pi,
        9,
    ),
    "torus": (cq.Workplane(cq.Solid.makeTorus(2, 0.5)), 4 * math.pi**2, math.pi**2, 16),
    "plate": (plate(), 32 + 16 + 2 * math.pi - 2 * math.pi, 16 - math.pi, 20),
}


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_solids_are_exact(name):
    shape, area, volume, most = ELEMENTARY[name]
    model, a, v, open_ = measured(shape)
    assert all(f.exact for f in model.faces)
    # Gauss quadrature with 8 points on 90-degree arcs is good to 1e-8.
    assert a == pytest.approx(area, rel=1e-8)
    assert v == pytest.approx(volume, rel=1e-8)
    assert open_ < 1e-9
    assert len(model.patches) <= most


TRIMMED = {
    "sphere minus box": cq.Workplane().sphere(1).cut(cq.Workplane().box(1, 1, 1, centered=False)),
    "sphere with square hole": cq.Workplane().sphere(1).cut(cq.Workplane().box(0.8, 0.8, 4)),
    "loft": cq.Workplane().rect(2, 2).workplane(offset=2).circle(0.7).loft(),
    "crossing cylinders": cq.Workplane().cylinder(4, 1).cut(cq.Workplane("YZ").cylinder(4, 0.5)),
    "oblique cut": cq.Workplane()
    .cylinder(4, 1)
    .cut(cq.Workplane().box(5, 5, 5).rotate((0, 0, 0), (1, 0, 0), 30).translate((0, 0, 3))),
    "fillets": cq.Workplane().box(1, 2, 3).edges().fillet(0.2),
    "torus and cylinder": cq.Workplane(cq.Solid.makeTorus(2, 0.5)).union(
        cq.Workplane().cylinder(1, 2)
    ),
    "nine holes": cq.Workplane().box(9, 9, 1).rarray(2.5, 2.5, 3, 3).circle(0.8).cutThruAll(),
    "slot": cq.Workplane().slot2D(3, 1).extrude(1),
    "vault": cq.Workplane("XZ").moveTo(-2, 0).lineTo(-2, 1).threePointArc((0, 2), (2, 1))
    .lineTo(2, 0).close().extrude(3),
    "vase": cq.Workplane("XZ").moveTo(0, 0).lineTo(1, 0).spline([(1.5, 1), (0.7, 2), (1, 3)],
    includeCurrent=True).lineTo(0, 3).close().revolve(360, (0, 0, 0), (0, 1, 0)),
}  # fmt: skip


@pytest.mark.parametrize("name", TRIMMED)
def test_trimmed_solids_are_closed_and_within_tolerance(name):
    shape = TRIMMED[name]
    model, area, volume, open_ = measured(shape)
    assert model.certificate.faces_failed == 0
    assert open_ < 1e-5
    assert volume == pytest.approx(shape.val().Volume(), rel=1e-4)
    assert area == pytest.approx(shape.val().Area(), rel=1e-4)
    for f in model.faces:
        assert f.area_error < (1e-6 if f.exact else 1e-4)
    weights = model.patches.control_points[..., 3]
    assert weights.min() > 0.0
    assert model.patches.areas().min() > 0.0


def test_cells_that_fold_between_their_samples_are_made_anew():
    def ball(radius, at, turn_deg):
        solid = cq.Workplane().sphere(radius).translate(at)
        return solid.rotate((0, 0, 0), (1, 2, 3), turn_deg).val()

    a, b = ball(2.288, (0.735, 0.175, 0.787), 237), ball(3.014, (0.142, -0.367, 0.472), 136)
    model, _, _, open_ = measured(a.fuse(b))
    assert all(f.angle_deg <= 1.0 and f.reason == "trimmed curved surface" for f in model.faces)
    # What is left of a sphere is higher than its half by the distance of the plane of the rim.
    apart = (a.Center() - b.Center()).Length
    caps = []
    for r, other in ((2.288, 3.014), (3.014, 2.288)):
        rim = (apart**2 + r**2 - other**2) / (2 * apart)
        caps.append(2e-6 * math.pi * r * (r + rim))
    assert sorted(f.area_m2 for f in model.faces) == pytest.approx(sorted(caps), rel=1e-4)
    assert open_ < 1e-6


def test_faces_off_in_area_are_converted_again_with_finer_edges(monkeypatch):
    ball = cq.Workplane().sphere(2.31)
    box = cq.Workplane().box(3.68, 1.932, 1.38).edges("|Z").fillet(0.3864)
    shape = ball.intersect(box.translate((0.758, 0.32, -0.409)).rotate((0, 0, 0), (1, 2, 3), 281))
    model, area, volume, open_ = measured(shape)
    assert model.certificate.max_area_error < 1e-4
    assert all(f.reason in ("", "trimmed curved surface") or f.kind == "plane" for f in model.faces)
    assert area == pytest.approx(shape.val().Area(), rel=1e-5)
    assert volume == pytest.approx(shape.val().Volume(), rel=1e-5)
    assert open_ < 1e-9
    # With the usual share of the tolerance for edges a fillet is off.
    monkeypatch.setattr(assemble, "FINE_EDGES", assemble.EDGE_SHARE)
    coarse = from_cadquery(shape, cache=False)
    off = [f for f in coarse.faces if f.area_error > 1e-4]
    assert off and all(f.reason.startswith("area off by") for f in off)


def test_text_is_exact():
    font = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")
    shape = cq.Workplane().text("Patch&8", 5, 1, fontPath=str(font))
    model, _, volume, open_ = measured(shape)
    assert model.certificate.faces_failed == 0
    assert model.certificate.faces_exact == model.certificate.faces_total
    assert volume == pytest.approx(shape.val().Volume(), rel=1e-9)
    assert open_ < 1e-9


def test_window_in_a_wall_takes_four_patches_a_side():
    wall = cq.Workplane().box(4, 0.3, 3).faces("<Y").workplane().rect(1.5, 1.2).cutThruAll()
    model, area, _, _ = measured(wall)
    assert area == pytest.approx(2 * (12 - 1.8) + 2 * 0.3 * (4 + 3) + 2 * 0.3 * 2.7, rel=1e-12)
    assert len(model.patches) == 4 + 4 + 8


def test_normals_point_out_of_the_material_and_into_cavities():
    room = cq.Workplane().box(4, 4, 3).cut(cq.Workplane().box(3.6, 3.6, 2.6))
    model, area, volume, _ = measured(room)
    assert volume == pytest.approx(48 - 3.6 * 3.6 * 2.6, rel=1e-12)
    middle = np.array([0.5])
    p = model.patches.evaluate(middle, middle)[:, 0] * 1e3
    n = model.patches.normals(middle, middle)[:, 0]
    inner = np.isclose(np.abs(p), [1.8, 1.8, 1.3]).any(axis=1)
    towards_axis = np.einsum("ij,ij->i", p, n) < 0
    assert (towards_axis == inner).all()


def test_inside_out_solid_is_reversed_and_noted():
    from OCP.TopoDS import TopoDS

    box = cq.Workplane().box(1, 1, 1).val()
    turned = cq.Shape.cast(TopoDS.Solid_s(box.wrapped.Reversed()))
    model, _, volume, _ = measured(turned)
    assert volume == pytest.approx(1.0, rel=1e-12)
    assert any("inside out" in note for note in model.certificate.notes)


def test_inconsistent_shell_is_reoriented_and_noted():
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    builder.MakeSolid(solid)
    for k, face in enumerate(cq.Workplane().box(1, 1, 1).faces().vals()):
        builder.Add(shell, face.wrapped.Reversed() if k in (1, 4) else face.wrapped)
    builder.Add(solid, shell)
    model, _, volume, open_ = measured(cq.Shape.cast(solid))
    assert volume == pytest.approx(1.0, rel=1e-12) and open_ < 1e-12
    assert any("2 faces turned" in note for note in model.certificate.notes)


def test_sheets_and_loose_faces():
    face = cq.Face.makePlane(2, 3)
    model = from_cadquery(face)
    assert [p.kind for p in model.parts] == ["sheet"]
    assert len(model.patches) == 1
    assert model.patches.areas().sum() == pytest.approx(6e-6)


def test_neighbouring_patches_share_edge_numbers():
    model = from_cadquery(cq.Workplane().box(1, 2, 3))
    edges, count = np.unique(model.patches.edge_index, return_counts=True)
    assert len(edges) == 12 and (edges >= 0).all() and (count == 2).all()


def test_edge_sides_lie_on_their_edges():
    model = from_cadquery(plate())
    nets, edges = model.patches.control_points, model.patches.edge_index
    s = np.linspace(0, 1, 5)
    zero, one = np.zeros(5), np.ones(5)
    sides = ((s, zero), (one, s), (s, one), (zero, s))
    points: dict[int, list[np.ndarray]] = {}
    for k, (u, v) in enumerate(sides):
        on = model.patches.evaluate(u, v)
        for p in range(len(nets)):
            if edges[p, k] >= 0:
                points.setdefault(int(edges[p, k]), []).append(on[p])
    lengths = [np.ptp(np.concatenate(x), axis=0).max() for x in points.values()]
    assert len(points) >= 14 and min(lengths) > 0


def test_tolerance_is_kept():
    shape = cq.Workplane().rect(2, 2).workplane(offset=2).circle(0.7).loft()
    coarse = from_cadquery(shape, tolerance=1e-3, angle_deg=3.0)
    fine = from_cadquery(shape, tolerance=1e-5, angle_deg=0.3)
    size = 1e-3 * math.sqrt(12)
    assert coarse.certificate.max_deviation_m <= 1e-3 * size
    assert fine.certificate.max_deviation_m <= 1.1e-5 * size
    assert fine.certificate.max_angle_deg <= 0.3
    assert len(fine.patches) > len(coarse.patches)
