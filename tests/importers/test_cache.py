"""Conversions kept on disk: taken again when nothing changed, and never when anything did."""

from __future__ import annotations

import dataclasses
import os
import sys

import cadquery as cq
import numpy as np
import pytest
from patchlight.importers import cad_face, from_cadquery, kept, read_step, step, stored
from patchlight.pipeline.cli import BAD_INPUT, main
from patchlight.solver.errors import InputError


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache."""
    home = tmp_path / "cache"
    monkeypatch.setenv(kept.VARIABLE, str(home))
    return home / "models"


@pytest.fixture(scope="module")
def plate():
    """A plate that takes longer to convert than what is not worth keeping."""
    holes = [(x, y) for x in range(-40, 41, 20) for y in range(-40, 41, 20)]
    return cq.Workplane().box(100, 100, 5).faces(">Z").workplane().pushPoints(holes).hole(8)


@pytest.fixture
def file(plate, tmp_path):
    path = tmp_path / "plate.step"
    cq.exporters.export(plate, str(path))
    return path


@pytest.fixture
def in_process(monkeypatch):
    """Files are read in this process: starting another takes longer than all else."""
    from patchlight.importers import child

    monkeypatch.setattr(step, "_run", lambda ask, _: stored.from_model(child.read(ask)[0]))


def is_cached(model):
    return any("taken from the cache" in note for note in model.certificate.notes)


def assert_same(model, other):
    assert np.array_equal(model.patches.control_points, other.patches.control_points)
    assert np.array_equal(model.patches.edge_index, other.patches.edge_index)
    assert [f.kind for f in model.faces] == [f.kind for f in other.faces]
    for name in ("deviation_m", "angle_deg", "area_m2", "area_error", "gap_m"):
        assert [getattr(f, name) for f in model.faces] == [getattr(f, name) for f in other.faces]


def test_a_file_is_converted_once(file, folder, monkeypatch):
    first = read_step(file)
    with monkeypatch.context() as patch:
        patch.setattr(step, "_run", None)  # what took all the time
        again = read_step(file)
    assert not is_cached(first)
    assert is_cached(again)
    assert_same(first, again)
    assert again.certificate.seconds == first.certificate.seconds
    assert f"{first.certificate.seconds:.3g} s" in again.certificate.notes[-1]
    assert again.parts[0].path == first.parts[0].path
    assert np.array_equal(again.parts[0].placement, first.parts[0].placement)
    assert again.sha256 == first.sha256
    # The CAD face is still found, by reading the file.
    assert cad_face(again, 0, 1).ShapeType() == cad_face(first, 0, 1).ShapeType()


@pytest.mark.parametrize(
    "options",
    [{"tolerance": 1e-3}, {"angle_deg": 2.0}, {"scale": 2.0}, {"unit": "cm"}, {"heal": False}],
    ids=lambda o: next(iter(o)),
)
def test_other_options_are_another_conversion(options, file, folder, in_process):
    read_step(file, check_areas=False)
    assert not is_cached_whole(read_step(file, check_areas=False, **options))


def is_cached_whole(model):
    return any(note.startswith("taken from the cache") for note in model.certificate.notes)


def test_another_name_is_another_conversion(file, folder, in_process):
    """What has no name is named after the file."""
    read_step(file)
    renamed = file.with_name("other.step")
    file.rename(renamed)
    model = read_step(renamed)
    assert not is_cached_whole(model)
    assert model.name == "other"


def test_a_file_that_refers_to_others_is_read_each_time(folder, tmp_path, in_process):
    """Another file may hold another shape the next time; its parts are kept by what they are."""
    path = tmp_path / "whole.step"
    write_in_several_files(path, cq.Workplane().box(10, 10, 10))
    first = read_step(path)
    write_in_several_files(path, cq.Workplane().box(20, 20, 20), only_others=True)
    again = read_step(path)
    assert again.patches.areas().sum() == pytest.approx(4.0 * first.patches.areas().sum())


def write_in_several_files(path, shape, *, only_others=False):
    """An assembly whose part lies in a file of its own."""
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.STEPControl import STEPControl_StepModelType
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    shapes.AddShape(cq.Compound.makeCompound([shape.val()]).wrapped, True)
    writer = STEPCAFControl_Writer()
    writer.Transfer(document, STEPControl_StepModelType.STEPControl_AsIs, "other_")
    before = path.read_bytes() if only_others else b""
    writer.Write(str(path))
    if only_others:
        path.write_bytes(before)
    assert b"DOCUMENT_FILE" in path.read_bytes()


def test_an_edited_file_is_read_again_and_unchanged_parts_are_not_converted(
    plate, folder, tmp_path, in_process
):
    path = tmp_path / "room.step"
    pair = cq.Assembly(name="pair").add(plate, name="plate")
    pair.add(cq.Workplane().box(1, 1, 1), name="box").export(str(path))
    first = read_step(path)
    pair.add(cq.Workplane().box(2, 2, 2), name="more").export(str(path))
    again = read_step(path)
    assert any("1 of 3 distinct parts taken" in note for note in again.certificate.notes)
    n = len(first.patches)
    assert len(again.patches) == n + 6
    assert np.array_equal(again.patches.control_points[:n], first.patches.control_points)


def test_a_cadquery_part_is_converted_once(plate, folder):
    first = from_cadquery(plate)
    again = from_cadquery(plate)
    assert is_cached(again)
    assert_same(first, again)
    elsewhere = from_cadquery(cq.Assembly().add(plate, loc=cq.Location((0, 0, 7))))
    assert is_cached(elsewhere)
    assert elsewhere.patches.bounds()[0][2] == pytest.approx(7e-3 - 2.5e-3)
    start, end = (cad_face(m, 0, 1) for m in (first, again))
    assert start.ShapeType() == end.ShapeType()


def test_small_parts_are_not_worth_a_file(folder):
    from_cadquery(cq.Workplane().box(1, 1, 1))
    assert not is_cached(from_cadquery(cq.Workplane().box(1, 1, 1)))
    assert not folder.exists()


@pytest.mark.parametrize(
    "damage",
    [lambda b: b"", lambda b: b[: len(b) // 2], lambda b: b[:3000] + b"\0" * 500 + b[3500:]],
    ids=["empty", "cut", "overwritten"],
)
def test_damaged_entries_are_made_again(damage, file, folder, in_process):
    first = read_step(file)
    for path in folder.iterdir():
        path.write_bytes(damage(path.read_bytes()))
    again = read_step(file)
    assert not is_cached(again)
    assert_same(first, again)
    assert is_cached(read_step(file))


def test_entries_of_another_converter_are_ignored(file, folder, monkeypatch, in_process):
    read_step(file)
    monkeypatch.setattr(kept, "converter", lambda: "another version")
    assert not is_cached_whole(read_step(file))


def test_entries_that_lack_something_are_ignored(file, folder, in_process):
    read_step(file)
    for path in folder.iterdir():
        head, arrays = stored.read(path)
        head.pop("faces")
        stored.write(path, head, arrays)
    assert not is_cached(read_step(file))


def test_without_cache_nothing_is_taken_or_kept(file, folder, in_process):
    read_step(file, cache=False)
    assert not folder.exists()
    read_step(file)
    assert not is_cached(read_step(file, cache=False))


def test_a_folder_that_cannot_be_written_does_no_harm(file, tmp_path, monkeypatch, in_process):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv(kept.VARIABLE, str(blocked))
    assert len(read_step(file).patches) == len(read_step(file).patches)


def test_old_entries_go_first(folder, monkeypatch):
    monkeypatch.setattr(kept, "LIMIT", 30_000)
    names = [f"{k}" * 64 for k in range(5)]
    folder.mkdir(parents=True)
    others = [folder / "mine.npz", folder / f"{names[0]}xyz.part"]
    for path in others:
        path.write_bytes(b"\0" * 40_000)  # the user's own, and what another process is writing
    left = folder / f"{names[0]}old.part"  # by a process that was killed
    left.write_bytes(b"\0" * 100)
    os.utime(left, (1.0, 1.0))
    for k, name in enumerate(names):
        kept.put(name, ({"k": k}, {"x": np.zeros(1000)}))
        os.utime(folder / f"{name}.npz", (10.0 + k, 10.0 + k))
        if k:
            assert kept.get(names[1]) is not None  # asked for all the time
    assert kept.get(names[0]) is None
    assert kept.get(names[1]) is not None
    assert kept.get(names[4]) is not None
    assert not left.exists()
    assert all(path.exists() for path in others)
    assert sum(p.stat().st_size for p in folder.iterdir() if p not in others) <= 30_000


@pytest.mark.parametrize("error", [PermissionError(13, "no"), MemoryError()], ids=lambda e: type(e))
def test_entries_out_of_reach_are_not_dropped(error, folder, monkeypatch):
    kept.put("0" * 64, ({}, {}))

    def read(path):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(stored, "read", read)
        assert kept.get("0" * 64) is None
    assert kept.get("0" * 64) is not None


def test_the_command_line_can_do_without(file, folder, capsys, in_process):
    assert main(["inspect", str(file), "--no-cache"]) == 0
    assert not folder.exists()
    assert main(["inspect", str(file)]) == 0
    assert "taken from the cache" not in capsys.readouterr().out
    assert main(["inspect", str(file)]) == 0
    assert "taken from the cache" in capsys.readouterr().out


@pytest.mark.skipif(sys.platform != "linux", reason="the limit is kept by Linux")
def test_memory_has_a_bound(file, capsys):
    with pytest.raises(InputError, match=r"plate\.step: reading takes more memory than 0\.05 GB"):
        read_step(file, memory_gb=0.05, cache=False)
    assert main(["inspect", str(file), "--memory", "0.05", "--no-cache"]) == BAD_INPUT
    assert "0.05 GB (memory_gb)" in capsys.readouterr().err


@pytest.mark.parametrize("memory", [0.0, -1.0, float("nan"), float("inf")])
def test_senseless_bounds_are_refused(memory, file):
    with pytest.raises(InputError, match="memory_gb"):
        read_step(file, memory_gb=memory)


def test_faces_survive_storing(file, in_process):
    """Also what is rarely there: colours, reasons, NaN."""
    model = read_step(file, check_areas=False)
    face = dataclasses.replace(model.faces[0], color=(0.1, 0.2, 0.3), name="ä/ö", reason="why")
    model = dataclasses.replace(model, faces=(face, *model.faces[1:]))
    head, arrays = stored.from_model(model)
    back = stored.to_model((head, arrays)).faces[0]
    assert (back.color, back.name, back.reason) == (face.color, face.name, face.reason)
    assert np.isnan(back.area_error)
