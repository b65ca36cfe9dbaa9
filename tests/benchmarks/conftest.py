"""The harness is a folder of scripts, not a package: its tests import them by name."""

import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module", autouse=True)
def _on_path():
    folder = str(Path(__file__).parent)
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)
