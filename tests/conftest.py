"""Session set-up; runs before anything imports Numba."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import pytest
from patchlight.solver.numba_cache import source_key

# Always keyed by the kernel sources, also below a folder given by the user: otherwise an edited
# kernel would be tested with the old machine code of those that call it.
_KEY = source_key()
_BASE = Path(
    os.environ.get("NUMBA_CACHE_DIR") or Path(tempfile.gettempdir(), f"patchlight-{os.getuid()}")
)
# Workers of pytest-xdist and child processes inherit the folder that the first process chose.
os.environ["NUMBA_CACHE_DIR"] = str(_BASE if _BASE.name == _KEY else _BASE / _KEY)

# Nor is anything of the user's cache read or written; workers share what one of them converted.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _CONVERTED = tempfile.TemporaryDirectory(prefix="patchlight-cache-")
    os.environ["PATCHLIGHT_CACHE_DIR"] = _CONVERTED.name
# Workers of pytest-xdist compile side by side as it is.
os.environ.setdefault("PATCHLIGHT_COMPILE_PROCESSES", "0")

# No test may open a window.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

#: Processes that the whole suite is spread over: one compiles while others do without kernels.
_WORKERS = min(4, len(os.sched_getaffinity(0)))
#: Files that start first, in this order: one that compiles the kernels of the solver, then long
#: ones that need none of these, then those that compile others.
_FIRST = (
    "test_closed_forms",
    "test_corpus",
    "test_run_folder",
    "test_report_html",
    "test_step",
    "test_cli",
    "test_form_factors",
    "test_simulation",
    "test_camera",
)


def _is_whole(config: pytest.Config) -> bool:
    """Whether the run is of the whole suite, not of some files or tests, nor watched by hand."""
    option = config.option
    chosen = (
        config.args_source is not config.ArgsSource.TESTPATHS
        or option.keyword
        or option.markexpr != "not slow"  # the default in pyproject.toml
    )
    watched = option.usepdb or option.collectonly or option.capture == "no"
    return not chosen and not watched and not option.maxfail


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Spread the whole suite over some processes, unless ``-n`` tells how many (0: this one)."""
    option = config.option
    if "PYTEST_XDIST_WORKER" in os.environ:
        return  # a worker, which would start workers of its own without end
    if getattr(option, "numprocesses", 0) is None and _WORKERS > 1 and _is_whole(config):
        option.numprocesses, option.dist, option.loadscopereorder = _WORKERS, "loadfile", False
        # Tests on numbers of threads need two.
        cores = len(os.sched_getaffinity(0))
        os.environ.setdefault("NUMBA_NUM_THREADS", str(max(2, cores // _WORKERS)))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In several processes, start with what takes longest; files stay whole."""
    if hasattr(config, "workerinput"):
        rank = {name: k for k, name in enumerate(_FIRST)}
        items.sort(key=lambda item: rank.get(item.path.stem, len(_FIRST)))


@pytest.fixture(autouse=True)
def nothing_kept_between_tests():
    """What a test counts must not depend on the tests before it."""
    yield
    store = sys.modules.get("patchlight.solver.store")
    if store is not None:
        store.forget()
