"""The harness of the conference room: errors of rows, the mesh, and a run on a coarse mesh."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parent


def test_errors_of_rows_are_those_of_the_light_they_gather():
    from conference_truth import Truth, row_errors, strict_check

    true = np.array([[0.5, 0.5, 0.0], [0.2, 0.2, 0.2]])
    low, high = true[:1] - 0.01, true[:1] + 0.03
    truth = Truth({}, true, np.array([[0.0, 0.01, 0.0], [0.0, 0.0, 0.0]]), low, high)
    exitance, emitted = np.array([1.0, 1.0, 10.0]), np.array([0.0, 0.0, 8.0])
    found = np.array([[0.5, 0.51, 0.0], [0.2, 0.2, 0.23]])
    errors = row_errors(truth, found, exitance, emitted)
    # Row 0 gathers 1.01 for 1, row 1 2.7 for 2.4; only row 1 sees the lamp, 1.84 for 1.6.
    assert errors["row_error"]["max"] == pytest.approx(0.125)
    assert errors["row_error"]["median"] == pytest.approx(0.5 * (0.01 + 0.125))
    assert errors["lamps_error"]["rows"] == 1
    assert errors["lamps_error"]["median"] == pytest.approx(0.15)
    assert errors["truth_deviation"]["max"] == pytest.approx(0.1)
    bracket = strict_check(truth, np.ones(3))
    assert bracket["rows"] == 1 and bracket["beyond"]["max"] == 0.0
    assert bracket["half_width"]["median"] == pytest.approx(0.06)
    assert bracket["from_middle"]["median"] == pytest.approx(0.03)


def test_mesh_has_nearly_the_elements_asked_for():
    from conference import mesh_to
    from patchlight.solver.model import PatchSet

    total = int(mesh_to(PatchSet.box((4.0, 3.0, 2.5), inward=True), 1000).prod(axis=1).sum())
    # A row of elements more on one of the walls changes their number by some 40 each.
    assert abs(total - 1000) <= 80


@pytest.mark.slow
def test_coarse_room_through_the_harness(tmp_path):
    pytest.importorskip("cadquery")
    command = [sys.executable, str(FOLDER / "conference.py"), "-o", str(tmp_path)]
    command += ["--elements", "932", "--rows", "8", "--accuracy", "0.1", "0.05"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "conference.json").read_text(encoding="utf-8"))
    assert report["patches"] == 932 and len(report["runs"]) == 2
    for run in report["runs"]:
        # Twice what it is at the quicker setting.
        assert run["row_error"]["median"] < 1e-2
        assert run["wall_s"] > 0.0 and run["cpu_s"] > 0.0
    assert (tmp_path / "conference.png").stat().st_size > 0
