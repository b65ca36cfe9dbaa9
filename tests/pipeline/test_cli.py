"""Exit codes and messages of the command line, before anything is computed."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from patchlight.pipeline.cli import BAD_INPUT, main
from patchlight.pipeline.output import prepare_output
from patchlight.solver.errors import OutputError

HEAVY = ("OCP", "cadquery", "vtk", "vtkmodules", "pyvista", "numba", "matplotlib", "colour")
HEAVY += ("pandas", "scipy", "xarray", "pvlib", "shapely", "OpenEXR")


@pytest.mark.parametrize(
    "code",
    [
        "import patchlight.pipeline, patchlight.importers, patchlight.reports",
        "from patchlight.pipeline import Scene, SensorGrid, simulate, load_scene, Material, batch",
        "from patchlight.pipeline.cli import main; assert main(['--help']) == 0",
        "from patchlight.pipeline.cli import main; assert main(['run', '--help']) == 0",
        "from patchlight.pipeline.cli import main; assert main(['year', '--help']) == 0",
        "from patchlight.pipeline import simulate_year",
        "from patchlight.pipeline.cli import main; assert main(['doctor']) == 0",
        "from patchlight.pipeline.cli import main; assert main(['schema']) == 0",
    ],
)
def test_nothing_heavy_is_loaded(code):
    report = f"import sys; print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; {report}"], capture_output=True, text=True, check=True
    )
    assert done.stderr.strip().splitlines()[-1] == "[]"


STEP_HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('a','2020-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));
ENDSEC;
DATA;
"""
BAD_STEPS = {
    "empty.step": "",
    "text.step": "hello\n",
    "truncated.step": STEP_HEAD + "#1=CARTESIAN_POINT('',(0.,0.,0.));\n",
    "no-faces.step": STEP_HEAD + "ENDSEC;\nEND-ISO-10303-21;\n",
}


@pytest.fixture
def bad_steps(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in BAD_STEPS.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def fails_with_one_line(capsys, *argv):
    """Run; check code 2, silence on stdout and a single line on stderr; return the line."""
    assert main([str(a) for a in argv]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("patchlight: ")
    return lines[0]


@pytest.mark.parametrize("name", [*BAD_STEPS, "missing.step", "missing.toml"])
def test_files_that_cannot_be_run(bad_steps, capsys, name):
    assert name in fails_with_one_line(capsys, "run", name)
    assert not list(bad_steps.glob("*-patchlight"))  # no empty output folder stays behind
    if name.endswith(".step"):
        assert name in fails_with_one_line(capsys, "inspect", name)


def test_inspect_prints_parts_and_certificate(tmp_path, capsys):
    cq = pytest.importorskip("cadquery")
    model = cq.Assembly(name="things")
    model.add(cq.Workplane().box(400, 300, 200), name="box")
    model.export(str(tmp_path / "things.step"))
    assert main(["inspect", str(tmp_path / "things.step"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [part["path"] for part in said["parts"]] == ["box"]
    assert said["certificate"]["faces_exact"] == said["certificate"]["faces_total"] == 6
    assert main(["inspect", str(tmp_path / "things.step")]) == 0
    assert "box  (solid" in capsys.readouterr().out


def test_other_files_and_folders(bad_steps, capsys):
    (bad_steps / "notes.txt").write_text("x")
    assert "notes.txt" in fails_with_one_line(capsys, "run", "notes.txt")
    (bad_steps / "folder.step").mkdir()
    assert "folder.step" in fails_with_one_line(capsys, "run", "folder.step")


@pytest.mark.parametrize(
    ("argv", "word"),
    [
        (["run"], "FILE"),
        (["run", "text.step", "--colour", "red"], "--colour"),
        (["run", "text.step", "--accuracy", "much"], "accuracy"),
        (["run", "text.step", "--accuracy", "nan"], "accuracy"),
        (["run", "text.step", "--accuracy", "0"], "accuracy"),
        (["run", "text.step", "--threads", "0"], "threads"),
        (["run", "text.step", "--up", "w"], "up"),
        (["frobnicate"], "frobnicate"),
        (["demo", "castle"], "castle"),
        (["batch", "-o", "out"], "batch"),
        (["batch", "nowhere", "-o", "out"], "nowhere"),
        (["batch", "text.step", "-o", "out", "--jobs", "0"], "jobs"),
        (["batch", "text.step", "-o", "out", "--scene", "none.toml"], "none.toml"),
    ],
)
def test_wrong_usage(bad_steps, capsys, argv, word):
    assert word in fails_with_one_line(capsys, *argv)


def test_scene_files_fix_their_models(bad_steps, capsys):
    text = 'schema_version = 1\n[[model]]\nfile = "text.step"\n'
    (bad_steps / "s.toml").write_text(text)
    assert "--scale" in fails_with_one_line(capsys, "run", "s.toml", "--scale", "2")
    assert "--scene" in fails_with_one_line(capsys, "run", "s.toml", "--scene", "s.toml")


@pytest.mark.parametrize(
    ("table", "word"),
    [
        ('[[assign]]\nparts = "x"\nmaterial = { reflectance = nan }', "reflectance"),
        ('[[assign]]\nparts = "x"\nmateriel = { reflectance = 0.5 }', "materiel"),
    ],
)
def test_one_problem_in_a_scene_file_is_one_line(bad_steps, capsys, table, word):
    text = f'schema_version = 1\n[[model]]\nfile = "text.step"\n{table}\n'
    (bad_steps / "s.toml").write_text(text)
    if "materiel" in table:
        text = text.replace("materiel", "material = {}\nmateriel")
        (bad_steps / "s.toml").write_text(text)
    assert word in fails_with_one_line(capsys, "run", "s.toml")


def test_output_folder_is_tried_before_reading(bad_steps, capsys, monkeypatch):
    def must_not_read(*_, **__):
        raise AssertionError("the model was read before the output folder was tried")

    monkeypatch.setattr("patchlight.importers.read_step", must_not_read)
    below_a_file = bad_steps / "text.step" / "out"
    line = fails_with_one_line(capsys, "run", "text.step", "-o", below_a_file)
    assert "cannot be written" in line


def test_folders_of_other_things_need_force(tmp_path):
    model = tmp_path / "a.step"
    model.write_text("a")
    out = tmp_path / "out"
    prepare_output(out, [model])
    (out / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="notes.txt"):
        prepare_output(out, [model])
    record = {"inputs": [{"path": str(tmp_path / "b.step"), "sha256": "0"}]}
    (out / "run.json").write_text(json.dumps(record))
    with pytest.raises(OutputError, match=r"b\.step"):
        prepare_output(out, [model])
    prepare_output(out, [tmp_path / "b.step"])  # the same file, whatever is in it now
    prepare_output(out, [model], force=True)


def test_interrupt_is_130(bad_steps, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("patchlight.importers.read_step", interrupted)
    assert main(["run", "text.step"]) == 130
    assert not list(bad_steps.glob("*-patchlight"))


def test_version(capsys):
    from importlib.metadata import version

    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == version("patchlight")


@pytest.fixture(scope="module")
def demo_scene(tmp_path_factory):
    pytest.importorskip("cadquery")
    from patchlight.pipeline import load_scene
    from patchlight.pipeline.demo import write_demo

    return load_scene(write_demo("office", tmp_path_factory.mktemp("demo")))


def test_demo_model_has_curved_faces(demo_scene):
    model = demo_scene.entries["office"].model
    curved = [f for f in model.faces if f.kind != "plane"]
    assert len(model.faces) >= 60 and len(curved) >= 20
    assert model.certificate.faces_failed == 0
    paths = {p.path for p in model.parts}
    assert {"room", "frame", "column", "lamp:1", "lamp:2", "desk:1/top"} <= paths
    assert sum(p.startswith("chair:") and "/leg:" in p for p in paths) == 16
    assert all(p.color is not None and p.kind == "solid" for p in model.parts)


def test_demo_scene_file_fits_its_model(demo_scene):
    data = demo_scene.freeze()
    assert not data.default_faces.any()
    assert data.groups == ("lamps", "sky", "ground")
    assert sum(lamp.flux_lm for lamp in data.luminaires) == pytest.approx(6400)
    assert 40 <= len(data.sensors[0]) <= 120
    from patchlight.solver.placement import check_placement

    assert check_placement(data) == ()


def test_no_traceback_from_a_process(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "patchlight.pipeline.cli", "run", str(tmp_path / "no.step")],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr and "no such file" in done.stderr


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (("--timeout", "0.001"), "not read within 0.001 s"),
        (("--memory", "0.05"), "more memory than 0.05 GB"),
        (("--timeout", "0"), "timeout_s = 0.0: must be above 0 and finite"),
    ],
    ids=lambda x: x[0][2:] if isinstance(x, tuple) else None,
)
@pytest.mark.parametrize("kind", ["step", "toml"])
def test_reading_has_limits(kind, limit, said, tmp_path, capsys):
    import cadquery as cq

    model, scene = tmp_path / "box.step", tmp_path / "scene.toml"
    cq.exporters.export(cq.Workplane().box(3000, 3000, 3000), str(model))
    scene.write_text('schema_version = 1\n[[model]]\nfile = "box.step"\n')
    file = model if kind == "step" else scene
    assert main(["run", str(file), "-o", str(tmp_path / "out"), "--no-cache", *limit]) == BAD_INPUT
    assert said in capsys.readouterr().err


def test_a_scene_that_is_refused_still_draws_the_hint_of_a_wrong_unit(tmp_path, capsys):
    import cadquery as cq

    room = cq.Workplane().box(4000, 6000, 3000).faces("<Z").shell(-100)
    cq.exporters.export(room, str(tmp_path / "office.step"))
    (tmp_path / "scene.toml").write_text(
        'schema_version = 1\n[[model]]\nfile = "office.step"\nunit = "m"\n'
        '[[sensors]]\nname = "desk"\nz_m = 0.8\n'
    )
    assert main(["inspect", str(tmp_path / "office.step"), "--unit", "m"]) == 0
    (hint,) = capsys.readouterr().err.strip().splitlines()
    assert "6000 m long" in hint and "length unit" in hint
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out")]) == BAD_INPUT
    first, second = capsys.readouterr().err.strip().splitlines()
    assert first.endswith(hint.removeprefix("warning: "))
    assert second.startswith("patchlight: sensors 'desk'")
