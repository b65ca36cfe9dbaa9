"""The demo office agrees with Radiance."""

import json
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_demo_agrees_with_radiance(tmp_path):
    pytest.importorskip("pyradiance")
    pytest.importorskip("cadquery")
    script = Path(__file__).with_name("demo_radiance.py")
    command = [
        sys.executable,
        str(script),
        "--quick",
        "--accuracy",
        "0.05",
        "--output",
        str(tmp_path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "demo_radiance.json").read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in report["rows"]}
    # Direct light has no mesh in it: what remains is Radiance's noise and the cut of the lamps.
    for name in ("lamps.direct", "sky.direct"):
        row = rows[name]
        noise = 3.0 * row["radiance_noise_lx"]
        difference = abs(row["patchlight_lx"] - row["radiance_lx"])
        assert difference <= 0.01 * row["radiance_lx"] + noise, name
    assert rows["ground.direct"]["patchlight_lx"] == 0.0
