"""The harness of the large halls: the scene, and a run of the smallest."""

import json
import sys

import numpy as np
import pytest


@pytest.mark.parametrize("side", [1, 3])
def test_halls_grow_by_desks(side):
    from large_room import CELL, EXITANCE, HEIGHT, large_room

    scene = large_room(side)
    lamps = ((side + 1) // 2) ** 2
    # Desk: top 6, 4 legs of 4 + 5 + 5, screen 6, drawers 6; lamp: 6.
    assert len(scene.patches) == 6 + side**2 * (6 + 56 + 12) + 6 * lamps
    assert scene.luminaires[0].flux_lm == pytest.approx(EXITANCE * 1.44 * lamps)
    low, high = scene.patches.bounds()
    np.testing.assert_allclose(high - low, [CELL * side, CELL * side, HEIGHT], rtol=1e-12)


@pytest.mark.slow
def test_a_run_is_measured_and_drawn(tmp_path, monkeypatch):
    import large

    monkeypatch.setattr(large, "alone", large.measure)  # not in a process of its own
    monkeypatch.setattr(
        sys, "argv", ["large.py", "-o", str(tmp_path), "--desks", "1", "--accuracy", "0.4"]
    )
    large.main()
    (run,) = json.loads((tmp_path / "large.json").read_text())["runs"]
    assert run["elements"] >= run["patches"] and run["peak_bytes"] > run["matrix_bytes"]
    assert not run["packed"] and run["mean_lx"] > 100.0
    assert (tmp_path / "large.png").stat().st_size > 10_000
