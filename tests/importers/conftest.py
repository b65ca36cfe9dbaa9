"""Fixtures: models built in CadQuery, and the folder of real STEP files when there is one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Folder of real files; the tests that need it skip without it."""
    folder = os.environ.get("PATCHLIGHT_CORPUS")
    if not folder or not (Path(folder) / "step").is_dir():
        pytest.skip("PATCHLIGHT_CORPUS is not set")
    return Path(folder)
