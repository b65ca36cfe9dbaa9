"""Reference scenes and their truths are those of the benchmarks, a folder of scripts."""

import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module", autouse=True)
def _benchmarks_on_path():
    folder = str(Path(__file__).parents[1] / "benchmarks")
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)
