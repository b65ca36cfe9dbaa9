"""The list of kernels that are compiled ahead is what a run of the demo calls."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from patchlight.solver.compile_ahead import LIST
from patchlight.solver.kernels import compiled


@pytest.mark.slow
@pytest.mark.skipif(compiled._SHARED_CACHE is None, reason="nothing is compiled ahead")
def test_the_demo_calls_what_is_listed(tmp_path):
    """No more, which would be compiled in vain, and no less; written anew as the script tells."""
    script = Path(__file__).with_name("first_kernels.py")
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    found, listed = (
        {line for line in text.splitlines() if not line.startswith("#")}
        for text in (done.stdout, LIST.read_text(encoding="utf-8"))
    )
    assert found == listed
