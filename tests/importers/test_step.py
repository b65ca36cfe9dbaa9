"""STEP files: names, colours, instances and units through the file, and every bad input."""

from __future__ import annotations

import json
import subprocess
import sys

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import cad_face, from_cadquery, inspection, read_step, select_faces
from patchlight.solver.errors import InputError, MissingFileError


@pytest.fixture(scope="module")
def room():
    wall = cq.Workplane().box(4, 0.2, 3)
    lamps = cq.Assembly(name="lamps")
    bulb = cq.Workplane().sphere(0.1)
    lamps.add(bulb, name="bulb a", loc=cq.Location((1, 0, 2)), color=cq.Color(1, 0.5, 0))
    lamps.add(bulb, name="bulb/b", loc=cq.Location((-1, 0, 2)))
    out = cq.Assembly(name="room")
    out.add(wall, name="wall", loc=cq.Location((0, 2, 0)), color=cq.Color(0.5, 0.5, 0.5))
    turn = cq.Location((2, 0, 0), (0, 0, 1), 90)
    out.add(wall, name="side", loc=turn)
    out.add(lamps, loc=cq.Location((0, 0, 0.5)))
    return out


@pytest.fixture(scope="module")
def room_file(room, tmp_path_factory):
    path = tmp_path_factory.mktemp("step") / "room.step"
    room.export(str(path))
    return path


@pytest.fixture(scope="module")
def from_file(room_file):
    return read_step(room_file)


PATHS = ["wall", "side", "lamps/bulb a", "lamps/bulb%2Fb"]


def test_assembly_paths_colours_and_placements(room):
    model = from_cadquery(room, unit="m")
    assert [p.path for p in model.parts] == PATHS
    low, high = model.patches.bounds()
    np.testing.assert_allclose(high, [2.1, 2.1, 2.6], atol=1e-12)
    # sRGB 0.5 is linear 0.2140.
    assert model.parts[2].color == pytest.approx((1.0, 0.21404, 0.0), abs=1e-4)
    assert model.parts[1].color is None
    # The same geometry twice is converted once.
    assert model.parts[1].instance_of == 0
    assert model.parts[3].instance_of == 2


def exported(path, *shapes):
    """STEP file without product names; the kernel writes its own in their place."""
    cq.exporters.export(cq.Workplane().add(list(shapes)), str(path))
    assert "'Open CASCADE STEP translator" in path.read_text()
    return path


def test_parts_without_a_name_are_called_after_their_file(tmp_path):
    box = cq.Workplane().box(1, 2, 3).val()
    one = read_step(exported(tmp_path / "bracket.step", box))
    assert [p.path for p in one.parts] == ["bracket"]
    two = read_step(exported(tmp_path / "pair.step", box, box.moved(cq.Location((5, 0, 0)))))
    assert [p.path for p in two.parts] == ["pair:1", "pair:2"]


@pytest.mark.parametrize("name", ["Open CASCADE", "Open CASCADE STEP translator", "lamp 7.9 1"])
def test_names_of_the_author_are_kept(tmp_path, name):
    path = exported(tmp_path / "bracket.step", cq.Workplane().box(1, 2, 3).val())
    text = path.read_text()
    automatic = text.split("PRODUCT('")[1].split("'")[0]
    path.write_text(text.replace(f"'{automatic}'", f"'{name}'"))
    assert [p.path for p in read_step(path).parts] == [name]


def test_round_trip_through_step(room, room_file, from_file):
    direct, read = from_cadquery(room), from_file
    assert read.name == "room" and read.unit.startswith("milli")
    assert sorted(p.path for p in read.parts) == sorted(PATHS)
    for part in read.parts:
        i = [p.path for p in direct.parts].index(part.path)
        expected = direct.parts[i].color
        if expected is not None:
            assert part.color == pytest.approx(expected, abs=2e-3)
        mine = read.patches.take(read.patches.part_index == read.parts.index(part))
        other = direct.patches.take(direct.patches.part_index == i)
        np.testing.assert_allclose(mine.bounds(), other.bounds(), atol=1e-12)
    assert len(read.sha256) == 64 and read.source == str(room_file)


def test_unit_and_scale(room_file, from_file):
    base = from_file.patches.areas().sum()
    inch = read_step(room_file, unit="in", scale=10.0)
    assert inch.patches.areas().sum() / base == pytest.approx(254.0**2, rel=1e-12)
    assert inch.unit == "in"


def test_size_warning(tmp_path):
    path = tmp_path / "tiny.step"
    cq.exporters.export(cq.Workplane().box(0.5, 0.5, 0.5), str(path))
    assert any("length unit" in w for w in read_step(path).warnings)


def test_inspection_is_json(from_file):
    model = from_file
    text = json.loads(json.dumps(inspection(model)))
    certificate = text["certificate"]
    assert certificate["faces_total"] == certificate["faces_exact"] == 14
    assert certificate["faces_failed"] == 0 and certificate["seconds"] > 0
    assert certificate["patches"] == len(model.patches)
    assert set(certificate["faces"][0]) >= {
        "part", "number", "kind", "exact", "patches", "deviation_m", "angle_deg", "area_m2",
        "area_error", "gap_m", "reason",
    }  # fmt: skip
    assert sorted(p["path"] for p in text["parts"]) == sorted(PATHS)
    assert {p["path"]: p["color"] for p in text["parts"]}["lamps/bulb a"] == "#ff8000"


@pytest.mark.parametrize("source", ["memory", "file"])
def test_face_selection(room, from_file, source):
    model = from_cadquery(room) if source == "memory" else from_file
    side = [p.path for p in model.parts].index("side")

    def normals(selector):
        rows = select_faces(model, side, selector)
        mask = np.isin(model.patches.face_index, rows)
        half = np.array([0.5])
        return model.patches.take(mask).normals(half, half)[:, 0]

    np.testing.assert_allclose(normals("up"), [[0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(normals("down"), [[0, 0, -1]], atol=1e-12)
    assert len(normals("vertical")) == 4
    np.testing.assert_allclose(normals(">Z"), [[0, 0, 1]], atol=1e-12)
    # The part is turned: its thin direction is x in the model.
    np.testing.assert_allclose(normals(">X"), [[1, 0, 0]], atol=1e-9)
    assert len(normals("|Z")) == 2
    number = model.faces[select_faces(model, side, "#3")[0]].number
    assert number == 3
    wall = [p.path for p in model.parts].index("wall")
    assert len(select_faces(model, wall, "#808080")) == 6
    assert select_faces(model, wall, "#ff00ff") == []


def test_bad_selectors(room):
    model = from_cadquery(room)
    with pytest.raises(InputError, match="faces 1 to 6"):
        select_faces(model, "wall", "#7")
    with pytest.raises(InputError, match="CadQuery selector"):
        select_faces(model, "wall", "no such ((")
    with pytest.raises(InputError, match="not found"):
        select_faces(model, "ceiling", "up")


def test_cad_face(room, from_file):
    for model in (from_cadquery(room), from_file):
        face = cq.Face(cad_face(model, "wall", 1))
        row = next(f for f in model.faces if f.part == 0 and f.number == 1)
        assert face.Area() == pytest.approx(row.area_m2 * 1e6, rel=1e-9)
        with pytest.raises(InputError, match="faces 1 to 6"):
            cad_face(model, "wall", 7)


def test_missing_and_unusable_files(tmp_path, room_file):
    with pytest.raises(MissingFileError, match="no such file"):
        read_step(tmp_path / "none.step")
    with pytest.raises(InputError, match="folder"):
        read_step(tmp_path)
    cases = {
        "empty.step": (b"", "empty"),
        "text.step": (b"hello\n" * 50, "not a STEP file"),
        "cut.step": (room_file.read_bytes()[:3000], "truncated"),
        "bare.step": (
            b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
            b"FILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\n"
            b"ENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
            "no shape|no faces|cannot read",
        ),
        "mesh.step": (
            b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=TESSELLATED_SOLID('',(#2),$);\n"
            b"ENDSEC;\nEND-ISO-10303-21;\n",
            "tessellated",
        ),
    }
    for name, (content, message) in cases.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError, match=message) as caught:
            read_step(path)
        assert name in str(caught.value) and "\n" not in str(caught.value)


def tessellated(path, brep):
    """File of a box as triangles, beside its surfaces or alone."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Controller, STEPControl_Writer

    STEPControl_Controller.Init_s()
    before = {
        k: Interface_Static.CVal_s(k) for k in ("write.step.tessellated", "write.step.schema")
    }
    shape = cq.Workplane().box(1, 1, 1).val().wrapped
    BRepMesh_IncrementalMesh(shape, 0.1)
    try:
        Interface_Static.SetCVal_s("write.step.tessellated", "On")
        Interface_Static.SetCVal_s("write.step.schema", "AP242DIS")
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        writer.Write(str(path))
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)
    if not brep:
        path.write_text(path.read_text().replace("ADVANCED_FACE", "GEOMETRIC_CURVE_SET"))
    return path


def test_triangles_beside_surfaces_are_ignored_with_a_note(tmp_path):
    model = read_step(tessellated(tmp_path / "both.step", brep=True))
    assert model.certificate.faces_exact == 6
    assert any("tessellated geometry" in note for note in model.certificate.notes)


def test_triangles_alone_are_refused(tmp_path):
    with pytest.raises(InputError, match="tessellated geometry only"):
        read_step(tessellated(tmp_path / "alone.step", brep=False))


def test_wire_only_file_has_no_faces(tmp_path):
    path = tmp_path / "wire.step"
    cq.exporters.export(cq.Workplane().rect(1, 1), str(path))
    with pytest.raises(InputError, match="no faces|no shape"):
        read_step(path)


def test_timeout_and_bad_options(room_file):
    with pytest.raises(InputError, match="not read within"):
        read_step(room_file, timeout_s=0.01, cache=False)
    with pytest.raises(InputError, match="unit"):
        read_step(room_file, unit="furlong")
    with pytest.raises(InputError, match="scale"):
        read_step(room_file, scale=-1.0)
    with pytest.raises(InputError, match="expected a Workplane"):
        from_cadquery("box")


def test_crash_of_the_reader_is_one_line(room_file, monkeypatch):
    from patchlight.importers import step

    real = subprocess.run

    def crashing(command, **options):
        return real([sys.executable, "-c", "import os; os.abort()"], **options)

    monkeypatch.setattr(step.subprocess, "run", crashing)
    with pytest.raises(InputError, match="crashed on this file .signal 6.$"):
        read_step(room_file, cache=False)
    with pytest.raises(InputError, match="signal 6., perhaps for want of memory: 0.3 GB"):
        read_step(room_file, cache=False, memory_gb=0.3)


def test_importing_loads_no_cad_kernel():
    code = (
        "import sys, patchlight.importers as i; assert i.read_step and i.inspection; "
        "bad = {'OCP', 'cadquery', 'vtk', 'numba', 'scipy', 'matplotlib'} & set(sys.modules); "
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
