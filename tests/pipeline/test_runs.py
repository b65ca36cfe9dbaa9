"""Whole runs: they compile the solver's kernels, so they are slow the first time."""

from __future__ import annotations

import csv
import json

import pytest
from patchlight.pipeline import Emitter, PatchSet, Scene, SensorGrid, simulate
from patchlight.pipeline.cli import main
from patchlight.solver.model.reached import accuracy_reached

pytestmark = pytest.mark.slow


@pytest.fixture
def air_step(tmp_path, monkeypatch):
    """A volume of air, 4 x 3 x 2.8 m, with a table and a ball in it."""
    cq = pytest.importorskip("cadquery")
    monkeypatch.chdir(tmp_path)
    air = cq.Assembly(name="air")
    air.add(cq.Workplane().box(4000, 3000, 2800), name="volume")
    air.add(cq.Workplane().box(800, 800, 700).translate((0, 0, -1050)), name="table")
    air.add(cq.Workplane().sphere(200).translate((1000, 0, 0)), name="ball")
    air.export(str(tmp_path / "air.step"))
    return tmp_path / "air.step"


SCENE = """\
schema_version = 1
accuracy = 0.2
[[model]]
file = "air.step"
[[assign]]
parts = "volume"
air = true
[[assign]]
parts = "ball"
emitter = { flux_lm = 1000 }
[[sensors]]
name = "g"
z_m = -0.5
spacing_m = 1.0
[[requirements]]
sensors = "g"
metric = "E_avg_lx"
min = 1e6
"""


def test_bare_file_finds_the_air_and_says_so(air_step, capsys):
    code = main(["run", "air.step", "--accuracy", "0.3", "--json"])
    captured = capsys.readouterr()
    assert code in (0, 3)
    assert "volume of air" in captured.err and "THE INTERIOR IS CLOSED" in captured.err
    printed = json.loads(captured.out)
    mean = next(m["value"] for m in printed["metrics"] if m["id"] == "E_avg_lx")
    assert mean > 1.0
    folder = air_step.parent / "air-patchlight"
    for name in ("run.json", "report.html", "config.resolved.toml", "log.jsonl", "metrics.csv"):
        assert (folder / name).stat().st_size > 0
    assert list((folder / "images").glob("*.exr"))


def test_check_fails_on_a_requirement(air_step, capsys):
    (air_step.parent / "s.toml").write_text(SCENE)
    code = main(["run", "s.toml", "--check", "-o", "out"])
    out = capsys.readouterr().out
    assert "fail: g E_avg_lx" in out
    assert code in (1, 3)
    assert main(["run", "s.toml", "-o", "out"]) in (0, 3)  # the same inputs may be run again


def test_batch_goes_on_after_failures_and_keeps_what_is_done(air_step, capsys):
    (air_step.parent / "bad.step").write_text("hello")
    (air_step.parent / "s.toml").write_text(SCENE)
    argv = ["batch", ".", "-o", "out", "--scene", "s.toml", "--accuracy", "0.5"]
    assert main(argv) == 4
    out = capsys.readouterr().out
    assert "bad.step: " in out
    rows = list(csv.DictReader((air_step.parent / "out" / "summary.csv").open()))
    assert {row["file"]: row["status"] for row in rows}["bad.step"] == "failed"
    good = next(row for row in rows if row["file"] == "air.step")
    assert good["report"] == "air/report.html" and float(good["g.E_avg_lx"]) > 1.0
    if good["status"] == "ok":
        before = (air_step.parent / "out" / "air" / "run.json").stat().st_mtime_ns
        main(argv)
        assert (air_step.parent / "out" / "air" / "run.json").stat().st_mtime_ns == before


def test_the_method_of_1993_by_command_line_scene_file_and_call(air_step, capsys, monkeypatch):
    (air_step.parent / "s.toml").write_text(SCENE.replace("0.2", '0.5\nmethod = "nn93"'))
    asked = []
    monkeypatch.setattr(
        "patchlight.pipeline.runs.simulate",
        lambda scene, **how: asked.append(how["method"]) or simulate(scene, **how),
    )
    assert main(["run", "s.toml", "-o", "out"]) in (0, 3)
    told = json.loads((air_step.parent / "out" / "run.json").read_text())
    assert told["settings"]["method"] == "nn93"
    assert main(["run", "s.toml", "-o", "other", "--method", "default"]) in (0, 3)
    written = (air_step.parent / "other" / "config.resolved.toml").read_text()
    assert asked == ["nn93", "default"] and 'method = "default"' in written


def test_simulate_carries_requirements_and_progress():
    scene = Scene()
    scene.add(PatchSet.box((2, 2, 2), (0, 0, 1), inward=True), "room")
    scene.add(PatchSet.disk((0, 0, 1.9), 0.2, (0, 0, -1)), "lamp")
    scene.assign("lamp", Emitter(flux_lm=1000))
    scene.add(SensorGrid.on_plane("g", z=0.5, spacing=1.0))
    scene.require("g", "E_avg_lx", min=1.0)
    stages = []
    result = simulate(scene, accuracy=0.1, progress=lambda stage, done, total: stages.append(stage))
    assert result.settings["requirements"] == [{"sensors": "g", "metric": "E_avg_lx", "min": 1.0}]
    assert result.settings["started"] <= result.settings["ended"]
    assert stages
    assert (accuracy_reached(result) <= 0.1) == result.converged
    assert result.sensors["g"].metrics["E_avg_lx"] > 1.0
