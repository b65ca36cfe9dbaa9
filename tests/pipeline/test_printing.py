"""What `run` prints and returns for results good and bad, without any computation."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from patchlight.pipeline.cli import main
from patchlight.pipeline.runs import Run
from patchlight.solver.model import SensorResult
from patchlight.solver.model.reached import accuracy_message


def grid(name, values, errors):
    """Sensors 1 m apart along x at 0.8 m."""
    n = len(values)
    return SensorResult(
        name=name,
        points=np.column_stack([np.arange(n) + 0.5, np.full(n, 2.0), np.full(n, 0.8)]),
        normals=np.tile([0.0, 0.0, 1.0], (n, 1)),
        area_m2=np.ones(n),
        illuminance_lx=np.array(values, dtype=float),
        error_lx=np.array(errors, dtype=float),
        components={"lamp.direct": np.array(values, dtype=float)},
    )


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run the command line on a result of `grids` and requirements; code, stdout and stderr."""

    def run(grids, *options, requirements=(), converged=True, accuracy=0.05):
        result = SimpleNamespace(
            sensors={g.name: g for g in grids},
            settings={"accuracy": accuracy, "requirements": list(requirements)},
            converged=converged,
            scene=SimpleNamespace(faces=(), patches=()),
            balance=SimpleNamespace(residual_fraction=0.0),
            warnings=(),
        )
        done = Run(result, tmp_path, 1.0)
        monkeypatch.setattr("patchlight.pipeline.runs.run_file", lambda *_: done)
        code = main(["run", "a.step", *options])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


PLANE = grid("plane", [100.0, 500.0, 12000.0], [1.0, 5.0, 100.0])
LATE = grid("wall", [100.0, 50.0, 200.0], [5.02, 10.0, 2.0])
FAILS = {"sensors": "plane", "metric": "E_min_lx", "min": 300.0}
OPEN = {"sensors": "plane", "metric": "E_min_lx", "min": 100.5}
MET = {"sensors": "plane", "metric": "E_min_lx", "min": 50.0}


@pytest.mark.parametrize(
    ("requirements", "check", "converged", "code"),
    [
        ([MET], True, True, 0),
        ([FAILS], True, True, 1),
        ([FAILS], False, True, 0),
        ([MET], True, False, 3),
        # A failure holds whatever the error is, so that no accuracy would turn it ...
        ([FAILS], True, False, 1),
        ([FAILS], False, False, 3),
        # ... which is not so while the bound lies within the error.
        ([OPEN], True, False, 3),
        ([OPEN, FAILS], True, False, 1),
    ],
)
def test_a_failed_requirement_counts_before_the_accuracy(run, requirements, check, converged, code):
    options = ["--check"] if check else []
    found, _, _ = run([PLANE, LATE], *options, requirements=requirements, converged=converged)
    assert found == code


def test_the_grid_that_misses_the_accuracy_is_named():
    # Of three sensors the 95 % quantile from below is the middle one, 5.02 of 100 lx.
    assert accuracy_message({g.name: g for g in (PLANE, LATE)}, 0.05) == (
        "accuracy 0.05 was not reached: wall 0.051, above it at 2 of 3 sensors, worst "
        "50.00 ± 10 lx at (1.5, 2, 0.8) m"
    )


def test_every_grid_that_misses_is_named():
    other = grid("floor", [10.0, 20.0, 30.0], [1.0, 2.0, 3.0])
    said = accuracy_message({g.name: g for g in (LATE, PLANE, other)}, 0.05)
    assert "wall 0.051" in said and "floor 0.1," in said and "plane" not in said


def test_json_holds_the_accuracy_of_each_grid(run):
    _, out, _ = run([PLANE, LATE], "--json", converged=False)
    said = json.loads(out)
    assert said["accuracy_reached_by_grid"] == pytest.approx({"plane": 0.01, "wall": 0.0502})
    assert said["accuracy_reached"] == pytest.approx(0.0502)


def test_numbers_are_written_out(run):
    high = grid("plane", [10000.0, 1234567.0], [0.0, 1500.0])
    asked = {"sensors": "plane", "metric": "E_max_lx", "max": 1e6}
    _, out, _ = run([high], requirements=[asked])
    lines = out.splitlines()
    assert "  E_min_lx           10000 lx" in lines
    assert "  E_max_lx           1234600 ± 1500 lx" in lines
    assert "fail: plane E_max_lx = 1234600 ± 1500 lx, asked <= 1000000" in lines
    assert "e+" not in out


def test_rounding_is_nothing(run):
    dark = grid("plane", [3e-15, 4e-15], [1e-17, 1e-17])
    _, out, _ = run([dark])
    assert "  E_avg_lx           0 lx" in out.splitlines()
