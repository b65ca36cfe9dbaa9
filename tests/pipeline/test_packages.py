"""What holds for all packages: public names, and where compiled kernels are kept."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import subprocess
import sys
import types
from pathlib import Path

import pytest
from patchlight.pipeline import simulation
from patchlight.pipeline.doctoring import doctor_lines
from patchlight.pipeline.simulation import announce_kernels
from patchlight.solver import compile_ahead, numba_cache

PACKAGES = ("importers", "pipeline", "reports", "solver", "solver.model")


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_are_never_modules(package):
    """A submodule hides a function of its name as soon as anything has imported the submodule."""
    module = importlib.import_module(f"patchlight.{package}")
    public = set(getattr(module, "__all__", ()))
    assert not public & {info.name for info in pkgutil.iter_modules(module.__path__)}
    assert not [name for name in public if inspect.ismodule(getattr(module, name))]


def cache_folder(tmp_path: Path, **environment: str) -> Path:
    """Where a kernel imported by a script of its own would be kept."""
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    code = (
        "from patchlight.solver.kernels.sky_luminance import sky_luminance\n"
        "print(sky_luminance._cache.cache_path)"
    )
    env = kept | {"XDG_CACHE_HOME": str(tmp_path / "user")} | environment
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
    )
    return Path(done.stdout.strip())


def test_kernels_of_a_plain_script_are_keyed_by_all_sources(tmp_path):
    assert cache_folder(tmp_path).parent.name == f"numba-{numba_cache.source_key()}"


def test_cache_folder_of_the_user_wins(tmp_path):
    mine = tmp_path / "mine"
    assert cache_folder(tmp_path, NUMBA_CACHE_DIR=str(mine)).parent == mine


def test_key_changes_with_any_kernel(tmp_path, monkeypatch):
    for name in ("a.py", "b.py"):
        (tmp_path / name).write_text(name)
    monkeypatch.setattr(numba_cache, "KERNELS", tmp_path)
    keys = {numba_cache.source_key()}
    for name in ("a.py", "b.py"):
        (tmp_path / name).write_text("changed")
        keys.add(numba_cache.source_key())
    assert len(keys) == 3


def test_folder_that_cannot_be_written_is_passed_over(tmp_path, monkeypatch):
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "__pycache__").write_text("in the way")
    monkeypatch.setattr(numba_cache, "KERNELS", kernels)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    folder, warm = numba_cache.use_cache_folder()
    assert folder.parent == tmp_path / "user" / "patchlight"
    assert not warm


def forget_what_was_said(monkeypatch):
    monkeypatch.setattr(simulation, "_SAID", set())
    monkeypatch.setattr(compile_ahead, "_LOOKED_AT", {})


def test_first_run_says_once_that_it_compiles(tmp_path, monkeypatch, capsys):
    forget_what_was_said(monkeypatch)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    if (numba := sys.modules.get("numba")) is not None:
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
        monkeypatch.setattr(numba.config, "DISABLE_JIT", 0)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    told = []
    for progress in (None, None, lambda *state: told.append(state)):
        announce_kernels(progress)
    assert capsys.readouterr().err.count("compiled") == 1 and not told
    forget_what_was_said(monkeypatch)
    for progress in (lambda *state: told.append(state), lambda *state: told.append(state), None):
        announce_kernels(progress)
    assert told == [("compiling kernels (once)", 0, 1)] and not capsys.readouterr().err
    forget_what_was_said(monkeypatch)
    compile_ahead.compile_ahead()
    (tmp_path / "kernel.nbi").touch()  # as other processes do in the meantime
    announce_kernels(None)
    assert capsys.readouterr().err.count("compiled") == 1
    forget_what_was_said(monkeypatch)
    announce_kernels(None)
    assert not capsys.readouterr().err


@pytest.mark.parametrize("imported", [False, True])
@pytest.mark.parametrize("value, said", [("1", 0), ("0", 1), ("yes", 1)])
def test_nobody_says_that_it_compiles_where_nothing_is(
    value, said, imported, tmp_path, monkeypatch, capsys
):
    """Numba reads numbers only: of other values it warns, and compiles."""
    forget_what_was_said(monkeypatch)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", value)
    if imported:
        config = types.SimpleNamespace(CACHE_DIR=str(tmp_path), DISABLE_JIT=int(not said))
        monkeypatch.setitem(sys.modules, "numba", types.SimpleNamespace(config=config))
    else:
        monkeypatch.delitem(sys.modules, "numba", raising=False)
    announce_kernels(None)
    assert capsys.readouterr().err.count("compiled") == said
    assert ("NUMBA_DISABLE_JIT" in doctor_lines()[-1]) == (not said)
