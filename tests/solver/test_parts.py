"""Kernels called by kernels: same numbers and errors, and machine code for the outermost only."""

from __future__ import annotations

import importlib.util
import math
import subprocess
import sys

import numpy as np
import pytest
from numba import config
from numba.core import codegen
from patchlight.solver.kernels import compiled, parts

KERNELS = """
import math
import numba as nb
import numpy as np
from patchlight.solver.kernels.compiled import kernel, lean, parallel

@lean
def lowest(x):
    return math.sin(x) + 0.1 * x

@lean
def middle(x):
    return lowest(x) * lowest(x + 1.0)

@kernel
def taken(n):
    return np.full(n, 0.5)

@kernel
def highest(values, n):
    total = taken(n)[0]
    for k in range(values.shape[0]):
        total += middle(values[k])
    return total

@parallel
def over_rows(values, n, out):
    for i in nb.prange(out.shape[0]):
        out[i] = highest(values[i], n)
"""
VALUES = np.linspace(-2.0, 3.0, 12).reshape(3, 4)

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


def expected(values: np.ndarray) -> float:
    """The same in Python, in the same order: no rounding apart, but for that of the sine."""
    total = 0.5
    for x in values:
        a, b = (math.sin(t) + 0.1 * t for t in (x, x + 1.0))
        total += a * b
    return total


@pytest.fixture
def load(tmp_path):
    """Functions of `KERNELS` that nothing has been compiled of."""
    path = tmp_path / "some_kernels.py"
    path.write_text(KERNELS)

    def load():
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module  # where Numba looks for what it loads from disk
        spec.loader.exec_module(module)
        return module

    yield load
    sys.modules.pop(path.stem, None)


@pytest.fixture
def optimised(monkeypatch):
    """Names of the libraries that LLVM has optimised as a whole."""
    names: list[str] = []
    inner = codegen.CPUCodeLibrary._optimize_final_module

    def count(library):
        names.append(library.name)
        inner(library)

    monkeypatch.setattr(codegen.CPUCodeLibrary, "_optimize_final_module", count)
    return names


def test_installed_numba_has_what_parts_take():
    assert parts.is_possible()


def test_only_what_python_calls_is_optimised(load, optimised):
    some = load()
    out = np.empty(3)
    some.over_rows(VALUES, 2, out)
    np.testing.assert_allclose(out, [expected(row) for row in VALUES], rtol=1e-14)
    own = ("lowest", "middle", "taken", "highest", "over_rows", "gufunc", "gufuncwrapper")
    assert [name for name in optimised if any(word in name for word in own)] == ["over_rows"]
    # Called from Python they are compiled after all, to the same bits.
    assert some.highest(VALUES[1], 2) == out[1]
    assert some.lowest(1.0) == math.sin(1.0) + 0.1
    assert {"highest", "lowest"} <= set(optimised) and "middle" not in optimised


def test_without_parts_the_bits_are_the_same(load, optimised, monkeypatch):
    with_parts = load().highest(VALUES[0], 1)
    assert "middle" not in optimised
    monkeypatch.setattr(compiled, "_PARTS", False)
    for name in ("kernel", "lean", "parallel"):
        options = {"_nrt": name != "lean"} | ({"parallel": True} if name == "parallel" else {})
        monkeypatch.setattr(compiled, name, compiled._compiled(**options))
    some = load()
    some.highest._cache.disable()
    assert some.highest(VALUES[0], 1) == with_parts
    assert "middle" in optimised


def test_errors_of_parts_reach_python(load):
    some = load()
    with pytest.raises(ValueError, match="negative dimensions"):
        some.highest(VALUES[0], -1)


def test_another_process_takes_them_from_disk(load, tmp_path):
    here = load().highest(VALUES[2], 1)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "import numpy as np, some_kernels\n"
        "values = np.linspace(-2.0, 3.0, 12).reshape(3, 4)[2]\n"
        "hits = some_kernels.highest.stats.cache_hits\n"
        "print(some_kernels.highest(values, 1).hex(), sum(hits.values()))\n"
        "try: some_kernels.highest(values, -1)\n"
        "except ValueError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"{here.hex()} 1", "negative dimensions not allowed"]
